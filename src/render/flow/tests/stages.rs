//! The stages that project and list splats on a GPU, each against f64.

use super::gpu::{context, later, scenes, with_flow};
use super::outside::with_gaps;
use super::*;
use crate::render::gpu::layout::{TILE_PX, two_parts};
use crate::render::gpu::splat_lists::stages::Listed;

/// Relative error of a number of f32 after some twenty roundings by 2^-24, of which not all go one way.
const ROUNDED: f64 = 1e-6;

/// Splats in a view as a GPU lists them.
struct Seen {
    name: String,
    view: View,
    flow: Arc<FlowSplats>,
    listed: Listed,
}

impl Seen {
    fn of(name: String, job: &RenderJob, scene: &FlowScene) -> Option<Self> {
        let (view, job) = (job.local_view(), with_flow(job, scene));
        let flow = job.flow?;
        Some(Self { name, listed: Listed::of(&*context(true)?, &flow, &view), view, flow })
    }

    fn all() -> Vec<Self> {
        let (mesh, gaps) = (mesh(4), with_gaps());
        let mut all = Vec::new();
        for (camera, view) in cameras(&mesh).into_iter().zip(["outside", "parallel", "wide", "inside"]) {
            let job = job(&mesh, &camera, (131, 78));
            let of = |(name, scene): (&str, FlowScene)| Self::of(format!("{view}, {name}"), &job, &scene);
            all.extend(scenes(&mesh, &job).into_iter().filter_map(of));
        }
        for (camera, stride) in cameras(&gaps).into_iter().zip([3, 7, 2, 1000]) {
            let usual = job(&gaps, &camera, (131, 78));
            let samples = Samples::Lattice(Lattice::new(stride.try_into().unwrap()));
            let job = RenderJob { view: View { samples, ..usual.view.clone() }, ..usual };
            let scene = scene(&gaps, FlowStyle { size: 0.8, ..FlowStyle::default() }, vortex);
            all.extend(Self::of(format!("every {stride}"), &job, &scene));
        }
        all
    }

    /// The pixel in the middle of a tile.
    fn middle(&self, tile: usize) -> DVec2 {
        let Samples::Lattice(lattice) = &self.view.samples else { panic!("a list of pixels") };
        let columns = self.listed.params.tiles[0] as usize;
        let [x, y] = [(tile % columns, self.view.width_px), (tile / columns, self.view.height_px)]
            .map(|(at, pixels)| lattice.pixel(at * TILE_PX + TILE_PX / 2, pixels) as f64 + 0.5);
        DVec2::new(x, y)
    }

    /// Columns and rows of the pixels of a tile.
    fn pixels(&self, tile: usize) -> [Vec<usize>; 2] {
        let Samples::Lattice(lattice) = &self.view.samples else { panic!("a list of pixels") };
        let (columns, plane) = (self.listed.params.tiles[0] as usize, self.view.plane_px());
        let of = |at: usize, places: usize, pixels: usize| {
            (at * TILE_PX..((at + 1) * TILE_PX).min(places)).map(|at| lattice.pixel(at, pixels)).collect()
        };
        [of(tile % columns, plane.0, self.view.width_px), of(tile / columns, plane.1, self.view.height_px)]
    }

    /// The numbers of the splats of a tile.
    fn numbers(&self, tile: usize) -> Vec<usize> {
        self.listed.places(tile).chunks(2).map(|place| place[1][3] as usize).collect()
    }
}

