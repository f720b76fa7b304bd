//! Surfaces of known shape, and invariants of every surface: it is closed, has no triangle without area, and faces lower values.

use super::*;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid, kuhn_grid_of, shuffled};
use crate::mesh::{Mesh, RawMesh};
use proptest::prelude::*;
use std::collections::BTreeMap;

/// A mesh with a scalar.
struct Field {
    mesh: Mesh,
    points: Vec<DVec3>,
    values: Vec<f32>,
}

impl Field {
    fn new(raw: RawMesh, value: impl Fn(DVec3) -> f32) -> Self {
        let (mesh, _) = Mesh::build(raw.clone()).unwrap();
        let points: Vec<DVec3> = mesh.vertex_source.iter().map(|&v| raw.points[v as usize]).collect();
        Self { mesh, values: points.iter().map(|&p| value(p)).collect(), points }
    }

    fn with<T>(&self, work: impl FnOnce(Domain<'_>) -> T) -> T {
        let missing: Vec<bool> = self.values.iter().map(|v| !v.is_finite()).collect();
        work(Domain { topology: &self.mesh.topology, points: &self.points, missing: &missing, missing_cells: &[] })
    }

    fn contour(&self, value: f64) -> Surface {
        self.with(|domain| domain.contour(|v| f64::from(self.values[v as usize]), value))
    }

    fn boundary(&self) -> Surface {
        self.with(|domain| domain.boundary())
    }
}

/// A grid of `n` cubes along each axis on [-1, 1]^3.
fn cube(n: usize) -> RawMesh {
    let mut raw = kuhn_grid([n; 3]);
    raw.points.iter_mut().for_each(|p| *p = *p * (2.0 / n as f64) - 1.0);
    raw
}

/// Twice the area of a triangle times its normal.
fn normal(surface: &Surface, triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|i| surface.points[i as usize]);
    (b - a).cross(c - a)
}

fn area(surface: &Surface) -> f64 {
    surface.triangles.iter().map(|&t| 0.5 * normal(surface, t).length()).sum()
}

/// Volume enclosed by a closed surface with outward normals.
fn volume(surface: &Surface) -> f64 {
    let of = |t: &[u32; 3]| t.map(|i| surface.points[i as usize]);
    surface.triangles.iter().map(of).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// Number of triangles along each edge from its lower to its higher point, and back.
fn edges(surface: &Surface) -> BTreeMap<(u32, u32), [usize; 2]> {
    let mut edges: BTreeMap<(u32, u32), [usize; 2]> = BTreeMap::new();
    for [a, b, c] in &surface.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            edges.entry((*from.min(to), *from.max(to))).or_default()[usize::from(from > to)] += 1;
        }
    }
    edges
}

/// Vertices - edges + triangles.
fn euler(surface: &Surface) -> i64 {
    [surface.points.len(), surface.triangles.len()].iter().sum::<usize>() as i64 - edges(surface).len() as i64
}

/// Faces of the mesh, by their ascending vertices, on the outside or beside a hole.
fn rim(field: &Field) -> std::collections::BTreeSet<[u32; 3]> {
    let boundary = field.boundary();
    let face = |t: &[u32; 3]| {
        let mut face = t.map(|i| boundary.crossings[i as usize].low);
        face.sort_unstable();
        face
    };
    boundary.triangles.iter().map(face).collect()
}

