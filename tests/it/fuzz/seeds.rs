//! The seeds in `fuzz/corpus`, written by the library's own writers and by hand. `fuzz/README.md` has the command that writes
//! them anew; what fuzzing found lies beside them and is left alone.

use super::CORPUS;
use super::targets::archive::pack;
use crate::import::series::Grid;
use crate::meshes::{grid, noise};
use ::exr::prelude::{
    Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, Vec2, WritableImage,
};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use tetreel::camera::Camera;
use tetreel::codec::vq::{Search, VqEncoder, VqOptions};
use tetreel::codec::{ChunkSink, Encoder, seal};
use tetreel::error::FileResult;
use tetreel::field::{Association, Component, FieldInfo, SeriesSource, TimeAxis};
use tetreel::fit::{FitOptions, fit};
use tetreel::image::{DepthImage, ExrColor, ExrValue, Planes, PngDepth, RgbaImage, write_exr, write_png_with_texts};
use tetreel::ingest::{CodecChoice, IngestOptions, ingest};
use tetreel::mesh::RawMesh;
use tetreel::node_table::{JointTable, Node, NodeTable};
use tetreel::pipeline::{FaceDetail, FrameRequest, FrameTime, TetDraw};
use tetreel::store::{Store, StoredTravel};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{
    Lengths, MappedRange, OpacityKind, RangePolicy, TransferContent, TransferFunction, TransferSource,
};
use tetreel::ui::settings::{SavedLook, Settings, SettingsFile};

fn put(to: &Path, target: &str, name: &str, bytes: &[u8]) {
    let folder = to.join(target);
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join(name), bytes).unwrap();
}

fn write_all(to: &Path) {
    stores(to);
    stores_of_shapes(to);
    store_of_points(to);
    blocks(to);
    xdmf_and_pvd(to);
    parts(to);
    exodus(to);
    ensight(to);
    raw(to);
    images(to);
    transfer_functions(to);
    texts(to);
    requests(to);
}

/// Names of the seeds in a folder, each with that of its target.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = |folder: &Path| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let name = |path: &Path| path.strip_prefix(folder).unwrap().to_string_lossy().replace('\\', "/");
    entries(folder).filter(|path| path.is_dir()).flat_map(|path| entries(&path)).map(|path| name(&path)).collect()
}

#[test]
fn the_seeds_are_those_that_are_written() {
    let temp = tempfile::tempdir().unwrap();
    write_all(temp.path());
    let (written, kept) = (names(temp.path()), names(Path::new(CORPUS)));
    // What once failed is kept as it was, whoever wrote it.
    let seeds: BTreeSet<String> = kept.into_iter().filter(|name| !name.contains("/found_")).collect();
    assert_eq!(written, seeds);
    assert!(written.len() > 50, "{} seeds", written.len());
}

#[test]
#[ignore = "writes to the working tree; what it does is run by the test above, into another folder"]
fn the_seeds_are_written_anew() {
    write_all(Path::new(CORPUS));
}

/// A series on six tets.
struct Cube {
    mesh: RawMesh,
    times: TimeAxis,
    fields: Vec<FieldInfo>,
}

impl SeriesSource for Cube {
    fn describe(&self) -> String {
        "cube".to_owned()
    }

    fn times(&self) -> &TimeAxis {
        &self.times
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        Ok(self.mesh.clone())
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        let Component::Index(component) = component else { panic!("ingest reads components") };
        out.clear();
        out.extend((0..self.mesh.points.len()).map(|i| values(step + 100 * component)[i]));
        // Special values for the codec.
        if field.name == "T" && step == 5 {
            out[3] = f32::NAN;
        }
        Ok(())
    }
}

/// Eight numbers of a step.
fn values(step: usize) -> Vec<f32> {
    (0..8).map(|i| (0.1 * step as f64 + noise(1, i) + 0.01 * noise(2, 8 * step as u64 + i)) as f32).collect()
}

