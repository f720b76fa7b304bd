//! Whether playback keeps up, in words.

use crate::playback::{Mode, State};

/// Below this share of the requested rate a shortfall is reported; the rate is measured over two seconds, so a frame more or less is
/// negligible.
const SHORT_OF: f64 = 0.9;

/// A message if playback cannot keep up: in [`Mode::RealTime`] steps are dropped, in [`Mode::EveryStep`] it is slower.
pub fn shortfall(state: &State) -> Option<String> {
    let shown = state.frames_per_second.filter(|_| state.playing)?;
    match state.settings.mode {
        Mode::EveryStep => {
            let asked = state.speed?;
            let is_short = shown < SHORT_OF * asked;
            is_short.then(|| format!("slower than asked: {shown:.1} of {asked:.1} frames/s"))
        }
        Mode::RealTime => {
            let dropped = state.dropped;
            (dropped > 0).then(|| format!("dropping steps to keep time: {dropped} so far, {shown:.1} frames/s shown"))
        }
        Mode::AsFastAsPossible => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::TimeAxis;
    use crate::playback::{Clock, Command};
    use std::time::Duration;

    fn state(mode: Mode, asked: f64, shown: f64, dropped: u64) -> State {
        let mut clock = Clock::new(TimeAxis { values: vec![0.0, 1.0, 2.0] });
        clock.apply(Command::Mode(mode), Duration::ZERO).unwrap();
        let (speed, frames_per_second) = (Some(asked), Some(shown));
        State { playing: true, speed, frames_per_second, dropped, ..clock.state() }
    }

    #[test]
    fn it_is_said_when_frames_come_late_or_not_at_all() {
        assert_eq!(shortfall(&state(Mode::EveryStep, 10.0, 9.5, 0)), None);
        let slow = shortfall(&state(Mode::EveryStep, 10.0, 3.12, 0)).unwrap();
        assert_eq!(slow, "slower than asked: 3.1 of 10.0 frames/s");
        assert_eq!(shortfall(&state(Mode::RealTime, 10.0, 3.0, 0)), None);
        assert!(shortfall(&state(Mode::RealTime, 10.0, 3.0, 7)).unwrap().contains("7 so far"));
        assert_eq!(shortfall(&state(Mode::AsFastAsPossible, 10.0, 3.0, 0)), None);
        assert_eq!(shortfall(&State { playing: false, ..state(Mode::EveryStep, 10.0, 1.0, 0) }), None);
    }
}
