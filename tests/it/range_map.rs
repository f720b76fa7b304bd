//! A crowd of values in a corner of their range: what a range map makes visible (dissertation 7.2, figure 7.1).

use crate::common::samples;
use crate::series::ingested;
use std::sync::Arc;
use tetreel::camera::Camera;
use tetreel::histograms::{Histogram, Kind};
use tetreel::image::RgbaImage;
use tetreel::import;
use tetreel::moments::{AxisScale, Bins, Histogram1d};
use tetreel::pipeline::{FrameRequest, Pipeline};
use tetreel::store::Store;
use tetreel::task::Cancel;
use tetreel::transfer::{
    Context, Ensemble, Function, Lengths, Member, OpacityKind, RangeMap, RangePolicy, TransferFunction,
};

/// Two shells: what lies a little below and a little above the middle of the axis.
const SHELLS: &str = "cool-to-warm@0:0,0.3:0,0.38:0.5,0.46:0,0.54:0,0.62:0.5,0.7:0,1:0";

/// The torso with its dipole in the 100th of 360 positions.
fn torso(out: &std::path::Path) -> Option<Store> {
    let source = import::open(&samples()?.join("torso_dipole/torso_dipole.xdmf")).unwrap();
    Some(ingested(&*source, &out.join("torso.zarr"), "100"))
}

/// Counts of the scalars over a range that is symmetric about 0.
fn symmetric_counts(scalars: &[f32], reach: f32) -> Histogram1d {
    let mut counts = Histogram1d::over(Bins::new(Some([-reach, reach]), AxisScale::Linear, 4096));
    counts.add(scalars);
    counts
}

fn drawn(pipeline: &mut Pipeline, map: RangeMap) -> RgbaImage {
    let (lo, hi) = pipeline.mesh().positions.world_bounds();
    let unit = 0.01 * (hi - lo).length();
    let [min, max] = pipeline.field().range.unwrap().map(f64::from);
    let context = Context::new((min, max), (min, max), OpacityKind::Alpha, Lengths::of_unit_distance(unit));
    let function = Function::TransferFunction(TransferFunction::parse(SHELLS).unwrap());
    let member = Member { range: RangePolicy::Symmetric, map, ..Member::new("shells", function) };
    let ensemble = Ensemble { name: "shells".into(), members: vec![member], ..Default::default() };
    let table = Arc::new(ensemble.curve(&context).unwrap().node_table(&Lengths::of_unit_distance(unit)).unwrap());
    let camera = Camera::default_for((lo, hi)).unwrap();
    pipeline.render(&FrameRequest::new(0, camera, table, (160, 160))).unwrap().planes.color.clone()
}

/// Of the pixels that show the mesh, the share with an opacity above a fifth; of these, the share that is bluer than red and the
/// reverse.
fn visible(image: &RgbaImage, mesh: &RgbaImage) -> [f64; 3] {
    let inside: Vec<_> = image.pixels.iter().zip(&mesh.pixels).filter(|(_, m)| m[3] > 0.0).map(|(p, _)| p).collect();
    let seen: Vec<_> = inside.iter().filter(|p| p[3] > 0.2).collect();
    let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
    let blue = seen.iter().filter(|p| p[2] > p[0]).count();
    [share(seen.len(), inside.len()), share(blue, seen.len()), share(seen.len() - blue, seen.len())]
}

#[test]
fn shells_of_weak_potential_in_the_torso_are_seen_with_a_range_map_only() {
    let out = tempfile::tempdir().unwrap();
    let Some(store) = torso(out.path()) else { return };
    let mut pipeline = Pipeline::open(&store, None).unwrap();
    let [min, max] = pipeline.field().range.unwrap();
    let mut scalars = vec![0.0; pipeline.mesh().positions.local.len()];
    store.field(&pipeline.field().name.parse().unwrap()).unwrap().decode_step(0, &mut scalars).unwrap();
    let counts = symmetric_counts(&scalars, max.max(-min));
    // The crowd: a hundredth of the range has most of the values.
    let mut by_count = counts.counts().to_vec();
    by_count.sort_unstable_by_key(|&n| std::cmp::Reverse(n));
    let crowd = by_count[..by_count.len() / 100].iter().sum::<u64>() as f64 / counts.finite() as f64;
    eprintln!("{:.1} % of the values in 1 % of the range", 100.0 * crowd);
    // Measured: 0.867.
    assert!(crowd > 0.7);
    // What the store has counted over the series is of the same field.
    let stored = store.field(&pipeline.field().name.parse().unwrap()).unwrap();
    let stored: Vec<Histogram> = stored.histograms(pipeline.mesh(), &Cancel::new()).unwrap().unwrap();
    assert_eq!(stored.len(), Kind::ALL.len());
    assert_eq!(stored[0].one().unwrap().finite(), counts.finite());

    let flat = Ensemble {
        members: vec![Member::new("all", Function::TransferFunction(TransferFunction::parse("gray@0:0.1").unwrap()))],
        ..Default::default()
    };
    let mesh = {
        let range = (f64::from(min), f64::from(max));
        let context = Context::new(range, range, OpacityKind::Alpha, Lengths::of_unit_distance(1.0));
        let (lo, hi) = pipeline.mesh().positions.world_bounds();
        let table = Arc::new(flat.curve(&context).unwrap().node_table(&Lengths::of_unit_distance(1.0)).unwrap());
        pipeline
            .render(&FrameRequest::new(0, Camera::default_for((lo, hi)).unwrap(), table, (160, 160)))
            .unwrap()
            .planes
            .color
            .clone()
    };
    let [before, ..] = visible(&drawn(&mut pipeline, RangeMap::default()), &mesh);
    let [after, blue, red] = visible(&drawn(&mut pipeline, RangeMap::equalised(counts.counts())), &mesh);
    eprintln!(
        "visible: {:.2} % before, {:.1} % after, of it {:.0} % blue",
        100.0 * before,
        100.0 * after,
        100.0 * blue
    );
    // Measured: 0.0060 and 0.891, of it 0.53 blue. What is seen without a map does not pass for what is seen with one.
    assert!(before < 0.012 && after > 0.6, "{before} {after}");
    assert!(blue > 0.25 && red > 0.25, "both shells: {blue} {red}");
}
