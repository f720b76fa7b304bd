//! The stages: their bindings, and their shaders, composed from parts. No other module knows the parts of a stage.

use super::layout::{FRAGMENT_BYTES, JOINT_FRAGMENT_BYTES};
use super::resources::{Binding, Resource, declarations};
use super::shader_parts as lib;
use crate::optics::OpticsKind;
use crate::render::RenderJob;
use std::fmt;

/// Number type of the rays' planar geometry and of depths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// f32, and sums of two: within WebGPU's defaults.
    #[default]
    Single,
    /// f64, an optional feature of devices.
    Double,
}

/// What a pass over the faces does with the fragments that it finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// Counts them per pixel.
    Count,
    /// Stores them.
    Store(FragmentKind, Inside),
    /// Keeps the nearest depths of each pixel, for faces of the boundary.
    Layers,
}

/// Destination of a bilinearly enlarged image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Toward {
    /// The frame.
    Image,
    /// The input of the joint filter.
    Filter,
}

/// Contents of a fragment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FragmentKind {
    /// Depth, scalar, cells.
    Plain,
    /// As `Plain`, and the value at vertices, for a joint table.
    Joint,
}

impl FragmentKind {
    /// The kind of a job's fragments.
    pub fn of(job: &RenderJob) -> Self {
        if job.joint.is_some() { Self::Joint } else { Self::Plain }
    }

    /// Bytes of a fragment.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Plain => FRAGMENT_BYTES,
            Self::Joint => JOINT_FRAGMENT_BYTES,
        }
    }
}

/// What rays meet inside cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inside {
    /// The volume alone.
    Volume,
    /// The volume and isosurfaces.
    Surfaces,
}

impl Inside {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Volume, Self::Surfaces];

    /// What rays of a job meet.
    pub fn of(job: &RenderJob) -> Self {
        if job.surfaces.is_some() { Self::Surfaces } else { Self::Volume }
    }

    /// Bindings beyond those of [`Gathering`]: of the walk, and of the face renderer.
    fn bindings(self) -> [&'static [Binding]; 2] {
        const SURFACES: Binding = Binding::Read(Resource::Surfaces);
        match self {
            Self::Volume => [&[], &[]],
            Self::Surfaces => {
                [&[SURFACES], &[SURFACES, Binding::Read(Resource::Vertices), Binding::Read(Resource::Corners)]]
            }
        }
    }
}

/// How segments are integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gathering {
    /// With a transfer function of the scalar, by these optics.
    Scalar(OpticsKind),
    /// With a joint table, by the exact integrator.
    Joint,
}

impl Gathering {
    /// All ways of integration.
    pub const ALL: [Self; 4] = [
        Self::Scalar(OpticsKind::Exact),
        Self::Scalar(OpticsKind::Table3d),
        Self::Scalar(OpticsKind::Partial),
        Self::Joint,
    ];

    /// How segments of a job are integrated.
    pub fn of(job: &RenderJob) -> Self {
        if job.joint.is_some() { Self::Joint } else { Self::Scalar(job.optics) }
    }

    /// Bindings of the transfer function.
    fn tables(self) -> &'static [Binding] {
        const TABLE: Binding = Binding::Read(Resource::Table);
        match self {
            Self::Scalar(OpticsKind::Exact | OpticsKind::Partial) => &[TABLE],
            Self::Scalar(OpticsKind::Table3d) => &[TABLE, Binding::Read(Resource::Table3dParams)],
            Self::Joint => &[TABLE, Binding::Read(Resource::JointParams)],
        }
    }

    /// Kind of the fragments that are integrated so.
    fn fragments(self) -> FragmentKind {
        match self {
            Self::Scalar(_) => FragmentKind::Plain,
            Self::Joint => FragmentKind::Joint,
        }
    }
}

