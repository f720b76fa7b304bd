//! The few vector operations that the compiler does not generate by itself: comparisons to bit masks, and the indices of set bits.
//! Everything else is written as loops over arrays.

use super::super::tiles::TILE_PX;

/// Pixels tested side by side in f32: two rows of eight.
pub(in crate::render::cpu) const BLOCK: usize = 2 * COLUMNS;
/// Columns of a block.
pub(in crate::render::cpu) const COLUMNS: usize = 8;

/// Pixels of a tile (row times [`TILE_PX`] plus column), with room for a block behind the last.
pub(in crate::render::cpu) type PixelList = [u32; TILE_PX * TILE_PX + BLOCK];

/// A processor's vectors. All implementations give the same results.
pub(in crate::render::cpu) trait Lanes: Copy {
    /// A bit for each lane where `a < b`.
    fn less_f32(self, a: [f32; BLOCK], b: [f32; BLOCK]) -> u16;

    /// A bit for each lane where `a < b`.
    fn less_f64(self, a: [f64; 8], b: [f64; 8]) -> u8;

    /// `a` where the bit is set, else `b`.
    #[inline(always)]
    fn select(self, bits: u8, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        let mut selected = [0.0; 8];
        for l in 0..8 {
            selected[l] = if bits >> l & 1 == 1 { a[l] } else { b[l] };
        }
        selected
    }

    /// For eight pixels of a tile, the entries of one table at their columns, and of another at their rows.
    #[inline(always)]
    fn look_up(self, pixels: &[u32; 8], columns: &[f64; TILE_PX], rows: &[f64; TILE_PX]) -> [[f64; 8]; 2] {
        let pixels = pixels.map(|pixel| pixel as usize);
        [pixels.map(|pixel| columns[pixel % TILE_PX]), pixels.map(|pixel| rows[pixel / TILE_PX % TILE_PX])]
    }

    /// Appends to `list[..count]` the pixels whose bits are set in a block that begins at pixel `first`; returns the new count.
    #[inline(always)]
    fn push(self, mut bits: u16, first: usize, list: &mut PixelList, count: usize) -> usize {
        let mut end = count;
        while bits != 0 && end < list.len() {
            let l = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            list[end] = (first + l / COLUMNS * TILE_PX + l % COLUMNS) as u32;
            end += 1;
        }
        end
    }
}

impl Lanes for pulp::Scalar {
    #[inline(always)]
    fn less_f32(self, a: [f32; BLOCK], b: [f32; BLOCK]) -> u16 {
        (0..BLOCK).fold(0, |bits, l| bits | u16::from(a[l] < b[l]) << l)
    }

    #[inline(always)]
    fn less_f64(self, a: [f64; 8], b: [f64; 8]) -> u8 {
        (0..8).fold(0, |bits, l| bits | u8::from(a[l] < b[l]) << l)
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    use pulp::cast;
    use pulp::x86::{V3, V4};
    use std::arch::x86_64::{__m256, __m256d, __m256i, __m512, __m512d, __m512i, _CMP_LT_OQ};

    impl Lanes for V3 {
        #[inline(always)]
        fn less_f32(self, a: [f32; BLOCK], b: [f32; BLOCK]) -> u16 {
            let (a, b): ([__m256; 2], [__m256; 2]) = (cast(a), cast(b));
            let bits = |i: usize| self.avx._mm256_movemask_ps(self.avx._mm256_cmp_ps::<_CMP_LT_OQ>(a[i], b[i]));
            (bits(0) | bits(1) << 8) as u16
        }

        #[inline(always)]
        fn less_f64(self, a: [f64; 8], b: [f64; 8]) -> u8 {
            let (a, b): ([__m256d; 2], [__m256d; 2]) = (cast(a), cast(b));
            let bits = |i: usize| self.avx._mm256_movemask_pd(self.avx._mm256_cmp_pd::<_CMP_LT_OQ>(a[i], b[i]));
            (bits(0) | bits(1) << 4) as u8
        }

        #[inline(always)]
        fn select(self, bits: u8, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
            let (a, b): ([__m256d; 2], [__m256d; 2]) = (cast(a), cast(b));
            let all = self.avx._mm256_set1_epi64x(i64::from(bits));
            let select = |i: usize, of_lanes: [u64; 4]| {
                let of_lanes = cast::<_, __m256i>(of_lanes);
                let flags = self.avx2._mm256_cmpeq_epi64(self.avx2._mm256_and_si256(all, of_lanes), of_lanes);
                self.avx._mm256_blendv_pd(b[i], a[i], cast(flags))
            };
            cast([select(0, [1, 2, 4, 8]), select(1, [16, 32, 64, 128])])
        }
    }

    /// Offsets of a block's pixels from its first one.
    const OFFSETS: [i32; BLOCK] = {
        let mut offsets = [0; BLOCK];
        let mut l = 0;
        while l < BLOCK {
            offsets[l] = (l / COLUMNS * TILE_PX + l % COLUMNS) as i32;
            l += 1;
        }
        offsets
    };

    impl Lanes for V4 {
        #[inline(always)]
        fn less_f32(self, a: [f32; BLOCK], b: [f32; BLOCK]) -> u16 {
            self.avx512f._mm512_cmplt_ps_mask(cast::<_, __m512>(a), cast::<_, __m512>(b))
        }

        #[inline(always)]
        fn less_f64(self, a: [f64; 8], b: [f64; 8]) -> u8 {
            self.avx512f._mm512_cmplt_pd_mask(cast::<_, __m512d>(a), cast::<_, __m512d>(b))
        }

        #[inline(always)]
        fn select(self, bits: u8, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
            cast(self.avx512f._mm512_mask_blend_pd(bits, cast::<_, __m512d>(b), cast::<_, __m512d>(a)))
        }

        #[inline(always)]
        fn look_up(self, pixels: &[u32; 8], columns: &[f64; TILE_PX], rows: &[f64; TILE_PX]) -> [[f64; 8]; 2] {
            // Only the lowest four bits of an index are used.
            const { assert!(TILE_PX == 16) };
            let column = self.avx512f._mm512_cvtepu32_epi64(cast::<_, __m256i>(*pixels));
            let row = self.avx512f._mm512_srli_epi64::<4>(column);
            [(column, columns), (row, rows)].map(|(at, table)| {
                let [low, high]: [__m512d; 2] = cast(*table);
                cast(self.avx512f._mm512_permutex2var_pd(low, at, high))
            })
        }

        #[inline(always)]
        fn push(self, bits: u16, first: usize, list: &mut PixelList, count: usize) -> usize {
            let first = self.avx512f._mm512_set1_epi32(first as i32);
            let pixels = self.avx512f._mm512_add_epi32(first, cast::<_, __m512i>(OFFSETS));
            let packed = self.avx512f._mm512_maskz_compress_epi32(bits, pixels);
            if let Some(room) = list[count.min(TILE_PX * TILE_PX)..].first_chunk_mut::<BLOCK>() {
                *room = cast(packed);
            }
            count + bits.count_ones() as usize
        }
    }
}
