//! The supported input formats.

use super::content::Head;
use super::{ensight, exodus, legacy, npz, parts, pvd, raw, vtkhdf, vtu, xdmf};
use crate::error::FileResult;
use crate::field::SeriesSource;
use std::path::{Path, PathBuf};

/// An input format of simulation files: a folder here, and a line of [`FORMATS`].
pub struct Format {
    /// Name in the plural, for messages.
    pub name: &'static str,
    /// File name extensions in lower case; the usual one first.
    pub extensions: &'static [&'static str],
    /// Whether several files, in natural order of their names, form one series.
    pub joins: bool,
    /// Whether a file that begins so is of this format.
    pub(super) recognises: fn(&Head) -> bool,
    /// Opens one file, or several if they join.
    ///
    /// # Errors
    /// If a file is damaged, or has unsupported content.
    pub open: fn(&[PathBuf]) -> FileResult<Box<dyn SeriesSource>>,
    /// The files that are read along with one.
    ///
    /// # Errors
    /// If the file is damaged or names missing ones.
    pub files: fn(&Path) -> FileResult<Vec<PathBuf>>,
}

/// All formats that [`open`](super::open) reads. Help, messages and the player list these.
pub const FORMATS: &[Format] = &[
    pvd::FORMAT,
    vtu::FORMAT,
    parts::PVTU,
    parts::VTM,
    vtu::IMAGE,
    vtu::RECTILINEAR,
    vtu::CURVILINEAR,
    legacy::FORMAT,
    parts::SERIES,
    vtkhdf::FORMAT,
    xdmf::FORMAT,
    exodus::FORMAT,
    ensight::FORMAT,
    npz::FORMAT,
    raw::METAIMAGE,
    raw::NRRD,
];

/// The extensions of what most series come in.
const COMMON: [&str; 6] = ["pvd", "vtu", "pvtu", "vtm", "series", "xdmf"];

impl Format {
    /// The extensions of the formats that most series come in, where there is no room for all.
    pub fn common_extensions() -> String {
        COMMON.map(|extension| format!(".{extension}")).join(", ")
    }

    /// The format of a file, by the extension of its name; a part of an Exodus file has numbers behind it.
    pub fn of(path: &Path) -> Option<&'static Self> {
        let extension = extension(path);
        let is_part = exodus::is_part(path);
        FORMATS.iter().find(|format| match is_part {
            true => format.extensions == exodus::FORMAT.extensions,
            false => format.extensions.contains(&extension.as_str()),
        })
    }

    /// The usual extensions of all formats, as in ".pvd, .vtu, .xdmf".
    pub fn extensions() -> String {
        let usual = FORMATS.iter().filter_map(|format| format.extensions.first());
        usual.map(|extension| format!(".{extension}")).collect::<Vec<_>>().join(", ")
    }

    /// The usual extensions with the names, as in ".pvd (ParaView collections) and .vtu (unstructured grids of VTK)".
    pub fn list() -> String {
        let of = |format: &Self| format!(".{} ({})", format.extensions.first().unwrap_or(&""), format.name);
        let all: Vec<String> = FORMATS.iter().map(of).collect();
        match &all[..] {
            [.., _, last] => format!("{} and {last}", all[..all.len() - 1].join(", ")),
            one => one.concat(),
        }
    }
}

/// The extension of a file name in lower case; empty if there is none.
pub(super) fn extension(path: &Path) -> String {
    path.extension().map_or(String::new(), |e| e.to_string_lossy().to_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_have_extensions_of_their_own_and_are_listed() {
        let all: Vec<&str> = FORMATS.iter().flat_map(|format| format.extensions).copied().collect();
        for (i, extension) in all.iter().enumerate() {
            assert!(!all[..i].contains(extension) && !extension.is_empty(), "{extension}");
            assert_eq!(*extension, extension.to_ascii_lowercase());
            assert!(Format::of(Path::new(&format!("a.{}", extension.to_uppercase()))).is_some());
        }
        assert!(FORMATS.iter().all(|format| Format::list().contains(format.name)));
        assert!(COMMON.iter().all(|extension| all.contains(extension)), "{}", Format::common_extensions());
        assert_eq!(
            Format::extensions(),
            ".pvd, .vtu, .pvtu, .vtm, .vti, .vtr, .vts, .vtk, .series, .vtkhdf, .xdmf, .e, .case, .npz, .mhd, .nhdr"
        );
    }
}
