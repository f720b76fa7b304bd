//! Natural order of file names with numbers.

use std::cmp::Ordering;

/// Compares names with runs of digits as numbers; ties by bytes, so that the order is total.
pub(super) fn natural_order(a: &[u8], b: &[u8]) -> Ordering {
    let (mut left, mut right) = (a, b);
    while let (Some(&l), Some(&r)) = (left.first(), right.first()) {
        let (order, taken) = if l.is_ascii_digit() && r.is_ascii_digit() {
            let ((l, m), (r, n)) = (digits(left), digits(right));
            (m.len().cmp(&n.len()).then_with(|| m.cmp(n)), (l, r))
        } else {
            (l.cmp(&r), (1, 1))
        };
        if order != Ordering::Equal {
            return order;
        }
        (left, right) = (&left[taken.0..], &right[taken.1..]);
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

/// Number of leading digits, and the digits without leading zeros.
fn digits(text: &[u8]) -> (usize, &[u8]) {
    let length = text.iter().take_while(|b| b.is_ascii_digit()).count();
    let zeros = text[..length].iter().take_while(|&&b| b == b'0').count();
    (length, &text[zeros..length])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_in_names_compare_as_numbers() {
        let mut names = ["t10", "t9", "t010", "t1_2", "t1_10", "t", "t1", "u0", "t99999999999999999999999", "t2"];
        names.sort_by(|a, b| natural_order(a.as_bytes(), b.as_bytes()));
        assert_eq!(names, ["t", "t1", "t1_2", "t1_10", "t2", "t9", "t010", "t10", "t99999999999999999999999", "u0"]);
    }
}
