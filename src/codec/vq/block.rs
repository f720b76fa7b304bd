//! One block in memory, and the decoding of a step of it.
//!
//! ```text
//! column8 = row group[j] of the first codebook, column64 = row j of the second      (one number an entry)
//! for each vertex v:  value = mean[v] + scale[v] * (column8[i8[v]] + column64[i64[v]])
//! ```
//! Codebooks lie step by step, so that the two columns of a step, 8 bytes an entry together, stay in the first-level cache (up to 4096
//! entries). Deviations for speed: a column is padded to 2^8, 2^10, 2^12, 2^14 or 2^16 entries, so that an index of its type or masked
//! cannot leave it and needs no check; blocks without scales have a loop of their own; the loop is compiled for AVX-512, too, where the
//! compiler gathers 16 numbers at once: 0.39 ns a vertex instead of 0.60 on a Xeon (1024 entries: 0.42, 0.69). Columns of 256 numbers are
//! looked up in registers there ([`LookUp`]): an EPYC needs 0.33 of a plain loop's time for it, and 0.89 when it gathers. Tried and not
//! kept: indices loaded eight at a time and shifted apart (0.52; 0.59), sums in a buffer of 64 numbers (0.43; 0.48).

#[cfg(target_arch = "x86_64")]
use super::lookup::LookUp;
use super::simd::widest;
use super::{GROUPS, STEPS, group_of_step};
use crate::slowdown::{Slow, waste};
use crate::task::Cancel;
use pulp::NullaryFnOnce;
use rayon::prelude::*;

/// Vertices of one task: below that, threads cost more than they save.
const TASK: usize = 32_768;

/// Indices into the first and the second codebook, one each per vertex, as narrow as the codebooks allow.
#[derive(Clone, Debug, PartialEq)]
pub enum Indices {
    /// Codebooks of at most 256 entries.
    Narrow([Vec<u8>; 2]),
    /// Codebooks of at most 65536 entries.
    Wide([Vec<u16>; 2]),
}

impl Indices {
    /// The narrowest form for codebooks of `entries`.
    pub(super) fn new(indices: [Vec<u16>; 2], entries: usize) -> Self {
        if entries <= 256 {
            Self::Narrow(indices.map(|list| list.iter().map(|&i| i as u8).collect()))
        } else {
            Self::Wide(indices)
        }
    }

    /// Size in memory and in the store.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Narrow([a, b]) => a.len() + b.len(),
            Self::Wide([a, b]) => 2 * (a.len() + b.len()),
        }
    }
}

/// A run of equal special values (NaN, infinities) of one vertex in consecutive steps, which no codebook can give.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct SpecialRun {
    /// The vertex.
    pub vertex: u32,
    /// First step, counted from the beginning of the series.
    pub first: u32,
    /// Number of steps, all in one block.
    pub count: u32,
    /// Bits of the value.
    pub bits: u32,
}

/// The stored form of a block.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Encoded {
    /// Mean of each vertex over the block; its exact value if it is constant.
    pub(super) mean: Vec<f32>,
    /// Exponent of the scale 2^e of each vertex; empty if all are 0.
    pub(super) exponent: Vec<i8>,
    /// Indices into both codebooks.
    pub(super) indices: Indices,
    /// The first codebook: `GROUPS` rows of one number an entry.
    pub(super) cb8: Vec<f32>,
    /// The second codebook: `STEPS` rows of one number an entry.
    pub(super) cb64: Vec<f32>,
    /// Special values to overwrite after decoding, by vertex, then step.
    pub(super) runs: Vec<SpecialRun>,
}

/// A block in memory that is ready to decode any of its steps.
///
/// Its parts are plain slices, so that they can be copied to another processor unchanged. With `b` the block's number, `j = step - 64 b`
/// and `n` = [`VqBlock::row_len`], a decoder there computes
///
/// ```text
/// scale    = if exponents is empty { 1 } else { powers[exponents[v] as u8] }                            (2^exponent)
/// value[v] = means[v] + scale * (cb8[j / 8 * n + first[v]] + cb64[j * n + second[v]])
/// bits[s.vertex] = s.bits    for each s of specials with s.first <= step < s.first + s.count
/// ```
///
/// in f32, with the operations rounded one by one and denormals kept, to have the bits of
/// [`Decoder::decode_step`](crate::codec::Decoder::decode_step). Only rows `j / 8` and `j` of the codebooks are needed for
/// a step.
#[derive(Debug)]
pub struct VqBlock {
    parts: Encoded,
    /// Length of a padded codebook row.
    padded: usize,
    /// 2^e for each exponent e, indexed by e as `u8`.
    powers: [f32; 256],
}

