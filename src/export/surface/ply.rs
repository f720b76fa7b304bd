//! One `.ply` file, binary and little-endian: vertices with `x`, `y`, `z` as double and field components as float, faces with
//! `vertex_indices`, `isovalue` as double for isosurfaces, and components of fields of cells as float.

use super::step::StepSurface;
use crate::error::FileResult;
use crate::export::appended::{self, Values};
use crate::field::Association;
use std::io::{self, Write};
use std::path::Path;

/// Unique property names of all components. A name is one word: characters other than letters, digits and `_` become `_`, and further ones
/// are appended to a name that is taken. Components of a vector end in their number.
fn property_names(fields: &[Values]) -> Vec<String> {
    let mut taken: Vec<String> = ["x", "y", "z"].map(str::to_owned).to_vec();
    for field in fields {
        for component in 0..field.components.len() {
            let name = &field.info.name;
            let name = if field.components.len() == 1 { name.clone() } else { format!("{name}_{component}") };
            let mut name: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
            while name.is_empty() || taken.contains(&name) {
                name.push('_');
            }
            taken.push(name);
        }
    }
    taken.split_off(3)
}

fn head(surface: &StepSurface) -> String {
    let mut head = format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by tetreel\ncomment time {:?}\nelement vertex {}\n\
         property double x\nproperty double y\nproperty double z\n",
        surface.time,
        surface.points.len()
    );
    let names = property_names(&surface.fields);
    let of = surface.fields.iter().flat_map(|field| vec![field.info.association; field.components.len()]);
    let properties = |wanted: Association| {
        let named = names.iter().zip(of.clone()).filter(move |(_, of)| *of == wanted);
        named.map(|(name, _)| format!("property float {name}\n")).collect::<String>()
    };
    head += &properties(Association::Point);
    head += &format!("element face {}\nproperty list uchar uint vertex_indices\n", surface.triangles.len());
    if surface.is_isosurface {
        head += "property double isovalue\n";
    }
    head += &properties(Association::Cell);
    head + "end_header\n"
}

fn body(out: &mut impl Write, surface: &StepSurface) -> io::Result<()> {
    let components = |of: Association| -> Vec<&Vec<f32>> {
        surface.fields.iter().filter(|field| field.info.association == of).flat_map(|field| &field.components).collect()
    };
    let (of_points, of_triangles) = (components(Association::Point), components(Association::Cell));
    for (i, point) in surface.points.iter().enumerate() {
        for coordinate in point.to_array() {
            out.write_all(&coordinate.to_le_bytes())?;
        }
        for values in &of_points {
            out.write_all(&values[i].to_le_bytes())?;
        }
    }
    for (i, triangle) in surface.triangles.iter().enumerate() {
        out.write_all(&[3])?;
        for corner in triangle {
            out.write_all(&corner.to_le_bytes())?;
        }
        if surface.is_isosurface {
            out.write_all(&surface.isovalues[i].to_le_bytes())?;
        }
        for values in &of_triangles {
            out.write_all(&values[i].to_le_bytes())?;
        }
    }
    Ok(())
}

/// Writes a surface to `path`; returns the size of the file.
///
/// # Errors
/// If the disk is full.
pub(super) fn write(path: &Path, surface: &StepSurface) -> FileResult<u64> {
    appended::write(path, |out| {
        out.write_all(head(surface).as_bytes())?;
        body(out, surface)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{Association, FieldInfo};

    #[test]
    fn names_are_single_words_and_each_is_there_once() {
        let field = |name: &str, components| {
            Values::empty(FieldInfo { name: name.to_owned(), components, association: Association::Point })
        };
        let fields = [field("x", 1), field("a b", 1), field("a:b", 1), field("Übung", 1), field("U", 3)];
        assert_eq!(property_names(&fields), ["x_", "a_b", "a_b_", "_bung", "U_0", "U_1", "U_2"]);
    }
}
