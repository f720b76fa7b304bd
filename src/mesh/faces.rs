//! Unique faces and neighbours from the cells alone.
//!
//! ```text
//! half-faces = the four faces of every cell: ascending vertices, cell, local face
//! counting sort of the half-faces by their lowest vertex            linear, sequential (a scatter)
//! sort of each vertex's half-faces by the other two, then the cell  a dozen to a few dozen entries each; in parallel
//! runs of equal vertices: 1 -> boundary, 2 -> interior, else non-manifold
//! ```
//! A hash map of faces would need more memory, and its order would have to be undone. Cells in curve order keep the
//! scatter and the runs in cache.
//!
//! All cells are positively oriented, hence the side on which a cell lies of its face is the parity of the face's
//! outward winding relative to ascending order: no coordinates are needed. Two cells on the same side overlap.

use super::{CellNeighbour, FACE_VERTICES, NONE, Topology};

/// A face seen from one of its cells. Its lowest vertex is the bucket that it lies in.
#[derive(Clone, Copy)]
struct HalfFace {
    /// The other two vertices, ascending.
    others: [u32; 2],
    /// The cell, and its vertex opposite the face.
    cell: CellNeighbour,
}

/// Derives faces and neighbours of positively oriented `tets` with indices below `vertex_count`. Returns how many
/// triangles are non-manifold beside them.
pub(super) fn connect(vertex_count: u32, tets: Vec<[u32; 4]>) -> (Topology, u64) {
    let (starts, mut half_faces) = bucket_half_faces(vertex_count, &tets);
    sort_buckets(&starts, &mut half_faces);

    let face_count: usize = runs(&starts, &half_faces).map(|(_, run)| Junction::of(run, &tets).face_count()).sum();
    let mut faces = Vec::with_capacity(face_count);
    let mut face_cells = Vec::with_capacity(face_count);
    let mut neighbours = vec![[CellNeighbour::NONE; 4]; tets.len()];
    let mut non_manifold = 0;
    for (lowest, run) in runs(&starts, &half_faces) {
        let face = [lowest, run[0].others[0], run[0].others[1]];
        match Junction::of(run, &tets) {
            Junction::Interior(first, second) => {
                faces.push(face);
                face_cells.push([first.cell, second.cell].map(cell_of));
                *side_mut(&mut neighbours, first.cell) = second.cell;
                *side_mut(&mut neighbours, second.cell) = first.cell;
            }
            Junction::Boundary(half_faces) => {
                non_manifold += u64::from(half_faces.len() > 1);
                for half_face in half_faces {
                    faces.push(face);
                    face_cells.push([cell_of(half_face.cell), NONE]);
                }
            }
        }
    }
    (Topology { vertex_count, tets, neighbours, faces, face_cells }, non_manifold)
}

/// What meets at one triangle.
enum Junction<'a> {
    /// Two cells on opposite sides, the lower id first.
    Interior(HalfFace, HalfFace),
    /// One cell; or several that are each left without a neighbour, because it is not clear which belong together.
    Boundary(&'a [HalfFace]),
}

impl<'a> Junction<'a> {
    fn of(run: &'a [HalfFace], tets: &[[u32; 4]]) -> Self {
        match run {
            &[first, second] if winding_is_even(first.cell, tets) != winding_is_even(second.cell, tets) => {
                Self::Interior(first, second)
            }
            _ => Self::Boundary(run),
        }
    }

    /// Entries in the list of unique faces.
    fn face_count(&self) -> usize {
        match self {
            Self::Interior(..) => 1,
            Self::Boundary(half_faces) => half_faces.len(),
        }
    }
}

