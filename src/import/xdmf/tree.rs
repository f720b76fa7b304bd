//! The elements of an XDMF file, and the paths between them.
//!
//! The subset of XPath that XDMF writers use: absolute paths of names or `*`, `/` and `//`, and the predicates `[n]`, `[@Name="value"]` and
//! `[self::A or self::B]`, alone or inside `xpointer(...)`.

use super::super::xml::{Attributes, same_length_utf8, unescape};
use crate::error::{FileError, FileResult};
use crate::files;
use quick_xml::Reader;
use quick_xml::events::Event;
use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};

/// Index of an element; 0 is the document itself.
pub(super) type Id = usize;

/// Longest chain of references, and deepest nesting; beyond this a reference counts as circular.
pub(super) const DEPTH_MAX: usize = 32;

/// An XDMF file in memory.
pub(super) struct Document {
    path: PathBuf,
    text: String,
    elements: Vec<Element>,
    /// Cached results of paths; the steps of a series mostly share theirs.
    found: Mutex<HashMap<String, Vec<Id>>>,
}

#[derive(Default)]
struct Element {
    name: String,
    attributes: Attributes,
    children: Vec<Id>,
    /// Byte ranges of its direct text.
    text: Vec<Range<usize>>,
    byte: usize,
}

impl Document {
    /// Reads and parses a file.
    ///
    /// # Errors
    /// If it cannot be read, or is not well-formed XML with the root `Xdmf`.
    pub(super) fn open(path: &Path) -> FileResult<Self> {
        let bytes = files::read(path)?;
        let text = match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(e) => same_length_utf8(e.as_bytes()).into_owned(),
        };
        let elements = parse(path, &text)?;
        Ok(Self { path: path.to_owned(), text, elements, found: Mutex::default() })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn name(&self, id: Id) -> &str {
        &self.elements[id].name
    }

    pub(super) fn attribute(&self, id: Id, key: &str) -> Option<&str> {
        self.elements[id].attributes.get(key)
    }

    /// An attribute as a count; `None` if it is absent.
    pub(super) fn count<T: FromStr>(&self, id: Id, key: &str) -> FileResult<Option<T>> {
        self.elements[id].attributes.count(key).map_err(|problem| self.invalid(id, problem))
    }

    /// The first of these attributes that exists: versions of the format differ in their names.
    pub(super) fn either(&self, id: Id, keys: &[&str]) -> Option<&str> {
        keys.iter().find_map(|key| self.attribute(id, key)).map(str::trim)
    }

    /// The direct text, trimmed and with its references resolved.
    pub(super) fn text(&self, id: Id) -> String {
        unescape(self.numbers(&self.elements[id].text).trim())
    }

    /// Byte ranges of the direct text.
    pub(super) fn text_ranges(&self, id: Id) -> &[Range<usize>] {
        &self.elements[id].text
    }

