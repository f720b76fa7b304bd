//! What a frame cost and what it did not have to do.

use serde::{Deserialize, Serialize};

/// Counts and times of one frame, stage by stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameStats {
    /// Bytes read from the store.
    pub bytes_read: u64,
    /// Scalars decoded.
    pub vertices_decoded: u64,
    /// Cells that can be seen with this transfer function at this step.
    pub cells_active: u64,
    /// Cells of the mesh.
    pub cells_total: u64,
    /// Cells that could be seen without clips, which cut all of them away.
    pub cells_clipped: u64,
    /// Cells that were looked at to find out whether they can be seen; of the others that was known.
    pub cells_classified: u64,
    /// Chunks of vertices that were not decoded, since none of their cells can be seen.
    pub chunks_skipped: u64,
    /// Times that the scalars of a step were still in memory.
    pub decodes_skipped: u64,
    /// Clusters of cells that lie outside of the view and were not looked at.
    pub clusters_outside: u64,
    /// Vertices that were not brought into view coordinates.
    pub vertices_not_transformed: u64,
    /// Times that the faces through which rays may enter were those of the frame before.
    pub entry_lists_kept: u64,
    /// Faces through which rays may enter that are those of the frame before and were not looked for.
    pub entry_faces_kept: u64,
    /// Faces that were not looked at in a tile, since all pixels in their boxes are opaque in front of them (faces drawn).
    pub faces_hidden: u64,
    /// Faces that are drawn, by renderers that draw faces: those of the level of detail.
    pub faces_drawn: u64,
    /// Faces of the mesh, where faces are drawn.
    pub faces_total: u64,
    /// Times that faces were sorted by depth for the frame.
    pub face_sorts: u64,
    /// Times that faces were needed in depth order and nothing had to be sorted for it.
    pub face_sorts_skipped: u64,
    /// Entries of a pre-integrated table that were computed before the frame, since the transfer function has changed there; those
    /// of a renderer that makes a table of its own are not counted.
    pub table_entries_built: u64,
    /// Places found where a ray passes through a face that is drawn.
    pub fragments: u64,
    /// Pixels that were resolved again from all of their fragments, since the buffer had not put them in order.
    pub pixels_resolved_again: u64,
    /// Faces through which rays may enter the active cells.
    pub entry_faces: u64,
    /// Entries found: (pixel, face) pairs.
    pub entries: u64,
    /// Cells stepped through by all rays, without those behind what is opaque that rays walked side by side have come to.
    pub steps: u64,
    /// Segments between two transfer-function nodes that were integrated.
    pub segments: u64,
    /// Rays that met at least one active cell.
    pub rays_hit: u64,
    /// Rays stopped early because nothing behind could be seen.
    pub rays_stopped_early: u64,
    /// Path pieces skipped because they lay before what was already composited (overlapping cells); fragments dropped
    /// because they did (faces drawn).
    pub out_of_order: u64,
    /// Paths given up because the signs of edge functions contradicted each other: 0 where arithmetic is as assumed.
    pub broken_paths: u64,
    /// Rays that a ray caster has cast: at strides 8, 4, 2 and 1 where contrast decides which, at the last otherwise, as many as the image has
    /// pixels. None where it was known without that nothing is to be seen.
    pub rays_by_level: [u64; 4],
    /// Blocks between rays that were split since their corners differ, since the border of the domain goes through them, since a face of
    /// it reaches into them, since one beside them is, and since a layer beside the cells begins or ends in them.
    pub blocks_split: [u64; 5],
    /// Blocks between rays whose pixels were filled.
    pub blocks_filled: u64,
    /// Layers of depth of the domain's boundary that were drawn to enlarge the image, in all of its sizes together; none for an image of no
    /// cells.
    pub depth_layers: u64,
    /// Whether the GPU brought the image to the size of its frame.
    pub upsampled_on_gpu: bool,
    /// Pixels of the enlarged image that none of the four samples around them is alike, so that all of them counted (`joint2x2`).
    pub upsample_fallbacks: u64,
    /// Pixels whose rays were all cast, for details of later frames.
    pub pixels_anew: u64,
    /// Root mean square by which these were off before, with details of an earlier frame and without any; `None` where there were none.
    pub residual_rmse: Option<[f64; 2]>,
    /// Whether the reference evaluated the transfer function by its formula; by its table otherwise.
    pub by_formula: bool,
    /// Whether the GPU rendered it.
    pub on_gpu: bool,
    /// Whether the GPU computed places in f64, as thin cells need it; in f32 otherwise.
    pub in_f64: bool,
    /// Times that the frame was begun again because the device was lost or failed.
    pub gpu_restarts: u64,
    /// Times that a frame was begun again because its lists of entries or of large faces were longer than the room for them, and that
    /// layers of depth were, because their list of large faces was (GPU).
    pub entry_retries: u64,
    /// Bytes sent to the GPU.
    pub bytes_uploaded: u64,
    /// Scalars decoded on the GPU.
    pub vertices_decoded_on_gpu: u64,
    /// Milliseconds of the GPU for decoding; `None` if it did not, or has no timestamps.
    pub ms_gpu_decode: Option<f64>,
    /// Milliseconds of the GPU for the view transform; `None` without a GPU or without timestamps.
    pub ms_gpu_transform: Option<f64>,
    /// Milliseconds of the GPU for the entries.
    pub ms_gpu_entries: Option<f64>,
    /// Milliseconds of the GPU for the walk.
    pub ms_gpu_walk: Option<f64>,
    /// Milliseconds spent decoding.
    pub ms_decode: f64,
    /// Milliseconds spent on active cells, faces in order, and tables.
    pub ms_order: f64,
    /// Milliseconds in which the CPU placed cells or faces in the view: view transform, entries, and what each tile looks at.
    pub ms_place: f64,
    /// Milliseconds until the renderer had begun: room for pixels, and what is sent to the GPU.
    pub ms_begin: f64,
    /// Milliseconds spent walking and compositing.
    pub ms_render: f64,
    /// Milliseconds for what is found on the image of surfaces: a pass for normals and numbers, and light from them. Not among those of
    /// rendering.
    pub ms_guides: f64,
    /// Milliseconds for layers of depth of the domain's boundary. Not among those of rendering.
    pub ms_depth_layers: f64,
    /// Milliseconds in which a small image came to full size, without those for layers of depth. Not among those of rendering.
    pub ms_upsample: f64,
    /// Milliseconds in which few rays were given details, and some pixels made anew. Not among those of rendering.
    pub ms_residual: f64,
    /// Milliseconds that threads had nothing to do while others rendered, all of them together.
    pub ms_idle: f64,
    /// Milliseconds from job to frame.
    pub ms_frame: f64,
}

impl FrameStats {
    /// Milliseconds that all stages took.
    pub fn ms_worked(&self) -> f64 {
        let on_image = self.ms_depth_layers + self.ms_upsample + self.ms_residual;
        self.ms_decode + self.ms_order + self.ms_place + self.ms_begin + self.ms_render + on_image
    }

    /// Adds the counts of a part of the frame (a tile). Times are those of the whole frame and stay.
    pub fn add_counts(&mut self, part: &FrameStats) {
        self.entries += part.entries;
        self.steps += part.steps;
        self.fragments += part.fragments;
        self.pixels_resolved_again += part.pixels_resolved_again;
        self.segments += part.segments;
        self.rays_hit += part.rays_hit;
        self.rays_stopped_early += part.rays_stopped_early;
        self.out_of_order += part.out_of_order;
        self.broken_paths += part.broken_paths;
        self.faces_hidden += part.faces_hidden;
        self.entry_faces += part.entry_faces;
        self.entry_lists_kept += part.entry_lists_kept;
        self.entry_faces_kept += part.entry_faces_kept;
        self.clusters_outside += part.clusters_outside;
        self.vertices_not_transformed += part.vertices_not_transformed;
    }
}