/// A stage of a renderer: one entry point in one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Decodes a step from its compressed block.
    DecodeVq,
    /// Transforms vertices to view coordinates.
    ViewTransform,
    /// Counts the items that meet each tile.
    EntriesCount,
    /// Sums the tiles' counts to places.
    EntriesScan,
    /// Stores the items of each tile.
    EntriesStore,
    /// Walks all rays from their entries through the cells.
    Walk(Gathering, Inside, Precision),
    /// Walks the rays of a list.
    WalkRays(Gathering, Inside, Precision),
    /// Begins the next step of adaptive sampling once the rays of the last one are cast.
    SplitPlan,
    /// Decides which blocks between rays are split by their own corners.
    SplitDecide,
    /// Splits neighbouring blocks, and appends the rays in split blocks to the list.
    SplitAppend,
    /// Sets the workgroups of the next walk.
    SplitSlice,
    /// Fills the pixels between rays.
    Fill,
    /// Copies an image to the texture that a window samples.
    Present,
    /// Tests faces against the pixels of their boxes.
    Faces(Pass, Precision),
    /// Tests large faces, tile by tile.
    FacePieces(Pass, Precision),
    /// Finds the rays that begin in a cell.
    FaceStarts(Pass, Precision),
    /// Sums fragments per pixel to places.
    FaceScan,
    /// Runs one round of sorting the fragments of deep pixels.
    FaceSort(FragmentKind),
    /// Orders and composites the fragments of each pixel.
    FaceResolve(Gathering, Inside, Precision),
    /// Chooses the next pieces of the boundary's large faces.
    LayersPlan,
    /// Computes the range of all depths.
    LayersRange,
    /// Maps depth layers to the reference that filters compare.
    LayersReference,
    /// Enlarges an image by nearest samples.
    UpsampleNearest,
    /// Enlarges an image bilinearly.
    UpsampleBilinear(Toward),
    /// Applies the joint bilateral filter to the bilinear image.
    UpsampleJoint,
    /// Enlarges an image from those of four samples whose depths are alike.
    UpsampleJoint2x2,
}

/// All stages.
pub fn stages() -> impl Iterator<Item = Stage> {
    let alike = [
        Stage::DecodeVq,
        Stage::ViewTransform,
        Stage::EntriesCount,
        Stage::EntriesScan,
        Stage::EntriesStore,
        Stage::Present,
        Stage::FaceScan,
        Stage::FaceSort(FragmentKind::Plain),
        Stage::FaceSort(FragmentKind::Joint),
        Stage::SplitPlan,
        Stage::SplitDecide,
        Stage::SplitAppend,
        Stage::SplitSlice,
        Stage::Fill,
        Stage::Faces(Pass::Layers, Precision::Single),
        Stage::FacePieces(Pass::Layers, Precision::Single),
        Stage::LayersPlan,
        Stage::LayersRange,
        Stage::LayersReference,
        Stage::UpsampleNearest,
        Stage::UpsampleBilinear(Toward::Image),
        Stage::UpsampleBilinear(Toward::Filter),
        Stage::UpsampleJoint,
        Stage::UpsampleJoint2x2,
    ];
    let with = |precision: Precision| {
        let kinds = [FragmentKind::Plain, FragmentKind::Joint];
        let stores = kinds.into_iter().flat_map(|kind| Inside::ALL.map(|inside| Pass::Store(kind, inside)));
        let finding = [Pass::Count].into_iter().chain(stores).flat_map(move |pass| {
            [Stage::Faces(pass, precision), Stage::FacePieces(pass, precision), Stage::FaceStarts(pass, precision)]
        });
        let gathering = Gathering::ALL.into_iter().flat_map(|how| Inside::ALL.map(|inside| (how, inside)));
        finding.chain(gathering.flat_map(move |(how, inside)| {
            [
                Stage::Walk(how, inside, precision),
                Stage::WalkRays(how, inside, precision),
                Stage::FaceResolve(how, inside, precision),
            ]
        }))
    };
    alike.into_iter().chain([Precision::Single, Precision::Double].into_iter().flat_map(with))
}

/// How the records of cells are split over bindings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordSplit {
    /// Number of bindings in use, 1 to [`RECORD_PARTS_MAX`].
    pub parts: u32,
    /// Base-2 logarithm of the cells per binding.
    pub shift: u32,
}

/// Largest number of bindings for the records of cells.
pub const RECORD_PARTS_MAX: u32 = 3;

/// Bytes of a cell's record: four vertices, four neighbours.
pub const RECORD_BYTES: u64 = 32;

impl RecordSplit {
    /// How `cells` records are split if a binding holds at most `binding_bytes`; `None` if they do not fit.
    pub fn new(cells: usize, binding_bytes: u64) -> Option<Self> {
        let shift = (binding_bytes / RECORD_BYTES).checked_ilog2()?.min(30);
        let parts = u32::try_from(cells.div_ceil(1 << shift)).ok()?.max(1);
        (parts <= RECORD_PARTS_MAX).then_some(Self { parts, shift })
    }

