//! Probed points against the reference's pixels and closed forms.

use super::*;
use crate::camera::{Camera, Projection};
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};
use crate::mesh::{Mesh, RawMesh};
use crate::node_table::{Node, NodeTable};
use crate::render::Renderer;
use crate::render::domain::DomainSurface;
use crate::render::reference::Reference;
use crate::render::surfaces::{Cut, Isosurface, SurfaceScene, SurfaceShading, cut_planes};
use crate::render::testing::job;
use crate::visibility::CellSet;
use std::sync::Arc;

fn table(nodes: &[(f64, f64)]) -> Arc<NodeTable> {
    let nodes = nodes.iter().map(|&(scalar, tau)| Node { scalar, rgb: [0.5; 3], tau }).collect();
    Arc::new(NodeTable::new(nodes).unwrap())
}

/// Looks along +X at a row of cubes whose first face is in the plane x = 0, with one pixel at its middle.
fn along_x(cubes: usize, value: impl Fn(f64) -> f32, nodes: &[(f64, f64)], projection: Projection) -> RenderJob {
    let (mesh, _) = Mesh::build(kuhn_grid([cubes, 1, 1])).unwrap();
    let scalars = (0..mesh.positions.local.len()).map(|v| value(mesh.positions.world(v).x)).collect();
    let position = DVec3::new(-4.0, 0.45, 0.4);
    let camera = Camera { position, focal_point: position + DVec3::X, view_up: DVec3::Z, projection, near: 0.0 };
    job(&Arc::new(mesh), scalars, &camera, (9, 9), table(nodes))
}

const PARALLEL: Projection = Projection::Parallel { scale: 2.0 };
const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 20.0 };
const MIDDLE: (f64, f64) = (4.5, 4.5);

/// Bound on the rounding of a world coordinate: positions within [-1, 1] are f32.
fn rounding(job: &RenderJob) -> f64 {
    4.0 * f64::from(f32::EPSILON) * job.mesh.positions.scale
}

fn sum_of_contributions(job: &RenderJob, at_px: (f64, f64)) -> f64 {
    let ray = Ray::new(job, at_px).unwrap();
    let mut sum = 0.0;
    ray.absorb(job, &ray.chain(job), |seen| sum += seen.contribution);
    sum
}

/// A mesh with random values and holes, seen from a random eye.
fn random_job(random: &mut Random) -> RenderJob {
    let mut raw = jittered(kuhn_grid([3, 2, 3]), random);
    let offset = if random.below(3) == 0 { DVec3::new(3e7, -2e7, 5e6) } else { DVec3::ZERO };
    raw.points.iter_mut().for_each(|p| *p += offset);
    let (mesh, _) = Mesh::build(raw).unwrap();
    let holes = [0, 0, 12][random.below(3)];
    let value = |random: &mut Random| match holes > 0 && random.below(holes) == 0 {
        true => [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][random.below(3)],
        false => random.signed() as f32,
    };
    let scalars = (0..mesh.positions.local.len()).map(|_| value(random)).collect();
    let direction = DVec3::from_array(std::array::from_fn(|_| random.signed()));
    let target = offset + DVec3::new(1.5, 1.0, 1.5);
    // Inside, near, outside, far.
    let distance = [0.1, 1.7, 9.0, 4e4][random.below(4)];
    let angle = if distance > 100.0 { 0.01 } else { 20.0 + 50.0 * (1.0 + random.signed()) };
    let projection = match random.below(3) {
        0 => Projection::Parallel { scale: 2.5 },
        _ => Projection::Perspective { view_angle: angle },
    };
    let near = [0.0, 1.0][random.below(2)];
    let camera =
        Camera { position: target + distance * direction, focal_point: target, view_up: DVec3::Z, projection, near };
    // Sometimes with a step to an opaque plateau.
    let most = [0.6, 30.0, 1e300][random.below(3)];
    let nodes = [(-0.7, 0.0), (-0.1, 0.3), (0.2, 0.0), (0.6, 0.1), (0.6, most), (0.8, 0.02)];
    let job = job(&Arc::new(mesh), scalars, &camera, (11, 9), table(&nodes));
    let surface = |value, opacity| Isosurface { opacity, ..Isosurface::new(value) };
    let surfaces = [surface(0.31, 0.4), surface(-0.52, [0.3, 1.0][random.below(2)])];
    let mut scene = SurfaceScene::new(&surfaces, SurfaceShading::default(), &job.table).unwrap();
    let random_cuts = random.below(2) == 0;
    let mut plane = || Cut {
        point: (target + 0.5 * DVec3::from_array(std::array::from_fn(|_| random.signed()))).to_array(),
        normal: std::array::from_fn(|_| random.signed()),
        clips: random.below(2) == 0,
        by: None,
    };
    if random_cuts {
        scene = scene.with_planes(cut_planes(&[plane(), plane()], &job.mesh.positions).unwrap());
    }
    RenderJob { surfaces: Some(scene).filter(|_| random.below(2) == 0), ..job }
}

