//! `Grid` elements without nested grids: topology, geometry and attributes.

use super::super::cells::{self, Kind};
use super::super::pieces::COMPONENTS_MAX;
use super::function::{Function, is_function};
use super::items::Item;
use super::tree::{Document, Id};
use crate::error::FileResult;
use crate::field::{Association, FieldInfo};
use std::sync::Arc;

/// A mesh, or a piece of one, with its fields.
pub(crate) struct Grid {
    pub(super) document: Arc<Document>,
    pub(super) topology: Topology,
    pub(super) geometry: Geometry,
    pub(super) points: usize,
    pub(super) attributes: Vec<Attribute>,
    /// Names of attributes that are skipped, with the reason.
    pub(super) left_out: Vec<String>,
    /// What is read in part, one line each.
    pub(super) notes: Vec<String>,
}

/// The cells of a grid.
#[derive(Debug, Hash)]
pub(super) struct Topology {
    pub(super) id: Id,
    pub(super) shape: CellShape,
    pub(super) cells: usize,
    /// Number of points of each cell of points, if it is said.
    pub(super) nodes: Option<u64>,
    /// Vertex indices of the cells; `None` for cells of points in their order.
    pub(super) connectivity: Option<Item>,
    /// Index of the first point.
    pub(super) base: u64,
}

/// The types of the cells.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(super) enum CellShape {
    /// All cells have this VTK type.
    Same(u8),
    /// Each cell is preceded by its type.
    Mixed,
}

/// The point coordinates of a grid.
#[derive(Debug, Hash)]
pub(super) enum Geometry {
    /// Interleaved coordinates, 2 or 3 per point.
    Together(Item, usize),
    /// x, y and z in separate arrays.
    Apart(Box<[Item; 3]>),
}

/// A field of a grid.
#[derive(Debug)]
pub(super) struct Attribute {
    pub(super) field: FieldInfo,
    pub(super) stored: Stored,
}

/// The values of a field.
#[derive(Debug)]
pub(super) enum Stored {
    /// Tuple by tuple.
    Values(Item),
    /// By the dofs of cells.
    Function(Box<Function>),
}

impl Stored {
    /// The array with the values.
    pub(super) fn values(&self) -> &Item {
        match self {
            Self::Values(item) => item,
            Self::Function(function) => &function.coefficients,
        }
    }

    /// All arrays.
    pub(super) fn items(&self) -> Vec<&Item> {
        match self {
            Self::Values(item) => vec![item],
            Self::Function(function) => function.items().to_vec(),
        }
    }
}

/// An XDMF cell type: name, number in mixed topologies, number of corners, and VTK type.
pub(super) struct CellType {
    pub(super) name: &'static str,
    pub(super) code: u64,
    /// 0 if each cell gives the number.
    pub(super) corners: usize,
    pub(super) vtk: u8,
}

/// The cell types of `XdmfTopologyType`.
#[rustfmt::skip]
pub(super) const CELL_TYPES: &[CellType] = &[
    CellType { name: "Polyvertex", code: 1, corners: 0, vtk: 2 }, CellType { name: "Polyline", code: 2, corners: 0, vtk: 4 },
    CellType { name: "Polygon", code: 3, corners: 0, vtk: 7 }, CellType { name: "Triangle", code: 4, corners: 3, vtk: 5 },
    CellType { name: "Quadrilateral", code: 5, corners: 4, vtk: 9 }, CellType { name: "Tetrahedron", code: 6, corners: 4, vtk: 10 },
    CellType { name: "Pyramid", code: 7, corners: 5, vtk: 14 }, CellType { name: "Wedge", code: 8, corners: 6, vtk: 13 },
    CellType { name: "Hexahedron", code: 9, corners: 8, vtk: 12 }, CellType { name: "Polyhedron", code: 16, corners: 0, vtk: 42 },
    CellType { name: "Edge_3", code: 34, corners: 3, vtk: 21 }, CellType { name: "Quadrilateral_9", code: 35, corners: 9, vtk: 28 },
    CellType { name: "Triangle_6", code: 36, corners: 6, vtk: 22 }, CellType { name: "Quadrilateral_8", code: 37, corners: 8, vtk: 23 },
    CellType { name: "Tetrahedron_10", code: 38, corners: 10, vtk: 24 }, CellType { name: "Pyramid_13", code: 39, corners: 13, vtk: 27 },
    CellType { name: "Wedge_15", code: 40, corners: 15, vtk: 26 }, CellType { name: "Wedge_18", code: 41, corners: 18, vtk: 32 },
    CellType { name: "Hexahedron_20", code: 48, corners: 20, vtk: 25 }, CellType { name: "Hexahedron_24", code: 49, corners: 24, vtk: 33 },
    CellType { name: "Hexahedron_27", code: 50, corners: 27, vtk: 29 },
];

