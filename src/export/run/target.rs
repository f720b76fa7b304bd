//! The output of a run: numbered images, one image, or a movie.

use crate::error::{FileError, FileResult};
use crate::export::movie::MovieFormat;
use crate::export::sequence::FramePattern;
use crate::export::still::StillFormat;
use crate::files;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The output of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// Images, numbered or a single one.
    Images(FramePattern),
    /// A movie.
    Movie(PathBuf, MovieFormat),
}

impl Target {
    /// Parses a file name or a pattern.
    ///
    /// # Errors
    /// If its extension is neither an image's nor a movie's, or the pattern is invalid.
    pub fn parse(word: OsString) -> FileResult<Self> {
        let path = Path::new(&word);
        let is_movie = MovieFormat::of(path);
        if is_movie.is_none() && StillFormat::of(path).is_none() {
            let problem = "is neither an image (.png, .exr) nor a movie (.mp4, .mov, .mkv, .webm)";
            return Err(FileError::unsupported(path, "", problem).remedy("write, for example, frame_%04d.png"));
        }
        let Some(format) = is_movie else { return FramePattern::new(path).map(Self::Images) };
        let no_number = || {
            FileError::unsupported(path, "", "a movie is one file and has no number in its name")
                .remedy("write, for example, movie.mp4")
        };
        let mut plain = Vec::new();
        let mut rest = word.as_encoded_bytes();
        while let Some((&first, after)) = rest.split_first() {
            plain.push(first);
            // A literal percent sign is doubled, as in the names of images.
            rest = if first == b'%' { after.strip_prefix(b"%").ok_or_else(no_number)? } else { after };
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

    /// Checks that the output can be written, as far as possible in advance.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn check_place(&self) -> FileResult<()> {
        let path = self.path(0);
        if let Self::Movie(..) = self {
            return files::check_place(&path);
        }
        if path.is_dir() {
            return Err(FileError::invalid(&path, "", "is a folder").remedy("choose another name"));
        }
        // Folders of images are created with the first one.
        let folder = files::parent_of(&path).ancestors().find(|f| f.exists()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            return Err(FileError::invalid(folder, "", "is not a folder").remedy("choose another name"));
        }
        tempfile::tempfile_in(folder).map(|_| ()).map_err(|e| FileError::io(&path, "write", &e))
    }
}

/// A file name or pattern in a folder; a % in the folder's name is doubled, as it is no pattern.
pub fn pattern_in(folder: &Path, pattern: &Path) -> PathBuf {
    if pattern.is_absolute() {
        return pattern.to_owned();
    }
    let mut bytes = Vec::new();
    for &byte in folder.as_os_str().as_encoded_bytes() {
        bytes.extend_from_slice(if byte == b'%' { b"%%" } else { std::slice::from_ref(&byte) });
    }
    files::os_string(bytes).map_or_else(|| folder.to_owned(), PathBuf::from).join(pattern)
}
