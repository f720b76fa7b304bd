//! The stages: their bindings, and their shaders, composed from parts ([`super::stage_parts`]).

pub use super::variants::{
    Along, Element, FragmentKind, Gathering, Inside, Moment, OtherLayers, Pass, Precision, Toward, Valued,
};

use super::resources::{Binding, Resource, declarations};

/// A stage of a renderer: one entry point in one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Decodes a step from its compressed block.
    DecodeVq(Moment, Valued),
    /// Transforms vertices to view coordinates.
    ViewTransform,
    /// Counts the items that meet each tile.
    EntriesCount,
    /// Sums the tiles' counts to places.
    EntriesScan,
    /// Stores the items of each tile.
    EntriesStore,
    /// Projects splats of flow.
    FlowProject,
    /// Counts those that reach each tile.
    FlowCount,
    /// Sums the tiles' counts to places.
    FlowScan,
    /// Stores the numbers of those of each tile.
    FlowStore,
    /// Puts those of each tile in order, and writes where they are.
    FlowSort,
    /// Walks all rays from their entries through the cells.
    Walk(Along, Precision),
    /// Walks the rays of a list, without other layers.
    WalkRays(Along, Precision),
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
    /// Tests elements against the pixels of their boxes.
    Find(Element, Pass, Precision),
    /// Tests elements with large boxes, tile by tile.
    FindPieces(Element, Pass, Precision),
    /// Finds the rays that begin in a cell.
    FaceStarts(Pass, Precision),
    /// Sums fragments per pixel to places.
    FragmentScan,
    /// Runs one round of sorting the fragments of deep pixels.
    FragmentSort(Element, FragmentKind),
    /// Orders and composites the fragments of each pixel.
    Resolve(Element, Along, Precision),
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

/// The stages of flow, in order.
pub const FLOW: [Stage; 5] = [Stage::FlowProject, Stage::FlowCount, Stage::FlowScan, Stage::FlowStore, Stage::FlowSort];

/// All stages.
pub fn stages() -> impl Iterator<Item = Stage> {
    let alike = [
        Stage::DecodeVq(Moment::Step, Valued::Each),
        Stage::DecodeVq(Moment::Mixture, Valued::Each),
        Stage::DecodeVq(Moment::Step, Valued::Wholes),
        Stage::DecodeVq(Moment::Mixture, Valued::Wholes),
        Stage::ViewTransform,
        Stage::EntriesCount,
        Stage::EntriesScan,
        Stage::EntriesStore,
        Stage::Present,
        Stage::FragmentScan,
        Stage::SplitPlan,
        Stage::SplitDecide,
        Stage::SplitAppend,
        Stage::SplitSlice,
        Stage::Fill,
        Stage::Find(Element::Face, Pass::Layers, Precision::Single),
        Stage::FindPieces(Element::Face, Pass::Layers, Precision::Single),
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
        let elements = [Element::Face, Element::Tet, Element::Slab, Element::Ball];
        let elements = elements.into_iter().filter(move |element| element.precision(precision) == precision);
        let walks = Along::all().flat_map(move |along| {
            let listed = (along.layers == OtherLayers::None).then_some(Stage::WalkRays(along, precision));
            [Stage::Walk(along, precision)].into_iter().chain(listed)
        });
        walks.chain(elements.flat_map(move |element| listing(element, precision)))
    };
    alike.into_iter().chain(FLOW).chain([Precision::Single, Precision::Double].into_iter().flat_map(with))
}

