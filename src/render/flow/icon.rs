//! Icons: patterns of one channel, periodic both ways, along which the flow is seen to move.
//!
//! s runs along the flow, t across it, one period each. All have the same mean, so that none is more opaque than another, and none has a seam.

use super::lanes::{Eight, LANES};
use crate::random::{hash, unit};
use crate::words::words;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// Texels along and across.
pub(in crate::render) const TEXELS: usize = 64;

/// Mean of each generated icon.
pub(super) const MEAN: f64 = 0.2;

/// A generated pattern of splats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Icon {
    /// Short strokes, brighter towards their heads.
    #[default]
    Strokes,
    /// Long lines.
    Lines,
    /// Dots.
    Particles,
    /// Arrow heads.
    Arrows,
}

words!(Icon, "there is no icon", ["strokes" = Strokes, "lines" = Lines, "particles" = Particles, "arrows" = Arrows]);

impl Icon {
    /// The texels, 0 to 1, of mean [`MEAN`]: rows across, in each the texels along.
    pub(crate) fn texels(self) -> Vec<[f64; TEXELS]> {
        let at = |i: usize| (i as f64 + 0.5) / TEXELS as f64;
        let raw: Vec<[f64; TEXELS]> =
            (0..TEXELS).map(|row| std::array::from_fn(|column| self.raw(at(column), at(row)))).collect();
        let mean = |power: f64| {
            let sum: f64 = raw.iter().flatten().map(|value| value.powf(power)).sum();
            sum / (TEXELS * TEXELS) as f64
        };
        // The mean falls with the power: bisected to the last bits.
        let (mut low, mut high) = (0.0, 64.0);
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            *(if mean(middle) > MEAN { &mut low } else { &mut high }) = middle;
        }
        raw.iter().map(|row| row.map(|value| value.powf(low))).collect()
    }

    /// The pattern at a place before its mean is set, 0 to 1.
    fn raw(self, s: f64, t: f64) -> f64 {
        match self {
            Self::Strokes => most((0..14).map(|i| {
                let ([from, lane], length) = (place(1, i), 0.25 + 0.15 * unit(hash(2, i)));
                let behind = (from - s).rem_euclid(1.0) / length;
                bump(nearest(t - lane) / 0.03) * if behind < 1.0 { 1.0 - behind } else { 0.0 }
            })),
            Self::Lines => most((0..10).map(|i| {
                let [from, shift] = place(3, i);
                let lane = (i as f64 + 0.6 * shift) / 10.0;
                // All around, so that a line is never cut.
                bump(nearest(t - lane) / 0.025) * (0.55 + 0.45 * (TAU * (s - from)).cos())
            })),
            Self::Particles => most((0..9).map(|i| {
                // One in each of 3 x 3 squares: never two at one place.
                let ([x, y], [column, row]) = (place(4, i), [i % 3, i / 3].map(|k| k as f64));
                let center = [(column + 0.25 + 0.5 * x) / 3.0, (row + 0.25 + 0.5 * y) / 3.0];
                bump(nearest(s - center[0]) / 0.055) * bump(nearest(t - center[1]) / 0.055)
            })),
            Self::Arrows => most([[0.25, 0.25], [0.75, 0.75]].into_iter().map(|[x, y]| {
                let (behind, beside) = (nearest(x + 0.2 - s), nearest(t - y).abs());
                // A head whose wings sweep back, and a shaft behind its tip.
                let wing = bump((behind - 1.2 * beside) / 0.035) * soft((0.16 - beside) / 0.015);
                let shaft = bump(beside / 0.025) * soft(behind / 0.015) * soft((0.38 - behind) / 0.015);
                wing.max(shaft)
            })),
        }
    }
}

