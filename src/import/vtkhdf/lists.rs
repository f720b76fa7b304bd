//! Where the points and cells of each part of each step are in the lists of a file.

use super::super::hdf::Hdf;
use super::block::{column, counts, invalid};
use crate::error::FileResult;

/// Rows of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Rows {
    pub(super) first: u64,
    pub(super) count: u64,
}

/// Where the mesh of a part is. Equal places are equal meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Place {
    pub(super) points: Rows,
    pub(super) cells: Rows,
    /// One more than cells: each begins where the one before it ends.
    pub(super) offsets: Rows,
    pub(super) corners: Rows,
    /// Faces of polyhedra, if the file has any.
    pub(super) faces: Option<FacePlace>,
    /// Points and cells of the parts before it in its step.
    pub(super) before: [u64; 2],
}

/// Where the faces of a part's polyhedra are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct FacePlace {
    /// One more than faces.
    pub(super) offsets: Rows,
    pub(super) corners: Rows,
    /// The faces of each polyhedron; where these end is in rows like those of the cells' offsets.
    pub(super) of_cells: Rows,
}

/// Counts of all parts of all steps, and where each step begins.
pub(super) struct Lists {
    points: Vec<u64>,
    cells: Vec<u64>,
    corners: Vec<u64>,
    /// Faces, their corners, and the faces of all polyhedra.
    faces: Option<[Vec<u64>; 3]>,
    /// One, if the grid is the same at all steps.
    starts: Vec<Start>,
}

/// Where a step begins.
#[derive(Clone, Copy, Debug, Default)]
struct Start {
    part: u64,
    parts: u64,
    points: u64,
    cells: u64,
    corners: u64,
    faces: u64,
    face_corners: u64,
    of_cells: u64,
}

impl Lists {
    /// Reads counts and, if there are steps, where these begin.
    ///
    /// # Errors
    /// If some are missing or contradict each other.
    pub(super) fn read(file: &Hdf, group: &str, steps: Option<usize>) -> FileResult<Self> {
        let of_parts = |name: &str| counts(file, &format!("{group}/{name}"));
        let points = of_parts("NumberOfPoints")?;
        let (cells, corners) = (of_parts("NumberOfCells")?, of_parts("NumberOfConnectivityIds")?);
        let has_faces = file.names(group)?.1.iter().any(|name| name == "NumberOfFaces");
        let faces = if has_faces {
            let names = ["NumberOfFaces", "NumberOfFaceConnectivityIds", "NumberOfPolyhedronToFaceIds"];
            let [faces, corners, of_cells] = names.map(of_parts);
            Some([faces?, corners?, of_cells?])
        } else {
            None
        };
        if let Some(other) = [&cells, &corners].map(Vec::len).into_iter().find(|&length| length != points.len()) {
            let problem = format!("has {} numbers of points, and {other} of cells or corners", points.len());
            return Err(invalid(file, group, problem).remedy("write a number for each part"));
        }
        if let Some(other) = faces.iter().flatten().map(Vec::len).find(|&length| length != points.len()) {
            let problem = format!("has {} parts, and faces of {other}", points.len());
            return Err(invalid(file, group, problem).remedy(
                "VTK leaves out the numbers of parts without polyhedra: merge the parts before they are written",
            ));
        }
        let parts = points.len() as u64;
        let starts = match steps {
            None => vec![Start { parts, ..Start::default() }],
            Some(steps) => read_starts(file, group, (steps, parts), faces.as_ref())?,
        };
        Ok(Self { points, cells, corners, faces, starts })
    }

    /// The parts of a step; the error says what is wrong with them.
    pub(super) fn places(&self, step: usize) -> Result<Vec<Place>, String> {
        let start = match &self.starts[..] {
            [start] => *start,
            starts => *starts.get(step).ok_or("there is no such step")?,
        };
        let end = start.part.checked_add(start.parts).filter(|&end| end <= self.points.len() as u64);
        let end = end.ok_or_else(|| {
            format!("has parts {} + {} of {} at step {step}", start.part, start.parts, self.points.len())
        })?;
        let mut next = start;
        let mut place = |part: u64| {
            let (found, after) = self.place(start, next, part)?;
            next = after;
            Some(found)
        };
        let places: Option<Vec<Place>> = (start.part..end).map(&mut place).collect();
        places.ok_or_else(|| format!("has numbers of points or cells at step {step} that no list holds"))
    }

