//! Where other programs are silently wrong: opacities between the nodes of the colours, tables of another step's range, and
//! images that are shifted by half a pixel.
//!
//! All three were found in VTK 9.7.2, two of them in its default settings. Each test draws what that program would have drawn, and
//! asserts that it would have noticed.

use crate::meshes::{build, grid, sample};
use crate::render::havs::{havs, with_all_faces, with_buffer};
use crate::render::{camera, difference, job, raycast, reference, table, wave};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tetreel::camera::{Camera, Projection};
use tetreel::field::{Association, Component, FieldInfo, SeriesSource, TimeAxis};
use tetreel::image::RgbaImage;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::look::mapped_range;
use tetreel::mesh::RawMesh;
use tetreel::node_table::NodeTable;
use tetreel::optics::OpticsKind;
use tetreel::pipeline::{FrameRequest, FrameTime, Pipeline, Pipelined, PipelinedOptions, TetDraw};
use tetreel::playback::{Clock, Command, Mode, Player};
use tetreel::render::{Frame, RenderJob};
use tetreel::store::Store;
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{Lengths, OpacityKind, RangePolicy, TransferFunction, build_node_table};

/// What a channel whose value is known may be off by: roundings of f32 sums below 0.1. Measured: 1.8e-8.
const EXACT: f64 = 1e-7;

