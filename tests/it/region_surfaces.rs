//! Surfaces of regions: against closed forms on boxes, beside the volume of others, where they touch, and in holes.

use crate::cubes::cubes;
use crate::domain::{SIZE, is_box, planes};
use crate::series::{colors_for, ingested};
use glam::DVec3;
use tetreel::camera::{Camera, Projection};
use tetreel::field::Association;
use tetreel::image::Planes;
use tetreel::pipeline::{Backend, FrameRequest, FrameTime, Pipeline, TetDraw};
use tetreel::render::surfaces::Normals;

const DRAWS: [TetDraw; 3] = [TetDraw::Raycast, TetDraw::ALL_FACES, TetDraw::Reference];

/// A box of 4 x 2 x 2 of three blocks along x: 1 up to x = 2, 2 up to 3, 4. At step 1 the second has number 1, too. `q` has no values in
/// block 2.
fn blocks(dir: &std::path::Path, field: &str, surfaces: &[&str]) -> (Pipeline, FrameRequest) {
    let fields = [("T", Association::Point), ("block", Association::Cell), ("q", Association::Cell)];
    let source = cubes([4, 2, 2], false, 2, &fields, |name, step, at| match name {
        "block" if at.x < 2.0 || step == 1 && at.x < 3.0 => 1.0,
        "block" => {
            if at.x < 3.0 {
                2.0
            } else {
                4.0
            }
        }
        "q" if (2.0..3.0).contains(&at.x) => f32::NAN,
        _ => (0.25 * at.x) as f32,
    });
    let store = ingested(&source, &dir.join("blocks.zarr"), "0..1");
    let pipeline = Pipeline::open(&store, Some(&field.parse().unwrap())).unwrap();
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let (table, formula) = colors_for(&pipeline, "viridis@0:0.3,1:0.5");
    let request = FrameRequest::new(0, camera, table, SIZE).with_tets(|tets| {
        (tets.volume, tets.formula, tets.shading.normals) = (false, Some(formula), Normals::None);
    });
    (pipeline, FrameRequest { backend: Backend::Cpu, ..with(&request, surfaces) })
}

fn with(request: &FrameRequest, surfaces: &[&str]) -> FrameRequest {
    request.clone().with_tets(|tets| tets.domain = surfaces.iter().map(|text| text.parse().unwrap()).collect())
}

/// A camera before the middle of the first block that looks along x.
fn along_x() -> Camera {
    Camera {
        position: DVec3::new(-5.0, 0.97, 1.04),
        focal_point: DVec3::new(0.0, 0.97, 1.04),
        view_up: DVec3::Z,
        projection: Projection::Parallel { scale: 1.5 },
        near: 0.0,
    }
}

fn center(planes: &Planes) -> ([f32; 4], f32) {
    let at = SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2;
    (planes.color.pixels[at], planes.depth.pixels[at])
}

#[test]
fn the_surface_of_a_region_is_that_of_its_box_whatever_the_volume_shows() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = blocks(temp.path(), "T", &["solid:block=2:#ffffff:0.5"]);
    let outside = request.camera;
    let parallel = Camera { projection: Projection::Parallel { scale: 3.0 }, ..outside };
    let inside = Camera {
        position: DVec3::new(2.4, 0.9, 1.1),
        projection: Projection::Perspective { view_angle: 80.0 },
        ..outside
    };
    let bounds = (DVec3::new(2.0, 0.0, 0.0), DVec3::new(3.0, 2.0, 2.0));
    for (name, camera) in [("outside", outside), ("parallel", parallel), ("inside", inside)] {
        for (draw, shown) in DRAWS.into_iter().flat_map(|draw| [(draw, None), (draw, Some("block=1"))]) {
            let request = FrameRequest { camera, ..request.clone() };
            let request = request.with_tets(|tets| tets.regions = shown.map(|shown| shown.parse().unwrap()));
            let found = planes(&mut pipeline, &request, draw);
            let seen = is_box(&found, bounds, &request, &format!("{name}, {draw:?}, {shown:?}"));
            assert!(seen[1] > 200 && (seen[0] > 100 || name == "inside"), "{name}: {seen:?}");
        }
    }
    // At the other step, and on the way to it, numbers are those of the last step: block 2 is none, and 1 reaches to x = 3.
    let at = |time: FrameTime, surface: &str, pipeline: &mut Pipeline| {
        let request = FrameRequest { camera: along_x(), time, ..with(&request, &[surface]) };
        center(&planes(pipeline, &request, TetDraw::Raycast))
    };
    assert_eq!(at(FrameTime::between(0, 1, 0.9), "solid:block=2:#ffffff", &mut pipeline), ([1.0; 4], 7.0));
    assert_eq!(at(1.into(), "solid:block=2:#ffffff", &mut pipeline), ([0.0; 4], f32::INFINITY));
    assert_eq!(at(1.into(), "solid:block=4:#ffffff", &mut pipeline), ([1.0; 4], 8.0));
}

