//! The compression achieved for a field, in the columns of the dissertation's Table 6.1.

use crate::codec::{Encoding, PaperSize, Quality};
use serde::Serialize;
use std::fmt;

/// A row of the table.
#[derive(Clone, Debug, Serialize)]
pub struct CompressionReport {
    /// Name of the codec.
    pub codec: String,
    /// Entries of each codebook.
    pub entries: u64,
    /// Number of values of a step.
    pub values: u64,
    /// Number of tetrahedra.
    pub tets: u64,
    /// Number of steps.
    pub steps: u64,
    /// Bytes of the values as f32.
    pub raw_bytes: u64,
    /// Compressed bytes by the dissertation's formula (6.2.2).
    pub paper_bytes: u64,
    /// Bytes that the codec has written, checksums included.
    pub bytes: u64,
    /// `raw_bytes / paper_bytes`.
    pub paper_ratio: f64,
    /// `raw_bytes / bytes`.
    pub ratio: f64,
    /// Errors, measured with the decoder.
    #[serde(flatten)]
    pub quality: Quality,
}

impl CompressionReport {
    /// The row of a field; `None` without a codebook.
    pub(super) fn new(
        encoding: &dyn Encoding,
        [values, tets, steps]: [u64; 3],
        bytes: u64,
        quality: Quality,
    ) -> Option<Self> {
        let PaperSize { entries, bytes: paper_bytes } = encoding.by_the_paper(values, steps)?;
        let raw_bytes = values * steps * size_of::<f32>() as u64;
        let ratio = |bytes: u64| raw_bytes as f64 / bytes.max(1) as f64;
        Some(Self {
            codec: encoding.codec().name.to_owned(),
            entries,
            values,
            tets,
            steps,
            raw_bytes,
            paper_bytes,
            bytes,
            paper_ratio: ratio(paper_bytes),
            ratio: ratio(bytes),
            quality,
        })
    }
}

impl fmt::Display for CompressionReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [raw, paper, real] = [self.raw_bytes, self.paper_bytes, self.bytes].map(|bytes| bytes as f64 / 1e6);
        let db = |snr: Option<f64>| snr.map_or_else(|| "exact".to_owned(), |snr| format!("{snr:.1} dB"));
        let q = &self.quality;
        writeln!(
            f,
            "  {}, {} entries: {} values a step, {} tets, {} steps",
            self.codec, self.entries, self.values, self.tets, self.steps
        )?;
        writeln!(
            f,
            "  size {raw:.2} MB, compressed {real:.2} MB ({:.1}:1), by the paper's formula {paper:.2} MB ({:.1}:1)",
            self.ratio, self.paper_ratio
        )?;
        writeln!(
            f,
            "  SNR {} (steps {} to {}), max error {:.3e}, RMSE {:.3e}",
            db(q.snr_db),
            db(q.snr_min_db),
            db(q.snr_max_db),
            q.max_error,
            q.rmse
        )?;
        let s = &q.over_sigma;
        write!(
            f,
            "  RMSE over a scalar's sigma: median {:.3e}, 99 % below {:.3e}, max {:.3e}",
            s.median, s.p99, s.max
        )?;
        if self.bytes > self.raw_bytes {
            write!(f, "\n  larger than the values themselves: take fewer --entries, or --codec raw")?;
        }
        Ok(())
    }
}
