//! What the dialog of exports offers, as it is typed and chosen.

use crate::export::annotate::{Annotations, Title};
use crate::export::movie::FrameRate;
use crate::export::run::{
    RunOptions, SIZE_MAX_PX, Target, Times, parse_angle, parse_duration, parse_size, parse_times, pattern_in,
};
use crate::export::still::{Background, StillFormat};
use crate::field::TimeAxis;
use crate::image::{ExrColor, ExrCompression};
use crate::ingest::StepRange;
use crate::pipeline::FrameTime;
use crate::project::Output;
use std::fmt::Display;
use std::path::{Path, PathBuf, absolute};

/// Which frames are exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frames {
    /// The one on the screen.
    Moment,
    /// Those of steps.
    Steps,
}

/// The choices of the dialog. Texts are as on the command line, and empty for the default.
#[derive(Clone, Debug, PartialEq)]
pub struct Choices {
    /// Path of an image, of numbered images, or of a movie.
    pub file: String,
    /// Which frames are exported.
    pub frames: Frames,
    /// Steps `A..B:S`.
    pub steps: String,
    /// Times `T0..T1`.
    pub times: String,
    /// Seconds over which the times are spread.
    pub duration: String,
    /// With a duration: whether scalars are interpolated between two steps.
    pub interpolate: bool,
    /// Degrees by which the camera turns.
    pub turntable: String,
    /// Frames per second.
    pub fps: String,
    /// Width and height in pixels.
    pub size_px: (usize, usize),
    /// Colour behind the volume; `None`: transparent, in a movie black.
    pub background: Option<[u8; 3]>,
    /// Whether the time is drawn.
    pub time: bool,
    /// Whether the colour bar is drawn.
    pub legend: bool,
    /// Whether a title is drawn.
    pub title: bool,
    /// Text of the title; empty: field and dataset.
    pub title_text: String,
    /// Whether PNG files have 16 bits per channel, not 8.
    pub deep_png: bool,
    /// Whether colours in EXR files have 16 bits, not 32.
    pub half_exr: bool,
    /// Colour space of EXR files.
    pub exr: ExrColor,
    /// Compression of EXR files.
    pub exr_compression: ExrCompression,
    /// Whether images of the same request are kept.
    pub resume: bool,
    /// Whether other files that are there are replaced.
    pub replaces: bool,
}

/// What the first choices of a session depend on, beside the project's output settings.
pub(in crate::ui) struct Beginning<'a> {
    /// Folder of the project.
    pub(in crate::ui) folder: &'a Path,
    /// Folder for files if the project names none.
    pub(in crate::ui) here: &'a Path,
    /// Name of the project or the dataset.
    pub(in crate::ui) name: &'a str,
    /// Size of the window's picture.
    pub(in crate::ui) size_px: (usize, usize),
    /// Colour behind it.
    pub(in crate::ui) background: [u8; 3],
    /// First and last step that are played, if not all are.
    pub(in crate::ui) range: Option<(usize, usize)>,
}