#[test]
fn an_opaque_surface_is_met_where_it_is_and_a_faint_one_behind_haze_is_not_taken() {
    let haze = along_x(8, |x| x as f32, &[(0.0, 0.01)], PARALLEL);
    let with = |value: f64, opacity: f64| {
        let surfaces = [Isosurface { opacity, ..Isosurface::new(value) }];
        let scene = SurfaceScene::new(&surfaces, SurfaceShading::default(), &haze.table).unwrap();
        RenderJob { surfaces: Some(scene), ..haze.clone() }
    };
    let found = probe(&with(5.25, 1.0), MIDDLE).unwrap().unwrap();
    assert!((found.depth - 9.25).abs() < rounding(&haze) && (found.scalar - 5.25).abs() < 1e-5, "{found:?}");
    assert!(found.share > 0.9);
    assert!((found.position.x - 5.25).abs() < rounding(&haze));
    let faint = probe(&with(5.25, 1e-4), MIDDLE).unwrap().unwrap();
    assert!((faint.depth - 9.25).abs() > 1e-3);
}

#[test]
fn contributions_of_all_cells_make_the_opacity_of_the_reference() {
    // The reference's pixel is rounded to f32: by half of 2^-24 below 1. Sums of a hundred numbers in f64 are far better.
    let bound = 2f64.powi(-25) + 1e-12;
    let (mut seen, mut caught, mut empty) = (0, 0, 0);
    for seed in 0..200 {
        let job = random_job(&mut Random::new(seed));
        let judge = Reference::new().render(job.clone()).unwrap().planes.color.clone();
        let thinner = job.table.nodes().iter().map(|n| Node { tau: n.tau * (1.0 - 1e-4), ..*n }).collect();
        let thinner = RenderJob { table: Arc::new(NodeTable::new(thinner).unwrap()), ..job.clone() };
        for (i, pixel) in judge.pixels.iter().enumerate() {
            let at_px = ((i % judge.width) as f64 + 0.5, (i / judge.width) as f64 + 0.5);
            let expected = f64::from(pixel[3]);
            let sum = sum_of_contributions(&job, at_px);
            assert!((sum - expected).abs() <= bound, "seed {seed}, pixel {i}: {sum} for {expected}");
            caught += usize::from((sum_of_contributions(&thinner, at_px) - expected).abs() > bound);
            let probe = probe(&job, at_px).unwrap();
            assert_eq!(probe.is_some(), sum > 0.0, "seed {seed}, pixel {i}");
            seen += usize::from(probe.is_some());
            empty += usize::from(probe.is_none());
        }
    }
    // A ten-thousandth less extinction is noticed wherever the ray is neither transparent nor opaque.
    assert!(seen > 5000 && empty > 1000 && caught > seen / 4, "{seen} seen, {empty} empty, {caught} caught");
}

