//! Kernels of readers of foreign files.

use super::Work;
use std::error::Error;
use std::fs;
use std::hint::black_box;
use std::path::Path;
use tetreel::export::vtu::{VtuOptions, write_series};
use tetreel::field::{Component, SeriesSource};
use tetreel::import;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

/// Opens a series and reads its mesh and all values.
fn read(path: &Path) -> Result<(), Box<dyn Error>> {
    let series = import::open(path)?;
    black_box(series.mesh()?);
    let mut values = Vec::new();
    for step in 0..series.times().len() {
        for field in series.fields() {
            for component in 0..field.components {
                series.read(field, Component::Index(component), step, &mut values)?;
                black_box(&values);
            }
        }
    }
    Ok(())
}

/// A series as tetreel writes it (appended data), and small files in other encodings.
pub fn read_vtu(folder: &Path) -> Result<Work, Box<dyn Error>> {
    let series = generate(&SynthSpec { cells: 10_000, steps: 3, ..SynthSpec::new(SeriesName::Tornado) })?;
    let written = write_series(&series, &folder.join("t"), &VtuOptions::default(), &Silent, &Cancel::new())?;
    let small = crate::tools::root().join("tests/data/vtu");
    let others = ["ascii.vtu", "base64_none_64_le.vtu", "blocks_base64_zlib.vtu", "inline_none_32_be.vtu"];
    let others = others.map(|name| small.join(name));
    Ok(Box::new(move || {
        read(&written.pvd)?;
        for _ in 0..8 {
            others.iter().try_for_each(|path| read(path))?;
        }
        Ok(())
    }))
}

/// A series in binary files beside the XML, and small ones in HDF5.
pub fn read_xdmf(folder: &Path) -> Result<Work, Box<dyn Error>> {
    let path = folder.join("jet.xdmf");
    write_xdmf(folder, &path)?;
    let small = crate::tools::root().join("tests/data/xdmf");
    let others = ["dolfinx.xdmf", "gzip_f32.xdmf", "meshio_xml.xdmf"].map(|name| small.join(name));
    Ok(Box::new(move || {
        read(&path)?;
        for _ in 0..4 {
            others.iter().try_for_each(|path| read(path))?;
        }
        Ok(())
    }))
}

/// A jet of eight steps.
fn write_xdmf(folder: &Path, path: &Path) -> Result<(), Box<dyn Error>> {
    let jet = generate(&SynthSpec { cells: 20_000, steps: 8, ..SynthSpec::new(SeriesName::Jet) })?;
    let mesh = jet.mesh()?;
    let points: Vec<[f64; 3]> = mesh.points.iter().map(|point| point.to_array()).collect();
    fs::write(folder.join("points.bin"), bytemuck::cast_slice::<_, u8>(&points))?;
    fs::write(folder.join("cells.bin"), bytemuck::cast_slice::<_, u8>(&mesh.cells.tets))?;
    let (cells, vertices) = (mesh.cells.tets.len(), points.len());
    let mut grids = String::new();
    let mut values = Vec::new();
    for (step, time) in jet.times().values.iter().enumerate() {
        jet.read(&jet.fields()[0], Component::Index(0), step, &mut values)?;
        fs::write(folder.join(format!("s{step}.bin")), bytemuck::cast_slice::<f32, u8>(&values))?;
        grids += &format!(
            "<Grid GridType='Uniform'><Time Value='{time}'/>\
             <Topology TopologyType='Tetrahedron' NumberOfElements='{cells}'>\
             <DataItem Dimensions='{cells} 4' NumberType='UInt' Precision='4' Format='Binary'>cells.bin</DataItem></Topology>\
             <Geometry GeometryType='XYZ'>\
             <DataItem Dimensions='{vertices} 3' NumberType='Float' Precision='8' Format='Binary'>points.bin</DataItem></Geometry>\
             <Attribute Name='s' AttributeType='Scalar' Center='Node'>\
             <DataItem Dimensions='{vertices}' NumberType='Float' Precision='4' Format='Binary'>s{step}.bin</DataItem></Attribute></Grid>"
        );
    }
    let text =
        format!("<Xdmf><Domain><Grid GridType='Collection' CollectionType='Temporal'>{grids}</Grid></Domain></Xdmf>");
    Ok(fs::write(path, text)?)
}
