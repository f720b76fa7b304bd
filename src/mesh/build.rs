//! Builds a mesh from a file's points and cells.
//!
//! ```text
//! split      cells of other shapes into tetrahedra (`split.rs`), which are the cells of the rest; points that this adds follow the others
//! check      indices in range; points that cells use are finite
//! place      box of those points -> f64 origin, power-of-two scale; positions rounded to f32     (points are freed)
//! orient     exact sign of each cell's volume after rounding: swap two vertices, or drop
//! order      vertices that remaining cells use, by Hilbert index; cells by that of their centroid
//! deduplicate  cells of the same vertices share their index, so they meet in the order
//! gather     positions and renumbered cells in curve order                                     (raw cells are freed)
//! connect    unique faces and neighbours (`faces.rs`), unless the cells do not fit together (`soup.rs`)
//! ```
//! 1. A cell is judged after rounding, because the rounded cell is the one that is drawn; the predicate is exact, so that
//!    no tolerance decides whether a sliver is kept.
//! 2. The box is that of the points of all cells with four different vertices, before flat ones are dropped: which cells
//!    are flat depends on the rounding, and that on the box.
//! 3. Every parallel step maps or sorts by unique keys, so that threads do not show in the result.
//!
//! Memory in bytes a cell, with v vertices a cell (0.18 in a regular mesh) and s <= 4 faces a cell (2 in a large one):
//!
//! | array | bytes | check | orient | order | gather | connect |
//! |---|---|---|---|---|---|---|
//! | raw points, f64 | 24 v | x | | | | |
//! | raw cells | 16 | x | x | x | x | |
//! | raw positions, f32 | 12 v | x | x | x | x | |
//! | orientations | 1 | | x | x | | |
//! | vertex keys, ranks | 16 v + 4 v | | | x | x | |
//! | cell keys | 16 | | | x | x | |
//! | positions, sources, turns | 12 v + 4 v + 5 | | | | x | x |
//! | cells | 16 | | | | x | x |
//! | half-faces of a part, bucket starts | 48 (6 from 8M cells on) + 4 v | | | | | x |
//! | neighbours | 16 | | | | | x |
//! | faces and their cells | 20 s | | | | | x |
//! | sum for v = 0.18, s = 2 | | 22 | 19 | 39 | 62 | 129 (87 from 8M cells on) |
//!
//! Measured on 55^3 jittered cubes in random order (998,250 cells): 128 at the peak, of which 79 stay (then
//! without the turns); 0.6 s on two shared
//! cores, the exact predicate 11 ms of it, so that it needs no filter in front. `synth jet --cells 10000000 --steps 3` takes 965 MiB in all, where
//! all half-faces at once made it 1346, and 1.05 of its time. Not kept: a hash map from faces to cells
//! (more memory than the half-faces, and an order to undo), and one sort of all half-faces (each would have to hold its
//! lowest vertex, too: 16 bytes a cell more).

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::curve::{CurveKey, cell_curve_index, curve_index, sort_along_curve};
use super::repair::{self, Orientation};
use super::{
    ConnectivityChoice, FarParts, Mesh, MeshError, NONE, Positions, RawMesh, RepairReport, Split, Topology,
    Unconnected, WorstCell, split, tet_aspect_ratio,
};

impl Mesh {
    /// Repairs a mesh, brings it into curve order and derives its faces. What was found and repaired is in the report:
    /// cells turned to positive orientation, flat and duplicate cells dropped, unused points dropped. Coincident points
    /// and non-manifold faces are counted and kept.
    ///
    /// # Errors
    /// If there are too many cells or points to number, a cell names a missing point, a point in use is not finite or
    /// further away than f64 can scale, or no cell remains.
    pub fn build(raw: RawMesh) -> Result<(Mesh, RepairReport), MeshError> {
        Self::build_as(raw, ConnectivityChoice::Full)
    }

