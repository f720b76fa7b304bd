//! Vectors of eight numbers for the walk, on processors with AVX2 and with AVX-512. Every operation rounds as in the scalar walk.

use pulp::core_arch::x86::{Avx, Avx2};
use pulp::x86::{V3, V4};
use pulp::{NullaryFnOnce, cast};
use std::arch::x86_64::{__m128, __m256, __m256d, __m256i, __m512d, __m512i, _CMP_LT_OQ};

/// Rays walked side by side.
pub(in crate::render::cpu) const LANES: usize = 8;

/// One f64 per lane.
pub(in crate::render::cpu) type Eight = [f64; LANES];

/// A processor's vectors of eight numbers.
pub(in crate::render::cpu) trait Lanes: Copy {
    /// Eight f64.
    type F: Copy;
    /// One flag per lane.
    type M: Copy;

    /// Instructions common to all of these processors.
    fn avx(self) -> Avx;

    fn avx2(self) -> Avx2;

    /// Calls a function compiled with all of the processor's instructions.
    fn vectorize(self, call: impl NullaryFnOnce<Output = ()>);

    fn load(self, from: &Eight) -> Self::F;
    fn store(self, from: Self::F) -> Eight;
    fn splat(self, value: f64) -> Self::F;
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// The greater, `b` if equal.
    fn greater(self, a: Self::F, b: Self::F) -> Self::F;
    /// The lesser, `b` if equal.
    fn less(self, a: Self::F, b: Self::F) -> Self::F;
    fn abs(self, a: Self::F) -> Self::F;
    /// Rounds to f32.
    fn to_f32(self, a: Self::F) -> __m256;

    /// Flags where `a < b`.
    fn lt(self, a: Self::F, b: Self::F) -> Self::M;
    fn and(self, a: Self::M, b: Self::M) -> Self::M;
    /// `a` and not `b`.
    fn and_not(self, a: Self::M, b: Self::M) -> Self::M;
    fn bits(self, mask: Self::M) -> u8;
    fn mask(self, bits: u8) -> Self::M;
    /// `a` where the flag is set, else `b`.
    fn select(self, mask: Self::M, a: Self::F, b: Self::F) -> Self::F;
    /// `a` where the flag is set, else `b`.
    fn select_u32(self, mask: Self::M, a: __m256i, b: __m256i) -> __m256i;

    /// `a` where the flag is set, else `b`.
    fn select_f32(self, mask: Self::M, a: __m256, b: __m256) -> __m256;
    /// A bit for each lane where `a < b`.
    fn less_f32(self, a: __m256, b: __m256) -> u8;

    #[inline(always)]
    fn splat_f32(self, value: f32) -> __m256 {
        self.avx()._mm256_set1_ps(value)
    }

    #[inline(always)]
    fn add_f32(self, a: __m256, b: __m256) -> __m256 {
        self.avx()._mm256_add_ps(a, b)
    }

    #[inline(always)]
    fn sub_f32(self, a: __m256, b: __m256) -> __m256 {
        self.avx()._mm256_sub_ps(a, b)
    }

    #[inline(always)]
    fn mul_f32(self, a: __m256, b: __m256) -> __m256 {
        self.avx()._mm256_mul_ps(a, b)
    }

    /// The greater, `b` if equal.
    #[inline(always)]
    fn greater_f32(self, a: __m256, b: __m256) -> __m256 {
        self.avx()._mm256_max_ps(a, b)
    }

    /// Ones in the first `N` lanes (1, 2 or 4), then the first numbers of `a`.
    #[inline(always)]
    fn one_after<const N: usize>(self, a: __m256) -> __m256 {
        let (avx, ones) = (self.avx(), self.splat_f32(1.0));
        match N {
            1 => {
                let from: __m256i = cast([0u32, 0, 1, 2, 3, 4, 5, 6]);
                avx._mm256_blend_ps::<0x01>(self.avx2()._mm256_permutevar8x32_ps(a, from), ones)
            }
            2 => {
                let from: __m256i = cast([0u32, 0, 0, 1, 2, 3, 4, 5]);
                avx._mm256_blend_ps::<0x03>(self.avx2()._mm256_permutevar8x32_ps(a, from), ones)
            }
            _ => avx._mm256_permute2f128_ps::<0x02>(a, ones),
        }
    }

