//! Adaptive sampling against a plain recursion over the blocks, on synthetic images.

use super::*;
use proptest::prelude::*;
use std::collections::BTreeSet;

/// An image, its domain, and its boxes of entry faces.
struct Exact {
    size: (usize, usize),
    colors: Vec<[f32; 4]>,
    met: Vec<bool>,
    boxes: Vec<[usize; 4]>,
}

impl Exact {
    fn at(&self, (x, y): (usize, usize)) -> usize {
        y * self.size.0 + x
    }

    fn reach(&self, columns: &Range<usize>, rows: &Range<usize>) -> bool {
        self.boxes
            .iter()
            .any(|&[x0, x1, y0, y1]| x0 < columns.end && columns.start < x1 && y0 < rows.end && rows.start < y1)
    }

    /// A smooth image with steps; parts of the domain of any size.
    fn random(size: (usize, usize), seeds: &[(f32, f32, f32)]) -> Self {
        let (mut colors, mut met) = (Vec::new(), Vec::new());
        for (y, x) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (y as f32, x as f32))) {
            let inside = |&(a, b, c): &(f32, f32, f32)| {
                let (dx, dy) = (x - a * size.0 as f32, y - b * size.1 as f32);
                dx * dx + dy * dy < (20.0 * c * c * c).powi(2)
            };
            let parts = seeds.iter().filter(|seed| inside(seed)).count() as f32;
            let light =
                if parts > 0.0 { 0.2 * parts + 0.1 * (0.2 * x).sin() + 0.05 * (0.1 * x * y).cos() } else { 0.0 };
            colors.push([light, 0.5 * light, 0.0, light.min(1.0)]);
            met.push(parts > 0.0);
        }
        let boxes = (0..met.len()).filter(|&at| met[at]).map(|at| (at % size.0, at / size.0));
        let boxes = boxes.map(|(x, y)| [x.saturating_sub(1), x + 1, y, y + 2]).collect();
        Self { size, colors, met, boxes }
    }

    /// The image with contrast-adaptive sampling, the pixels whose rays were cast, and the counts.
    fn sampled(&self, contrast: f32) -> (Planes, BTreeSet<(usize, usize)>, FrameStats) {
        let (mut adaptive, mut stats, mut cast) = (Adaptive::default(), FrameStats::default(), BTreeSet::new());
        // Memory left over from another image.
        adaptive.begin((9, 30), vec![0.5]);
        adaptive.begin(self.size, vec![contrast]);
        loop {
            for pixel in (0..self.size.1).flat_map(|y| (0..self.size.0).map(move |x| (x, y))) {
                if adaptive.wanted.contains(pixel.0, pixel.1) {
                    assert!(cast.insert(pixel), "a ray is cast once");
                    let at = self.at(pixel);
                    adaptive.seen.planes.color.pixels[at] = self.colors[at];
                    adaptive.seen.planes.depth.pixels[at] = at as f32;
                    if self.met[at] {
                        adaptive.seen.met.insert(pixel.0, pixel.1);
                    }
                }
            }
            if !adaptive.refine(|columns, rows| self.reach(&columns, &rows), |_, _| false, &mut stats) {
                break;
            }
        }
        let mut planes = Planes::default();
        planes.clear(self.size.0, self.size.1);
        adaptive.fill(&mut planes);
        (planes, cast, stats)
    }

    /// The first and last pixels of the blocks of a stride in one direction.
    fn lines(stride: usize, pixels: usize) -> Vec<(usize, usize)> {
        let mut places: Vec<usize> = (0..pixels).filter(|&p| p.is_multiple_of(stride) || p + 1 == pixels).collect();
        if places.len() == 1 {
            places.push(places[0]);
        }
        places.windows(2).map(|two| (two[0], two[1])).collect()
    }

    /// The pixels whose rays are cast, and the blocks that are filled, from the definition.
    fn defined(&self, contrast: f32) -> (BTreeSet<(usize, usize)>, Vec<[usize; 4]>) {
        let blocks_of = |stride: usize| {
            let rows = Self::lines(stride, self.size.1);
            let columns = Self::lines(stride, self.size.0);
            rows.into_iter().flat_map(move |(y0, y1)| columns.clone().into_iter().map(move |(x0, x1)| [x0, x1, y0, y1]))
        };
        let corners = |[x0, x1, y0, y1]: [usize; 4]| [(x0, y0), (x1, y0), (x0, y1), (x1, y1)];
        let (mut cast, mut filled) = (BTreeSet::new(), Vec::new());
        let mut open: Vec<[usize; 4]> = blocks_of(8).collect();
        cast.extend(open.iter().flat_map(|&block| corners(block)));
        for stride in [8, 4, 2] {
            let has_reason = |block: &[usize; 4]| {
                let at = corners(*block).map(|corner| self.at(corner));
                let differs = (0..4)
                    .any(|c| at.iter().any(|&a| at.iter().any(|&b| self.colors[a][c] - self.colors[b][c] > contrast)));
                let met = at.iter().filter(|&&at| self.met[at]).count();
                let [x0, x1, y0, y1] = *block;
                differs || (1..4).contains(&met) || met == 0 && self.reach(&(x0..x1 + 1), &(y0..y1 + 1))
            };
            let own: Vec<_> = open.iter().copied().filter(has_reason).collect();
            let touches =
                |a: &[usize; 4], b: &[usize; 4]| a[0].abs_diff(b[0]) <= stride && a[2].abs_diff(b[2]) <= stride;
            let (split, whole): (Vec<[usize; 4]>, Vec<[usize; 4]>) =
                open.iter().partition(|block| own.iter().any(|of| touches(of, block)));
            filled.extend(whole);
            let is_inside = |block: &[usize; 4]| {
                split.iter().any(|s| s[0] <= block[0] && block[1] <= s[1] && s[2] <= block[2] && block[3] <= s[3])
            };
            open = blocks_of(stride / 2).filter(is_inside).collect();
            cast.extend(open.iter().flat_map(|&block| corners(block)));
        }
        (cast, filled)
    }
}

