//! What a file is, by how it begins: names of files lie, or say too little.

use super::format::Format;
use super::{FORMATS, exodus};
use crate::files;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes that are read: more than comments before an XML element, and than the names in front of an HDF5 file.
const BYTES: u64 = 1 << 16;

/// The beginning of a file.
pub(super) struct Head(Vec<u8>);

impl Head {
    /// The beginning of a file, empty if it cannot be read: whoever opens it says why.
    pub(super) fn of(path: &Path) -> Self {
        let mut bytes = Vec::new();
        if path.is_file()
            && let Ok(file) = files::open(path)
            && file.take(BYTES).read_to_end(&mut bytes).is_err()
        {
            bytes.clear();
        }
        Self(bytes)
    }

    /// Whether the file begins with these bytes.
    pub(super) fn begins_with(&self, bytes: &[u8]) -> bool {
        self.0.starts_with(bytes)
    }

    /// Whether these bytes are in it.
    pub(super) fn has(&self, bytes: &[u8]) -> bool {
        self.find(bytes).is_some()
    }

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        self.0.windows(bytes.len()).position(|window| window == bytes)
    }

    /// Whether it begins with this XML element, behind a declaration and comments.
    pub(super) fn is_xml(&self, element: &str) -> bool {
        let begins = self.0.trim_ascii_start().starts_with(b"<") || self.begins_with(b"\xef\xbb\xbf<");
        begins && self.has(format!("<{element}").as_bytes())
    }

    /// The type of a file of VTK in XML.
    pub(super) fn vtk_type(&self) -> Option<&str> {
        let from = self.find(b"<VTKFile")?;
        let tag = self.0[from..].split(|&byte| byte == b'>').next()?;
        let tag = std::str::from_utf8(tag).ok()?;
        let value = tag.split_once("type=")?.1;
        let quote = value.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
        value[1..].split_once(quote).map(|(name, _)| name)
    }

    /// Whether it is a file of VTK in XML of one of these types.
    pub(super) fn is_vtk(&self, types: &[&str]) -> bool {
        self.vtk_type().is_some_and(|of_file| types.contains(&of_file))
    }
}

/// The format of a file: that of its name, unless the file begins as one of another does.
pub(super) fn format_of(path: &Path) -> Option<&'static Format> {
    let named = Format::of(path);
    let head = Head::of(path);
    if named.is_some_and(|format| (format.recognises)(&head)) {
        return named;
    }
    FORMATS.iter().find(|format| (format.recognises)(&head)).or(named)
}

