//! The file from which an interrupted import goes on: a line with the version, then arrays, then a CRC-32C of everything before.
//!
//! An array is its length in bytes as u64, and its elements, little-endian. What the arrays mean is known to those who write and read them,
//! in the same order.

use crate::codec::{Element, to_bytes};
use crate::error::{FileError, FileResult};
use crate::files;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// How the first line begins in every version.
const KIND: &[u8] = b"tetreel checkpoint ";
/// The rest of the first line: the version of the arrays.
const VERSION: &[u8] = b"1\n";
/// Bytes of the checksum at the end.
const CHECKSUM_BYTES: u64 = 4;
/// Bytes that are checked at a time.
const PIECE_BYTES: usize = 1 << 16;

/// Writes a checkpoint.
#[derive(Debug)]
pub struct CheckpointWriter {
    path: PathBuf,
    file: BufWriter<File>,
    checksum: u32,
}

impl CheckpointWriter {
    pub(super) fn create(path: &Path) -> FileResult<Self> {
        let file = File::create(path).map_err(|e| FileError::io(path, "write", &e))?;
        let mut to = Self { path: path.to_owned(), file: BufWriter::new(file), checksum: 0 };
        to.write(KIND)?;
        to.write(VERSION)?;
        Ok(to)
    }

    fn write(&mut self, bytes: &[u8]) -> FileResult<()> {
        self.checksum = crc32c::crc32c_append(self.checksum, bytes);
        self.file.write_all(bytes).map_err(|e| FileError::io(&self.path, "write", &e))
    }

    /// Writes an array.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn put<T: Element>(&mut self, values: &[T]) -> FileResult<()> {
        self.write(&(size_of_val(values) as u64).to_le_bytes())?;
        self.write(&to_bytes(values))
    }

    /// Writes the checksum, and makes the file durable.
    pub(super) fn finish(mut self) -> FileResult<()> {
        let checksum = self.checksum.to_le_bytes();
        let written = self.file.write_all(&checksum).and_then(|()| self.file.flush());
        written.and_then(|()| self.file.get_ref().sync_all()).map_err(|e| FileError::io(&self.path, "write", &e))
    }
}

/// Reads a checkpoint whose checksum is right.
#[derive(Debug)]
pub struct CheckpointReader {
    path: PathBuf,
    file: BufReader<File>,
    /// Bytes before the checksum that were not read yet.
    left: u64,
}

impl CheckpointReader {
    pub(super) fn open(path: &Path) -> FileResult<Self> {
        let io = |e: std::io::Error| FileError::io(path, "read", &e);
        let file = files::open(path)?;
        let bytes = file.metadata().map_err(io)?.len();
        let mut from = Self { path: path.to_owned(), file: BufReader::new(file), left: bytes };
        from.left = bytes.checked_sub(CHECKSUM_BYTES).ok_or_else(|| from.damaged())?;
        let mut kind = [0; KIND.len()];
        if !from.has(KIND.len() as u64) || !from.fill(&mut kind).is_ok_and(|()| kind == KIND) {
            return Err(from.damaged());
        }
        let mut version = [0; VERSION.len()];
        if !from.has(VERSION.len() as u64) {
            return Err(from.damaged());
        }
        from.fill(&mut version)?;
        if version != VERSION {
            let problem = "is of another version of tetreel";
            return Err(remedy(FileError::unsupported(path, "", problem), path));
        }
        from.check_sum(crc32c::crc32c_append(crc32c::crc32c(KIND), VERSION))?;
        Ok(from)
    }

    /// Compares the checksum of the rest with that at the end, and goes back.
    fn check_sum(&mut self, mut checksum: u32) -> FileResult<()> {
        let start = (KIND.len() + VERSION.len()) as u64;
        let (end, mut piece) = (self.left, vec![0; PIECE_BYTES]);
        while self.left > 0 {
            let length = self.left.min(PIECE_BYTES as u64) as usize;
            self.fill(&mut piece[..length])?;
            checksum = crc32c::crc32c_append(checksum, &piece[..length]);
        }
        let mut stored = [0; CHECKSUM_BYTES as usize];
        self.left = CHECKSUM_BYTES;
        self.fill(&mut stored)?;
        if stored != checksum.to_le_bytes() {
            return Err(self.damaged());
        }
        self.left = end;
        self.file.seek(SeekFrom::Start(start)).map_err(|e| FileError::io(&self.path, "read", &e))?;
        Ok(())
    }

