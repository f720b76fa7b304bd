//! A series that grows while it is played.

use super::{Clock, Course, Phase, Sequence};
use crate::field::TimeAxis;
use crate::playback::{CommandError, Mode};

impl Clock {
    /// Replaces the times of a series that has grown; `times` begins with the old ones. The frame on the screen, mode, range and all other
    /// settings stay. From the old last step, playing goes on to the first new one, where it would have returned to the start of a loop or
    /// turned round; a playback that had ended waits for [`Command::Play`], which goes on with the new steps.
    ///
    /// In [`Mode::RealTime`] without a speed of its own the whole series still lasts as long as before, so that playback is faster; the
    /// share of the interval that has passed is kept, as after a change of the speed.
    ///
    /// [`Command::Play`]: crate::playback::Command::Play
    ///
    /// # Errors
    /// If the series has fewer steps than before or another time at one of them; the clock is then unchanged.
    pub fn extend(&mut self, times: TimeAxis) -> Result<(), CommandError> {
        let known = self.times.len();
        let bits = |time: &f64| time.to_bits();
        if !times.values.iter().take(known).map(bits).eq(self.times.values.iter().map(bits)) {
            return Err(CommandError::OtherSeries);
        }
        let mut progress = self.progress();
        self.times = times;
        self.sequence = Sequence::new(self.times.len(), &self.settings);
        if known == 0 {
            let progress = self.begin_again();
            self.phase = Phase::Waiting { progress, due: None };
            return Ok(());
        }
        let Some(score) = self.score() else { return Ok(()) };
        let Course { held, from, next, returning } = self.course;
        // An interval along the series is finished first.
        if next.is_none_or(|next| next.jump || next.turned) {
            self.course = Course { held, ..Course::at_step(from, returning, &score) };
            if self.settings.mode == Mode::RealTime && self.course.next != next {
                progress = 0.0;
            }
        }
        self.phase = match self.phase {
            Phase::Waiting { due, .. } => Phase::Waiting { progress, due },
            Phase::Resting { .. } | Phase::Running { .. } => self.resting_or_running(progress),
        };
        Ok(())
    }
}
