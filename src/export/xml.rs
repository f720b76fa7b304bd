//! Attribute values of XML 1.0.

use std::fmt::Write as _;

/// `text` as an attribute value between double quotes, or `None` if it holds a character that XML 1.0 cannot express.
///
/// Tabs and line ends are written as references, since a reader would turn them into spaces otherwise.
pub(super) fn attribute(text: &str) -> Option<String> {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => write!(out, "&#{};", u32::from(c)).ok()?,
            '\0'..='\x1F' | '\u{FFFE}' | '\u{FFFF}' => return None,
            _ => out.push(c),
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_back_from_an_xml_reader_as_they_were() {
        for name in ["T", "<&>\"'", "a\tb\r\nc", "Überdruck €", "", "&amp;"] {
            let element = format!("<e n=\"{}\"/>", attribute(name).unwrap());
            let mut reader = quick_xml::Reader::from_str(&element);
            let quick_xml::events::Event::Empty(e) = reader.read_event().unwrap() else { panic!("{element}") };
            let value = e.attributes().next().unwrap().unwrap();
            assert_eq!(value.normalized_value(quick_xml::XmlVersion::Explicit1_0).unwrap(), name, "{element}");
        }
    }

    #[test]
    fn characters_that_xml_lacks_are_refused() {
        for name in ["a\0", "\x1B[1m", "\u{FFFF}"] {
            assert_eq!(attribute(name), None);
        }
    }
}
