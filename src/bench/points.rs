//! The points suite: cells as points in all their footprints, beside faces and the cell walk, as tables 3.1 and 3.2 of the dissertation.

use super::{RunError, Spread};
use crate::image::RgbaImage;
use crate::pipeline::{FrameRequest, Pipeline, PipelineError, TetDraw};
use crate::render::points::{Compositing, Footprint, PointStyle};
use crate::short::Short;
use crate::task::{Cancel, Progress};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Levels of detail of table 3.2.
const LODS: [f64; 4] = [1.0, 0.75, 0.5, 0.25];
const FOOTPRINTS: [Footprint; 4] = [Footprint::Square, Footprint::Circle, Footprint::Ellipse, Footprint::Exact];
/// The scale of footprints at which `gap` overdraws least.
const SMALL: f64 = 0.6;

/// Judge of the errors: the cell walk, from which the reference is two orders of magnitude nearer than what is measured.
const JUDGE_WALK: &str = "raycast";

/// One way to draw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointsRow {
    /// The renderer; of points with compositing, footprint and what differs from the default.
    pub way: String,
    /// The source of error by which alone it differs from `own exact`, if it is a row of the decomposition.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Level of detail: the share of faces or fragments.
    pub lod: f64,
    /// Milliseconds of the frames.
    pub ms: Spread,
    /// Error of the image against the cell walk.
    pub error: RunError,
    /// Fragments per pixel of the image; 0 for rays.
    pub fragments: f64,
}

/// Results for a series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointsRun {
    /// Name of the data set.
    pub dataset: String,
    /// Cells of its mesh.
    pub cells: u64,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// All ways to draw; the first one is the cell walk.
    pub rows: Vec<PointsRow>,
}

