//! [`RunOptions`]: what a run writes, whoever chooses it: a command line or a dialog.

use super::{Output, Plan, PlanError, Run, Target, Times, check_memory};
use crate::error::FileError;
use crate::export::annotate::{AboutSeries, Annotations, Annotator};
use crate::export::movie::{Ffmpeg, MovieOptions};
use crate::export::still::{Background, FrameAttributes, StillFormat, StillOptions};
use crate::field::TimeAxis;
use crate::image::{ExrColor, ExrCompression, ExrEncoding};
use crate::scene::Scene;
use std::str::FromStr;

/// Options of a run; `None`: the default.
#[derive(Clone, Debug, PartialEq)]
pub struct RunOptions {
    /// The files.
    pub target: Target,
    /// The times that they show.
    pub times: Times,
    /// Width and height in pixels.
    pub size_px: (usize, usize),
    /// Colour behind the volume.
    pub background: Background,
    /// What is drawn over the frames.
    pub annotations: Option<Annotations>,
    /// Bits per channel of PNG files, or of colours in EXR files, as text.
    pub bit_depth: Option<String>,
    /// Colour space of EXR files.
    pub exr: Option<ExrColor>,
    /// Compression of EXR files.
    pub exr_compression: Option<ExrCompression>,
    /// Whether existing images of the same request are kept.
    pub resume: bool,
    /// Whether other files at the places of the output are replaced.
    pub replaces: bool,
}

/// Options that no run can have.
#[derive(Debug, thiserror::Error)]
pub enum OptionsError {
    /// Options that contradict each other, or exceed the memory.
    #[error("{0}")]
    Refused(String),
    /// A place that cannot be written to, or no ffmpeg.
    #[error(transparent)]
    File(#[from] FileError),
    /// Times without frames.
    #[error(transparent)]
    Plan(#[from] PlanError),
}

/// What the texts of frames and movies say beside their options.
#[derive(Clone, Copy, Debug)]
pub struct Naming<'a> {
    /// Name of the dataset.
    pub dataset: &'a str,
    /// How the frames were made.
    pub made_by: &'a str,
}

impl RunOptions {
    /// Checks that the options fit each other. Reads nothing.
    ///
    /// # Errors
    /// If no run can have them.
    pub fn check(&self) -> Result<(), OptionsError> {
        let is_movie = matches!(self.target, Target::Movie(..));
        self.times.check(is_movie).map_err(OptionsError::Refused)?;
        self.times.frame_count()?;
        self.still_options().map_err(OptionsError::Refused)?;
        if self.resume && is_movie {
            let problem = "a movie cannot be continued: --resume is for images, such as frame_%04d.png";
            return Err(OptionsError::Refused(problem.to_owned()));
        }
        Ok(())
    }

    /// Checks that there is a place for the output, and memory for a frame.
    ///
    /// # Errors
    /// If there is none.
    pub fn check_place(&self) -> Result<(), OptionsError> {
        self.check_memory(1)?;
        Ok(self.target.check_place()?)
    }

    /// Checks that there is memory for this many frames.
    ///
    /// # Errors
    /// If there is none.
    pub fn check_memory(&self, frames: usize) -> Result<(), OptionsError> {
        check_memory(self.size_px, frames).map_err(OptionsError::Refused)
    }

    /// The encoder of a movie; `None` for images.
    ///
    /// # Errors
    /// If there is none.
    pub fn ffmpeg(&self) -> Result<Option<Ffmpeg>, OptionsError> {
        match self.target {
            Target::Movie(_, format) => Ok(Some(Ffmpeg::find(format)?)),
            Target::Images(_) => Ok(None),
        }
    }

    /// The frames of a series with these times.
    ///
    /// # Errors
    /// If there are none, or they have no files.
    pub fn plan(&self, times: &TimeAxis) -> Result<Plan, OptionsError> {
        let plan = self.times.plan(times, matches!(self.target, Target::Movie(..)))?;
        let frames = plan.frames.len();
        if let Target::Images(pattern) = &self.target
            && frames > 1
            && !pattern.is_numbered()
        {
            return Err(OptionsError::Refused(format!(
                "{frames} frames need a number in the file name, such as frame_%04d.png, or a movie"
            )));
        }
        Ok(plan)
    }