fn stores(to: &Path) {
    let cube = |steps: usize, components| Cube {
        mesh: grid(1, 0.0, 0, |_| true),
        times: TimeAxis { values: (0..steps).map(|i| 0.5 * i as f64).collect() },
        fields: vec![FieldInfo { name: "T".to_owned(), components, association: Association::Point }],
    };
    let vq = VqOptions { entries: 4, search: Search::Exact, own_scales: false };
    for (name, source, codec) in [
        ("raw", cube(2, 1), CodecChoice::default()),
        ("vector", cube(1, 2), CodecChoice::default()),
        ("travel", cube(17, 3), CodecChoice::default()),
        ("vq", cube(66, 1), CodecChoice::new(vq)),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.zarr");
        ingest(&source, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
        if name == "travel" {
            keep_ways(&Store::open(&path).unwrap());
        }
        put(to, "store", name, &packed(&path));
        if name == "raw" {
            let store = Store::open(&path).unwrap();
            fit(&store, None, &FitOptions::default(), &Silent, &Cancel::new()).unwrap();
            put(to, "store", "functions", &packed(&path));
        }
    }
}

/// Ways of the vectors of a store, whatever these are.
fn keep_ways(store: &Store) {
    let components = [0, 1, 2].map(|axis| store.field(&format!("T:{axis}").parse().unwrap()).unwrap());
    let travel = StoredTravel::of(components.each_ref(), store.times()).unwrap();
    let ways = |first: f32| Arc::new((0..8u8).map(|i| first + f32::from(i)).collect());
    assert!(travel.keep(0, &[ways(0.5), ways(1.0)]).unwrap());
}

/// A hexahedron, a wedge as a polyhedron, a pyramid and a tetrahedron.
fn shapes(has_shared_faces: bool) -> Grid {
    let mut points: Vec<_> = (0..8).map(|i| [f64::from(i % 2), f64::from(i / 2 % 2), f64::from(i / 4)]).collect();
    points.extend([[0.5, 0.0, 2.0], [0.5, 1.0, 2.0], [2.0, 0.5, 0.5], [2.0, 0.0, 1.5]]);
    let wedge = vec![vec![4, 5, 8], vec![6, 9, 7], vec![4, 6, 7, 5], vec![5, 7, 9, 8], vec![8, 9, 6, 4]];
    Grid {
        point_arrays: vec![("T", 1, (0..12).map(f64::from).collect())],
        cell_arrays: vec![("c", 2, (0..8).map(f64::from).collect())],
        cells: vec![
            (12, vec![0, 1, 3, 2, 4, 5, 7, 6]),
            (42, vec![4, 5, 8, 6, 7, 9]),
            (14, vec![1, 3, 7, 5, 10]),
            (10, vec![5, 7, 10, 11]),
        ],
        faces: vec![(1, wedge)],
        points,
        has_shared_faces,
        ..Grid::default()
    }
}

fn stores_of_shapes(to: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let (vtu, path) = (folder.path().join("a.vtu"), folder.path().join("s.zarr"));
    fs::write(&vtu, shapes(true).text()).unwrap();
    let source = tetreel::import::open(&vtu).unwrap();
    ingest(source.as_ref(), &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
    put(to, "store", "shapes", &packed(&path));
}

/// Points without cells, with radii and volumes.
fn store_of_points(to: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.zarr");
    let cloud = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/npz/cloud.npz");
    let source = tetreel::import::open(&cloud).unwrap();
    let options = IngestOptions { radius: Some(0.25), volume: Some(0.01), ..Default::default() };
    ingest(source.as_ref(), &path, &options, &Silent, &Cancel::new()).unwrap();
    put(to, "store", "cloud", &packed(&path));
}

/// Pieces, blocks and lists of them; and polyhedra, which such files often have.
fn parts(to: &Path) {
    for (name, has_shared_faces) in [("polyhedra", false), ("polyhedra_shared_faces", true)] {
        put(to, "vtu", name, shapes(has_shared_faces).text().as_bytes());
    }
    let grid = shapes(false).text();
    let pieces = br#"<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid GhostLevel="0">
<Piece Source="a.vtu"/><Piece Source="./b.vtu"/></PUnstructuredGrid></VTKFile>
"#;
    let blocks = br#"<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet><Block index="0"><DataSet index="0" file="p.pvtu"/>
<DataSet index="1"/></Block><DataSet index="1" file="s.vtp"/></vtkMultiBlockDataSet></VTKFile>
"#;
    let list =
        br#"{"file-series-version": "1.0", "files": [{"name": "m.vtm", "time": 0.5}, {"name": "p.pvtu", "time": 0}]}"#;
    let files = [("a.vtu", grid.as_bytes()), ("b.vtu", grid.as_bytes()), ("p.pvtu", &pieces[..]), ("m.vtm", blocks)];
    let all = [("fuzzed.vtu.series", &list[..])].into_iter().chain(files);
    put(to, "parts", "nested", &pack(all.map(|(name, bytes)| (name, bytes, false))));
    let list = br#"{"files": [{"name": "a.vtu", "time": -1e3}, {"name": "a.vtu", "time": 2.5}]}"#;
    let all = [("fuzzed.vtu.series", &list[..], false), ("a.vtu", grid.as_bytes(), false)];
    put(to, "parts", "plain", &pack(all));
    let list = br#"{"files": [{"name": "a.vtk", "time": 1}, {"name": "b.vtk", "time": 2.5}]}"#;
    let files = [("a.vtk", LEGACY), ("b.vtk", LEGACY)].map(|(name, bytes)| (name, bytes, false));
    put(to, "parts", "legacy", &pack([("fuzzed.vtu.series", &list[..], false)].into_iter().chain(files)));
    let list = br#"{"files": [{"name": "m.vtm", "time": 1}, {"name": "m.vtm", "time": 2.5}]}"#;
    let blocks = br#"<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet><DataSet index="0" file="a.vtu"/>
<DataSet index="1" file="b.vtk"/></vtkMultiBlockDataSet></VTKFile>
"#;
    let files = [("a.vtu", grid.as_bytes()), ("b.vtk", LEGACY), ("m.vtm", &blocks[..])];
    let all = [("fuzzed.vtu.series", &list[..])].into_iter().chain(files);
    put(to, "parts", "mixed", &pack(all.map(|(name, bytes)| (name, bytes, false))));
    put(to, "vtk", "attributes", LEGACY);
}

/// A legacy file of VTK with attributes of all kinds.
const LEGACY: &[u8] = b"# vtk DataFile Version 3.0
all attributes
ASCII
DATASET STRUCTURED_POINTS
FIELD FieldData 2 CYCLE 1 1 int 7 TIME 1 1 double 0.25
DIMENSIONS 2 2 2
ASPECT_RATIO 1 0.5 2
ORIGIN 0 -1e3 0
POINT_DATA 8
SCALARS s%20t short
LOOKUP_TABLE colours
1 2 3 4 5 6 7 8
LOOKUP_TABLE colours 1
0.1 0.2 0.3 1
COLOR_SCALARS c 1 0 0 0 0 0 0 0 1
VECTORS v float
1 0 0 1 0 0 1 0 0 1 0 0 1 0 0 1 0 0 1 0 0 -1e-3 nan inf
METADATA
COMPONENT_NAMES
x

z
INFORMATION 1
NAME L2_NORM_RANGE LOCATION vtkDataArray
DATA 2 0 1

TENSORS6 t double
1 2 3 4 5 6 1 2 3 4 5 6 1 2 3 4 5 6 1 2 3 4 5 6
1 2 3 4 5 6 1 2 3 4 5 6 1 2 3 4 5 6 1 2 3 4 5 6
TEXTURE_COORDINATES tc 1 float 1 2 3 4 5 6 7 8
CELL_DATA 1
FIELD f 4
ids 2 1 vtkIdType 7 8
NULL_ARRAY
texts 1 1 string
a b
vtkGhostType 1 1 unsigned_char
0
";

/// Volumes with a header before their values.
fn raw(to: &Path) {
    let values: Vec<u8> = (0..24_u8).flat_map(|i| (f32::from(i) * 0.5).to_le_bytes()).collect();
    let meta = b"ObjectType = Image\nNDims = 3\nDimSize = 2 3 4\nElementSpacing = 0.5 1 2\nOffset = 1 0 -1\n\
                 TransformMatrix = 1 0 0 0 1 0 0 0 1\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n";
    put(to, "raw", "metaimage", &[&meta[..], &values].concat());
    let nrrd = b"NRRD0004\ntype: float\ndimension: 4\nsizes: 2 3 2 2\nspace: left-posterior-superior\n\
                 space directions: (1,0,0) (0,1,0) (0,0,1) none\nspace origin: (0,0,0)\nkinds: domain domain domain list\n\
                 endian: little\nencoding: raw\n\n";
    put(to, "raw", "nrrd", &[&nrrd[..], &values].concat());
    let text =
        b"NRRD0001\ncontent: T\ntype: float\ndimension: 3\nsizes: 2 2 2\nencoding: ascii\n\n1 2 3 4\n5 6 7 1e3\n";
    put(to, "raw", "text", text);
}

/// A case as text and one in C binary, in files of their own.
fn ensight(to: &Path) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/ensight");
    for kind in ["text", "binary"] {
        let data = |name: &str| fs::read(folder.join(name)).unwrap();
        let [mesh, t0, t1, p] = ["mesh.geo", "T.0", "T.1", "p"].map(|name| format!("{kind}.{name}"));
        let bytes = [&mesh, &t0, &t1, &p].map(|name| data(name));
        let case = data(&format!("{kind}.case"));
        let files =
            [&mesh, &t0, &t1, &p].into_iter().zip(&bytes).map(|(name, bytes)| (name.as_str(), &bytes[..], false));
        put(to, "ensight", kind, &pack([("fuzzed.case", &case[..], false)].into_iter().chain(files)));
    }
}

/// The files of the tests.
fn exodus(to: &Path) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/exodus");
    for name in ["cdf1", "cdf2", "cdf5", "netcdf4"] {
        put(to, "exodus", name, &fs::read(folder.join(format!("{name}.e"))).unwrap());
    }
    let parts = [0, 1].map(|part| fs::read(folder.join(format!("parts.e.2.{part}"))).unwrap());
    let names = ["fuzzed.e.2.0", "fuzzed.e.2.1"];
    put(to, "exodus_parts", "two", &pack(names.into_iter().zip(&parts).map(|(name, bytes)| (name, &bytes[..], false))));
}