impl Choices {
    /// The first choices: those of the project, and for the rest a picture as the window has it.
    pub(in crate::ui) fn of(output: &Output, beginning: &Beginning<'_>) -> Self {
        let text = |text: &Option<String>| text.clone().unwrap_or_default();
        let number = |number: Option<f64>| number.map_or_else(String::new, |number| number.to_string());
        let parsed = |text: &Option<String>| text.as_ref().and_then(|text| text.parse().ok());
        let annotations: Annotations = output.annotate.as_ref().and_then(|text| text.parse().ok()).unwrap_or_default();
        let own = PathBuf::from(format!("{}.png", beginning.name.replace('%', "%%")));
        let file = match &output.output {
            Some(file) => pattern_in(beginning.folder, file),
            None => pattern_in(beginning.here, &own),
        };
        let is = |format| StillFormat::of(&file) == Some(format);
        let background = match output.background.as_deref().map(str::parse) {
            Some(Ok(Background::Color(color))) => Some(color.map(|c| (255.0 * c).round() as u8)),
            Some(Ok(Background::Transparent)) => None,
            Some(Err(_)) | None => Some(beginning.background),
        };
        let all = || beginning.range.map_or_else(|| "0..".to_owned(), |(a, b)| format!("{a}..{b}"));
        Self {
            frames: if output.output.is_some() { Frames::Steps } else { Frames::Moment },
            steps: output.steps.clone().unwrap_or_else(all),
            times: text(&output.times),
            duration: number(output.duration),
            interpolate: output.interpolate == Some(true),
            turntable: number(output.turntable),
            fps: output.fps.clone().unwrap_or_else(|| FrameRate::default().to_string()),
            size_px: output.size.as_deref().and_then(|text| parse_size(text).ok()).unwrap_or(beginning.size_px),
            background,
            time: annotations.time,
            legend: annotations.legend,
            title: annotations.title.is_some(),
            title_text: match annotations.title {
                Some(Title::Text(text)) => text,
                Some(Title::FieldAndDataset) | None => String::new(),
            },
            deep_png: is(StillFormat::Png) && output.bit_depth == Some(16),
            half_exr: is(StillFormat::Exr) && output.bit_depth == Some(16),
            exr: parsed(&output.exr).unwrap_or_default(),
            exr_compression: output.exr_compression.as_ref().and_then(|text| text.parse().ok()).unwrap_or_default(),
            resume: false,
            replaces: false,
            file: file.display().to_string(),
        }
    }

    /// The choices with other frames, and with a number in the name of images or without one.
    #[must_use]
    pub fn with_frames(&self, frames: Frames) -> Self {
        let path = Path::new(&self.file);
        let file = match (frames, path.extension().and_then(|extension| extension.to_str())) {
            (Frames::Moment, _) => self.file.replacen(NUMBER, "", 1),
            (Frames::Steps, Some(extension)) if StillFormat::of(path).is_some() && !has_number(&self.file) => {
                let stem = self.file.len().saturating_sub(extension.len() + 1);
                format!("{}{NUMBER}.{extension}", self.file.get(..stem).unwrap_or_default())
            }
            (Frames::Steps, _) => self.file.clone(),
        };
        Self { frames, file, ..self.clone() }
    }

    /// The format of the images; `None` for movies, and for files that cannot be written.
    pub fn still_format(&self) -> Option<StillFormat> {
        StillFormat::of(Path::new(self.file.trim()))
    }

    /// Whether the frames have a rate: those of a movie, or of images over a duration.
    pub fn has_rate(&self) -> bool {
        self.still_format().is_none() || (self.frames == Frames::Steps && !self.duration.trim().is_empty())
    }

    /// The absolute path or pattern of the files.
    pub(super) fn path(&self) -> Result<PathBuf, String> {
        let file = Path::new(self.file.trim());
        if file.as_os_str().is_empty() {
            return Err("file: name one, such as frame_%04d.png or movie.mp4".to_owned());
        }
        let here = absolute(".").map_err(|error| format!("file: there is no folder to write to: {error}"))?;
        Ok(pattern_in(&here, file))
    }

