//! Numbers in short, readable form.

use std::fmt::{self, Display, LowerExp};

/// A number in the fewest digits that parse back to it, with an exponent if it would need many zeros.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Short<T>(pub(crate) T);

/// Exponents of numbers written without one.
const PLAIN: std::ops::RangeInclusive<i32> = -5..=8;

impl<T: Display + LowerExp> Display for Short<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = format!("{:e}", self.0);
        // Non-finite numbers have no exponent.
        let exponent = text.split_once('e').and_then(|(_, exponent)| exponent.parse().ok());
        if exponent.is_none_or(|exponent| PLAIN.contains(&exponent)) {
            Display::fmt(&self.0, f)
        } else {
            f.write_str(&text)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn long_rows_of_digits_become_exponents() {
        let written = [5.451_571_6e-19_f32, f32::MAX, 1e-5, 123.25, -0.0, f32::NAN].map(|x| Short(x).to_string());
        assert_eq!(written, ["5.4515716e-19", "3.4028235e38", "0.00001", "123.25", "-0", "NaN"]);
        let written = [1e9, -999_999_999.0, 0.1 + 0.2, 1e-300].map(|x: f64| Short(x).to_string());
        assert_eq!(written, ["1e9", "-999999999", "0.30000000000000004", "1e-300"]);
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(a in any::<f32>(), b in any::<f64>()) {
            prop_assert_eq!(Short(a).to_string().parse::<f32>().unwrap().to_bits(), a.to_bits());
            prop_assert_eq!(Short(&b).to_string().parse::<f64>().unwrap().to_bits(), b.to_bits());
        }
    }
}
