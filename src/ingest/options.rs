//! The options of an import.

use super::checkpoints::Checkpoints;
use crate::codec::CodecChoice;
use crate::field::FieldSelector;
use crate::mesh::ConnectivityChoice;
use std::fmt;
use std::str::FromStr;

/// Steps A..B:S: zero-based, both ends included, every S-th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepRange {
    /// First step.
    pub first: usize,
    /// Last step, included; `None` for the last one there is.
    pub last: Option<usize>,
    /// Distance from one step to the next, at least 1.
    pub stride: usize,
}

impl Default for StepRange {
    /// All steps.
    fn default() -> Self {
        Self { first: 0, last: None, stride: 1 }
    }
}

/// An invalid range of steps, or one that the series does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StepRangeError {
    /// Not of the form `A..B:S`.
    #[error("'{0}' is no range of steps; write A..B or A..B:S with whole numbers, both ends included, e.g. 0..99:10")]
    Malformed(String),
    /// The stride is 0.
    #[error("'{0}' has a stride of 0; the smallest is 1")]
    NoStride(String),
    /// The last step is before the first.
    #[error("steps {0} end before they begin")]
    Reversed(StepRange),
    /// The range exceeds the series.
    #[error("steps {range} reach beyond the series, whose steps are 0..{}", .count.saturating_sub(1))]
    Beyond {
        /// The range.
        range: StepRange,
        /// Number of steps in the series.
        count: usize,
    },
}

impl FromStr for StepRange {
    type Err = StepRangeError;

    /// Parses `A..B:S`; without S every step, without A from the first, without B to the last, and `A` alone is one step.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let malformed = || StepRangeError::Malformed(text.to_owned());
        let number = |part: &str| part.trim().parse::<usize>().map_err(|_| malformed());
        let (ends, stride) = match text.split_once(':') {
            Some((ends, stride)) => (ends, number(stride)?),
            None => (text, 1),
        };
        if stride == 0 {
            return Err(StepRangeError::NoStride(text.to_owned()));
        }
        let range = match ends.split_once("..") {
            Some((first, last)) => Self {
                first: if first.trim().is_empty() { 0 } else { number(first)? },
                last: if last.trim().is_empty() { None } else { Some(number(last)?) },
                stride,
            },
            None => Self { first: number(ends)?, last: Some(number(ends)?), stride },
        };
        if range.last.is_some_and(|last| last < range.first) {
            return Err(StepRangeError::Reversed(range));
        }
        Ok(range)
    }
}

impl fmt::Display for StepRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..", self.first)?;
        if let Some(last) = self.last {
            write!(f, "{last}")?;
        }
        if self.stride != 1 { write!(f, ":{}", self.stride) } else { Ok(()) }
    }
}

impl StepRange {
    /// The range without steps beyond the last of `count`; one that begins beyond it stays as it is.
    #[must_use]
    pub fn within(self, count: usize) -> Self {
        let is_too_long = self.first < count && self.last.is_some_and(|last| last >= count);
        if is_too_long { Self { last: None, ..self } } else { self }
    }

    /// Indices of the selected steps in a series of `count` steps; at least one.
    ///
    /// # Errors
    /// If an end is not in the series, the range is reversed, or the stride is 0.
    pub fn select(&self, count: usize) -> Result<Vec<usize>, StepRangeError> {
        let last = self.last.unwrap_or(count.saturating_sub(1));
        if self.stride == 0 {
            return Err(StepRangeError::NoStride(self.to_string()));
        }
        if self.first >= count || last >= count {
            return Err(StepRangeError::Beyond { range: *self, count });
        }
        if last < self.first {
            return Err(StepRangeError::Reversed(*self));
        }
        Ok((self.first..=last).step_by(self.stride).collect())
    }
}

/// The unit of a field, as the user writes it: `FIELD=UNIT`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldUnits {
    /// Name of the field; a vector's name includes its components and their magnitude.
    pub field: String,
    /// Unit of its values, for display only.
    pub units: String,
}

impl FromStr for FieldUnits {
    type Err = String;

    /// The last `=` separates them: names may contain one, units do not.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.rsplit_once('=').map(|(field, units)| (field, units.trim())) {
            Some((field, units)) if !field.is_empty() && !units.is_empty() => {
                Ok(Self { field: field.to_owned(), units: units.to_owned() })
            }
            _ => Err(format!("'{text}' names no unit; write FIELD=UNIT, e.g. T=K")),
        }
    }
}

