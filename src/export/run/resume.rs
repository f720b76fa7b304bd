//! Finding the frames of a run that were already rendered.
//!
//! Every image has the fingerprint of its inputs: [`VERSION`], and a SHA-256 over the version of tetreel, the text of the request without
//! its [hints](FrameRequest::without_hints), the file's metadata (time, field, units), checksums of the mesh, of the steps shown and of
//! further fields, of the vectors of all steps until there if flow has travelled through them, and how it is written. A file with the same
//! fingerprint that can be read to its end is the frame that would be rendered.

use super::RunError;
use super::plan::{Plan, PlannedFrame};
use crate::export::still::{FrameAttributes, read_fingerprint};
use crate::mesh::Mesh;
use crate::node_table::JointTable;
use crate::pipeline::{FlowLayer, FrameRequest, Series};
use crate::store::StoredTravel;
use crate::task::Cancel;
use sha2::{Digest, Sha256};
use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;

/// Common inputs of all frames of a run, and checksums of its steps.
pub(super) struct Fingerprints {
    common: Sha256,
    /// The last joint transfer function and its checksum.
    joint: RefCell<Option<(Arc<JointTable>, u32)>>,
    /// Steps, ascending, and the checksums of their scalars.
    steps: Vec<(usize, u32)>,
    /// The ways of the flow, which depend on all steps before.
    pub(super) travel: Option<StoredTravel>,
}

impl Fingerprints {
    /// `checksums` belong to the plan's steps, in order; `written_as` describes the output format.
    pub(super) fn new(mesh: &Mesh, plan: &Plan, checksums: &[u32], written_as: &str) -> Self {
        let mut common = Sha256::new();
        common.update(FrameAttributes::SOFTWARE);
        let positions = &mesh.positions;
        let crcs = [
            crc32c::crc32c(bytemuck::cast_slice(&positions.local)),
            crc32c::crc32c(bytemuck::cast_slice(&mesh.topology.tets)),
        ];
        let counts = (positions.local.len(), mesh.topology.tets.len());
        common.update(format!("{:?} {} {crcs:?} {counts:?} {written_as}", positions.origin, positions.scale));
        Self {
            common,
            joint: RefCell::default(),
            steps: plan.steps.iter().copied().zip(checksums.iter().copied()).collect(),
            travel: None,
        }
    }

    /// The fingerprint of a frame: a version, a colon, hexadecimal digits.
    pub(super) fn of(
        &self,
        frame: &PlannedFrame,
        request: &FrameRequest,
        attributes: &FrameAttributes,
        series: &Series,
        cancel: &Cancel,
    ) -> Result<String, RunError> {
        let mut hash = self.common.clone();
        // The text of a joint table would be megabytes.
        let short = request.clone().with_tets(|tets| tets.table = tets.table.over_scalars().clone().into());
        hash.update(short.without_hints().to_text()?);
        hash.update(serde_json::to_vec(attributes)?);
        if let Some(joint) = request.tets().and_then(|tets| tets.table.joint()) {
            hash.update(self.content(joint).to_le_bytes());
            // Its rows depend on all steps, also on those that are not shown.
            if joint.vertex_axis().len() > 1 {
                let cov = series.coefficients_of_variation(cancel)?.ok_or(RunError::Cancelled)?;
                hash.update(crc32c::crc32c(bytemuck::cast_slice(&cov)).to_le_bytes());
            }
        }
        let is_flow_seen = request.layers.iter().any(|layer| layer.flow().is_some_and(FlowLayer::is_seen));
        let last = frame.time.toward().map_or(0, |(next, _)| next).max(frame.time.step());
        if let Some(travel) = self.travel.as_ref().filter(|_| is_flow_seen) {
            hash.update(travel.depends_on(last).unwrap_or(0).to_le_bytes());
        }
        for step in [Some(frame.time.step()), frame.time.toward().map(|(next, _)| next)].into_iter().flatten() {
            let at = self.steps.binary_search_by_key(&step, |(step, _)| *step);
            hash.update(at.map_or(0, |i| self.steps[i].1).to_le_bytes());
        }
        let digits: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(format!("{VERSION}:{digits}"))
    }

    fn content(&self, joint: &Arc<JointTable>) -> u32 {
        let mut last = self.joint.borrow_mut();
        if let Some((of, content)) = &*last
            && Arc::ptr_eq(of, joint)
        {
            return *content;
        }
        let axes = [joint.scalars(), joint.vertex_axis(), joint.cell_axis()];
        let counts = axes.map(|axis| axis.len() as u64);
        let axes = axes.iter().fold(crc32c::crc32c(bytemuck::bytes_of(&counts)), |crc, axis| {
            crc32c::crc32c_append(crc, bytemuck::cast_slice(axis))
        });
        let content = crc32c::crc32c_append(axes, bytemuck::cast_slice(joint.values()));
        *last = Some((joint.clone(), content));
        content
    }
}

/// Version of fingerprints: one of another version does not identify a frame. Version 1 is not written as a number.
const VERSION: u32 = 3;