/// The stages with lists of fragments.
fn listing(element: Element, precision: Precision) -> impl Iterator<Item = Stage> {
    let kinds = [FragmentKind::Plain, FragmentKind::Joint];
    let insides = Inside::OF_VERTICES.into_iter().filter(move |&inside| element.inside_of_fragments(inside) == inside);
    let stores = kinds.into_iter().flat_map(move |kind| insides.clone().map(move |inside| Pass::Store(kind, inside)));
    let finding = [Pass::Count].into_iter().chain(stores).flat_map(move |pass| {
        let starts = (element == Element::Face).then_some(Stage::FaceStarts(pass, precision));
        [Stage::Find(element, pass, precision), Stage::FindPieces(element, pass, precision)].into_iter().chain(starts)
    });
    // All points are sorted and resolved alike, and without other layers.
    let resolves = !element.is_slab();
    let resolving =
        Along::all().filter(move |along| resolves && (element == Element::Face || along.layers == OtherLayers::None));
    let resolving = resolving.map(move |along| Stage::Resolve(element, along, precision));
    let sorts = resolves && precision == Precision::Single;
    let sorting = sorts.then(|| kinds.map(|kind| Stage::FragmentSort(element, kind)));
    finding.chain(sorting.into_iter().flatten()).chain(resolving)
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
const RECORD_BYTES: u64 = size_of::<[[u32; 4]; 2]>() as u64;

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
        self.file().0
    }

    /// Its name, and the text of its file.
    fn file(self) -> (&'static str, &'static str) {
        match self {
            Self::DecodeVq(..) => ("decode_vq", include_str!("../../../shaders/decode_vq.wgsl")),
            Self::ViewTransform => ("view_transform", include_str!("../../../shaders/view_transform.wgsl")),
            Self::EntriesCount => ("entries_count", include_str!("../../../shaders/entries_count.wgsl")),
            Self::EntriesScan => ("entries_scan", include_str!("../../../shaders/entries_scan.wgsl")),
            Self::EntriesStore => ("entries_store", include_str!("../../../shaders/entries_store.wgsl")),
            Self::FlowProject => ("flow_project", include_str!("../../../shaders/flow_project.wgsl")),
            Self::FlowCount => ("flow_count", include_str!("../../../shaders/flow_count.wgsl")),
            Self::FlowScan => Self::EntriesScan.file(),
            Self::FlowStore => ("flow_store", include_str!("../../../shaders/flow_store.wgsl")),
            Self::FlowSort => ("flow_sort", include_str!("../../../shaders/flow_sort.wgsl")),
            Self::Walk(..) => ("walk", include_str!("../../../shaders/walk.wgsl")),
            Self::WalkRays(..) => ("walk_rays", include_str!("../../../shaders/walk_rays.wgsl")),
            Self::SplitPlan => ("split_plan", include_str!("../../../shaders/split_plan.wgsl")),
            Self::SplitDecide => ("split_decide", include_str!("../../../shaders/split_decide.wgsl")),
            Self::SplitAppend => ("split_append", include_str!("../../../shaders/split_append.wgsl")),
            Self::SplitSlice => ("split_slice", include_str!("../../../shaders/split_slice.wgsl")),
            Self::Fill => ("fill", include_str!("../../../shaders/fill.wgsl")),
            Self::Present => ("present", include_str!("../../../shaders/present.wgsl")),
            Self::Find(..) => ("fragments_find", include_str!("../../../shaders/fragments_find.wgsl")),
            Self::FindPieces(..) => ("fragments_pieces", include_str!("../../../shaders/fragments_pieces.wgsl")),
            Self::FaceStarts(..) => ("face_starts", include_str!("../../../shaders/face_starts.wgsl")),
            Self::FragmentScan => ("fragments_scan", include_str!("../../../shaders/fragments_scan.wgsl")),
            Self::FragmentSort(..) => ("fragments_sort", include_str!("../../../shaders/fragments_sort.wgsl")),
            Self::Resolve(..) => ("fragments_resolve", include_str!("../../../shaders/fragments_resolve.wgsl")),
            Self::LayersPlan => ("layers_plan", include_str!("../../../shaders/layers_plan.wgsl")),
            Self::LayersRange => ("layers_range", include_str!("../../../shaders/layers_range.wgsl")),
            Self::LayersReference => ("layers_reference", include_str!("../../../shaders/layers_reference.wgsl")),
            Self::UpsampleNearest => ("upsample_nearest", include_str!("../../../shaders/upsample_nearest.wgsl")),
            Self::UpsampleBilinear(_) => ("upsample_bilinear", include_str!("../../../shaders/upsample_bilinear.wgsl")),
            Self::UpsampleJoint => ("upsample_joint", include_str!("../../../shaders/upsample_joint.wgsl")),
            Self::UpsampleJoint2x2 => ("upsample_joint2x2", include_str!("../../../shaders/upsample_joint2x2.wgsl")),
        }
    }

    /// The numbers that it computes with.
    pub fn precision(self) -> Precision {
        match self {
            Self::Walk(_, precision)
            | Self::WalkRays(_, precision)
            | Self::Resolve(_, _, precision)
            | Self::Find(_, _, precision)
            | Self::FindPieces(_, _, precision)
            | Self::FaceStarts(_, precision) => precision,
            // Mixtures are those of the CPU, which mixes in f64.
            Self::DecodeVq(Moment::Mixture, _) => Precision::Double,
            _ => Precision::Single,
        }
    }

    /// Its bindings, in the order of their numbers.
    pub fn bindings(self) -> Vec<Binding> {
        use Binding::{Atomic, Read, Write};
        use Resource::*;
        let params = [Read(Params), Read(ListParams)];
        let planes = [Write(Counters), Write(ColorPlane), Write(DepthPlane)];
        let upsampling = [Read(Params), Read(UpsampleParams)];
        let small = [Read(SmallColor), Read(SmallDepth)];
        let records = Resource::RECORDS.map(Read);
        let fragments = Resource::FRAGMENTS.map(Write);
        match self {
            Self::DecodeVq(_, Valued::Each) => vec![Read(VqStep), Read(Block), Write(Scalars)],
            Self::DecodeVq(_, Valued::Wholes) => vec![Read(VqStep), Read(Block), Read(SourceCells), Write(Scalars)],
            Self::ViewTransform => vec![Read(Params), Read(Positions), Read(Scalars), Write(Vertices)],
            Self::EntriesCount | Self::EntriesStore => {
                [&[Read(Params), Read(Vertices), Read(Items), Atomic(Bins)][..], &records].concat()
            }
            Self::EntriesScan => vec![Read(Params), Write(Bins)],
            Self::FlowProject => {
                let read = [Read(Params), Read(FlowParams), Read(FlowSites), Read(FlowReady)];
                [&read[..], &[Write(FlowRecords), Write(FlowPlane)]].concat()
            }
            Self::FlowCount | Self::FlowStore => {
                vec![Read(Params), Read(FlowParams), Read(FlowRecords), Atomic(FlowBins)]
            }
            Self::FlowScan => vec![Read(Params), Write(FlowBins)],
            Self::FlowSort => {
                vec![Read(Params), Read(FlowParams), Read(FlowRecords), Atomic(FlowBins), Write(FlowPlane)]
            }
            Self::Walk(along, _) => {
                let read = [Read(Params), Read(Vertices), Read(ActiveCells), Read(Bins)];
                let [met, _] = along.bindings();
                [&read[..], &records, &planes, &met].concat()
            }
            Self::WalkRays(along, _) => {
                let read = [Read(Params), Read(RayParams), Read(Vertices), Read(ActiveCells), Read(Bins)];
                let written = [Atomic(Rays), Write(SeenColorPlane), Write(SeenDepthPlane)];
                let [met, _] = along.bindings();
                [&read[..], &records, &written, &met].concat()
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
            Self::Find(element @ (Element::Tet | Element::Slab | Element::Ball), pass, _)
            | Self::FindPieces(element @ (Element::Tet | Element::Slab | Element::Ball), pass, _) => {
                let shape = if element == Element::Ball { Balls } else { Corners };
                let found = [Read(PointParams), Atomic(Lists), Read(Vertices), Read(Drawn), Read(shape)];
                let kept = if pass == Pass::Count { &[][..] } else { &fragments };
                [&params[..], &found, kept].concat()
            }
            Self::Find(Element::Face, pass, _)
            | Self::FindPieces(Element::Face, pass, _)
            | Self::FaceStarts(pass, _) => {
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
            Self::FragmentScan => vec![Read(Params), Write(Lists)],
            Self::FragmentSort(..) => [&params[..], &[Read(Lists)], &fragments].concat(),
            Self::Resolve(element, along, _) => {
                let [_, met] = along.bindings();
                let read = match element {
                    Element::Face => &[Read(Lists), Read(ActiveCells)][..],
                    Element::Tet | Element::Slab | Element::Ball => &[Read(PointParams), Read(Lists), Read(Drawn)],
                };
                [&params[..], read, &fragments, &planes, &met].concat()
            }
        }
    }

    /// The complete WGSL source.
    pub fn source(self, split: RecordSplit) -> String {
        let (_, file) = self.file();
        [&declarations(&self.bindings()), &self.constants(split), &self.parts().concat(), file].concat()
    }

    /// The constants that depend on how cells and fragments are stored.
    fn constants(self, split: RecordSplit) -> String {
        let kind = match self {
            Self::Find(_, Pass::Store(kind, _), _)
            | Self::FindPieces(_, Pass::Store(kind, _), _)
            | Self::FaceStarts(Pass::Store(kind, _), _)
            | Self::FragmentSort(_, kind) => kind,
            Self::Resolve(_, along, _) => FragmentKind::integrated(along.how, along.inside),
            _ => FragmentKind::Plain,
        };
        let RecordSplit { parts, shift } = split;
        let records = format!("const RECORD_PARTS: u32 = {parts}u;\nconst RECORD_SHIFT: u32 = {shift}u;\n");
        format!("{records}const FRAGMENT_PAIRS: u32 = {}u;\n", kind.bytes() / 8)
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