#[test]
fn beside_the_volume_of_another_region_a_shell_lets_it_through_and_all_renderers_agree() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = blocks(temp.path(), "T", &["solid:block=2,4:#4488ff:0.4", "edges:block=1"]);
    let request = request.with_tets(|tets| {
        (tets.volume, tets.regions) = (true, Some("block=1".parse().unwrap()));
    });
    let [raycast, faces, judge] = DRAWS.map(|draw| planes(&mut pipeline, &request, draw));
    let difference = |a: &Planes, b: &Planes| {
        let pairs = a.color.pixels.iter().flatten().zip(b.color.pixels.iter().flatten());
        pairs.map(|(a, b)| (a - b).abs()).fold(0f32, f32::max)
    };
    assert!(difference(&raycast, &judge) < 1e-5 && difference(&faces, &judge) < 1e-5);
    let others = [
        with(&request, &["solid:block=2,4:#4488ff:0.4"]),
        with(&request, &["solid:block=2:#4488ff:0.4", "edges:block=1"]),
        request.clone().with_tets(|tets| tets.regions = Some("block=2".parse().unwrap())),
    ];
    for other in others {
        assert!(difference(&planes(&mut pipeline, &other, TetDraw::Raycast), &raycast) > 0.05);
    }
}

#[test]
fn at_a_common_face_the_surface_that_is_asked_for_first_lies_in_front_on_any_number_of_threads() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = blocks(temp.path(), "T", &[]);
    let (red, green) = ("solid:block=1:#ff0000:0.5", "solid:block=2:#00ff00");
    let request = FrameRequest { camera: along_x(), ..request };
    for (surfaces, expected) in [
        ([red, green], [0.75, 0.25, 0.0, 1.0]),
        ([green, red], [0.5, 0.5, 0.0, 1.0]),
        // The domain's surface shares its first face with that of block 1.
        (["solid:#0000ff:0.5", "solid:block=1:#ff0000"], [0.5, 0.0, 0.5, 1.0]),
        (["solid:block=1:#ff0000", "solid:#0000ff:0.5"], [1.0, 0.0, 0.0, 1.0]),
    ] {
        let request = with(&request, &surfaces);
        for draw in DRAWS {
            let found = [1, 3].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| planes(&mut pipeline, &request, draw))
            });
            assert!(found[0] == found[1], "{surfaces:?}, {draw:?}");
            assert_eq!(center(&found[0]).0, expected, "{surfaces:?}, {draw:?}");
        }
    }
}

#[test]
fn a_surface_of_one_colour_needs_no_values_and_one_in_colours_of_the_field_does() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = blocks(temp.path(), "q", &[]);
    let request = FrameRequest { camera: along_x(), ..request };
    let mut found = |surface: &str| center(&planes(&mut pipeline, &with(&request, &[surface]), TetDraw::Raycast));
    assert_eq!(found("solid:block=2:#ffffff"), ([1.0; 4], 7.0));
    assert_eq!(found("solid:block=2").1, f32::INFINITY);
    let (rgba, depth) = found("solid:block=2,4");
    assert!((rgba[3], depth) == (1.0, 8.0) && rgba[0] > 0.0, "{rgba:?}, {depth}");
    // Regions whose numbers no cell has have no surface; fields that are none of cells, or none at all, are refused.
    assert_eq!(found("solid:block=7:#ffffff").1, f32::INFINITY);
    for (surface, problem) in
        [("solid:T=1", "'T' has values of vertices; regions are chosen by a field of cells"), ("edges:x=1", "'x'")]
    {
        let error = pipeline.render(&with(&request, &[surface])).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
}
