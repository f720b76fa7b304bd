//! Fragments of other layers among the cells: flat quads, of one colour each, that cover rectangles of pixels.

use super::formula::{field, function, job_of};
use super::havs::{havs, with_all_faces, with_buffer, with_some_faces};
use super::joint::{LAYERS, ROWS, SCALARS, noisy, with_joint_table};
use super::*;
use crate::meshes::{build, grid, noise, sample};
use std::ops::Range;
use tetreel::camera::View;
use tetreel::optics::OpticsKind;
use tetreel::render::{Frame, LayerFragment, LayerFragments, RenderError};
use tetreel::transfer::{Lengths, MappedRange, OpacityKind};
use tetreel::visibility::Skip;

/// A quad at a depth.
#[derive(Clone)]
pub(super) struct Quad {
    pub(super) columns: Range<usize>,
    pub(super) rows: Range<usize>,
    pub(super) depth: f64,
    pub(super) rgba: [f32; 4],
}

impl Quad {
    fn covers(&self, column: usize, row: usize) -> bool {
        self.columns.contains(&column) && self.rows.contains(&row)
    }
}

/// The job with quads, each a layer of its own.
pub(super) fn with_quads(job: &RenderJob, quads: &[Quad]) -> RenderJob {
    let (width, height) = (job.view.width_px, job.view.height_px);
    let of_quad = |quad: &Quad| {
        let pixels = quad.rows.clone().flat_map(|row| quad.columns.clone().map(move |column| row * width + column));
        let fragment = LayerFragment { depth: quad.depth, rgba: quad.rgba };
        pixels.map(|pixel| (pixel as u32, fragment)).collect::<Vec<_>>()
    };
    let fragments = LayerFragments::new(width * height, quads.iter().flat_map(of_quad)).unwrap();
    RenderJob { fragments: Some(Arc::new(fragments)), ..job.clone() }
}

/// Something that rays pass through between two depths, with extinction (or a flat thing's opacity) and colour.
struct Layer {
    depth: [f64; 2],
    depth_of_light: f64,
    rgb: [f64; 3],
}

/// What a ray sees of layers that do not overlap, front to back: by closed form, and where it sees something first.
fn composited(layers: &[Layer]) -> ([f64; 4], f64) {
    let (mut rgba, mut through, mut from) = ([0.0; 4], 1.0, f64::INFINITY);
    for layer in layers {
        let opacity = -(-layer.depth_of_light).exp_m1();
        for (sum, c) in rgba.iter_mut().zip(layer.rgb.into_iter().chain([1.0])) {
            *sum += through * opacity * c;
        }
        if opacity > 0.0 {
            from = from.min(layer.depth[0]);
        }
        through *= 1.0 - opacity;
    }
    (rgba, from)
}

/// Constant extinction and colour between two depths.
struct Slab {
    depth: [f64; 2],
    tau: f64,
    rgb: [f64; 3],
}

/// What the ray of a pixel sees of slabs across the view and quads.
fn closed_form(view: &View, slabs: &[Slab], quads: &[Quad], [column, row]: [usize; 2]) -> ([f64; 4], f64) {
    let (px, py) = view.ray(column, row);
    let per_depth = view.length_per_depth(px, py);
    let near = if view.perspective { view.near } else { f64::NEG_INFINITY };
    let mut met: Vec<&Quad> = quads.iter().filter(|q| q.covers(column, row) && q.depth >= near).collect();
    met.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let flat = |quad: &&Quad| {
        let opacity = f64::from(quad.rgba[3]);
        let rgb = std::array::from_fn(|c| f64::from(quad.rgba[c]) / opacity);
        Layer { depth: [quad.depth; 2], depth_of_light: -(-opacity).ln_1p(), rgb }
    };
    let mut layers: Vec<Layer> = met.iter().map(flat).collect();
    for &Slab { depth: [enter, exit], tau, rgb } in slabs {
        let mut ends = vec![enter.max(near)];
        ends.extend(met.iter().map(|quad| quad.depth).filter(|d| (enter.max(near)..exit).contains(d)));
        ends.push(exit);
        for pair in ends.windows(2).filter(|pair| pair[1] > pair[0]) {
            layers.push(Layer {
                depth: [pair[0], pair[1]],
                depth_of_light: tau * (pair[1] - pair[0]) * per_depth,
                rgb,
            });
        }
    }
    // A flat thing lies before the part of a slab that begins at it.
    layers.sort_by(|a, b| a.depth[0].total_cmp(&b.depth[0]).then(a.depth[1].total_cmp(&b.depth[1])));
    composited(&layers)
}

