//! Cost of a frame, and work that was saved.

use serde::{Deserialize, Serialize};

/// Counts and times of one frame, stage by stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameStats {
    /// Bytes read from the store.
    pub bytes_read: u64,
    /// Scalars decoded.
    pub vertices_decoded: u64,
    /// Cells that may be visible with this transfer function at this step.
    pub cells_active: u64,
    /// Cells of the mesh.
    pub cells_total: u64,
    /// Cells that would be active but lie completely outside of the clips.
    pub cells_clipped: u64,
    /// Cells whose visibility was tested; that of the others was known.
    pub cells_classified: u64,
    /// Chunks of vertices that were not decoded, since none of their cells is visible.
    pub chunks_skipped: u64,
    /// Steps whose scalars were still in memory.
    pub decodes_skipped: u64,
    /// Clusters of cells outside of the view, which were skipped.
    pub clusters_outside: u64,
    /// Vertices that were not transformed to view coordinates.
    pub vertices_not_transformed: u64,
    /// Times that the list of entry faces was that of the frame before.
    pub entry_lists_kept: u64,
    /// Entry faces in lists kept from the frame before.
    pub entry_faces_kept: u64,
    /// Faces skipped in a tile, since all pixels in their boxes are opaque in front of them (faces drawn).
    pub faces_hidden: u64,
    /// Faces that are drawn, by renderers that draw faces: those of the level of detail.
    pub faces_drawn: u64,
    /// Faces of the mesh, where faces are drawn.
    pub faces_total: u64,
    /// Cells that are drawn as points: those of the level of detail.
    pub points_drawn: u64,
    /// Active cells, where cells are drawn as points.
    pub points_total: u64,
    /// Points that no pixel's ray can meet in front of the eye.
    pub points_culled: u64,
    /// Points that were widened to half a pixel.
    pub points_enlarged: u64,
    /// Splats of flow in view.
    pub flow_splats: u64,
    /// Splats of them whose pattern moves by more than a quarter of its period while the shutter is open, which blurs it.
    pub flow_fast: u64,
    /// Whether nothing flows: all vectors are 0, or not finite.
    pub flow_still: bool,
    /// Pixels that splats cover, each counted once a splat; where the GPU draws splats, as far as rays are not opaque.
    pub flow_fragments: u64,
    /// Pixels that splats would cover where they are outside of the cells that are shown, as far as `flow_fragments` are counted.
    pub flow_outside: u64,
    /// Milliseconds for the splats of flow and their fragments, a part of `ms_order`.
    pub ms_flow: f64,
    /// Functions that a pixel's ray may meet in front of the eye.
    pub functions_drawn: u64,
    /// Functions smaller than a pixel that were widened to one.
    pub functions_widened: u64,
    /// Functions of the field, where one of functions is drawn.
    pub functions_total: u64,
    /// Functions projected to a tile: those of slabs that show something.
    pub functions_projected: u64,
    /// Slabs of tiles whose functions were summed.
    pub function_slabs: u64,
    /// Slabs of tiles that were skipped, since nothing of their functions' values is visible.
    pub function_slabs_clear: u64,
    /// Slabs of tiles in which sheets are not as close as the error asked for: there would be too many.
    pub function_slabs_limited: u64,
    /// Sheets of tiles on which functions were summed.
    pub sheets: u64,
    /// Intervals between two sheets inside the mesh which no function reaches: nothing is drawn there.
    pub function_gaps: u64,
    /// Times that faces, or cells as points, were sorted by depth for the frame.
    pub face_sorts: u64,
    /// Times that faces were needed in depth order without being sorted.
    pub face_sorts_skipped: u64,
    /// Entries of a pre-integrated table that were computed before the frame, since the transfer function has changed there; tables that a
    /// renderer makes itself are not counted.
    pub table_entries_built: u64,
    /// Fragments: intersections of rays with drawn faces, or with points.
    pub fragments: u64,
    /// Pixels that were resolved again from all of their fragments, which did not lead from cell to cell in their order.
    pub pixels_resolved_again: u64,
    /// Faces through which rays may enter the active cells.
    pub entry_faces: u64,
    /// Entries found: (pixel, face) pairs.
    pub entries: u64,
    /// Cells traversed by all rays, without cells behind opaque ones that rays walked side by side traverse.
    pub steps: u64,
    /// Segments between two transfer-function nodes that were integrated.
    pub segments: u64,
    /// Rays that met at least one active cell.
    pub rays_hit: u64,
    /// Rays stopped early because nothing behind would be visible.
    pub rays_stopped_early: u64,
    /// Path pieces skipped because they lay before what was already composited (overlapping cells); with faces drawn, fragments dropped for
    /// that reason.
    pub out_of_order: u64,
    /// Paths abandoned because the signs of edge functions contradicted each other: 0 where arithmetic is as assumed.
    pub broken_paths: u64,
    /// Rays cast by a ray caster: at strides 8, 4, 2 and 1 where contrast decides which, otherwise all at the last, one for each pixel of
    /// the image. None if the image is known to be empty.
    pub rays_by_level: [u64; 4],
    /// Blocks between rays that were split because: their corners differ; the border of the domain crosses them; a face of it reaches into
    /// them; a neighbour was split; a request layer beside the cells begins or ends in them.
    pub blocks_split: [u64; 5],
    /// Blocks between rays whose pixels were filled.
    pub blocks_filled: u64,
    /// Depth layers of the domain's boundary that were drawn to enlarge the image, over all of its sizes; none for an image without cells.
    pub depth_layers: u64,
    /// Whether the GPU enlarged the image to the size of its frame.
    pub upsampled_on_gpu: bool,
    /// Pixels of the enlarged image to which none of the four samples around is similar, so that all of them counted (`joint2x2`).
    pub upsample_fallbacks: u64,
    /// Pixels whose rays were all cast, for details of later frames.
    pub pixels_anew: u64,
    /// RMS error that these pixels had before, with details of an earlier frame and without any; `None` where there were none.
    pub residual_rmse: Option<[f64; 2]>,
    /// Whether the reference evaluated the transfer function by its formula; otherwise by its table.
    pub by_formula: bool,
    /// Whether the GPU rendered the frame.
    pub on_gpu: bool,
    /// Whether the GPU computed positions in f64, as thin cells need; otherwise in f32.
    pub in_f64: bool,
    /// Times that the frame was restarted because the device was lost or failed.
    pub gpu_restarts: u64,
    /// Times that a frame was restarted because its lists of entries or of large faces exceeded their buffers, and that depth layers were,
    /// because their list of large faces did (GPU).
    pub entry_retries: u64,
    /// Bytes sent to the GPU.
    pub bytes_uploaded: u64,
    /// Scalars decoded on the GPU, of both steps between two.
    pub vertices_decoded_on_gpu: u64,
    /// GPU milliseconds for decoding; `None` if it did not decode, or has no timestamps.
    pub ms_gpu_decode: Option<f64>,
    /// GPU milliseconds for the view transform; `None` without a GPU or without timestamps.
    pub ms_gpu_transform: Option<f64>,
    /// GPU milliseconds for the entries.
    pub ms_gpu_entries: Option<f64>,
    /// GPU milliseconds for the walk.
    pub ms_gpu_walk: Option<f64>,
    /// Milliseconds spent decoding.
    pub ms_decode: f64,
    /// Milliseconds for active cells, face order, and tables.
    pub ms_order: f64,
    /// Milliseconds in which the CPU placed cells or faces in the view: view transform, entries, and lists for each tile.
    pub ms_place: f64,
    /// Milliseconds for setup of the renderer: pixel buffers, and uploads to the GPU.
    pub ms_begin: f64,
    /// Milliseconds spent walking and compositing.
    pub ms_render: f64,
    /// Milliseconds for surface guides: a pass for normals and surface numbers, and shading with them. Not part of `ms_render`.
    pub ms_guides: f64,
    /// Milliseconds for depth layers of the domain's boundary. Not part of `ms_render`.
    pub ms_depth_layers: f64,
    /// Milliseconds for enlarging a small image, without depth layers. Not part of `ms_render`.
    pub ms_upsample: f64,
    /// Milliseconds in which sparse rays were given details, and some pixels cast anew. Not part of `ms_render`.
    pub ms_residual: f64,
    /// Idle milliseconds of threads while others rendered, summed over threads.
    pub ms_idle: f64,
    /// Milliseconds from request to frame.
    pub ms_frame: f64,
}

