//! The surface of the domain: against closed forms on a box, with and without what is in it, and cut.

use crate::series::{colors_for, ingested};
use glam::DVec3;
use tetreel::camera::{Camera, Projection};
use tetreel::image::Planes;
use tetreel::pipeline::{Backend, FrameRequest, Pipeline, SampleSet, TetDraw};
use tetreel::render::surfaces::{Cut, Normals};
use tetreel::synth::{SeriesName, SynthSpec, generate};

pub(crate) const SIZE: (usize, usize) = (60, 50);

/// A box, and a request for surfaces of its domain alone.
fn slab(dir: &std::path::Path, surfaces: &[&str]) -> (Pipeline, FrameRequest) {
    let series = generate(&SynthSpec { cells: 3000, steps: 3, ..SynthSpec::new(SeriesName::Slab) }).unwrap();
    let pipeline =
        Pipeline::open(&ingested(&series, &dir.join("slab.zarr"), "0..2"), Some(&"linear".parse().unwrap())).unwrap();
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let (table, formula) = colors_for(&pipeline, "viridis@0:0,1:0");
    let request = FrameRequest::new(1, camera, table, SIZE).with_tets(|tets| {
        tets.domain = surfaces.iter().map(|text| text.parse().unwrap()).collect();
        (tets.volume, tets.formula, tets.shading.normals) = (false, Some(formula), Normals::None);
    });
    (pipeline, FrameRequest { backend: Backend::Cpu, ..request })
}

pub(crate) fn planes(pipeline: &mut Pipeline, request: &FrameRequest, draw: TetDraw) -> Planes {
    pipeline.render(&request.clone().with_draw(draw)).unwrap().planes.clone()
}

/// Depths at which the ray of a pixel enters and leaves a box, if it does.
pub(crate) fn through_box((lo, hi): (DVec3, DVec3), request: &FrameRequest, pixel: usize) -> Option<(f64, f64)> {
    let view = request.camera.view(SIZE.0, SIZE.1).unwrap();
    let (px, py) = view.ray(pixel % SIZE.0, pixel / SIZE.0);
    let beside = px * view.right + py * view.up;
    let (origin, along) =
        if view.perspective { (view.eye, view.forward + beside) } else { (view.eye + beside, view.forward) };
    let (a, b) = ((lo - origin) / along, (hi - origin) / along);
    let (enter, exit) = (a.min(b).max_element(), a.max(b).min_element());
    (exit > enter && exit > 0.0).then_some((enter, exit))
}

/// Checks that a picture is that of a white box of opacity 0.5; returns how many of its rays miss and meet it.
pub(crate) fn is_box(found: &Planes, bounds: (DVec3, DVec3), request: &FrameRequest, name: &str) -> [usize; 2] {
    let eye = request.camera.position;
    let is_inside = eye.cmpgt(bounds.0).all() && eye.cmplt(bounds.1).all();
    let mut seen = [0, 0];
    for pixel in 0..SIZE.0 * SIZE.1 {
        let through = through_box(bounds, request, pixel);
        let (opacity, depth) = match through {
            None => (0.0, f64::INFINITY),
            Some((enter, exit)) if enter <= 0.0 && is_inside => (0.5, exit),
            Some((enter, _)) => (0.75, enter),
        };
        seen[usize::from(opacity > 0.0)] += 1;
        // A ray that meets an edge of the box within rounding may go either way.
        let grazes = through.is_some_and(|(enter, exit)| exit - enter < 1e-4);
        let (rgba, at) = (found.color.pixels[pixel], f64::from(found.depth.pixels[pixel]));
        assert!(grazes || rgba == [opacity as f32; 4], "{name}, pixel {pixel}: {rgba:?}");
        assert!(grazes || at == depth || (at - depth).abs() < 1e-5, "{name}, pixel {pixel}: {at}, not {depth}");
    }
    seen
}