/// The options of an import.
#[derive(Clone, Debug, Default)]
pub struct IngestOptions {
    /// Fields and components; empty for all fields. A vector without a component becomes one field per component, and their magnitude.
    pub fields: Vec<FieldSelector>,
    /// Units of fields. Each must be imported.
    pub units: Vec<FieldUnits>,
    /// Range of steps.
    pub steps: StepRange,
    /// Codec.
    pub codec: CodecChoice,
    /// Whether values of cells are brought to the vertices: the mean of the cells around, weighted by their volumes.
    pub cells_to_points: bool,
    /// Whether faces and neighbours are derived and stored.
    pub connectivity: ConnectivityChoice,
    /// Radius of the points of a cloud, in place of those that the source has; `None`: these, else half the distance to the fourth nearest
    /// point.
    pub radius: Option<f64>,
    /// Volume of the points of a cloud, in place of those that the source has; `None`: these, else those of the balls.
    pub volume: Option<f64>,
    /// Whether an existing store is replaced.
    pub overwrite: bool,
    /// How often the state is kept in the folder `NAME.partial` beside the store NAME. If this import ends early, another one with the same
    /// options goes on from there, with the same source opened anew. `None`: never, and nothing is left.
    pub checkpoints: Option<Checkpoints>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn select(text: &str, count: usize) -> Vec<usize> {
        text.parse::<StepRange>().unwrap().select(count).unwrap()
    }

    #[test]
    fn a_range_ends_with_the_series_but_does_not_begin_behind_it() {
        let steps = |text: &str| text.parse::<StepRange>().unwrap().within(5).select(5).ok();
        assert_eq!(steps("0..99:2"), Some(vec![0, 2, 4]));
        assert_eq!(steps("3..5"), Some(vec![3, 4]));
        assert_eq!((steps("1..4:3"), steps("2..")), (Some(vec![1, 4]), Some(vec![2, 3, 4])));
        assert_eq!([steps("5"), steps("5.."), steps("7..9")], [None, None, None]);
    }

    #[test]
    fn both_ends_are_included() {
        assert_eq!(select("0..3", 10), [0, 1, 2, 3]);
        assert_eq!(select("2..9:3", 10), [2, 5, 8]);
        assert_eq!(select("2..8:3", 10), [2, 5, 8]);
        assert_eq!(select("5..5", 10), [5]);
        assert_eq!(select("5", 10), [5]);
        assert_eq!(select("7..", 10), [7, 8, 9]);
        assert_eq!(select("..2", 10), [0, 1, 2]);
        assert_eq!(select("..:4", 10), [0, 4, 8]);
        assert_eq!(StepRange::default().select(3).unwrap(), [0, 1, 2]);
    }

    #[test]
    fn what_is_no_range_is_refused() {
        for text in ["", "a..b", "1..2..3", "-1..2", "1..2:", "1..2:x", "1.5", "99999999999999999999"] {
            assert!(matches!(text.parse::<StepRange>(), Err(StepRangeError::Malformed(_))), "{text}");
        }
        assert!(matches!("0..9:0".parse::<StepRange>(), Err(StepRangeError::NoStride(_))));
        assert!(matches!("9..0".parse::<StepRange>(), Err(StepRangeError::Reversed(_))));
    }

    #[test]
    fn a_range_beyond_the_series_is_refused_not_cut() {
        let range: StepRange = "0..10".parse().unwrap();
        assert_eq!(range.select(10), Err(StepRangeError::Beyond { range, count: 10 }));
        assert!(StepRange::default().select(0).is_err());
    }

    #[test]
    fn a_unit_follows_the_last_equals_sign() {
        let parsed = |text: &str| text.parse::<FieldUnits>().map(|u| (u.field, u.units));
        assert_eq!(parsed("velocity=m/s"), Ok(("velocity".to_owned(), "m/s".to_owned())));
        assert_eq!(parsed("a=b= kg m^-3"), Ok(("a=b".to_owned(), "kg m^-3".to_owned())));
        for text in ["T", "T=", "T= ", "=K", ""] {
            assert!(parsed(text).unwrap_err().contains("FIELD=UNIT"), "{text}");
        }
    }

    #[test]
    fn text_and_range_are_inverse() {
        for text in ["0..99:10", "3..", "0..7"] {
            assert_eq!(text.parse::<StepRange>().unwrap().to_string(), text);
        }
    }
}