impl VqBlock {
    /// A block of these parts, with indices all below `entries`, the number of entries of both codebooks. Once `cancel` is raised, its
    /// codebooks lack rows: large ones take milliseconds to pad.
    pub(super) fn new(mut parts: Encoded, entries: usize, cancel: &Cancel) -> Self {
        let padded = padded_len(entries);
        parts.cb8 = pad(parts.cb8, entries, padded, cancel);
        parts.cb64 = pad(parts.cb64, entries, padded, cancel);
        let powers = std::array::from_fn(|bits| power((bits as u8).cast_signed()));
        Self { parts, padded, powers }
    }

    /// Size in memory of a block without special values.
    pub(super) fn expected_bytes(vertices: usize, entries: usize, exponents: bool) -> u64 {
        let index = if entries <= 256 { size_of::<u8>() } else { size_of::<u16>() };
        let per_vertex = size_of::<f32>() + 2 * index + usize::from(exponents);
        let codebooks = (GROUPS + STEPS) * padded_len(entries) * size_of::<f32>();
        (vertices as u64).saturating_mul(per_vertex as u64).saturating_add(codebooks as u64)
    }

    /// Mean of each vertex over the steps of the block; its exact value if it is constant.
    pub fn means(&self) -> &[f32] {
        &self.parts.mean
    }

    /// Exponent of the scale 2^e of each vertex; empty if all are 0.
    pub fn exponents(&self) -> &[i8] {
        &self.parts.exponent
    }

    /// 2^e for each exponent e, indexed by e as `u8`.
    pub fn powers(&self) -> &[f32; 256] {
        &self.powers
    }

    /// Indices into both codebooks, one each per vertex; all below [`VqBlock::row_len`].
    pub fn indices(&self) -> &Indices {
        &self.parts.indices
    }

    /// Length of a codebook row: the number of entries, rounded up to a power of two of at least 256. The padding is zero and never used.
    pub fn row_len(&self) -> usize {
        self.padded
    }

    /// The first codebook: for each of the 8 groups of steps a row of one number an entry.
    pub fn cb8(&self) -> &[f32] {
        &self.parts.cb8
    }

    /// The second codebook: for each of the 64 steps a row of one number an entry; zero behind a short block's last step.
    pub fn cb64(&self) -> &[f32] {
        &self.parts.cb64
    }

    /// Special values to overwrite after decoding, by vertex, then step.
    pub fn specials(&self) -> &[SpecialRun] {
        &self.parts.runs
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        let p = &self.parts;
        let floats = p.mean.len() + p.cb8.len() + p.cb64.len();
        floats * size_of::<f32>() + p.exponent.len() + p.indices.bytes() + size_of_val(&p.runs[..])
    }

    /// Decodes step `j` of the block, which is step `step` of the series, on all threads, unless `cancel` is raised. Returns false if it
    /// was.
    pub(super) fn decode(&self, j: usize, step: usize, out: &mut [f32], cancel: &Cancel) -> bool {
        if out.len() <= TASK {
            self.decode_part(j, step, 0, out);
        } else {
            out.par_chunks_mut(TASK).enumerate().for_each(|(i, out)| {
                if !cancel.is_cancelled() {
                    self.decode_part(j, step, i * TASK, out);
                }
            });
        }
        !cancel.is_cancelled()
    }

    /// Decodes step `j` of the vertices from `first` on, on this thread.
    pub(super) fn decode_part(&self, j: usize, step: usize, first: usize, out: &mut [f32]) {
        self.decode_finite(j, first, out);
        waste(Slow::DecodeVq, out.len());
        waste(Slow::DecodeLanes, out.len());
        let runs = &self.parts.runs;
        let from = runs.partition_point(|run| (run.vertex as usize) < first);
        let to = from + runs[from..].partition_point(|run| (run.vertex as usize) < first + out.len());
        for run in &runs[from..to] {
            if step.wrapping_sub(run.first as usize) < run.count as usize {
                out[run.vertex as usize - first] = f32::from_bits(run.bits);
            }
        }
    }

    /// Decodes from the codebooks alone, without special values.
    pub(super) fn decode_finite(&self, j: usize, first: usize, out: &mut [f32]) {
        let range = first..first + out.len();
        let row = |row: usize| row * self.padded..(row + 1) * self.padded;
        let columns = [&self.parts.cb8[row(group_of_step(j))], &self.parts.cb64[row(j)]];
        let mean = &self.parts.mean[range.clone()];
        // With scales, the differences are decoded first.
        let base = if self.parts.exponent.is_empty() { Some(mean) } else { None };
        match &self.parts.indices {
            Indices::Narrow(i) => {
                let indices = i.each_ref().map(|i| &i[range.clone()]);
                let sums = Sums::<0x100, u8> { base, indices, columns, out };
                match pulp::Arch::new() {
                    #[cfg(target_arch = "x86_64")]
                    pulp::Arch::V4(lanes) => lanes.vectorize(LookUp { lanes, sums }),
                    _ => widest(sums),
                }
            }
            Indices::Wide(i) => {
                let indices = i.each_ref().map(|i| &i[range.clone()]);
                match self.padded {
                    0x400 => widest(Sums::<0x400, u16> { base, indices, columns, out }),
                    0x1000 => widest(Sums::<0x1000, u16> { base, indices, columns, out }),
                    0x4000 => widest(Sums::<0x4000, u16> { base, indices, columns, out }),
                    _ => widest(Sums::<0x1_0000, u16> { base, indices, columns, out }),
                }
            }
        }
        if base.is_none() {
            let exponents = &self.parts.exponent[range];
            for ((value, &mean), &exponent) in out.iter_mut().zip(mean).zip(exponents) {
                *value = mean + self.powers[usize::from(exponent.cast_unsigned())] * *value;
            }
        }
    }
}

