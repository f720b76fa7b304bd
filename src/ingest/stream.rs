//! The steps of a source as a stream: one thread reads ahead while the caller works.
//!
//! Buffers circulate: the reader takes one from the pool, fills it and sends it; the caller sends it back. There are as
//! many as two steps need, so that memory does not grow with the series. Whichever side ends first closes its
//! channels, which ends the other.

use super::plan::PlannedField;
use super::report::IngestError;
use crate::error::FileResult;
use crate::field::{Component, SeriesSource};
use crate::task::Cancel;
use crossbeam::channel::{Receiver, Sender, bounded};
use std::time::{Duration, Instant};

/// Values of one component of one step.
struct Read {
    values: Vec<f32>,
    took: Duration,
}

/// The receiving end of the stream.
pub(super) struct Stream {
    reads: Receiver<FileResult<Read>>,
    pool: Sender<Vec<f32>>,
    /// Time spent reading the values received so far.
    pub(super) read_time: Duration,
}

/// The steps to read: for each of `steps`, each of `fields`, each of its components to read.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub(super) source: &'a dyn SeriesSource,
    pub(super) fields: &'a [PlannedField],
    pub(super) steps: &'a [usize],
    pub(super) cancel: &'a Cancel,
}

/// Runs `work` on the stream of a job while another thread reads.
pub(super) fn with_stream<T>(
    job: &Job<'_>,
    work: impl FnOnce(&mut Stream) -> Result<T, IngestError>,
) -> Result<T, IngestError> {
    let buffers = 2 * job.fields.iter().map(|f| f.reads.len()).sum::<usize>();
    let (send_read, reads) = bounded(buffers);
    let (pool, take_buffer) = bounded(buffers);
    for _ in 0..buffers {
        // The channel has room for all buffers, and its receiver is alive.
        let _ = pool.send(Vec::new());
    }
    let stream = Stream { reads, pool, read_time: Duration::ZERO };
    std::thread::scope(|scope| {
        scope.spawn(move || read_all(job, &take_buffer, &send_read));
        // Owned here, so that dropping it (after an error or a panic of `work`, too) ends the reader, which this scope awaits.
        let mut stream = stream;
        work(&mut stream)
    })
}

fn read_all(job: &Job<'_>, take_buffer: &Receiver<Vec<f32>>, send: &Sender<FileResult<Read>>) {
    for &step in job.steps {
        for field in job.fields {
            for &component in &field.reads {
                let Ok(mut values) = take_buffer.recv() else { return };
                if job.cancel.is_cancelled() {
                    return;
                }
                let start = Instant::now();
                let result = job.source.read(&field.info, Component::Index(component), step, &mut values);
                let failed = result.is_err();
                if send.send(result.map(|()| Read { values, took: start.elapsed() })).is_err() || failed {
                    return;
                }
            }
        }
    }
}

impl Stream {
    /// Passes the next values to `work` and recycles their buffer.
    pub(super) fn next<T>(&mut self, work: impl FnOnce(&[f32]) -> T) -> Result<T, IngestError> {
        // The reader closes the channel early only when it is cancelled.
        let read = self.reads.recv().map_err(|_| IngestError::Cancelled)?;
        let Read { values, took } = read.map_err(IngestError::Source)?;
        self.read_time += took;
        let result = work(&values);
        // After its last read the reader takes no more buffers.
        let _ = self.pool.send(values);
        Ok(result)
    }
}