/// How far what a GPU has written of a splat is from what the CPU has, as a share of the bound.
fn splat_apart(seen: &Seen, number: usize, splat: &Splat) -> f64 {
    let [periods, placed, color, mixed, kernel] = seen.listed.splat(number).try_into().unwrap();
    let scene = seen.flow.scene();
    let close = |found: f32, expected: f64, of: f64| (f64::from(found) - expected).abs() / (ROUNDED * of);
    let exact = |found: &[f32], expected: &[f64]| {
        let is_same = found.iter().zip(expected).all(|(found, expected)| *found == *expected as f32);
        if is_same { 0.0 } else { f64::INFINITY }
    };
    let origin = seen.listed.params.depth_behind_eye();
    let depth = two_parts(splat.depth - origin).map(f64::from);
    let expected = splat.periods_per_pixel();
    let mut apart = vec![
        exact(&placed[..2], &depth),
        exact(
            &color,
            &[splat.color[0], splat.color[1], splat.color[2], if splat.flows { scene.style.opacity } else { 0.0 }],
        ),
        exact(&mixed[1..2], &[splat.mix.share]),
    ];
    if splat.flows {
        let [along, across] = expected;
        let all = [along.x, along.y, across.x, across.y];
        apart.extend((0..4).map(|i| close(periods[i], all[i], splat.frequency[i / 2])));
        apart.push(close(placed[2], splat.width * TEXELS as f64, splat.width * TEXELS as f64));
        // Its slope is 4.5 at most.
        apart.push(close(mixed[0], splat.contrast, 4.5));
        let texels = splat.frequency[1] * TEXELS as f64;
        if (texels.log2() - texels.log2().round()).abs() > ROUNDED {
            apart.push(exact(&mixed[2..3], &[(8 * splat.mix.icon + splat.level as usize) as f64]));
        }
        let whole = |icon: usize| seen.flow.patterns[icon].sums().whole();
        let next = if splat.mix.share > 0.0 { whole(splat.mix.icon + 1) } else { 0.0 };
        let mean = (1.0 - splat.mix.share) * whole(splat.mix.icon) + splat.mix.share * next;
        apart.push(close(mixed[3], (1.0 - splat.contrast) * mean, 4.5));
    }
    if let Some(of_kernel) = &splat.kernel {
        let (color, depth, opacity) = of_kernel.numbers();
        apart.extend([
            exact(&kernel[..3], &color),
            close(kernel[3], depth, 2.0 * depth),
            close(placed[3], opacity, 2.0),
        ]);
    }
    apart.into_iter().fold(0.0, f64::max)
}

#[test]
fn splats_are_projected_as_on_the_cpu() {
    let (mut greatest, mut far) = (0.0, 0);
    for seen in Seen::all() {
        let splats = seen.flow.projected();
        assert_eq!(splats.len(), seen.flow.ready().splats(), "{}", seen.name);
        // What is sent for a frame of the same mesh: 15 words a splat, 5 of a kernel, and what all have in common.
        let of_each = if seen.flow.scene().kernels.is_some() { 80 } else { 60 };
        assert_eq!(seen.listed.bytes_sent, 48 + of_each * splats.len() as u64);
        let far_out = |splat: &&Splat| splat.center.length() > 10.0 * seen.view.width_px as f64;
        far += splats.iter().filter(far_out).count();
        for (number, splat) in splats.iter().enumerate() {
            let apart = splat_apart(&seen, number, splat);
            assert!(apart <= 1.0, "{}, {number}: {apart} of {splat:?}", seen.name);
            greatest = f64::max(greatest, apart);
        }
        // Other numbers are noticed.
        let others = later(seen.flow.scene());
        let wider = FlowStyle { size: 1.0001 * others.style.size, length: Some(0.7), ..others.style };
        let others = FlowScene { style: wider, ..others }.splats(&seen.view);
        let pairs = others.projected().iter().zip(splats).enumerate().filter(|(_, (a, b))| a.site == b.site);
        assert!(pairs.clone().all(|(number, (other, _))| splat_apart(&seen, number, other) > 1.0), "{}", seen.name);
    }
    assert!(far > 0 || context(true).is_none(), "no centre is far outside");
    eprintln!("{greatest:.2} of the bound, {far} far outside");
}

/// The least squared distance, in widths, of a rectangle of places beside a splat's centre.
fn least_squared(splat: &Splat, low: DVec2, high: DVec2) -> f64 {
    let [xx, xy, yy] = splat.form;
    let squared = |x: f64, y: f64| xx * x * x + 2.0 * xy * x * y + yy * y * y;
    if low.x <= 0.0 && low.y <= 0.0 && high.x >= 0.0 && high.y >= 0.0 {
        return 0.0;
    }
    let rows = [low.y, high.y].map(|y| squared((-xy / xx * y).clamp(low.x, high.x), y));
    let columns = [low.x, high.x].map(|x| squared(x, (-xy / yy * x).clamp(low.y, high.y)));
    rows.into_iter().chain(columns).fold(f64::INFINITY, f64::min)
}