/// The files below a folder as one input, chunks without their checksums.
fn packed(root: &Path) -> Vec<u8> {
    let mut files = BTreeMap::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
                files.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    // The root first: an input that is cut behind it is still a store, or nearly one, and where there is none readers wait.
    let (root, others): (Vec<_>, Vec<_>) = files.iter().partition(|(name, _)| *name == "zarr.json");
    let parts = root.into_iter().chain(others).map(|(name, bytes)| {
        let payload = bytes.len().saturating_sub(4);
        let sealed = bytes.len() > 4 && bytes[payload..] == seal(&bytes[..payload]);
        (name.as_str(), if sealed { &bytes[..payload] } else { &bytes[..] }, sealed)
    });
    pack(parts)
}

/// Takes chunks as an encoder gives them.
#[derive(Default)]
struct Chunks(Vec<(String, Vec<u8>)>);

impl ChunkSink for Chunks {
    fn put(&mut self, key: &str, payload: &[u8]) -> FileResult<()> {
        self.0.push((format!("f/{key}"), payload.to_vec()));
        Ok(())
    }
}

fn blocks(to: &Path) {
    for (name, entries, own_scales, steps) in
        [("narrow", 3, false, 65), ("scales", 4, true, 64), ("short", 2, false, 9), ("wide", 257, true, 1)]
    {
        let mut chunks = Chunks::default();
        let mut encoder = Box::new(VqEncoder::new(8, VqOptions { entries, search: Search::Exact, own_scales }));
        for step in 0..steps {
            let mut values = values(step);
            if name != "short" {
                values[step % 8] = f32::INFINITY;
            }
            encoder.push(&values, &mut chunks).unwrap();
        }
        let parameters = encoder.finish(&mut chunks).unwrap().parameters;
        let shape = serde_json::json!({ "steps": steps, "vertices": 8, "parameters": parameters }).to_string();
        let first = [("f/shape.json", shape.as_bytes(), false)];
        put(
            to,
            "vq",
            name,
            &pack(first.into_iter().chain(chunks.0.iter().map(|(key, b)| (key.as_str(), &b[..], true)))),
        );
    }
    let payload: Vec<u8> = (0..24).collect();
    for kind in 0..7 {
        let sealed = [&[kind], &payload[..], &seal(&payload)].concat();
        put(to, "chunk", &format!("whole_{kind}"), &sealed);
    }
    put(to, "chunk", "empty", &[&[3][..], &seal(&[])].concat());
    put(to, "chunk", "key", b"\x03vq/mean/c/12/0");
}

