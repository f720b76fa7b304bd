//! Fields of cells are drawn alike with and without skipping of chunks.

use crate::cubes::cubes;
use crate::render::difference;
use crate::series::table_for;
use crate::skipping::{bits, with};
use glam::DVec3;
use std::sync::Arc;
use tetreel::camera::Camera;
use tetreel::codec::vq::VqOptions;
use tetreel::field::Association;
use tetreel::ingest::{CodecChoice, IngestOptions, ingest};
use tetreel::node_table::{JointTable, NodeTable};
use tetreel::pipeline::{FrameRequest, FrameTime, Pipeline, TetDraw};
use tetreel::store::Store;
use tetreel::task::{Cancel, Silent};
use tetreel::visibility::Skip;

/// Cubes along each axis.
const SIZE: [u32; 3] = [32, 16, 16];

/// A store of cubes whose cells have values that fall from a middle that moves along x.
fn stored(are_whole: bool, codec: CodecChoice) -> (tempfile::TempDir, Store) {
    let source = cubes(SIZE, are_whole, 4, &[("q", Association::Cell)], |_, step, at| {
        (-0.02 * (at - DVec3::new(6.0 + 4.0 * step as f64, 8.0, 8.0)).length_squared()).exp() as f32
    });
    let out = tempfile::tempdir().unwrap();
    let path = out.path().join("q.zarr");
    ingest(&source, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
    (out, Store::open(path).unwrap())
}

fn vq() -> CodecChoice {
    CodecChoice::new(VqOptions { entries: 64, ..VqOptions::default() })
}

#[test]
fn chunks_of_cells_that_nobody_sees_are_not_decoded_and_the_frames_stay_as_they_are() {
    for (are_whole, is_vq) in [(false, true), (true, true), (true, false)] {
        let (_out, store) = stored(are_whole, if is_vq { vq() } else { CodecChoice::default() });
        let count = u64::from(SIZE.iter().product::<u32>()) * if are_whole { 1 } else { 6 };
        let open = || Pipeline::open(&store, None).unwrap();
        let (mut some, mut all) = (open(), open());
        let off = Skip { transparent_chunks: false, ..Skip::ALL };
        let camera = Camera::default_for(some.mesh().positions.world_bounds()).unwrap();
        let table = table_for(&some, "inferno@0:0,0.55:0,0.6:0.5,1:0.9");
        let times = [FrameTime::from(0), 1.into(), 2.into(), 3.into(), FrameTime::between(1, 2, 0.4)];
        let (mut skipped, mut partly, mut seen) = (0, 0, 0.0f32);
        // Ranges are known from the second round on.
        for time in times.into_iter().cycle().take(3 * times.len()) {
            for draw in [TetDraw::Raycast, TetDraw::ALL_FACES] {
                let request = FrameRequest::new(time, camera, table.clone(), (64, 50));
                let on = some.render(&with(&request, draw, Skip::ALL)).unwrap().clone();
                let off = all.render(&with(&request, draw, off)).unwrap().clone();
                let name = format!("{are_whole}, {time:?}, {draw:?}");
                let (rmse, _) = difference(&on.planes.color, &off.planes.color);
                // Faces are summed in another order.
                assert!(bits(&on) == bits(&off) || draw != TetDraw::Raycast && rmse <= 1e-6, "{name}: {rmse:.2e}");
                assert_eq!((on.stats.cells_active, off.stats.chunks_skipped), (off.stats.cells_active, 0), "{name}");
                assert!(on.stats.cells_active < on.stats.cells_total / 2, "{name}");
                seen = on.planes.color.pixels.iter().fold(seen, |most, p| most.max(p[3]));
                skipped += on.stats.chunks_skipped;
                partly += u64::from((1..count).contains(&on.stats.vertices_decoded));
            }
        }
        assert!(skipped > 0 && (partly > 0) == is_vq && seen > 0.5, "{are_whole}: {skipped}, {partly}, {seen}");
        // What was left out is decoded for a transfer function that shows it.
        let request = FrameRequest::new(2, camera, table_for(&some, "inferno@0:0.5,1:0.5"), (64, 50));
        let [on, off] = [(&mut some, Skip::ALL), (&mut all, Skip::NONE)]
            .map(|(pipeline, skip)| bits(pipeline.render(&with(&request, TetDraw::Raycast, skip)).unwrap()));
        assert!(on == off);
    }
}

#[test]
fn gradients_of_cells_have_the_cells_around_also_where_these_are_transparent() {
    let (_out, store) = stored(false, vq());
    let mut pipeline = Pipeline::open(&store, None).unwrap();
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    // Scalars from 0.5 on are seen, the more the steeper.
    let values = [0.0f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.9].map(|tau| [0.8, 0.5, 0.2, tau]).to_vec();
    let joint = JointTable::new(vec![0.0, 0.5, 0.51, 1.0], vec![0.0], vec![0.0, 0.2], values).unwrap();
    for step in [0, 1, 2, 3, 0, 1, 2] {
        let request = FrameRequest::new(step, camera, Arc::new(NodeTable::transparent()), (64, 50));
        let request = request.with_tets(|tets| tets.table = Arc::new(joint.clone()).into());
        let [on, off] =
            [Skip::ALL, Skip::NONE].map(|skip| bits(pipeline.render(&with(&request, TetDraw::Raycast, skip)).unwrap()));
        assert!(on == off && on.0.iter().any(|p| f32::from_bits(p[3]) > 0.1), "{step}");
    }
}
