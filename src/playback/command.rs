//! Commands and settings of a clock: plain data, for keys, scripts, traces and project files alike.

use crate::short::Short;
use serde::{Deserialize, Serialize};

/// A command to a playback. As JSON `"play"`, `{"step": -1}`, `{"speed": 0.5}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Command {
    /// Resumes. At the end or outside of the range, playback begins again at the start.
    Play,
    /// Pauses; the time already spent on the frame is kept.
    Pause,
    /// [`Command::Pause`] while playing, else [`Command::Play`].
    Toggle,
    /// Pauses at the start: the first step to be played, backwards the last.
    Stop,
    /// Pauses, and moves this many steps later in time (negative: earlier), whatever direction and stride are, stopping at the ends of the
    /// series. From between two steps, the first step reached counts as one.
    Step(i64),
    /// Seeks to a step; beyond the last one, to the last. Playing goes on from there.
    SeekStep(usize),
    /// Seeks to a time in the file's unit, clamped to the series. In real-time mode to that very time, else to the step shown then. Playing
    /// goes on from there.
    SeekTime(f64),
    /// Sets the speed, in the unit of the current mode ([`Mode`]); above 0, finite. In the mode without a speed it is kept for
    /// [`Mode::EveryStep`].
    Speed(f64),
    /// Sets the direction.
    Direction(Direction),
    /// Reverses the current direction, which on the way back of ping-pong is not the one that was set.
    Reverse,
    /// Sets what happens at the ends.
    Loop(Loop),
    /// Restricts playback to a range, or to the whole series.
    Range(Option<StepRange>),
    /// Plays only every n-th step, counted from the first of the range in both directions; 1 or more.
    Stride(usize),
    /// Sets whether frames or time lead.
    Mode(Mode),
    /// Whether [`Mode::RealTime`] interpolates linearly between steps.
    Interpolate(bool),
}

/// Whether frames or time lead the playback.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Each step is shown, none is dropped; a slow renderer slows the playback. Speed: frames per second.
    #[default]
    EveryStep,
    /// The file's times lead, uniform or not; steps are dropped if the renderer does not keep up. Speed: units of the file's
    /// time per second.
    RealTime,
    /// Each step is shown, the next one as soon as the last is. No speed.
    AsFastAsPossible,
}

/// Direction in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// To later times.
    #[default]
    Forward,
    /// To earlier times.
    Backward,
}

impl Direction {
    /// The opposite direction.
    pub fn reversed(self) -> Self {
        match self {
            Self::Forward => Self::Backward,
            Self::Backward => Self::Forward,
        }
    }
}

/// What happens at the ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loop {
    /// Playback of the range (if there is none, of the series) ends with its last frame.
    #[default]
    Off,
    /// The whole series repeats, whatever the range.
    All,
    /// The range repeats; the series if there is none.
    Range,
    /// The range, or the series, is played forth and back; the steps at the turns are shown once.
    PingPong,
}

/// Steps from A to B, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepRange {
    /// One end; the smaller one once a clock has taken it.
    pub a: usize,
    /// The other end.
    pub b: usize,
}

/// How a series is played: what a project keeps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", default, deny_unknown_fields)]
pub struct Settings {
    /// Whether frames or time lead.
    pub mode: Mode,
    /// Speed of [`Mode::EveryStep`].
    pub frames_per_second: f64,
    /// Speed of [`Mode::RealTime`] in the file's unit per second; `None` lets the whole series last
    /// [`Settings::DEFAULT_DURATION_SECS`].
    pub time_per_second: Option<f64>,
    /// Direction in time.
    pub direction: Direction,
    /// What happens at the ends.
    #[serde(rename = "loop")]
    pub repeat: Loop,
    /// Steps to be played; `None`: all.
    pub range: Option<StepRange>,
    /// Only every n-th step is played.
    pub stride: usize,
    /// Whether [`Mode::RealTime`] interpolates between steps.
    pub interpolate: bool,
}

impl Settings {
    /// How long a series lasts in [`Mode::RealTime`] from its first to its last step, unless a speed is asked for.
    pub const DEFAULT_DURATION_SECS: f64 = 10.0;
    /// Speed of [`Mode::EveryStep`] unless another is asked for.
    pub const DEFAULT_FRAMES_PER_SECOND: f64 = 25.0;

    /// Checks the numbers.
    ///
    /// # Errors
    /// The first invalid number.
    pub fn check(&self) -> Result<(), CommandError> {
        check_speed(self.frames_per_second)?;
        self.time_per_second.map_or(Ok(()), check_speed)?;
        check_stride(self.stride)
    }

    /// The settings for a series of this many steps: the range sorted and clamped.
    pub(super) fn checked(mut self, steps: usize) -> Result<Self, CommandError> {
        self.check()?;
        self.range = self.range.and_then(|range| range.within(steps));
        Ok(self)
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            mode: Mode::default(),
            frames_per_second: Self::DEFAULT_FRAMES_PER_SECOND,
            time_per_second: None,
            direction: Direction::default(),
            repeat: Loop::default(),
            range: None,
            stride: 1,
            interpolate: false,
        }
    }
}

impl StepRange {
    /// The range sorted, and clamped to this many steps; `None` if there are none.
    pub(super) fn within(self, steps: usize) -> Option<Self> {
        let last = steps.checked_sub(1)?;
        Some(Self { a: self.a.min(self.b).min(last), b: self.a.max(self.b).min(last) })
    }
}

/// A refused command; the clock is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CommandError {
    /// A speed that is not finite or not above 0.
    #[error(
        "a speed of {} cannot be played; give a finite one above 0 (pause, or reverse the direction, for the rest)",
        Short(.0)
    )]
    Speed(f64),
    /// A stride of 0.
    #[error("a stride of 0 never moves; give 1 or more")]
    Stride,
    /// A time that is NaN.
    #[error("there is no time {0} to go to")]
    Time(f64),
    /// Times that do not begin with those of the series.
    #[error("the times do not begin with those of the series that is played; open it anew")]
    OtherSeries,
}

impl Command {
    /// Checks the numbers.
    pub(super) fn check(&self) -> Result<(), CommandError> {
        match *self {
            Self::Speed(speed) => check_speed(speed),
            Self::Stride(stride) => check_stride(stride),
            Self::SeekTime(time) if time.is_nan() => Err(CommandError::Time(time)),
            _ => Ok(()),
        }
    }
}

fn check_speed(speed: f64) -> Result<(), CommandError> {
    if speed > 0.0 && speed.is_finite() { Ok(()) } else { Err(CommandError::Speed(speed)) }
}

fn check_stride(stride: usize) -> Result<(), CommandError> {
    if stride > 0 { Ok(()) } else { Err(CommandError::Stride) }
}