    /// The sums of the numbers of four vectors, of pairs of pairs.
    #[inline(always)]
    fn sums_f32(self, [a, b, c, d]: [__m256; 4]) -> [f32; 4] {
        let avx = self.avx();
        let of_halves = avx._mm256_hadd_ps(avx._mm256_hadd_ps(a, b), avx._mm256_hadd_ps(c, d));
        let other = avx._mm256_permute2f128_ps::<0x01>(of_halves, of_halves);
        let [sums, _]: [[f32; 4]; 2] = cast(self.add_f32(of_halves, other));
        sums
    }

    /// The columns of eight rows.
    fn transpose(self, rows: [&[f64; 4]; LANES]) -> [Self::F; 4];

    /// The columns of eight f32 rows.
    #[inline(always)]
    fn transpose_f32(self, rows: [&[f32; LANES]; LANES]) -> [__m256; LANES] {
        let avx = self.avx();
        let [a, b, c, d, e, f, g, h]: [__m256; LANES] = [
            cast(*rows[0]),
            cast(*rows[1]),
            cast(*rows[2]),
            cast(*rows[3]),
            cast(*rows[4]),
            cast(*rows[5]),
            cast(*rows[6]),
            cast(*rows[7]),
        ];
        // Columns 0 and 1 of each half of two rows, then 2 and 3.
        let (ab, cd) = (avx._mm256_unpacklo_ps(a, b), avx._mm256_unpacklo_ps(c, d));
        let (ef, gh) = (avx._mm256_unpacklo_ps(e, f), avx._mm256_unpacklo_ps(g, h));
        let (ab_high, cd_high) = (avx._mm256_unpackhi_ps(a, b), avx._mm256_unpackhi_ps(c, d));
        let (ef_high, gh_high) = (avx._mm256_unpackhi_ps(e, f), avx._mm256_unpackhi_ps(g, h));
        // One column of each half of four rows.
        let first = [
            avx._mm256_shuffle_ps::<0x44>(ab, cd),
            avx._mm256_shuffle_ps::<0xee>(ab, cd),
            avx._mm256_shuffle_ps::<0x44>(ab_high, cd_high),
            avx._mm256_shuffle_ps::<0xee>(ab_high, cd_high),
        ];
        let second = [
            avx._mm256_shuffle_ps::<0x44>(ef, gh),
            avx._mm256_shuffle_ps::<0xee>(ef, gh),
            avx._mm256_shuffle_ps::<0x44>(ef_high, gh_high),
            avx._mm256_shuffle_ps::<0xee>(ef_high, gh_high),
        ];
        [
            avx._mm256_permute2f128_ps::<0x20>(first[0], second[0]),
            avx._mm256_permute2f128_ps::<0x20>(first[1], second[1]),
            avx._mm256_permute2f128_ps::<0x20>(first[2], second[2]),
            avx._mm256_permute2f128_ps::<0x20>(first[3], second[3]),
            avx._mm256_permute2f128_ps::<0x31>(first[0], second[0]),
            avx._mm256_permute2f128_ps::<0x31>(first[1], second[1]),
            avx._mm256_permute2f128_ps::<0x31>(first[2], second[2]),
            avx._mm256_permute2f128_ps::<0x31>(first[3], second[3]),
        ]
    }

    /// For each row the entry of `neighbours` where `tets` has `gone`, which occurs once.
    fn across(self, tets: [&[u32; 4]; LANES], neighbours: [&[u32; 4]; LANES], gone: __m256i) -> __m256i;

    /// -a, including the sign of zero.
    #[inline(always)]
    fn neg(self, a: Self::F) -> Self::F {
        self.sub(self.splat(-0.0), a)
    }

    /// `a` or `b` where its flag is set, else `c`.
    #[inline(always)]
    fn select3(self, [k0, k1]: [Self::M; 2], [a, b, c]: [Self::F; 3]) -> Self::F {
        self.select(k0, a, self.select(k1, b, c))
    }

    /// `a` or `b` where its flag is set, else `c`.
    #[inline(always)]
    fn select3_u32(self, [k0, k1]: [Self::M; 2], [a, b, c]: [__m256i; 3]) -> __m256i {
        self.select_u32(k0, a, self.select_u32(k1, b, c))
    }
}

/// Methods of two arguments from the processor's intrinsics.
macro_rules! of_two {
    (|$cpu:ident, $a:ident, $b:ident| $($name:ident = $value:expr,)*) => {
        $(
            #[inline(always)]
            fn $name(self, $a: Self::F, $b: Self::F) -> Self::F {
                let $cpu = self;
                $value
            }
        )*
    };
}

impl Lanes for V4 {
    type F = __m512d;
    type M = u8;

    #[inline(always)]
    fn avx(self) -> Avx {
        self.avx
    }

