//! The time that a frame lasts while a series is played.

use super::{Mode, Sequence, State};
use crate::field::TimeAxis;
use crate::pipeline::FrameTime;

impl State {
    /// The series' time from a frame to the next while it is played, in the file's unit, whatever the direction: until the next of the steps that
    /// are played, at the last of them that since the one before. In [`Mode::RealTime`] it is what passes within one of `fps` frames a second if
    /// steps are interpolated, and at least that if they are not. 0 if nothing changes.
    pub fn interval(&self, times: &TimeAxis, frame: FrameTime, fps: f64) -> f64 {
        let sequence = Sequence::new(times.len(), &self.settings);
        let Some((from, to)) = sequence.and_then(|sequence| sequence.interval(frame.step())) else { return 0.0 };
        let between_steps = (FrameTime::from(to).time(times) - FrameTime::from(from).time(times)).abs();
        let of_frame = self.speed.unwrap_or(0.0) / fps;
        let interval = match self.settings.mode {
            Mode::RealTime if self.settings.interpolate => of_frame,
            Mode::RealTime => between_steps.max(of_frame),
            Mode::EveryStep | Mode::AsFastAsPossible => between_steps,
        };
        Some(interval).filter(|interval| interval.is_finite()).unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::playback::{Clock, Direction, Loop, Settings, StepRange};

    fn intervals(settings: Settings, fps: f64) -> Vec<f64> {
        // Not uniform.
        let times = TimeAxis { values: vec![0.0, 1.0, 3.0, 7.0, 15.0] };
        let state = Clock::with_settings(times.clone(), settings).unwrap().state();
        (0..5).map(|step| state.interval(&times, step.into(), fps)).collect()
    }

    #[test]
    fn it_lasts_until_the_next_of_the_steps_that_are_played_whatever_the_measured_rate() {
        let all = Settings::default();
        assert_eq!(intervals(all, 25.0), [1.0, 2.0, 4.0, 8.0, 8.0]);
        for other in [
            Settings { direction: Direction::Backward, ..all },
            Settings { repeat: Loop::PingPong, frames_per_second: 3.0, ..all },
            Settings { mode: Mode::AsFastAsPossible, ..all },
        ] {
            assert_eq!(intervals(other, 10.0), intervals(all, 25.0), "{other:?}");
        }
        let range = Some(StepRange { a: 1, b: 4 });
        // Of 1, 3 are played; a step beside them is passed in the interval around it.
        assert_eq!(intervals(Settings { range, stride: 2, ..all }, 25.0), [6.0; 5]);
        assert_eq!(intervals(Settings { range: Some(StepRange { a: 2, b: 2 }), ..all }, 25.0), [0.0; 5]);
    }

    #[test]
    fn in_real_time_it_is_the_time_of_a_frame_if_that_is_longer_or_steps_are_interpolated() {
        let real_time = Settings { mode: Mode::RealTime, time_per_second: Some(60.0), ..Settings::default() };
        assert_eq!(intervals(real_time, 20.0), [3.0, 3.0, 4.0, 8.0, 8.0]);
        assert_eq!(intervals(Settings { interpolate: true, ..real_time }, 20.0), [3.0; 5]);
        let state = Clock::with_settings(TimeAxis { values: vec![5.0] }, real_time).unwrap().state();
        assert_eq!(state.interval(&TimeAxis { values: vec![5.0] }, 0.into(), 20.0), 0.0);
        let endless = TimeAxis { values: vec![-f64::MAX, f64::MAX] };
        assert_eq!(Clock::new(endless.clone()).state().interval(&endless, 0.into(), 20.0), 0.0);
    }
}