fn xdmf_and_pvd(to: &Path) {
    let data = |name: &str| fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)).unwrap();
    for (name, others) in [
        ("contiguous_f64", &["contiguous_f64.h5"][..]),
        ("latest_f32", &["latest_f32.h5"]),
        ("dolfinx", &["dolfinx.h5"]),
        ("version2", &["version2.h5", "version2.bin"]),
        ("gzip_f32", &["gzip_f32.h5"]),
        ("checkpoint_xml", &[]),
        ("meshio_xml", &[]),
        ("spatial", &[]),
    ] {
        let main = data(&format!("xdmf/{name}.xdmf"));
        let others: Vec<(&str, Vec<u8>)> =
            others.iter().map(|other| (*other, data(&format!("xdmf/{other}")))).collect();
        let others = others.iter().map(|(other, bytes)| (*other, &bytes[..], false));
        put(to, "xdmf", name, &pack([("fuzzed.xdmf", &main[..], false)].into_iter().chain(others)));
    }
    put(to, "vtu", "pieces", &data("vtu/pieces_ascii.vtu"));
    for name in ["steps.vtkhdf", "polyhedron.vtkhdf", "blocks.vtkhdf", "image.vtkhdf", "cloud.vtkhdf", "single.hdf"] {
        put(to, "vtkhdf", name.split('.').next().unwrap(), &data(&format!("vtkhdf/{name}")));
    }
    for name in ["stored", "deflated", "lists", "cloud", "filled"] {
        put(to, "npz", name, &data(&format!("npz/{name}.npz")));
    }
    let list = br#"<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1" byte_order="LittleEndian"><Collection>