/// Renderers of complete jobs, and of those with some faces only.
fn paths(job: &RenderJob) -> Vec<(&'static str, Frame)> {
    let render = |mut renderer: Box<dyn Renderer>, job: &RenderJob| renderer.render(job.clone()).unwrap().clone();
    let no_skipping = RenderJob { skip: Skip::NONE, ..job.clone() };
    vec![
        ("raycast", render(Box::new(Raycast::new()), job)),
        ("raycast, nothing left out", render(Box::new(Raycast::new()), &no_skipping)),
        ("raycast, portable", render(Box::new(Raycast::portable()), job)),
        ("faces", havs(&with_all_faces(job))),
        ("faces, nothing left out", havs(&with_all_faces(&no_skipping))),
        ("faces, k = 2", havs(&with_buffer(&with_all_faces(job), 2, false))),
        ("outer faces", havs(&with_some_faces(job, 0.0, 1))),
        ("points", points(job)),
        ("reference", render(Box::new(Reference::new()), job)),
    ]
}

/// Slabs of x in [0.25, 1] (scalar 0) and in [-1, -0.25] (scalar 1) of [-1, 1]^3.
pub(super) fn slabs() -> (Arc<Mesh>, Vec<f32>) {
    let mesh = build(grid(8, 0.0, 1, |c| c.x.abs() > 0.25));
    let scalars = sample(&mesh, |p| f64::from(u8::from(p.x < 0.0)));
    (Arc::new(mesh), scalars)
}

const SIZE: usize = 40;
const COLORS: [[f64; 3]; 2] = [[0.9, 0.5, 0.1], [0.2, 0.4, 1.0]];

/// Quads at these depths: half of the image each, a corner of the image only, all of it.
fn quads_at(depths: &[f64]) -> Vec<Quad> {
    let quad = |(i, &depth): (usize, &f64)| {
        let [columns, rows] = match i % 4 {
            0 => [0..SIZE, 0..SIZE / 2],
            1 => [SIZE / 2..SIZE, 0..SIZE],
            2 => [0..SIZE, 0..SIZE],
            _ => [3..9, 0..SIZE],
        };
        let opacity = [0.3f32, 0.5, 0.25, 0.6][i % 4];
        Quad { columns, rows, depth, rgba: [0.8 * opacity, 0.1 * opacity, opacity, opacity] }
    };
    depths.iter().enumerate().map(quad).collect()
}

/// Compares all paths with the closed form; returns the number of pixels that saw a quad and of those that saw cells.
fn check(name: &str, eye_x: f64, projection: Projection, near: f64, taus: [f64; 2], quads: &[Quad]) -> [usize; 2] {
    let (mesh, scalars) = slabs();
    let position = DVec3::new(eye_x, 0.013, -0.021);
    let camera = Camera { position, focal_point: position - DVec3::X, view_up: DVec3::Z, projection, near };
    let [front, back] = taus;
    let nodes = [(0.0, COLORS[0], front), (0.5, COLORS[0], front), (0.5, COLORS[1], back), (1.0, COLORS[1], back)];
    let job = with_quads(&job(&mesh, scalars, &camera, (SIZE, SIZE), table(&nodes)), quads);
    let world = |x: [f64; 2]| x.map(|x| (eye_x - x).max(if job.view.perspective { 0.0 } else { f64::NEG_INFINITY }));
    let slabs = [
        Slab { depth: world([1.0, 0.25]), tau: front, rgb: COLORS[0] },
        Slab { depth: world([-0.25, -1.0]), tau: back, rgb: COLORS[1] },
    ];
    let (mut of_quads, mut of_cells) = (0, 0);
    for (path, frame) in paths(&job) {
        for (i, (found, depth)) in frame.planes.color.pixels.iter().zip(&frame.planes.depth.pixels).enumerate() {
            let [column, row] = [i % SIZE, i / SIZE];
            let (px, py) = job.view.ray(column, row);
            let off = job.view.right * px + job.view.up * py + DVec3::new(0.0, 0.013, -0.021);
            let hits = job.view.perspective || off.y.abs().max(off.z.abs()) < 1.0;
            let (expected, from) = closed_form(&job.view, if hits { &slabs } else { &[] }, quads, [column, row]);
            of_quads += usize::from(quads.iter().any(|quad| quad.covers(column, row)));
            of_cells += usize::from(hits);
            for (a, b) in found.iter().zip(expected) {
                // Sums and products of f32, some 2^-24 each: a ray has up to 14 pieces. What ends at 2^-17 lacks that.
                let error = (f64::from(*a) - b).abs();
                assert!(error < 2e-6 + 7.7e-6 * b, "{name}, {path}, pixel {i}: {found:?}, not {expected:?}");
            }
            let is_same_depth = f64::from(*depth) == from || (f64::from(*depth) - from).abs() < 1e-6 * from.abs();
            assert!(is_same_depth, "{name}, {path}, pixel {i}: seen from {depth}, not {from}");
        }
    }
    [of_quads, of_cells]
}