/// The files of the series in a folder: its one list of files or file with all steps; else all its files of steps, if these are of one
/// format. The error says what there is.
pub(super) fn series_in(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(folder).map_err(|error| format!("cannot be listed: {error}"))?;
    // Names decide here: a folder may have thousands of other files.
    let is_known = |path: &PathBuf| path.is_file() && Format::of(path).is_some();
    let mut known: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(is_known).collect();
    known.sort();
    let named = |path: PathBuf| Some((Format::of(&path)?, path));
    let found: Vec<(&'static Format, PathBuf)> = exodus::one_of_parts(known).into_iter().filter_map(named).collect();
    let (steps, whole): (Vec<_>, Vec<_>) = found.into_iter().partition(|(format, _)| format.joins);
    match (whole.as_slice(), steps.as_slice()) {
        ([(_, one)], _) => Ok(vec![one.clone()]),
        ([], []) => Err("has no series in it".to_owned()),
        ([], [(format, _), others @ ..]) if others.iter().all(|(other, _)| std::ptr::eq(*format, *other)) => {
            Ok(steps.into_iter().map(|(_, path)| path).collect())
        }
        (several, _) => {
            let all = if several.is_empty() { &steps } else { &whole };
            let names = all.iter().filter_map(|(_, path)| Some(path.file_name()?.to_string_lossy().into_owned()));
            let names: Vec<String> = names.take(8).collect();
            Err(format!("has several series in it: {}", names.join(", ")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_file_is_what_it_begins_with_unless_nothing_knows_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let format = |name: &str, text: &[u8]| {
            let path = folder.path().join(name);
            fs::write(&path, text).expect("a file");
            format_of(&path).map(|format| format.extensions[0])
        };
        let vtk =
            |of_type: &str| format!("<?xml version=\"1.0\"?>\n<!-- <VTK --><VTKFile version='1.0' type=\"{of_type}\">");
        for (of_type, expected) in [
            ("UnstructuredGrid", "vtu"),
            ("PUnstructuredGrid", "pvtu"),
            ("PImageData", "pvtu"),
            ("ImageData", "vti"),
            ("RectilinearGrid", "vtr"),
            ("StructuredGrid", "vts"),
            ("Collection", "pvd"),
            ("vtkMultiBlockDataSet", "vtm"),
        ] {
            for name in ["a.xml", "a", "a.vtu", "a.e"] {
                assert_eq!(format(name, vtk(of_type).as_bytes()), Some(expected), "{of_type} in {name}");
            }
        }
        assert_eq!(format("a.vtu", vtk("PolyData").as_bytes()), Some("vtu"), "whoever reads it refuses it");
        assert_eq!(format("a.txt", vtk("PolyData").as_bytes()), None);
        assert_eq!(format("a.dat", b"# vtk DataFile Version 3.0\n"), Some("vtk"));
        assert_eq!(format("a.bin", b"CDF\x02..."), Some("e"));
        assert_eq!(format("a.h5", b"\x89HDF\r\n\x1a\n...VTKHDF..."), Some("vtkhdf"));
        assert_eq!(format("a.nc", b"\x89HDF\r\n\x1a\n...connect1..."), Some("e"));
        assert_eq!(format("a.h5", b"\x89HDF\r\n\x1a\n..."), None);
        assert_eq!(format("a.zip", b"PK\x03\x04...points.npy..."), Some("npz"));
        assert_eq!(format("a.xml", b"\n<Xdmf Version=\"3.0\">"), Some("xdmf"));
        assert_eq!(format("a.json", b"{\"file-series-version\": \"1.0\", \"files\": []}"), Some("series"));
        assert_eq!(format("a.stl", b"solid"), None);
        assert_eq!(format("a.pvd", b""), Some("pvd"));
        assert_eq!(format_of(Path::new("missing.vtu")).map(|format| format.extensions[0]), Some("vtu"));
    }

    #[test]
    fn a_folder_is_the_one_series_in_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let add = |name: &str| fs::write(folder.path().join(name), "").expect("a file");
        let found = || -> Result<Vec<String>, String> {
            let found = series_in(folder.path())?;
            Ok(found.iter().map(|path| path.file_name().unwrap().to_string_lossy().into_owned()).collect::<Vec<_>>())
        };
        assert!(found().unwrap_err().contains("no series"));
        ["readme.txt", "a_0.vtu", "a_1.vtu", "a_10.vtu"].iter().for_each(|name| add(name));
        assert_eq!(found(), Ok(["a_0.vtu", "a_1.vtu", "a_10.vtu"].map(str::to_owned).to_vec()));
        add("b.vtk");
        assert!(found().unwrap_err().contains("a_0.vtu, a_1.vtu, a_10.vtu, b.vtk"));
        add("a.pvd");
        assert_eq!(found(), Ok(vec!["a.pvd".to_owned()]), "a list leads");
        add("c.e");
        assert!(found().unwrap_err().contains("a.pvd, c.e"));
        ["a.pvd", "c.e"].iter().for_each(|name| fs::remove_file(folder.path().join(name)).expect("removed"));
        ["c.e.2.0", "c.e.2.1"].iter().for_each(|name| add(name));
        assert_eq!(found(), Ok(vec!["c.e.2.0".to_owned()]), "of parts, one");
        add("c.e.3.0");
        assert!(found().unwrap_err().contains("c.e.2.0, c.e.3.0"));
        assert!(series_in(&folder.path().join("none")).is_err());
    }
}