<DataSet timestep="0" group="" part="0" file="a.vtu"/>
<DataSet timestep="0.5" group="" part="0" file="b%20.vtu"/>
<DataSet timestep="1e3" group="" part="0" file=".\a.vtu"/>
</Collection></VTKFile>
"#;
    let (a, b) = (data("vtu/ascii.vtu"), data("vtu/raw_zlib_32_le.vtu"));
    put(to, "pvd", "two", &pack([("fuzzed.pvd", &list[..], false), ("a.vtu", &a, false), ("b%20.vtu", &a, false)]));
    let list = br#"<VTKFile type="Collection"><Collection>
<DataSet part="1" file="b.vtu"/><DataSet part="0" file="a.vtu"/><DataSet part="2" file="surface.vtp"/>
</Collection></VTKFile>
"#;
    put(to, "pvd", "parts", &pack([("fuzzed.pvd", &list[..], false), ("a.vtu", &b, false), ("b.vtu", &b, false)]));
}

fn images(to: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let pixel = |i: u64| {
        let alpha = 0.5 + 0.5 * noise(3, i).abs();
        [0.2 * alpha, 0.5 * alpha, 0.9 * alpha, alpha].map(|c| c as f32)
    };
    let color = RgbaImage { width: 5, height: 4, pixels: (0..20).map(pixel).collect() };
    let depth = DepthImage { width: 5, height: 4, pixels: (0..20).map(|i| 1.0 + i as f32).collect() };
    let texts = [("Software", "tetreel"), ("tetreel fingerprint", "0123")];
    for (name, background, depth) in [
        ("straight_8", None, PngDepth::Eight),
        ("straight_16", None, PngDepth::Sixteen),
        ("opaque_8", Some([0.1, 0.2, 0.3]), PngDepth::Eight),
    ] {
        write_png_with_texts(&path, &color, background, depth, &texts).unwrap();
        put(to, "png", name, &fs::read(&path).unwrap());
    }
    for (name, color, bits, palette) in [
        ("palette", png::ColorType::Indexed, png::BitDepth::Two, true),
        ("gray_1", png::ColorType::Grayscale, png::BitDepth::One, false),
        ("gray_alpha", png::ColorType::GrayscaleAlpha, png::BitDepth::Eight, false),
    ] {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
        encoder.set_color(color);
        encoder.set_depth(bits);
        if palette {
            encoder.set_palette(vec![255, 0, 0, 0, 0, 255, 9, 9, 9]);
            encoder.set_trns(vec![255, 128]);
        }
        let data = vec![0b0110_0000; if color == png::ColorType::GrayscaleAlpha { 8 } else { 2 }];
        encoder.write_header().unwrap().write_image_data(&data).unwrap();
        put(to, "png", name, &bytes);
    }
    let attributes = BTreeMap::from([
        ("software".to_owned(), ExrValue::Text("tetreel".to_owned())),
        ("tetreel.time".to_owned(), ExrValue::Number(0.25)),
    ]);
    for (name, stored, depth) in [("raw", ExrColor::Raw, Some(&depth)), ("linear", ExrColor::Linear, None)] {
        let planes = Planes { color: color.clone(), depth: depth.cloned().unwrap_or_default(), ..Planes::default() };
        write_exr(&path, &planes, stored, &attributes).unwrap();
        put(to, "exr", name, &fs::read(&path).unwrap());
    }
    for (name, compression, blocks) in [
        ("none", Compression::Uncompressed, Blocks::ScanLines),
        ("rle", Compression::RLE, Blocks::ScanLines),
        ("zips", Compression::ZIP1, Blocks::ScanLines),
        ("zip_tiles", Compression::ZIP16, Blocks::Tiles(Vec2(4, 2))),
        ("piz", Compression::PIZ, Blocks::ScanLines),
        ("b44_tiles", Compression::B44, Blocks::Tiles(Vec2(8, 8))),
        ("pxr24", Compression::PXR24, Blocks::ScanLines),
    ] {
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let channels = SpecificChannels::rgba(|Vec2(x, y): Vec2<usize>| {
            let [r, g, b, a] = color.pixels[x + 5 * y];
            (r, g, b, a)
        });
        let layer = Layer::new((5, 4), LayerAttributes::named("a"), encoding, channels);
        Image::from_layer(layer).write().non_parallel().to_file(&path).unwrap();
        put(to, "exr", name, &fs::read(&path).unwrap());
    }
}

