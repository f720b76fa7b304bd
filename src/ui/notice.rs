//! Messages: errors stay until dismissed, others go away after a while.

use std::time::Duration;

/// Kind of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoticeKind {
    /// Something failed; the text says what to do.
    Error,
    /// An action has succeeded.
    Done,
}

/// A message to the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// Kind of the message.
    pub kind: NoticeKind,
    /// Text of the message.
    pub text: String,
    /// Number of repetitions.
    pub count: u64,
    /// Time at which it goes away; set when it is first on the screen.
    until: Option<Duration>,
}

/// Time that a message of kind `Done` stays.
const STAYS: Duration = Duration::from_secs(10);

/// Drops messages whose time is over; the time until the next one is.
pub(super) fn pass(notices: &mut Vec<Notice>, now: Duration) -> Option<Duration> {
    for notice in notices.iter_mut().filter(|notice| notice.kind == NoticeKind::Done) {
        notice.until.get_or_insert(now.saturating_add(STAYS));
    }
    notices.retain(|notice| notice.until.is_none_or(|until| until > now));
    notices.iter().filter_map(|notice| notice.until?.checked_sub(now)).min()
}

/// Largest number of messages; the oldest are dropped.
const NOTICES_MAX: usize = 4;

/// Adds a message; a repeated one is counted, and only the last one of kind `Done` stays.
pub(super) fn add(notices: &mut Vec<Notice>, kind: NoticeKind, text: String) {
    if let Some(known) = notices.iter_mut().find(|n| n.kind == kind && n.text == text) {
        (known.count, known.until) = (known.count + 1, None);
        return;
    }
    if kind == NoticeKind::Done {
        notices.retain(|n| n.kind != NoticeKind::Done);
    }
    notices.push(Notice { kind, text, count: 1, until: None });
    let excess = notices.len().saturating_sub(NOTICES_MAX);
    notices.drain(..excess);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_message_is_counted_and_old_ones_go() {
        let mut notices = Vec::new();
        for text in ["a", "b", "a"] {
            add(&mut notices, NoticeKind::Error, text.to_owned());
        }
        let seen = |notices: &[Notice]| notices.iter().map(|n| (n.text.clone(), n.count)).collect::<Vec<_>>();
        assert_eq!(seen(&notices), [("a".to_owned(), 2), ("b".to_owned(), 1)]);
        add(&mut notices, NoticeKind::Done, "x".to_owned());
        add(&mut notices, NoticeKind::Done, "y".to_owned());
        assert_eq!(notices.iter().filter(|n| n.kind == NoticeKind::Done).count(), 1);
        assert_eq!(pass(&mut notices, Duration::from_secs(5)), Some(STAYS));
        assert_eq!(pass(&mut notices, Duration::from_secs(9)), Some(STAYS - Duration::from_secs(4)));
        // Said again, it stays on.
        add(&mut notices, NoticeKind::Done, "y".to_owned());
        assert_eq!((pass(&mut notices, Duration::from_secs(15)), notices.len()), (Some(STAYS), 3));
        assert_eq!((pass(&mut notices, Duration::from_secs(25)), notices.len()), (None, 2), "errors stay");
        (0..10).for_each(|i| add(&mut notices, NoticeKind::Error, i.to_string()));
        assert_eq!(notices.len(), NOTICES_MAX);
    }
}