#[test]
fn a_point_lies_on_the_ray_in_its_cell_and_has_its_scalar() {
    let (mut count, mut noticed) = (0, 0);
    for seed in 0..100 {
        let mut random = Random::new(1000 + seed);
        let job = random_job(&mut random);
        let at_px = (5.5 + 5.5 * random.signed(), 4.5 + 4.5 * random.signed());
        let Some(probe) = probe(&job, at_px).unwrap() else { continue };
        count += 1;
        let tet = job.mesh.topology.tets[probe.cell as usize];
        assert!(job.active.contains(probe.cell));
        assert_eq!(probe.source_cell, job.mesh.cell_source[probe.cell as usize]);
        assert!(probe.weights.iter().all(|w| (0.0..=1.0).contains(w)));
        assert!((probe.weights.iter().sum::<f64>() - 1.0).abs() <= 4.0 * f64::EPSILON);
        let scalars = job.scalars.at_corners(probe.cell, tet);
        // Four products of scalars and weights below 1 and their sum: each rounds by 2^-53 at most.
        let by_hand: f64 = probe.weights.iter().zip(scalars).map(|(w, s)| w * f64::from(s)).sum();
        assert!((probe.scalar - by_hand).abs() <= 16.0 * f64::EPSILON, "seed {seed}");
        noticed += usize::from((f64::from(scalars[0]) - by_hand).abs() > 16.0 * f64::EPSILON);
        assert!(probe.share > 0.0 && probe.share <= 1.0);
        // The camera projects it back to the pointed position, within the rounding of view coordinates by a few 2^-53 of the distance
        // (and of the offset in the world), and of weights clamped by the inflation of cells.
        let view = job.view;
        let p = view.to_view(probe.position);
        let (x, y) = if view.perspective { (p.x / p.z, p.y / p.z) } else { (p.x, p.y) };
        let (px, py) = view.ray_at(at_px.0, at_px.1);
        let digits = 64.0 * f64::EPSILON * (view.eye.length() + probe.position.length() + p.length());
        let bound = (digits + 1e-9 * job.mesh.positions.scale) * (1.0 + px.abs() + py.abs());
        let per_plane = if view.perspective { p.z } else { 1.0 };
        assert!((x - px).abs() * per_plane <= bound && (y - py).abs() * per_plane <= bound, "seed {seed}: {probe:?}");
        assert!((p.z - probe.depth).abs() <= bound && probe.depth >= view.near - bound, "seed {seed}: {probe:?}");
    }
    assert!(count > 40 && noticed > count / 2, "{count}, {noticed} other scalars noticed");
}

#[test]
fn in_a_layer_the_point_is_where_half_of_what_its_cell_absorbs_is() {
    // One thick cube of constant extinction: the first cell on the ray contributes most, and its half is at a known depth.
    for (tau, projection) in [(1e-9, PARALLEL), (1.0, PARALLEL), (50.0, PARALLEL), (1.0, PERSPECTIVE)] {
        let job = along_x(1, |_| 0.0, &[(0.0, tau)], projection);
        let probe = probe(&job, MIDDLE).unwrap().unwrap();
        let ray = Ray::new(&job, MIDDLE).unwrap();
        let chain = ray.chain(&job);
        let of_cell = chain.iter().find(|on_ray| on_ray.number == probe.cell).unwrap();
        let [near, far] = of_cell.segment.part.map(|d| d * job.mesh.positions.scale);
        let opacity = |length: f64| -(-tau * length).exp_m1();
        let passed = probe.depth - near;
        // Exact except for rounding of depths below 8, which a small segment's opacity has in full.
        let bound = 64.0 * f64::EPSILON * tau.max(1e-9);
        assert!((opacity(passed) - 0.5 * opacity(far - near)).abs() <= bound, "{tau}: {passed} of {}", far - near);
        assert!((probe.position.x - (probe.depth - 4.0)).abs() <= rounding(&job));
    }
}

#[test]
fn the_layer_that_dominates_is_taken_and_not_the_haze_in_front_of_it() {
    // Value = x: haze from 0 to 8, a layer at 5 to 5.5; then an equal layer behind an opaque one.
    let layer = [(0.0, 0.01), (5.0, 0.01), (5.0, 4.0), (5.5, 4.0), (5.5, 0.01), (8.0, 0.01)];
    let job_of = |nodes: &[(f64, f64)]| along_x(8, |x| x as f32, nodes, PARALLEL);
    let found = probe(&job_of(&layer), MIDDLE).unwrap().unwrap();
    assert!(found.scalar > 5.0 && found.scalar < 5.5, "{found:?}");
    assert!((found.scalar - found.position.x).abs() <= rounding(&job_of(&layer)));
    let hidden = [(1.0, 0.0), (1.0, 500.0), (1.5, 500.0), (1.5, 0.0), (5.0, 0.0), (5.0, 900.0), (8.0, 900.0)];
    let found = probe(&job_of(&hidden), MIDDLE).unwrap().unwrap();
    assert!(found.scalar >= 1.0 && found.scalar < 1.02, "{found:?}");
}