#[test]
fn a_ray_meets_a_box_where_it_enters_and_where_it_leaves_and_once_from_within() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = slab(temp.path(), &["solid:#ffffff:0.5"]);
    let (lo, hi) = pipeline.mesh().positions.world_bounds();
    let outside = request.camera;
    let parallel = Camera { projection: Projection::Parallel { scale: 0.4 * (hi - lo).length() }, ..outside };
    let inside =
        Camera { position: lo + 0.4 * (hi - lo), projection: Projection::Perspective { view_angle: 80.0 }, ..outside };
    for (name, camera) in [("outside", outside), ("parallel", parallel), ("inside", inside)] {
        let request = FrameRequest { camera, ..request.clone() };
        for draw in [TetDraw::Raycast, TetDraw::ALL_FACES, TetDraw::Reference] {
            let found = planes(&mut pipeline, &request, draw);
            let seen = is_box(&found, (lo, hi), &request, &format!("{name}, {draw:?}"));
            assert!(seen[1] > 500 && (seen[0] > 100 || name == "inside"), "{name}: {seen:?}");
        }
    }
}

#[test]
fn it_has_the_colours_of_the_field_also_where_the_volume_is_clear() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = slab(temp.path(), &["solid"]);
    let found = planes(&mut pipeline, &request, TetDraw::Raycast);
    let formula = request.tets().unwrap().formula.clone().unwrap();
    let formula = formula.formula().unwrap();
    let scalars = pipeline.prepare(&request).unwrap().scalars;
    let mesh = pipeline.mesh().clone();
    let view = request.camera.view(SIZE.0, SIZE.1).unwrap();
    let (mut compared, bounds) = (0, mesh.positions.world_bounds());
    for pixel in 0..SIZE.0 * SIZE.1 {
        let Some((enter, _)) = through_box(bounds, &request, pixel) else { continue };
        let (px, py) = view.ray(pixel % SIZE.0, pixel / SIZE.0);
        let point = view.eye + enter * (view.forward + px * view.right + py * view.up);
        // The scalar of the cell at the point, by its corners.
        let local = mesh.positions.local_from_world(point);
        let inside = |tet: &&[u32; 4]| {
            let corners = mesh.positions.corners(**tet).map(|c| c.as_dvec3());
            let whole = tetreel::mesh::tet_volume(mesh.positions.corners(**tet));
            (0..4).all(|i| {
                let mut with = corners;
                with[i] = local;
                let [a, b, c, d] = with;
                (b - a).cross(c - a).dot(d - a) / 6.0 > -1e-7 * whole.abs().max(1e-12)
            })
        };
        let Some(tet) = mesh.topology.tets.iter().find(inside) else { continue };
        let range = tet.map(|v| f64::from(scalars.values()[v as usize]));
        let (least, most) = range.iter().fold((f64::MAX, f64::MIN), |(lo, hi), s| (lo.min(*s), hi.max(*s)));
        let [a, b] = [least, most].map(|scalar| formula.eval(scalar).0);
        let color = found.color.pixels[pixel];
        let between = (0..3).all(|c| {
            let (lo, hi) = (a[c].min(b[c]) - 0.02, a[c].max(b[c]) + 0.02);
            (lo..=hi).contains(&f64::from(color[c]))
        });
        assert!(between && color[3] == 1.0, "pixel {pixel}: {color:?} between {a:?} and {b:?}");
        compared += 1;
    }
    assert!(compared > 400, "{compared}");
    // In a volume it hides what lies behind it.
    let with_volume = request.clone().with_tets(|tets| tets.volume = true);
    let hidden = planes(&mut pipeline, &with_volume, TetDraw::Raycast);
    assert!(hidden.color == found.color);
}

