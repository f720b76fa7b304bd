//! Points that pieces of a mesh share: each piece lists those on its borders, and they are one point where they have the same number, or,
//! if there are no numbers, where coordinates are equal to the bit and all values agree in the first step.

use crate::mesh::{Cells, RawMesh, gather};
use glam::DVec3;
use std::collections::HashMap;

/// Which points of all pieces are one.
pub(super) struct Joints {
    /// The first of the points that are one, ascending: point i of the joined mesh.
    sources: Vec<u32>,
    /// The point of the joined mesh that each point is.
    joined: Vec<u32>,
    /// Each further point, and the first one.
    pairs: Vec<[u32; 2]>,
}

/// Points with equal coordinates in different pieces, each with the first one: candidates of a mesh whose pieces have these numbers of
/// points.
pub(super) fn coincident(points: &[DVec3], counts: impl IntoIterator<Item = usize>) -> Vec<[u32; 2]> {
    let mut first: HashMap<[u64; 3], (u32, usize)> = HashMap::with_capacity(points.len());
    let mut pairs = Vec::new();
    let piece_of = counts.into_iter().enumerate().flat_map(|(piece, count)| std::iter::repeat_n(piece, count));
    for ((index, point), piece) in (0u32..).zip(points).zip(piece_of) {
        // Adding zero turns -0 into +0.
        let bits = point.to_array().map(|v| (v + 0.0).to_bits());
        let (earlier, of_piece) = *first.entry(bits).or_insert((index, piece));
        if of_piece != piece {
            pairs.push([index, earlier]);
        }
    }
    pairs
}

/// Points of one number, each with the first one: those of a mesh whose pieces have these numbers of their points. `None` if the numbers
/// are no names of points: if two of one piece, or two at different places, have the same.
pub(super) fn of_one_number(points: &[DVec3], numbers: &[Vec<u64>]) -> Option<Vec<[u32; 2]>> {
    let mut first: HashMap<u64, (u32, usize)> = HashMap::with_capacity(points.len());
    let mut pairs = Vec::new();
    let mut index = 0;
    for (piece, numbers) in numbers.iter().enumerate() {
        for number in numbers {
            match first.get_mut(number) {
                None => {
                    first.insert(*number, (index, piece));
                }
                Some((_, last)) if *last == piece => return None,
                Some((earlier, last)) => {
                    if points.get(index as usize)? != points.get(*earlier as usize)? {
                        return None;
                    }
                    pairs.push([index, *earlier]);
                    *last = piece;
                }
            }
            index += 1;
        }
    }
    (index as usize == points.len()).then_some(pairs)
}

/// Whether two values are the same: equal, or both NaN.
pub(super) fn agree(a: f32, b: f32) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

impl Joints {
    /// Joins these pairs of `points` points; `None` if there are none.
    pub(super) fn of(pairs: Vec<[u32; 2]>, points: usize) -> Option<Self> {
        if pairs.is_empty() {
            return None;
        }
        let mut joined: Vec<u32> = vec![0; points];
        let mut further = vec![false; points];
        pairs.iter().for_each(|&[point, _]| further[point as usize] = true);
        let sources: Vec<u32> = (0..points as u32).filter(|&point| !further[point as usize]).collect();
        (0u32..).zip(&sources).for_each(|(number, &source)| joined[source as usize] = number);
        pairs.iter().for_each(|&[point, first]| joined[point as usize] = joined[first as usize]);
        Some(Self { sources, joined, pairs })
    }

    /// Number of points that are further ones.
    pub(super) fn len(&self) -> usize {
        self.pairs.len()
    }

    /// The mesh with one point for those that are one.
    pub(super) fn join(&self, mesh: RawMesh) -> RawMesh {
        let RawMesh { mut points, cells: Cells { mut tets, solids, points: point_cells, radii, volumes } } = mesh;
        gather(&mut points, &self.sources);
        tets.as_flattened_mut().iter_mut().for_each(|vertex| *vertex = self.joined[*vertex as usize]);
        let point_cells = point_cells.iter().map(|vertex| self.joined[*vertex as usize]).collect();
        let mut cells = Cells { points: point_cells, radii, volumes, ..Cells::from(tets) };
        solids.iter().for_each(|solid| cells.solids.push_renumbered(solid, |vertex| self.joined[vertex as usize]));
        RawMesh { points, cells }
    }

    /// The values of the joined points; returns how many further points had another value than the first, which is taken.
    pub(super) fn gather<T: Copy>(&self, values: &mut Vec<T>, agree: impl Fn(T, T) -> bool) -> usize {
        let differs = |&&[point, first]: &&[u32; 2]| !agree(values[point as usize], values[first as usize]);
        let differing = self.pairs.iter().filter(differs).count();
        gather(values, &self.sources);
        differing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_different_pieces_are_one_and_those_of_one_piece_are_not() {
        let p = |x: f64| DVec3::new(x, 0.0, -0.0);
        // Three pieces: the second has a point twice, which both are the first's; the third meets both others.
        let points = [p(0.0), p(1.0), p(2.0), p(1.0), p(1.0), p(3.0), p(3.0), p(-0.0), p(1.0)];
        let pairs = coincident(&points, [3, 3, 3]);
        assert_eq!(pairs, [[3, 1], [4, 1], [6, 5], [7, 0], [8, 1]]);
        let joints = Joints::of(pairs, points.len()).unwrap();
        assert_eq!((joints.len(), joints.sources.as_slice()), (5, &[0, 1, 2, 5][..]));
        let mesh = RawMesh { points: points.to_vec(), cells: Cells::from(vec![[0, 1, 2, 5], [7, 8, 6, 2]]) };
        let joined = joints.join(mesh);
        assert_eq!(joined.points, [p(0.0), p(1.0), p(2.0), p(3.0)]);
        assert_eq!(joined.cells.tets, [[0, 1, 2, 3], [0, 1, 3, 2]]);
        let mut values = vec![0.0, 1.0, 2.0, 1.0, 9.0, f32::NAN, f32::NAN, 0.0, 1.0];
        assert_eq!(joints.gather(&mut values, agree), 1);
        assert!(values[..3] == [0.0, 1.0, 2.0] && values[3].is_nan() && values.len() == 4);
        assert!(Joints::of(Vec::new(), 5).is_none());
    }

    #[test]
    fn points_of_one_number_are_one_unless_numbers_contradict_places() {
        let p = |x: f64| DVec3::new(x, 0.0, 0.0);
        // The points 2 and 3 of the first piece are at one place, and stay two.
        let points = [p(0.0), p(1.0), p(1.0), p(1.0), p(1.0), p(2.0), p(1.0), p(0.0)];
        let numbers = |last: u64| [vec![1, 2, 3], vec![3, 2, 9], vec![2, last]];
        assert_eq!(of_one_number(&points, &numbers(1)), Some(vec![[3, 2], [4, 1], [6, 1], [7, 0]]));
        assert_eq!(of_one_number(&points, &numbers(2)), None, "twice in one piece");
        assert_eq!(of_one_number(&points, &numbers(9)), None, "at two places");
        assert_eq!(of_one_number(&points, &numbers(1)[..2]), None, "too few");
        assert_eq!(of_one_number(&points, &[vec![1; 9]]), None);
    }
}