/// All half-faces, bucket by bucket, and where each vertex's bucket starts (one more entry for the end). Fewer than
/// 2^30 cells have fewer than 2^32 half-faces.
fn bucket_half_faces(vertex_count: u32, tets: &[[u32; 4]]) -> (Vec<u32>, Vec<HalfFace>) {
    // Counts become the buckets' ends, and those their starts while the buckets are filled from behind.
    let mut starts = vec![0u32; vertex_count as usize + 1];
    for tet in tets {
        // The lowest vertex of a cell is the lowest of three of its faces; the fourth begins with the second lowest.
        let (lowest, second) = two_lowest(*tet);
        starts[lowest as usize] += 3;
        starts[second as usize] += 1;
    }
    let mut end = 0;
    for start in &mut starts {
        end += *start;
        *start = end;
    }
    let unfilled = HalfFace { others: [NONE; 2], cell: CellNeighbour::NONE };
    let mut half_faces = vec![unfilled; 4 * tets.len()];
    for (cell, tet) in (0u32..).zip(tets) {
        for local in 0..4 {
            let [lowest, b, c] = ascending_face(*tet, local);
            let start = &mut starts[lowest as usize];
            *start -= 1;
            half_faces[*start as usize] = HalfFace { others: [b, c], cell: CellNeighbour::new(cell, local) };
        }
    }
    (starts, half_faces)
}

/// Sorts the buckets that begin at `starts` (the last entry is the end); `half_faces` are theirs alone. Halves are
/// sorted in parallel.
fn sort_buckets(starts: &[u32], half_faces: &mut [HalfFace]) {
    /// Buckets that one thread sorts in well under a millisecond.
    const SEQUENTIAL_BUCKETS: usize = 512;
    let buckets = starts.len() - 1;
    if buckets > SEQUENTIAL_BUCKETS {
        let middle = buckets / 2;
        let (left, right) = half_faces.split_at_mut((starts[middle] - starts[0]) as usize);
        rayon::join(|| sort_buckets(&starts[..=middle], left), || sort_buckets(&starts[middle..], right));
        return;
    }
    let mut rest = half_faces;
    for ends in starts.windows(2) {
        let (bucket, behind) = rest.split_at_mut((ends[1] - ends[0]) as usize);
        bucket.sort_unstable_by_key(|half_face| (half_face.others, half_face.cell.0));
        rest = behind;
    }
}

/// Runs of half-faces with the same vertices, each beside its lowest vertex, in lexicographic order.
fn runs<'a>(starts: &'a [u32], half_faces: &'a [HalfFace]) -> impl Iterator<Item = (u32, &'a [HalfFace])> {
    (0u32..).zip(starts.windows(2)).flat_map(|(lowest, ends)| {
        let bucket = &half_faces[ends[0] as usize..ends[1] as usize];
        bucket.chunk_by(|a, b| a.others == b.others).map(move |run| (lowest, run))
    })
}

/// The vertices of a cell's face, ascending.
pub(super) fn ascending_face(tet: [u32; 4], local: u32) -> [u32; 3] {
    let mut face = FACE_VERTICES[local as usize].map(|i| tet[i]);
    face.sort_unstable();
    face
}

/// Whether the outward winding of a cell's face is an even permutation of its ascending vertices. Cells on opposite
/// sides of a shared face differ in this.
pub(super) fn winding_is_even(side: CellNeighbour, tets: &[[u32; 4]]) -> bool {
    let tet = tets[cell_of(side) as usize];
    let [a, b, c] = FACE_VERTICES[side.opposite() as usize].map(|i| tet[i]);
    ((a > b) ^ (b > c)) == (a > c)
}

fn two_lowest(tet: [u32; 4]) -> (u32, u32) {
    let [lowest, second, ..] = super::curve::ascending(tet);
    (lowest, second)
}

/// The cell of a half-face, which always has one.
fn cell_of(side: CellNeighbour) -> u32 {
    side.0 >> 2
}

fn side_mut(neighbours: &mut [[CellNeighbour; 4]], side: CellNeighbour) -> &mut CellNeighbour {
    &mut neighbours[cell_of(side) as usize][side.opposite() as usize]
}
