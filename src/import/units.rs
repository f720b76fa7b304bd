//! Units that files say fields have.

/// Names of the attribute of a data set or variable that has its unit; the first is that of the CF conventions.
pub(super) const ATTRIBUTES: [&str; 3] = ["units", "Units", "unit"];
/// Most characters of a unit; a longer text is a description.
const CHARACTERS_MAX: usize = 64;

/// The unit that a text is; `None` for one that is empty, long, or has more than one line.
pub(super) fn unit_of(text: &str) -> Option<String> {
    let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
    let is_unit = !text.is_empty() && text.chars().count() <= CHARACTERS_MAX && !text.contains(char::is_control);
    is_unit.then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_a_short_text_of_one_line() {
        for (text, unit) in [(" m/s \n", Some("m/s")), ("°C\0\0", Some("°C")), ("1", Some("1"))] {
            assert_eq!(unit_of(text).as_deref(), unit, "{text:?}");
        }
        assert_eq!(unit_of(&"µ".repeat(64)), Some("µ".repeat(64)));
        for text in ["", " \t", "\0", "m\ns", "a\u{1b}[0m", &"µ".repeat(65)] {
            assert_eq!(unit_of(text), None, "{text:?}");
        }
    }
}
