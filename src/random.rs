//! Random numbers that are identical on every machine: SplitMix64 as a stream and as a hash.

/// The golden-ratio increment of SplitMix64.
const GAMMA: u64 = 0x9E37_79B9_7F4A_7C15;

/// SplitMix64 (Steele, Lea, Flood: *Fast splittable pseudorandom number generators*, OOPSLA 2014).
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// The stream of `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GAMMA);
        mix(self.0)
    }

    /// The next number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        unit(self.next_u64())
    }

    /// The next number in [lo, hi).
    pub fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.unit()
    }

    /// The next index below `n`, by multiplication (its bias of n / 2^64 is of no concern here); 0 for `n` = 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.next_u64()) * n as u128) >> 64) as usize
    }
}

/// Random bits that depend on `seed` and `index` only, so that values can be made in any order and on any thread.
pub fn hash(seed: u64, index: u64) -> u64 {
    mix(mix(seed.wrapping_add(GAMMA)).wrapping_add(index.wrapping_mul(GAMMA)).wrapping_add(GAMMA))
}

/// The upper 53 bits of `bits` as a number in [0, 1).
pub fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 * (-53f64).exp2()
}

/// The finalizer of SplitMix64, a bijection of u64.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stream_is_the_published_one() {
        // First outputs of Vigna's splitmix64.c for this seed.
        let mut stream = SplitMix64::new(1_234_567);
        let got: Vec<u64> = (0..3).map(|_| stream.next_u64()).collect();
        assert_eq!(got, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    #[test]
    fn units_lie_in_the_half_open_interval_and_have_the_mean_and_variance_of_it() {
        assert_eq!(unit(0), 0.0);
        assert!(unit(u64::MAX) < 1.0);
        let n = 100_000;
        let values: Vec<f64> = (0..n).map(|i| unit(hash(7, i))).collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n as f64;
        // Standard errors: sqrt(1/12 / n) = 9e-4 and about sqrt(1/180 / n) = 2.4e-4; five of each.
        assert!((mean - 0.5).abs() < 4.6e-3, "{mean}");
        assert!((variance - 1.0 / 12.0).abs() < 1.2e-3, "{variance}");
    }

    #[test]
    fn indices_stay_below_their_bound_and_reach_all_of_it() {
        let mut stream = SplitMix64::new(3);
        let mut seen = [0usize; 5];
        for _ in 0..1000 {
            seen[stream.below(5)] += 1;
        }
        assert!(seen.iter().all(|&count| count > 100), "{seen:?}");
        assert_eq!(stream.below(0), 0);
    }

    #[test]
    fn neighbouring_seeds_and_indices_give_unrelated_bits() {
        let flipped = |a: u64, b: u64| (a ^ b).count_ones();
        let pairs: u32 = (0..1000).map(|i| flipped(hash(1, i), hash(2, i)) + flipped(hash(1, i), hash(1, i + 1))).sum();
        // 128,000 bits, each flipped with probability 1/2: standard deviation 179; five of them.
        assert!((f64::from(pairs) - 64_000.0).abs() < 900.0, "{pairs}");
    }
}
