//! Regions of a mesh: the cells in which a field of cells has certain values, as those of a block or a material have.

use crate::short::Short;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// The cells whose value of a field of cells is in one of some ranges. As text `FIELD=VALUE,FROM..TO,...`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Regions {
    /// Name of the field, as options have it.
    pub field: String,
    /// Least and greatest value of each range, in the numbers that fields have; equal for a single value.
    pub values: Vec<[f32; 2]>,
}

impl Regions {
    /// Whether a cell with this value is shown.
    pub fn show(&self, value: f32) -> bool {
        self.values.iter().any(|&[from, to]| from <= value && value <= to)
    }

    /// Whether some value of a range, from least to greatest, is shown.
    pub fn meet(&self, [least, greatest]: [f32; 2]) -> bool {
        self.values.iter().any(|&[from, to]| from <= greatest && least <= to)
    }

    /// The regions of a field whose values are given as text: `VALUE,FROM..TO,...`.
    ///
    /// # Errors
    /// If the text is something else.
    pub fn of_field(field: &str, values: &str) -> Result<Self, String> {
        let malformed = || format!("'{values}' is no list of values; write VALUE,FROM..TO, as in 0,3..5");
        let number = |text: &str| text.trim().parse().ok().filter(|value: &f32| !value.is_nan()).ok_or_else(malformed);
        let range = |text: &str| -> Result<[f32; 2], String> {
            let [from, to] = match text.split_once("..") {
                Some((from, to)) => [number(from)?, number(to)?],
                None => [number(text)?; 2],
            };
            if from <= to { Ok([from, to]) } else { Err(format!("'{text}' ends before it begins")) }
        };
        let values = values.split(',').map(range).collect::<Result<_, _>>()?;
        Ok(Self { field: field.to_owned(), values })
    }

    /// The values as text, which [`Self::of_field`] reads.
    pub fn values_as_text(&self) -> String {
        let range = |&[from, to]: &[f32; 2]| {
            if from == to { Short(from).to_string() } else { format!("{}..{}", Short(from), Short(to)) }
        };
        self.values.iter().map(range).collect::<Vec<_>>().join(",")
    }
}

impl FromStr for Regions {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let malformed = || format!("'{text}' is no choice of regions; write FIELD=VALUE,FROM..TO, as in block=0,3..5");
        let (field, values) = text.rsplit_once('=').ok_or_else(malformed)?;
        if field.trim().is_empty() { Err(malformed()) } else { Self::of_field(field.trim(), values) }
    }
}

impl TryFrom<String> for Regions {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Regions> for String {
    fn from(regions: Regions) -> Self {
        regions.to_string()
    }
}

impl fmt::Display for Regions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.field, self.values_as_text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_comes_back_and_what_is_no_choice_is_refused() {
        for text in ["block=0,3..5", "a=b=-1.5", "T (cell)=-1e30..2,7"] {
            let regions: Regions = text.parse().unwrap();
            assert_eq!(regions.to_string().parse::<Regions>(), Ok(regions), "{text}");
        }
        let regions: Regions = "block=0,3..5".parse().unwrap();
        assert_eq!((regions.field.as_str(), &regions.values[..]), ("block", &[[0.0, 0.0], [3.0, 5.0]][..]));
        assert!([0.0, 3.0, 4.5, 5.0].iter().all(|value| regions.show(*value)));
        assert!(regions.meet([-1.0, 0.0]) && regions.meet([4.0, 4.5]) && regions.meet([-9.0, 9.0]));
        assert!(!regions.meet([0.5, 2.5]) && !regions.meet([6.0, 7.0]));
        assert!(![-0.1, 0.1, 5.1, f32::NAN, f32::INFINITY].iter().any(|value| regions.show(*value)));
        // Fields have 0.7 and 0.1 as f32, which are below and above.
        let regions: Regions = "phase=0.1,0.7..1".parse().unwrap();
        assert!(regions.show(0.1) && regions.show(0.7) && !regions.show(0.1f32.next_up()));
        for text in ["", "block", "block=", "=1", "block=1,", "block=a", "block=5..3", "block=nan"] {
            assert!(text.parse::<Regions>().is_err(), "{text}");
        }
    }
}
