//! Polyhedra: any number of faces, each with any number of corners.

use std::collections::VecDeque;

/// Why faces do not bound a polyhedron. Numbers are those of the faces' vertices.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotClosed {
    /// Fewer than four faces.
    #[error("has {0} faces; a polyhedron has four at least")]
    TooFew(usize),
    /// A face of fewer than three corners.
    #[error("has a face with {0} corners")]
    NoFace(usize),
    /// A face that names a vertex twice.
    #[error("has a face with vertex {0} twice")]
    Twice(u32),
    /// An edge that does not belong to two faces.
    #[error("has faces that do not close: the edge from vertex {} to {} belongs to {faces} of them, not to two", .edge[0], .edge[1])]
    Open {
        /// Its vertices.
        edge: [u32; 2],
        /// Number of faces.
        faces: usize,
    },
    /// Faces that cannot all be seen from one side, or that are several surfaces.
    #[error("has faces that bound no single space")]
    NoInside,
}

/// Orders the corners of the faces of a polyhedron so that all are counter-clockwise as seen from the same side; the first keeps its order.
///
/// # Errors
/// If they do not close.
pub fn close(faces: &mut [Vec<u32>]) -> Result<(), NotClosed> {
    if faces.len() < 4 {
        return Err(NotClosed::TooFew(faces.len()));
    }
    let mut edges: Vec<([u32; 2], usize, bool)> = Vec::new();
    for (number, face) in faces.iter().enumerate() {
        if face.len() < 3 {
            return Err(NotClosed::NoFace(face.len()));
        }
        let mut sorted = face.clone();
        sorted.sort_unstable();
        if let Some(twice) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(NotClosed::Twice(twice[0]));
        }
        for (&a, &b) in face.iter().zip(face.iter().cycle().skip(1)) {
            edges.push(([a.min(b), a.max(b)], number, a < b));
        }
    }
    edges.sort_unstable();
    let mut beside: Vec<Vec<(usize, bool)>> = vec![Vec::new(); faces.len()];
    for of_edge in edges.chunk_by(|a, b| a.0 == b.0) {
        let &[(_, a, a_ascends), (_, b, b_ascends)] = of_edge else {
            return Err(NotClosed::Open { edge: of_edge[0].0, faces: of_edge.len() });
        };
        // Faces of one orientation run along their edge in opposite directions.
        let is_turned = a_ascends == b_ascends;
        beside[a].push((b, is_turned));
        beside[b].push((a, is_turned));
    }
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    turned[0] = Some(false);
    let mut front = VecDeque::from([0]);
    while let Some(face) = front.pop_front() {
        for &(other, differs) in &beside[face] {
            let expected = turned[face].map(|turned| turned != differs);
            match turned[other] {
                None => {
                    turned[other] = expected;
                    front.push_back(other);
                }
                known if known != expected => return Err(NotClosed::NoInside),
                Some(_) => {}
            }
        }
    }
    for (face, turned) in faces.iter_mut().zip(turned) {
        if turned.ok_or(NotClosed::NoInside)? {
            face.reverse();
        }
    }
    Ok(())
}

/// The faces at the front of a list like that of a [`Polyhedron`], and what follows them; `None` if the list is cut.
pub fn take_faces<T: Copy + TryInto<usize>>(list: &[T]) -> Option<(Vec<Vec<T>>, &[T])> {
    let (&count, mut rest) = list.split_first()?;
    let mut faces = Vec::new();
    for _ in 0..count.try_into().ok()? {
        let (&corners, after) = rest.split_first()?;
        let (face, after) = after.split_at_checked(corners.try_into().ok()?)?;
        faces.push(face.to_vec());
        rest = after;
    }
    Some((faces, rest))
}

/// The faces of a polyhedron as a list: their number, then for each the number of its corners, and these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Polyhedron<'a> {
    /// Its vertices, each once.
    pub vertices: &'a [u32],
    /// The list.
    pub faces: &'a [u32],
}

impl<'a> Polyhedron<'a> {
    /// Corners of the faces.
    pub fn faces(self) -> impl Iterator<Item = &'a [u32]> {
        let mut rest = self.faces.get(1..).unwrap_or_default();
        std::iter::from_fn(move || {
            let (&count, after) = rest.split_first()?;
            let (face, after) = after.split_at_checked(count as usize)?;
            rest = after;
            Some(face)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Vec<Vec<u32>> {
        [[0, 3, 4, 1], [6, 7, 10, 9], [0, 1, 7, 6], [1, 4, 10, 7], [4, 3, 9, 10], [3, 0, 6, 9]].map(Vec::from).to_vec()
    }

    #[test]
    fn faces_are_turned_to_one_side_whatever_theirs_was() {
        for turned in 0..64u32 {
            let mut faces = cube();
            (0..6).filter(|i| turned >> i & 1 == 1).for_each(|i| faces[i].reverse());
            close(&mut faces).unwrap();
            let mut edges: Vec<_> =
                faces.iter().flat_map(|f| (0..4).map(|i| [f[i], f[(i + 1) % 4]]).collect::<Vec<_>>()).collect();
            edges.sort_unstable();
            edges.dedup();
            assert_eq!(edges.len(), 24, "each edge once in each direction");
        }
    }

    #[test]
    fn lists_of_faces_are_taken_from_the_front_and_cut_ones_refused() {
        let list = [2u64, 3, 7, 8, 9, 4, 1, 2, 3, 4, 5];
        assert_eq!(take_faces(&list), Some((vec![vec![7, 8, 9], vec![1, 2, 3, 4]], &[5][..])));
        for cut in 0..list.len() - 1 {
            assert_eq!(take_faces(&list[..cut]), None, "{cut}");
        }
        assert_eq!(take_faces(&[u64::MAX, u64::MAX, 0]), None);
    }

    #[test]
    fn faces_that_do_not_close_are_named() {
        let with = |change: &dyn Fn(&mut Vec<Vec<u32>>)| {
            let mut faces = cube();
            change(&mut faces);
            close(&mut faces).unwrap_err()
        };
        assert_eq!(with(&|f| _ = f.pop()), NotClosed::Open { edge: [0, 3], faces: 1 });
        assert_eq!(with(&|f| f.push(vec![0, 3, 20])), NotClosed::Open { edge: [0, 3], faces: 3 });
        assert_eq!(with(&|f| f.truncate(3)), NotClosed::TooFew(3));
        assert_eq!(with(&|f| f[2] = vec![0, 1]), NotClosed::NoFace(2));
        assert_eq!(with(&|f| f[2][2] = 0), NotClosed::Twice(0));
        // Two cubes apart are not one polyhedron.
        let apart =
            |f: &mut Vec<Vec<u32>>| f.extend(cube().into_iter().map(|face| face.iter().map(|v| v + 50).collect()));
        assert_eq!(with(&apart), NotClosed::NoInside);
        assert!(with(&|f| _ = f.pop()).to_string().contains("the edge from vertex 0 to 3 belongs to 1 of them"));
    }
}
