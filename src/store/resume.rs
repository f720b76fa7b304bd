//! Going on with an unfinished store: the state of its writers is kept from time to time, and taken up by another run.

use super::checkpoint::without;
use super::folder::walk;
use super::layout::{MESH, TIME};
use super::staging::Staging;
use super::writer::{Content, FieldWriter, StoreWriter};
use super::{CheckpointReader, CheckpointWriter};
use crate::codec::{EncoderState, Encoding};
use crate::error::{FileError, FileResult};
use crate::moments::{Moments, MomentsState};
use std::fs;
use std::path::Path;

impl StoreWriter {
    /// Begins a store at `target` that another run can go on with, in the folder `NAME.partial` beside it, or goes on with what is there:
    /// then with the checkpoint. Dropped before there is one, it leaves no files.
    ///
    /// # Errors
    /// As [`StoreWriter::create`]; if another process writes in that folder, it is somebody else's, or its checkpoint is damaged.
    pub fn go_on(target: &Path, overwrite: bool) -> FileResult<(Self, Option<CheckpointReader>)> {
        let staging = Staging::go_on(target, overwrite)?;
        let checkpoint = match staging.partial() {
            Some(partial) => partial.read()?,
            None => None,
        };
        let writer = Self::at(staging);
        writer.write_groups()?;
        Ok((writer, checkpoint))
    }

    /// The folder of a store that another run can go on with.
    pub fn partial(&self) -> Option<&Path> {
        self.staging.partial().map(|partial| partial.root())
    }

    /// What to do if another run cannot go on with a store that it could.
    pub fn remedy(&self) -> Option<String> {
        self.partial().map(without)
    }

    /// Makes everything durable that was written, and replaces the checkpoint by what `fill` writes. Without a folder for it, does nothing.
    ///
    /// # Errors
    /// If a file cannot be written; the earlier checkpoint is there still.
    pub fn keep(&self, fill: impl FnOnce(&mut CheckpointWriter) -> FileResult<()>) -> FileResult<()> {
        self.staging.partial().map_or(Ok(()), |partial| partial.write(fill))
    }

    /// Removes what an earlier run has written behind its checkpoint, from which `fields` go on. Mesh and times must be written.
    ///
    /// # Errors
    /// If a file cannot be removed, or chunks before the checkpoint are missing.
    pub fn discard_unsettled<'a>(&self, fields: impl IntoIterator<Item = &'a FieldWriter>) -> FileResult<()> {
        let root = self.staging.path();
        let mut fields: Vec<(&FieldWriter, String, u64)> =
            fields.into_iter().map(|field| (field, format!("{}/", field.group()), 0)).collect();
        let written_anew = [MESH.split('/').next().unwrap_or(MESH), TIME].map(|group| format!("{group}/"));
        walk(root, &mut |path, metadata| {
            if metadata.is_dir() {
                // Succeeds for an empty one only.
                let _ = fs::remove_dir(path);
                return Ok(());
            }
            let below = path.strip_prefix(root).unwrap_or(path);
            let key = below.iter().map(|part| part.to_string_lossy()).collect::<Vec<_>>().join("/");
            if written_anew.iter().any(|group| key.starts_with(group)) {
                return Ok(());
            }
            let found = fields.iter_mut().find_map(|(field, group, bytes)| {
                let key = key.strip_prefix(group.as_str())?;
                field.is_settled(key).then_some(bytes)
            });
            match found {
                Some(bytes) => *bytes = bytes.saturating_add(metadata.len()),
                None => fs::remove_file(path).map_err(|e| FileError::io(path, "remove", &e))?,
            }
            Ok(())
        })?;
        match fields.iter().find(|(field, _, bytes)| *bytes != field.sink.bytes) {
            None => Ok(()),
            Some((field, group, bytes)) => {
                let problem = format!("has {bytes} bytes of {} that were written before", field.sink.bytes);
                Err(FileError::invalid(root.join(group), "", problem).remedy(without(self.partial().unwrap_or(root))))
            }
        }
    }
}

impl FieldWriter {
    /// Whether a chunk, below the field's group, was written and will not be again.
    fn is_settled(&self, key: &str) -> bool {
        matches!(&self.content, Content::Encoded(encoder) if encoder.is_settled(key))
    }

    /// Whether these are the values of an earlier step, as far as its checksum tells; `None` if it is not known.
    pub fn had(&self, step: usize, values: &[f32]) -> Option<bool> {
        let known = self.checksums.as_ref()?.get(step)?;
        Some(*known == Self::checksum(values))
    }

    /// Writes the state of the field and of its statistics, at the end of a block.
    ///
    /// # Errors
    /// If the file cannot be written, or steps wait for others to make a block.
    pub fn keep(&self, moments: &Moments, to: &mut CheckpointWriter) -> FileResult<()> {
        let EncoderState { counts, rows, sums } = match &self.content {
            Content::MagnitudeOf(_) => EncoderState::default(),
            Content::Encoded(encoder) => encoder.state().ok_or_else(|| {
                FileError::invalid(self.root.join(self.group()), "", "is within a block, which cannot be kept")
            })?,
        };
        to.put(self.name().as_bytes())?;
        to.put(&[self.sink.bytes])?;
        to.put(self.checksums.as_deref().unwrap_or_default())?;
        to.put(&counts)?;
        to.put(&rows)?;
        to.put(&sums)?;
        let MomentsState { means, squares, counts, ranges, nonfinite, nonfinite_before } = moments.state();
        to.put(&means)?;
        to.put(&squares)?;
        to.put(&counts)?;
        to.put(ranges.as_flattened())?;
        to.put(&nonfinite)?;
        to.put(&[nonfinite_before])
    }

    /// Goes on from the state after `steps` steps that [`FieldWriter::keep`] wrote; `count` are the values of a step. Returns the statistics.
    ///
    /// # Errors
    /// If it is not the state of such a field.
    pub fn go_on(
        &mut self,
        encoding: &dyn Encoding,
        [steps, count]: [usize; 2],
        from: &mut CheckpointReader,
    ) -> FileResult<Moments> {
        let name = from.take::<u8>()?;
        let bytes = from.take::<u64>()?;
        let checksums = from.take::<u32>()?;
        let state = EncoderState { counts: from.take()?, rows: from.take()?, sums: from.take()? };
        let (means, squares, counts) = (from.take()?, from.take()?, from.take()?);
        let (ranges, nonfinite, before) = (from.take::<f32>()?, from.take()?, from.take::<u64>()?);
        let (&[bytes], &[nonfinite_before], (ranges, [])) = (&bytes[..], &before[..], ranges.as_chunks::<2>()) else {
            return Err(from.damaged());
        };
        let ranges = ranges.to_vec();
        let state_of_steps = MomentsState { means, squares, counts, ranges, nonfinite, nonfinite_before };
        let fits = |moments: &Moments| moments.steps().len() == steps && state_of_steps.means.len() == count;
        let moments = Moments::from_state(&state_of_steps).filter(fits).ok_or_else(|| from.damaged())?;
        if name != self.name().as_bytes() || checksums.len() != steps {
            return Err(from.damaged());
        }
        if let Content::Encoded(encoder) = &mut self.content {
            *encoder = encoding.resume(count, steps, state).ok_or_else(|| from.damaged())?;
        }
        self.sink.bytes = bytes;
        self.checksums = Some(checksums);
        Ok(moments)
    }
}