    /// The cells of part `part` of a mesh of `cells` cells.
    pub fn cells_of(self, part: u32, cells: usize) -> std::ops::Range<usize> {
        let at = |part: u32| ((part as usize) << self.shift).min(cells);
        at(part)..at(part + 1)
    }
}

impl Stage {
    /// Name of its entry point and of its file.
    pub fn name(self) -> &'static str {
        match self {
            Self::DecodeVq => "decode_vq",
            Self::ViewTransform => "view_transform",
            Self::EntriesCount => "entries_count",
            Self::EntriesScan => "entries_scan",
            Self::EntriesStore => "entries_store",
            Self::Walk(..) => "walk",
            Self::WalkRays(..) => "walk_rays",
            Self::SplitPlan => "split_plan",
            Self::SplitDecide => "split_decide",
            Self::SplitAppend => "split_append",
            Self::SplitSlice => "split_slice",
            Self::Fill => "fill",
            Self::Present => "present",
            Self::Faces(..) => "faces",
            Self::FacePieces(..) => "face_pieces",
            Self::FaceStarts(..) => "face_starts",
            Self::FaceScan => "face_scan",
            Self::FaceSort(_) => "face_sort",
            Self::FaceResolve(..) => "face_resolve",
            Self::LayersPlan => "layers_plan",
            Self::LayersRange => "layers_range",
            Self::LayersReference => "layers_reference",
            Self::UpsampleNearest => "upsample_nearest",
            Self::UpsampleBilinear(_) => "upsample_bilinear",
            Self::UpsampleJoint => "upsample_joint",
            Self::UpsampleJoint2x2 => "upsample_joint2x2",
        }
    }

    /// Precision of its geometry.
    pub fn precision(self) -> Precision {
        match self {
            Self::Walk(_, _, precision)
            | Self::WalkRays(_, _, precision)
            | Self::FaceResolve(_, _, precision)
            | Self::Faces(_, precision)
            | Self::FacePieces(_, precision)
            | Self::FaceStarts(_, precision) => precision,
            _ => Precision::Single,
        }
    }

    /// Its bindings, in the order of their numbers.
    pub fn bindings(self) -> Vec<Binding> {
        use Binding::{Atomic, Read, Write};
        use Resource::*;
        let params = [Read(Params), Read(FaceParams)];
        let planes = [Write(Counters), Write(ColorPlane), Write(DepthPlane)];
        let upsampling = [Read(Params), Read(UpsampleParams)];
        let small = [Read(SmallColor), Read(SmallDepth)];
        let records = Resource::RECORDS.map(Read);
        let fragments = Resource::FRAGMENTS.map(Write);
        match self {
            Self::DecodeVq => vec![Read(VqStep), Read(Block), Write(Scalars)],
            Self::ViewTransform => vec![Read(Params), Read(Positions), Read(Scalars), Write(Vertices)],
            Self::EntriesCount | Self::EntriesStore => {
                [&[Read(Params), Read(Vertices), Read(Items), Atomic(Bins)][..], &records].concat()
            }
            Self::EntriesScan => vec![Read(Params), Write(Bins)],
            Self::Walk(how, inside, _) => {
                let read = [Read(Params), Read(Vertices), Read(ActiveCells), Read(Bins)];
                let [surfaces, _] = inside.bindings();
                [&read[..], &records, &planes, how.tables(), surfaces].concat()
            }
            Self::WalkRays(how, inside, _) => {
                let read = [Read(Params), Read(RayParams), Read(Vertices), Read(ActiveCells), Read(Bins)];
                let written = [Atomic(Rays), Write(SeenColorPlane), Write(SeenDepthPlane)];
                let [surfaces, _] = inside.bindings();
                [&read[..], &records, &written, how.tables(), surfaces].concat()
            }
            Self::SplitPlan => vec![Read(Params), Read(Bins), Atomic(Rays), Write(Args)],
            Self::SplitDecide => {
                let read = [Read(Params), Read(RayParams), Read(Vertices), Read(ActiveCells), Read(Bins)];
                [&read[..], &records, &[Atomic(Rays), Read(SeenColor)]].concat()
            }
            Self::SplitAppend => vec![Read(Params), Read(RayParams), Atomic(Rays)],
            Self::SplitSlice => vec![Atomic(Rays), Write(Args)],
            Self::Fill => {
                let read = [Read(Params), Read(RayParams), Read(Rays), Read(SeenColor), Read(SeenDepth)];
                [&read[..], &[Write(ColorPlane), Write(DepthPlane)]].concat()
            }
            Self::Present => vec![Read(Color), Write(Screen)],
            Self::Faces(pass, _) | Self::FacePieces(pass, _) | Self::FaceStarts(pass, _) => {
                let faces = Resource::FACES.map(Read);
                let kept = match pass {
                    Pass::Count => faces.to_vec(),
                    Pass::Store(..) => [&faces[..], &fragments].concat(),
                    Pass::Layers => vec![Atomic(Depths)],
                };
                let found = [Atomic(Lists), Read(Vertices), Read(Drawn)];
                [&params[..], &found, &kept].concat()
            }
            Self::LayersPlan => [&params[..], &[Write(Lists), Write(Args)]].concat(),
            Self::LayersRange => [&params[..], &[Read(Depths), Write(DepthRange)]].concat(),
            Self::LayersReference => [&params[..], &[Read(Depths), Read(DepthRange), Write(ReferencePlane)]].concat(),
            Self::UpsampleNearest => [&upsampling[..], &small, &planes[1..]].concat(),
            Self::UpsampleBilinear(toward) => {
                let color = match toward {
                    Toward::Image => ColorPlane,
                    Toward::Filter => EnlargedPlane,
                };
                [&upsampling[..], &small, &[Write(color), Write(DepthPlane)]].concat()
            }
            Self::UpsampleJoint => [&upsampling[..], &[Read(Reference), Read(Enlarged), Write(ColorPlane)]].concat(),
            Self::UpsampleJoint2x2 => {
                [&upsampling[..], &small, &[Read(Reference), Read(SmallReference)], &planes].concat()
            }
            Self::FaceScan => vec![Read(Params), Write(Lists)],
            Self::FaceSort(_) => [&params[..], &[Read(Lists)], &fragments].concat(),
            Self::FaceResolve(how, inside, _) => {
                let [_, surfaces] = inside.bindings();
                [&params[..], &[Read(Lists), Read(ActiveCells)], &fragments, &planes, how.tables(), surfaces].concat()
            }
        }
    }

    /// The complete WGSL source.
    pub fn source(self, split: RecordSplit) -> String {
        [declarations(&self.bindings()), self.parts(split)].concat()
    }

    fn parts(self, split: RecordSplit) -> String {
        let constants = Constants(split).to_string();
        let constants = constants.as_str();
        match self {
            Self::DecodeVq => include_str!("../../../shaders/decode_vq.wgsl").to_owned(),
            Self::ViewTransform => {
                [lib::FRAME, lib::SUMS, include_str!("../../../shaders/view_transform.wgsl")].concat()
            }
            Self::EntriesCount => entering(constants, include_str!("../../../shaders/entries_count.wgsl")),
            Self::EntriesScan => [lib::FRAME, include_str!("../../../shaders/entries_scan.wgsl")].concat(),
            Self::EntriesStore => entering(constants, include_str!("../../../shaders/entries_store.wgsl")),
            Self::Walk(how, inside, precision) => {
                let tiles = include_str!("../../../shaders/walk.wgsl");
                [&walking(constants, how, inside, precision), tiles].concat()
            }
            Self::WalkRays(how, inside, precision) => {
                let listed = [lib::RAY_LIST, lib::RAY_BITS, include_str!("../../../shaders/walk_rays.wgsl")].concat();
                [&walking(constants, how, inside, precision), listed.as_str()].concat()
            }
            Self::SplitPlan => splitting("", include_str!("../../../shaders/split_plan.wgsl")),
            Self::SplitDecide => {
                let boxes = [lib::SUMS, lib::CELLS, lib::ACTIVE, lib::PAIRS, lib::CLOSE_BOXES].concat();
                let decide = include_str!("../../../shaders/split_decide.wgsl");
                splitting(&[constants, &blocks(), &boxes].concat(), decide)
            }
            Self::SplitAppend => splitting(&blocks(), include_str!("../../../shaders/split_append.wgsl")),
            Self::SplitSlice => [lib::RAY_LIST, include_str!("../../../shaders/split_slice.wgsl")].concat(),
            Self::Fill => splitting(&blocks(), include_str!("../../../shaders/fill.wgsl")),
            Self::Present => include_str!("../../../shaders/present.wgsl").to_owned(),
            Self::Faces(pass, precision) => finding(pass, precision, include_str!("../../../shaders/faces.wgsl")),
            Self::FacePieces(pass, precision) => {
                finding(pass, precision, include_str!("../../../shaders/face_pieces.wgsl"))
            }
            Self::FaceStarts(pass, precision) => {
                finding(pass, precision, include_str!("../../../shaders/face_starts.wgsl"))
            }
            Self::FaceScan => {
                [lib::FRAME, &faces(FragmentKind::Plain), include_str!("../../../shaders/face_scan.wgsl")].concat()
            }
            Self::LayersPlan => layering(include_str!("../../../shaders/layers_plan.wgsl")),
            Self::LayersRange => layering(include_str!("../../../shaders/layers_range.wgsl")),
            Self::LayersReference => layering(include_str!("../../../shaders/layers_reference.wgsl")),
            Self::UpsampleNearest => upsampling(lib::SAMPLES, include_str!("../../../shaders/upsample_nearest.wgsl")),
            Self::UpsampleBilinear(_) => {
                upsampling(lib::SAMPLES, include_str!("../../../shaders/upsample_bilinear.wgsl"))
            }
            Self::UpsampleJoint => upsampling("", include_str!("../../../shaders/upsample_joint.wgsl")),
            Self::UpsampleJoint2x2 => upsampling(lib::SAMPLES, include_str!("../../../shaders/upsample_joint2x2.wgsl")),
            Self::FaceSort(kind) => {
                [lib::FRAME, &faces(kind), lib::FRAGMENTS, include_str!("../../../shaders/face_sort.wgsl")].concat()
            }
            Self::FaceResolve(how, inside, precision) => {
                let surfaces = match inside {
                    Inside::Volume => "",
                    Inside::Surfaces => &[lib::CORNERS, lib::BEHIND_VERTICES].concat(),
                };
                let resolve =
                    [lib::ACTIVE, lib::FRAGMENTS, include_str!("../../../shaders/face_resolve.wgsl")].concat();
                [&gathering(how, inside, precision), &faces(how.fragments()), surfaces, &resolve].concat()
            }
        }
    }
}

