//! What a series looks like before anybody has said anything: its feature is seen, and seen through.

use crate::common::samples;
use crate::series::ingested;
use std::path::Path;
use std::sync::Arc;
use tetreel::camera::Camera;
use tetreel::field::FieldSelector;
use tetreel::image::RgbaImage;
use tetreel::import;
use tetreel::look::{Look, mapped_range};
use tetreel::node_table::NodeTable;
use tetreel::pipeline::{Backend, FrameRequest, Pipeline, TetDraw};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::Cancel;
use tetreel::transfer::{OpacityKind, TransferFunction};

/// Mean and standard deviation of the opacities of those pixels that the domain covers, and the picture.
struct Picture {
    mean: f64,
    deviation: f64,
    image: RgbaImage,
}

fn image(pipeline: &mut Pipeline, step: usize, camera: Camera, table: NodeTable) -> RgbaImage {
    let request = FrameRequest::new(step, camera, Arc::new(table), (160, 120));
    let request = FrameRequest { backend: Backend::Cpu, ..request.with_draw(TetDraw::Raycast) };
    pipeline.render_unless(&request, &Cancel::new()).unwrap().planes.color.clone()
}

/// The first picture of a step of a field, as `render` and the window make it.
fn first_picture(store: &Store, field: Option<&FieldSelector>, step: usize) -> Picture {
    let mut pipeline = Pipeline::open(store, field).unwrap();
    let look = Look::first_for(pipeline.series(), &Cancel::new()).unwrap();
    let range = mapped_range(pipeline.series(), &look.range, step.into()).unwrap();
    let table = look.table(&range).unwrap();
    let opaque = TransferFunction::parse("gray@0:1").unwrap();
    let everything = tetreel::transfer::build_node_table(&opaque, &range, OpacityKind::Alpha, &look.lengths).unwrap();
    let domain = image(&mut pipeline, step, look.camera, everything);
    let image = image(&mut pipeline, step, look.camera, table);
    let covered = domain.pixels.iter().zip(&image.pixels).filter(|(domain, _)| domain[3] > 0.5);
    let alphas: Vec<f64> = covered.map(|(_, pixel)| f64::from(pixel[3])).collect();
    let count = alphas.len() as f64;
    let mean = alphas.iter().sum::<f64>() / count;
    let deviation = (alphas.iter().map(|alpha| (alpha - mean).powi(2)).sum::<f64>() / count).sqrt();
    Picture { mean, deviation, image }
}

/// One sees something, and through it.
fn assert_shows(name: &str, picture: &Picture) {
    let Picture { mean, deviation, .. } = picture;
    assert!((0.05..=0.6).contains(mean), "{name}: mean opacity {mean}");
    assert!(*deviation >= 0.05, "{name}: opacities differ by {deviation}");
}

fn import_to(source: &Path, out: &Path, steps: &str) -> Store {
    ingested(&*import::open(source).unwrap(), out, steps)
}

/// Steps of twelve at which there is something to be seen: the jet starts from nothing, and what decays is gone at the end.
const GENERATED: [(SeriesName, &[usize]); 5] = [
    (SeriesName::Decay, &[0, 6]),
    (SeriesName::Dipole, &[0, 6, 11]),
    (SeriesName::Jet, &[6, 11]),
    (SeriesName::Tornado, &[0, 6, 11]),
    (SeriesName::Slab, &[0, 6, 11]),
];

#[test]
fn the_first_picture_of_every_generated_series_shows_its_feature() {
    let out = tempfile::tempdir().unwrap();
    assert_eq!(GENERATED.map(|(series, _)| series), SeriesName::ALL);
    for (series, steps) in GENERATED {
        let source = generate(&SynthSpec { cells: 20_000, steps: 12, ..SynthSpec::new(series) }).unwrap();
        let store = ingested(&source, &out.path().join(series.as_str()), "0..11");
        for &step in steps {
            assert_shows(series.as_str(), &first_picture(&store, None, step));
        }
    }
}

#[test]
fn the_first_picture_of_every_sample_shows_its_feature() {
    let Some(dir) = samples() else { return };
    // The wave of the heart begins with hardly anything.
    for (name, field, steps, shown) in [
        ("heart_wave/heart_wave.xdmf", "potential", "0..359:40", [4, 8]),
        ("jet_flow/jet_flow.xdmf", "velocity", "0..63:9", [0, 4]),
        ("jet_flow/jet_flow.xdmf", "velocity:0", "0..63:9", [0, 4]),
        ("natural_convection/natural_convection.xdmf", "temperature", "0..149:30", [0, 2]),
        ("torso_dipole/torso_dipole.xdmf", "potential", "0..359:60", [0, 3]),
        ("spxf/spxf.pvd", "reaction_force", "0..191:40", [0, 2]),
    ] {
        let out = tempfile::tempdir().unwrap();
        let store = import_to(&dir.join(name), &out.path().join("series.zarr"), steps);
        let field = field.parse().unwrap();
        for step in shown {
            assert_shows(name, &first_picture(&store, Some(&field), step));
        }
    }
}

#[test]
fn both_hues_of_a_dipole_are_seen() {
    let Some(dir) = samples() else { return };
    let out = tempfile::tempdir().unwrap();
    let store = import_to(&dir.join("torso_dipole/torso_dipole.xdmf"), &out.path().join("torso.zarr"), "0..359:60");
    let picture = first_picture(&store, None, 0);
    let is_seen = |pixel: &&[f32; 4]| pixel[3] >= 0.3;
    let seen: Vec<&[f32; 4]> = picture.image.pixels.iter().filter(is_seen).collect();
    let (warm, cold) =
        (seen.iter().filter(|p| p[0] > 1.2 * p[2]).count(), seen.iter().filter(|p| p[2] > 1.2 * p[0]).count());
    eprintln!("torso: {warm} warm pixels, {cold} cold ones");
    assert!(warm > 10 && cold > 10, "{warm} {cold}");
}