    fn has(&self, bytes: u64) -> bool {
        bytes <= self.left
    }

    fn fill(&mut self, bytes: &mut [u8]) -> FileResult<()> {
        self.file.read_exact(bytes).map_err(|e| FileError::io(&self.path, "read", &e))?;
        self.left -= bytes.len() as u64;
        Ok(())
    }

    /// Reads the next array.
    ///
    /// # Errors
    /// If there is none, or it has elements of another size.
    pub fn take<T: Element>(&mut self) -> FileResult<Vec<T>> {
        let mut length = [0; size_of::<u64>()];
        if !self.has(length.len() as u64) {
            return Err(self.damaged());
        }
        self.fill(&mut length)?;
        let length = u64::from_le_bytes(length);
        if !self.has(length) || length % size_of::<T>() as u64 != 0 {
            return Err(self.damaged());
        }
        // The file is as long.
        let mut values = vec![T::zeroed(); (length / size_of::<T>() as u64) as usize];
        self.fill(bytemuck::cast_slice_mut(&mut values))?;
        if cfg!(target_endian = "big") {
            values.iter_mut().for_each(|value| *value = value.reversed());
        }
        Ok(values)
    }

    /// The error that the file is damaged.
    pub fn damaged(&self) -> FileError {
        remedy(FileError::invalid(&self.path, "", "is damaged: the import cannot go on"), &self.path)
    }

    /// The error that the import was begun otherwise.
    pub fn differs(&self, problem: String) -> FileError {
        remedy(FileError::invalid(files::parent_of(&self.path), "", problem), &self.path)
    }
}

/// An error of a checkpoint with its remedy.
fn remedy(error: FileError, checkpoint: &Path) -> FileError {
    error.remedy(without(files::parent_of(checkpoint)))
}

/// What can be done without what is in the folder of an unfinished import.
pub(super) fn without(folder: &Path) -> String {
    format!("remove {} to begin again, or leave --resume out", folder.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back_and_no_damage_goes_unnoticed() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("checkpoint");
        let mut to = CheckpointWriter::create(&path).unwrap();
        to.put(&[1.5, f64::NAN]).unwrap();
        to.put::<u32>(&[]).unwrap();
        to.put(&[7u8, 8, 9]).unwrap();
        to.finish().unwrap();
        let mut from = CheckpointReader::open(&path).unwrap();
        assert_eq!(from.take::<f64>().unwrap().map_bits(), [1.5f64, f64::NAN].map(f64::to_bits));
        assert!(from.take::<u32>().unwrap().is_empty());
        assert!(from.take::<u32>().unwrap_err().to_string().contains("is damaged"), "3 bytes are no numbers");
        let mut from = CheckpointReader::open(&path).unwrap();
        from.take::<f64>().unwrap();
        from.take::<u8>().unwrap();
        assert_eq!(from.take::<u8>().unwrap(), [7, 8, 9]);
        assert!(from.take::<u8>().is_err(), "there are no more");

        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = CheckpointReader::open(&path).unwrap_err().to_string();
            assert!(error.contains("checkpoint") && error.contains("leave --resume out"), "{length}: {error}");
        }
        for at in 0..8 * whole.len() {
            let mut bytes = whole.clone();
            bytes[at / 8] ^= 1 << (at % 8);
            std::fs::write(&path, &bytes).unwrap();
            assert!(CheckpointReader::open(&path).is_err(), "bit {at}");
        }
        let other = [KIND, b"2\n", &whole[KIND.len() + 2..]].concat();
        std::fs::write(&path, other).unwrap();
        assert!(CheckpointReader::open(&path).unwrap_err().to_string().contains("another version"));
    }

    trait Bits {
        fn map_bits(&self) -> Vec<u64>;
    }

    impl Bits for Vec<f64> {
        fn map_bits(&self) -> Vec<u64> {
            self.iter().map(|x| x.to_bits()).collect()
        }
    }
}
