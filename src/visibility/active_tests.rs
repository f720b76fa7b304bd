use super::*;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid, kuhn_grid_of};
use crate::node_table::{Node, NodeTable};
use proptest::prelude::*;

fn table(nodes: &[(f64, f64)]) -> NodeTable {
    NodeTable::new(nodes.iter().map(|&(scalar, tau)| Node { scalar, rgb: [0.5; 3], tau }).collect()).unwrap()
}

/// Random tents and steps, with gaps between them.
fn random_table(random: &mut Random) -> NodeTable {
    let mut nodes = vec![(-2.0, 0.0)];
    let mut at = -1.0;
    while at < 1.0 {
        let width = 0.3 * (0.5 + 0.5 * random.signed()) + 1e-4;
        let foot = if random.below(2) == 0 { 0.0 } else { 1.0 };
        nodes.extend([(at, 0.0), (at, foot), (at + width, 1.0), (at + 2.0 * width, 0.0)]);
        at += 2.0 * width + 0.4 * (1.0 + random.signed());
    }
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for node in nodes {
        if kept.len() < 2 || kept[kept.len() - 2].0 < node.0 {
            kept.push(node);
        }
    }
    table(&kept)
}

/// Oracle: classifies cell by cell from scalar ranges.
fn naive(mesh: &Mesh, scalars: &[f32], table: Option<&NodeTable>) -> CellSet {
    CellSet::of(mesh.topology.tets.len(), |cell| {
        let s = mesh.topology.tets[cell].map(|v| scalars[v as usize]);
        let (lo, hi) = s.iter().fold((f32::MAX, f32::MIN), |(lo, hi), &s| (lo.min(s), hi.max(s)));
        s.iter().all(|s| s.is_finite()) && table.is_none_or(|t| t.is_visible_in(f64::from(lo), f64::from(hi)))
    })
}

/// Several chunks and clusters: 32 x 32 x 32 cubes are 196,608 cells and 35,937 vertices.
fn large_mesh() -> Arc<Mesh> {
    Arc::new(Mesh::build(jittered(kuhn_grid([32, 32, 32]), &mut Random::new(3))).unwrap().0)
}

/// A bump that moves along the diagonal of the box, flat far from its middle.
fn wave(mesh: &Mesh, time: f64) -> Arc<Vec<f32>> {
    let at = |v| mesh.positions.world(v);
    let value = |v| (2.0 * (-(at(v) - time).length_squared() / 9.0).exp() - 1.0).max(-0.99) as f32;
    Arc::new((0..mesh.positions.local.len()).map(value).collect())
}

/// A scalar that is constant nowhere.
fn slope(mesh: &Mesh) -> Arc<Vec<f32>> {
    Arc::new(mesh.positions.local.iter().map(|p| p.x + 0.5 * p.y + 0.25 * p.z).collect())
}

fn clusters(mesh: &Mesh) -> Arc<Clusters> {
    Arc::new(Clusters::new(mesh))
}

