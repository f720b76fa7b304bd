//! Points without cells: import, store, pictures and what is refused.

use crate::series::table_for;
use glam::DVec3;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use tetreel::camera::{Camera, Projection};
use tetreel::codec::vq::VqOptions;
use tetreel::error::FileResult;
use tetreel::export::StoredSeries;
use tetreel::field::{Association, Component, FieldInfo, SeriesSource, TimeAxis};
use tetreel::ingest::{AppendOptions, CodecChoice, IngestError, IngestOptions, append, ingest};
use tetreel::mesh::{Cells, RawMesh};
use tetreel::node_table::{Node, NodeTable};
use tetreel::pipeline::{FrameRequest, Pipeline, TetDraw, TetLayer};
use tetreel::random::SplitMix64;
use tetreel::render::points::{Compositing, Footprint, PointStyle};
use tetreel::render::{Frame, Planes};
use tetreel::store::{Store, StoredKind};
use tetreel::task::{Cancel, Silent};

/// Balls with a scalar each, which grows from step to step.
struct Balls {
    points: Vec<DVec3>,
    radii: Vec<f64>,
    volumes: Vec<f64>,
    times: TimeAxis,
    fields: [FieldInfo; 1],
}

impl Balls {
    fn of(balls: &[([f64; 3], f64)], steps: usize) -> Self {
        Self {
            points: balls.iter().map(|(p, _)| DVec3::from_array(*p)).collect(),
            radii: balls.iter().map(|(_, radius)| *radius).collect(),
            volumes: Vec::new(),
            times: TimeAxis { values: (0..steps).map(|step| step as f64).collect() },
            fields: [FieldInfo { name: "s".to_owned(), components: 1, association: Association::Point }],
        }
    }

    /// Balls along a spiral.
    fn spiral(count: usize) -> Self {
        let ball = |i: usize| {
            let t = 0.37 * i as f64;
            ([t.cos() * t.sqrt(), t.sin() * t.sqrt(), 0.05 * t], 0.1 + 0.05 * (1.7 * t).sin())
        };
        Self::of(&(0..count).map(ball).collect::<Vec<_>>(), 3)
    }

    fn import(&self, out: &Path, options: &IngestOptions) -> Store {
        ingest(self, out, options, &Silent, &Cancel::new()).unwrap();
        Store::open(out).unwrap()
    }
}

impl SeriesSource for Balls {
    fn describe(&self) -> String {
        "balls".to_owned()
    }

    fn times(&self) -> &TimeAxis {
        &self.times
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        let points = (0..self.points.len() as u32).collect();
        let (radii, volumes) = (self.radii.clone(), self.volumes.clone());
        let cells = Cells { points, radii, volumes, ..Cells::default() };
        Ok(RawMesh { points: self.points.clone(), cells })
    }

    fn read(&self, _: &FieldInfo, _: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        out.clear();
        out.extend((0..self.points.len()).map(|i| ((i * i) as f32).sin() + step as f32));
        Ok(())
    }
}

const SIZE: usize = 65;

/// A view along z in parallel projection, 4 units wide.
fn along_z() -> Camera {
    let camera = Camera::default_for((DVec3::splat(-2.0), DVec3::splat(2.0))).unwrap();
    Camera {
        position: DVec3::Z * 10.0,
        focal_point: DVec3::ZERO,
        view_up: DVec3::Y,
        projection: Projection::Parallel { scale: 2.0 },
        ..camera
    }
}

/// The optical depth of each pixel of a frame.
fn depths(planes: &Planes) -> Vec<f64> {
    planes.color.pixels.iter().map(|pixel| -(-f64::from(pixel[3])).ln_1p()).collect()
}

fn with(style: PointStyle, request: &FrameRequest) -> FrameRequest {
    request.clone().with_draw(TetDraw::Points(style))
}