#[test]
fn an_opaque_plateau_is_met_at_its_first_point() {
    for tau in [1e9, 1e300, f64::MAX] {
        let job = along_x(4, |x| x as f32, &[(2.25, 0.0), (2.25, tau), (9.0, tau)], PERSPECTIVE);
        let found = probe(&job, MIDDLE).unwrap().unwrap();
        assert!((found.scalar - 2.25).abs() <= rounding(&job) && found.share == 1.0, "{tau}: {found:?}");
    }
}

#[test]
fn of_equal_contributions_the_nearest_counts() {
    // Values alternating between 0 and 1 make equal layers at 0.5: extinction so thin that the front absorbs nothing.
    let thin = 1e-20;
    let job = along_x(6, |x| (x as i64 % 2) as f32, &[(0.0, 0.0), (0.5, thin), (1.0, 0.0)], PARALLEL);
    let ray = Ray::new(&job, MIDDLE).unwrap();
    let chain = ray.chain(&job);
    let mut given = Vec::new();
    ray.absorb(&job, &chain, |seen| given.push((seen.on_ray.number, seen.contribution)));
    let most = given.iter().map(|&(_, c)| c).fold(0.0, f64::max);
    let first = given.iter().find(|&&(_, c)| c == most).unwrap().0;
    assert_eq!(probe(&job, MIDDLE).unwrap().unwrap().cell, first);
}

#[test]
fn what_is_nearer_than_the_near_plane_is_not_seen() {
    let mut job = along_x(4, |x| x as f32, &[(0.0, 1.0)], PERSPECTIVE);
    job.view.near = 4.0 + 2.3;
    let found = probe(&job, MIDDLE).unwrap().unwrap();
    assert!(found.depth >= job.view.near && found.position.x >= 2.3 - rounding(&job), "{found:?}");
    job.view.near = 9.0;
    assert_eq!(probe(&job, MIDDLE), Ok(None));
}

#[test]
fn from_inside_only_what_is_in_front_of_the_eye_is_seen() {
    let mut job = along_x(8, |x| x as f32, &[(0.0, 3.0)], PERSPECTIVE);
    job.view.eye.x = 3.4;
    let found = probe(&job, MIDDLE).unwrap().unwrap();
    assert!(found.position.x > 3.4 && found.position.x < 4.5, "{found:?}");
    job.view.forward = -job.view.forward;
    job.view.right = -job.view.right;
    let found = probe(&job, MIDDLE).unwrap().unwrap();
    assert!(found.position.x < 3.4 && found.position.x > 2.3, "{found:?}");
}

#[test]
fn cells_with_a_hole_are_not_there() {
    let job = along_x(4, |x| if x == 1.0 { f32::NAN } else { x as f32 }, &[(0.0, 1e6)], PARALLEL);
    let found = probe(&job, MIDDLE).unwrap().unwrap();
    assert!(found.position.x >= 2.0 - rounding(&job) && found.position.x < 2.1, "{found:?}");
    let none = along_x(4, |_| f32::NAN, &[(0.0, 1e6)], PARALLEL);
    assert_eq!(probe(&none, MIDDLE), Ok(None));
}

#[test]
fn where_nothing_is_to_be_seen_nothing_is_found() {
    let transparent = along_x(2, |x| x as f32, &[(5.0, 0.0), (6.0, 1.0)], PARALLEL);
    assert_eq!(probe(&transparent, MIDDLE), Ok(None), "no extinction");
    let job = along_x(2, |x| x as f32, &[(0.0, 1.0)], PARALLEL);
    assert!(probe(&job, MIDDLE).unwrap().is_some());
    assert_eq!(probe(&job, (0.5, 0.5)), Ok(None), "beside the mesh");
    for at_px in [(-1.0, 4.5), (4.5, 9.5), (f64::NAN, 4.5), (f64::INFINITY, 0.0)] {
        assert_eq!(probe(&job, at_px), Ok(None), "beside the image");
    }
    let other = RenderJob { scalars: Arc::new(vec![0.0; 3]).into(), ..job };
    assert!(probe(&other, MIDDLE).is_err());
}

