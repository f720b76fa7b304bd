//! Where frames go: numbered images, one image, or a movie.

use super::super::Interrupted;
use super::super::progress::Terminal;
use crate::error::{FileError, FileResult};
use crate::export::movie::{Ffmpeg, MovieError, MovieFormat, MovieOptions, MovieWriter};
use crate::export::sequence::{FramePattern, FrameWriter};
use crate::export::still::{OutputFrame, StillFormat, StillOptions};
use crate::files;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// What `--output` names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// Images, numbered or one.
    Images(FramePattern),
    /// A movie.
    Movie(PathBuf, MovieFormat),
}

impl Target {
    /// Reads the word behind `--output`.
    pub(super) fn parse(word: OsString) -> FileResult<Self> {
        let path = Path::new(&word);
        let is_movie = MovieFormat::of(path);
        if is_movie.is_none() && StillFormat::of(path).is_none() {
            let problem = "is neither an image (.png, .exr) nor a movie (.mp4, .mov, .mkv, .webm)";
            return Err(FileError::unsupported(path, "", problem).remedy("write, for example, frame_%04d.png"));
        }
        let Some(format) = is_movie else { return FramePattern::new(path).map(Self::Images) };
        let mut plain = Vec::new();
        let mut rest = word.as_encoded_bytes();
        while let Some((&first, after)) = rest.split_first() {
            plain.push(first);
            // A percent sign is doubled, as in the names of images.
            rest = if first == b'%' { after.strip_prefix(b"%").ok_or_else(|| no_number(path))? } else { after };
        }
        let plain = files::os_string(plain).unwrap_or_else(|| word.clone());
        Ok(Self::Movie(plain.into(), format))
    }

    /// The file of a frame.
    pub(super) fn path(&self, frame: usize) -> PathBuf {
        match self {
            Self::Images(pattern) => pattern.path(frame),
            Self::Movie(path, _) => path.clone(),
        }
    }

    /// Whether frames can go there, as far as that can be known before they exist.
    pub(super) fn check_place(&self) -> FileResult<()> {
        let path = self.path(0);
        if path.is_dir() {
            return Err(FileError::invalid(&path, "", "is a folder").remedy("choose another name"));
        }
        let folder = match self {
            // The folders of images are made when the first one is there.
            Self::Images(_) => {
                files::parent_of(&path).ancestors().map(or_here).find(|f| f.exists()).unwrap_or(Path::new("."))
            }
            Self::Movie(..) => {
                files::check_place(&path)?;
                files::parent_of(&path)
            }
        };
        if !folder.is_dir() {
            return Err(FileError::invalid(folder, "", "is not a folder").remedy("choose another name"));
        }
        tempfile::tempfile_in(folder).map(|_| ()).map_err(|e| FileError::io(&path, "write", &e))
    }
}

fn no_number(path: &Path) -> FileError {
    FileError::unsupported(path, "", "a movie is one file and has no number in its name")
        .remedy("write, for example, movie.mp4")
}

/// The current folder has an empty name as an ancestor.
fn or_here(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

/// Takes frames in order.
pub(super) enum Sink {
    /// Images.
    Images(FrameWriter),
    /// A movie.
    Movie(Box<MovieWriter>),
}

impl Sink {
    /// Images.
    pub(super) fn images(options: StillOptions) -> Self {
        Self::Images(FrameWriter::new(options))
    }

    /// A movie at `place`.
    pub(super) fn movie(ffmpeg: &Ffmpeg, place: &Path, options: &MovieOptions) -> FileResult<Self> {
        Ok(Self::Movie(Box::new(MovieWriter::start(ffmpeg, place, options)?)))
    }

    /// Hands over a frame; waits if writing is behind.
    pub(super) fn send(&mut self, frame: OutputFrame, file: &Path, terminal: &Terminal) -> anyhow::Result<()> {
        match self {
            Self::Images(writer) => Ok(writer.send(frame, file.to_owned())?),
            Self::Movie(writer) => writer.send(frame.planes.color, &terminal.cancel).map_err(interrupted),
        }
    }

    /// Waits until all is written. After a failure images already rendered are written nevertheless, half a movie only if
    /// `keep` is set.
    pub(super) fn finish(self, keep: bool, terminal: &Terminal) -> anyhow::Result<()> {
        match self {
            Self::Images(mut writer) => Ok(writer.finish().map(|_| ())?),
            Self::Movie(writer) if keep => writer.finish(&terminal.cancel).map(|_| ()).map_err(interrupted),
            Self::Movie(_) => Ok(()),
        }
    }
}

fn interrupted(error: MovieError) -> anyhow::Error {
    match error {
        MovieError::Cancelled => Interrupted.into(),
        MovieError::File(error) => error.into(),
    }
}