#[test]
fn a_ball_has_the_depth_of_its_chord_and_balls_add_up() {
    let temp = tempfile::tempdir().unwrap();
    let balls = Balls::of(&[([-1.0, 0.0, 0.0], 0.8), ([1.0, 0.0, 0.0], 0.4), ([1.0, 0.0, 0.3], 0.3)], 1);
    let store = balls.import(&temp.path().join("b.zarr"), &IngestOptions::default());
    let mut pipeline = Pipeline::open(&store, None).unwrap();
    const TAU: f64 = 0.7;
    let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0; 3], tau: TAU }]).unwrap();
    let request = FrameRequest::new(0, along_z(), Arc::new(table), (SIZE, SIZE));
    let found = depths(&pipeline.render(&request).unwrap().planes);
    let pixel = 4.0 / SIZE as f64;
    for row in 0..SIZE {
        for column in 0..SIZE {
            let at = |i: usize| (i as f64 + 0.5) * pixel - 2.0;
            let (x, y) = (at(column), -at(row));
            let chord = |(p, r): (&DVec3, &f64)| 2.0 * (r * r - (x - p.x).powi(2) - (y - p.y).powi(2)).max(0.0).sqrt();
            let expected: f64 = TAU * balls.points.iter().zip(&balls.radii).map(chord).sum::<f64>();
            // A f32 opacity rounds by 2^-25 of one, which the depth has times e^depth; positions and radii round by 2^-25 of the box, which
            // near a border the chord has as its square root.
            let bound = 2f64.powi(-24) * expected.exp() + TAU * 3.0 * (4.0 * 0.8 * 2f64.powi(-23)).sqrt();
            assert!((found[SIZE * row + column] - expected).abs() <= bound, "{row} {column}");
        }
    }
    let at_middle = found[SIZE * (SIZE / 2) + SIZE / 4];
    assert!(at_middle > 1.0, "the test sees something");
    let job = pipeline.prepare(&request).unwrap();
    let probed = |at: (f64, f64)| tetreel::render::probe::probe(&job, at).unwrap();
    let of = |x: f64, y: f64| ((x + 2.0) / pixel, (2.0 - y) / pixel);
    let near = probed(of(1.0, 0.05)).unwrap();
    assert_eq!(near.source_cell, 2, "the nearer of two");
    assert!(near.position.distance(balls.points[2]) < 1e-6 && (near.depth - (10.0 - 0.3)).abs() < 1e-6);
    assert_eq!(probed(of(1.0, 0.35)).unwrap().source_cell, 1);
    assert!(probed(of(0.0, 1.5)).is_none());
    // The other shapes: an ellipse is the ball, a square has its volume.
    let circle = pipeline.render(&with(PointStyle::BALLS, &request)).unwrap().planes.clone();
    assert!(depths(&circle) == found, "auto");
    let ellipse = PointStyle { footprint: Footprint::Ellipse, ..PointStyle::BALLS };
    assert!(pipeline.render(&with(ellipse, &request)).unwrap().planes == circle);
    let square = PointStyle { footprint: Footprint::Square, ..PointStyle::BALLS };
    let square = depths(&pipeline.render(&with(square, &request)).unwrap().planes);
    let sum = |depths: &[f64]| depths.iter().sum::<f64>();
    assert!((sum(&square) / sum(&found) - 1.0).abs() < 0.05 && square != found);
}