    /// Text of these ranges, without resolving references: numbers have none.
    pub(super) fn numbers(&self, ranges: &[Range<usize>]) -> Cow<'_, str> {
        match ranges {
            [range] => Cow::Borrowed(&self.text[range.clone()]),
            _ => Cow::Owned(ranges.iter().map(|range| &self.text[range.clone()]).collect()),
        }
    }

    /// Description of an element for messages: tag, `Name` attribute and byte offset.
    pub(super) fn place(&self, id: Id) -> String {
        let element = &self.elements[id];
        let name = element.attributes.get("Name").map_or(String::new(), |name| format!(" '{name}'"));
        format!("<{}>{name} at byte {}", element.name, element.byte)
    }

    pub(super) fn invalid(&self, id: Id, problem: impl Into<String>) -> FileError {
        FileError::invalid(&self.path, self.place(id), problem).remedy("correct it, or write the file again")
    }

    pub(super) fn unsupported(&self, id: Id, problem: impl Into<String>) -> FileError {
        FileError::unsupported(&self.path, self.place(id), problem)
            .remedy("write it as meshio does: an unstructured grid, its arrays in HDF5, binary or XML")
    }

    /// The children of an element, with `xi:include` replaced by its target, and references resolved.
    pub(super) fn children(&self, id: Id) -> FileResult<Vec<Id>> {
        let mut children = Vec::new();
        for &child in &self.elements[id].children {
            if self.name(child) == "include" {
                if let Some(href) = self.attribute(child, "href").filter(|href| !href.is_empty()) {
                    let problem = format!("includes another file ('{href}'), which is not read");
                    return Err(self.unsupported(child, problem).remedy("put the included elements into the file"));
                }
                let path = self.attribute(child, "xpointer").ok_or_else(|| self.invalid(child, "names nothing"))?;
                for found in self.find(child, path)? {
                    children.push(self.resolved(found)?);
                }
            } else {
                children.push(self.resolved(child)?);
            }
        }
        Ok(children)
    }

    /// The [`Document::children`] with this tag.
    pub(super) fn children_named(&self, id: Id, name: &str) -> FileResult<Vec<Id>> {
        Ok(self.children(id)?.into_iter().filter(|&child| self.name(child) == name).collect())
    }

    /// The element itself, or the target of its reference or chain of references: `Reference="XML"` with a path as text, or
    /// `Reference="PATH"`.
    fn resolved(&self, id: Id) -> FileResult<Id> {
        let mut at = id;
        for _ in 0..DEPTH_MAX {
            let Some(reference) = self.attribute(at, "Reference") else { return Ok(at) };
            let path =
                if reference.trim().eq_ignore_ascii_case("XML") { self.text(at) } else { reference.trim().to_owned() };
            let found = self.find(at, &path)?;
            let same_name = found.iter().find(|&&other| self.name(other) == self.name(at));
            at = *same_name.ok_or_else(|| {
                self.invalid(at, format!("refers to '{path}', where there is no <{}>", self.name(at)))
            })?;
        }
        Err(self.invalid(id, "refers to itself"))
    }

    /// The elements that a path selects, in file order; errors name `from`.
    fn find(&self, from: Id, path: &str) -> FileResult<Vec<Id>> {
        let mut cache = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = cache.get(path) {
            return Ok(found.clone());
        }
        let found = self.select(path).map_err(|problem| {
            self.unsupported(from, format!("the path '{path}' is not understood: {problem}"))
                .remedy("write it as /Xdmf/Domain/Grid[1]/..., with [n] or [@Name=\"...\"] where needed")
        })?;
        if found.is_empty() {
            return Err(self.invalid(from, format!("refers to '{path}', where there is nothing")));
        }
        cache.insert(path.to_owned(), found.clone());
        Ok(found)
    }

    fn select(&self, path: &str) -> Result<Vec<Id>, String> {
        let mut rest = path.trim();
        if let Some(inner) = rest.strip_prefix("xpointer(") {
            rest = inner.strip_suffix(')').ok_or("a parenthesis is not closed")?.trim();
        }
        let mut context = vec![0];
        while !rest.is_empty() {
            rest = rest.strip_prefix('/').ok_or("it does not begin with /")?;
            if let Some(after) = rest.strip_prefix('/') {
                rest = after;
                // Children have larger ids than their parents, so id order is file order.
                context = (0..self.elements.len()).filter(|&id| self.is_below(id, &context)).collect();
            }
            let (step, after) = PathStep::parse(rest)?;
            rest = after;
            let mut next: Vec<Id> =
                context.iter().flat_map(|&id| step.apply(self, &self.elements[id].children)).collect();
            next.sort_unstable();
            next.dedup();
            context = next;
        }
        Ok(context)
    }

    /// Whether an element is one of `roots` or inside one. In practice only the document itself precedes `//`.
    fn is_below(&self, id: Id, roots: &[Id]) -> bool {
        let holds = |root: Id| {
            let mut open = vec![root];
            while let Some(at) = open.pop() {
                if at == id {
                    return true;
                }
                open.extend(&self.elements[at].children);
            }
            false
        };
        roots.iter().any(|&root| root == 0 || holds(root))
    }
}

/// One step of an XPath.
struct PathStep<'a> {
    name: &'a str,
    predicates: Vec<Predicate<'a>>,
}

enum Predicate<'a> {
    /// One-based position among the elements that earlier predicates have left.
    Position(usize),
    Attribute(&'a str, &'a str),
    Names(Vec<&'a str>),
}

