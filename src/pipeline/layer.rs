//! What a frame shows, layer by layer, as plain data.

use super::TetDraw;
use crate::node_table::TransferTable;
use crate::optics::OpticsKind;
use crate::transfer::TransferSource;
use serde::{Serialize, Serializer};
use std::sync::Arc;

/// A layer of a frame: a closed set, so that whoever draws, keeps or writes frames knows all that can be asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Layer {
    /// The cells of the mesh.
    Tets(TetLayer),
}

/// The cells of a mesh with the scalars of a field.
///
/// Only the volume can be seen yet: [`Surface`] and [`Cut`] have no values and [`Shading`] has one, until something draws more of them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TetLayer {
    /// Name of the field, as the series has it ([`StoredField::name`](crate::store::StoredField::name)); `None`: that of the series,
    /// whichever it is.
    pub field: Option<String>,
    /// Transfer function over the field's scalars.
    pub table: TransferTable,
    /// What the table was made from, if that is known: the reference evaluates it by its formula, and the table without it.
    #[serde(serialize_with = "content")]
    pub formula: Option<Arc<TransferSource>>,
    /// How segments are integrated; the reference does it in its own way.
    pub optics: OpticsKind,
    /// Isosurfaces in the cells.
    pub surfaces: Vec<Surface>,
    /// Cuts through the cells.
    pub cuts: Vec<Cut>,
    /// Light on surfaces and cuts.
    pub shading: Shading,
    /// Whether the volume is drawn.
    pub volume: bool,
    /// How the cells are drawn.
    pub draw: TetDraw,
}

/// An isosurface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Surface {}

/// A cut through cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Cut {}

/// Light on surfaces and cuts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Shading {
    /// None: colours are those of the transfer function.
    #[default]
    None,
}

impl TetLayer {
    /// The volume of the series' own field, with everything else as by default: the fastest accurate renderer, exact optics.
    pub fn new(table: impl Into<TransferTable>) -> Self {
        let (field, formula, optics, surfaces, cuts, shading, draw) = Default::default();
        Self { field, table: table.into(), formula, optics, surfaces, cuts, shading, volume: true, draw }
    }

    /// Whether both show the same: only the judge asks for the formula.
    pub(super) fn looks_like(&self, other: &Self) -> bool {
        let is_judge = self.draw == TetDraw::Reference;
        let Self { field, table, formula, optics, surfaces, cuts, shading, volume, draw } = self;
        (field, surfaces, cuts) == (&other.field, &other.surfaces, &other.cuts)
            && (*optics, *shading, *volume, *draw) == (other.optics, other.shading, other.volume, other.draw)
            && *table == other.table
            && (!is_judge || *formula == other.formula)
    }
}

/// What the source is, not where.
fn content<S: Serializer>(source: &Option<Arc<TransferSource>>, serializer: S) -> Result<S::Ok, S::Error> {
    source.as_deref().serialize(serializer)
}

/// Why there is no frame of a request, whatever the series holds.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// Two layers of cells.
    #[error("layers {first} and {second} of the request are both of cells (tets); a frame has one of them")]
    TwoOfCells {
        /// Place of the first of them.
        first: usize,
        /// Place of the next one.
        second: usize,
    },
    /// A field that is not played.
    #[error("the request is for the field '{asked}', but the series is of '{played}'; ask for that, or open the other")]
    OtherField {
        /// Name of the field asked for.
        asked: String,
        /// Name of the field that the series is of.
        played: String,
    },
}

#[cfg(test)]
#[path = "layer_tests.rs"]
mod tests;
