//! The values behind a header or in a file of their own.

use crate::error::{FileError, FileResult};
use crate::files;
use crate::import::numbers::{Number, parse_ascii};
use flate2::read::{MultiGzDecoder, ZlibDecoder};
use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;

/// How values are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Raw,
    Gzip,
    Zlib,
    Text,
}

/// Where values begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Start {
    /// At this byte of the file.
    Byte(u64),
    /// So that they end with the file.
    Last,
}

/// The values of all steps.
pub(super) struct Data {
    pub(super) path: PathBuf,
    pub(super) start: Start,
    /// Bytes that are passed once the data are decompressed.
    pub(super) skip: u64,
    pub(super) encoding: Encoding,
}

impl Data {
    /// Bytes of the file.
    ///
    /// # Errors
    /// If it is missing.
    pub(super) fn file_bytes(&self) -> FileResult<u64> {
        let metadata = std::fs::metadata(&self.path).map_err(|e| FileError::io(&self.path, "read", &e))?;
        Ok(metadata.len())
    }

    /// Checks that there are numbers of so many bytes in all.
    ///
    /// # Errors
    /// If there are fewer.
    pub(super) fn check(&self, bytes: u64, number: Number) -> FileResult<()> {
        let file = self.file_bytes()?;
        let there = match (self.encoding, self.start) {
            (Encoding::Raw, Start::Byte(start)) => file.saturating_sub(start).saturating_sub(self.skip),
            (Encoding::Raw, Start::Last) => file,
            // Two bytes for a number, but one for the last.
            (Encoding::Text, _) => (file / 2 + 1).saturating_mul(number.size() as u64),
            _ => {
                let mut reader = self.reader(bytes)?.take(bytes);
                std::io::copy(&mut reader, &mut std::io::sink()).map_err(|e| self.unpacking(&e))?
            }
        };
        if there >= bytes {
            return Ok(());
        }
        let problem = format!("has {there} bytes of values, of {bytes} that the header claims");
        Err(FileError::invalid(&self.path, "", problem)
            .remedy("correct the sizes in the header, or copy the file again"))
    }

    /// Reads step `step`, of so many bytes, of `steps`; text becomes numbers with the lowest byte first.
    ///
    /// # Errors
    /// If the values are damaged.
    pub(super) fn read(&self, step: usize, steps: usize, bytes: usize, number: Number) -> FileResult<Vec<u8>> {
        let before = (step as u64).saturating_mul(bytes as u64);
        let cut = || {
            FileError::invalid(&self.path, format!("step {step}"), "ends before its values do")
                .remedy("copy the file again")
        };
        let mut out = Vec::new();
        let all = (bytes as u64).saturating_mul(steps as u64);
        let mut reader = self.reader(all)?;
        if self.encoding == Encoding::Text {
            reader.read_to_end(&mut out).map_err(|e| self.unpacking(&e))?;
            let invalid = |problem: String| FileError::invalid(&self.path, "values", problem);
            let parsed = parse_ascii(number, &out).map_err(invalid)?;
            let from = usize::try_from(before).unwrap_or(usize::MAX);
            return Ok(parsed.get(from..from.saturating_add(bytes)).ok_or_else(cut)?.to_vec());
        }
        self.pass(&mut reader, before)?;
        reader.take(bytes as u64).read_to_end(&mut out).map_err(|e| self.unpacking(&e))?;
        if out.len() == bytes { Ok(out) } else { Err(cut()) }
    }

    /// The values from their beginning on, `all` bytes.
    fn reader(&self, all: u64) -> FileResult<Box<dyn Stream>> {
        let mut file = files::open(&self.path)?;
        let start = match self.start {
            Start::Byte(start) => start,
            Start::Last => self.file_bytes()?.saturating_sub(all),
        };
        file.seek(SeekFrom::Start(start)).map_err(|e| FileError::io(&self.path, "read", &e))?;
        let mut reader: Box<dyn Stream> = match self.encoding {
            Encoding::Raw | Encoding::Text => Box::new(Plain(file)),
            Encoding::Gzip => Box::new(Packed(MultiGzDecoder::new(file))),
            Encoding::Zlib => Box::new(Packed(ZlibDecoder::new(file))),
        };
        self.pass(&mut reader, self.skip)?;
        Ok(reader)
    }

    fn pass(&self, reader: &mut Box<dyn Stream>, bytes: u64) -> FileResult<()> {
        reader.pass(bytes).map_err(|e| self.unpacking(&e))
    }

    fn unpacking(&self, error: &std::io::Error) -> FileError {
        FileError::invalid(&self.path, "values", format!("cannot be read: {error}")).remedy("copy the file again")
    }
}

/// Bytes of which some can be passed.
trait Stream: Read {
    fn pass(&mut self, bytes: u64) -> std::io::Result<()>;
}

struct Plain(std::fs::File);
struct Packed<R>(R);

impl Read for Plain {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(out)
    }
}

impl Stream for Plain {
    fn pass(&mut self, bytes: u64) -> std::io::Result<()> {
        let to = self.0.stream_position()?.saturating_add(bytes).min(i64::MAX as u64);
        self.0.seek(SeekFrom::Start(to)).map(drop)
    }
}

impl<R: Read> Read for Packed<R> {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(out)
    }
}

impl<R: Read> Stream for Packed<R> {
    fn pass(&mut self, bytes: u64) -> std::io::Result<()> {
        std::io::copy(&mut (&mut self.0).take(bytes), &mut std::io::sink()).map(drop)
    }
}