    #[inline(always)]
    fn avx2(self) -> Avx2 {
        self.avx2
    }

    of_two!(
        |cpu, a, b| add = cpu.avx512f._mm512_add_pd(a, b),
        sub = cpu.avx512f._mm512_sub_pd(a, b),
        mul = cpu.avx512f._mm512_mul_pd(a, b),
        div = cpu.avx512f._mm512_div_pd(a, b),
        greater = cpu.avx512f._mm512_max_pd(a, b),
        less = cpu.avx512f._mm512_min_pd(a, b),
    );

    #[inline(always)]
    fn vectorize(self, call: impl NullaryFnOnce<Output = ()>) {
        V4::vectorize(self, call);
    }

    #[inline(always)]
    fn load(self, from: &Eight) -> __m512d {
        cast(*from)
    }

    #[inline(always)]
    fn store(self, from: __m512d) -> Eight {
        cast(from)
    }

    #[inline(always)]
    fn splat(self, value: f64) -> __m512d {
        self.avx512f._mm512_set1_pd(value)
    }

    #[inline(always)]
    fn abs(self, a: __m512d) -> __m512d {
        self.avx512f._mm512_abs_pd(a)
    }

    #[inline(always)]
    fn to_f32(self, a: __m512d) -> __m256 {
        self.avx512f._mm512_cvtpd_ps(a)
    }

    #[inline(always)]
    fn lt(self, a: __m512d, b: __m512d) -> u8 {
        self.avx512f._mm512_cmplt_pd_mask(a, b)
    }

    #[inline(always)]
    fn and(self, a: u8, b: u8) -> u8 {
        a & b
    }

    #[inline(always)]
    fn and_not(self, a: u8, b: u8) -> u8 {
        a & !b
    }

    #[inline(always)]
    fn bits(self, mask: u8) -> u8 {
        mask
    }

    #[inline(always)]
    fn mask(self, bits: u8) -> u8 {
        bits
    }

    #[inline(always)]
    fn select(self, mask: u8, a: __m512d, b: __m512d) -> __m512d {
        self.avx512f._mm512_mask_blend_pd(mask, b, a)
    }

    #[inline(always)]
    fn select_u32(self, mask: u8, a: __m256i, b: __m256i) -> __m256i {
        self.avx512f._mm256_mask_blend_epi32(mask, b, a)
    }

    #[inline(always)]
    fn select_f32(self, mask: u8, a: __m256, b: __m256) -> __m256 {
        self.avx512f._mm256_mask_blend_ps(mask, b, a)
    }

    #[inline(always)]
    fn less_f32(self, a: __m256, b: __m256) -> u8 {
        self.avx512f._mm256_cmp_ps_mask::<_CMP_LT_OQ>(a, b)
    }

    #[inline(always)]
    fn transpose(self, rows: [&[f64; 4]; LANES]) -> [__m512d; 4] {
        let [a, b, c, d, e, f, g, h] = rows;
        let [a, b]: [__m512d; 2] = [cast([*a, *e]), cast([*b, *f])];
        let [c, d]: [__m512d; 2] = [cast([*c, *g]), cast([*d, *h])];
        let low: __m512i = cast([0u64, 1, 8, 9, 4, 5, 12, 13]);
        let high: __m512i = cast([2u64, 3, 10, 11, 6, 7, 14, 15]);
        let even = [self.avx512f._mm512_unpacklo_pd(a, b), self.avx512f._mm512_unpacklo_pd(c, d)];
        let odd = [self.avx512f._mm512_unpackhi_pd(a, b), self.avx512f._mm512_unpackhi_pd(c, d)];
        [
            self.avx512f._mm512_permutex2var_pd(even[0], low, even[1]),
            self.avx512f._mm512_permutex2var_pd(odd[0], low, odd[1]),
            self.avx512f._mm512_permutex2var_pd(even[0], high, even[1]),
            self.avx512f._mm512_permutex2var_pd(odd[0], high, odd[1]),
        ]
    }

