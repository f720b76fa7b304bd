//! Sums of two columns of 256 numbers on processors with AVX-512. A column lies in registers and is permuted.
//!
//! A gather reads its numbers one after the other, and on some processors takes longer than a plain loop. Here 32 indices select among the
//! lower halves of the numbers, then among the upper ones: by permutations of 64 halves each, and by the index's two upper bits among their
//! results. Only the additions round, so that the bits are those of [`Sums`]. Vector code uses no closures, which would be compiled without
//! the processor's instructions.

use super::block::Sums;
use pulp::x86::V4;
use pulp::{NullaryFnOnce, cast};
use std::arch::x86_64::{__m512, __m512i};

/// Indices that are looked up at once.
const LANES: usize = 32;
/// Sums computed for one column before the other one is loaded: the registers do not hold both. They stay in the first-level cache.
const PIECE: usize = 64 * LANES;

/// [`Sums`] by permutations.
pub(super) struct LookUp<'a> {
    pub(super) lanes: V4,
    pub(super) sums: Sums<'a, 256, u8>,
}

impl NullaryFnOnce for LookUp<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lanes, sums: Sums { base, indices: [i8, i64], columns, out } } = self;
        let (Ok(column8), Ok(column64)) = (<&[f32; 256]>::try_from(columns[0]), <&[f32; 256]>::try_from(columns[1]))
        else {
            return;
        };
        let whole = out.len() / LANES * LANES;
        let (pieces, tail) = out.split_at_mut(whole);
        for (at, out) in pieces.chunks_mut(PIECE).enumerate() {
            let range = at * PIECE..at * PIECE + out.len();
            let out = out.as_chunks_mut().0;
            look_up(&Column::new(lanes, column8), &i8[range.clone()], out);
            add(&Column::new(lanes, column64), &i64[range.clone()], base.map(|base| &base[range]), out);
        }
        Sums::<256, u8> {
            base: base.map(|base| &base[whole..]),
            indices: [&i8[whole..], &i64[whole..]],
            columns,
            out: tail,
        }
        .call();
    }
}

/// `out = column[indices]`.
#[inline(always)]
fn look_up(column: &Column, indices: &[u8], out: &mut [[f32; LANES]]) {
    for (out, indices) in out.iter_mut().zip(indices.as_chunks().0) {
        *out = cast(column.at(indices));
    }
}

/// `out = base + (out + column[indices])`, or without `base` if there is none.
#[inline(always)]
fn add(column: &Column, indices: &[u8], base: Option<&[f32]>, out: &mut [[f32; LANES]]) {
    let indices = indices.as_chunks().0;
    match base {
        Some(base) => {
            for ((out, indices), base) in out.iter_mut().zip(indices).zip(base.as_chunks().0) {
                *out = sums(column.lanes, *base, sums(column.lanes, *out, cast(column.at(indices))));
            }
        }
        None => {
            for (out, indices) in out.iter_mut().zip(indices) {
                *out = sums(column.lanes, *out, cast(column.at(indices)));
            }
        }
    }
}

#[inline(always)]
fn sums(lanes: V4, a: [f32; LANES], b: [f32; LANES]) -> [f32; LANES] {
    let ([a, b], [c, d]): ([__m512; 2], [__m512; 2]) = (cast(a), cast(b));
    cast([lanes.avx512f._mm512_add_ps(a, c), lanes.avx512f._mm512_add_ps(b, d)])
}

/// Word indices of the lower, and of the upper, halves of 32 numbers.
const EVERY_OTHER_WORD: [[u16; LANES]; 2] = {
    let mut words = [[0; LANES]; 2];
    let mut at = 0;
    while at < LANES {
        words[0][at] = 2 * at as u16;
        words[1][at] = 2 * at as u16 + 1;
        at += 1;
    }
    words
};

/// A column in registers: the lower and the upper halves of its numbers.
struct Column {
    lanes: V4,
    halves: [[__m512i; 8]; 2],
}

