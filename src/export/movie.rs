//! Movies, encoded by an ffmpeg process while the next frame renders.
//!
//! Frames go through a pipe as rgb24, fed by a thread of its own. The process writes to a temporary sibling of the movie, which is renamed
//! when the movie is complete. In all other cases the process is ended and the sibling removed.

use super::still::Background;
use super::written::Written;
use crate::error::{FileError, FileResult};
use crate::files;
use crate::image::RgbaImage;
use crate::task::Cancel;
use crossbeam::channel::{Receiver, SendTimeoutError, Sender, bounded};
use std::ffi::OsString;
use std::fmt;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::str::FromStr;
use std::thread::JoinHandle;
use std::time::Duration;
use tempfile::NamedTempFile;

/// Environment variable with the program to run in place of the `ffmpeg` on the path.
pub const FFMPEG_VARIABLE: &str = "TETREEL_FFMPEG";

/// A container for movies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MovieFormat {
    /// MPEG-4, H.264.
    Mp4,
    /// QuickTime, H.264.
    Mov,
    /// Matroska, H.264.
    Mkv,
    /// WebM, VP9.
    WebM,
}

impl MovieFormat {
    /// The format for a file name's extension, in upper or lower case.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_ascii_lowercase().to_str()? {
            "mp4" => Some(Self::Mp4),
            "mov" => Some(Self::Mov),
            "mkv" => Some(Self::Mkv),
            "webm" => Some(Self::WebM),
            _ => None,
        }
    }

    /// ffmpeg's name of the container.
    fn muxer(self) -> &'static str {
        match self {
            Self::Mp4 => "mp4",
            Self::Mov => "mov",
            Self::Mkv => "matroska",
            Self::WebM => "webm",
        }
    }

    /// ffmpeg's name of the encoder.
    fn encoder(self) -> &'static str {
        match self {
            Self::Mp4 | Self::Mov | Self::Mkv => "libx264",
            Self::WebM => "libvpx-vp9",
        }
    }

    /// Encoder options for nearly lossless quality at a speed that keeps up with rendering.
    fn encoder_options(self) -> &'static [&'static str] {
        match self {
            // The index precedes the data, so that a browser can start before the download ends.
            Self::Mp4 | Self::Mov => &["-preset", "medium", "-crf", "18", "-movflags", "+faststart"],
            Self::Mkv => &["-preset", "medium", "-crf", "18"],
            Self::WebM => &["-crf", "24", "-b:v", "0", "-deadline", "good", "-cpu-used", "3", "-row-mt", "1"],
        }
    }
}

/// Frames per second: a decimal number, or a fraction such as 30000/1001.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRate {
    numerator: f64,
    denominator: u32,
}

/// Slowest and fastest frame rate: timestamps of containers have limited size.
const FRAMES_PER_SECOND: std::ops::RangeInclusive<f64> = 0.01..=1000.0;

impl FrameRate {
    /// Frames per second.
    pub fn per_second(self) -> f64 {
        self.numerator / f64::from(self.denominator)
    }
}

impl Default for FrameRate {
    /// 25 frames per second.
    fn default() -> Self {
        Self { numerator: 25.0, denominator: 1 }
    }
}

impl FromStr for FrameRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (numerator, denominator) = text.split_once('/').unwrap_or((text, "1"));
        let parts = numerator.trim().parse().ok().zip(denominator.trim().parse().ok());
        let rate = parts.map(|(numerator, denominator)| Self { numerator, denominator });
        rate.filter(|rate| FRAMES_PER_SECOND.contains(&rate.per_second())).ok_or_else(|| {
            let (slowest, fastest) = FRAMES_PER_SECOND.into_inner();
            format!("write frames per second from {slowest} to {fastest}, as in 25, 23.976 or 30000/1001")
        })
    }
}

impl fmt::Display for FrameRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.denominator {
            1 => write!(f, "{}", self.numerator),
            denominator => write!(f, "{}/{denominator}", self.numerator),
        }
    }
}

/// Properties of a movie beside its frames.
#[derive(Clone, Debug)]
pub struct MovieOptions {
    /// Width and height of the frames in pixels. An odd size is padded by a column or row in the background colour: the movie's chroma has
    /// half the resolution.
    pub size_px: (usize, usize),
    /// Frames per second.
    pub rate: FrameRate,
    /// Background behind the volume; black if there is none, since a movie has no opacity.
    pub background: Background,
    /// Title, as players show it.
    pub title: String,
    /// How the movie was made.
    pub comment: String,
}