/// Sources of error (dissertation 3.4), each by the one change to `own exact` that has it. A gap has the depth and the scalar of centroids by
/// its definition: the row before it has these without the gap. The errors do not add up.
fn sources() -> [(&'static str, PointStyle); 6] {
    const EXACT: PointStyle = PointStyle::EXACT;
    let (order, scalar) = (PointStyle { exact_order: false, ..EXACT }, PointStyle { constant_scalar: true, ..EXACT });
    [
        ("none: own entry and exit", EXACT),
        ("order of centroids", order),
        ("constant scalar", scalar),
        ("overdraw", PointStyle { footprint: Footprint::Ellipse, ..EXACT }),
        ("order and scalar", PointStyle { exact_order: false, ..scalar }),
        ("order, scalar and gap", PointStyle { compositing: Compositing::Gap, ..EXACT }),
    ]
}

/// A way to draw, with its name.
fn ways() -> Vec<(String, TetDraw)> {
    let mut ways = vec![("raycast".to_owned(), TetDraw::Raycast), ("havs".to_owned(), TetDraw::ALL_FACES)];
    let mut points = |style: PointStyle, note: &str| {
        let name = format!("{} {}{note}", style.compositing, style.footprint);
        ways.push((name, TetDraw::Points(style)));
    };
    for compositing in [Compositing::Own, Compositing::Gap] {
        for footprint in FOOTPRINTS {
            let style = PointStyle { footprint, compositing, ..PointStyle::EXACT };
            LODS.into_iter().for_each(|lod| points(PointStyle { lod, ..style }, ""));
        }
        let small = PointStyle { footprint: Footprint::Ellipse, compositing, radius: SMALL, ..PointStyle::EXACT };
        points(small, &format!(", radius {SMALL}"));
    }
    let scalar = PointStyle { constant_scalar: true, ..PointStyle::EXACT };
    points(PointStyle { exact_order: false, ..PointStyle::EXACT }, ", inexact order");
    points(scalar, ", constant scalar");
    points(PointStyle { exact_order: false, ..scalar }, ", constant scalar, inexact order");
    ways
}

/// Draws the request's scene in all ways in turn, `frames` times and once more before; refused ways are left out.
///
/// # Errors
/// If a step cannot be read, the camera has no view, the cell walk fails, or `cancel` was raised.
pub fn run_points(
    pipeline: &mut Pipeline,
    dataset: &str,
    request: &FrameRequest,
    frames: usize,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<PointsRun, PipelineError> {
    let mut truth: Option<RgbaImage> = None;
    let mut rows: Vec<(PointsRow, FrameRequest, Vec<f64>)> = Vec::new();
    let source_of = |draw| {
        let found = sources().into_iter().find(|(_, style)| TetDraw::Points(*style) == draw);
        found.map(|(source, _)| source.to_owned())
    };
    let pixels = (request.size_px.0 * request.size_px.1).max(1) as f64;
    for (way, draw) in ways() {
        let request = request.clone().with_draw(draw);
        let frame = match pipeline.render_unless(&request, cancel) {
            Ok(frame) => frame,
            Err(PipelineError::Render(_) | PipelineError::Request(_)) if truth.is_some() && !cancel.is_cancelled() => {
                continue;
            }
            Err(error) => return Err(error),
        };
        let truth = truth.get_or_insert_with(|| frame.planes.color.clone());
        let error = RunError::between(truth, &frame.planes.color, JUDGE_WALK);
        let fragments = frame.stats.fragments as f64 / pixels;
        let (source, lod, ms) = (source_of(draw), draw.lod(), Spread::of(&[]));
        rows.push((PointsRow { way, source, lod, ms, error, fragments }, request, Vec::new()));
        progress.advance(1);
    }
    for _ in 0..frames {
        for (_, request, times) in &mut rows {
            times.push(pipeline.render_unless(request, cancel)?.stats.ms_worked());
        }
        progress.advance(1);
    }
    let with_times = |(row, _, times): (PointsRow, _, Vec<f64>)| PointsRow { ms: Spread::of(&times), ..row };
    Ok(PointsRun {
        dataset: dataset.to_owned(),
        cells: pipeline.mesh().topology.tets.len() as u64,
        size: [request.size_px.0 as u32, request.size_px.1 as u32],
        rows: rows.into_iter().map(with_times).collect(),
    })
}

/// Number of ways and of frames that [`run_points`] tells of.
pub fn points_progress(frames: usize) -> u64 {
    (ways().len() + frames) as u64
}

impl fmt::Display for PointsRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { dataset, cells, size: [width, height], rows } = self;
        writeln!(f, "\n{dataset}: {cells} cells, {width} x {height}, errors against the ray caster")?;
        writeln!(f, "| way | % | ms (quartiles) | fps | of its time | fragments a pixel | RMSE | max | distance |")?;
        writeln!(f, "|---|---|---|---|---|---|---|---|---|")?;
        let walk = rows.first().map_or(f64::NAN, |row| row.ms.median);
        for PointsRow { way, lod, ms, error, fragments, .. } in rows {
            let Spread { q1, median, q3, .. } = ms;
            let percent = Short(100.0 * lod);
            let (fps, of_walk) = (1e3 / median, median / walk);
            let (RunError { rmse, max, .. }, distance) = (error, error.distance.unwrap_or(f64::NAN));
            writeln!(
                f,
                "| {way} | {percent} | {median:.1} ({q1:.1} to {q3:.1}) | {fps:.1} | {of_walk:.2} | {fragments:.1} | {rmse:.1e} | {max:.1e} | {distance:.2} |"
            )?;
        }
        writeln!(f, "\nSources of error, by changes to own exact; the errors do not add up")?;
        writeln!(f, "| source | way | fps | fragments a pixel | RMSE | max | distance |")?;
        writeln!(f, "|---|---|---|---|---|---|---|")?;
        let of = |source: &str| rows.iter().find(|row| row.source.as_deref() == Some(source));
        for PointsRow { way, source, ms, error, fragments, .. } in sources().iter().filter_map(|(source, _)| of(source))
        {
            let (source, fps) = (source.as_deref().unwrap_or_default(), 1e3 / ms.median);
            let (RunError { rmse, max, .. }, distance) = (error, error.distance.unwrap_or(f64::NAN));
            writeln!(f, "| {source} | {way} | {fps:.1} | {fragments:.1} | {rmse:.1e} | {max:.1e} | {distance:.2} |")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::node_table::{Node, NodeTable};
    use crate::pipeline::{Backend, test_series};
    use crate::task::Silent;
    use std::sync::Arc;

    #[test]
    fn every_footprint_compositing_and_level_is_a_row_once_and_exact_points_are_the_walk() {
        let mut pipeline = Pipeline::new(test_series::jet());
        let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
        let node = |scalar, tau| Node { scalar, rgb: [1.0; 3], tau };
        let table = NodeTable::new(vec![node(0.0, 0.1), node(1.0, 3.0)]).unwrap();
        let request = FrameRequest::new(0, camera, Arc::new(table), (32, 24));
        let request = FrameRequest { backend: Backend::Cpu, ..request };
        let run = run_points(&mut pipeline, "jet", &request, 2, &Silent, &Cancel::new()).unwrap();
        assert_eq!(run.rows.len(), 2 + 2 * (4 * 4 + 1) + 3);
        let row = |way: &str, lod: f64| {
            let found: Vec<_> = run.rows.iter().filter(|row| row.way == way && row.lod == lod).collect();
            assert_eq!(found.len(), 1, "{way} {lod}");
            found[0]
        };
        let [exact, gap] = [row("own exact", 1.0), row("gap exact", 1.0)];
        assert!(exact.error.rmse <= 1e-5 && gap.error.rmse > 10.0 * exact.error.rmse.max(1e-5), "{gap:?}");
        assert!(row("own exact", 0.25).fragments < row("own exact", 0.75).fragments);
        assert!(run.rows.iter().all(|row| row.ms.median > 0.0));
        let of_source = |source: &str| {
            let found: Vec<_> = run.rows.iter().filter(|row| row.source.as_deref() == Some(source)).collect();
            assert_eq!(found.len(), 1, "{source}");
            found[0]
        };
        let parts = sources().map(|(source, _)| of_source(source));
        assert_eq!(parts.len(), run.rows.iter().filter(|row| row.source.is_some()).count());
        for (i, part) in parts.iter().enumerate() {
            // Each changes something of its own.
            assert!(part.error.rmse > 1e-5 || i == 0, "{part:?}");
            assert!(parts[..i].iter().all(|other| other.way != part.way && other.error != part.error), "{part:?}");
            assert_eq!(part.lod, 1.0);
        }
        let text = run.to_string();
        assert!(text.contains("the errors do not add up") && text.contains("| overdraw | own ellipse |"));
        assert!(text.contains("| gap ellipse, radius 0.6 | 100 |") && text.contains("| own exact, inexact order |"));
        let json = serde_json::to_string(&run).unwrap();
        assert_eq!(serde_json::from_str::<PointsRun>(&json).unwrap(), run);
    }
}
