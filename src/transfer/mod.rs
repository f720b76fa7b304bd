//! Builds the [`NodeTable`](crate::node_table::NodeTable) that renderers use from what a user edits: colour maps, opacity points, range
//! policies.
//!
//! A [`TransferFunction`] is a [`ColorMap`] and opacity points. A [`RangePolicy`] says which scalars its axis 0..1 covers
//! ([`MappedRange`]), which a [`RangeMap`] may stretch. [`build_node_table`] puts both together; an [`Ensemble`] blends several
//! by way of [`Curve`]s. `docs/transfer-functions.md` is the user's page.

mod blend;
mod built_in;
mod color_map;
mod color_space;
mod curve;
mod ensemble;
mod file;
mod first_look;
mod formula;
mod function;
mod keyframes;
mod opacity;
mod paraview;
mod pieces;
mod profile;
mod range;
mod range_map;
mod table;
mod text;
mod tolerance;
mod widget;

pub use blend::Blend;
pub use color_map::{ColorMap, ColorPoint};
pub use curve::Curve;
pub use ensemble::{
    Context, Counts2d, Ensemble, Evaluator, Function, Line, Member, Reduction, Sample, Space, joint_table,
};
pub use first_look::FirstLook;
pub use formula::{BlendedEnsembles, Formula, TransferContent, TransferSource};
pub use function::{OpacityPoint, OpacityValues, PositionKind, TransferFunction};
pub use opacity::OpacityKind;
pub use paraview::{ColorMapEntry, color_maps_to_json, read_color_maps};
pub use pieces::ColorWeighting;
pub use range::{MappedRange, RangePolicy};
pub use range_map::RangeMap;
pub use table::build_node_table;
pub use tolerance::{COLOR_TOLERANCE, DEPTH_SHARE, DEPTH_TOLERANCE, JOINT_TOLERANCE, Lengths};
pub use widget::{Part, Polyline, PolylinePoint, Rectangle, Triangle, Widget};

use crate::error::FileError;
use crate::node_table::{JointTableError, NodeTableError};
use crate::short::Short;

/// Why a transfer function, a range or a table is invalid.
#[derive(Debug, thiserror::Error)]
pub enum TransferError {
    /// A part of a text (`--tf`, `--range`, `--opacity-kind`) cannot be read.
    #[error("'{part}': {problem}")]
    BadText {
        /// The offending part.
        part: String,
        /// What is wrong with it, and what would be right.
        problem: String,
    },
    /// Neither a built-in colour map nor a file.
    #[error("there is no colour map '{name}'; there are {known}, each also with _r (reversed), or give a .json file")]
    UnknownMap {
        /// The name asked for.
        name: String,
        /// All built-in names.
        known: String,
    },
    /// Not a built-in colour map, where there is no folder to look for files in.
    #[error(
        "there is no built-in colour map '{name}'; there are {known}, each also with _r (reversed), or the map itself stands in its \
         place, with Name and RGBPoints as ParaView writes it"
    )]
    NoBuiltInMap {
        /// The name asked for.
        name: String,
        /// All built-in names.
        known: String,
    },
    /// A colour map or transfer function file is at fault.
    #[error(transparent)]
    File(#[from] FileError),
    /// A colour map is at fault.
    #[error("colour map '{name}': {problem}")]
    BadMap {
        /// Name of the map.
        name: String,
        /// What is wrong.
        problem: String,
    },
    /// An opacity point is at fault.
    #[error("opacity point {index} ({}:{}): {problem}", Short(.position), Short(.value))]
    BadPoint {
        /// Which point, from 0.
        index: usize,
        /// Its position.
        position: f64,
        /// Its value.
        value: f64,
        /// What is wrong.
        problem: &'static str,
    },
    /// A transfer function without opacity points.
    #[error("a transfer function needs at least one opacity point, as in viridis@0:0,1:0.2")]
    NoPoints,
    /// A range that cannot be mapped.
    #[error("range {}..{}: {problem}", Short(.lo), Short(.hi))]
    BadRange {
        /// Lower end.
        lo: f64,
        /// Upper end.
        hi: f64,
        /// What is wrong.
        problem: &'static str,
    },
    /// A member of an ensemble is at fault.
    #[error("member '{member}': {problem}")]
    BadMember {
        /// Name of the member.
        member: String,
        /// What is wrong with it.
        problem: String,
    },
    /// Two ensembles of which one has opacities and the other extinctions.
    #[error(
        "an ensemble of opacities and one of extinctions cannot be mixed; the opacity kind 'extinction' makes both alike"
    )]
    MixedKinds,
    /// The curve of an ensemble has too many points.
    #[error("an ensemble has more than {most} points in one curve; it has too many members or widgets")]
    TooManyPoints {
        /// Most points of a curve.
        most: usize,
    },
    /// Members that keep their axes need too many positions on them.
    #[error(
        "members that keep their axes change in {covs} places of the coefficient of variation and in {gradients} of the gradient; a table has {most} pairs of these at most, so reduce members of one of both, or give them fewer widgets"
    )]
    TooManyPlaces {
        /// Positions on the axis of the coefficient of variation.
        covs: usize,
        /// Positions on the axis of gradient magnitudes.
        gradients: usize,
        /// Most pairs that a table may have.
        most: usize,
    },
    /// A range map does not increase.
    #[error(
        "range map: point {index} is followed by one that does not lie to the right of it and above; between 0,0 and 1,1 both coordinates must increase"
    )]
    BadRangeMap {
        /// Which point, counted from 0, the end at 0,0.
        index: usize,
    },
    /// A unit distance that is not positive, not finite, or so small that extinction overflows.
    #[error("unit distance {} must be positive and finite, and extinction per unit must not overflow", Short(.0))]
    BadUnitDistance(f64),
    /// A longest path that is not positive or not finite.
    #[error("the longest path, {0}, must be positive and finite")]
    BadLongestPath(f64),
    /// The nodes do not make a table.
    #[error(transparent)]
    Table(#[from] NodeTableError),
    /// Values do not make a table over several axes.
    #[error(transparent)]
    Joint(#[from] JointTableError),
}

#[cfg(test)]
mod tests;
