//! Fields over time: the time axis, field descriptions, and the source of an uncompressed series.

mod blocks;
mod regions;
mod scalars;

use crate::error::FileResult;
use crate::mesh::RawMesh;
pub use blocks::{Block, Blocks};
pub use regions::Regions;
pub use scalars::Scalars;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Names of the fields of points that have the radii and the volumes of a cloud, in the first step.
pub(crate) const RADIUS: &str = "radius";
pub(crate) const VOLUME: &str = "volume";

/// Times of the steps, as stored in the file (never index * dt), in the file's unit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TimeAxis {
    /// Strictly increasing, finite.
    pub values: Vec<f64>,
}

impl TimeAxis {
    /// Number of steps.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there is no step.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }
}

/// Whether vertices or cells have the values of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Association {
    /// One value per vertex.
    Point,
    /// One value per cell, constant in it.
    Cell,
}

/// A field that a source offers.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct FieldInfo {
    /// Name as in the file.
    pub name: String,
    /// 1 for scalars, 3 for vectors, otherwise as in the file.
    pub components: usize,
    /// Whether values are per point or per cell.
    pub association: Association,
}

/// The component of a tuple that is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Component {
    /// Component by index (0 for scalars).
    Index(usize),
    /// Euclidean norm of the tuple.
    Magnitude,
}

/// A field and a component of it, as the user names them: `NAME`, `NAME:mag`, `NAME:0`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct FieldSelector {
    /// Name of the field.
    pub name: String,
    /// `None` if the user named none: the value of a scalar, the magnitude of anything else.
    pub component: Option<Component>,
}

impl FromStr for FieldSelector {
    type Err = std::convert::Infallible;

    /// Parses a selector. A suffix that is neither `mag` nor a number belongs to the name: names may contain colons.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if let Some((name, suffix)) = text.rsplit_once(':') {
            let component = match suffix {
                "mag" => Some(Component::Magnitude),
                _ if !suffix.is_empty() && suffix.bytes().all(|b| b.is_ascii_digit()) => {
                    suffix.parse().ok().map(Component::Index)
                }
                _ => None,
            };
            if component.is_some() && !name.is_empty() {
                return Ok(Self { name: name.to_owned(), component });
            }
        }
        Ok(Self { name: text.to_owned(), component: None })
    }
}

impl fmt::Display for FieldSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.component {
            None => f.write_str(&self.name),
            Some(Component::Magnitude) => write!(f, "{}:mag", self.name),
            Some(Component::Index(i)) => write!(f, "{}:{i}", self.name),
        }
    }
}

impl FieldSelector {
    /// The component to read of a field with `components` numbers per tuple.
    pub fn component_of(&self, components: usize) -> Component {
        self.component.unwrap_or(if components == 1 { Component::Index(0) } else { Component::Magnitude })
    }
}

/// An uncompressed series: any step of any field, in the file's own numbering of points and cells.
///
/// Implementations hold at most a few steps in memory. Every error names the file and the place.
pub trait SeriesSource: Sync {
    /// One-line description of the source, for reports and the store's attributes (a file name, generator and seed).
    fn describe(&self) -> String;
    /// Times of the steps.
    fn times(&self) -> &TimeAxis;
    /// Fields of the first step.
    fn fields(&self) -> &[FieldInfo];
    /// The unit of a field's values, as the source says it.
    fn unit(&self, _field: &FieldInfo) -> Option<String> {
        None
    }
    /// The mesh, the same for all steps.
    fn mesh(&self) -> FileResult<RawMesh>;
    /// The number of a cell of [`Self::mesh`] in the files, where other cells may come before it or be left out.
    fn cell_number(&self, cell: u32) -> u32 {
        cell
    }
    /// Values of one component of `field` at `step`: one per point or per cell of [`SeriesSource::mesh`], as the field's
    /// association says, into `out` (cleared first, so that its memory is used again).
    ///
    /// # Errors
    /// If the step cannot be read, lacks the field, or has another number of points or cells than the mesh.
    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()>;
    /// Checks a step without reading values: its mesh, and which fields it has. What it lacks is in the notes then.
    ///
    /// # Errors
    /// If the step cannot be read, or has another mesh.
    fn check(&self, _step: usize) -> FileResult<()> {
        Ok(())
    }
    /// [`Self::read`] without rounding to f32 what the source has more precisely.
    ///
    /// # Errors
    /// As for [`Self::read`].
    fn read_f64(&self, field: &FieldInfo, component: usize, step: usize, out: &mut Vec<f64>) -> FileResult<()> {
        let mut narrow = Vec::new();
        self.read(field, Component::Index(component), step, &mut narrow)?;
        out.clear();
        out.extend(narrow.into_iter().map(f64::from));
        Ok(())
    }
    /// The blocks of the mesh of [`Self::mesh`]; `None` if the source has none.
    ///
    /// # Errors
    /// If the first step cannot be read.
    fn blocks(&self) -> FileResult<Option<Blocks>> {
        Ok(None)
    }
    /// Lets points move: the mesh is that of the first step at all steps, and a field of points, the last one of [`Self::fields`], has the
    /// vectors from there to where they are. A source whose points cannot move has no such field.
    ///
    /// # Errors
    /// If the first step cannot be read.
    fn fix_points(&mut self) -> FileResult<()> {
        Ok(())
    }
    /// What reading the steps up to `last` has counted for [`Self::notes`], for another run to go on from.
    fn counted(&self, _last: usize) -> serde_json::Value {
        serde_json::Value::Null
    }
    /// Goes on from what an earlier run has [`Self::counted`] of the same source. What is no such count is ignored.
    fn count_on(&self, _counted: &serde_json::Value) {}
    /// Counts of skipped items (cells of lower dimension, say), one readable line each.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}