/// The sums of one number of each column, and of `base` if there is one. Columns have `N` numbers, a power of two.
pub(super) struct Sums<'a, const N: usize, I> {
    pub(super) base: Option<&'a [f32]>,
    pub(super) indices: [&'a [I]; 2],
    pub(super) columns: [&'a [f32]; 2],
    pub(super) out: &'a mut [f32],
}

impl<const N: usize, I: Copy + Into<usize>> NullaryFnOnce for Sums<'_, N, I> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { base, indices: [i8, i64], columns: [column8, column64], out } = self;
        // Columns are cut to N numbers when the codebooks are padded; without them nothing is added.
        let (Ok(column8), Ok(column64)) = (<&[f32; N]>::try_from(column8), <&[f32; N]>::try_from(column64)) else {
            return;
        };
        match base {
            Some(base) => add(base, i8, i64, column8, column64, out),
            None => differences(i8, i64, column8, column64, out),
        }
    }
}

/// `out = base + (column8[i8] + column64[i64])`. Each slice is a separate argument, so that the compiler knows that `out` overlaps none of
/// them, without which it does not gather.
#[inline(always)]
fn add<const N: usize, I: Copy + Into<usize>>(
    base: &[f32],
    i8: &[I],
    i64: &[I],
    column8: &[f32; N],
    column64: &[f32; N],
    out: &mut [f32],
) {
    for ((value, base), (&a, &b)) in out.iter_mut().zip(base).zip(i8.iter().zip(i64)) {
        *value = base + (column8[a.into() & (N - 1)] + column64[b.into() & (N - 1)]);
    }
}

/// Decodes differences alone, without a mean to add them to.
#[inline(always)]
fn differences<const N: usize, I: Copy + Into<usize>>(
    i8: &[I],
    i64: &[I],
    column8: &[f32; N],
    column64: &[f32; N],
    out: &mut [f32],
) {
    for (value, (&a, &b)) in out.iter_mut().zip(i8.iter().zip(i64)) {
        *value = column8[a.into() & (N - 1)] + column64[b.into() & (N - 1)];
    }
}

/// Length of a padded row of a codebook of `entries`.
fn padded_len(entries: usize) -> usize {
    [1 << 8, 1 << 10, 1 << 12, 1 << 14].into_iter().find(|&n| n >= entries).unwrap_or(1 << 16)
}

/// Rows of `entries` numbers, each padded to `padded`; the last ones are missing once `cancel` is raised.
fn pad(codebook: Vec<f32>, entries: usize, padded: usize, cancel: &Cancel) -> Vec<f32> {
    if entries == padded {
        return codebook;
    }
    let mut rows = vec![0.0; codebook.len() / entries * padded];
    for (to, from) in rows.chunks_exact_mut(padded).zip(codebook.chunks_exact(entries)) {
        if cancel.is_cancelled() {
            break;
        }
        to[..entries].copy_from_slice(from);
    }
    rows
}

/// 2^`exponent`, exactly.
pub(super) fn power(exponent: i8) -> f32 {
    let e = i32::from(exponent);
    // Below 2^-126 the exponent field is 0, and the power is one mantissa bit.
    f32::from_bits(if e >= -126 { ((e + 127) as u32) << 23 } else { 1 << (e + 149) })
}

#[cfg(test)]
mod tests {
    use super::super::simd::portable;
    use super::super::test_data::Random;
    use super::*;

    #[test]
    fn wide_registers_give_the_same_bits() {
        let mut random = Random::new(12);
        let count = 1003;
        let mut numbers = |n: usize| (0..n).map(|_| random.signed()).collect::<Vec<f32>>();
        let (mean, column8, column64) = (numbers(count), numbers(1024), numbers(1024));
        let index: Vec<u16> = (0..count).map(|i| (i * 7919 % 1024) as u16).collect();
        let indices = [&index[..], &index[..]];
        let columns = [&column8[..], &column64[..]];
        for base in [Some(&mean[..]), None] {
            let (mut wide, mut plain) = (vec![0.0; count], vec![0.0; count]);
            widest(Sums::<1024, u16> { base, indices, columns, out: &mut wide });
            portable(Sums::<1024, u16> { base, indices, columns, out: &mut plain });
            assert!(wide.iter().zip(&plain).all(|(a, b)| a.to_bits() == b.to_bits()));
            assert!(wide.iter().any(|&x| x != 0.0));
        }
    }
}
