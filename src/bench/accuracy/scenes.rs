//! Scenes of the accuracy suite.

use crate::bench::report::SceneName;
use crate::camera::{Camera, CameraError};
use crate::node_table::NodeTable;
use crate::pipeline::FrameRequest;
use crate::transfer::TransferSource;
use std::sync::Arc;

/// Transfer functions by name: one in which every scalar is visible, so that rays are long and all cells count, and one of two narrow
/// tents, which is hardest for tables, omitted faces and small images.
pub const TRANSFER_FUNCTIONS: [(&str, &str); 2] =
    [("dense", "viridis@0:0.05,1:0.5"), ("tents", "viridis@0:0,0.2:0,0.25:0.8,0.3:0,0.6:0,0.65:0.8,0.7:0,1:0")];

/// A view and a time within a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Name of the view.
    pub name: &'static str,
    /// Step as a share of the series, 0 to 1.
    pub at: f64,
    /// Degrees around the focal point, from the camera that frames the mesh.
    pub azimuth_deg: f64,
    /// Elevation in degrees.
    pub elevation_deg: f64,
}

/// The views of every series: from the front at half time, and from the side near the end.
pub const VIEWS: [View; 2] = [
    View { name: "front", at: 0.5, azimuth_deg: 0.0, elevation_deg: 0.0 },
    View { name: "side", at: 0.9, azimuth_deg: 75.0, elevation_deg: 20.0 },
];

/// A step seen through a camera and a transfer function.
#[derive(Clone, Debug, PartialEq)]
pub struct AccuracyScene {
    /// Name in the record.
    pub name: SceneName,
    /// The request, for any path.
    pub request: FrameRequest,
}

/// Every view through every transfer function, for a series of this number of steps. `camera` frames the mesh; `table` makes the table of a
/// transfer function (as text) at a step, and returns what it is made from.
///
/// # Errors
/// As `table`, or if a camera cannot orbit.
pub fn scenes<E: From<CameraError>>(
    series: &str,
    steps: usize,
    camera: &Camera,
    size_px: (usize, usize),
    transfer_functions: &[(&str, &str)],
    mut table: impl FnMut(&str, usize) -> Result<(Arc<NodeTable>, Arc<TransferSource>), E>,
) -> Result<Vec<AccuracyScene>, E> {
    let mut all = Vec::new();
    for view in &VIEWS {
        let step = (view.at * steps.saturating_sub(1) as f64).round() as usize;
        let camera = camera.orbit(view.azimuth_deg, view.elevation_deg)?;
        for (name, tf) in transfer_functions {
            let name = SceneName {
                series: series.to_owned(),
                transfer_function: (*name).to_owned(),
                step,
                view: view.name.to_owned(),
            };
            let (table, source) = table(tf, step)?;
            let request = FrameRequest::new(step, camera, table, size_px);
            all.push(AccuracyScene { name, request: request.with_tets(|tets| tets.formula = Some(source)) });
        }
    }
    Ok(all)
}
