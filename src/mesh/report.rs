//! Report of what [`Mesh::build`](super::Mesh::build) found and repaired.

use std::fmt;

use super::{CloudReport, FarParts, Unconnected};
use crate::short::Short;
use serde::Serialize;

/// Counts of what was found and repaired while a mesh was built. `Display` gives a clean mesh one line, and any other
/// one more line for each kind of repair or defect.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RepairReport {
    /// Cells in the source.
    pub cells_in: u64,
    /// Cells of the source that were split into several tetrahedra, which are cells of the mesh.
    #[serde(skip_serializing_if = "is_zero")]
    pub split_cells: u64,
    /// Split cells that are cut from a point added in their middle, as their corners alone gave tetrahedra that overlap or leave inner faces
    /// open.
    #[serde(skip_serializing_if = "is_zero")]
    pub steiner_cells: u64,
    /// Split cells some tetrahedra of which overlap others, as their faces are warped.
    #[serde(skip_serializing_if = "is_zero")]
    pub warped_cells: u64,
    /// Split cells some tetrahedra of which have no volume and are dropped: what these would have closed is left open.
    #[serde(skip_serializing_if = "is_zero")]
    pub gapped_cells: u64,
    /// Cells in the mesh.
    pub cells_out: u64,
    /// Tetrahedra of the source of negative orientation, two vertices of which were swapped.
    pub flipped: u64,
    /// Cells dropped because they have no volume (a vertex named twice, or vertices in one plane after rounding).
    pub zero_volume: u64,
    /// Cells dropped because an earlier one has the same four vertices.
    pub duplicate_cells: u64,
    /// Points in the source.
    pub vertices_in: u64,
    /// Vertices in the mesh, with those that were added in the middle of cells.
    pub vertices_out: u64,
    /// Points dropped because no cell that was kept uses them.
    pub unreferenced_vertices: u64,
    /// Vertices at the rounded position of another vertex of lower source index. They are kept: their scalars may differ.
    pub coincident_points: u64,
    /// Triangles shared by more than two cells, or by two cells on the same side. They count as boundary for each of
    /// their cells.
    pub non_manifold_faces: u64,
    /// Unique faces with a cell on one side only, non-manifold ones once for each of their cells.
    pub boundary_faces: u64,
    /// Connected components, through faces.
    pub parts: u64,
    /// What is known of the faces of cells that were imported without connectivity, which has then no non-manifold or boundary faces and no
    /// parts; `None` with connectivity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unconnected: Option<Unconnected>,
    /// What is particular to a cloud; `None` for a mesh of cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cloud: Option<CloudReport>,
    /// Parts so far away that the default view leaves them out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub far_parts: Option<FarParts>,
    /// The tetrahedra of the greatest aspect ratios, the worst first; at most [`WorstCell::MOST`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub worst_cells: Vec<WorstCell>,
}

/// A tetrahedron far from a regular one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstCell {
    /// The cell of the [`RawMesh`](super::RawMesh) that it is, or is a part of; in the report of an import its number in the files.
    pub source: u32,
    /// Its aspect ratio ([`tet_aspect_ratio`](super::tet_aspect_ratio)).
    pub aspect_ratio: f64,
}

impl WorstCell {
    /// Number of cells that are named.
    pub const MOST: usize = 5;
    /// Aspect ratios up to this are not worth a line: boundary layers have them.
    const WORTH_A_LINE: f64 = 1000.0;
}

/// Whether a count is left out: meshes of tetrahedra say nothing of splits.
fn is_zero(count: &u64) -> bool {
    *count == 0
}

impl RepairReport {
    /// The report with other numbers of cells.
    pub fn with_cell_numbers(mut self, number: impl Fn(u32) -> u32) -> Self {
        self.worst_cells.iter_mut().for_each(|worst| worst.source = number(worst.source));
        self.far_parts.iter_mut().for_each(|far| far.cell = number(far.cell));
        self
    }

    /// Whether the source needed no repair and has no defects.
    pub fn is_clean(&self) -> bool {
        self.far_parts.is_none() && self.unconnected.is_none() && self.findings().all(|(count, _)| count == 0)
    }

    /// The count and the explanation of each kind of repair or defect.
    fn findings(&self) -> impl Iterator<Item = (u64, &'static str)> {
        [
            (self.steiner_cells, "warped cells cut from a point added in their middle"),
            (self.warped_cells, "cells so warped that tetrahedra of theirs overlap kept"),
            (
                self.gapped_cells,
                "split cells without the flat ones of their tetrahedra, which may leave inner faces open",
            ),
            (self.flipped, "cells of negative orientation turned round"),
            (self.zero_volume, "cells without volume dropped"),
            (self.duplicate_cells, "cells with the vertices of an earlier one dropped"),
            (self.unreferenced_vertices, "points that no remaining cell uses dropped"),
            (self.coincident_points, "points at the position of another one kept, as their scalars may differ"),
            (self.cloud.map_or(0, |cloud| cloud.without_radius), "points without a radius above zero dropped"),
            (self.cloud.map_or(0, |cloud| cloud.without_volume), "points without a volume above zero dropped"),
            (self.non_manifold_faces, "faces of more than two cells, or of overlapping ones, treated as boundary"),
        ]
        .into_iter()
    }
}

