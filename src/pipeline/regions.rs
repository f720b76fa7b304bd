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
    /// Least and greatest value of each range; equal for a single value.
    pub values: Vec<[f64; 2]>,
}

impl Regions {
    /// Whether a cell with this value is shown.
    pub fn show(&self, value: f32) -> bool {
        let value = f64::from(value);
        self.values.iter().any(|&[from, to]| from <= value && value <= to)
    }
}

impl FromStr for Regions {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let malformed = || format!("'{text}' is no choice of regions; write FIELD=VALUE,FROM..TO, as in block=0,3..5");
        let (field, values) = text.rsplit_once('=').ok_or_else(malformed)?;
        let number = |text: &str| text.trim().parse().ok().filter(|value: &f64| !value.is_nan()).ok_or_else(malformed);
        let range = |text: &str| -> Result<[f64; 2], String> {
            let [from, to] = match text.split_once("..") {
                Some((from, to)) => [number(from)?, number(to)?],
                None => [number(text)?; 2],
            };
            if from <= to { Ok([from, to]) } else { Err(format!("'{text}' ends before it begins")) }
        };
        let values = values.split(',').map(range).collect::<Result<Vec<_>, _>>()?;
        if field.trim().is_empty() { Err(malformed()) } else { Ok(Self { field: field.trim().to_owned(), values }) }
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
        let range = |&[from, to]: &[f64; 2]| {
            if from == to { Short(from).to_string() } else { format!("{}..{}", Short(from), Short(to)) }
        };
        write!(f, "{}={}", self.field, self.values.iter().map(range).collect::<Vec<_>>().join(","))
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
        assert!(![-0.1, 0.1, 5.1, f32::NAN, f32::INFINITY].iter().any(|value| regions.show(*value)));
        for text in ["", "block", "block=", "=1", "block=1,", "block=a", "block=5..3", "block=nan"] {
            assert!(text.parse::<Regions>().is_err(), "{text}");
        }
    }
}