/// VTK's number of several points as one cell.
pub(super) const POLY_VERTEX: u8 = 2;

/// Other names of the same types that writers use.
const CELL_TYPE_ALIASES: &[(&str, &str)] = &[
    ("tet", "tetrahedron"),
    ("hex", "hexahedron"),
    ("tri", "triangle"),
    ("quad", "quadrilateral"),
    ("edge", "polyline"),
    ("interval", "polyline"),
    ("tet_10", "tetrahedron_10"),
    ("tri_6", "triangle_6"),
    ("hex_20", "hexahedron_20"),
    ("hex_27", "hexahedron_27"),
];

impl Grid {
    /// Reads the grid `id`.
    ///
    /// # Errors
    /// If it lacks topology or geometry, or these are of an unsupported kind; if the arrays of a function contradict each other.
    pub(super) fn of(document: &Arc<Document>, id: Id) -> FileResult<Self> {
        let children = document.children(id)?;
        let one = |name: &str| {
            let found = children.iter().copied().find(|&child| document.name(child) == name);
            found.ok_or_else(|| document.invalid(id, format!("has no <{name}>")))
        };
        let topology = Topology::of(document, one("Topology")?)?;
        let (geometry, points) = geometry(document, one("Geometry")?)?;
        let mut grid = Self {
            document: document.clone(),
            topology,
            geometry,
            points,
            attributes: Vec::new(),
            left_out: Vec::new(),
            notes: Vec::new(),
        };
        for &child in children.iter().filter(|&&child| document.name(child) == "Attribute") {
            if is_function(document, child) {
                grid.add_function(document, child)?;
            } else {
                grid.add_attribute(document, child);
            }
        }
        Ok(grid)
    }

    /// Adds a field, or a note if it is unsupported: the other fields can still be read.
    fn add_attribute(&mut self, document: &Document, id: Id) {
        let name = document.attribute(id, "Name").unwrap_or("").to_owned();
        let read = || -> Result<Attribute, String> {
            if name.is_empty() {
                return Err("has no name".to_owned());
            }
            let (association, tuples) = match document.attribute(id, "Center").unwrap_or("Node").trim() {
                "Node" => (Association::Point, self.points),
                "Cell" => (Association::Cell, self.topology.cells),
                other => return Err(format!("is of Center {other}")),
            };
            let items = document.children_named(id, "DataItem").map_err(|e| e.to_string())?;
            let &[item] = items.as_slice() else { return Err(format!("has {} arrays", items.len())) };
            let item = Item::of(document, item).map_err(|e| e.problem)?;
            let components =
                item.len().and_then(|n| usize::try_from(n).ok()).filter(|_| tuples > 0).map(|n| n / tuples);
            let components = components.filter(|&n| {
                (1..=COMPONENTS_MAX).contains(&(n as u64)) && item.len() == n.checked_mul(tuples).map(|n| n as u64)
            });
            let components = components.ok_or_else(|| format!("has {:?} numbers for {tuples} tuples", item.dims))?;
            let field = FieldInfo { name: name.clone(), components, association };
            Ok(Attribute { field, stored: Stored::Values(item) })
        };
        match read() {
            Ok(attribute) => self.attributes.push(attribute),
            Err(reason) => self.left_out.push(format!("'{name}' ({reason})")),
        }
    }
}

impl Topology {
    fn of(document: &Document, id: Id) -> FileResult<Self> {
        let name = document.either(id, &["TopologyType", "Type"]).unwrap_or("");
        let shape = shape_of(document, id, name)?;
        let connectivity = match document.children_named(id, "DataItem")?.as_slice() {
            [] => None,
            [item] => Some(Item::of(document, *item)?),
            _ => return Err(document.unsupported(id, "has several arrays, which is not read")),
        };
        let nodes = document.attribute(id, "NodesPerElement").and_then(|text| text.trim().parse().ok());
        let cells = cell_count(document, id, (name, nodes), connectivity.as_ref())?;
        let base = document.count(id, "BaseOffset")?.unwrap_or(0);
        Ok(Self { id, shape, cells, nodes, connectivity, base })
    }
}