fn most(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

/// A place in the period, by chance but always the same.
fn place(seed: u64, index: u64) -> [f64; 2] {
    [0, 1].map(|part| unit(hash(seed, 2 * index + part)))
}

/// The nearest of all periods' repetitions of a distance, -0.5 to 0.5.
fn nearest(distance: f64) -> f64 {
    distance - distance.round()
}

/// A Gaussian of width 1.
fn bump(distance: f64) -> f64 {
    (-0.5 * distance * distance).exp()
}

/// From 0 to 1 around 0.
fn soft(at: f64) -> f64 {
    1.0 / (1.0 + (-at).exp())
}

/// An icon as running sums along s, averaged across over 1, 2, 4, ... texels: the mean over any box is four look-ups.
#[derive(Debug)]
pub(in crate::render) struct IconSums {
    /// For each power of two, each row.
    levels: Vec<[SumsOfRow; TEXELS]>,
    /// Mean of the icon.
    whole: f64,
}

/// For each texel of a row the sum of those before it, and the texel itself; then the sum of all, and zero.
type SumsOfRow = [[f32; 2]; TEXELS + 1];

impl IconSums {
    /// The sums of an icon, made when it is first drawn.
    pub(in crate::render) fn of(icon: Icon) -> &'static Self {
        static ALL: [OnceLock<IconSums>; Icon::ALL.len()] = [const { OnceLock::new() }; Icon::ALL.len()];
        ALL[icon as usize].get_or_init(|| Self::make(&icon.texels(), MEAN))
    }

    /// The sums of the texels of an icon with this mean.
    pub(super) fn make(texels: &[[f64; TEXELS]], whole: f64) -> Self {
        let level = |level: u32| {
            let rows = 1usize << level;
            std::array::from_fn(|first| {
                let mut before = 0.0;
                std::array::from_fn(|column| {
                    if column == TEXELS {
                        return [before as f32, 0.0];
                    }
                    let all: f64 = (0..rows).map(|row| texels[(first + row) % TEXELS][column]).sum();
                    let texel = all / rows as f64;
                    before += texel;
                    [(before - texel) as f32, texel as f32]
                })
            })
        };
        Self { levels: (0..=TEXELS.ilog2()).map(level).collect(), whole }
    }

    /// The mean of the icon, into which it fades.
    #[inline(always)]
    pub(super) fn whole(&self) -> f64 {
        self.whole
    }

    /// Appends the sums as texels: for each level and row those before each texel from half a period before the period to half of one behind
    /// it, and the texel, of the row and of the next one (`shaders/lib/flow_icons.wgsl`).
    #[cfg(feature = "gpu")]
    pub(super) fn push_texels(&self, texels: &mut Vec<[f32; 4]>) {
        let half = TEXELS as i32 / 2;
        for rows in &self.levels {
            for row in 0..TEXELS {
                let both = [&rows[row], &rows[(row + 1) % TEXELS]];
                for column in -half..=TEXELS as i32 + half {
                    let (period, at) = (column.div_euclid(TEXELS as i32), column.rem_euclid(TEXELS as i32) as usize);
                    let sum = |of: &SumsOfRow| f64::from(of[at][0]) + f64::from(period) * f64::from(of[TEXELS][0]);
                    let [[before, here], [next_before, next]] = both.map(|of| [sum(of) as f32, of[at][1]]);
                    texels.push([before, here, next_before, next]);
                }
            }
        }
    }

    /// The level whose rows are at least as many texels as a pixel is across.
    pub(in crate::render) fn level(periods_per_pixel: f64) -> u32 {
        let texels = (periods_per_pixel * TEXELS as f64).clamp(1.0, TEXELS as f64);
        texels.log2().ceil() as u32
    }

    /// Width of the box along, in periods, for a pixel of this width: at least a texel, at most a period.
    pub(in crate::render) fn width(periods_per_pixel: f64) -> f64 {
        periods_per_pixel.clamp(1.0 / TEXELS as f64, 1.0)
    }

    /// The means over boxes around places (s, t), in periods: `width` long and 2^level texels across. Those around what is not finite are NaN.
    ///
    /// Sums are f32: off by 2^-19 at most, for icons of the usual mean by 2^-21, of which two are subtracted, over the box's texels along.
    #[inline(always)]
    pub(super) fn means(&self, s: &Eight, t: &Eight, width: f64, level: u32) -> [f32; LANES] {
        const TEXEL: f64 = TEXELS as f64;
        let rows = &self.levels[level as usize];
        let (wide, across) = (width * TEXEL, 0.5 * f64::from(1u32 << level));
        let (mut from, mut to, mut row) = (Texels::default(), Texels::default(), Texels::default());
        for l in 0..LANES {
            let begin = (s[l] - s[l].floor()) * TEXEL - 0.5 * wide;
            from.set(l, begin);
            to.set(l, begin + wide);
            row.set(l, (t[l] - t[l].floor()) * TEXEL - across);
        }
        let near = sums_between(rows, &row.number, &from, &to);
        let mut next = row.number;
        for of in &mut next {
            *of = of.wrapping_add(1);
        }
        let far = sums_between(rows, &next, &from, &to);
        let per_texel = wide.recip() as f32;
        let mut means = [0.0; LANES];
        for l in 0..LANES {
            means[l] = (near[l] + row.share[l] * (far[l] - near[l])) * per_texel;
        }
        means
    }
}

/// The texels around places: the number of each, and how far in it the place is.
#[derive(Default)]
struct Texels {
    number: [i32; LANES],
    share: [f32; LANES],
}