    /// The run of a scene that has had a request.
    ///
    /// # Errors
    /// If there is an encoder missing.
    pub fn run(
        &self,
        plan: Plan,
        ffmpeg: Option<Ffmpeg>,
        scene: &Scene,
        naming: &Naming<'_>,
    ) -> Result<Run, OptionsError> {
        let output = match (&self.target, ffmpeg) {
            (Target::Movie(path, _), Some(ffmpeg)) => {
                Output::Movie { path: path.clone(), ffmpeg, options: self.movie_options(scene, naming) }
            }
            (Target::Movie(path, _), None) => {
                let problem = format!("{}: no ffmpeg was looked for; please report this", path.display());
                return Err(OptionsError::Refused(problem));
            }
            (Target::Images(pattern), _) => {
                let options = self.still_options().map_err(OptionsError::Refused)?;
                Output::Images { pattern: pattern.clone(), options }
            }
        };
        let annotator = self.annotator(scene, naming.dataset);
        Ok(Run { annotator, resume: self.resume, replaces: self.replaces, ..Run::new(plan, output) })
    }

    /// The annotations over frames of a scene; `None` if nothing is drawn.
    pub fn annotator(&self, scene: &Scene, dataset: &str) -> Option<Annotator> {
        let field = scene.pipeline.field();
        let about =
            AboutSeries { dataset, field: &field.name, times: &scene.pipeline.times().values, time_units: None };
        let background = match self.target {
            Target::Movie(..) => Some(self.background.color().unwrap_or_default()),
            Target::Images(_) => self.background.color(),
        };
        let annotations = self.annotations.as_ref().filter(|annotations| **annotations != Annotations::default())?;
        Some(Annotator::new(annotations, &about, background))
    }

    /// How images are written.
    fn still_options(&self) -> Result<StillOptions, String> {
        let file = self.target.path(0);
        let is = |format| StillFormat::of(&file) == Some(format);
        let of_exr = [("--exr", self.exr.is_some()), ("--exr-compression", self.exr_compression.is_some())];
        if let Some((option, _)) = of_exr.iter().find(|(_, is_given)| *is_given && !is(StillFormat::Exr)) {
            return Err(format!("{option} is for EXR files; {} is none", file.display()));
        }
        if self.bit_depth.is_some() && !is(StillFormat::Png) && !is(StillFormat::Exr) {
            return Err(format!("--bit-depth is for PNG and EXR files; {} is none", file.display()));
        }
        if self.background != Background::Transparent && is(StillFormat::Exr) {
            return Err(format!("--background is for PNG files and movies; {} has opacity", file.display()));
        }
        Ok(StillOptions {
            background: self.background,
            png_depth: self.bits(is(StillFormat::Png))?,
            exr: ExrEncoding {
                color: self.exr.unwrap_or_default(),
                depth: self.bits(is(StillFormat::Exr))?,
                compression: self.exr_compression.unwrap_or_default(),
            },
        })
    }

    /// The requested bits per channel, if the files have that format.
    fn bits<D: Default + FromStr<Err = String>>(&self, is_its_format: bool) -> Result<D, String> {
        let asked = self.bit_depth.as_deref().filter(|_| is_its_format);
        let parse = |bits: &str| bits.parse().map_err(|e| format!("--bit-depth {bits}: {e}"));
        asked.map_or(Ok(D::default()), parse)
    }

    /// Metadata of the movie.
    fn movie_options(&self, scene: &Scene, naming: &Naming<'_>) -> MovieOptions {
        let field = scene.pipeline.field();
        let units = field.units.as_ref().map(|units| format!(" [{units}]")).unwrap_or_default();
        MovieOptions {
            size_px: self.size_px,
            rate: self.times.rate(),
            background: self.background,
            title: format!("{}: {}{units}", naming.dataset, field.name),
            comment: format!("{}; {}", FrameAttributes::SOFTWARE, naming.made_by),
        }
    }
}

/// Largest width or height of images: 32768 squared pixels of 16 bytes are 16 GiB.
pub const SIZE_MAX_PX: usize = 32_768;

/// Parses a width and height in pixels: `1024x768`.
///
/// # Errors
/// If the text is none, or they are 0 or above [`SIZE_MAX_PX`].
pub fn parse_size(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parts {
        Some((w, h)) if (1..=SIZE_MAX_PX).contains(&w) && (1..=SIZE_MAX_PX).contains(&h) => Ok((w, h)),
        Some(_) => Err(format!("width and height must be 1 to {SIZE_MAX_PX}")),
        None => Err("write WIDTHxHEIGHT, as in 1024x768".to_owned()),
    }
}
