//! Codec `vq`: vector quantisation along time, after Callahan's dissertation (6.1.1, 6.2.2).
//!
//! The values of a vertex in a block of 64 steps are its mean, plus one of the entries of a codebook of 8-vectors (one
//! number for each group of 8 steps), plus one of the entries of a codebook of 64-vectors:
//!
//! ```text
//! b, j = step / 64, step % 64
//! value[v] = mean[b][v] + (cb8[b][group[j]][i8[b][v]] + cb64[b][j][i64[b][v]])
//! ```
//!
//! | array | shape | element |
//! |---|---|---|
//! | `mean` | blocks, vertices | f32 |
//! | `i8`, `i64` | blocks, vertices | u8 up to 256 entries, u16 above |
//! | `cb8` | blocks, 8, entries | f32 |
//! | `cb64` | blocks, 64, entries | f32 |
//! | `exponent` (if used) | blocks, vertices | i8: the bracket is multiplied by 2^exponent |
//! | `special`, `special_start` (if there are any) | runs, 4; blocks + 1 | u32: vertex, first step, number of steps, bits; u64 |
//!
//! The last block may be short; rows of `cb64` behind its last step are zero. A vertex that is constant in a block comes back exactly
//! (entry 0 of both codebooks is -0), NaN and infinities bit for bit: they are stored apart, and the gaps that they leave are filled along
//! time before training. Other decoded values do not depend on whether a value was special or had the value of the filling.
//!
//! With `own_scales`, differences are trained in units of a power of two of each vertex: the error is then relative to
//! each vertex's own variation, for data over many orders of magnitude. Values beyond 2^120 force it.
//!
//! `encode` is the order of work, `search` the loop in which encoding spends its time, `block` the one for decoding. Errors in the report
//! and the attributes come from the decoder itself, run on every block before it is written. Means are f32: as f16 they would be two bytes
//! a vertex and block smaller, and cost decibels where codebooks are good (decaying fields with many entries). `simd` compiles three loops
//! (search, projection, decoding) for AVX2 and AVX-512 as well, with the same bits. Three lines of numpy in `tests/interop/read_store.py`
//! decode a step.
//!
//! Beside the dissertation's figures (`docs/compression.md` has the commands): of the turbulent jet with 1,024 entries the SNR of steps is 7.2
//! to 26.6 dB and the ratio 20.7 in the store, 14.6 by the formula ([`paper_bytes`]); the dissertation prints 5.3 to 17.9 dB and 34.7 for its
//! jet, for which its own formula would give 14.5. With 64 steps in place of 150 a block spans more than twice the time: 9.0 dB instead of
//! 10.6, images 0.080 apart instead of 0.062. Images of SPX1, Blunt (step 20) and Torso (step 100) with 256 entries, dense (`--tf
//! 'viridis@0:0.02,1:0.5'`), are off by an RMSE of 5e-5 to 8e-5. Blunt's largest error is 0.0094 in the units of the field with 256 entries and
//! 0.0046 with 512, where the store is still 22 times smaller than the values.

mod block;
mod codebook;
mod codec;
mod decoder;
mod encode;
mod encoder;
mod layout;
#[cfg(target_arch = "x86_64")]
mod lookup;
mod pca;
mod prepare;
#[cfg(test)]
mod properties;
mod search;
mod simd;
#[cfg(test)]
mod test_data;
#[cfg(test)]
mod tests;
mod tiles;

use crate::words::words;
pub use block::{Indices, SpecialRun, VqBlock};
pub use codec::CODEC;
pub use decoder::VqDecoder;
pub use encoder::VqEncoder;
pub use layout::{MAX_ENTRIES, NAME, VqParameters, paper_bytes};

/// Steps of a block.
pub const STEPS: usize = 64;
/// Groups of steps in a block: length of a vector of the first codebook.
pub const GROUPS: usize = 8;

/// The group of step `j` of a block.
pub fn group_of_step(j: usize) -> usize {
    j / GROUPS
}

/// How codebooks are trained and searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Search {
    /// Trained on a sample, searched along principal axes.
    #[default]
    Fast,
    /// LBG on all vectors in all 64 dimensions: much slower, a little better.
    Exact,
}

words!(Search, "there is no search", ["fast" = Fast, "exact" = Exact]);

/// Options of the encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VqOptions {
    /// Entries of each codebook, 2 to [`MAX_ENTRIES`].
    pub entries: usize,
    /// How codebooks are trained and searched.
    pub search: Search,
    /// Whether each vertex has its own power of two.
    pub own_scales: bool,
}

impl Default for VqOptions {
    fn default() -> Self {
        Self { entries: 256, search: Search::Fast, own_scales: false }
    }
}