    /// [`Self::build`], with connectivity or without.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn build_as(raw: RawMesh, choice: ConnectivityChoice) -> Result<(Mesh, RepairReport), MeshError> {
        let RawMesh { points, cells } = raw;
        let cells = split(cells, &points);
        Self::build_split(points, cells, choice)
    }

    /// [`Self::build_as`] of split cells.
    pub(crate) fn build_split(
        mut points: Vec<DVec3>,
        mut split: Split,
        choice: ConnectivityChoice,
    ) -> Result<(Mesh, RepairReport), MeshError> {
        let (cells_in, vertices_in) = (split.cell_count() as u64, points.len() as u64);
        let mut tets = std::mem::take(&mut split.tets);
        points.append(&mut split.steiner.points);
        repair::check_counts(tets.len(), points.len())?;
        repair::check_indices(&tets, points.len())?;
        if tets.is_empty() {
            return Err(MeshError::NoCells);
        }
        let points_in = points.len();
        let steiner_cells = split.steiner.of_solids.len() as u64;
        let mut report = RepairReport { cells_in, vertices_in, steiner_cells, ..Default::default() };

        let raw_positions = repair::local_positions(&points, &tets)?;
        drop(points);
        let orientations = repair::orient_cells(&mut tets, &raw_positions);
        let count = |kind| orientations.par_iter().filter(|&&orientation| orientation == kind).count() as u64;
        report.flipped = count(Orientation::Negative);
        let flat_tets = count(Orientation::Flat);
        report.zero_volume = flat_tets;
        if flat_tets == tets.len() as u64 {
            return Err(MeshError::AllFlat(tets.len()));
        }
        let tets_in = tets.len() as u64;
        for cell in split.groups() {
            let of_kind = |kind| orientations[cell.clone()].iter().filter(|&&other| other == kind).count() as u64;
            let [turned, straight, flat] =
                [Orientation::Negative, Orientation::Positive, Orientation::Flat].map(of_kind);
            report.split_cells += u64::from(turned + straight > 0);
            report.warped_cells += u64::from(turned > 0 && straight > 0);
            report.gapped_cells += u64::from(flat > 0 && turned + straight > 0);
            // A cell that is turned as a whole is numbered the other way round.
            report.flipped -= turned;
            // A cell without a volume is one, whatever its parts.
            report.zero_volume -= if turned + straight > 0 { flat } else { flat - 1 };
        }

        let vertex_order = order_vertices(&tets, &orientations, &raw_positions.local);
        report.vertices_out = vertex_order.len() as u64;
        // Those that were added are all in use.
        report.unreferenced_vertices = points_in as u64 - report.vertices_out;
        report.coincident_points = repair::count_coincident(&vertex_order, &raw_positions.local);

        let mut cell_order = order_cells(&tets, &orientations, &raw_positions.local);
        repair::drop_duplicates(&mut cell_order, &tets);
        let is_turned = |&(_, source): &CurveKey| orientations[source as usize] == Orientation::Negative;
        let cell_turned = cell_order.par_iter().map(is_turned).collect();
        drop(orientations);
        report.cells_out = cell_order.len() as u64;
        report.duplicate_cells = tets_in - flat_tets - report.cells_out;

        let tets = renumber(tets, &cell_order, &vertex_order, raw_positions.local.len());
        let local: Vec<Vec3> = vertex_order.iter().map(|&(_, source)| raw_positions.local[source as usize]).collect();
        // At most the number of points, which was checked above.
        let mut topology = Topology::of_cells(local.len() as u32, tets);
        report.unconnected = Unconnected::find(choice, &topology, &local, [&vertex_order, &cell_order]);
        let mut cell_source = sources(cell_order);
        split.to_cells(&mut cell_source);
        let positions = Positions { local, origin: raw_positions.origin, scale: raw_positions.scale };
        drop(raw_positions);
        let vertex_source = sources(vertex_order);

        let split_cells = split.split_cells(&cell_source, &vertex_source, points_in);
        if report.unconnected.is_some() {
            topology.forget_connectivity();
        } else {
            let connectivity = topology.connectivity();
            report.non_manifold_faces = connectivity.non_manifold_faces();
            report.boundary_faces = connectivity.boundary_faces().count() as u64;
            let parts = connectivity.parts();
            report.parts = parts.1.len() as u64;
            report.far_parts = FarParts::of(&topology.tets, parts, &positions, &cell_source);
        }
        report.worst_cells = worst_cells(&topology.tets, &positions.local, &cell_source);
        let without_far_parts = report.far_parts.as_ref().map(FarParts::frame);
        let mut mesh = Mesh::of_parts(topology, positions, [vertex_source, cell_source], cell_turned, split_cells);
        (mesh.without_far_parts, mesh.is_connected) = (without_far_parts, report.unconnected.is_none());
        Ok((mesh, report))
    }
}

