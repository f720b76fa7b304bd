//! Messages that stay until dismissed.

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
}

/// Largest number of messages; the oldest are dropped.
const NOTICES_MAX: usize = 4;

/// Adds a message; a repeated one is counted, and only the last one of kind `Done` stays.
pub(super) fn add(notices: &mut Vec<Notice>, kind: NoticeKind, text: String) {
    if let Some(known) = notices.iter_mut().find(|n| n.kind == kind && n.text == text) {
        known.count += 1;
        return;
    }
    if kind == NoticeKind::Done {
        notices.retain(|n| n.kind != NoticeKind::Done);
    }
    notices.push(Notice { kind, text, count: 1 });
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
        (0..10).for_each(|i| add(&mut notices, NoticeKind::Error, i.to_string()));
        assert_eq!(notices.len(), NOTICES_MAX);
    }
}