    /// The options of a run with `moment` on the screen.
    ///
    /// # Errors
    /// If a text has no meaning, or the options contradict each other.
    pub(super) fn options(&self, moment: Option<FrameTime>, times: &TimeAxis) -> Result<RunOptions, String> {
        let target = Target::parse(self.path()?.into_os_string()).map_err(|error| error.to_string())?;
        let still = StillFormat::of(&target.path(0)).filter(|_| matches!(target, Target::Images(_)));
        let is_exr = still == Some(StillFormat::Exr);
        let (width, height) = self.size_px;
        if !(1..=SIZE_MAX_PX).contains(&width) || !(1..=SIZE_MAX_PX).contains(&height) {
            return Err(format!("size: width and height must be 1 to {SIZE_MAX_PX}"));
        }
        let color = self.background.map(|rgb| Background::Color(rgb.map(|c| f32::from(c) / 255.0)));
        let deep = match still {
            Some(StillFormat::Png) => self.deep_png,
            Some(StillFormat::Exr) => self.half_exr,
            None => false,
        };
        let options = RunOptions {
            times: match self.frames {
                Frames::Moment => self.moment(moment.ok_or("there is no step to show")?, times, still.is_none())?,
                Frames::Steps => self.times(times)?,
            },
            target,
            size_px: self.size_px,
            background: color.filter(|_| !is_exr).unwrap_or_default(),
            annotations: self.annotations()?,
            bit_depth: deep.then(|| "16".to_owned()),
            exr: Some(self.exr).filter(|color| is_exr && *color != ExrColor::default()),
            exr_compression: Some(self.exr_compression).filter(|how| is_exr && *how != ExrCompression::default()),
            resume: self.resume && still.is_some(),
            replaces: self.replaces,
        };
        options.check().map_err(|error| error.to_string())?;
        Ok(options)
    }

    /// The times of the frame on the screen: a step, or a time between two.
    fn moment(&self, moment: FrameTime, times: &TimeAxis, is_movie: bool) -> Result<Times, String> {
        let rate = if is_movie { Some(self.rate()?) } else { None };
        if moment.toward().is_none() {
            let step = moment.step();
            return Ok(Times {
                steps: StepRange { first: step, last: Some(step), stride: 1 },
                rate,
                ..Times::default()
            });
        }
        let time = moment.time(times);
        let duration_s = Some(1.0 / rate.unwrap_or_default().per_second());
        Ok(Times { range: Some((time, time)), rate, duration_s, interpolate: true, ..Times::default() })
    }

    /// The times of the chosen steps.
    fn times(&self, times: &TimeAxis) -> Result<Times, String> {
        let duration_s = given("duration", &self.duration, parse_duration)?;
        let steps = given("steps", &self.steps, |text| text.parse::<StepRange>())?.unwrap_or_default();
        Ok(Times {
            steps: steps.within(times.len()),
            range: given("times", &self.times, parse_times)?,
            rate: if self.has_rate() { Some(self.rate()?) } else { None },
            duration_s,
            interpolate: self.interpolate && duration_s.is_some(),
            turntable_deg: given("turntable", &self.turntable, parse_angle)?.filter(|degrees| *degrees != 0.0),
        })
    }

    fn rate(&self) -> Result<FrameRate, String> {
        Ok(given("frame rate", &self.fps, |text| text.parse::<FrameRate>())?.unwrap_or_default())
    }

    /// What is drawn over the frames; `None` for nothing.
    fn annotations(&self) -> Result<Option<Annotations>, String> {
        let title = self.title.then(|| match self.title_text.trim() {
            "" => Title::FieldAndDataset,
            text => Title::Text(text.to_owned()),
        });
        let chosen = Annotations { time: self.time, legend: self.legend, title };
        // A project file and the command line have it as text.
        if chosen.to_string().parse::<Annotations>().as_ref() != Ok(&chosen) {
            return Err("title: after a comma there is no word of its own for time, legend or title".to_owned());
        }
        Ok(Some(chosen).filter(|chosen| *chosen != Annotations::default()))
    }
}

/// The number in names of images.
const NUMBER: &str = "_%04d";

/// Whether a name has a number: a % that is not doubled.
fn has_number(file: &str) -> bool {
    file.replace("%%", "").contains('%')
}

/// The value of a text, unless it is empty; errors begin with its name.
fn given<T, E: Display>(name: &str, text: &str, parse: impl Fn(&str) -> Result<T, E>) -> Result<Option<T>, String> {
    let text = text.trim();
    if text.is_empty() {
        return Ok(None);
    }
    parse(text).map(Some).map_err(|error| format!("{name}: {error}"))
}