impl Texels {
    #[inline(always)]
    fn set(&mut self, l: usize, at: f64) {
        let floor = at.floor();
        (self.number[l], self.share[l]) = (to_integer(floor), (at - floor) as f32);
    }
}

/// The sums of rows of these numbers from one place to another.
#[inline(always)]
fn sums_between(rows: &[SumsOfRow; TEXELS], numbers: &[i32; LANES], from: &Texels, to: &Texels) -> [f32; LANES] {
    let mut sums = [[0.0; LANES]; 5];
    for l in 0..LANES {
        let row = &rows[texel(numbers[l])];
        let (a, b) = (row[texel(from.number[l])], row[texel(to.number[l])]);
        (sums[0][l], sums[1][l], sums[2][l], sums[3][l]) = (a[0], a[1], b[0], b[1]);
        sums[4][l] = row[TEXELS][0];
    }
    let mut between = [0.0; LANES];
    for l in 0..LANES {
        let periods = ((to.number[l] >> TEXELS.ilog2()) - (from.number[l] >> TEXELS.ilog2())) as f32;
        let parts = to.share[l] * sums[3][l] - from.share[l] * sums[1][l];
        between[l] = periods * sums[4][l] + ((sums[2][l] - sums[0][l]) + parts);
    }
    between
}

/// The index of a texel in its period.
#[inline(always)]
fn texel(number: i32) -> usize {
    number as usize % TEXELS
}

/// An integer in f64, below 2^31; something else for what is not finite. Its last bits after a sum with 1.5 * 2^52: vectors of older processors
/// have no other way.
#[inline(always)]
fn to_integer(whole: f64) -> i32 {
    (whole + 6_755_399_441_055_744.0).to_bits() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn icons_have_one_mean_and_no_seam() {
        for icon in Icon::ALL {
            let texels = icon.texels();
            let mean = texels.iter().flatten().sum::<f64>() / (TEXELS * TEXELS) as f64;
            // A sum of 4096 numbers below 1 in float64.
            assert!((mean - MEAN).abs() < 1e-12, "{icon}: {mean}");
            assert!(texels.iter().flatten().all(|value| (0.0..=1.0).contains(value)));
            let value = |row: usize, column: usize| texels[row % TEXELS][column % TEXELS];
            let step = |row: usize, column: usize| {
                let here = value(row, column);
                [(value(row, column + 1) - here).abs(), (value(row + 1, column) - here).abs()]
            };
            let most = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>, way: usize| {
                rows.flat_map(|row| columns.clone().map(move |column| (row, column)))
                    .map(|(row, column)| step(row, column)[way])
                    .fold(0.0, f64::max)
            };
            let last = TEXELS - 1;
            assert!(most(0..TEXELS, last..TEXELS, 0) <= most(0..TEXELS, 0..last, 0), "{icon} along");
            assert!(most(last..TEXELS, 0..TEXELS, 1) <= most(0..last, 0..TEXELS, 1), "{icon} across");
            assert!(most(0..TEXELS, 0..TEXELS, 0) > 0.02, "{icon} is seen to move");
        }
    }

    #[test]
    fn the_mean_over_a_period_is_that_of_the_icon_and_of_a_texel_the_texel() {
        for icon in Icon::ALL {
            let (sums, texels) = (IconSums::of(icon), icon.texels());
            let top = IconSums::level(1.0);
            let mean = |s, t, width, level| f64::from(sums.means(&[s; LANES], &[t; LANES], width, level)[0]);
            // Five roundings of sums up to 13, by 2^-21 each, over 64 texels, and three of the mean, by 2^-27; below, over one texel.
            assert!((mean(0.3, -7.1, 1.0, top) - MEAN).abs() < 6e-8, "{icon}");
            let center = |i: usize| (i as f64 + 0.5) / TEXELS as f64;
            for (row, column) in [(0, 0), (5, 63), (63, 17)] {
                // A whole number of periods away.
                let found = mean(center(column) - 3.0, center(row) + 2.0, 1.0 / TEXELS as f64, 0);
                assert!((found - texels[row][column]).abs() < 2.5e-6, "{icon}");
            }
            for bad in [f64::NAN, f64::INFINITY] {
                assert!(mean(bad, 0.5, 1.0, 0).is_nan() && mean(0.5, -bad, 0.5, top).is_nan());
            }
        }
        assert_eq!([0.0, 1.0 / 64.0, 1.1 / 64.0, 0.4, 9.0].map(IconSums::level), [0, 0, 1, 5, 6]);
    }
}