impl FrameStats {
    /// Sum of the milliseconds of all stages, without `ms_guides`.
    pub fn ms_worked(&self) -> f64 {
        let on_image = self.ms_depth_layers + self.ms_upsample + self.ms_residual;
        self.ms_decode + self.ms_order + self.ms_place + self.ms_begin + self.ms_render + on_image
    }

    /// Adds the counts of a part of the frame (a tile). Times are those of the whole frame and are not added.
    pub fn add_counts(&mut self, part: &FrameStats) {
        self.entries += part.entries;
        self.steps += part.steps;
        self.fragments += part.fragments;
        self.pixels_resolved_again += part.pixels_resolved_again;
        self.segments += part.segments;
        self.functions_projected += part.functions_projected;
        self.function_slabs += part.function_slabs;
        self.function_slabs_clear += part.function_slabs_clear;
        self.function_slabs_limited += part.function_slabs_limited;
        self.sheets += part.sheets;
        self.function_gaps += part.function_gaps;
        self.rays_hit += part.rays_hit;
        self.rays_stopped_early += part.rays_stopped_early;
        self.out_of_order += part.out_of_order;
        self.broken_paths += part.broken_paths;
        self.flow_fragments += part.flow_fragments;
        self.flow_outside += part.flow_outside;
        self.faces_hidden += part.faces_hidden;
        self.entry_faces += part.entry_faces;
        self.entry_lists_kept += part.entry_lists_kept;
        self.entry_faces_kept += part.entry_faces_kept;
        self.clusters_outside += part.clusters_outside;
        self.vertices_not_transformed += part.vertices_not_transformed;
    }
}
