//! Derives unique faces and neighbours from the cells alone.
//!
//! ```text
//! half-faces = the four faces of every cell: ascending vertices, cell, local face
//! for each part (range of vertices); meshes of 8M cells and more have about 8 parts:
//!     counting sort of the half-faces by their lowest vertex            linear, sequential (a scatter)
//!     sort of each vertex's half-faces by the other two, then the cell  a dozen to a few dozen entries each; in parallel
//!     runs of equal vertices: 1 -> boundary, 2 -> interior, else non-manifold
//! ```
//! Parts save memory: all half-faces at once would take more than the result. In curve order, a part reads few blocks of cells beyond its
//! own.
//! A hash map of faces would need more memory, and its order would have to be undone. Cells in curve order keep the
//! scatter and the runs in cache.
//!
//! All cells are positively oriented, hence the parity of a face's outward winding relative to ascending order tells on which side its cell
//! lies: no coordinates are needed. Two cells on the same side overlap.

use super::{CellNeighbour, Connectivity, FACE_VERTICES, NONE};
use std::ops::Range;

/// A face seen from one of its cells, in the bucket of its lowest vertex.
#[derive(Clone, Copy)]
struct HalfFace {
    /// The other two vertices, ascending.
    others: [u32; 2],
    /// The cell, and its vertex opposite the face.
    cell: CellNeighbour,
}

/// Minimum of half-faces per part: meshes of fewer than a million cells have one part.
const PART: usize = 4_000_000;
/// Approximate number of parts of a large mesh; a part ends before the vertex whose half-faces would exceed its share.
const PARTS: usize = 8;

/// Cells per block; blocks outside of a part's vertex range are skipped.
const BLOCK: usize = 1024;

/// Derives faces and neighbours of positively oriented `tets` with indices below `vertex_count`.
pub(super) fn connect(vertex_count: u32, tets: &[[u32; 4]]) -> Connectivity {
    let most = PART.max((4 * tets.len()).div_ceil(PARTS));
    connect_in_parts(vertex_count, tets, most)
}

/// [`connect`] by parts of at most `most` half-faces each, or of a single vertex.
pub(super) fn connect_in_parts(vertex_count: u32, tets: &[[u32; 4]], most: usize) -> Connectivity {
    let starts = bucket_starts(vertex_count, tets);
    let blocks: Vec<[u32; 2]> = tets.chunks(BLOCK).map(lowest_in).collect();
    let mut faces = Vec::new();
    let mut face_cells = Vec::new();
    let mut neighbours = vec![[CellNeighbour::NONE; 4]; tets.len()];
    let (mut first, mut half_faces) = (0, Vec::new());
    while first < vertex_count {
        let begin = starts[first as usize];
        let fits = |end: &&u32| (**end - begin) as usize <= most;
        let behind = first + 1 + starts[first as usize + 2..].iter().take_while(fits).count() as u32;
        let part = Part { vertices: first..behind, starts: &starts[first as usize..=behind as usize] };
        part.find(tets, &blocks, &mut half_faces);
        let face_count: usize = part.runs(&half_faces).map(|(_, run)| Junction::of(run, tets).face_count()).sum();
        faces.reserve_exact(face_count);
        face_cells.reserve_exact(face_count);
        for (lowest, run) in part.runs(&half_faces) {
            let face = [lowest, run[0].others[0], run[0].others[1]];
            match Junction::of(run, tets) {
                Junction::Interior(first, second) => {
                    faces.push(face);
                    face_cells.push([first.cell, second.cell].map(cell_of));
                    *side_mut(&mut neighbours, first.cell) = second.cell;
                    *side_mut(&mut neighbours, second.cell) = first.cell;
                }
                Junction::Boundary(half_faces) => {
                    for half_face in half_faces {
                        faces.push(face);
                        face_cells.push([cell_of(half_face.cell), NONE]);
                    }
                }
            }
        }
        first = behind;
    }
    Connectivity { neighbours, faces, face_cells }
}

/// The cells that meet at one triangle.
enum Junction<'a> {
    /// Two cells on opposite sides, the lower id first.
    Interior(HalfFace, HalfFace),
    /// One cell; or several without neighbours, because it is ambiguous which belong together.
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

    /// Number of entries in the list of unique faces.
    fn face_count(&self) -> usize {
        match self {
            Self::Interior(..) => 1,
            Self::Boundary(half_faces) => half_faces.len(),
        }
    }
}