/// Balls by chance in a cube, half of the image wide, against sums of all their chords in f64 on a hundred pixels; says how long the
/// import and the frame took.
fn assert_many_add_up(count: usize, size: usize, radius: f64) {
    // Depths are around 0.5.
    let tau = 0.5 * 4.0 / (count as f64 * 4.0 / 3.0 * PI * radius.powi(3));
    let mut random = SplitMix64::new(11);
    let mut place = || [0; 3].map(|_| random.between(-1.0, 1.0));
    let balls: Vec<_> = (0..count).map(|_| (place(), radius)).collect();
    let temp = tempfile::tempdir().unwrap();
    let started = Instant::now();
    let store = Balls::of(&balls, 1).import(&temp.path().join("m.zarr"), &IngestOptions::default());
    let imported = started.elapsed();
    let mut pipeline = Pipeline::open(&store, None).unwrap();
    let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0; 3], tau }]).unwrap();
    let request = FrameRequest::new(0, along_z(), Arc::new(table), (size, size));
    let started = Instant::now();
    let Frame { planes, stats, .. } = pipeline.render(&request).unwrap();
    println!("{count} points: import {imported:?}, first frame of {size} x {size} {:?}", started.elapsed());
    assert_eq!([stats.points_drawn, stats.points_total, stats.points_culled], [count as u64, count as u64, 0]);
    let (found, pixel) = (depths(planes), 4.0 / size as f64);
    assert!(radius > pixel, "none is widened");
    for at in
        (0..100).map(|i| i * 997 + 17).map(|i| (size / 4 + i % (size / 2)) * size + size / 4 + i * 31 % (size / 2))
    {
        let at_pixel = |i: usize| (i as f64 + 0.5) * pixel - 2.0;
        let (x, y) = (at_pixel(at % size), -at_pixel(at / size));
        // Places and radii are off by 2^-24 of the box's 4 units, and so r^2 - d^2 by this at most.
        let wrong = 4.0 * radius * 4.0 * 2f64.powi(-24);
        let (mut depth, mut off, mut hit) = (0.0, 0.0, 0);
        for &([px, py, _], _) in &balls {
            let inside = radius * radius - (x - px).powi(2) - (y - py).powi(2);
            if inside > -wrong {
                depth += tau * 2.0 * inside.max(0.0).sqrt();
                off += tau * 2.0 * if inside > wrong { wrong / inside.sqrt() } else { (2.0 * wrong).sqrt() };
                hit += 1;
            }
        }
        // Opacities add up in f32, each with four roundings at most; of what an opacity is off the depth has e^depth times.
        let bound = off + (4.0 * f64::from(hit) + 1.0) * 2f64.powi(-24) * depth.exp();
        assert!((found[at] - depth).abs() <= bound, "{at}: {} for {depth}, {hit} balls, {bound:.1e}", found[at]);
        assert!(depth > 0.1 && bound < tau * radius, "{bound:.1e}: half a ball's depth would be noticed");
    }
}

#[test]
fn a_hundred_thousand_points_add_up() {
    assert_many_add_up(100_000, 64, 1.0 / 14.0);
}

#[test]
#[ignore = "takes gigabytes: .ci/run runs it by itself where they are free"]
fn ten_million_points_add_up() {
    // Small balls: a ray meets some 140 of them, so that one left out would be noticed.
    assert_many_add_up(10_000_000, 1024, 1.0 / 240.0);
}

#[test]
fn a_ball_that_covers_the_image_is_in_every_pixel() {
    let temp = tempfile::tempdir().unwrap();
    const RADIUS: f64 = 100.0;
    const TAU: f64 = 0.005;
    let store = Balls::of(&[([0.0; 3], RADIUS)], 1).import(&temp.path().join("b.zarr"), &IngestOptions::default());
    let mut pipeline = Pipeline::open(&store, None).unwrap();
    let table = Arc::new(NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0; 3], tau: TAU }]).unwrap());
    let mut drawn = |z: f64, style: PointStyle| {
        let projection = Projection::Perspective { view_angle: 10.0 };
        let camera = Camera { position: DVec3::Z * z, focal_point: -DVec3::Z, projection, ..along_z() };
        let request = FrameRequest::new(0, camera, table.clone(), (SIZE, SIZE));
        let frame = pipeline.render(&with(style, &request)).unwrap();
        assert!(frame.planes.color.pixels.iter().flatten().all(|value| value.is_finite()));
        (depths(&frame.planes), frame.stats.fragments)
    };
    let all = (SIZE * SIZE) as u64;
    let (found, fragments) = drawn(150.0, PointStyle::BALLS);
    assert_eq!(fragments, all);
    for (i, depth) in found.iter().enumerate() {
        // The distance of a ray from the middle, by its tangent.
        let at = |i: usize| ((i as f64 + 0.5) / SIZE as f64 - 0.5) * 2.0 * 5f64.to_radians().tan();
        let square = at(i % SIZE).powi(2) + at(i / SIZE).powi(2);
        let chord = 2.0 * (RADIUS * RADIUS - 150.0 * 150.0 * square / (1.0 + square)).sqrt();
        assert!((depth - TAU * chord).abs() <= 8.0 * 2f64.powi(-24) * (TAU * chord).exp(), "{i}: {depth}");
    }
    assert_eq!(drawn(150.0, PointStyle { footprint: Footprint::Square, ..PointStyle::BALLS }).1, all);
    // The eye in it, beside its middle.
    assert_eq!(drawn(50.0, PointStyle::BALLS).1, all);
}

