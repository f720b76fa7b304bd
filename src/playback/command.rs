//! What a clock is told, and how it is set: plain data, for keys, scripts, traces and project files alike.

use crate::short::Short;
use serde::{Deserialize, Serialize};

/// Everything that a playback can be told. As JSON `"play"`, `{"step": -1}`, `{"speed": 0.5}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Command {
    /// Plays on. At the end of what is to be played, or outside of the range, it begins again at its start.
    Play,
    /// Stands still; the time already spent on the frame is kept.
    Pause,
    /// [`Command::Pause`] while playing, else [`Command::Play`].
    Toggle,
    /// Pauses at the start of what is to be played: its first step, backwards its last.
    Stop,
    /// Pauses, and goes so many steps later in time (negative: earlier), whatever direction and stride are; at the ends of
    /// the series it stays there. From between two steps, the first of them counts as one.
    Step(i64),
    /// Goes to a step; beyond the last one, to the last. Playing goes on from there.
    SeekStep(usize),
    /// Goes to a time in the file's unit; beyond the ends of the series, to its ends. In real-time mode to that very time, else
    /// to the step that holds it. Playing goes on from there.
    SeekTime(f64),
    /// How fast, in the unit of the present mode ([`Mode`]); above 0, finite. In the mode without a speed it is kept for
    /// [`Mode::EveryStep`].
    Speed(f64),
    /// Which way the series is played.
    Direction(Direction),
    /// Turns round: from what ping-pong does at the moment, if it is on its way back.
    Reverse,
    /// What happens at the ends.
    Loop(Loop),
    /// The part of the series to be played, or all of it.
    Range(Option<StepRange>),
    /// Only every so many-th step, counted from the first of the range in both directions; 1 or more.
    Stride(usize),
    /// What leads: the frames or the time.
    Mode(Mode),
    /// Whether [`Mode::RealTime`] shows linear mixtures of two steps in between.
    Interpolate(bool),
}

/// What leads the playback, the frames or the time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Each step is shown, none is dropped; a renderer that does not keep up slows the playback. Speed: frames per second.
    #[default]
    EveryStep,
    /// The file's times lead, uniform or not; steps are dropped if the renderer does not keep up. Speed: units of the file's
    /// time per second.
    RealTime,
    /// Each step is shown, the next one as soon as the last is. No speed.
    AsFastAsPossible,
}

/// Which way in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Later.
    #[default]
    Forward,
    /// Earlier.
    Backward,
}

impl Direction {
    /// The other one.
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
    /// The whole series, again and again, whatever the range.
    All,
    /// The range again and again; the series if there is none.
    Range,
    /// The range, or the series, forth and back; the steps at the turns are shown once.
    PingPong,
}

/// Steps from A to B, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepRange {
    /// One end. The lesser one once a clock has taken it.
    pub a: usize,
    /// The other.
    pub b: usize,
}

/// How a series is played: what a project keeps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", default, deny_unknown_fields)]
pub struct Settings {
    /// What leads.
    pub mode: Mode,
    /// Speed of [`Mode::EveryStep`].
    pub frames_per_second: f64,
    /// Speed of [`Mode::RealTime`] in the file's unit per second; `None` lets the whole series last
    /// [`Settings::DEFAULT_DURATION_SECS`].
    pub time_per_second: Option<f64>,
    /// Which way.
    pub direction: Direction,
    /// What happens at the ends.
    #[serde(rename = "loop")]
    pub repeat: Loop,
    /// Which part.
    pub range: Option<StepRange>,
    /// Every so many-th step.
    pub stride: usize,
    /// Mixtures of two steps in [`Mode::RealTime`].
    pub interpolate: bool,
}

impl Settings {
    /// How long a series lasts in [`Mode::RealTime`] from its first to its last step, unless a speed is asked for.
    pub const DEFAULT_DURATION_SECS: f64 = 10.0;
    /// Speed of [`Mode::EveryStep`] unless another is asked for.
    pub const DEFAULT_FRAMES_PER_SECOND: f64 = 25.0;

    /// Whether its numbers make sense.
    ///
    /// # Errors
    /// The first that does not.
    pub fn check(&self) -> Result<(), CommandError> {
        check_speed(self.frames_per_second)?;
        self.time_per_second.map_or(Ok(()), check_speed)?;
        check_stride(self.stride)
    }

    /// Itself for a series of so many steps: the range in order and within the series.
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
    /// In order and within a series of so many steps; `None` if there are none.
    pub(super) fn within(self, steps: usize) -> Option<Self> {
        let last = steps.checked_sub(1)?;
        Some(Self { a: self.a.min(self.b).min(last), b: self.a.max(self.b).min(last) })
    }
}

/// A command that cannot be followed; the clock is as it was.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CommandError {
    /// Not a speed.
    #[error(
        "a speed of {} cannot be played; give a finite one above 0 (pause, or reverse the direction, for the rest)",
        Short(.0)
    )]
    Speed(f64),
    /// A stride of 0.
    #[error("a stride of 0 never moves; give 1 or more")]
    Stride,
    /// Not a time.
    #[error("there is no time {0} to go to")]
    Time(f64),
    /// Times that are not those of the series and more.
    #[error("the times do not begin with those of the series that is played; open it anew")]
    OtherSeries,
}

impl Command {
    /// Whether its numbers make sense.
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
