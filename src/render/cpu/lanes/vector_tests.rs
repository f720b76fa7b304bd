//! Every operation on all vectors of this processor, against scalar arithmetic.

use super::*;

/// Numbers with zeros of both signs, equal ones and extremes.
const A: Eight = [0.0, -0.0, 1.5, -2.25, 1e300, 1e-300, 7.0, 0.1];
const B: Eight = [-0.0, 0.0, 1.5, 3.0, -1e300, 2e-300, -7.0, 0.3];
const FLAGS: u8 = 0b1011_0010;

fn flag(l: usize) -> bool {
    FLAGS >> l & 1 == 1
}

fn bits_of(flags: impl Fn(usize) -> bool) -> u8 {
    (0..LANES).fold(0, |bits, l| bits | u8::from(flags(l)) << l)
}

struct Compare<L>(L);

impl<L: Lanes> NullaryFnOnce for Compare<L> {
    type Output = ();

    fn call(self) {
        let lanes = self.0;
        let (a, b) = (lanes.load(&A), lanes.load(&B));
        let same = |found: L::F, each: &dyn Fn(f64, f64) -> f64| {
            let found = lanes.store(found).map(f64::to_bits);
            assert_eq!(found, std::array::from_fn(|l| each(A[l], B[l]).to_bits()));
        };
        same(lanes.add(a, b), &|a, b| a + b);
        same(lanes.sub(a, b), &|a, b| a - b);
        same(lanes.mul(a, b), &|a, b| a * b);
        same(lanes.div(a, lanes.splat(3.0)), &|a, _| a / 3.0);
        same(lanes.greater(a, b), &|a, b| if a > b { a } else { b });
        same(lanes.less(a, b), &|a, b| if a < b { a } else { b });
        same(lanes.abs(a), &|a, _| a.abs());
        same(lanes.neg(a), &|a, _| -a);
        let flags = lanes.mask(FLAGS);
        let of = |l: usize| if flag(l) { A[l] } else { B[l] };
        assert_eq!(lanes.store(lanes.select(flags, a, b)).map(f64::to_bits), std::array::from_fn(|l| of(l).to_bits()));
        let less = lanes.lt(a, b);
        assert_eq!(lanes.bits(flags), FLAGS);
        assert_eq!(lanes.bits(less), bits_of(|l| A[l] < B[l]));
        assert_eq!(lanes.bits(lanes.and(less, flags)), bits_of(|l| A[l] < B[l] && flag(l)));
        assert_eq!(lanes.bits(lanes.and_not(less, flags)), bits_of(|l| A[l] < B[l] && !flag(l)));
        self.compare_f32();
        self.compare_rows();
    }
}

impl<L: Lanes> Compare<L> {
    fn compare_f32(&self) {
        let lanes = self.0;
        let (a32, b32) = (A.map(|a| a as f32), B.map(|b| b as f32));
        assert_eq!(cast::<_, [u32; LANES]>(lanes.to_f32(lanes.load(&A))), a32.map(f32::to_bits));
        let (a, b): (__m256, __m256) = (cast(a32), cast(b32));
        let same = |found: __m256, each: &dyn Fn(usize) -> f32| {
            assert_eq!(cast::<_, [u32; LANES]>(found), std::array::from_fn(|l| each(l).to_bits()));
        };
        same(lanes.add_f32(a, lanes.splat_f32(2.5)), &|l| a32[l] + 2.5);
        same(lanes.mul_f32(a, lanes.splat_f32(2.5)), &|l| a32[l] * 2.5);
        same(lanes.greater_f32(a, b), &|l| if a32[l] > b32[l] { a32[l] } else { b32[l] });
        same(lanes.select_f32(lanes.mask(FLAGS), a, b), &|l| if flag(l) { a32[l] } else { b32[l] });
        assert_eq!(lanes.less_f32(a, b), bits_of(|l| a32[l] < b32[l]));
        let after = |n: usize, l: usize| if l < n { 1.0 } else { a32[l - n] };
        same(lanes.one_after::<1>(a), &|l| after(1, l));
        same(lanes.one_after::<2>(a), &|l| after(2, l));
        same(lanes.one_after::<4>(a), &|l| after(4, l));
        // Sums that another order would round otherwise.
        let vectors: [[f32; LANES]; 4] =
            std::array::from_fn(|i| std::array::from_fn(|l| (i * 8 + l) as f32).map(f32::sin));
        let sums = vectors.map(|[a, b, c, d, e, f, g, h]| ((a + b) + (c + d)) + ((e + f) + (g + h)));
        assert_eq!(lanes.sums_f32(vectors.map(cast)), sums);
    }

    fn compare_rows(&self) {
        let lanes = self.0;
        let of_f32: [[f32; LANES]; LANES] = std::array::from_fn(|l| std::array::from_fn(|i| (8 * l + i) as f32));
        let columns = lanes.transpose_f32(of_f32.each_ref()).map(cast::<__m256, [f32; LANES]>);
        assert_eq!(columns, std::array::from_fn(|i| of_f32.map(|row| row[i])));
        let numbers: [[f64; 4]; LANES] = std::array::from_fn(|r| std::array::from_fn(|c| (10 * r + c) as f64));
        for (c, column) in lanes.transpose(numbers.each_ref()).into_iter().enumerate() {
            assert_eq!(lanes.store(column), std::array::from_fn(|r| numbers[r][c]));
        }
        let tets: [[u32; 4]; LANES] = std::array::from_fn(|r| std::array::from_fn(|c| (10 * r + c) as u32));
        let neighbours = tets.map(|row| row.map(|v| 1000 + v));
        let gone: [u32; LANES] = std::array::from_fn(|r| tets[r][(r * 3 + 1) % 4]);
        let found: [u32; LANES] = cast(lanes.across(tets.each_ref(), neighbours.each_ref(), cast(gone)));
        assert_eq!(found, gone.map(|v| 1000 + v));
        let chosen: [u32; LANES] = cast(lanes.select_u32(lanes.mask(FLAGS), cast(gone), cast(found)));
        assert_eq!(chosen, std::array::from_fn(|l| if flag(l) { gone[l] } else { found[l] }));
    }
}

#[test]
fn vectors_do_what_numbers_do_one_by_one() {
    V3::try_new().into_iter().for_each(|lanes| Lanes::vectorize(lanes, Compare(lanes)));
    V4::try_new().into_iter().for_each(|lanes| Lanes::vectorize(lanes, Compare(lanes)));
}
