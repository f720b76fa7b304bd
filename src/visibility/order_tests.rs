//! The depth order against a plain sort, and which requests need no sort.

use super::radix::RadixSort;
use super::*;
use crate::mesh::test_meshes::kuhn_grid;
use crate::mesh::{Mesh, RawMesh};
use crate::task::Cancel;
use glam::DVec3;
use proptest::prelude::*;
use std::sync::Arc;

/// Many faces of a grid have the same depth.
fn grid(n: [usize; 3]) -> Arc<Mesh> {
    Arc::new(Mesh::build(kuhn_grid(n)).unwrap().0)
}

fn whole(mesh: &Mesh) -> Arc<Selection> {
    some(mesh, |_| true)
}

fn some(mesh: &Mesh, is_in: impl Fn(u32) -> bool + Sync) -> Arc<Selection> {
    let faces = IdSet::of(mesh.topology.connectivity().faces.len(), |face| is_in(face as u32));
    let is_complete = faces.count() == faces.universe();
    Arc::new(Selection { ids: faces, is_complete })
}

/// Oracle: a stable sort by the depth of the centroid.
fn naive(mesh: &Mesh, direction: DVec3, selection: &Selection) -> Vec<u32> {
    let depth: Vec<f32> = mesh.positions.local.iter().map(|p| direction.dot(p.as_dvec3()) as f32).collect();
    let key = |face: u32| {
        let [a, b, c] = mesh.topology.connectivity().faces[face as usize].map(|v| depth[v as usize]);
        a + b + c
    };
    let mut faces: Vec<u32> =
        (0..selection.ids.universe() as u32).filter(|&face| selection.ids.contains(face)).collect();
    // The standard library's sort is stable; +0 and -0 compare equal.
    faces.sort_by(|&a, &b| key(a).partial_cmp(&key(b)).unwrap());
    faces
}

fn order(of: &mut DepthOrder, mesh: &Arc<Mesh>, direction: DVec3, selection: &Arc<Selection>) -> Arc<Drawn> {
    of.order(mesh, direction, selection, &Cancel::new()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn faces_come_in_the_order_of_a_stable_sort_by_depth(
        // One bucket to several, and more than one chunk.
        n in prop::sample::select(vec![[1, 1, 1], [3, 2, 2], [9, 9, 9], [20, 20, 20]]),
        direction in prop::array::uniform3(prop::sample::select(vec![-1.0, -0.3, 0.0, 0.5, 1.0])),
        keep in 1_u32..5, parts in prop::collection::vec(2_u32..9, 3),
    ) {
        let mesh = grid(n);
        let direction = DVec3::from_array(direction);
        let mut depth_order = DepthOrder::default();
        let selection = some(&mesh, |face| face % 5 < keep);
        let drawn = order(&mut depth_order, &mesh, direction, &selection);
        prop_assert_eq!(&drawn.ids, &naive(&mesh, direction, &selection));
        prop_assert_eq!(drawn.is_complete, selection.is_complete);
        // Filtered from the sorted faces, or sorted anew.
        for part in parts {
            let part = some(&mesh, |face| face % part != 1);
            prop_assert_eq!(&order(&mut depth_order, &mesh, direction, &part).ids, &naive(&mesh, direction, &part));
        }
        prop_assert!(depth_order.sorts() <= 2, "at most twice for a direction");
        // The comparison detects another direction.
        if direction != DVec3::ZERO {
            let other = order(&mut depth_order, &mesh, -direction, &selection);
            prop_assert_ne!(&other.ids, &drawn.ids);
        }
    }
}

#[test]
fn the_order_is_the_same_with_any_number_of_threads() {
    let mesh = grid([24, 24, 24]);
    assert!(mesh.topology.connectivity().faces.len() > 2 * super::parts::CHUNK, "several chunks");
    let direction = DVec3::new(0.3, -0.7, 0.6);
    let part = some(&mesh, |face| face % 3 != 0);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut depth_order = DepthOrder::default();
            let all = order(&mut depth_order, &mesh, direction, &whole(&mesh));
            (all, order(&mut depth_order, &mesh, direction, &part))
        })
    };
    let one = run(1);
    assert_eq!(one.0.ids, naive(&mesh, direction, &whole(&mesh)));
    for threads in 2..=4 {
        assert_eq!(run(threads), one, "{threads} threads");
    }
}

#[test]
fn faces_that_all_lie_in_one_bucket_are_sorted_too() {
    // One distant point stretches the range, so that all others lie in a thousandth of it.
    let mut raw = RawMesh::default();
    let mesh = grid([24, 24, 24]);
    raw.points = (0..mesh.positions.local.len()).map(|v| mesh.positions.world(v)).collect();
    raw.cells.tets = mesh.topology.tets.clone();
    raw.points.push(DVec3::new(1e5, 1.0, 2.0));
    let last = raw.points.len() as u32 - 1;
    let far = raw.cells.tets[0];
    raw.cells.tets.push([far[0], far[1], far[2], last]);
    let mesh = Arc::new(Mesh::build(raw).unwrap().0);
    let mut depth_order = DepthOrder::default();
    let drawn = order(&mut depth_order, &mesh, DVec3::X, &whole(&mesh));
    assert_eq!(drawn.ids, naive(&mesh, DVec3::X, &whole(&mesh)));
}