/// What is wrong with the numbers of a tile: out of order, missing, or of a splat that does not reach it.
fn faults(seen: &Seen, tile: usize, numbers: &[usize]) -> [usize; 3] {
    let (splats, [columns, rows]) = (seen.flow.projected(), seen.pixels(tile));
    let corner = |at: fn(&[usize]) -> Option<&usize>| {
        DVec2::new(*at(&columns).unwrap() as f64, *at(&rows).unwrap() as f64) + 0.5
    };
    let (low, high) = (corner(<[usize]>::first), corner(<[usize]>::last));
    let has_pixel = |splat: &Splat| {
        let in_view = splat.rows(seen.view.height_px);
        rows.iter().filter(|row| in_view.contains(row)).any(|&row| {
            let of_row = splat.columns(row, seen.view.width_px);
            columns.iter().any(|column| of_row.contains(column))
        })
    };
    let reaches = |splat: &Splat| {
        // Twice the pad of the stage, and of its rounding.
        let pad = 0.125 + (splat.center.abs() + splat.half_height) / 131_072.0;
        least_squared(splat, low - splat.center - pad, high - splat.center + pad) < END * END
    };
    let missing = (0..splats.len()).filter(|number| has_pixel(&splats[*number]) && !numbers.contains(number)).count();
    let more = numbers.iter().filter(|&&number| !reaches(&splats[number])).count();
    [usize::from(!numbers.is_sorted_by(|a, b| a < b)), missing, more]
}

#[test]
fn each_tile_lists_the_splats_that_reach_it_in_their_order() {
    for seen in Seen::all() {
        let mut noticed = [0; 3];
        for tile in 0..seen.listed.tiles() {
            let numbers = seen.numbers(tile);
            assert_eq!(faults(&seen, tile, &numbers), [0; 3], "{}, tile {tile}", seen.name);
            // Two that are exchanged, one that is missing, and one too many are noticed.
            let mut exchanged = numbers.clone();
            exchanged.reverse();
            let all: Vec<usize> = (0..seen.flow.projected().len()).collect();
            for (noticed, (part, other)) in noticed.iter_mut().zip([exchanged, Vec::new(), all].iter().enumerate()) {
                *noticed += usize::from(faults(&seen, tile, other)[part] > 0);
            }
        }
        assert!(noticed[..2].iter().all(|noticed| *noticed > 0), "{}: {noticed:?}", seen.name);
    }
}

/// How far a place in a tile is from that of a splat, as a share of the bound.
fn place_apart(seen: &Seen, place: &[[f32; 4]], splat: &Splat, middle: DVec2) -> f64 {
    let [window, pattern] = place.try_into().unwrap();
    let [window, pattern]: [[f32; 4]; 2] = [window, pattern];
    let ([xx, xy, _], beside) = (splat.form, middle - splat.center);
    let (root, slope, down) = (xx.sqrt(), -xy / xx, END / splat.half_height);
    let apart = |found: f32, expected: f64, of: f64| (f64::from(found) - expected).abs() / (ROUNDED * of);
    // A needle's distance is a difference of ways.
    let ways = root * (beside.x.abs() + (slope * beside.y).abs());
    let mut all = vec![
        apart(window[0], root * (beside.x - slope * beside.y), 1.0 + ways),
        apart(window[1], down * beside.y, 1.0 + down * beside.y.abs()),
        apart(window[2], root, root),
        apart(window[3], -root * slope, root * (1.0 + slope.abs())),
        apart(pattern[0], down, down),
    ];
    if splat.flows && seen.listed.splat(pattern[3] as usize)[2][3] > 0.0 {
        for (found, (per_pixel, phase)) in
            [pattern[1], pattern[2]].into_iter().zip(splat.periods_per_pixel().into_iter().zip(splat.phase))
        {
            let at = per_pixel.dot(beside) + phase - f64::from(found);
            all.push((at - at.round()).abs() / ROUNDED);
        }
    }
    all.into_iter().fold(0.0, f64::max)
}

#[test]
fn places_in_tiles_are_those_of_f64_however_far_the_centre_is() {
    let mut greatest = 0.0;
    for seen in Seen::all() {
        let splats = seen.flow.projected();
        for tile in 0..seen.listed.tiles() {
            let middle = seen.middle(tile);
            for place in seen.listed.places(tile).chunks(2) {
                let splat = &splats[place[1][3] as usize];
                let apart = place_apart(&seen, place, splat, middle);
                assert!(apart <= 1.0, "{}, {tile}: {apart} of {splat:?}", seen.name);
                greatest = f64::max(greatest, apart);
                // A thousandth of a pixel is noticed, if the splat is not larger than the image.
                let moved = place_apart(&seen, place, splat, middle + 1e-3);
                assert!(moved > 1.0 || splat.half_height > 100.0, "{}, {tile}: {moved}", seen.name);
            }
        }
    }
    eprintln!("{greatest:.2} of the bound");
}
