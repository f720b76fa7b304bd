//! Two transfer functions and their blends, as in figure 7.6 of the dissertation: each as an image, with its opacity over the scalar below,
//! filled with its colours. `cargo run --release --example ensembles [OUT.png [STORE.zarr [STEP]]]`; without a store it generates a small
//! series first.

use std::{env::args, error::Error, path::Path, sync::Arc};
use tetreel::camera::Camera;
use tetreel::image::{PngDepth, RgbaImage, contact_sheet, write_png};
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::pipeline::{FrameRequest, Pipeline};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{
    Blend, ColorWeighting, Context, Curve, Ensemble, Function, Lengths, Member, OpacityKind, Rectangle, Widget,
};

const SIZE: (usize, usize) = (320, 240);
const PANEL_HEIGHT: usize = 96;
/// Opacity at the top of a panel.
const PANEL_OPACITY: f64 = 0.25;

/// A box of one colour over a range of scalars.
fn rectangle(x: [f64; 2], rgb: [f64; 3], opacity: f64) -> Widget {
    Widget::Rectangle(Rectangle { x, y: [0.0, 1.0], rgb, opacity: [opacity; 2] })
}

/// (a) the whole range, in three colours; (b) one detail.
fn members() -> [Member; 2] {
    let all = vec![
        rectangle([0.08, 0.3], [0.2, 0.4, 0.9], 0.015),
        rectangle([0.3, 0.6], [0.3, 0.75, 0.35], 0.04),
        rectangle([0.6, 1.0], [0.95, 0.75, 0.2], 0.12),
    ];
    let detail = vec![rectangle([0.5, 0.75], [0.9, 0.2, 0.15], 0.2)];
    [Member::new("all", Function::Widgets(all)), Member::new("detail", Function::Widgets(detail))]
}

fn main() -> Result<(), Box<dyn Error>> {
    let temp = tempfile::tempdir()?;
    let generated = temp.path().join("jet.zarr");
    let store = match args().nth(2) {
        Some(path) => Store::open(path)?,
        None => {
            let jet = generate(&SynthSpec { cells: 60_000, steps: 8, ..SynthSpec::new(SeriesName::Jet) })?;
            ingest(&jet, &generated, &IngestOptions::default(), &Silent, &Cancel::new())?;
            Store::open(&generated)?
        }
    };
    let mut pipeline = Pipeline::open(&store, None)?;
    let step = args().nth(3).map_or(Ok(pipeline.times().len() / 2), |text| text.parse())?;
    let (lo, hi) = pipeline.mesh().positions.world_bounds();
    let [min, max] = pipeline.field().range.ok_or("the field has no finite value")?.map(f64::from);
    let unit_distance = 0.01 * (hi - lo).length();
    let context = Context::new((min, max), (min, max), OpacityKind::Alpha, Lengths::of_unit_distance(unit_distance));
    let mut camera = Camera::default_for((lo, hi))?;
    // Nearer: the ends of a jet are empty.
    camera.position = camera.focal_point.lerp(camera.position, 0.65);
    let [all, detail] = members();
    let one =
        |member: &Member| Ensemble { name: "one".into(), colors: ColorWeighting::Plain, members: vec![member.clone()] };
    let both = |blend| {
        let detail = Member { blend, ..detail.clone() };
        Ensemble { members: vec![all.clone(), detail], ..one(&all) }
    };
    let ensembles = [one(&all), one(&detail), both(Blend::Add), both(Blend::And), both(Blend::Xor8)];
    let (mut images, mut panels) = (Vec::new(), Vec::new());
    for ensemble in ensembles {
        let curve = ensemble.curve(&context)?;
        let table = Arc::new(curve.node_table(&Lengths::of_unit_distance(unit_distance))?);
        images.push(pipeline.render(&FrameRequest::new(step, camera, table, SIZE))?.planes.color.clone());
        panels.push(panel(&curve, (min, max)));
    }
    let out = args().nth(1).unwrap_or_else(|| "ensembles.png".to_owned());
    images.append(&mut panels);
    let rows = [&images[..5], &images[5..]].map(|row| contact_sheet(row, 5, 6, [0.0; 3]));
    write_png(Path::new(&out), &stacked(&rows), Some([0.0; 3]), PngDepth::Eight)?;
    println!("{out}: all, detail, ADD, AND, XOR at step {step}");
    Ok(())
}

/// Plot of opacity over the scalar's range, filled with the colours.
fn panel(curve: &Curve, (min, max): (f64, f64)) -> RgbaImage {
    let mut image = RgbaImage::new(SIZE.0, PANEL_HEIGHT);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        let (column, row) = (i % SIZE.0, i / SIZE.0);
        let (rgb, opacity) = curve.eval(min + (max - min) * (column as f64 + 0.5) / SIZE.0 as f64);
        let height = 1.0 - (row as f64 + 0.5) / PANEL_HEIGHT as f64;
        let [r, g, b] = if opacity / PANEL_OPACITY > height { rgb } else { [0.15; 3] };
        *pixel = [r, g, b, 1.0].map(|v| v as f32);
    }
    image
}

/// Stacks images of equal width.
fn stacked(rows: &[RgbaImage]) -> RgbaImage {
    let pixels = rows.iter().flat_map(|row| row.pixels.iter().copied()).collect();
    RgbaImage { width: rows[0].width, height: rows.iter().map(|row| row.height).sum(), pixels }
}