    #[inline(always)]
    fn across(self, tets: [&[u32; 4]; LANES], neighbours: [&[u32; 4]; LANES], gone: __m256i) -> __m256i {
        let gone = self.avx512f._mm512_castsi256_si512(gone);
        let first: __m512i = cast([0u32, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]);
        let second: __m512i = cast([4u32, 4, 4, 4, 5, 5, 5, 5, 6, 6, 6, 6, 7, 7, 7, 7]);
        let gone =
            [self.avx512f._mm512_permutexvar_epi32(first, gone), self.avx512f._mm512_permutexvar_epi32(second, gone)];
        let (tets, neighbours) = (fours(tets), fours(neighbours));
        let is_gone = [
            self.avx512f._mm512_cmpeq_epi32_mask(tets[0], gone[0]),
            self.avx512f._mm512_cmpeq_epi32_mask(tets[1], gone[1]),
        ];
        let packed = [
            self.avx512f._mm512_maskz_compress_epi32(is_gone[0], neighbours[0]),
            self.avx512f._mm512_maskz_compress_epi32(is_gone[1], neighbours[1]),
        ];
        let packed = [self.avx512f._mm512_castsi512_si256(packed[0]), self.avx512f._mm512_castsi512_si256(packed[1])];
        // Only four of each are used.
        self.avx2._mm256_permute2x128_si256::<0x20>(packed[0], packed[1])
    }
}

/// The rows as two vectors of four rows each.
#[inline(always)]
fn fours([a, b, c, d, e, f, g, h]: [&[u32; 4]; LANES]) -> [__m512i; 2] {
    [cast([*a, *b, *c, *d]), cast([*e, *f, *g, *h])]
}

impl Lanes for V3 {
    type F = [__m256d; 2];
    type M = [__m256d; 2];

    #[inline(always)]
    fn avx(self) -> Avx {
        self.avx
    }

    #[inline(always)]
    fn avx2(self) -> Avx2 {
        self.avx2
    }

    of_two!(
        |cpu, a, b| add = [cpu.avx._mm256_add_pd(a[0], b[0]), cpu.avx._mm256_add_pd(a[1], b[1])],
        sub = [cpu.avx._mm256_sub_pd(a[0], b[0]), cpu.avx._mm256_sub_pd(a[1], b[1])],
        mul = [cpu.avx._mm256_mul_pd(a[0], b[0]), cpu.avx._mm256_mul_pd(a[1], b[1])],
        div = [cpu.avx._mm256_div_pd(a[0], b[0]), cpu.avx._mm256_div_pd(a[1], b[1])],
        greater = [cpu.avx._mm256_max_pd(a[0], b[0]), cpu.avx._mm256_max_pd(a[1], b[1])],
        less = [cpu.avx._mm256_min_pd(a[0], b[0]), cpu.avx._mm256_min_pd(a[1], b[1])],
    );

    #[inline(always)]
    fn vectorize(self, call: impl NullaryFnOnce<Output = ()>) {
        V3::vectorize(self, call);
    }

    #[inline(always)]
    fn load(self, from: &Eight) -> Self::F {
        cast(*from)
    }

    #[inline(always)]
    fn store(self, from: Self::F) -> Eight {
        cast(from)
    }

    #[inline(always)]
    fn splat(self, value: f64) -> Self::F {
        [self.avx._mm256_set1_pd(value); 2]
    }

    #[inline(always)]
    fn abs(self, a: Self::F) -> Self::F {
        let sign = self.avx._mm256_set1_pd(-0.0);
        [self.avx._mm256_andnot_pd(sign, a[0]), self.avx._mm256_andnot_pd(sign, a[1])]
    }

    #[inline(always)]
    fn to_f32(self, a: Self::F) -> __m256 {
        let halves: [__m128; 2] = [self.avx._mm256_cvtpd_ps(a[0]), self.avx._mm256_cvtpd_ps(a[1])];
        self.avx._mm256_set_m128(halves[1], halves[0])
    }

    #[inline(always)]
    fn lt(self, a: Self::F, b: Self::F) -> Self::M {
        [self.avx._mm256_cmp_pd::<_CMP_LT_OQ>(a[0], b[0]), self.avx._mm256_cmp_pd::<_CMP_LT_OQ>(a[1], b[1])]
    }

    #[inline(always)]
    fn and(self, a: Self::M, b: Self::M) -> Self::M {
        [self.avx._mm256_and_pd(a[0], b[0]), self.avx._mm256_and_pd(a[1], b[1])]
    }

    #[inline(always)]
    fn and_not(self, a: Self::M, b: Self::M) -> Self::M {
        [self.avx._mm256_andnot_pd(b[0], a[0]), self.avx._mm256_andnot_pd(b[1], a[1])]
    }

    #[inline(always)]
    fn bits(self, mask: Self::M) -> u8 {
        (self.avx._mm256_movemask_pd(mask[0]) | self.avx._mm256_movemask_pd(mask[1]) << 4) as u8
    }