    /// The place of a part at `next`, and the place behind it; `None` if numbers overflow.
    fn place(&self, start: Start, mut next: Start, part: u64) -> Option<(Place, Start)> {
        let at = usize::try_from(part).ok()?;
        let take = |list: &[u64], from: &mut u64| {
            let rows = Rows { first: *from, count: *list.get(at)? };
            *from = from.checked_add(rows.count)?;
            Some(rows)
        };
        // Offsets have one row more than cells or faces for each part before, of this step and of those before it.
        let offsets =
            |rows: Rows| Some(Rows { first: rows.first.checked_add(part)?, count: rows.count.checked_add(1)? });
        let points = take(&self.points, &mut next.points)?;
        let cells = take(&self.cells, &mut next.cells)?;
        let corners = take(&self.corners, &mut next.corners)?;
        let faces = match &self.faces {
            None => None,
            Some([faces, face_corners, of_cells]) => Some(FacePlace {
                offsets: offsets(take(faces, &mut next.faces)?)?,
                corners: take(face_corners, &mut next.face_corners)?,
                of_cells: take(of_cells, &mut next.of_cells)?,
            }),
        };
        let before = [points.first - start.points, cells.first - start.cells];
        Some((Place { points, cells, offsets: offsets(cells)?, corners, faces, before }, next))
    }
}

/// Where steps begin. Without a number of parts, those of a step end where those of another begin.
fn read_starts(
    file: &Hdf,
    group: &str,
    (steps, parts): (usize, u64),
    faces: Option<&[Vec<u64>; 3]>,
) -> FileResult<Vec<Start>> {
    let (_, names) = file.names(&format!("{group}/Steps"))?;
    let of_steps = |name: &str| column(file, &format!("{group}/Steps/{name}"), steps);
    let part = of_steps("PartOffsets")?;
    let counts = if names.iter().any(|name| name == "NumberOfParts") {
        of_steps("NumberOfParts")?
    } else {
        let mut sorted = part.clone();
        sorted.sort_unstable();
        let end = |&first: &u64| sorted.get(sorted.partition_point(|&other| other <= first)).copied().unwrap_or(parts);
        part.iter().map(|first| end(first).saturating_sub(*first)).collect()
    };
    let (points, cells) = (of_steps("PointOffsets")?, of_steps("CellOffsets")?);
    let corners = of_steps("ConnectivityIdOffsets")?;
    let of_faces = |which: usize, name: &str| match faces {
        None => Ok(vec![0; steps]),
        Some(counts) => face_starts(file, &format!("{group}/Steps/{name}"), &part, &counts[which]),
    };
    let (faces, face_corners) = (of_faces(0, "FaceOffsetsOffsets")?, of_faces(1, "FaceConnectivityOffsets")?);
    let of_cells = of_faces(2, "PolyhedronToFaceIdOffsets")?;
    let start = |step: usize| Start {
        part: part[step],
        parts: counts[step],
        points: points[step],
        cells: cells[step],
        corners: corners[step],
        faces: faces[step],
        face_corners: face_corners[step],
        of_cells: of_cells[step],
    };
    Ok((0..steps).map(start).collect())
}

/// Where faces of steps begin. VTK 9.7 writes this for each part, not for each step, of a grid in parts: then the sums of the counts of
/// earlier parts are taken.
fn face_starts(file: &Hdf, name: &str, part: &[u64], counts: &[u64]) -> FileResult<Vec<u64>> {
    let steps = part.len();
    if file.array(name)?.shape().first() == Some(&(steps as u64)) {
        return column(file, name, steps);
    }
    let mut sums = vec![0_u64];
    for count in counts {
        sums.push(sums.last().copied().unwrap_or(0).saturating_add(*count));
    }
    // A part beyond the list is refused when its step is opened.
    let sum = |part: &u64| usize::try_from(*part).ok().and_then(|part| sums.get(part)).copied().unwrap_or(u64::MAX);
    Ok(part.iter().map(sum).collect())
}