#[test]
fn a_point_is_as_thick_as_its_volume_makes_it() {
    let temp = tempfile::tempdir().unwrap();
    let all = [([-1.0, 0.0, 0.0], 0.8), ([1.0, 0.0, 0.0], 0.4), ([1.0, 0.0, 0.3], 0.3)];
    // In front of the second lies the third, which hides most of it.
    let filled = [0.25, 3.0, 0.5];
    let drawn = |balls: &Balls, name: &str, style: PointStyle| {
        let store = balls.import(&temp.path().join(name), &IngestOptions { overwrite: true, ..Default::default() });
        let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0; 3], tau: 0.7 }]).unwrap();
        let request = FrameRequest::new(0, along_z(), Arc::new(table), (SIZE, SIZE));
        let found = depths(&Pipeline::open(&store, None).unwrap().render(&with(style, &request)).unwrap().planes);
        (found, store.info().unwrap())
    };
    for footprint in [Footprint::Circle, Footprint::Ellipse, Footprint::Square] {
        let style = PointStyle { footprint, ..PointStyle::BALLS };
        let mut filled_ones = Balls::of(&all, 1);
        filled_ones.volumes =
            filled.iter().zip(all).map(|(part, (_, radius))| part * tetreel::mesh::ball_volume(radius)).collect();
        let (found, info) = drawn(&filled_ones, "v.zarr", style);
        assert!(info.version.store == "2.1" && info.to_string().contains("radius 0.3 to 0.8, volume 0.05"), "{info}");
        let mut expected = vec![0.0; SIZE * SIZE];
        for (part, ball) in filled.iter().zip(all) {
            let (alone, info) = drawn(&Balls::of(&[ball], 1), "b.zarr", style);
            assert_eq!(info.version.store, "2.0");
            expected.iter_mut().zip(&alone).for_each(|(sum, depth)| *sum += part * depth);
        }
        // A f32 opacity rounds by 2^-25 of one, which a depth has times e^depth; here in the picture and in those it is compared with.
        // Frames differ, so positions and radii round otherwise: 2^-24 of the box, which near a border the chord has as its square root.
        let near_border = 0.7 * 4.0 * (4.0 * 0.8 * 2f64.powi(-23)).sqrt();
        let bound = |depth: f64| 5.0 * 2f64.powi(-24) * depth.exp() + near_border;
        let wrong = (0..SIZE * SIZE).filter(|&at| (found[at] - expected[at]).abs() > bound(expected[at]));
        // A square begins and ends with whole pixels: none of its borders is at a pixel's middle here.
        assert_eq!(wrong.count(), 0, "{footprint:?}");
        let (as_balls, _) = drawn(&Balls::of(&all, 1), "b.zarr", style);
        assert!((0..SIZE * SIZE).any(|at| (as_balls[at] - expected[at]).abs() > 0.1), "the test can fail");
    }
}

#[test]
fn a_store_of_points_says_so_and_gives_everything_back() {
    let temp = tempfile::tempdir().unwrap();
    let balls = Balls::spiral(500);
    let out = temp.path().join("c.zarr");
    let store = balls.import(&out, &IngestOptions { steps: "0..1".parse().unwrap(), ..Default::default() });
    let info = store.info().unwrap();
    assert_eq!((info.mesh.kind, info.mesh.vertices, info.mesh.cells), (StoredKind::Points, 500, 500));
    assert_eq!(info.version.store, "2.0");
    assert!(info.to_string().starts_with("cloud    500 points, radius 0.05"), "{info}");
    assert!(!out.join("mesh/0/tets").exists() && !out.join("mesh/0/neighbours").exists());
    let root = std::fs::read_to_string(out.join("zarr.json")).unwrap();
    assert!(root.contains("\"kind\": \"points\""), "{root}");

    let stored = StoredSeries::new(&store, &[]).unwrap();
    let raw = stored.mesh().unwrap();
    assert_eq!((&raw.points, &raw.cells.points), (&balls.points, &balls.mesh().unwrap().cells.points));
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    stored.read(&stored.fields()[0], Component::Index(0), 1, &mut ours).unwrap();
    balls.read(&balls.fields[0], Component::Index(0), 1, &mut theirs).unwrap();
    assert_eq!(ours, theirs);
    // Steps are added; another cloud is not.
    append(&balls, &out, &AppendOptions::default(), &Silent, &Cancel::new()).unwrap();
    let grown = Store::open(&out).unwrap();
    assert_eq!((grown.times().len(), grown.info().unwrap().version.store.as_str()), (3, "2.0"));
    let mut moved = Balls::spiral(500);
    moved.points[3].x += 0.5;
    moved.times.values.push(3.0);
    assert!(append(&moved, &out, &AppendOptions::default(), &Silent, &Cancel::new()).is_err());

    let small = temp.path().join("v.zarr");
    let codec = CodecChoice::new(VqOptions::default());
    let store = balls.import(&small, &IngestOptions { codec, ..Default::default() });
    let field = store.field(&"s".parse().unwrap()).unwrap();
    let mut values = vec![0.0; field.value_count()];
    field.decode_step(2, &mut values).unwrap();
    assert!(field.info().quality.is_some() && values.iter().all(|value| (1.0..=3.0).contains(value)));
}