fn sizes() -> impl Strategy<Value = (usize, usize)> {
    prop_oneof![(1..70usize, 1..50usize), (1..10usize, 1..10usize), Just((17, 9)), Just((1, 40)), Just((64, 1))]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn rays_and_fillings_are_those_of_the_definition(
        size in sizes(),
        seeds in prop::collection::vec((0.0..1.0f32, 0.0..1.0f32, 0.1..1.2f32), 0..5),
        contrast in prop_oneof![Just(f32::MIN_POSITIVE), 0.001..0.3f32, Just(1.0)],
    ) {
        let exact = Exact::random(size, &seeds);
        let (planes, cast, stats) = exact.sampled(contrast);
        let (expected, filled) = exact.defined(contrast);
        prop_assert_eq!(&cast, &expected);
        prop_assert_eq!(stats.rays_by_level.iter().sum::<u64>(), cast.len() as u64);
        prop_assert_eq!(stats.blocks_filled, filled.len() as u64);
        for pixel in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))) {
            let at = exact.at(pixel);
            let (color, depth) = (planes.color.pixels[at], planes.depth.pixels[at]);
            if cast.contains(&pixel) {
                prop_assert_eq!((color, depth), (exact.colors[at], at as f32));
                continue;
            }
            let (x, y) = pixel;
            let owns = |&&[x0, x1, y0, y1]: &&[usize; 4]| {
                x >= x0 && (x < x1 || x1 + 1 == size.0) && y >= y0 && (y < y1 || y1 + 1 == size.1)
            };
            let owners: Vec<_> = filled.iter().filter(owns).collect();
            prop_assert_eq!(owners.len(), 1, "{:?} has one owner", pixel);
            let [x0, x1, y0, y1] = *owners[0];
            let share = |from: usize, to: usize, at: usize| (at - from) as f64 / (to - from).max(1) as f64;
            let (right, down) = (share(x0, x1, x), share(y0, y1, y));
            for (c, &filled) in color.iter().enumerate() {
                let of = |x, y| f64::from(exact.colors[exact.at((x, y))][c]);
                let above = of(x0, y0) * (1.0 - right) + of(x1, y0) * right;
                let below = of(x0, y1) * (1.0 - right) + of(x1, y1) * right;
                // Three interpolations, each rounded twice in f32.
                prop_assert!((f64::from(filled) - (above * (1.0 - down) + below * down)).abs() < 6.0 * 1.2e-7);
            }
            let nearest = exact.at((if right > 0.5 { x1 } else { x0 }, if down > 0.5 { y1 } else { y0 }));
            prop_assert_eq!(depth, nearest as f32);
        }
    }
}

#[test]
fn each_reason_splits_blocks_and_a_part_of_one_pixel_is_found() {
    let size = (65, 65);
    let mut exact = Exact::random(size, &[]);
    let (_, cast, stats) = exact.sampled(0.1);
    assert_eq!((cast.len(), stats.blocks_split, stats.blocks_filled), (81, [0; 5], 64));
    // One pixel that no coarse ray meets, and its box.
    let part = exact.at((29, 43));
    (exact.colors[part], exact.met[part]) = ([1.0; 4], true);
    exact.boxes.push([29, 30, 43, 44]);
    let (planes, cast, stats) = exact.sampled(0.1);
    assert_eq!(planes.color.pixels, exact.colors);
    assert!(cast.len() < 400 && stats.blocks_split[2] > 0 && stats.blocks_split[3] > 0, "{stats:?}");
    // Without its box the pixel is missed.
    exact.boxes.clear();
    assert!(exact.sampled(0.1).0.color.pixels != exact.colors);
    // A border without contrast, and contrast without a border.
    exact = Exact::random(size, &[(0.5, 0.5, 0.95)]);
    exact.colors.fill([0.0; 4]);
    let borders = exact.sampled(0.1).2;
    assert!(borders.blocks_split[1] > 0 && borders.blocks_split[0] == 0, "{borders:?}");
    exact.met.fill(true);
    exact.colors = (0..65 * 65).map(|at| [if at % 65 > 30 { 1.0 } else { 0.0 }; 4]).collect();
    let contrast = exact.sampled(0.1).2;
    assert!(contrast.blocks_split[0] > 0 && contrast.blocks_split[1] == 0, "{contrast:?}");
}

#[test]
fn a_contrast_is_a_share() {
    let read = |text: &str| text.parse::<Contrast>();
    assert_eq!(read("0.05"), Ok(Contrast::default()));
    assert_eq!([read("0").unwrap().get(), read("1").unwrap().get()], [0.0, 1.0]);
    for bad in ["-0.1", "1.5", "nan", "inf"] {
        assert!(read(bad).unwrap_err().contains("0 to 1"), "{bad}");
    }
    assert_eq!(read("much").unwrap_err(), "'much' is no contrast; give a number from 0 to 1");
}
