//! The array of a header whose element is open: its data, and the unit that it may have inside.

use super::super::units::unit_of;
use super::super::xml::{Attributes, unescape};
use super::header::{ArrayInfo, DataPlace};
use quick_xml::events::BytesStart;
use std::ops::Range;

/// An open array.
pub(super) struct OpenArray {
    pub(super) info: ArrayInfo,
    pub(super) tuples: usize,
    /// Number of open elements outside of it.
    pub(super) depth: usize,
    /// Where the text of the element begins that has its unit, while that is open.
    unit_from: Option<usize>,
}

impl OpenArray {
    pub(super) fn new(info: ArrayInfo, tuples: usize, depth: usize) -> Self {
        Self { info, tuples, depth, unit_from: None }
    }

    /// Takes text directly inside of it.
    pub(super) fn text(&mut self, range: Range<usize>, bytes: &[u8]) {
        let blank = bytes[range.clone()].iter().all(u8::is_ascii_whitespace);
        if let (false, DataPlace::Ascii(ranges) | DataPlace::Base64(ranges)) = (blank, &mut self.info.data) {
            ranges.push(range);
        }
    }

    /// An element begins directly inside of it, whose tag ends at byte `end`. VTK writes the unit as such an element.
    pub(super) fn begin(&mut self, tag: &BytesStart<'_>, end: usize) {
        if tag.name().as_ref() == "InformationKey"
            && let Ok(attributes) = Attributes::of(tag)
            && (attributes.get("name"), attributes.get("location")) == (Some("UNITS_LABEL"), Some("vtkDataArray"))
        {
            self.unit_from = Some(end);
        }
    }

    /// An element directly inside of it ends, whose closing tag begins at byte `begin` of the text of the file.
    pub(super) fn end(&mut self, begin: usize, text: &str) {
        let raw = self.unit_from.take().and_then(|from| text.get(from..begin)).filter(|raw| !raw.contains('<'));
        if let Some(unit) = raw.and_then(|raw| unit_of(&unescape(raw))) {
            self.info.unit = Some(unit);
        }
    }
}
