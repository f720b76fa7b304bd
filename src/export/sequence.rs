//! Sequences of numbered images, encoded and written while the next frame renders.

use super::numbered::NumberedPath;
use super::still::{OutputFrame, StillFormat, StillOptions, write_still};
use super::written::Written;
use crate::error::{FileError, FileResult};
use crossbeam::channel::{Sender, bounded};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::thread::JoinHandle;

/// A file name pattern for images with the number of the frame: `frame_%04d.png`, `%d` for no leading zeros, `%%` for a percent sign.
/// Without a number it names a single frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramePattern(NumberedPath);

impl FramePattern {
    /// Parses a pattern.
    ///
    /// # Errors
    /// If there are two numbers, a conversion other than %d, or the file is neither .png nor .exr.
    pub fn new(path: &Path) -> FileResult<Self> {
        const EXAMPLE: &str = "frame_%04d.png";
        let pattern = NumberedPath::new(path, EXAMPLE)?;
        if StillFormat::of(path).is_none() {
            let problem = "only .png and .exr images can be written";
            return Err(FileError::unsupported(path, "", problem).remedy(format!("write, for example, {EXAMPLE}")));
        }
        Ok(Self(pattern))
    }

    /// Whether the pattern has a number.
    pub fn is_numbered(&self) -> bool {
        self.0.is_numbered()
    }

    /// The path of frame `n`.
    pub fn path(&self, n: usize) -> PathBuf {
        self.0.path(n)
    }
}

impl FromStr for FramePattern {
    type Err = FileError;

    fn from_str(text: &str) -> Result<Self, FileError> {
        Self::new(Path::new(text))
    }
}

/// Most frames waiting to be encoded: enough to keep the writer busy, few enough to bound memory.
const QUEUE: usize = 2;

/// Encodes and writes images on a thread of its own. Each file appears complete or not at all.
#[derive(Debug)]
pub struct FrameWriter {
    queue: Option<Sender<(OutputFrame, PathBuf)>>,
    thread: Option<JoinHandle<FileResult<usize>>>,
}

impl FrameWriter {
    /// Starts the thread, which counts what it has written.
    pub fn new(options: StillOptions, count: Written) -> Self {
        let (queue, frames) = bounded::<(OutputFrame, PathBuf)>(QUEUE);
        let thread = std::thread::spawn(move || {
            let mut written = 0;
            for (frame, path) in frames {
                if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
                    std::fs::create_dir_all(parent).map_err(|e| FileError::io(parent, "make the folder", &e))?;
                }
                write_still(&path, &frame, &options)?;
                count.add(&path);
                written += 1;
            }
            Ok(written)
        });
        Self { queue: Some(queue), thread: Some(thread) }
    }

    /// Sends a frame; blocks while the writer is behind.
    ///
    /// # Errors
    /// If an earlier frame could not be written.
    pub fn send(&mut self, frame: OutputFrame, path: PathBuf) -> FileResult<()> {
        let sent = self.queue.as_ref().is_some_and(|queue| queue.send((frame, path)).is_ok());
        if sent { Ok(()) } else { self.finish().map(|_| ()) }
    }

    /// Waits until all frames are written and returns their number; 0 if called again.
    ///
    /// # Errors
    /// If a frame could not be written.
    pub fn finish(&mut self) -> FileResult<usize> {
        self.queue = None;
        match self.thread.take().map(JoinHandle::join) {
            None => Ok(0),
            Some(Ok(result)) => result,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Planes, RgbaImage};

    #[test]
    fn patterns_place_the_number_of_the_frame() {
        let path = |pattern: &str, n| pattern.parse::<FramePattern>().unwrap().path(n).display().to_string();
        assert_eq!(path("out/frame_%04d.png", 7), "out/frame_0007.png");
        assert_eq!(path("f%d_x.PNG", 12345), "f12345_x.PNG");
        assert_eq!(path("f%02d.png", 12345), "f12345.png");
        assert_eq!(path("50%%_%d.png", 3), "50%_3.png");
        assert_eq!(path("one.png", 3), "one.png");
        assert_eq!(path("raw_%03d.exr", 3), "raw_003.exr");
    }

    #[cfg(unix)]
    #[test]
    fn patterns_may_be_no_unicode() {
        use std::os::unix::ffi::OsStrExt;
        let os = |bytes: &[u8]| PathBuf::from(std::ffi::OsStr::from_bytes(bytes));
        let pattern = FramePattern::new(&os(b"o\xff%%/f_%03d\xfe.png")).unwrap();
        assert_eq!(pattern.path(7), os(b"o\xff%/f_007\xfe.png"));
        assert_eq!(FramePattern::new(&os(b"\xff.exr")).unwrap().path(7), os(b"\xff.exr"));
        for bad in [&b"\xff_%d_%d.png"[..], b"\xff_%s.png", b"\xff_%\xff.png", b"\xff_%d.jpg", b"\xff%"] {
            assert!(FramePattern::new(&os(bad)).is_err(), "{}", os(bad).display());
        }
    }

    #[test]
    fn patterns_that_mean_nothing_are_refused() {
        for bad in ["a_%d_%d.png", "a_%s.png", "a_%04d.jpg", "a_%d", "100%", "a_%99d.png"] {
            assert!(bad.parse::<FramePattern>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_frame_that_cannot_be_written_is_reported() {
        let dir = tempfile::tempdir().unwrap();
        let blocked = dir.path().join("file");
        std::fs::write(&blocked, "in the way").unwrap();
        let frame = || OutputFrame {
            planes: Planes { color: RgbaImage::new(2, 2), ..Planes::default() },
            ..Default::default()
        };
        let count = Written::default();
        let mut writer = FrameWriter::new(StillOptions::default(), count.clone());
        writer.send(frame(), dir.path().join("a.png")).unwrap();
        let _ = writer.send(frame(), blocked.join("b.png"));
        assert!(writer.finish().is_err());
        assert_eq!(count.bytes(), dir.path().join("a.png").metadata().unwrap().len());
    }
}