/// Why no movie was written.
#[derive(Clone, Debug, thiserror::Error)]
pub enum MovieError {
    /// An error of ffmpeg or the file system.
    #[error(transparent)]
    File(#[from] FileError),
    /// The export was cancelled.
    #[error("cancelled")]
    Cancelled,
}

/// An ffmpeg with an encoder for a format.
#[derive(Clone, Debug)]
pub struct Ffmpeg {
    program: OsString,
    format: MovieFormat,
}

impl Ffmpeg {
    /// Finds the program that `TETREEL_FFMPEG` names, else `ffmpeg` on the path, and checks its encoders.
    ///
    /// # Errors
    /// If there is no such program, it does not respond, or it lacks the encoder.
    pub fn find(format: MovieFormat) -> FileResult<Self> {
        let named = std::env::var_os(FFMPEG_VARIABLE).filter(|name| !name.is_empty());
        let program = named.unwrap_or_else(|| OsString::from("ffmpeg"));
        let remedy = format!("install ffmpeg, name one in {FFMPEG_VARIABLE}, or write images: frame_%04d.png");
        let mut command = Command::new(&program);
        command.args(["-hide_banner", "-loglevel", "error", "-encoders"]).stdin(Stdio::null());
        let answer = command.output().map_err(|e| FileError::io(&program, "run", &e).remedy(&remedy))?;
        if !answer.status.success() {
            let problem = format!("is asked for its encoders and ends with {}", answer.status);
            return Err(FileError::unsupported(&program, "", problem).remedy(remedy));
        }
        let listed = String::from_utf8_lossy(&answer.stdout);
        if !listed.split_whitespace().any(|word| word == format.encoder()) {
            let problem = format!("was built without the encoder {}", format.encoder());
            return Err(FileError::unsupported(&program, "", problem).remedy(remedy));
        }
        Ok(Self { program, format })
    }

    /// The command that encodes rgb24 frames from its standard input.
    fn command(&self, options: &MovieOptions, file: &Path) -> Command {
        let (width, height) = options.size_px;
        let [r, g, b] = background_rgb(options).map(to_byte);
        // Without an explicit matrix it would be BT.601, whatever the tags say.
        let filter = format!(
            "pad=w=ceil(iw/2)*2:h=ceil(ih/2)*2:x=0:y=0:color=0x{r:02x}{g:02x}{b:02x},\
             scale=out_color_matrix=bt709:out_range=tv:flags=bicubic+accurate_rnd+full_chroma_int,format=yuv420p"
        );
        // Without the prefix, a colon in the name would end a protocol name.
        let mut url = OsString::from("file:");
        url.push(file);
        let rate = options.rate.to_string();
        let mut command = Command::new(&self.program);
        command
            .args(["-hide_banner", "-loglevel", "error", "-xerror", "-nostdin", "-y"])
            .args(["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", &format!("{width}x{height}")])
            .args(["-framerate", &rate, "-i", "pipe:0", "-an", "-vf", &filter])
            .args(["-c:v", self.format.encoder()])
            .args(self.format.encoder_options())
            .args(["-pix_fmt", "yuv420p", "-r", &rate])
            .args(["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"])
            .args(["-metadata", &format!("title={}", options.title)])
            .args(["-metadata", &format!("comment={}", options.comment)])
            .args(["-f", self.format.muxer()])
            .arg(url)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        // Ctrl-C in a terminal goes to the whole process group; this process is ended by its writer instead, so that it finishes no half
        // movie.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command
    }
}

/// The background colour.
fn background_rgb(options: &MovieOptions) -> [f32; 3] {
    options.background.color().unwrap_or([0.0; 3])
}

fn to_byte(channel: f32) -> u8 {
    (channel * 255.0).round() as u8
}

/// Most frames waiting for the pipe: enough to keep the encoder busy, few enough to bound memory.
const QUEUE: usize = 2;
/// Interval between checks for cancellation while waiting for the encoder.
const PATIENCE: Duration = Duration::from_millis(20);
/// Time limit for the last messages of an ended process; reached only if its children hold its output open.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// Bytes kept of the process's messages, from the end.
const TAIL_BYTES: usize = 2000;
/// Lines of these that are shown.
const TAIL_LINES: usize = 4;

/// Writes one movie.
#[derive(Debug)]
pub struct MovieWriter {
    place: PathBuf,
    program: OsString,
    /// The temporary file, removed with this writer unless it has become the movie.
    file: Option<NamedTempFile>,
    size_px: (usize, usize),
    process: Child,
    queue: Option<Sender<RgbaImage>>,
    feeder: Option<JoinHandle<io::Result<usize>>>,
    messages: Receiver<String>,
}

impl MovieWriter {
    /// Starts the process. The folder of `place` must exist; an older movie there stays until the new one is complete.
    ///
    /// # Errors
    /// If the folder is not writable or the process does not start.
    pub fn start(ffmpeg: &Ffmpeg, place: &Path, options: &MovieOptions) -> FileResult<Self> {
        let file = files::sibling_file(place)?;
        let cannot_run = |e: &io::Error| FileError::io(&ffmpeg.program, "run", e);
        let mut process = ffmpeg.command(options, file.path()).spawn().map_err(|e| cannot_run(&e))?;
        let (pipe, mut errors) = (process.stdin.take(), process.stderr.take());
        let (queue, frames) = bounded(QUEUE);
        let background = background_rgb(options);
        let feeder = std::thread::spawn(move || feed(pipe, &frames, background));
        let (say, messages) = bounded(1);
        std::thread::spawn(move || {
            // The receiver is gone if the movie was cancelled.
            let _ = say.send(errors.as_mut().map(tail_of).unwrap_or_default());
        });
        Ok(Self {
            place: place.to_owned(),
            program: ffmpeg.program.clone(),
            file: Some(file),
            size_px: options.size_px,
            process,
            queue: Some(queue),
            feeder: Some(feeder),
            messages,
        })
    }