impl Column {
    #[inline(always)]
    fn new(lanes: V4, column: &[f32; 256]) -> Self {
        let bw = lanes.avx512bw;
        let [even, odd] = EVERY_OTHER_WORD.map(cast::<_, __m512i>);
        let mut halves = [[even; 8]; 2];
        for (at, numbers) in column.as_chunks::<LANES>().0.iter().enumerate() {
            let [a, b]: [__m512i; 2] = cast(*numbers);
            halves[0][at] = bw._mm512_permutex2var_epi16(a, even, b);
            halves[1][at] = bw._mm512_permutex2var_epi16(a, odd, b);
        }
        Self { lanes, halves }
    }

    /// The numbers at 32 indices.
    #[inline(always)]
    fn at(&self, indices: &[u8; LANES]) -> [__m512; 2] {
        let (f, bw) = (self.lanes.avx512f, self.lanes.avx512bw);
        // Indices in groups of four, ordered so that the recombined halves are in the order of the indices.
        let order = cast([0u32, 4, 1, 5, 2, 6, 3, 7]);
        let index = bw._mm512_cvtepu8_epi16(self.lanes.avx2._mm256_permutevar8x32_epi32(cast(*indices), order));
        let sixth = bw._mm512_test_epi16_mask(index, f._mm512_set1_epi16(1 << 6));
        let seventh = bw._mm512_test_epi16_mask(index, f._mm512_set1_epi16(1 << 7));
        let mut of_halves = [index; 2];
        for (out, halves) in of_halves.iter_mut().zip(&self.halves) {
            let mut among = [index; 4];
            for (out, at) in among.iter_mut().zip(halves.as_chunks::<2>().0) {
                *out = bw._mm512_permutex2var_epi16(at[0], index, at[1]);
            }
            let lower = bw._mm512_mask_blend_epi16(sixth, among[0], among[1]);
            let upper = bw._mm512_mask_blend_epi16(sixth, among[2], among[3]);
            *out = bw._mm512_mask_blend_epi16(seventh, lower, upper);
        }
        let [low, high] = of_halves;
        [cast(bw._mm512_unpacklo_epi16(low, high)), cast(bw._mm512_unpackhi_epi16(low, high))]
    }
}

#[cfg(test)]
mod tests {
    use super::super::simd::portable;
    use super::super::test_data::Random;
    use super::*;

    #[test]
    fn permuted_numbers_are_those_of_the_plain_loop() {
        let Some(lanes) = V4::try_new() else {
            eprintln!("SKIPPED: this processor has no AVX-512, so nothing is permuted");
            return;
        };
        let mut random = Random::new(31);
        let mut numbers = |n: usize| (0..n).map(|_| random.signed()).collect::<Vec<f32>>();
        let mut columns = [numbers(256), numbers(256)];
        columns[0][..4].copy_from_slice(&[-0.0, 0.0, f32::MIN_POSITIVE / 8.0, -f32::MAX]);
        let columns = [&columns[0][..], &columns[1][..]];
        for count in [0, 1, LANES - 1, LANES, LANES + 1, 300, PIECE - 1, PIECE, 3 * PIECE + 77] {
            let mean = numbers(count);
            // Both visit all entries, in different orders.
            let indices = [7919, 131].map(|stride| (0..count).map(|i| (i * stride % 256) as u8).collect::<Vec<u8>>());
            for base in [Some(&mean[..]), None] {
                let (mut permuted, mut plain) = (vec![f32::NAN; count], vec![f32::NAN; count]);
                let indices = [&indices[0][..], &indices[1][..]];
                lanes.vectorize(LookUp { lanes, sums: Sums { base, indices, columns, out: &mut permuted } });
                portable(Sums::<256, u8> { base, indices, columns, out: &mut plain });
                let differ = permuted.iter().zip(&plain).position(|(a, b)| a.to_bits() != b.to_bits());
                assert_eq!(differ, None, "of {count} numbers");
                assert!(plain.iter().all(|x| x.is_finite()), "all are written");
            }
        }
    }
}