#[test]
fn feature_edges_are_those_of_the_box_and_a_wireframe_has_all() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = slab(temp.path(), &["edges:#ffffff"]);
    let (lo, hi) = pipeline.mesh().positions.world_bounds();
    let middle = 0.5 * (lo + hi);
    // Along x: four edges make a rectangle, in front of those behind.
    let camera = Camera {
        position: middle + (hi - lo).length() * DVec3::X,
        focal_point: middle,
        view_up: DVec3::Z,
        projection: Projection::Parallel { scale: 0.5 * (hi.z - lo.z) * 1.2 },
        near: 0.0,
    };
    let request = FrameRequest { camera, ..request };
    let count = |planes: &Planes| planes.color.pixels.iter().filter(|p| p[3] > 0.0).count();
    let edges = planes(&mut pipeline, &request, TetDraw::Raycast);
    let wire = request.clone().with_tets(|tets| tets.domain = vec!["wireframe:#ffffff".parse().unwrap()]);
    let wires = planes(&mut pipeline, &wire, TetDraw::Raycast);
    let center = SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2;
    let near = |planes: &Planes, pixel: usize| {
        (-2..=2).any(|dy: isize| {
            (-2..=2).any(|dx: isize| {
                let at = pixel as isize + dy * SIZE.0 as isize + dx;
                planes.color.pixels[at as usize][3] > 0.0
            })
        })
    };
    assert!(!near(&edges, center), "nothing turns in the middle of a side");
    assert!(count(&edges) > 50 && count(&wires) > 2 * count(&edges), "{} {}", count(&edges), count(&wires));
    // All lines lie on the rectangle, within a pixel.
    let view = camera.view(SIZE.0, SIZE.1).unwrap();
    let px = 2.0 * view.half_height / SIZE.1 as f64;
    for (pixel, color) in edges.color.pixels.iter().enumerate().filter(|(_, color)| color[3] > 0.0) {
        let (x, y) = view.ray(pixel % SIZE.0, pixel / SIZE.0);
        let half = 0.5 * (hi - lo);
        let off = (x.abs() - half.y).abs().min((y.abs() - half.z).abs());
        assert!(off < 1.01 * px, "pixel {pixel}: {off} from an edge, {color:?}");
    }
    // Hidden by the solid surface are the edges behind it only.
    let both = request.clone().with_tets(|tets| {
        tets.domain = ["solid:#000000", "edges:#ffffff"].map(|text| text.parse().unwrap()).to_vec();
    });
    let both = planes(&mut pipeline, &both, TetDraw::Raycast);
    assert!(both.color.pixels.iter().filter(|p| p[0] > 0.3).count() > 40);
}

#[test]
fn it_is_cut_by_clips_and_is_the_same_at_the_pixels_that_are_asked_for() {
    let temp = tempfile::tempdir().unwrap();
    let (mut pipeline, request) = slab(temp.path(), &["solid", "edges"]);
    let (lo, hi) = pipeline.mesh().positions.world_bounds();
    let cut = Cut { point: (0.5 * (lo + hi)).to_array(), normal: [1.0, 0.2, 0.3], clips: true, by: None };
    let clipped = request.clone().with_tets(|tets| tets.cuts = vec![cut]);
    let [whole, clipped_planes] = [&request, &clipped].map(|request| planes(&mut pipeline, request, TetDraw::Raycast));
    assert!(whole.color != clipped_planes.color);
    let view = request.camera.view(SIZE.0, SIZE.1).unwrap();
    let normal = DVec3::from(cut.normal).normalize();
    let mut seen = 0;
    for (pixel, depth) in clipped_planes.depth.pixels.iter().enumerate().filter(|(_, depth)| depth.is_finite()) {
        let (px, py) = view.ray(pixel % SIZE.0, pixel / SIZE.0);
        let point = view.eye + f64::from(*depth) * (view.forward + px * view.right + py * view.up);
        assert!(normal.dot(point - DVec3::from(cut.point)) < 1e-2, "pixel {pixel} shows what is cut away");
        seen += 1;
    }
    assert!(seen > 300, "{seen}");
    let stride_px = std::num::NonZeroUsize::new(7).unwrap();
    let some = FrameRequest { samples: SampleSet::Lattice { stride_px }, ..clipped };
    let some = planes(&mut pipeline, &some, TetDraw::Raycast);
    for (at, pixel) in some.color.pixels.iter().enumerate() {
        let (column, row) = (at % some.color.width, at / some.color.width);
        let (column, row) = ((7 * column).min(SIZE.0 - 1), (7 * row).min(SIZE.1 - 1));
        assert_eq!(*pixel, clipped_planes.color.pixels[row * SIZE.0 + column]);
    }
}
