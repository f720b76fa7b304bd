//! Types of elements.

use crate::mesh::POLYHEDRON_VTK_TYPE;

/// The type of polygons, and that of polyhedra.
pub(super) const NSIDED: u8 = 7;
pub(super) const NFACED: u8 = POLYHEDRON_VTK_TYPE;

/// Name, number of nodes and VTK's type of the elements. Corners come first in all.
const ELEMENT_TYPES: &[(&str, usize, u8)] = &[
    ("point", 1, 1),
    ("bar2", 2, 3),
    ("bar3", 3, 21),
    ("tria3", 3, 5),
    ("tria6", 6, 22),
    ("quad4", 4, 9),
    ("quad8", 8, 23),
    ("tetra4", 4, 10),
    ("tetra10", 10, 24),
    ("pyramid5", 5, 14),
    ("pyramid13", 13, 27),
    ("penta6", 6, 13),
    ("penta15", 15, 26),
    ("hexa8", 8, 12),
    ("hexa20", 20, 25),
    ("nsided", 0, NSIDED),
    ("nfaced", 0, NFACED),
];

/// A type of elements: those of ghosts are of other pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ElementType {
    pub(super) name: &'static str,
    /// Number of nodes; 0 if each element has its own.
    pub(super) nodes: usize,
    pub(super) vtk: u8,
    pub(super) is_ghost: bool,
}

/// The type of that name.
pub(super) fn element_type(name: &str) -> Option<ElementType> {
    let (plain, is_ghost) = name.strip_prefix("g_").map_or((name, false), |plain| (plain, true));
    let found = ELEMENT_TYPES.iter().find(|(known, ..)| *known == plain);
    found.map(|&(name, nodes, vtk)| ElementType { name, nodes, vtk, is_ghost })
}