/// Parts of the stages that integrate along rays.
fn gathering(how: Gathering, inside: Inside, precision: Precision) -> String {
    let optics = match how {
        Gathering::Scalar(OpticsKind::Exact) => [lib::WEIGHTS, lib::EXACT, lib::NO_JOINT].concat(),
        Gathering::Scalar(OpticsKind::Partial) => [lib::WEIGHTS, lib::PARTIAL, lib::NO_JOINT].concat(),
        Gathering::Scalar(OpticsKind::Table3d) => [lib::TABLE3D, lib::NO_JOINT].concat(),
        Gathering::Joint => [lib::WEIGHTS, lib::JOINT].concat(),
    };
    let surfaces = match (inside, how) {
        (Inside::Volume, _) => lib::NO_SURFACES.to_owned(),
        (Inside::Surfaces, Gathering::Scalar(_)) => [lib::SURFACES, lib::NO_JOINT_PARTS].concat(),
        (Inside::Surfaces, Gathering::Joint) => [lib::SURFACES, lib::JOINT_PARTS].concat(),
    };
    [lib::FRAME, lib::SUMS, &rays(inside, precision), lib::MATH, &optics, &surfaces, lib::LIGHT].concat()
}

/// Parts of the stages that walk along rays.
fn walking(constants: &str, how: Gathering, inside: Inside, precision: Precision) -> String {
    let kind = how.fragments();
    let values = [vertex_values(kind), behind_vertices(kind, inside)].concat();
    [constants, &gathering(how, inside, precision), &values, lib::CELLS, lib::ACTIVE, lib::CROSSING, lib::WALK].concat()
}