impl fmt::Display for RepairReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counted = |count, one, many| format!("{count} {}", if count == 1 { one } else { many });
        if let Some(cloud) = &self.cloud {
            write!(f, "{}, {cloud}", counted(self.cells_out, "point", "points"))?;
            for (count, what) in self.findings().filter(|&(count, _)| count > 0) {
                write!(f, "\n{what}: {count}")?;
            }
            return Ok(());
        }
        f.write_str(&counted(self.cells_out, "cell", "cells"))?;
        write!(f, ", {}", counted(self.vertices_out, "vertex", "vertices"))?;
        match &self.unconnected {
            Some(unconnected) => write!(f, ", {unconnected}")?,
            None => {
                let faces = counted(self.boundary_faces, "boundary face", "boundary faces");
                write!(f, ", {faces}, {}", counted(self.parts, "part", "parts"))?;
            }
        }
        if self.split_cells > 0 {
            write!(f, "\nof {}, {} of them split", counted(self.cells_in, "cell", "cells"), self.split_cells)?;
        }
        for (count, what) in self.findings().filter(|&(count, _)| count > 0) {
            write!(f, "\n{what}: {count}")?;
        }
        if let Some(FarParts { parts, cells, cell, ratio, .. }) = &self.far_parts {
            let (parts, cells) = (counted(*parts, "part", "parts"), counted(*cells, "cell", "cells"));
            write!(
                f,
                "\nfar from the rest, which the default view shows alone: {parts} of {cells}, as cell {cell} of the source; "
            )?;
            write!(f, "the box of all is {ratio:.1e} times that of the rest")?;
        }
        if self.worst_cells.first().is_some_and(|worst| worst.aspect_ratio > WorstCell::WORTH_A_LINE) {
            let of = |cell: &WorstCell| format!("{} ({:.1e})", cell.source, cell.aspect_ratio);
            let cells: Vec<String> = self.worst_cells.iter().map(of).collect();
            write!(f, "\nflattest cells of the source (aspect ratio): {}", cells.join(", "))?;
        }
        Ok(())
    }
}

impl fmt::Display for CloudReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [least, most] = self.radius.map(Short);
        let how = if self.estimated { " (half the distance to the fourth nearest point)" } else { "" };
        write!(f, "radius {least} to {most}{how}")?;
        let Some([least, most]) = self.volume.map(|ends| ends.map(Short)) else { return Ok(()) };
        write!(f, ", volume {least} to {most}")
    }
}

impl fmt::Display for Unconnected {
    /// The end of the first line, and a line of what was counted.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { faces, alone, open, overlapping, duplicates } = self;
        write!(f, "without connectivity, to be drawn as points (--connectivity full derives it)")?;
        write!(
            f,
            "\nfaces without a partner: {alone} of {faces} that were looked at; by positions {open} without one"
        )?;
        write!(f, ", {overlapping} of cells that overlap; cells with the corners of an earlier one: {duplicates}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clean_mesh_is_reported_in_one_line() {
        let report = RepairReport { cells_out: 6, vertices_out: 8, boundary_faces: 12, parts: 1, ..Default::default() };
        assert!(report.is_clean());
        assert_eq!(report.to_string(), "6 cells, 8 vertices, 12 boundary faces, 1 part");
    }

    #[test]
    fn flat_cells_are_named_by_their_numbers_in_the_source() {
        let cell = |source, aspect_ratio| WorstCell { source, aspect_ratio };
        let of = |worst_cells| RepairReport { worst_cells, ..Default::default() }.to_string();
        let text = of(vec![cell(17, 23456.0), cell(4, 3.0)]);
        assert!(text.ends_with("flattest cells of the source (aspect ratio): 17 (2.3e4), 4 (3.0e0)"), "{text}");
        assert!(!of(vec![cell(17, 900.0)]).contains("flattest"));
    }

    #[test]
    fn split_cells_are_told() {
        let report = RepairReport { cells_in: 3, split_cells: 2, warped_cells: 1, cells_out: 10, ..Default::default() };
        assert!(!report.is_clean());
        let text = report.to_string();
        assert!(text.contains("\nof 3 cells, 2 of them split\ncells so warped"), "{text}");
        assert!(serde_json::to_string(&RepairReport::default()).is_ok_and(|json| !json.contains("split")));
    }

    #[test]
    fn each_kind_of_repair_has_its_line() {
        let report = RepairReport { parts: 2, flipped: 3, non_manifold_faces: 1, ..Default::default() };
        assert!(!report.is_clean());
        let lines: Vec<_> = report.to_string().lines().map(str::to_owned).collect();
        assert!(lines[0].ends_with("2 parts"), "{lines:?}");
        assert!(lines[1] == "cells of negative orientation turned round: 3", "{lines:?}");
        assert!(lines[2].starts_with("faces of more than two cells") && lines[2].ends_with(": 1"), "{lines:?}");
        assert_eq!(lines.len(), 3);
    }
}