#[test]
fn what_needs_cells_says_that_it_does() {
    let temp = tempfile::tempdir().unwrap();
    let store = Balls::spiral(300).import(&temp.path().join("c.zarr"), &IngestOptions::default());
    let mut pipeline = Pipeline::open(&store, None).unwrap();
    let camera = Camera::default_for(pipeline.mesh().frame()).unwrap();
    let table = table_for(&pipeline, "inferno@0:0.1,1:0.5");
    let request = FrameRequest::new(1, camera, table, (48, 48));
    let with_layer = |change: &dyn Fn(&mut TetLayer)| request.clone().with_tets(change);
    let iso = || "0.5".parse::<tetreel::render::surfaces::IsosurfaceText>().unwrap().surface;
    let section = || "point=0,0,0 normal=0,0,1".parse::<tetreel::render::surfaces::CutText>().unwrap().cut;
    for (request, what) in [
        (request.clone().with_draw(TetDraw::Raycast), "rays"),
        (request.clone().with_draw(TetDraw::ALL_FACES), "faces"),
        (request.clone().with_draw(TetDraw::Reference), "reference"),
        (request.clone().with_draw(TetDraw::Points(PointStyle::EXACT)), "exact footprints"),
        (with_layer(&|tets| tets.surfaces = vec![iso()]), "isosurfaces"),
        (with_layer(&|tets| tets.cuts = vec![section()]), "sections"),
        (with_layer(&|tets| tets.parts = vec![0]), "parts"),
        (with_layer(&|tets| tets.shading.volume = true), "gradients"),
    ] {
        let refused = pipeline.render(&request).unwrap_err().to_string();
        assert!(refused.contains(what) && refused.contains("need cells"), "{refused}");
    }
    // Levels of detail, gaps and holes are drawn.
    let all = pipeline.render(&request).unwrap();
    assert_eq!((all.stats.points_drawn, all.stats.points_total), (300, 300));
    let half = PointStyle { lod: 0.5, ..PointStyle::BALLS };
    assert_eq!(pipeline.render(&with(half, &request)).unwrap().stats.points_drawn, 75);
    let gap = PointStyle { compositing: Compositing::Gap, ..PointStyle::BALLS };
    let frame = pipeline.render(&with(gap, &request)).unwrap();
    assert!(frame.planes.color.pixels.iter().any(|pixel| pixel[3] > 0.0));
    assert!(frame.planes.color.pixels.iter().flatten().all(|value| value.is_finite()));
}