/// Composes a stage of adaptive sampling.
fn splitting(parts: &str, stage: &str) -> String {
    [lib::FRAME, lib::RAY_LIST, lib::STRIDES, parts, stage].concat()
}

/// Parts of the stages that look at blocks.
fn blocks() -> String {
    [lib::RAY_BITS, lib::BLOCKS].concat()
}

/// Parts for planar geometry.
fn rays(inside: Inside, precision: Precision) -> String {
    let scalar = match inside {
        Inside::Volume => lib::SCALAR_AS_IS,
        Inside::Surfaces => lib::SCALAR_WITHIN_FACE,
    };
    [numbers(precision), lib::RAY, scalar].concat()
}

/// The part that defines the numbers of planar geometry.
fn numbers(precision: Precision) -> &'static str {
    match precision {
        Precision::Single => lib::RAY_SINGLE,
        Precision::Double => lib::RAY_DOUBLE,
    }
}

/// The part that interpolates the value at vertices.
fn vertex_values(kind: FragmentKind) -> &'static str {
    match kind {
        FragmentKind::Plain => lib::NO_VERTEX_VALUES,
        FragmentKind::Joint => lib::VERTEX_VALUES,
    }
}

/// The part that reads numbers behind the view vertices, if there are any.
fn behind_vertices(kind: FragmentKind, inside: Inside) -> &'static str {
    match (kind, inside) {
        (FragmentKind::Plain, Inside::Volume) => "",
        (FragmentKind::Joint, _) | (_, Inside::Surfaces) => lib::BEHIND_VERTICES,
    }
}