const MAPS: &[u8] = br#"[{"Name": "two", "ColorSpace": "RGB", "NanColor": [1, 1, 0],
 "RGBPoints": [-1.0, 0, 0, 0.5, 0.25, 1, 0.5, 0, 3.0, 1, 1, 1], "Points": [-1, 0, 0.5, 0, 1, 0.4, 0.3, 0.7, 3, 1, 0.5, 0]},
{"Name": "lab", "ColorSpace": "Lab", "RGBPoints": [0, 0.1, 0.1, 0.4, 1, 0.9, 0.9, 0.2]},
{"Name": "hsv", "ColorSpace": "HSV", "RGBPoints": [0, 1, 0, 0, 0.5, 0, 1, 0, 1, 0, 0, 1]},
{"Name": "diverging", "ColorSpace": "Diverging", "RGBPoints": [0, 0.2, 0.3, 0.8, 1, 0.7, 0, 0.1]}]
"#;

fn transfer_functions(to: &Path) {
    put(to, "color_maps", "spaces", MAPS);
    put(to, "color_maps", "step", br#"[{"RGBPoints": [0, 0, 0, 0, 1e-3, 0, 0, 0, 1e-3, 1, 1, 1, 1e300, 1, 1, 0]}]"#);
    let one = br#"{"color_map": "maps.json#two_r", "positions": "relative", "values": "opacity",
 "points": [[0, 0], [0.4, 0.2], [0.4, 1]]}"#;
    put(to, "transfer_function", "named", &pack([("fuzzed.json", &one[..], false), ("maps.json", MAPS, false)]));
    let tf = TransferFunction::parse("viridis_r@0:0,0.3:0.5,0.3:0,1:1").unwrap().to_json();
    put(to, "transfer_function", "built_in", &pack([("fuzzed.json", tf.as_bytes(), false)]));
    let full = br#"{"color_map": {"Name": "m", "ColorSpace": "Lab", "RGBPoints": [0, 0, 0, 0, 1, 1, 1, 1]},
 "positions": "absolute", "values": "extinction", "points": [[-2.5, 0], [7, 30]]}"#;
    put(to, "transfer_function", "full", &pack([("fuzzed.json", &full[..], false)]));

    let folder = tempfile::tempdir().unwrap();
    let mut file = SettingsFile::at(folder.path());
    let mut settings = Settings::default();
    settings.remember_file(Path::new("/data/a.zarr"));
    settings.looks.push(SavedLook {
        path: "/data/a.zarr".into(),
        used_ms: 5,
        field: "T".to_owned(),
        camera: Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap(),
        tf: TransferFunction::parse("viridis_r@0:0,0.3:0.5,1:1").unwrap(),
        range: RangePolicy::LogManual(0.5, 2.0),
    });
    assert_eq!(file.save(&mut settings), None);
    put(to, "settings", "look", &fs::read(folder.path().join("settings.json")).unwrap());
    put(to, "settings", "newer", br#"{"version": 2, "image_scale": 1}"#);
    put(to, "settings", "empty", b"{}");
}