    /// Sends a frame; blocks while the encoder is behind.
    ///
    /// # Errors
    /// If the frame has another size than the movie or a pixel without colour, if the process has failed, or `cancel` was raised. Frames
    /// sent after an error are lost.
    pub fn send(&mut self, image: RgbaImage, cancel: &Cancel) -> Result<(), MovieError> {
        if (image.width, image.height) != self.size_px {
            let problem = format!("a frame of {} x {} pixels does not fit the movie", image.width, image.height);
            return Err(FileError::invalid(&self.place, "", problem).into());
        }
        if let Some((i, j)) = image.first_not_finite() {
            let place = format!("pixel ({i}, {j})");
            return Err(FileError::invalid(&self.place, place, "is not finite and has no colour").into());
        }
        let mut image = image;
        loop {
            let Some(queue) = &self.queue else { return Err(self.failure("has failed before", "")) };
            match queue.send_timeout(image, PATIENCE) {
                Ok(()) => return Ok(()),
                Err(SendTimeoutError::Timeout(_)) if cancel.is_cancelled() => return Err(MovieError::Cancelled),
                Err(SendTimeoutError::Timeout(unsent)) => image = unsent,
                // The feeder ends early only when the process no longer reads.
                Err(SendTimeoutError::Disconnected(_)) => {
                    self.end(cancel)?;
                    return Err(self.failure("no longer reads", ""));
                }
            }
        }
    }

    /// Counts what the encoder has written so far.
    pub fn count(&self, count: &Written) {
        if let Some(file) = &self.file {
            count.set(file.path());
        }
    }

    /// Waits for the encoder and moves the movie into place. Returns the number of frames.
    ///
    /// # Errors
    /// If the process fails, the file cannot be moved into place, or `cancel` was raised: an older movie is then unchanged.
    pub fn finish(mut self, cancel: &Cancel) -> Result<usize, MovieError> {
        let frames = self.end(cancel)?;
        // Checked by path: the process may have replaced the file.
        let written = |file: &NamedTempFile| std::fs::metadata(file).is_ok_and(|m| m.len() > 0);
        let Some(file) = self.file.take().filter(written) else {
            return Err(self.failure(&format!("wrote nothing for {frames} frames"), ""));
        };
        file.persist(&self.place).map_err(|e| FileError::io(&self.place, "write", &e.error))?;
        Ok(frames)
    }