/// Parts of the face renderer's stages.
fn faces(kind: FragmentKind) -> String {
    let pairs = format!("const FRAGMENT_PAIRS: u32 = {}u;\n", kind.bytes() / 8);
    [&pairs, lib::TILES, lib::FACES, lib::FACE_LISTS].concat()
}

/// Parts of the stages of depth layers.
fn layers() -> String {
    [lib::TILES, lib::FACES, lib::LAYER_LISTS].concat()
}

/// Composes a stage that reads drawn depth layers.
fn layering(stage: &str) -> String {
    [lib::FRAME, &layers(), stage].concat()
}

/// Composes an upsampling stage.
fn upsampling(samples: &str, stage: &str) -> String {
    [lib::FRAME, lib::TILES, lib::UPSAMPLE, samples, stage].concat()
}

/// Composes a stage that finds fragments.
fn finding(pass: Pass, precision: Precision, stage: &str) -> String {
    let (kept, kind, inside) = match pass {
        Pass::Count => ([lib::MESH_FACES, lib::FRAGMENTS_COUNT, lib::PIECES], FragmentKind::Plain, Inside::Volume),
        Pass::Store(kind, inside) => ([lib::MESH_FACES, lib::FRAGMENTS_STORE, ""], kind, inside),
        Pass::Layers => ([lib::BOUNDARY_FACES, lib::LAYERS_KEEP, lib::PIECES], FragmentKind::Plain, Inside::Volume),
    };
    let lists = if pass == Pass::Layers { layers() } else { faces(kind) };
    let values = [vertex_values(kind), behind_vertices(kind, Inside::Volume)].concat();
    let ray = rays(inside, precision);
    [lib::FRAME, &lists, lib::SUMS, lib::BOXES, &ray, lib::FACE_HITS, &values, &kept.concat(), stage].concat()
}

/// Composes a stage that finds entries.
fn entering(constants: &str, stage: &str) -> String {
    [constants, lib::FRAME, lib::CELLS, lib::BOXES, lib::ITEMS, stage].concat()
}

/// WGSL constants of a record split.
struct Constants(RecordSplit);

impl fmt::Display for Constants {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "const RECORD_PARTS: u32 = {}u;\nconst RECORD_SHIFT: u32 = {}u;", self.0.parts, self.0.shift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_split_where_a_binding_ends() {
        let mib = 1 << 20;
        let split = |cells, bytes| RecordSplit::new(cells, bytes).map(|s| (s.parts, s.shift));
        assert_eq!(split(1_000_000, 128 * mib), Some((1, 22)));
        assert_eq!(split(1 << 22, 128 * mib), Some((1, 22)));
        assert_eq!(split((1 << 22) + 1, 128 * mib), Some((2, 22)));
        assert_eq!(split(10_000_000, 128 * mib), Some((3, 22)));
        assert_eq!(split(13_000_000, 128 * mib), None);
        assert_eq!(split(13_000_000, 2048 * mib - 1), Some((1, 25)));
        assert_eq!(split(0, 128 * mib), Some((1, 22)));
        assert_eq!(split(1, 31), None);
        let split = RecordSplit { parts: 3, shift: 4 };
        assert_eq!([0, 1, 2].map(|p| split.cells_of(p, 40)), [0..16, 16..32, 32..40]);
    }
}
