//! Readers of foreign files, one per format.
//!
//! | extension | what it is | read by |
//! |---|---|---|
//! | `.vtu` | an unstructured grid of VTK in XML: one step | `vtu` |
//! | `.vti`, `.vtr`, `.vts` | structured grids of VTK in XML | `vtu` |
//! | `.pvtu`, `.pvti`, ... | what parallel codes write: the pieces of a step in such files | `parts` |
//! | `.vtm` | blocks of VTK in such files: one step | `parts` |
//! | `.vtk` | a legacy file of VTK: one step | `legacy` |
//! | `.vtu.series`, ... | ParaView's list of such files with their times in JSON | `parts` |
//! | `.pvd` | ParaView's list of these files, each with its time | `pvd` |
//! | `.vtkhdf`, `.hdf` | VTKHDF: a grid of VTK in HDF5, with one step or several | `vtkhdf` |
//! | `.xdmf`, `.xmf` | XDMF: an XML file with the arrays of a series in HDF5 or binary files beside it | `xdmf` |
//! | `.e`, `.exo`, `.g`, ... | Exodus II in any format of netCDF: a mesh in blocks, and all steps; in parts too (`.e.4.0`, ...) | `exodus` |
//! | `.case`, `.encas` | EnSight Gold: a file that names those of the mesh and of each variable at each step | `ensight` |
//! | `.mhd`, `.mha`, `.nhdr`, `.nrrd` | raw volumes with a header of MetaImage or NRRD: one step, or several in NRRD | `raw` |
//! | `.npz` | arrays of NumPy by their names: a mesh and fields at all steps | `npz` |
//!
//! A reader yields a [`SeriesSource`]; another format is a folder here and a line of [`FORMATS`].

mod cache;
mod cell_list;
mod cells;
mod chosen;
mod content;
mod cursor;
mod ensight;
mod exodus;
mod faces;
mod format;
mod grids;
mod hdf;
mod joined;
mod joints;
mod lattice;
mod legacy;
mod made;
mod names;
mod npz;
mod numbers;
mod parts;
mod pieces;
mod pvd;
mod raw;
mod series;
mod tally;
mod timed;
mod times;
mod tuples;
mod units;
mod vtkhdf;
mod vtu;
mod xdmf;
mod xml;

pub use chosen::choose_blocks;
pub use format::{FORMATS, Format};

use crate::error::{FileError, FileResult};
use crate::field::SeriesSource;
use content::format_of;
use format::extension;
use names::natural_order;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Opens a series: one file of any of [`FORMATS`].
///
/// Reads the first step for the mesh and the fields, and checks that the files of the others exist.
///
/// # Errors
/// If the file is of another kind, is damaged, has cells that are not read, or names missing files.
pub fn open(path: &Path) -> FileResult<Box<dyn SeriesSource>> {
    open_many(&[path.to_owned()])
}

/// All files that [`open`] would read for the series at `path`: that path, and the files that it names.
///
/// # Errors
/// If a collection is damaged or names missing files.
pub fn files(path: &Path) -> FileResult<Vec<PathBuf>> {
    let mut files = vec![path.to_owned()];
    for series in expanded(&[path.to_owned()])? {
        if let Some(format) = format_of(&series) {
            files.extend((format.files)(&series)?);
        }
        files.push(series);
    }
    let mut seen = BTreeSet::new();
    files.retain(|file| seen.insert(file.clone()));
    Ok(files)
}

/// Opens several files of one format as one series, in natural order of their names (2 before 10): files of steps, or XDMF files with
/// different fields on the same mesh at the same times. A folder is the one series in it. What a file begins with says more of its format
/// than its name.
///
/// # Errors
/// As for [`open`]; if `paths` is empty; if the files are of different formats, or of one that cannot be joined.
pub fn open_many(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let mut paths = expanded(paths)?;
    paths.sort_by(|a, b| natural_order(a.as_os_str().as_encoded_bytes(), b.as_os_str().as_encoded_bytes()));
    let Some(first) = paths.first() else {
        return Err(FileError::invalid("", "", "no file was named").remedy(format!("name one: {}", Format::list())));
    };
    if let Some(refused) = paths.iter().find(|path| exodus::refused_by_name(path).is_some()) {
        return Err(unsupported(refused));
    }
    let format = format_of(first).ok_or_else(|| unsupported(first))?;
    for path in &paths[1..] {
        // The beginnings of thousands of files need not be read where names agree.
        let other = if Format::of(path).is_some_and(|other| std::ptr::eq(other, format)) {
            Some(format)
        } else {
            format_of(path)
        };
        let other = other.ok_or_else(|| unsupported(path))?;
        if !format.joins || !std::ptr::eq(other, format) {
            let alone = if format.joins && !other.joins { path } else { first };
            return Err(FileError::unsupported(alone, "", only_of_one_kind()).remedy("open it alone"));
        }
    }
    (format.open)(&paths)
}

/// The paths, a folder that is named alone replaced by the files of the series in it, and the parts of a file by one of them.
fn expanded(paths: &[PathBuf]) -> FileResult<Vec<PathBuf>> {
    let paths = match paths {
        [folder] if folder.is_dir() => content::series_in(folder).map_err(|problem| {
            let remedy = format!("name the files of one series: {}", Format::list());
            FileError::unsupported(folder, "", problem).remedy(remedy)
        }),
        _ => Ok(paths.to_vec()),
    }?;
    Ok(exodus::one_of_parts(paths))
}

/// Message: which files can be joined.
fn only_of_one_kind() -> String {
    let joined = FORMATS.iter().filter(|format| format.joins).filter_map(|format| format.extensions.first());
    let joined: Vec<String> = joined.map(|extension| format!(".{extension}")).collect();
    format!("only files of one kind, {}, can be joined to a series", joined.join(" or "))
}

fn unsupported(path: &Path) -> FileError {
    if let Some((problem, remedy)) = exodus::refused_by_name(path) {
        return FileError::unsupported(path, "", problem).remedy(remedy);
    }
    let problem = match extension(path).as_str() {
        "" => "is no file of a kind that is read".to_owned(),
        extension => format!("files of kind .{extension} are not read"),
    };
    FileError::unsupported(path, "", problem)
        .remedy(format!("convert it, for example with ParaView or meshio, to what is read: {}", Format::list()))
}

/// Reads the mesh and three steps of each field; they have as many values as there are points or cells.
#[cfg(test)]
fn read_all(source: &dyn SeriesSource) -> FileResult<()> {
    use crate::field::{Association, Component};
    let mesh = source.mesh()?;
    for field in source.fields() {
        for step in 0..source.times().len().min(3) {
            let mut out = Vec::new();
            source.read(field, Component::Magnitude, step, &mut out)?;
            let is_point = field.association == Association::Point;
            assert_eq!(out.len(), if is_point { mesh.points.len() } else { mesh.cells.len() });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_files_are_refused_with_a_list_of_what_is_read() {
        for name in ["a.stl", "folder", "a.VTP", ""] {
            let error = open(Path::new(name)).err().expect("refused").to_string();
            assert!([".pvd", ".vtu", ".xdmf"].iter().all(|kind| error.contains(kind)), "{error}");
        }
        assert!(open_many(&[]).is_err());
        let pair = [PathBuf::from("a.vtu"), PathBuf::from("b.pvd")];
        assert!(open_many(&pair).err().expect("refused").to_string().contains("open it alone"));
    }
}