const PARALLEL: Projection = Projection::Parallel { scale: 1.3 };
const NARROW: Projection = Projection::Perspective { view_angle: 20.0 };
const WIDE: Projection = Projection::Perspective { view_angle: 50.0 };

#[test]
fn quads_lie_before_in_between_and_behind_cells_and_where_there_are_none() {
    // Slabs are at depths 3 to 3.75 and 4.25 to 5 of an eye at x = 4.
    let everywhere = [1.0, 2.0, 3.2, 3.3, 3.3, 3.61, 4.0, 4.1, 4.4, 4.9, 6.0, 7.0];
    for projection in [PARALLEL, NARROW] {
        for taus in [[0.7, 1.3], [0.0, 1.3], [0.7, 0.0]] {
            let [quads, cells] = check("everywhere", 4.0, projection, 0.0, taus, &quads_at(&everywhere));
            assert!(quads == 9 * SIZE * SIZE && cells > quads / 2, "{quads} {cells}");
            for (name, depth) in [("before", 2.5), ("in the first", 3.4), ("in the gap", 4.0), ("behind", 9.0)] {
                // A corner of the image: most tiles and pixels have none.
                let corner = Quad { columns: 4..13, rows: 7..30, depth, rgba: [0.1, 0.2, 0.3, 0.4] };
                check(name, 4.0, projection, 0.0, taus, &[corner]);
            }
        }
        // Nothing in the cells is to be seen.
        check("transparent cells", 4.0, projection, 0.0, [0.0, 0.0], &quads_at(&everywhere));
    }
    // The cells are small in the middle of the image, quads cover tiles that no cell meets.
    let [_, cells] = check("far", 4.0, Projection::Parallel { scale: 8.0 }, 0.0, [0.7, 1.3], &quads_at(&everywhere));
    assert!((1..SIZE * SIZE).contains(&cells), "{cells}");
    check("behind the eye of a parallel projection", -3.0, PARALLEL, 0.0, [0.7, 1.3], &quads_at(&[-5.0, -3.8, 1.0]));
}

#[test]
fn quads_at_the_faces_of_cells_and_at_one_depth_lie_in_the_order_of_their_layers() {
    for projection in [PARALLEL, NARROW] {
        check("at faces", 4.0, projection, 0.0, [0.7, 1.3], &quads_at(&[3.0, 3.25, 3.75, 3.75, 4.25, 5.0, 5.0]));
    }
    let [a, b] = [[0.5f32, 0.0, 0.0, 0.5], [0.0, 0.5, 0.0, 0.5]];
    let quad = |rgba| Quad { columns: 0..SIZE, rows: 0..SIZE, depth: 3.5, rgba };
    check("a before b", 4.0, PARALLEL, 0.0, [0.7, 1.3], &[quad(a), quad(b)]);
    check("b before a", 4.0, PARALLEL, 0.0, [0.7, 1.3], &[quad(b), quad(a)]);
}

#[test]
fn what_is_before_the_near_plane_or_behind_something_opaque_is_not_seen() {
    // The eye is in the first slab, 0.35 before its end.
    for near in [0.0, 0.1] {
        check("eye in a slab", 0.6, WIDE, near, [0.7, 1.3], &quads_at(&[0.02, 0.05, 0.2, 0.3, 0.6, 1.1]));
    }
    check("near plane in a slab", 4.0, NARROW, 3.4, [0.7, 1.3], &quads_at(&[3.1, 3.3, 3.5, 3.6, 4.0]));
    check("opaque cells", 4.0, PARALLEL, 0.0, [300.0, 1.3], &quads_at(&[2.0, 3.01, 3.5, 4.0, 9.0]));
    let wall = Quad { columns: 5..30, rows: 0..33, depth: 3.4, rgba: [0.2, 0.6, 0.1, 1.0] };
    for depth in [2.0, 3.4, 4.0, 9.0] {
        let mut quads = quads_at(&[3.1, 3.2, 4.3, 4.4, 7.0, 8.0]);
        quads.push(Quad { depth, ..wall.clone() });
        check("an opaque quad", 4.0, PARALLEL, 0.0, [0.7, 1.3], &quads);
    }
}