/// Start of each vertex's bucket of half-faces, and the end of the last. Fewer than 2^30 cells have fewer than 2^32 half-faces.
fn bucket_starts(vertex_count: u32, tets: &[[u32; 4]]) -> Vec<u32> {
    let mut starts = vec![0u32; vertex_count as usize + 1];
    for tet in tets {
        // The lowest vertex of a cell is the lowest of three of its faces; the fourth begins with the second lowest.
        let (lowest, second) = two_lowest(*tet);
        starts[lowest as usize + 1] += 3;
        starts[second as usize + 1] += 1;
    }
    let mut end = 0;
    for start in &mut starts {
        end += *start;
        *start = end;
    }
    starts
}

/// The half-faces whose lowest vertex lies in a range of vertices.
struct Part<'a> {
    vertices: Range<u32>,
    /// Start of each bucket among all half-faces, and the end of the last.
    starts: &'a [u32],
}

impl Part<'_> {
    /// Fills `half_faces` with those of the part, bucket by bucket, each bucket sorted. `blocks` holds the [`lowest_in`] of every [`BLOCK`]
    /// cells.
    fn find(&self, tets: &[[u32; 4]], blocks: &[[u32; 2]], half_faces: &mut Vec<HalfFace>) {
        let (begin, end) = (self.starts[0], self.starts[self.starts.len() - 1]);
        let unfilled = HalfFace { others: [NONE; 2], cell: CellNeighbour::NONE };
        half_faces.clear();
        half_faces.resize((end - begin) as usize, unfilled);
        let mut next: Vec<u32> = self.starts.iter().map(|start| start - begin).collect();
        for (block, (cells, [least, greatest])) in tets.chunks(BLOCK).zip(blocks).enumerate() {
            if *least >= self.vertices.end || *greatest < self.vertices.start {
                continue;
            }
            for (cell, tet) in ((block * BLOCK) as u32..).zip(cells) {
                for local in 0..4 {
                    let [lowest, b, c] = ascending_face(*tet, local);
                    if self.vertices.contains(&lowest) {
                        let next = &mut next[(lowest - self.vertices.start) as usize];
                        half_faces[*next as usize] = HalfFace { others: [b, c], cell: CellNeighbour::new(cell, local) };
                        *next += 1;
                    }
                }
            }
        }
        sort_buckets(self.starts, half_faces);
    }

    /// Runs of half-faces with the same vertices, each beside its lowest vertex, in lexicographic order.
    fn runs<'a>(&'a self, half_faces: &'a [HalfFace]) -> impl Iterator<Item = (u32, &'a [HalfFace])> {
        self.vertices.clone().zip(self.starts.windows(2)).flat_map(|(lowest, ends)| {
            let [from, to] = [ends[0], ends[1]].map(|end| (end - self.starts[0]) as usize);
            half_faces[from..to].chunk_by(|a, b| a.others == b.others).map(move |run| (lowest, run))
        })
    }
}

/// Sorts the buckets of `half_faces` that begin at `starts` (whose last entry is the end), in parallel by halves.
fn sort_buckets(starts: &[u32], half_faces: &mut [HalfFace]) {
    /// Buckets per task; one thread sorts them in well under a millisecond.
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

/// The vertices of a cell's face, ascending.
pub(super) fn ascending_face(tet: [u32; 4], local: u32) -> [u32; 3] {
    let mut face = FACE_VERTICES[local as usize].map(|i| tet[i]);
    face.sort_unstable();
    face
}

/// Whether the outward winding of a cell's face is an even permutation of its ascending vertices. Cells on opposite
/// sides of a shared face differ in this.
pub(super) fn winding_is_even(side: CellNeighbour, tets: &[[u32; 4]]) -> bool {
    is_even(tets[cell_of(side) as usize], side.opposite())
}

/// [`winding_is_even`] of face `local` of a cell with these vertices.
pub(super) fn is_even(tet: [u32; 4], local: u32) -> bool {
    let [a, b, c] = FACE_VERTICES[local as usize].map(|i| tet[i]);
    ((a > b) ^ (b > c)) == (a > c)
}

/// Minimum and maximum of the lowest vertices of these cells' faces.
fn lowest_in(tets: &[[u32; 4]]) -> [u32; 2] {
    let both = tets.iter().map(|tet| two_lowest(*tet));
    both.fold([u32::MAX, 0], |[least, greatest], (lowest, second)| [least.min(lowest), greatest.max(second)])
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