    #[inline(always)]
    fn mask(self, bits: u8) -> Self::M {
        let (low, high): (__m256i, __m256i) = (cast([1u64, 2, 4, 8]), cast([16u64, 32, 64, 128]));
        let all = self.avx._mm256_set1_epi64x(i64::from(bits));
        [
            cast(self.avx2._mm256_cmpeq_epi64(self.avx2._mm256_and_si256(all, low), low)),
            cast(self.avx2._mm256_cmpeq_epi64(self.avx2._mm256_and_si256(all, high), high)),
        ]
    }

    #[inline(always)]
    fn select(self, mask: Self::M, a: Self::F, b: Self::F) -> Self::F {
        [self.avx._mm256_blendv_pd(b[0], a[0], mask[0]), self.avx._mm256_blendv_pd(b[1], a[1], mask[1])]
    }

    #[inline(always)]
    fn select_u32(self, mask: Self::M, a: __m256i, b: __m256i) -> __m256i {
        // The lower halves of the flags, in order.
        let halves = self.avx._mm256_shuffle_ps::<0x88>(cast(mask[0]), cast(mask[1]));
        let flags = self.avx2._mm256_permute4x64_epi64::<0xd8>(cast(halves));
        self.avx2._mm256_blendv_epi8(b, a, flags)
    }

    #[inline(always)]
    fn select_f32(self, mask: Self::M, a: __m256, b: __m256) -> __m256 {
        cast(self.select_u32(mask, cast(a), cast(b)))
    }

    #[inline(always)]
    fn less_f32(self, a: __m256, b: __m256) -> u8 {
        self.avx._mm256_movemask_ps(self.avx._mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) as u8
    }

    #[inline(always)]
    fn transpose(self, rows: [&[f64; 4]; LANES]) -> [Self::F; 4] {
        let [a, b, c, d, e, f, g, h] = rows;
        let (low, high) = (transpose_four(self, [a, b, c, d]), transpose_four(self, [e, f, g, h]));
        [[low[0], high[0]], [low[1], high[1]], [low[2], high[2]], [low[3], high[3]]]
    }

    #[inline(always)]
    fn across(self, tets: [&[u32; 4]; LANES], neighbours: [&[u32; 4]; LANES], gone: __m256i) -> __m256i {
        let [a, b, c, d, e, f, g, h] = tets;
        let tets: [__m256i; 4] = [cast([*a, *e]), cast([*b, *f]), cast([*c, *g]), cast([*d, *h])];
        let [a, b, c, d, e, f, g, h] = neighbours;
        let neighbours: [__m256i; 4] = [cast([*a, *e]), cast([*b, *f]), cast([*c, *g]), cast([*d, *h])];
        let gone = [
            self.avx2._mm256_shuffle_epi32::<0x00>(gone),
            self.avx2._mm256_shuffle_epi32::<0x55>(gone),
            self.avx2._mm256_shuffle_epi32::<0xaa>(gone),
            self.avx2._mm256_shuffle_epi32::<0xff>(gone),
        ];
        let mut kept = tets;
        for (kept, (&neighbours, &gone)) in kept.iter_mut().zip(neighbours.iter().zip(&gone)) {
            *kept = self.avx2._mm256_and_si256(self.avx2._mm256_cmpeq_epi32(*kept, gone), neighbours);
        }
        // One number of each row is not zero: the sum of the row.
        let sums = [self.avx2._mm256_hadd_epi32(kept[0], kept[1]), self.avx2._mm256_hadd_epi32(kept[2], kept[3])];
        self.avx2._mm256_hadd_epi32(sums[0], sums[1])
    }
}

/// The columns of four rows.
#[inline(always)]
fn transpose_four(v3: V3, [a, b, c, d]: [&[f64; 4]; 4]) -> [__m256d; 4] {
    let [[a0, a1], [b0, b1], [c0, c1], [d0, d1]]: [[[f64; 2]; 2]; 4] = [cast(*a), cast(*b), cast(*c), cast(*d)];
    // Halves of rows are put together as they are loaded.
    let first: [__m256d; 2] = [cast([a0, c0]), cast([b0, d0])];
    let last: [__m256d; 2] = [cast([a1, c1]), cast([b1, d1])];
    [
        v3.avx._mm256_unpacklo_pd(first[0], first[1]),
        v3.avx._mm256_unpackhi_pd(first[0], first[1]),
        v3.avx._mm256_unpacklo_pd(last[0], last[1]),
        v3.avx._mm256_unpackhi_pd(last[0], last[1]),
    ]
}

#[cfg(test)]
#[path = "vector_tests.rs"]
mod tests;