/// The cell type of a name, in any case, long or short.
fn type_named(name: &str) -> Option<&'static CellType> {
    let name = name.to_ascii_lowercase();
    let name = CELL_TYPE_ALIASES.iter().find(|(alias, _)| *alias == name).map_or(name.as_str(), |(_, full)| full);
    CELL_TYPES.iter().find(|t| t.name.eq_ignore_ascii_case(name))
}

fn shape_of(document: &Document, id: Id, name: &str) -> FileResult<CellShape> {
    if name.eq_ignore_ascii_case("Mixed") {
        return Ok(CellShape::Mixed);
    }
    let Some(cell_type) = type_named(name) else {
        let problem = format!("TopologyType=\"{name}\" is not read: only unstructured grids are");
        return Err(document.unsupported(id, problem));
    };
    // Polyhedra are read from mixed topologies.
    if matches!(cells::kind(cell_type.vtk), Kind::Unread | Kind::Polyhedron) {
        let what = format!("its cells are of type {} ({})", cell_type.name, cells::name_of(cell_type.vtk));
        return Err(cells::refuse_solid(document.path(), document.place(id), &what));
    }
    Ok(CellShape::Same(cell_type.vtk))
}

/// Number of cells, as given or counted.
fn cell_count(
    document: &Document,
    id: Id,
    (name, nodes): (&str, Option<u64>),
    connectivity: Option<&Item>,
) -> FileResult<usize> {
    let said = document.either(id, &["NumberOfElements", "Dimensions"]).filter(|text| !text.is_empty());
    if let Some(text) = said {
        let counts: Option<Vec<usize>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        let product = counts.and_then(|counts| counts.iter().try_fold(1_usize, |n, &d| n.checked_mul(d)));
        return product.ok_or_else(|| document.invalid(id, format!("'{text}' is no number of cells")));
    }
    let corners = nodes.unwrap_or_else(|| match type_named(name) {
        Some(CellType { vtk: POLY_VERTEX, .. }) => 1,
        of_type => of_type.map_or(0, |t| t.corners as u64),
    });
    let count = connectivity.and_then(Item::len).and_then(|n| n.checked_div(corners)).map(usize::try_from);
    count.and_then(Result::ok).ok_or_else(|| document.invalid(id, "lacks its NumberOfElements"))
}

/// The coordinates, and the number of points.
fn geometry(document: &Document, id: Id) -> FileResult<(Geometry, usize)> {
    let name = document.either(id, &["GeometryType", "Type"]).unwrap_or("XYZ").to_ascii_uppercase();
    let items = document.children_named(id, "DataItem")?;
    let items: Vec<Item> = items.into_iter().map(|item| Item::of(document, item)).collect::<FileResult<_>>()?;
    let several =
        || document.unsupported(id, format!("GeometryType=\"{name}\" with {} arrays is not read", items.len()));
    let (geometry, numbers, width) = match (name.as_str(), items.as_slice()) {
        ("XYZ", [item]) => (Geometry::Together(item.clone(), 3), item.len(), 3),
        ("XY", [item]) => (Geometry::Together(item.clone(), 2), item.len(), 2),
        ("X_Y_Z", [x, y, z]) if x.len() == y.len() && x.len() == z.len() => {
            (Geometry::Apart(Box::new([x.clone(), y.clone(), z.clone()])), x.len(), 1)
        }
        _ => return Err(several()),
    };
    let numbers = numbers.and_then(|n| usize::try_from(n).ok()).filter(|n| n.is_multiple_of(width));
    let numbers =
        numbers.ok_or_else(|| document.invalid(id, format!("its Dimensions are no points of {width} coordinates")))?;
    Ok((geometry, numbers / width))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_sorted_by_code_and_known_to_vtk() {
        assert!(CELL_TYPES.windows(2).all(|pair| pair[0].code < pair[1].code));
        assert!(CELL_TYPES.iter().all(|t| cells::kind_of(t.vtk.into()).is_some()));
        assert_eq!(type_named("TETRAHEDRON").map(|t| t.vtk), Some(10));
        assert!(CELL_TYPE_ALIASES.iter().all(|(alias, full)| type_named(alias).map(|t| t.name.to_ascii_lowercase()) == Some((*full).to_owned())));
    }
}