/// The tets of the greatest aspect ratios, the worst first, of equal ones the one of the lower source.
fn worst_cells(tets: &[[u32; 4]], local: &[Vec3], cell_source: &[u32]) -> Vec<WorstCell> {
    let is_worse =
        |a: &WorstCell, b: &WorstCell| b.aspect_ratio.total_cmp(&a.aspect_ratio).then(a.source.cmp(&b.source));
    let worst_of = |mut cells: Vec<WorstCell>| {
        cells.sort_unstable_by(is_worse);
        // A cell of the source is named once.
        let mut named: Vec<WorstCell> = Vec::new();
        for cell in cells {
            if named.len() < WorstCell::MOST && named.iter().all(|other| other.source != cell.source) {
                named.push(cell);
            }
        }
        named
    };
    let of_run = |(tets, sources): (&[[u32; 4]], &[u32])| {
        let ratio = |tet: &[u32; 4]| tet_aspect_ratio(tet.map(|v| local[v as usize]));
        worst_of(
            std::iter::zip(tets, sources)
                .map(|(tet, &source)| WorstCell { source, aspect_ratio: ratio(tet) })
                .collect(),
        )
    };
    let runs = tets.par_chunks(WORST_RUN).zip(cell_source.par_chunks(WORST_RUN));
    runs.map(of_run).reduce(Vec::new, |a, b| worst_of([a, b].concat()))
}

/// Cells that a task looks for the worst of.
const WORST_RUN: usize = 1 << 12;

/// Curve keys, in order, of the vertices that cells with a volume use.
fn order_vertices(tets: &[[u32; 4]], orientations: &[Orientation], local: &[Vec3]) -> Vec<CurveKey> {
    let kept = tets.iter().zip(orientations).filter(|(_, orientation)| **orientation != Orientation::Flat);
    let used = repair::used_vertices(kept.map(|(tet, _)| tet), local.len());
    let sources = (0..local.len() as u32).into_par_iter().filter(|&source| used[source as usize]);
    sort_along_curve(sources.map(|source| (curve_index(local[source as usize].as_dvec3()), source)).collect())
}

/// Curve keys, in order, of the cells with a volume.
fn order_cells(tets: &[[u32; 4]], orientations: &[Orientation], local: &[Vec3]) -> Vec<CurveKey> {
    let sources = (0..tets.len() as u32).into_par_iter();
    let kept = sources.filter(|&source| orientations[source as usize] != Orientation::Flat);
    sort_along_curve(kept.map(|source| (cell_curve_index(tets[source as usize], local), source)).collect())
}

/// The cells in curve order, with vertices renumbered in curve order.
fn renumber(
    tets: Vec<[u32; 4]>,
    cell_order: &[CurveKey],
    vertex_order: &[CurveKey],
    vertices_in: usize,
) -> Vec<[u32; 4]> {
    let mut ranks = vec![NONE; vertices_in];
    for (rank, &(_, source)) in (0u32..).zip(vertex_order) {
        ranks[source as usize] = rank;
    }
    cell_order.par_iter().map(|&(_, source)| tets[source as usize].map(|v| ranks[v as usize])).collect()
}

/// The source indices of ordered keys.
fn sources(order: Vec<CurveKey>) -> Vec<u32> {
    order.par_iter().map(|&(_, source)| source).collect()
}