    /// Closes the pipe, waits for the process and returns the number of frames that it read.
    fn end(&mut self, cancel: &Cancel) -> Result<usize, MovieError> {
        self.queue = None;
        let status = loop {
            if cancel.is_cancelled() {
                return Err(MovieError::Cancelled);
            }
            let ended = self.process.try_wait();
            match ended.map_err(|e| FileError::io(&self.program, "wait for", &e))? {
                Some(status) => break status,
                None => std::thread::sleep(PATIENCE),
            }
        };
        let fed = match self.feeder.take().map(JoinHandle::join) {
            None => Ok(0),
            Some(Ok(result)) => result,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        };
        // The error messages of the process at its end.
        let said = self.messages.recv_timeout(LAST_WORDS).unwrap_or_default();
        match fed {
            // A full disk may not show in the exit status: an index that could not be written is only an error message.
            Ok(frames) if status.success() && said.is_empty() => Ok(frames),
            Err(_) if status.success() => Err(self.failure("ended before it had read all frames", &said)),
            Ok(_) | Err(_) => Err(self.failure(&format!("ended with {status}"), &said)),
        }
    }

    fn failure(&self, what: &str, said: &str) -> MovieError {
        let colon = if said.is_empty() { "" } else { ": " };
        let problem = io::Error::other(format!("{} {what}{colon}{said}", self.program.display()));
        FileError::io(&self.place, "encode", &problem).into()
    }
}

impl Drop for MovieWriter {
    /// Ends a process that is still running: its output is not wanted.
    fn drop(&mut self) {
        self.queue = None;
        if matches!(self.process.try_wait(), Ok(Some(_))) {
            return;
        }
        // The process may have ended by itself; that is no failure.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Writes frames into the pipe until there are no more; returns their number.
fn feed(pipe: Option<ChildStdin>, frames: &Receiver<RgbaImage>, background: [f32; 3]) -> io::Result<usize> {
    let mut pipe = pipe.ok_or(io::ErrorKind::BrokenPipe)?;
    let mut count = 0;
    let mut bytes = Vec::new();
    for image in frames {
        bytes.clear();
        bytes.extend(image.over(background).into_iter().flatten().map(to_byte));
        pipe.write_all(&bytes)?;
        count += 1;
    }
    Ok(count)
}

/// The last lines of a stream, joined into one.
fn tail_of(stream: &mut impl Read) -> String {
    let mut tail = Vec::new();
    let mut chunk = [0; 4096];
    while let Ok(n @ 1..) = stream.read(&mut chunk) {
        tail.extend_from_slice(&chunk[..n]);
        tail.drain(..tail.len().saturating_sub(TAIL_BYTES));
    }
    let text = String::from_utf8_lossy(&tail);
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    lines[lines.len().saturating_sub(TAIL_LINES)..].join(" | ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_rates_are_decimal_or_fractions() {
        let rate = |text: &str| text.parse::<FrameRate>().map(|r| (r.to_string(), r.per_second()));
        assert_eq!(rate("25"), Ok(("25".to_owned(), 25.0)));
        assert_eq!(rate("23.976"), Ok(("23.976".to_owned(), 23.976)));
        assert_eq!(rate("30000/1001"), Ok(("30000/1001".to_owned(), 30000.0 / 1001.0)));
        for bad in ["", "0", "-25", "nan", "inf", "1/0", "25 fps", "1e9", "25/1.5"] {
            assert!(rate(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_extension_chooses_the_container() {
        let of = |name: &str| MovieFormat::of(Path::new(name));
        assert_eq!(of("a/B.MP4"), Some(MovieFormat::Mp4));
        assert_eq!(of("a.b.webm"), Some(MovieFormat::WebM));
        assert_eq!([of("mp4"), of("a.avi"), of("")], [None; 3]);
    }

    #[test]
    fn only_the_last_lines_of_a_long_complaint_are_kept() {
        let text: String = (0..10_000).map(|n| format!("line {n}\n\n")).collect();
        assert_eq!(tail_of(&mut text.as_bytes()), "line 9996 | line 9997 | line 9998 | line 9999");
        assert_eq!(tail_of(&mut &b""[..]), "");
    }
}