/// The vertices of the mesh that an edge of the surface touches: those of a face if it lies in one.
fn touched(surface: &Surface, (a, b): (u32, u32)) -> Vec<u32> {
    let ends = [a, b].map(|i| surface.crossings[i as usize]);
    let mut all: Vec<u32> = ends.iter().flat_map(|c| [c.low, c.high]).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Checks the invariants of a field's surface. Returns the number of edges with more than two triangles.
fn check(field: &Field, surface: &Surface) -> Result<usize, TestCaseError> {
    let rim = rim(field);
    let on_rim = |touched: &[u32]| rim.iter().any(|face| touched.iter().all(|v| face.contains(v)));
    let mut crowded = 0;
    for (edge, [there, back]) in edges(surface) {
        let touched = touched(surface, edge);
        if on_rim(&touched) {
            continue;
        }
        prop_assert_eq!(there, back, "edge {:?} of {:?}", edge, &touched);
        prop_assert!(there == 1 || touched.len() == 2, "{} triangles at {:?}", there + back, &touched);
        crowded += usize::from(there > 1);
    }
    let mut used = vec![false; surface.points.len()];
    for &triangle in &surface.triangles {
        prop_assert!(normal(surface, triangle).length() > 0.0);
        triangle.iter().for_each(|&i| used[i as usize] = true);
    }
    prop_assert!(used.iter().all(|&used| used));
    Ok(crowded)
}

#[test]
fn a_sphere_has_its_area_and_volume_to_second_order_and_is_one_closed_piece() {
    let (mut areas, mut volumes) = (Vec::new(), Vec::new());
    for n in [8, 16, 32] {
        let sphere = Field::new(cube(n), |p| p.length() as f32);
        let surface = sphere.contour(0.7);
        assert_eq!(euler(&surface), 2);
        assert!(edges(&surface).values().all(|sides| *sides == [1, 1]));
        assert_eq!(check(&sphere, &surface).unwrap(), 0);
        // Values grow outward, so normals point inward.
        for &t in &surface.triangles {
            let centre = t.iter().map(|&i| surface.points[i as usize]).sum::<DVec3>();
            assert!(normal(&surface, t).dot(centre) < 0.0);
        }
        let exact = 4.0 * std::f64::consts::PI * 0.7 * 0.7;
        areas.push((area(&surface) / exact - 1.0).abs());
        volumes.push((-volume(&surface) / (exact * 0.7 / 3.0) - 1.0).abs());
    }
    for errors in [&areas, &volumes] {
        assert!(errors[2] < 4e-3, "{errors:?}");
        assert!(errors.windows(2).all(|e| e[0] / e[1] > 3.5 && e[0] / e[1] < 4.5), "{errors:?}");
    }
}

#[test]
fn every_case_of_a_single_cell_faces_lower_values_and_halves_the_edges() {
    let raw = RawMesh { points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], cells: vec![[0, 1, 2, 3]].into() };
    for mask in 0..16_u32 {
        let is_above = |p: DVec3| mask >> (p.dot(DVec3::new(1.0, 2.0, 3.0)) as u32) & 1 == 1;
        let field = Field::new(raw.clone(), |p| if is_above(p) { 1.0 } else { -1.0 });
        let surface = field.contour(0.0);
        assert_eq!(surface.triangles.len(), [0, 1, 2, 1, 0][mask.count_ones() as usize], "{mask:04b}");
        assert!(surface.crossings.iter().all(|c| c.t == 0.5 && c.low < c.high));
        for &t in &surface.triangles {
            let above = raw.points.iter().find(|&&p| is_above(p)).unwrap();
            assert!(normal(&surface, t).dot(*above - surface.points[t[0] as usize]) < 0.0, "{mask:04b}");
        }
    }
}

#[test]
fn a_plane_through_vertices_is_cut_once_with_whole_triangles() {
    let field = Field::new(cube(4), |p| p.z as f32);
    let middle = field.contour(0.0);
    // Some of the cells above have only an edge in the plane.
    assert_eq!((middle.triangles.len(), middle.points.len(), area(&middle)), (2 * 16, 25, 4.0));
    assert!(middle.crossings.iter().all(|c| c.low == c.high) && middle.points.iter().all(|p| p.z == 0.0));
    assert!(middle.triangles.iter().all(|&t| normal(&middle, t).z < 0.0));
    assert!(middle.dropped > 0);
    assert_eq!(check(&field, &middle).unwrap(), 0);
    // Values equal to the isovalue count as above: there is a surface at the top, and none at the bottom.
    assert_eq!((area(&field.contour(1.0)), field.contour(-1.0)), (4.0, Surface::default()));
    let distances: Vec<f64> = field.points.iter().map(|p| p.z).collect();
    assert_eq!(field.with(|domain| domain.section(&distances)), middle);
}

#[test]
fn a_region_that_has_the_value_shows_its_border_to_lower_values_only() {
    let field = Field::new(cube(4), |p| p.x.max(0.0) as f32);
    assert_eq!(field.contour(0.0), Surface::default(), "nothing is lower");
    let field = Field::new(cube(4), |p| p.x.min(0.0) as f32);
    assert_eq!((area(&field.contour(0.0)), field.contour(0.0).triangles.len()), (4.0, 32));
    let constant = Field::new(cube(2), |_| 3.0);
    for value in [2.0, 3.0, 4.0] {
        assert_eq!(constant.contour(value), Surface::default());
    }
}

#[test]
fn the_boundary_is_closed_faces_outward_and_goes_around_holes() {
    let whole = Field::new(cube(4), |p| p.x as f32);
    let boundary = whole.boundary();
    assert_eq!((boundary.triangles.len(), area(&boundary)), (6 * 2 * 16, 24.0));
    assert!((volume(&boundary) - 8.0).abs() < 1e-12);
    assert_eq!(euler(&boundary), 2);
    // A vertex without a finite value removes the 24 cells around it.
    for gone in [f32::NAN, f32::INFINITY] {
        let holed = Field::new(cube(4), |p| if p == DVec3::ZERO { gone } else { p.x as f32 });
        let boundary = holed.boundary();
        assert_eq!(boundary.triangles.len(), 6 * 2 * 16 + 24);
        assert!((volume(&boundary) - (8.0 - 24.0 * 0.125 / 6.0)).abs() < 1e-12);
        assert_eq!(euler(&boundary), 4, "two closed pieces");
        assert!(edges(&boundary).values().all(|sides| *sides == [1, 1]));
        let surface = holed.contour(-0.1);
        assert!(area(&surface) < 4.0 && surface.points.iter().all(|p| p.is_finite()));
    }
    let nothing = Field::new(cube(2), |_| f32::NAN);
    assert_eq!((nothing.boundary(), nothing.contour(0.0)), (Surface::default(), Surface::default()));
}