#[test]
fn a_place_in_the_world_far_from_the_origin_costs_no_digits() {
    let near = along_x(3, |x| x as f32, &[(0.0, 2.0)], PERSPECTIVE);
    // A power of two times the coordinates' unit: the mesh is the same, bit for bit.
    let offset = DVec3::new(2f64.powi(40), -(2f64.powi(38)), 2f64.powi(39));
    let mut raw: RawMesh = kuhn_grid([3, 1, 1]);
    raw.points.iter_mut().for_each(|p| *p += offset);
    let (mesh, _) = Mesh::build(raw).unwrap();
    let mut far = RenderJob { mesh: Arc::new(mesh), ..near.clone() };
    assert_eq!(far.mesh.positions.local, near.mesh.positions.local);
    // The precision of the far eye's coordinates.
    far.view.eye = offset + DVec3::new(-4.0, 0.4375, 0.40625);
    let near = RenderJob { view: View { eye: far.view.eye - offset, ..near.view }, ..near };
    let [near, far] = [near, far].map(|job| probe(&job, (4.75, 4.25)).unwrap().unwrap());
    assert_eq!((near.cell, near.weights, near.scalar), (far.cell, far.weights, far.scalar));
    assert!((far.position - offset).distance(near.position) <= 2.0 * f64::EPSILON * 2f64.powi(40));
}

#[test]
fn four_equal_scalars_are_interpolated_to_themselves_and_a_hole_to_nothing() {
    let weights = [0.1, 0.2, 0.3, 0.4];
    for value in [0.1, f32::MAX, f32::MIN, f32::MIN_POSITIVE, -0.3] {
        assert_eq!(interpolate(weights, [value; 4]), f64::from(value));
    }
    assert!(interpolate([1.0, 0.0, 0.0, 0.0], [1.0, 2.0, 3.0, f32::NAN]).is_nan());
    assert!(interpolate([0.25; 4], [f32::INFINITY, 1.0, 1.0, f32::NEG_INFINITY]).is_nan());
    assert_eq!(interpolate([0.25; 4], [0.0, 1.0, 2.0, 3.0]), 1.5);
}

#[test]
fn half_of_the_opacity_is_found_in_ramps_of_any_strength() {
    let mut noticed = 0;
    for (from, to) in [(0.0, 1.0), (1.0, 0.0), (0.3, 0.7), (1.0, 1.0), (0.0, 1e300), (1e300, 0.0), (1e-300, 2e-300)] {
        for length in [1e-6, 1.0, 1e3] {
            let depth = (0.5 * from + 0.5 * to) * length;
            let place = half_absorbed(&[Piece { share: 1.0, from, to, depth }]);
            // Expected value by bisection.
            let absorbed = |u: f64| -(-(u * (from + 0.5 * (to - from) * u) * length)).exp_m1();
            let (mut lo, mut hi) = (0.0, 1.0);
            for _ in 0..2000 {
                let middle = 0.5 * (lo + hi);
                if absorbed(middle) < 0.5 * absorbed(1.0) { lo = middle } else { hi = middle }
            }
            // A few roundings of the position, twice as many where the ramp begins at zero and a root is taken.
            let bound = 32.0 * f64::EPSILON * lo.max(1e-3);
            assert!((place - lo).abs() <= bound, "{from} {to} {length}: {place} {lo}");
            let (first, last) = (from + 0.01 * to, to + 0.01 * from);
            let depth = (0.5 * first + 0.5 * last) * length;
            let other = half_absorbed(&[Piece { share: 1.0, from: first, to: last, depth }]);
            noticed += usize::from((other - lo).abs() > bound);
        }
    }
    // Ramps that are neither constant nor opaque at once.
    assert!(noticed > 10, "{noticed} of 21 other ramps noticed");
}

/// The job with surfaces of this style and opacity around sets of cells.
fn with_shells(job: &RenderJob, style: DomainStyle, shells: &[(&Arc<CellSet>, f64)]) -> RenderJob {
    let shell = |&(cells, opacity): &(&Arc<CellSet>, f64)| Shell {
        surface: DomainSurface { style, regions: None, color: None, opacity },
        cells: cells.clone(),
    };
    RenderJob { shells: shells.iter().map(shell).collect(), ..job.clone() }
}