/// Every renderer that there is on the CPU.
fn all(job: &RenderJob) -> [(&'static str, RgbaImage); 3] {
    let faces = havs(&with_buffer(&with_all_faces(job), 6, true));
    [("raycast", raycast(job)), ("reference", reference(job)), ("havs", faces.planes.color)]
}

mod narrow_opacities {
    use super::*;

    /// Scene of a peer's test: a unit cube with s = x, opacities a tent at 0.5 over a unit distance of 1/4, one colour.
    const TENT: [(f64, f64); 5] = [(0.0, 0.0), (0.4, 0.0), (0.5, 0.2), (0.6, 0.0), (1.0, 0.0)];
    const UNIT_DISTANCE: f64 = 0.25;
    const RGB: [f64; 3] = [1.0, 0.5, 0.25];

    /// A file as a user has it: the colour map has nodes at both ends only.
    fn file(folder: &Path) -> TransferFunction {
        let points: Vec<_> = TENT.iter().map(|(x, value)| serde_json::json!([x, value])).collect();
        let ends: Vec<f64> = [0.0, 1.0].iter().flat_map(|x| [*x, RGB[0], RGB[1], RGB[2]]).collect();
        let map = serde_json::json!([{ "Name": "one", "ColorSpace": "RGB", "RGBPoints": ends }]);
        std::fs::write(folder.join("map.json"), map.to_string()).unwrap();
        let tf = serde_json::json!({ "color_map": "map.json", "points": points });
        std::fs::write(folder.join("tf.json"), tf.to_string()).unwrap();
        TransferFunction::parse(folder.join("tf.json").to_str().unwrap()).unwrap()
    }

    /// The cube seen along -x; values are relative to its own size, 1.
    fn scene(table: NodeTable, jitter: f64) -> RenderJob {
        let mut raw = grid(4, jitter, 5, |_| true);
        raw.points.iter_mut().for_each(|p| *p *= 0.5);
        let mesh = Arc::new(build(raw));
        let scalars = sample(&mesh, |p| p.x + 0.5);
        let eye = Camera {
            position: DVec3::new(50.0, 0.01, 0.013),
            focal_point: DVec3::new(0.0, 0.01, 0.013),
            ..camera(50.0 * DVec3::X, Projection::Perspective { view_angle: 1.0 })
        };
        job(&mesh, scalars, &eye, (24, 24), table)
    }

    #[test]
    fn a_tent_of_opacity_between_two_nodes_of_colour_is_drawn_by_every_renderer() {
        let temp = tempfile::tempdir().unwrap();
        let range = RangePolicy::Manual(0.0, 1.0).resolve((0.0, 1.0), (0.0, 1.0)).unwrap();
        let tf = file(temp.path());
        let table =
            build_node_table(&tf, &range, OpacityKind::Extinction, &Lengths::of_unit_distance(UNIT_DISTANCE)).unwrap();
        assert_eq!(tf.color_map().points().len(), 2, "the colours have no node within the tent");
        // The area of the tent, 0.2 x 0.2 / 2, over the unit distance: an optical depth of 0.08, an opacity of 0.0769 (half a unit
        // of its last digit).
        let depth = 0.5 * 0.2 * 0.2 / UNIT_DISTANCE;
        assert!((-(-depth).exp_m1() - 0.0769).abs() < 5e-5);
        for jitter in [0.0, 0.16] {
            let job = scene(table.clone(), jitter);
            for (name, image) in all(&job) {
                assert!(worst(&job, &image, depth) <= EXACT, "{name}: off by {:.1e}", worst(&job, &image, depth));
            }
            // What VTK draws, where opacities count at nodes of the colours only: nothing.
            let ends = NodeTable::new(vec![table.eval(0.0), table.eval(1.0)]).unwrap();
            let job = RenderJob { table: Arc::new(ends), ..job };
            for (name, image) in all(&job) {
                assert!(worst(&job, &image, depth) > 1e5 * EXACT, "{name} would not have been told from nothing");
            }
        }
    }

    /// The largest difference from what a ray through the whole cube sees.
    fn worst(job: &RenderJob, image: &RgbaImage, depth: f64) -> f64 {
        let mut worst = 0.0f64;
        for (n, pixel) in image.pixels.iter().enumerate() {
            // A slanted ray is longer.
            let (px, py) = job.view.ray(n % image.width, n / image.width);
            let alpha = -(-depth * (1.0 + px * px + py * py).sqrt()).exp_m1();
            for (got, colour) in pixel.iter().zip([RGB[0], RGB[1], RGB[2], 1.0]) {
                worst = worst.max((f64::from(*got) - colour * alpha).abs());
            }
        }
        worst
    }

    #[test]
    fn opacities_as_alpha_are_drawn_as_the_table_promises() {
        // The same file without `--opacity-kind`: between two points opacity is linear, so that the depth of a unit distance is
        // -ln(1 - a), whose integral over a side of the tent (width 0.1, height h = 0.2) is 0.1 ((1 - h) ln(1 - h) + h) / h.
        let temp = tempfile::tempdir().unwrap();
        let range = RangePolicy::Manual(0.0, 1.0).resolve((0.0, 1.0), (0.0, 1.0)).unwrap();
        let table =
            build_node_table(&file(temp.path()), &range, OpacityKind::Alpha, &Lengths::of_unit_distance(UNIT_DISTANCE))
                .unwrap();
        let h = 0.2f64;
        let depth = 2.0 * 0.1 * ((1.0 - h) * (1.0 - h).ln() + h) / h / UNIT_DISTANCE;
        let job = scene(table, 0.16);
        for (name, image) in all(&job) {
            // By so much may a table be off, in the optical depth and in what is seen of colours.
            let bound = tetreel::transfer::DEPTH_TOLERANCE + EXACT;
            assert!(worst(&job, &image, depth) <= bound, "{name}: off by {:.1e}", worst(&job, &image, depth));
            assert!(worst(&job, &image, 1.01 * depth) > bound, "{name}: a hundredth more is not noticed");
        }
    }
}

mod ranges_that_widen {
    use super::*;

    /// How large the field is at each step: the first is quiet.
    const AMPLITUDES: [f64; 4] = [0.3, 0.3, 1.0, 0.6];
    const LONG: Duration = Duration::from_secs(60);

    struct Widening {
        mesh: RawMesh,
        times: TimeAxis,
        fields: [FieldInfo; 1],
    }

    impl SeriesSource for Widening {
        fn describe(&self) -> String {
            "widening".to_owned()
        }

        fn times(&self) -> &TimeAxis {
            &self.times
        }

        fn fields(&self) -> &[FieldInfo] {
            &self.fields
        }

        fn mesh(&self) -> tetreel::error::FileResult<RawMesh> {
            Ok(self.mesh.clone())
        }

        fn read(&self, _: &FieldInfo, _: Component, step: usize, out: &mut Vec<f32>) -> tetreel::error::FileResult<()> {
            out.clear();
            out.extend(self.mesh.points.iter().map(|&p| (AMPLITUDES[step] * (1.5 + wave(p))) as f32));
            Ok(())
        }
    }

    fn store(path: &Path) -> Store {
        let source = Widening {
            mesh: grid(4, 0.12, 8, |_| true),
            times: TimeAxis { values: (0..AMPLITUDES.len()).map(|i| i as f64).collect() },
            fields: [FieldInfo { name: "s".to_owned(), components: 1, association: Association::Point }],
        };
        ingest(&source, path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        Store::open(path).unwrap()
    }

    /// What a user asks for: the table of each moment is that of the range then.
    fn request(
        pipeline: &Pipeline,
        policy: &RangePolicy,
        draw: TetDraw,
        optics: OpticsKind,
    ) -> impl Fn(FrameTime) -> FrameRequest + use<> {
        let bounds = pipeline.mesh().positions.world_bounds();
        let camera = Camera::default_for(bounds).unwrap();
        let tf = TransferFunction::parse("turbo@0:0,0.3:0.02,0.4:0.6,0.5:0.05,1:0.4").unwrap();
        let (series, policy) = (pipeline.series().clone(), *policy);
        let unit = 0.05 * (bounds.1 - bounds.0).length();
        move |time| {
            let range = mapped_range(&series, &policy, time).unwrap();
            let table = build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_unit_distance(unit)).unwrap();
            let request = FrameRequest::new(time, camera, Arc::new(table), (32, 24));
            request.with_tets(|tets| (tets.draw, tets.optics) = (draw, optics))
        }
    }

    fn bits(frame: &Frame) -> Vec<[u32; 4]> {
        frame.planes.color.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
    }

    /// All frames of a player that goes through the series.
    fn played(pipeline: Pipeline, request: &impl Fn(FrameTime) -> FrameRequest) -> Vec<Vec<[u32; 4]>> {
        let clock = Clock::new(pipeline.times().clone());
        let mut player = Player::new(clock, Pipelined::start(pipeline, &PipelinedOptions::default(), || ()).unwrap());
        player.apply(Command::Mode(Mode::AsFastAsPossible), Duration::ZERO).unwrap();
        player.apply(Command::Play, Duration::ZERO).unwrap();
        let mut shown = Vec::new();
        while !player.clock().state().ended || player.pipelined().wanted() > 0 {
            match player.tick(Duration::ZERO, &mut |time| Some(request(time))).shown {
                Some(delivery) => shown.push(bits(&delivery.frame.unwrap())),
                None => drop(player.wait(LONG)),
            }
        }
        shown
    }

    // Long: six policies and five renderers, and a new pipeline for each step drawn alone.
    #[test]
    fn a_loud_step_after_a_quiet_one_is_the_one_that_is_drawn_alone() {
        let temp = tempfile::tempdir().unwrap();
        let store = store(&temp.path().join("s.zarr"));
        let open = || Pipeline::open(&store, None).unwrap();
        let policies = ["series", "step", "symmetric", "log", "0.1,2", "log:0.1,2"];
        let renderers = [
            (TetDraw::Raycast, OpticsKind::Exact),
            (TetDraw::Raycast, OpticsKind::Table3d),
            (TetDraw::ALL_FACES, OpticsKind::Exact),
            (TetDraw::ALL_FACES, OpticsKind::Table3d),
            (TetDraw::Reference, OpticsKind::Exact),
        ];
        for policy in policies {
            let policy: RangePolicy = policy.parse().unwrap();
            for (draw, optics) in renderers {
                let request = request(&open(), &policy, draw, optics);
                let name = format!("{policy}, {draw:?}, {optics:?}");
                let alone: Vec<_> =
                    (0..AMPLITUDES.len()).map(|step| bits(open().render(&request(step.into())).unwrap())).collect();
                assert!(alone[2].iter().flatten().any(|&bits| bits != 0), "{name}: an empty image proves nothing");
                // One pipeline through all steps, and back.
                let mut pipeline = open();
                for step in [0, 2, 1, 3, 0, 2] {
                    assert!(
                        bits(pipeline.render(&request(step.into())).unwrap()) == alone[step],
                        "{name}, step {step}"
                    );
                }
                assert!(played(open(), &request) == alone, "{name}: what is played is not what is drawn alone");
                // A table of the first step's range would be seen wherever ranges are those of steps.
                let stale = FrameRequest { layers: request(0.into()).layers, ..request(2.into()) };
                let differs = bits(open().render(&stale).unwrap()) != alone[2];
                assert_eq!(differs, policy == RangePolicy::Step, "{name}");
            }
        }
    }
}

mod pixel_centres {
    use super::*;

    const SIDE: usize = 16;
    /// Half the height of the image: pixels are 0.2 wide.
    const SCALE: f64 = 1.6;
    const PIXEL: f64 = 2.0 * SCALE / SIDE as f64;

    /// The box from -1 to 1 with its centre so many pixels right of and above that of the image.
    fn shifted(right: f64, up: f64, table: NodeTable) -> RenderJob {
        let mesh = Arc::new(build(grid(3, 0.1, 4, |_| true)));
        let scalars = vec![0.5; mesh.positions.local.len()];
        let along_z = camera(5.0 * DVec3::Z, Projection::Parallel { scale: SCALE });
        let by = PIXEL * DVec3::new(-right, -up, 0.0);
        let camera = Camera { position: along_z.position + by, focal_point: along_z.focal_point + by, ..along_z };
        job(&mesh, scalars, &camera, (SIDE, SIDE), table)
    }

    /// Which pixels see the box, if pixel (i, j) looks through (i + `at`, j + `at`).
    fn covered(right: f64, up: f64, at: f64) -> Vec<bool> {
        let inside = |offset: f64| offset.abs() < 1.0;
        let pixel = |n: usize| {
            let (i, j) = ((n % SIDE) as f64, (n / SIDE) as f64);
            let half = 0.5 * SIDE as f64;
            inside((i + at - half - right) * PIXEL) && inside((half - j - at - up) * PIXEL)
        };
        (0..SIDE * SIDE).map(pixel).collect()
    }

    #[test]
    fn a_pixel_is_covered_if_its_centre_is() {
        let opaque = table(&[(0.0, [1.0; 3], 50.0)]);
        // The edges lie at whole pixels plus these shifts: never at a centre nor at a corner, and between the two on the left.
        for (right, up) in [(0.2, 0.3), (-0.7, 0.2), (0.3, -0.8), (3.4, 2.1)] {
            let job = shifted(right, up, opaque.clone());
            for (name, image) in all(&job) {
                let seen: Vec<bool> = image.pixels.iter().map(|pixel| pixel[3] > 0.0).collect();
                assert_eq!(seen, covered(right, up, 0.5), "{name}, shifted by {right}, {up}");
                assert_eq!(seen.iter().filter(|&&seen| seen).count(), 100, "a box of 10 x 10 pixels");
                // Who samples the corners of pixels draws another picture.
                assert_ne!(seen, covered(right, up, 0.0), "{name}");
            }
        }
    }

    /// x turned around.
    fn mirrored(image: &RgbaImage) -> RgbaImage {
        let rows = image.pixels.chunks(image.width);
        RgbaImage { pixels: rows.flat_map(|row| row.iter().rev().copied()).collect(), ..image.clone() }
    }

    /// A scene from a camera so many pixels to the right; with `mirror`, all but the pixels is mirrored in x.
    fn scene(mirror: bool, right: f64, projection: Projection) -> RenderJob {
        // No ray goes through a vertex or an edge: the mesh is jittered, and the eye at no special place.
        let mut raw = grid(5, 0.13, 6, |c| c.length() > 0.5);
        let side = if mirror { DVec3::new(-1.0, 1.0, 1.0) } else { DVec3::ONE };
        raw.points.iter_mut().for_each(|p| *p *= side);
        let mesh = Arc::new(build(raw));
        let scalars = sample(&mesh, |p| wave(p * side));
        let eye = DVec3::new(3.07, 2.03, 2.51);
        let straight = camera(eye * side, projection);
        // Right as the picture has it: a pixel at the distance of the centre.
        let view = straight.view(SIDE, SIDE).unwrap();
        let pixel = match projection {
            Projection::Parallel { scale } => 2.0 * scale / SIDE as f64,
            Projection::Perspective { view_angle } => {
                2.0 * (0.5 * view_angle.to_radians()).tan() * eye.length() / SIDE as f64
            }
        };
        let by = view.right * right * pixel;
        let camera = Camera { position: straight.position + by, focal_point: straight.focal_point + by, ..straight };
        job(&mesh, scalars, &camera, (SIDE, SIDE), crate::render::dense())
    }

    #[test]
    fn a_mirrored_scene_is_the_mirrored_image() {
        for projection in [Projection::Perspective { view_angle: 34.0 }, Projection::Parallel { scale: 1.7 }] {
            let (left, right) = (all(&scene(false, 0.0, projection)), all(&scene(true, 0.0, projection)));
            let half = all(&scene(true, 0.5, projection));
            for (((name, left), (_, right)), (_, half)) in left.iter().zip(&right).zip(&half) {
                let (_, max) = difference(left, &mirrored(right));
                assert!(max <= EXACT, "{name}: off by {max:.1e}");
                // Half a pixel to one side is noticed. Measured: RMSE 0.07 and more.
                let (rmse, _) = difference(left, &mirrored(half));
                assert!(rmse > 1e5 * EXACT, "{name}: half a pixel makes a difference of {rmse:.1e} only");
            }
        }
    }
}
