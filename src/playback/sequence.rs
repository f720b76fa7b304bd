//! The order of steps: which step follows another, given range, stride and loop. Independent of time.
//!
//! Stride and range make a lattice A, A + S, A + 2 S, .. <= B, the same in both directions. From a step off the lattice (after a seek)
//! playing goes on with the next one on it.

use super::command::{Direction, Loop, Settings};

/// The steps to be played and what happens at their ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sequence {
    /// A, the first step of the lattice.
    first: usize,
    /// The last step of the lattice.
    last: usize,
    /// B: `last`, or less than a stride after it.
    end: usize,
    stride: usize,
    repeat: Loop,
}

/// The step after another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Successor {
    /// Index of the step.
    pub step: usize,
    /// Whether it is reached by a jump: back to the start of a loop, or from outside into the range.
    pub jump: bool,
    /// Whether ping-pong changes its direction there.
    pub turned: bool,
}

impl Sequence {
    /// The sequence of `settings` in a series of this many steps; `None` if there are none.
    pub fn new(steps: usize, settings: &Settings) -> Option<Self> {
        let whole = (0, steps.checked_sub(1)?);
        let range = settings.range.filter(|_| settings.repeat != Loop::All).and_then(|range| range.within(steps));
        let (first, end) = range.map_or(whole, |range| (range.a, range.b));
        // A stride beyond `steps` is equivalent, and clamped so that sums cannot overflow.
        let stride = settings.stride.clamp(1, steps);
        Some(Self { first, last: end - (end - first) % stride, end, stride, repeat: settings.repeat })
    }

    /// The step where playing begins.
    pub fn start(&self, heading: Direction) -> usize {
        match heading {
            Direction::Forward => self.first,
            Direction::Backward => self.last,
        }
    }

    /// Whether a step is between A and B, on the lattice or not.
    pub fn covers(&self, step: usize) -> bool {
        (self.first..=self.end).contains(&step)
    }

    /// Whether playback ends after the last step.
    pub fn ends(&self) -> bool {
        self.repeat == Loop::Off
    }

    /// The step after `step`; `None` at the end, or if there is no other step.
    pub fn after(&self, step: usize, heading: Direction) -> Option<Successor> {
        let jump = !self.covers(step);
        if let Some(ahead) = self.ahead(step, heading) {
            return Some(Successor { step: ahead, jump, turned: false });
        }
        match self.repeat {
            Loop::Off => None,
            Loop::All | Loop::Range => {
                let start = self.start(heading);
                (start != step).then_some(Successor { step: start, jump: true, turned: false })
            }
            Loop::PingPong => {
                let back = self.ahead(step, heading.reversed())?;
                Some(Successor { step: back, jump, turned: true })
            }
        }
    }

    /// The nearest lattice step in a direction.
    fn ahead(&self, step: usize, heading: Direction) -> Option<usize> {
        match heading {
            Direction::Forward if step < self.first => Some(self.first),
            Direction::Forward => {
                let ahead = self.first + ((step - self.first) / self.stride + 1) * self.stride;
                (ahead <= self.last).then_some(ahead)
            }
            Direction::Backward if step > self.last => Some(self.last),
            Direction::Backward if step <= self.first => None,
            Direction::Backward => Some(self.first + (step - 1 - self.first) / self.stride * self.stride),
        }
    }

    /// The two lattice steps between which a step is left, from the last one on those before it; `None` if there is one alone.
    pub fn interval(&self, step: usize) -> Option<(usize, usize)> {
        (self.first < self.last).then(|| step.clamp(self.first, self.last - 1)).and_then(|step| self.around(step))
    }

    /// The two lattice steps around the interval from `step` to the next of the series; `None` outside of the lattice.
    pub fn around(&self, step: usize) -> Option<(usize, usize)> {
        let lower = self.first + step.checked_sub(self.first)? / self.stride * self.stride;
        (step < self.last).then_some((lower, lower + self.stride))
    }
}

#[cfg(test)]
mod tests {
    use super::super::command::StepRange;
    use super::*;
    use Direction::{Backward, Forward};

    fn sequence(steps: usize, range: Option<(usize, usize)>, stride: usize, repeat: Loop) -> Sequence {
        let range = range.map(|(a, b)| StepRange { a, b });
        Sequence::new(steps, &Settings { range, stride, repeat, ..Settings::default() }).unwrap()
    }