/// Quads by lot within the depths of a scene.
pub(super) fn random_quads(view: &View, depths: [f64; 2], seed: u64) -> Vec<Quad> {
    let of = |i: u64| 0.5 + 0.5 * noise(seed, i);
    let range = |i: u64, size: usize| {
        let at = (of(i) * size as f64) as usize;
        at..(at + 1 + (of(i + 1) * size as f64) as usize).min(size)
    };
    let quad = |i: u64| {
        let opacity = of(i) as f32;
        let rgba = [of(i + 1) as f32 * opacity, of(i + 2) as f32 * opacity, of(i + 3) as f32 * opacity, opacity];
        let depth = depths[0] + of(i + 4) * (depths[1] - depths[0]);
        Quad { columns: range(i + 5, view.width_px), rows: range(i + 7, view.height_px), depth, rgba }
    };
    (0..12).map(|i| quad(10 * i)).collect()
}

#[test]
fn fast_paths_agree_with_the_judge_on_quads_in_any_field() {
    let projections = [Projection::Parallel { scale: 1.6 }, Projection::Perspective { view_angle: 35.0 }];
    for (seed, projection) in projections.into_iter().enumerate() {
        let (mesh, scalars) = field(5);
        let camera = camera(DVec3::new(3.0, 2.0, 2.5), projection);
        let range = MappedRange::new(0.0, 1.0, false).unwrap();
        let source = function("viridis@0:0,0.4:0.2,0.7:0,1:0.3", range, OpacityKind::Alpha, Lengths::of_diagonal(3.5));
        let by_formula = job_of(&mesh, scalars, &camera, (48, 40), source);
        let plain = super::joint::scene(5, projection);
        let vertex = sample(&plain.mesh, |p| 0.3 * p.x + 0.5 * p.y);
        let cell = (0..plain.mesh.topology.tets.len() as u64).map(|i| noise(7, i) as f32).collect();
        let joint = with_joint_table(&plain, noisy(&SCALARS, &ROWS, &LAYERS, 3), Some(vertex), Some(cell));
        for (name, job) in [("formula", &by_formula), ("table", &plain), ("joint", &joint)] {
            let quads = random_quads(&job.view, [2.5, 6.5], 3 + seed as u64);
            let job = with_quads(job, &quads);
            let judge = reference(&job);
            for (path, frame) in [("raycast", raycast(&job)), ("faces", havs(&with_all_faces(&job)).planes.color)] {
                assert_within(&format!("{name}, {path}"), &frame, &judge);
            }
            // What is not in its place is noticed, by a hundredth of the depth of the scene.
            let moved: Vec<Quad> = quads.iter().map(|q| Quad { depth: q.depth + 0.04, ..q.clone() }).collect();
            assert_noticed(name, &raycast(&with_quads(&job, &moved)), &judge);
            for optics in [OpticsKind::Partial, OpticsKind::Table3d] {
                // Colours of the one and tables of the other are approximations, with their own bounds elsewhere; a quad that is cut
                // wrongly is off by a whole segment.
                let job = RenderJob { optics, ..job.clone() };
                let (rmse, _) = difference(&raycast(&job), &judge);
                assert!(rmse < 1e-3, "{name}, {optics}: {rmse:.1e}");
            }
        }
    }
}

/// The job with up to `most` fragments on each ray, more on the right, some of which are clear or opaque.
fn crowded(job: &RenderJob, depths: [f64; 2], most: usize) -> RenderJob {
    let (width, height) = (job.view.width_px, job.view.height_px);
    let of = |seed: u64, i: usize| 0.5 + 0.5 * noise(seed, i as u64);
    let on_ray = |pixel: usize| {
        let count = (of(1, pixel) * (most * (pixel % width)) as f64 / width as f64) as usize;
        (0..count).map(move |i| {
            let at = 97 * pixel + i;
            let opacity = [0.0, 1.0, 0.05 * of(2, at)][(at % 29).min(2)] as f32;
            let rgba = [of(3, at) as f32 * opacity, 0.5 * opacity, of(4, at) as f32 * opacity, opacity];
            (pixel as u32, LayerFragment { depth: depths[0] + of(5, at) * (depths[1] - depths[0]), rgba })
        })
    };
    let fragments = LayerFragments::new(width * height, (0..width * height).flat_map(on_ray)).unwrap();
    RenderJob { fragments: Some(Arc::new(fragments)), ..job.clone() }
}