fn update(cells: &mut ActiveCells, mesh: &Arc<Mesh>, scalars: &Arc<Vec<f32>>, table: &NodeTable) -> Activity {
    let transparent = Arc::new(TransparentIntervals::of(table));
    cells.update(mesh, &clusters(mesh), &scalars.clone().into(), (&transparent, &[]), false, &Cancel::new()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn sets_are_those_found_cell_by_cell_whatever_came_before(seed in any::<u64>()) {
        let random = &mut Random::new(seed);
        let keep = random.next();
        let mesh = kuhn_grid_of([9, 9, 9], |c| keep >> ((c[0] + 2 * c[1] + 5 * c[2]) % 64) & 3 != 0);
        let mesh = Arc::new(Mesh::build(jittered(mesh, random)).unwrap().0);
        let mut cells = ActiveCells::default();
        let mut scalars = Arc::new(Vec::new());
        let mut table = random_table(random);
        for frame in 0..8 {
            if frame == 0 || random.below(3) > 0 {
                let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
                let value = |random: &mut Random| match random.below(60) {
                    hole @ 0..3 => bad[hole],
                    3..20 => 0.25,
                    _ => random.signed() as f32,
                };
                scalars = Arc::new((0..mesh.positions.local.len()).map(|_| value(random)).collect());
            }
            if random.below(3) == 0 {
                table = random_table(random);
            }
            let found = update(&mut cells, &mesh, &scalars, &table);
            prop_assert!(*found.active == naive(&mesh, &scalars, Some(&table)), "frame {}", frame);
            prop_assert!(*found.finite == naive(&mesh, &scalars, None), "frame {}", frame);
            // A single differing cell is detected.
            let mut other = (*found.active).clone();
            let cell = random.below(mesh.topology.tets.len()) as u32;
            other.set(cell, !other.contains(cell));
            prop_assert!(other != naive(&mesh, &scalars, Some(&table)));
        }
    }
}

/// Oracle: classifies cell by cell from labels.
fn by_label(mesh: &Mesh, scalars: &[f32], transparent: &TransparentIntervals) -> CellSet {
    CellSet::of(mesh.topology.tets.len(), |cell| {
        let labels = mesh.topology.tets[cell].map(|v| transparent.label(scalars[v as usize]));
        !labels.contains(&HOLE) && (labels[0] == VISIBLE || labels.iter().any(|&label| label != labels[0]))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn isovalues_that_move_over_the_same_scalars_change_the_cells_that_they_should(seed in any::<u64>()) {
        let random = &mut Random::new(seed);
        let mesh = Arc::new(Mesh::build(jittered(kuhn_grid([12, 9, 9]), random)).unwrap().0);
        let clusters = clusters(&mesh);
        let mut cells = ActiveCells::default();
        // Few distinct values, among them zeros of both signs and isovalues.
        let places = [-1.0, -0.5, -0.0, 0.0, 0.25, 0.5, 1.0, f32::MIN, f32::MAX];
        let value = |random: &mut Random| match random.below(50) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2..25 => places[random.below(places.len())],
            _ => random.signed() as f32,
        };
        for _ in 0..3 {
            let holes = random.below(2) == 0;
            let some = |random: &mut Random| Some(value(random)).filter(|v| holes || v.is_finite()).unwrap_or(0.5);
            let scalars: Arc<Vec<f32>> = Arc::new((0..mesh.positions.local.len()).map(|_| some(random)).collect());
            let mut table = random_table(random);
            for _ in 0..6 {
                if random.below(4) == 0 {
                    table = if random.below(2) == 0 { random_table(random) } else { NodeTable::transparent() };
                }
                let isovalues: Vec<f64> = (0..random.below(4)).map(|_| {
                    if random.below(2) == 0 { f64::from(places[random.below(7)]) } else { random.signed() }
                }).collect();
                let transparent = Arc::new(TransparentIntervals::of(&table).cut_at(&isovalues));
                let found = cells.update(&mesh, &clusters, &scalars.clone().into(), (&transparent, &[]), false, &Cancel::new()).unwrap();
                prop_assert!(*found.active == by_label(&mesh, &scalars, &transparent));
                prop_assert!(*found.finite == naive(&mesh, &scalars, None));
            }
        }
    }
}

#[test]
fn an_isovalue_that_moves_costs_the_cells_near_it() {
    let mesh = large_mesh();
    let (scalars, clusters) = (slope(&mesh), clusters(&mesh));
    let nowhere = TransparentIntervals::of(&NodeTable::transparent());
    let mut cells = ActiveCells::default();
    let mut update = |isovalue: f64| {
        let transparent = Arc::new(nowhere.cut_at(&[isovalue]));
        let found = cells
            .update(&mesh, &clusters, &scalars.clone().into(), (&transparent, &[]), false, &Cancel::new())
            .unwrap();
        assert_eq!(*found.active, by_label(&mesh, &scalars, &transparent));
        found.classified
    };
    let first = update(0.3);
    for isovalue in [0.31, 0.3, 0.28] {
        let classified = update(isovalue);
        assert!(classified > 0 && classified < first / 3, "{isovalue}: {classified}, and {first} at first");
    }
}

#[test]
fn only_clusters_in_which_something_changed_are_looked_at_again() {
    let (mesh, tent) = (large_mesh(), table(&[(0.5, 0.0), (0.8, 1.0), (0.9, 0.0)]));
    let mut cells = ActiveCells::default();
    let total = mesh.topology.tets.len() as u64;
    let first = update(&mut cells, &mesh, &wave(&mesh, 8.0), &tent);
    assert!(first.classified > 0 && first.classified < total, "{} of {total}", first.classified);
    // Equal values at another address.
    let again = update(&mut cells, &mesh, &wave(&mesh, 8.0), &tent);
    assert_eq!(again.classified, 0);
    assert!(Arc::ptr_eq(&first.active, &again.active));
    // A small step in time, a large one, and another table.
    for (time, table) in [(8.5, &tent), (24.0, &tent), (24.0, &table(&[(0.2, 0.0), (0.8, 1.0), (0.9, 0.0)]))] {
        let moved = update(&mut cells, &mesh, &wave(&mesh, time), table);
        assert!(moved.classified > 0 && moved.classified < total, "{} of {total}", moved.classified);
        assert_eq!(*moved.active, naive(&mesh, &wave(&mesh, time), Some(table)));
    }
    // Nothing is reused if `forget` is set.
    let scalars = wave(&mesh, 24.0);
    let transparent = Arc::new(TransparentIntervals::of(&tent));
    let fresh = cells
        .update(&mesh, &clusters(&mesh), &scalars.clone().into(), (&transparent, &[]), true, &Cancel::new())
        .unwrap();
    assert!(fresh.classified > 0);
    assert_eq!(*fresh.active, naive(&mesh, &scalars, Some(&tent)));
}

#[test]
fn scalars_in_the_same_place_with_the_same_table_are_not_looked_at() {
    let (mesh, tent) = (large_mesh(), table(&[(0.5, 0.0), (0.8, 1.0), (0.9, 0.0)]));
    let mut cells = ActiveCells::default();
    let scalars = wave(&mesh, 8.0);
    let first = update(&mut cells, &mesh, &scalars, &tent);
    let again = update(&mut cells, &mesh, &scalars, &tent);
    assert!(Arc::ptr_eq(&first.active, &again.active) && again.classified == 0);
    // A table with other colours and the same transparent intervals.
    let nodes = tent.nodes().iter().map(|n| Node { rgb: [0.1; 3], tau: 2.0 * n.tau, ..*n }).collect();
    let recoloured = update(&mut cells, &mesh, &scalars, &NodeTable::new(nodes).unwrap());
    assert!(Arc::ptr_eq(&first.active, &recoloured.active) && recoloured.classified == 0);
}

#[test]
fn a_table_without_clear_scalars_leaves_the_finite_cells_as_they_are() {
    let mesh = large_mesh();
    let mut cells = ActiveCells::default();
    let dense = table(&[(0.0, 1.0)]);
    let found = update(&mut cells, &mesh, &wave(&mesh, 8.0), &dense);
    assert!(Arc::ptr_eq(&found.finite, &found.active));
    assert_eq!((found.classified, found.active.count()), (0, mesh.topology.tets.len()));
    // The set of all cells keeps its address.
    let next = update(&mut cells, &mesh, &wave(&mesh, 9.0), &dense);
    assert!(Arc::ptr_eq(&found.active, &next.active));
}

#[test]
fn chunks_whose_label_is_known_are_not_looked_at() {
    let (mesh, tent) = (large_mesh(), table(&[(0.5, 0.0), (0.8, 1.0), (0.9, 0.0)]));
    let (transparent, whole) = (Arc::new(TransparentIntervals::of(&tent)), wave(&mesh, 8.0));
    let range = |s: &[f32]| s.iter().fold((f32::MAX, f32::MIN), |(lo, hi), &s| (lo.min(s), hi.max(s)));
    let labels: Vec<_> =
        whole.chunks(Clusters::VERTICES).map(range).map(|(lo, hi)| transparent.label_of_range(lo, hi)).collect();
    let mut cells = ActiveCells::default();
    let needed = clusters(&mesh).needed_scalars(&labels);
    let left_out = needed.iter().filter(|&&needed| !needed).count();
    // Cells on both sides of every chunk that is left out are transparent as well.
    assert!(left_out > 0 && left_out < needed.len(), "{needed:?} of {labels:?}");
    // Scalars that are not needed may have any value.
    let mut partial = (*whole).clone();
    for (chunk, scalars) in partial.chunks_mut(Clusters::VERTICES).enumerate() {
        if !needed[chunk] {
            scalars.fill(0.8);
        }
    }
    let known: Vec<_> = labels.iter().zip(&needed).map(|(&label, &needed)| label.filter(|_| !needed)).collect();
    let found = cells
        .update(&mesh, &clusters(&mesh), &Arc::new(partial).into(), (&transparent, &known), false, &Cancel::new())
        .unwrap();
    assert_eq!(*found.active, naive(&mesh, &whole, Some(&tent)));
}

#[test]
fn an_isovalue_moves_over_chunks_that_are_known_by_their_least_scalar() {
    let mesh = large_mesh();
    let (whole, clusters) = (slope(&mesh), clusters(&mesh));
    let range = |s: &[f32]| s.iter().fold((f32::MAX, f32::MIN), |(lo, hi), &s| (lo.min(s), hi.max(s)));
    let ranges: Vec<_> = whole.chunks(Clusters::VERTICES).map(range).collect();
    let nowhere = TransparentIntervals::of(&NodeTable::transparent());
    let known = |transparent: &TransparentIntervals| -> Vec<Option<Label>> {
        let labels: Vec<_> = ranges.iter().map(|&(lo, hi)| transparent.label_of_range(lo, hi)).collect();
        let needed = clusters.needed_scalars(&labels);
        labels.into_iter().zip(needed).map(|(label, needed)| label.filter(|_| !needed)).collect()
    };
    let isovalues = [0.3, 0.31, 0.29, 0.33, 0.3];
    let all: Vec<_> = isovalues.iter().map(|&value| Arc::new(nowhere.cut_at(&[value]))).collect();
    // Scalars that one of them needs are present.
    let mut partial = (*whole).clone();
    for (at, chunk) in partial.chunks_mut(Clusters::VERTICES).enumerate() {
        if all.iter().all(|transparent| known(transparent)[at].is_some()) {
            chunk.fill(ranges[at].0);
        }
    }
    assert!(partial != *whole);
    let (partial, mut cells) = (Arc::new(partial), ActiveCells::default());
    for transparent in &all {
        let found = cells
            .update(
                &mesh,
                &clusters,
                &partial.clone().into(),
                (transparent, &known(transparent)),
                false,
                &Cancel::new(),
            )
            .unwrap();
        assert_eq!(*found.active, by_label(&mesh, &whole, transparent));
        assert!(found.active.count() > 0);
    }
}

#[test]
fn a_cancelled_update_leaves_nothing_behind() {
    let (mesh, tent) = (large_mesh(), table(&[(0.5, 0.0), (0.8, 1.0), (0.9, 0.0)]));
    let mut cells = ActiveCells::default();
    let (transparent, cancel) = (Arc::new(TransparentIntervals::of(&tent)), Cancel::new());
    cancel.cancel();
    assert!(
        cells.update(&mesh, &clusters(&mesh), &wave(&mesh, 8.0).into(), (&transparent, &[]), false, &cancel).is_none()
    );
    let scalars = wave(&mesh, 8.0);
    let found = cells
        .update(&mesh, &clusters(&mesh), &scalars.clone().into(), (&transparent, &[]), false, &Cancel::new())
        .unwrap();
    assert_eq!(*found.active, naive(&mesh, &scalars, Some(&tent)));
}