#[test]
fn nothing_is_sorted_again_for_the_same_mesh_direction_and_faces() {
    let mesh = grid([3, 3, 3]);
    let mut depth_order = DepthOrder::default();
    let all = whole(&mesh);
    let first = order(&mut depth_order, &mesh, DVec3::X, &all);
    let again = order(&mut depth_order, &mesh, DVec3::X, &Arc::new((*all).clone()));
    assert!(Arc::ptr_eq(&first, &again), "the same list, in the same place");
    assert_eq!((depth_order.sorts(), depth_order.sorts_skipped()), (1, 1));
    // Each of these requires a sort.
    order(&mut depth_order, &mesh, DVec3::Y, &all);
    assert_eq!((depth_order.sorts(), depth_order.sorts_skipped()), (2, 1));
    let other = Arc::new((*mesh).clone());
    order(&mut depth_order, &other, DVec3::Y, &all);
    assert_eq!((depth_order.sorts(), depth_order.sorts_skipped()), (3, 1));
}

#[test]
fn active_cells_that_change_cause_one_more_sort_for_a_direction() {
    let mesh = grid([3, 3, 3]);
    let mut depth_order = DepthOrder::default();
    for step in 2..12 {
        let selection = some(&mesh, |face| face % step != 0);
        let drawn = order(&mut depth_order, &mesh, DVec3::NEG_Z, &selection);
        assert_eq!(drawn.ids, naive(&mesh, DVec3::NEG_Z, &selection));
    }
    assert_eq!((depth_order.sorts(), depth_order.sorts_skipped()), (2, 8));
}

#[test]
fn a_level_of_detail_sorts_its_faces_and_then_all_for_one_direction() {
    let mesh = grid([3, 3, 3]);
    let mut depth_order = DepthOrder::default();
    let level = |keep: u32| some(&mesh, |face| face % 10 < keep);
    order(&mut depth_order, &mesh, DVec3::X, &level(5));
    assert_eq!(depth_order.scope.count(), level(5).ids.count(), "the time is linear in what is drawn");
    order(&mut depth_order, &mesh, DVec3::X, &level(3));
    assert_eq!(depth_order.sorts(), 1, "fewer are filtered");
    for keep in [6, 8, 10] {
        order(&mut depth_order, &mesh, DVec3::X, &level(keep));
    }
    assert_eq!(depth_order.sorts(), 2, "with more, all are sorted once");
}

#[test]
fn memory_goes_round_unless_somebody_holds_it() {
    let mesh = grid([3, 3, 3]);
    let mut depth_order = DepthOrder::default();
    let held = order(&mut depth_order, &mesh, DVec3::X, &whole(&mesh));
    let copy = (*held).clone();
    let places: std::collections::BTreeSet<usize> = (1..100)
        .map(|i| {
            let direction = DVec3::new(1.0, f64::from(i), 0.0);
            order(&mut depth_order, &mesh, direction, &whole(&mesh)).ids.as_ptr() as usize
        })
        .collect();
    assert!(places.len() <= 2, "{} buffers for one list after the other", places.len());
    assert_eq!(*held, copy);
}

#[test]
fn a_cancelled_order_is_none_and_the_next_one_is_right() {
    let mesh = grid([3, 3, 3]);
    let mut depth_order = DepthOrder::default();
    let cancel = Cancel::new();
    cancel.cancel();
    assert_eq!(depth_order.order(&mesh, DVec3::X, &whole(&mesh), &cancel), None);
    let drawn = order(&mut depth_order, &mesh, DVec3::X, &whole(&mesh));
    assert_eq!(drawn.ids, naive(&mesh, DVec3::X, &whole(&mesh)));
    assert_eq!((depth_order.sorts(), depth_order.sorts_skipped()), (1, 0));
}

/// Depths from the whole range of f32, many of them equal.
fn depths() -> impl Strategy<Value = f32> {
    let extremes = vec![
        f32::NEG_INFINITY,
        f32::MIN,
        -1.0,
        -1e-45,
        -0.0,
        0.0,
        1e-45,
        f32::MIN_POSITIVE,
        1.0,
        f32::MAX,
        f32::INFINITY,
    ];
    prop_oneof![prop::sample::select(extremes), -1.0..1.0_f32, (-3..3_i8).prop_map(f32::from), prop::num::f32::NORMAL]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn depths_are_sorted_as_the_standard_library_sorts_them(
        depths in prop::collection::vec(depths(), 0..3000),
        // The given range of the depths may be wrong.
        range in prop::sample::select(vec![[-1.0, 1.0], [0.0, 0.0], [f32::MIN, f32::MAX], [f32::INFINITY, f32::NEG_INFINITY]]),
        copies in 1_usize..4,
    ) {
        let depths = depths.repeat(copies);
        let mut expected: Vec<u32> = (0..depths.len() as u32).rev().collect();
        expected.sort_by(|&a, &b| depths[a as usize].partial_cmp(&depths[b as usize]).unwrap());
        let mut sort = RadixSort::default();
        let (last, key) = (depths.len(), |id: u32| depths[id as usize]);
        sort.sort(depths.len(), |at| (last - 1 - at) as u32, key, range, &Cancel::new()).unwrap();
        prop_assert_eq!(sort.sorted(), &expected);
        // Another order of equal depths is detected.
        if depths.windows(2).any(|pair| pair[0] == pair[1]) {
            sort.sort(depths.len(), |at| at as u32, key, range, &Cancel::new()).unwrap();
            prop_assert_ne!(sort.sorted(), &expected);
        }
    }
}

#[test]
fn no_face_is_an_order_too() {
    let mesh = grid([1, 1, 1]);
    let mut depth_order = DepthOrder::default();
    assert!(order(&mut depth_order, &mesh, DVec3::X, &some(&mesh, |_| false)).ids.is_empty());
}

#[test]
fn bits_ascend_as_numbers_do() {
    let numbers = [f32::NEG_INFINITY, f32::MIN, -1.0, -1e-45, -0.0, 0.0, 1e-45, 1.0, f32::MAX, f32::INFINITY, f32::NAN];
    assert!(numbers.is_sorted_by(|&a, &b| ascending_bits(a) < ascending_bits(b)));
}