#[test]
fn rays_side_by_side_are_cut_as_one_after_the_other_to_the_bit() {
    let (mesh, scalars) = field(6);
    let step = table(&[(0.0, COLORS[0], 0.1), (0.5, COLORS[0], 0.4), (0.5, COLORS[1], 40.0), (1.0, COLORS[1], 90.0)]);
    let clear = table(&[(0.0, COLORS[0], 0.0), (1.0, COLORS[1], 0.0)]);
    let outside = camera(DVec3::new(3.0, 2.0, 2.5), NARROW);
    let inside = Camera { near: 0.13, ..camera(DVec3::new(0.3, 0.2, 0.25), WIDE) };
    let parallel = camera(DVec3::new(3.0, 2.0, 2.5), Projection::Parallel { scale: 1.6 });
    let mut stopped = 0;
    for (camera, depths) in [(outside, [2.0, 6.5]), (inside, [0.0, 1.5]), (parallel, [-1.0, 6.5])] {
        for table in [dense(), step.clone(), clear.clone()] {
            let job = job(&mesh, scalars.clone(), &camera, (50, 40), table);
            // More than there are rows for, and few.
            for most in [150, 6] {
                let job = crowded(&job, depths, most);
                for skip in [job.skip, Skip::NONE] {
                    let job = RenderJob { skip, ..job.clone() };
                    let [found, expected] = [Raycast::new(), Raycast::portable()]
                        .map(|mut renderer| renderer.render(job.clone()).unwrap().clone());
                    assert!(found.planes == expected.planes, "{most} fragments");
                    let counts = |frame: &Frame| {
                        let stats = &frame.stats;
                        [stats.steps, stats.segments, stats.rays_hit, stats.rays_stopped_early, stats.out_of_order]
                    };
                    assert_eq!(counts(&found), counts(&expected), "{most} fragments");
                    stopped += found.stats.rays_stopped_early;
                }
            }
        }
    }
    assert!(stopped > 1000, "{stopped}");
}

#[test]
fn lists_without_a_fragment_change_no_bit() {
    let (mesh, scalars) = field(5);
    let camera = camera(DVec3::new(3.0, 2.0, 2.5), NARROW);
    let job = job(&mesh, scalars, &camera, (48, 40), dense());
    let empty = with_quads(&job, &[]);
    assert_eq!(raycast(&empty), raycast(&job));
    assert_eq!(havs(&with_all_faces(&empty)).planes, havs(&with_all_faces(&job)).planes);
    assert_eq!(reference(&empty), reference(&job));
}

#[test]
fn fragments_at_fault_are_named() {
    let fragment = |depth, rgba| LayerFragments::new(4, [(3, LayerFragment { depth, rgba })]);
    assert!(fragment(-1.0, [0.0, 2.0, 0.0, 1.0]).is_ok());
    for bad in [
        fragment(f64::NAN, [0.0; 4]),
        fragment(f64::INFINITY, [0.0; 4]),
        fragment(1.0, [0.0, 0.0, 0.0, 1.1]),
        fragment(1.0, [-0.1, 0.0, 0.0, 0.5]),
        fragment(1.0, [f32::NAN, 0.0, 0.0, 0.5]),
        fragment(1.0, [f32::INFINITY, 0.0, 0.0, 0.5]),
    ] {
        assert!(bad.unwrap_err().to_string().contains("a fragment of pixel 3 at depth"));
    }
    let beyond = LayerFragments::new(4, [(4, LayerFragment { depth: 1.0, rgba: [0.0; 4] })]);
    assert!(matches!(beyond, Err(RenderError::BadLayerFragment { pixel: 4, .. })));
    let (mesh, scalars) = slabs();
    let camera = camera(DVec3::new(3.0, 2.0, 2.5), NARROW);
    let job = job(&mesh, scalars, &camera, (9, 7), dense());
    let fragments = Some(Arc::new(LayerFragments::new(4, []).unwrap()));
    let error = Raycast::new().begin(RenderJob { fragments, ..job }).unwrap_err();
    assert_eq!(error.to_string(), "fragments of other layers for 4 pixels in an image of 63");
}