/// State of a frame's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// The file has the frame.
    Frame,
    /// An image of an older version, with unknown inputs.
    Older,
    /// The file is missing, unreadable or another image.
    Other,
}

/// Compares the fingerprint of `file`, if it is a complete image.
pub(super) fn find(file: &Path, fingerprint: &str) -> Found {
    let found = Some(file).filter(|file| file.is_file()).and_then(|file| read_fingerprint(file).ok().flatten());
    match found {
        None => Found::Other,
        Some(found) if found == fingerprint => Found::Frame,
        Some(found) if version_of(&found) < VERSION => Found::Older,
        Some(_) => Found::Other,
    }
}

fn version_of(fingerprint: &str) -> u32 {
    fingerprint.split_once(':').map_or(1, |(version, _)| version.parse().unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::export::still::FrameAttributes;
    use crate::ingest::{IngestOptions, ingest};
    use crate::node_table::{Node, NodeTable};
    use crate::pipeline::FrameTime;
    use crate::store::Store;
    use crate::synth::{SeriesName, SynthSpec, generate};
    use crate::task::Silent;

    fn series(seed: u64) -> (tempfile::TempDir, Series) {
        let dir = tempfile::tempdir().unwrap();
        let source = generate(&SynthSpec { cells: 600, steps: 3, seed, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
        let path = dir.path().join("jet.zarr");
        ingest(&source, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        let series = Series::open(&Store::open(path).unwrap(), None).unwrap();
        (dir, series)
    }

    #[test]
    fn what_is_seen_over_all_steps_and_every_value_of_a_joint_count() {
        let [(_one_dir, one), (_other_dir, other)] = [1, 2].map(series);
        let plan = Plan::of_steps(&[1], one.times());
        // The same mesh and the same scalars of the shown step, by checksum.
        let fingerprints = Fingerprints::new(one.mesh(), &plan, &[7], "png");
        let camera = Camera::default_for(one.mesh().positions.world_bounds()).unwrap();
        let table = |rows: &[f64], last: f32| {
            let mut values = vec![[0.5; 4]; 2 * rows.len()];
            values[2 * rows.len() - 1] = [0.5, 0.5, 0.5, last];
            Arc::new(JointTable::new(vec![0.0, 1.0], rows.to_vec(), vec![0.0], values).unwrap())
        };
        let of = |joint: &Arc<JointTable>, series: &Series| {
            let request = FrameRequest::new(1, camera, joint.clone(), (8, 8));
            let attributes = FrameAttributes::default();
            fingerprints.of(&plan.frames[0], &request, &attributes, series, &Cancel::new()).unwrap()
        };
        let (flat, rows) = (table(&[0.0], 0.5), table(&[0.0, 1.0], 0.5));
        assert_eq!(of(&flat, &one), of(&flat, &other), "nothing is looked at beside the scalars");
        assert_ne!(of(&rows, &one), of(&rows, &other));
        assert_eq!(of(&rows, &one), of(&table(&[0.0, 1.0], 0.5), &one));
        assert_ne!(of(&rows, &one), of(&table(&[0.0, 1.0], 0.25), &one));
        assert_ne!(of(&rows, &one), of(&table(&[0.0, 2.0], 0.5), &one));
    }

    #[test]
    fn the_scalars_of_every_step_that_is_shown_count_and_no_others() {
        let (_dir, series) = series(1);
        let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
        let table = Arc::new(NodeTable::new(vec![Node { scalar: 0.0, rgb: [0.5; 3], tau: 1.0 }]).unwrap());
        let plan = Plan { steps: vec![0, 1, 2], ..Plan::of_steps(&[], series.times()) };
        // Fingerprint of a frame at `time`, with these checksums of the steps.
        let of = |time: FrameTime, checksums: [u32; 3]| {
            let fingerprints = Fingerprints::new(series.mesh(), &plan, &checksums, "png");
            let frame = PlannedFrame { time, at: 0.0, azimuth_deg: 0.0, held: None, shutter: 0.0 };
            let request = FrameRequest::new(time, camera, table.clone(), (8, 8));
            fingerprints.of(&frame, &request, &FrameAttributes::default(), &series, &Cancel::new()).unwrap()
        };
        for (time, shown) in [
            (FrameTime::from(1), [false, true, false]),
            (FrameTime::between(0, 1, 0.25), [true, true, false]),
            (FrameTime::between(0, 2, 0.25), [true, false, true]),
        ] {
            let before = of(time, [7, 8, 9]);
            assert_eq!(of(time, [7, 8, 9]), before);
            for step in 0..3 {
                let mut checksums = [7, 8, 9];
                checksums[step] = 10;
                assert_eq!(of(time, checksums) != before, shown[step], "{time:?}, step {step}");
            }
        }
        assert_ne!(of(FrameTime::between(0, 1, 0.25), [7, 8, 9]), of(FrameTime::between(0, 1, 0.5), [7, 8, 9]));
    }
}