#[test]
fn a_mesh_far_away_has_the_surface_that_it_has_nearby() {
    let offset = DVec3::new(1e9, -1e9, 1e9);
    // Multiples of 1/16: adding them to 1e9 is exact.
    let far = |p: DVec3| p + offset;
    let mut raw = cube(16);
    let near = Field::new(raw.clone(), |p| p.length() as f32);
    raw.points.iter_mut().for_each(|p| *p = far(*p));
    let (near, away) = (near.contour(0.7), Field::new(raw, |p| (p - offset).length() as f32).contour(0.7));
    assert_eq!(near.triangles.len(), away.triangles.len());
    assert!((area(&near) - area(&away)).abs() < 1e-6 * area(&near));
    for (a, b) in near.points.iter().zip(&away.points) {
        // Half a unit in the last place of 1e9 on each axis.
        assert!((far(*a) - b).abs().max_element() <= 1.2e-7, "{a} {b}");
    }
}

#[test]
fn an_edge_longer_than_the_largest_number_is_cut() {
    let raw = RawMesh {
        points: [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| (2.0 * p - 1.0) * 2_f64.powi(1023)).to_vec(),
        cells: vec![[0, 1, 2, 3]].into(),
    };
    let surface = Field::new(raw, |p| if p.x > 0.0 { 1.0 } else { 0.0 }).contour(0.5);
    assert_eq!(surface.triangles.len(), 1);
    assert!(surface.points.iter().all(|p| p.is_finite() && p.x.abs() < 1e300));
}

#[test]
fn values_that_are_almost_that_of_the_surface_make_no_needles() {
    // The crossing rounds to the vertex in f64.
    let field = Field::new(cube(4), |p| if p == DVec3::splat(0.5) { 1e-30 } else { -1.0 });
    let surface = field.contour(0.0);
    assert_eq!((surface.triangles.len(), surface.dropped), (0, 24));
    let field = Field::new(cube(4), |p| if p == DVec3::splat(0.5) { -1e-30 } else { 1.0 });
    assert_eq!((field.contour(0.0).triangles.len(), field.contour(0.0).dropped), (0, 24));
}

#[test]
fn fields_are_interpolated_between_the_ends_of_an_edge() {
    let field = Field::new(cube(8), |p| p.length() as f32);
    let surface = field.contour(0.7);
    let mut values = Vec::new();
    surface.interpolate(&field.points.iter().map(|p| p.x as f32).collect::<Vec<_>>(), &mut values);
    assert!(values.iter().zip(&surface.points).all(|(x, p)| (f64::from(*x) - p.x).abs() < 1e-6));
    surface.interpolate(&field.values, &mut values);
    assert!(values.iter().all(|v| (v - 0.7).abs() < 1e-6));
    let odd = Crossing { low: 0, high: 1, t: 0.25 };
    assert_eq!((odd.value(&[0.3, 0.3]), odd.value(&[f32::MIN, f32::MAX])), (0.3, -0.5 * f32::MAX));
    assert_eq!(Crossing { low: 1, high: 1, t: 0.0 }.value(&[0.0, -0.0]).to_bits(), (-0.0_f32).to_bits());
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let mut random = Random::new(7);
    let (raw, _) = shuffled(&kuhn_grid([24, 20, 18]), &mut random);
    let field = Field::new(raw, |p| (p.x * 0.3).sin() as f32 + (p.y * p.z * 0.02).cos() as f32);
    let one = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (field.contour(0.25), field.boundary()))
    };
    let (contour, boundary) = one(1);
    assert!(contour.triangles.len() > 1000 && boundary.triangles.len() > 1000);
    assert_eq!(one(5), (contour, boundary));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn surfaces_of_random_scalars_are_closed_without_triangles_of_no_area(
        seed in any::<u64>(),
        n in prop::array::uniform3(1_usize..4),
        values in prop::sample::select(vec![2, 3, 5, 1 << 20]),
        has_holes in any::<bool>(),
    ) {
        let mut random = Random::new(seed);
        let raw = jittered(kuhn_grid_of(n, |[x, y, z]| (x + 2 * y + 3 * z) % 5 != 4 || x == 0), &mut random);
        let (raw, _) = shuffled(&raw, &mut random);
        let drawn: Vec<f32> = raw.points.iter().map(|_| random.below(values) as f32).collect();
        let mut field = Field::new(raw, |_| 0.0);
        for (value, drawn) in field.values.iter_mut().zip(drawn) {
            *value = if has_holes && random.below(12) == 0 { f32::NAN } else { drawn };
        }
        // All values that occur, which makes ties, and one in between.
        let tie = random.below(values) as f64;
        for value in [tie, tie + 0.5] {
            let surface = field.contour(value);
            let crowded = check(&field, &surface)?;
            prop_assert!(crowded == 0 || value == tie);
            for (crossing, point) in surface.crossings.iter().zip(&surface.points) {
                let [a, b] = [crossing.low, crossing.high].map(|v| field.points[v as usize]);
                prop_assert!(point.cmpge(a.min(b)).all() && point.cmple(a.max(b)).all());
            }
        }
        let boundary = field.boundary();
        prop_assert!(edges(&boundary).values().all(|[there, back]| there == back));
    }
}