impl<'a> PathStep<'a> {
    /// Parses the step at the start of `text`; also returns the rest.
    fn parse(text: &'a str) -> Result<(Self, &'a str), String> {
        let (name, mut rest) = text.split_at(text.find(['/', '[']).unwrap_or(text.len()));
        let name = name.trim();
        if name.is_empty() || name.contains(['.', '(', ')', '@', '|', ' ']) {
            return Err(format!("'{name}' is no name"));
        }
        let mut predicates = Vec::new();
        while let Some(inside) = rest.strip_prefix('[') {
            let end = closing_bracket(inside).ok_or("a bracket is not closed")?;
            predicates.push(Predicate::parse(inside[..end].trim())?);
            rest = inside[end + 1..].trim_start();
        }
        Ok((Self { name, predicates }, rest))
    }

    fn apply(&self, document: &Document, children: &[Id]) -> Vec<Id> {
        let is_named = |&id: &Id| self.name == "*" || self.name == document.name(id);
        let mut found: Vec<Id> = children.iter().copied().filter(is_named).collect();
        for predicate in &self.predicates {
            match predicate {
                Predicate::Position(n) => {
                    found = n.checked_sub(1).and_then(|i| found.get(i)).map_or(Vec::new(), |&id| vec![id]);
                }
                Predicate::Attribute(key, value) => found.retain(|&id| document.attribute(id, key) == Some(*value)),
                Predicate::Names(names) => found.retain(|&id| names.contains(&document.name(id))),
            }
        }
        found
    }
}

impl<'a> Predicate<'a> {
    fn parse(text: &'a str) -> Result<Self, String> {
        let unknown = || format!("[{text}] is unknown");
        if let Ok(n) = text.parse() {
            return Ok(Self::Position(n));
        }
        if let Some((key, value)) = text.strip_prefix('@').and_then(|rest| rest.split_once('=')) {
            let value = value.trim();
            let quoted = |quote: char| value.strip_prefix(quote).and_then(|v| v.strip_suffix(quote));
            return quoted('"').or_else(|| quoted('\'')).map(|v| Self::Attribute(key.trim(), v)).ok_or_else(unknown);
        }
        let names = text.split(" or ").map(|part| part.trim().strip_prefix("self::").map(str::trim));
        names.collect::<Option<_>>().map(Self::Names).ok_or_else(unknown)
    }
}

/// Index of the bracket that ends a predicate, outside of quoted values.
fn closing_bracket(text: &str) -> Option<usize> {
    let mut quote = None;
    text.char_indices().find_map(|(i, c)| {
        match (quote, c) {
            (None, ']') => return Some(i),
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), _) if open == c => quote = None,
            _ => {}
        }
        None
    })
}

