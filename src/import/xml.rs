//! XML helpers for `.pvd`, `.vtu` and XDMF files: tolerant attributes, and UTF-8 conversion that keeps the length.

use quick_xml::events::BytesStart;
use std::borrow::Cow;
use std::str::FromStr;

/// The attributes of a tag. VTK writes names unescaped, so `<`, `>` and `&` in a value stand for themselves; the five
/// entities and numeric references of XML are still resolved.
#[derive(Default)]
pub(super) struct Attributes(Vec<(String, String)>);

impl Attributes {
    /// # Errors
    /// If the tag is malformed, say by a quotation mark inside a value.
    pub(super) fn of(tag: &BytesStart<'_>) -> Result<Self, String> {
        let mut pairs = Vec::new();
        for attribute in tag.attributes().with_checks(false) {
            let attribute = attribute.map_err(|e| {
                format!(
                    "the attributes of <{}> are malformed ({e}); a name with a quotation mark?",
                    tag.name().as_ref()
                )
            })?;
            pairs.push((attribute.key.as_ref().to_owned(), unescape(&attribute.value)));
        }
        Ok(Self(pairs))
    }

    /// The value of an attribute.
    pub(super) fn get(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str())
    }

    /// An attribute as a count (VTK pads some with spaces); `None` if it is absent.
    ///
    /// # Errors
    /// If it is not a count.
    pub(super) fn count<T: FromStr>(&self, key: &str) -> Result<Option<T>, String> {
        let Some(text) = self.get(key) else { return Ok(None) };
        text.trim().parse().map(Some).map_err(|_| format!("{key}=\"{text}\" is no count"))
    }
}

/// Resolves each valid reference; any other ampersand stands for itself.
pub(super) fn unescape(value: &str) -> String {
    let mut out = String::with_capacity(value.len());
    let mut rest = value;
    while let Some(at) = rest.find('&') {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        let reference = rest.find(';').map(|end| &rest[..=end]);
        match reference.and_then(|r| quick_xml::escape::unescape(r).ok().map(|text| (r.len(), text))) {
            Some((length, text)) => {
                out.push_str(&text);
                rest = &rest[length..];
            }
            None => {
                out.push('&');
                rest = &rest[1..];
            }
        }
    }
    out.push_str(rest);
    out
}

/// The bytes as UTF-8, each invalid one replaced by `?`, so that byte offsets stay valid (names in Latin-1 get question marks).
pub(super) fn same_length_utf8(bytes: &[u8]) -> Cow<'_, str> {
    if let Ok(text) = std::str::from_utf8(bytes) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(bytes.len());
    for chunk in bytes.utf8_chunks() {
        out.push_str(chunk.valid());
        out.extend(chunk.invalid().iter().map(|_| '?'));
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_are_resolved_and_loose_ampersands_kept() {
        assert_eq!(unescape("a<b&c>d"), "a<b&c>d");
        assert_eq!(unescape("a &amp; b &lt;&#65;&x; &"), "a & b <A&x; &");
        assert_eq!(unescape("&&amp;;"), "&&;");
        assert_eq!(unescape("&é;&"), "&é;&");
    }

    #[test]
    fn bytes_that_are_no_utf8_keep_their_places() {
        let latin1 = b"T \xb0C \xe4\xf6 caf\xc3\xa9";
        let text = same_length_utf8(latin1);
        assert_eq!(text.len(), latin1.len());
        assert_eq!(text, "T ?C ?? café");
    }
}