#[test]
fn the_surface_of_the_domain_is_met_where_it_is_and_one_sees_through_it_as_far_as_it_lets_one() {
    let haze = [(0.0, 1e-3), (1.0, 1e-3)];
    for projection in [PARALLEL, PERSPECTIVE] {
        let job = along_x(3, |x| x as f32 / 3.0, &haze, projection);
        let found =
            |style, opacity| probe(&with_shells(&job, style, &[(&job.active, opacity)]), MIDDLE).unwrap().unwrap();
        // The eye is 4 before the first face, and the last face 3 behind that.
        assert!((found(DomainStyle::Solid, 1.0).depth - 4.0).abs() < rounding(&job));
        let translucent = found(DomainStyle::Solid, 0.3);
        assert!((translucent.depth - 4.0).abs() < rounding(&job), "of two that take as much, the nearer gives more");
        // Front and back take 0.3 and 0.3 of what is left; the haze between takes little.
        assert!((translucent.share - 0.3 / (0.3 + 0.7 * 0.3)).abs() < 1e-2, "{}", translucent.share);
        assert!(found(DomainStyle::Edges, 1.0).depth > 4.01, "one looks past lines");
    }
    let solid = |job: &RenderJob| {
        let job = with_shells(job, DomainStyle::Solid, &[(&job.active, 1.0)]);
        probe(&job, MIDDLE).unwrap().unwrap().depth
    };
    // A missing cell has an inner face.
    let mut job = along_x(3, |x| if x > 1.5 { x as f32 } else { f32::NAN }, &haze, PARALLEL);
    job.finite = None;
    assert!((solid(&job) - 6.0).abs() < rounding(&job), "{}", solid(&job));
    // From inside, the ray meets the face behind all cells.
    let mut inside = along_x(3, |x| x as f32 / 3.0, &haze, PERSPECTIVE);
    inside.view.eye.x = 1.3;
    assert!((solid(&inside) - 1.7).abs() < rounding(&inside), "{}", solid(&inside));
}

#[test]
fn surfaces_of_regions_are_met_also_around_cells_that_are_not_drawn_and_two_at_one_face_count_both() {
    let job = along_x(4, |x| x as f32 / 4.0, &[(0.0, 1e-6), (1.0, 1e-6)], PARALLEL);
    let mesh = job.mesh.clone();
    let middle = |cell: usize| mesh.positions.corners(mesh.topology.tets[cell]).iter().map(|p| p.x).sum::<f32>() / 4.0;
    let places: Vec<f32> = (0..mesh.topology.tets.len()).map(middle).collect();
    let (least, most) = places.iter().fold((f32::MAX, f32::MIN), |(lo, hi), &x| (lo.min(x), hi.max(x)));
    let slab = |from: f32, to: f32| {
        let share = |cell: usize| 4.0 * (places[cell] - least) / (most - least);
        Arc::new(CellSet::of(places.len(), |cell| (from..to).contains(&share(cell))))
    };
    let (left, right) = (slab(-1.0, 2.0), slab(2.0, 5.0));
    // The volume is that of the left half; the surface is that of the right one.
    let of_left = RenderJob { active: left.clone(), finite: None, ..job.clone() };
    let depth = |shells: &[(&Arc<CellSet>, f64)]| {
        let found = probe(&with_shells(&of_left, DomainStyle::Solid, shells), MIDDLE).unwrap().unwrap();
        (found.depth, found.share)
    };
    let (at, share) = depth(&[(&right, 0.5)]);
    assert!((at - 6.0).abs() < rounding(&job) && (share - 2.0 / 3.0).abs() < 1e-3, "{at}, {share}");
    // At the face between, 0.2 of the left one and then 0.5 of the right one, more than 0.2 at the first face.
    let (at, share) = depth(&[(&left, 0.2), (&right, 0.5)]);
    let [first, shared] = [0.2, 0.8 * 0.8 * 0.5];
    let total = 1.0 - 0.8 * 0.8 * 0.5 * 0.5;
    assert!(
        (at - 6.0).abs() < rounding(&job) && (share - shared / total).abs() < 1e-3 && shared > first,
        "{at}, {share}"
    );
}
