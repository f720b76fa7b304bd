//! Writes the frames of a run in order.

use super::RunError;
use crate::export::Written;
use crate::export::movie::MovieWriter;
use crate::export::sequence::FrameWriter;
use crate::export::still::OutputFrame;
use crate::task::Cancel;
use std::path::Path;

/// Writer of a run's frames, in order.
pub(super) enum Sink {
    /// Writes images.
    Images(FrameWriter),
    /// Writes a movie, and counts its bytes.
    Movie(Box<MovieWriter>, Written),
}

impl Sink {
    /// Sends a frame; blocks while writing is behind.
    pub(super) fn send(&mut self, frame: OutputFrame, file: &Path, cancel: &Cancel) -> Result<(), RunError> {
        match self {
            Self::Images(writer) => Ok(writer.send(frame, file.to_owned())?),
            Self::Movie(writer, count) => {
                writer.count(count);
                writer.send(frame.planes.color, cancel).map_err(RunError::from)
            }
        }
    }

    /// Waits until all frames are written. After a failure, rendered images are still written, a partial movie only if `keep` is set.
    pub(super) fn finish(self, keep: bool, cancel: &Cancel) -> Result<(), RunError> {
        match self {
            Self::Images(mut writer) => Ok(writer.finish().map(|_| ())?),
            Self::Movie(writer, _) if keep => writer.finish(cancel).map(|_| ()).map_err(RunError::from),
            Self::Movie(..) => Ok(()),
        }
    }
}