    /// The first `count` steps after `from`.
    fn played(sequence: Sequence, from: usize, mut heading: Direction, count: usize) -> Vec<usize> {
        let mut step = from;
        let next = || {
            let successor = sequence.after(step, heading)?;
            heading = if successor.turned { heading.reversed() } else { heading };
            step = successor.step;
            Some(step)
        };
        std::iter::from_fn(next).take(count).collect()
    }

    #[test]
    fn a_series_is_played_once_or_again_and_again() {
        assert_eq!(played(sequence(4, None, 1, Loop::Off), 0, Forward, 9), [1, 2, 3]);
        assert_eq!(played(sequence(4, None, 1, Loop::Off), 3, Backward, 9), [2, 1, 0]);
        assert_eq!(played(sequence(3, None, 1, Loop::All), 0, Forward, 6), [1, 2, 0, 1, 2, 0]);
        assert_eq!(played(sequence(3, None, 1, Loop::All), 0, Backward, 4), [2, 1, 0, 2]);
    }

    #[test]
    fn ping_pong_shows_the_steps_at_the_turns_once() {
        assert_eq!(played(sequence(4, None, 1, Loop::PingPong), 0, Forward, 8), [1, 2, 3, 2, 1, 0, 1, 2]);
        assert_eq!(played(sequence(2, None, 1, Loop::PingPong), 0, Backward, 4), [1, 0, 1, 0]);
    }

    #[test]
    fn a_stride_that_does_not_divide_the_range_visits_the_same_steps_both_ways() {
        let once = sequence(20, Some((2, 12)), 4, Loop::Off);
        assert_eq!((once.start(Forward), once.start(Backward)), (2, 10));
        assert_eq!(played(once, 2, Forward, 9), [6, 10]);
        assert_eq!(played(once, 10, Backward, 9), [6, 2]);
        assert_eq!(played(sequence(20, Some((2, 12)), 4, Loop::PingPong), 2, Forward, 6), [6, 10, 6, 2, 6, 10]);
    }

    #[test]
    fn a_range_from_b_to_a_is_the_range_from_a_to_b() {
        assert_eq!(sequence(20, Some((12, 2)), 4, Loop::Range), sequence(20, Some((2, 12)), 4, Loop::Range));
        assert_eq!(sequence(5, Some((90, 2)), 1, Loop::Range), sequence(5, Some((2, 4)), 1, Loop::Range));
    }

    #[test]
    fn from_between_the_lattice_playing_goes_on_with_its_next_step() {
        let range = sequence(20, Some((2, 12)), 4, Loop::Range);
        assert_eq!(played(range, 7, Forward, 3), [10, 2, 6]);
        assert_eq!(played(range, 7, Backward, 3), [6, 2, 10]);
        assert_eq!((played(range, 12, Forward, 1), played(range, 12, Backward, 1)), (vec![2], vec![10]));
    }

    #[test]
    fn from_outside_the_range_playing_goes_to_its_start() {
        for (step, heading, expected) in [(0, Forward, 2), (15, Forward, 2), (0, Backward, 10), (15, Backward, 10)] {
            let next = sequence(20, Some((2, 12)), 4, Loop::Range).after(step, heading);
            assert_eq!(next, Some(Successor { step: expected, jump: true, turned: false }), "{step} {heading:?}");
        }
        let bounce = sequence(20, Some((2, 12)), 4, Loop::PingPong).after(15, Forward);
        assert_eq!(bounce, Some(Successor { step: 10, jump: true, turned: true }), "the nearest end");
        assert_eq!(played(sequence(20, Some((2, 12)), 4, Loop::Off), 15, Forward, 3), [0; 0]);
    }

    #[test]
    fn one_step_has_no_successor() {
        for repeat in [Loop::Off, Loop::All, Loop::Range, Loop::PingPong] {
            assert_eq!(sequence(1, None, 1, repeat).after(0, Forward), None);
            assert_eq!(sequence(9, Some((4, 4)), 3, repeat).after(4, Backward).map(|next| next.step), {
                // Every third step of the whole series is played.
                (repeat == Loop::All).then_some(3)
            });
        }
        assert_eq!(Sequence::new(0, &Settings::default()), None);
    }

    #[test]
    fn no_stride_overflows() {
        assert_eq!(played(sequence(9, None, usize::MAX, Loop::All), 4, Forward, 2), [0; 1]);
        assert_eq!(played(sequence(9, None, usize::MAX, Loop::PingPong), 4, Forward, 2), [0; 1]);
    }
}