#[test]
fn extreme_clouds_are_drawn_without_nan_and_bad_ones_refused() {
    let temp = tempfile::tempdir().unwrap();
    let out = temp.path().join("e.zarr");
    let options = IngestOptions { overwrite: true, ..Default::default() };
    let one = |radius| vec![([1.0, 2.0, 3.0], radius)];
    let same: Vec<_> = (0..2000).map(|_| ([5.0, 5.0, 5.0], 0.25)).collect();
    let sizes = [1e-38, 1e-20, 1.0, 1e20, 1e38];
    let of_all_sizes = sizes.map(|size| ([size, 0.0, -size], size)).to_vec();
    let alone = sizes.map(|size| vec![([size, 0.0, -size], size)]);
    let others = [one(1.0), one(1e-30), one(1e30), same, vec![([0.0; 3], 1e-30), ([1.0; 3], 1.0)]];
    let as_balls = others.into_iter().chain(alone).map(|balls| (balls, None));
    // A volume that is no f32 times that of the ball leaves the point out.
    for (balls, volume) in as_balls.chain([None, Some(1e-3)].map(|volume| (of_all_sizes.clone(), volume))) {
        let store = Balls::of(&balls, 1).import(&out, &IngestOptions { volume, ..options.clone() });
        let mut pipeline = Pipeline::open(&store, None).unwrap();
        let framed = Camera::default_for(pipeline.mesh().frame()).unwrap();
        let beside = framed.focal_point + DVec3::X * framed.position.distance(framed.focal_point);
        let inside = Camera { position: framed.focal_point, focal_point: beside, ..framed };
        let away = Camera { focal_point: 2.0 * framed.position - framed.focal_point, ..framed };
        let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0; 3], tau: 1.0 }]).unwrap();
        for camera in [framed, inside, away] {
            let request = FrameRequest::new(0, camera, Arc::new(table.clone()), (32, 32));
            let frame = pipeline.render(&request).unwrap();
            assert!(frame.planes.color.pixels.iter().flatten().all(|value| value.is_finite()));
            if camera == away {
                let stats = &frame.stats;
                assert!(
                    stats.points_culled == stats.points_drawn && stats.fragments == 0,
                    "all behind the eye: {stats:?}"
                );
            }
        }
    }
    let refused = |balls: &Balls, radius: Option<f64>| {
        let options = IngestOptions { radius, ..options.clone() };
        ingest(balls, &out, &options, &Silent, &Cancel::new())
            .map(|_| ())
            .map_err(|error: IngestError| error.to_string())
    };
    let none = Balls { radii: Vec::new(), ..Balls::of(&one(1.0), 1) };
    assert!(refused(&none, None).unwrap_err().contains("--radius"));
    assert!(refused(&none, Some(0.5)).is_ok());
    assert!(refused(&Balls::of(&one(-1.0), 1), None).unwrap_err().contains("none of the 1 points has a radius"));
}

#[test]
fn a_store_of_points_with_other_radii_is_invalid_and_never_a_panic() {
    let temp = tempfile::tempdir().unwrap();
    let out = temp.path().join("c.zarr");
    Balls::spiral(50).import(&out, &IngestOptions::default());
    let mut filled = Balls::spiral(50);
    filled.volumes = vec![0.01; 50];
    let with_volumes = temp.path().join("v.zarr");
    filled.import(&with_volumes, &IngestOptions::default());
    for (out, array) in [(&out, "radii"), (&with_volumes, "filling")] {
        let chunk = out.join("mesh/0").join(array).join("c/0");
        let intact = std::fs::read(&chunk).unwrap();
        for size in [0.0f32, -1.0, 2.0, f32::NAN, f32::INFINITY] {
            // The last four bytes are the checksum of the others.
            let mut bytes = intact[..intact.len() - 4].to_vec();
            bytes[4..8].copy_from_slice(&size.to_le_bytes());
            bytes.extend(crc32c::crc32c(&bytes).to_le_bytes());
            std::fs::write(&chunk, bytes).unwrap();
            let is_right = array == "filling" && size == 2.0;
            assert_eq!(Store::open(out).unwrap().mesh().is_ok(), is_right, "{array} {size}");
        }
        std::fs::write(&chunk, &intact[..intact.len() - 4]).unwrap();
        assert!(Store::open(out).and_then(|store| store.mesh()).is_err());
        std::fs::write(&chunk, &intact).unwrap();
    }
    std::fs::remove_dir_all(with_volumes.join("mesh/0/filling")).unwrap();
    assert!(Store::open(&with_volumes).and_then(|store| store.mesh()).is_err());
    let root = out.join("zarr.json");
    let text = std::fs::read_to_string(&root).unwrap();
    for (from, to) in [
        ("\"kind\": \"points\"", "\"kind\": \"cells\""),
        ("\"kind\": \"points\"", "\"kind\": \"lines\""),
        ("\"2.0\"", "\"1.2\""),
        ("\"2.0\"", "\"3.0\""),
    ] {
        assert!(text.contains(from), "{text}");
        std::fs::write(&root, text.replace(from, to)).unwrap();
        assert!(Store::open(&out).is_err(), "{from} as {to}");
    }
    std::fs::write(&root, text).unwrap();
    assert!(Store::open(&out).unwrap().mesh().unwrap().is_cloud());
}