fn texts(to: &Path) {
    let lists: [(&str, &[&str]); 4] = [
        (
            "camera",
            &[
                "pos=0,0,5 focal=0,0,0 up=0,1,0 angle=30 near=0.1",
                "parallel=2.5 pos=1e6,-2,3.5",
                "",
                "pos=1e-300,0,0 focal=0,0,0 up=0,1,1e-320",
            ],
        ),
        (
            "tf_text",
            &["viridis", "inferno@0:0,1:0.5", "batlow_r@0:0,0.4:0.2,0.4:1,1:0", "gray@0.5:1e300", "vik@1:1e-320"],
        ),
        (
            "options",
            &[
                "series",
                "-1e3,2.5",
                "log:1e-3,10",
                "symmetric",
                "0..99:10",
                "5",
                "..:4",
                "T:mag",
                "velocity:2",
                "T=K",
                "exact",
                "auto",
                "reference",
                "time,legend",
                "#ff8000",
                "30000/1001",
                "frame_%04d.png",
                "16",
                "linear",
                "transparent,hidden",
                "jet",
                "extinction",
                "fast",
                "all",
                "none",
                "6",
            ],
        ),
        (
            "command_line",
            &[
                "render\ns.zarr\n--tf\nviridis@0:0,1:0.5\n--range\nlog:1,2\n--output\nf_%04d.png\n--size\n640x480",
                "render\ns.zarr\n--times\n0..1.5\n--duration\n10\n--orbit\n360\n--output\nmovie.mp4\n--fps\n25",
                "import\nrun.pvd\n-o\ns.zarr\n--codec\nvq\n--entries\n256\n--fields\nT\n--steps\n0..9:3",
                "synth\njet\n-o\nj.zarr\n--cells\n1000\n--steps\n5",
                "compare\na.png\nb.png\n--sheet\nc.png\n--amplify\n10",
                "info\ns.zarr\n--threads\n4",
            ],
        ),
    ];
    for (target, list) in lists {
        for (i, text) in list.iter().enumerate() {
            put(to, target, &format!("text_{i:02}"), text.as_bytes());
        }
    }
}

fn requests(to: &Path) {
    let camera = Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap();
    let node = |scalar| Node { scalar, rgb: [0.25, 0.5, 1.0], tau: 3.0 };
    let nodes = NodeTable::new([0.0, 0.5, 0.5, 2.0].map(node).to_vec()).unwrap();
    let joint = JointTable::new(vec![0.0, 1.0], vec![0.0, 0.5], vec![0.0], vec![[0.5; 4]; 4]).unwrap();
    let content = TransferContent::Function {
        function: TransferFunction::parse("gray@0:0,1:0.5").unwrap(),
        range: MappedRange::new(0.0, 2.0, false).unwrap(),
    };
    let source = TransferSource { content, kind: OpacityKind::Alpha, lengths: Lengths::of_unit_distance(0.25) };
    let scalar = FrameRequest::new(3, camera, Arc::new(nodes), (64, 48));
    let joint = FrameRequest::new(FrameTime::between(1, 2, 0.25), camera, Arc::new(joint), (1, 1));
    for (name, request) in [
        ("scalar", scalar.clone().with_tets(|tets| tets.field = Some("velocity:mag".to_owned()))),
        ("joint", joint.with_draw(TetDraw::Faces(FaceDetail { lod: 0.5, ..FaceDetail::ALL }))),
        ("judged", scalar.with_tets(|tets| (tets.formula, tets.draw) = (Some(Arc::new(source)), TetDraw::Reference))),
    ] {
        put(to, "request", name, request.to_text().unwrap().as_bytes());
    }
}
