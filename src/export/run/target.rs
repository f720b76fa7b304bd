//! Where the frames of a run go: numbered images, one image, or a movie.

use crate::error::{FileError, FileResult};
use crate::export::movie::MovieFormat;
use crate::export::sequence::FramePattern;
use crate::export::still::StillFormat;
use crate::files;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Where frames go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// Images, numbered or one.
    Images(FramePattern),
    /// A movie.
    Movie(PathBuf, MovieFormat),
}

impl Target {
    /// Reads the name of a file or a pattern of names.
    ///
    /// # Errors
    /// If it is neither an image nor a movie by its ending, or a pattern that has no meaning.
    pub fn parse(word: OsString) -> FileResult<Self> {
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
    pub fn path(&self, frame: usize) -> PathBuf {
        match self {
            Self::Images(pattern) => pattern.path(frame),
            Self::Movie(path, _) => path.clone(),
        }
    }

    /// Whether frames can go there, as far as that can be known before they exist.
    ///
    /// # Errors
    /// If they cannot.
    pub fn check_place(&self) -> FileResult<()> {
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
