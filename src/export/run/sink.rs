//! Writes the frames of a run in order.

use super::RunError;
use crate::error::FileResult;
use crate::export::movie::{Ffmpeg, MovieOptions, MovieWriter};
use crate::export::sequence::FrameWriter;
use crate::export::still::{OutputFrame, StillOptions};
use crate::task::Cancel;
use std::path::Path;

/// Writer of a run's frames, in order.
pub(super) enum Sink {
    /// Writes images.
    Images(FrameWriter),
    /// Writes a movie.
    Movie(Box<MovieWriter>),
}

impl Sink {
    /// A sink for images.
    pub(super) fn images(options: StillOptions) -> Self {
        Self::Images(FrameWriter::new(options))
    }

    /// A sink for a movie at `place`.
    pub(super) fn movie(ffmpeg: &Ffmpeg, place: &Path, options: &MovieOptions) -> FileResult<Self> {
        Ok(Self::Movie(Box::new(MovieWriter::start(ffmpeg, place, options)?)))
    }

    /// Sends a frame; blocks while writing is behind.
    pub(super) fn send(&mut self, frame: OutputFrame, file: &Path, cancel: &Cancel) -> Result<(), RunError> {
        match self {
            Self::Images(writer) => Ok(writer.send(frame, file.to_owned())?),
            Self::Movie(writer) => writer.send(frame.planes.color, cancel).map_err(RunError::from),
        }
    }

    /// Waits until all frames are written. After a failure, rendered images are still written, a partial movie only if `keep` is set.
    pub(super) fn finish(self, keep: bool, cancel: &Cancel) -> Result<(), RunError> {
        match self {
            Self::Images(mut writer) => Ok(writer.finish().map(|_| ())?),
            Self::Movie(writer) if keep => writer.finish(cancel).map(|_| ()).map_err(RunError::from),
            Self::Movie(_) => Ok(()),
        }
    }
}