fn parse(path: &Path, text: &str) -> FileResult<Vec<Element>> {
    let mut reader = Reader::from_str(text);
    let mut elements = vec![Element::default()];
    let mut open: Vec<Id> = vec![0];
    loop {
        let byte = reader.buffer_position() as usize;
        let invalid = |problem: String| FileError::invalid(path, format!("byte {byte}"), problem);
        let event =
            reader.read_event().map_err(|e| invalid(format!("malformed XML: {e}")).remedy("write the file again"))?;
        let end = reader.buffer_position() as usize;
        // Never empty: the document itself stays open.
        let parent = open.last().copied().unwrap_or(0);
        match &event {
            Event::Start(tag) | Event::Empty(tag) => {
                let full_name = tag.name();
                let name = full_name.as_ref().rsplit(':').next().unwrap_or_default().to_owned();
                if parent == 0 && name != "Xdmf" {
                    return Err(invalid(format!("this is no XDMF file: it begins with <{name}>")));
                }
                let attributes = Attributes::of(tag).map_err(invalid)?;
                let id = elements.len();
                elements.push(Element { name, attributes, byte, ..Element::default() });
                elements[parent].children.push(id);
                if matches!(event, Event::Start(_)) {
                    open.push(id);
                }
            }
            Event::End(_) => {
                open.pop();
            }
            Event::Text(_) | Event::GeneralRef(_) => {
                // A reference inside of text is an event of its own; its pieces are merged.
                match elements[parent].text.last_mut() {
                    Some(last) if last.end == byte => last.end = end,
                    _ => elements[parent].text.push(byte..end),
                }
            }
            Event::Eof => {
                let inside = if parent == 0 { String::new() } else { format!(" inside <{}>", elements[parent].name) };
                if parent != 0 || elements.len() == 1 {
                    let what = if elements.len() == 1 { "this is no XDMF file: it ends" } else { "the file ends" };
                    return Err(invalid(format!("{what}{inside}")).remedy("write the file again"));
                }
                return Ok(elements);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn document(inside: &str) -> FileResult<Document> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.xdmf");
        fs::write(&path, format!("<?xml version=\"1.0\"?><!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n{inside}"))
            .expect("a file");
        Document::open(&path)
    }

    fn names(document: &Document, path: &str) -> Result<Vec<String>, String> {
        let name = |id: Id| document.attribute(id, "Name").unwrap_or(document.name(id)).to_owned();
        Ok(document.select(path)?.into_iter().map(name).collect())
    }

    const SERIES: &str = r#"<Xdmf xmlns:xi="http://www.w3.org/2001/XInclude"><Domain>
        <Grid Name="a/b[1]"><Topology/><Geometry/><Attribute Name="f"/></Grid>
        <Grid Name="s"><Grid Name="0"><xi:include xpointer="xpointer(//Grid[@Name=&quot;a/b[1]&quot;]/*[self::Topology or self::Geometry])"/>
        </Grid><Grid Name="1"><Topology Reference="/Xdmf/Domain/Grid[2]/Grid[@Name='2']/Topology"/></Grid>
        <Grid Name="2"><Topology Name="t" Reference="XML"> /Xdmf/Domain/Grid[1]/Topology[1] </Topology></Grid></Grid>
        </Domain></Xdmf>"#;

    #[test]
    fn the_paths_that_writers_use_are_followed() {
        let document = document(SERIES).expect("well-formed");
        assert_eq!(names(&document, "/Xdmf/Domain/Grid").as_deref(), Ok(&["a/b[1]".to_owned(), "s".to_owned()][..]));
        assert_eq!(names(&document, "//Grid[1]").map(|n| n.join(" ")), Ok("a/b[1] 0".to_owned()));
        assert_eq!(names(&document, "/Xdmf/Domain/Grid[@Name='s']/Grid[2]").map(|n| n.join(" ")), Ok("1".to_owned()));
        assert_eq!(names(&document, "//Grid[3]//Grid").map(|n| n.len()), Ok(0));
        let grids = document.select("/Xdmf/Domain/Grid[2]/Grid").expect("a path");
        let children = |i: usize| document.children(grids[i]).expect("resolves");
        let wanted = document.select("/Xdmf/Domain/Grid[1]/*[self::Topology or self::Geometry]").expect("a path");
        assert_eq!(children(0), wanted);
        assert_eq!((children(1), children(2)), (vec![wanted[0]], vec![wanted[0]]));
    }

    #[test]
    fn other_paths_circles_and_dead_ends_are_errors_that_say_so() {
        let error = |inside: &str| {
            let document = document(&format!("<Xdmf><Domain>{inside}</Domain></Xdmf>")).expect("well-formed");
            let grid = document.select("/Xdmf/Domain").expect("a path")[0];
            document.children(grid).expect_err("refused").to_string()
        };
        for path in ["../Grid", "Grid[1]", "/Xdmf/Domain/Grid[last()]", "/Xdmf/Domain/Grid[1", "id(3)", "/Xdmf/.."] {
            assert!(error(&format!("<Grid Reference='{path}'/>")).contains("not understood"), "{path}");
        }
        assert!(error("<Grid Reference='/Xdmf/Domain/Grid[1]'/>").contains("refers to itself"));
        assert!(error("<Grid Reference='/Xdmf/Domain/Grid[0]'/>").contains("there is nothing"));
        assert!(error("<Grid Reference='/Xdmf/Domain'/>").contains("no <Grid>"));
        assert!(error("<include href='b.xdmf'/>").contains("b.xdmf"));
    }

    #[test]
    fn what_is_no_xdmf_is_refused_with_its_byte() {
        for (text, part) in [
            ("<VTKFile/>", "VTKFile"),
            ("<Xdmf><Domain></Xdmf>", "malformed"),
            ("", "no XDMF"),
            ("<Xdmf>", "inside <Xdmf>"),
        ] {
            let error = document(text).err().expect("refused").to_string();
            assert!(error.contains(part) && error.contains("byte"), "{error}");
        }
    }
}
