//! The parts of `shaders/lib/` of which each stage is composed. No other module knows them.

use super::shader_parts as lib;
use super::shaders::{Along, Element, FragmentKind, Gathering, Inside, OtherLayers, Pass, Precision, Stage};
use super::shaders::{Moment, Valued};
use crate::optics::OpticsKind;

impl Stage {
    /// The parts of `shaders/lib/` that its file needs.
    pub(super) fn parts(self) -> Vec<&'static str> {
        match self {
            Self::DecodeVq(moment, valued) => {
                let mixed = if moment == Moment::Step { lib::STEP_AS_IS } else { lib::STEP_MIXED };
                vec![mixed, if valued == Valued::Each { lib::VALUES_AS_STORED } else { lib::VALUES_OF_PARTS }]
            }
            Self::Present => vec![],
            Self::ViewTransform => vec![lib::FRAME, lib::SUMS, lib::VIEW],
            Self::EntriesCount | Self::EntriesStore => vec![lib::FRAME, lib::CELLS, lib::BOXES, lib::ITEMS],
            Self::EntriesScan | Self::FlowScan => vec![lib::FRAME, lib::SATURATING],
            Self::FlowProject => {
                [&PROJECTED[..], &[lib::SUMS, lib::DOUBLE, lib::VIEW, lib::MATH, lib::TEXELS]].concat()
            }
            Self::FlowCount => [&PROJECTED[..], &[lib::BOXES, lib::FLOW_TILES]].concat(),
            Self::FlowStore => [&PROJECTED[..], &[lib::BOXES, lib::FLOW_TILES, lib::FLOW_BINS]].concat(),
            Self::FlowSort => {
                let lists = [lib::TILES, lib::TEXELS, lib::FLOW_BINS, lib::NETWORK];
                [&PROJECTED[..], &lists, &[lib::SUMS, lib::DOUBLE, lib::RAY_SINGLE]].concat()
            }
            Self::Walk(along, precision) => walking(along, precision),
            Self::WalkRays(along, precision) => {
                [walking(along, precision), vec![lib::RAY_LIST, lib::RAY_BITS]].concat()
            }
            Self::SplitPlan => vec![lib::FRAME, lib::RAY_LIST, lib::STRIDES],
            Self::SplitDecide => {
                let boxes = [lib::SUMS, lib::CELLS, lib::ACTIVE, lib::PAIRS, lib::CLOSE_BOXES];
                [&BLOCKS[..], &boxes].concat()
            }
            Self::SplitAppend | Self::Fill => BLOCKS.to_vec(),
            Self::SplitSlice => vec![lib::RAY_LIST],
            Self::Find(element, pass, precision) | Self::FindPieces(element, pass, precision) => {
                finding(element, pass, precision)
            }
            Self::FaceStarts(pass, precision) => finding(Element::Face, pass, precision),
            Self::FragmentScan => [&[lib::FRAME][..], &LISTS, &[lib::SATURATING]].concat(),
            Self::FragmentSort(element, _) => {
                [&[lib::FRAME][..], &LISTS, &STORED, &[order(element), lib::NETWORK]].concat()
            }
            Self::Resolve(element, along, precision) => {
                let surfaces = match along.inside {
                    Inside::Volume => &[][..],
                    Inside::Surfaces => &[lib::CORNERS, lib::BEHIND_VERTICES],
                    Inside::Cells => &[lib::BEHIND_VERTICES],
                };
                let gathered = match element {
                    Element::Face => [lib::ACTIVE, lib::FACE_PATHS],
                    Element::Tet | Element::Slab | Element::Ball => [lib::POINT_LIST, lib::POINT_LIGHT],
                };
                let sorted = [order(element), lib::SORT];
                [&gathering(along, precision)[..], &LISTS, &STORED, &sorted, &gathered, surfaces].concat()
            }
            Self::LayersPlan | Self::LayersRange | Self::LayersReference => [&[lib::FRAME][..], &LAYERS].concat(),
            Self::UpsampleJoint => vec![lib::FRAME, lib::TILES, lib::UPSAMPLE],
            Self::UpsampleNearest | Self::UpsampleBilinear(_) | Self::UpsampleJoint2x2 => {
                vec![lib::FRAME, lib::TILES, lib::UPSAMPLE, lib::SAMPLES]
            }
        }
    }
}

/// Parts of the stages of adaptive sampling that look at blocks.
const BLOCKS: [&str; 5] = [lib::FRAME, lib::RAY_LIST, lib::STRIDES, lib::RAY_BITS, lib::BLOCKS];

/// Parts of the stages with lists of fragments.
const LISTS: [&str; 3] = [lib::TILES, lib::LIST_PARAMS, lib::FRAGMENT_LISTS];

/// Parts of the stages that read stored fragments.
const STORED: [&str; 2] = [lib::FRAGMENTS, lib::FRAGMENT_PLACES];

/// Parts of the stages of flow.
const PROJECTED: [&str; 4] = [lib::FRAME, lib::FLOW_LAYOUT, lib::FLOW_PARAMS, lib::FLOW_RECORDS];

/// Parts of the stages of depth layers.
const LAYERS: [&str; 3] = [lib::TILES, lib::LIST_PARAMS, lib::LAYER_LISTS];

/// The part that says what fragments are sorted by.
fn order(element: Element) -> &'static str {
    match element {
        Element::Face => lib::FACE_ORDER,
        Element::Tet | Element::Slab | Element::Ball => lib::POINT_ORDER,
    }
}

/// Parts of the stages that integrate along rays.
fn gathering(along: Along, precision: Precision) -> Vec<&'static str> {
    let Along { how, inside, layers } = along;
    let optics = match how {
        Gathering::Scalar(OpticsKind::Exact) => &[lib::WEIGHTS, lib::INTERVALS, lib::EXACT, lib::NO_JOINT][..],
        Gathering::Scalar(OpticsKind::Partial) => &[lib::WEIGHTS, lib::INTERVALS, lib::PARTIAL, lib::NO_JOINT],
        Gathering::Scalar(OpticsKind::Table3d) => &[lib::TABLE3D, lib::NO_JOINT],
        Gathering::Joint => &[lib::WEIGHTS, lib::JOINT],
    };
    let met = match (inside, how) {
        (Inside::Volume, _) => lib::NO_SURFACES,
        (Inside::Cells, Gathering::Scalar(_)) => lib::CELL_SCALARS,
        (Inside::Cells, Gathering::Joint) => lib::CELL_JOINT,
        (Inside::Surfaces, _) => lib::SURFACES,
    };
    let cut = match how {
        _ if layers == OtherLayers::None && inside != Inside::Surfaces => &[][..],
        Gathering::Scalar(_) => &[lib::NO_JOINT_PARTS],
        Gathering::Joint => &[lib::JOINT_PARTS],
    };
    let ahead = match layers {
        OtherLayers::None => &[lib::NOTHING_AHEAD][..],
        OtherLayers::Fragments => &[lib::TEXELS, lib::LAYER_FRAGMENTS, lib::FRAGMENTS_AHEAD, lib::AHEAD],
        OtherLayers::Flow => &[
            lib::TEXELS,
            lib::LAYER_FRAGMENTS,
            lib::FLOW_LAYOUT,
            lib::FLOW_ICONS,
            lib::FLOW_SPLATS,
            lib::FLOW_AHEAD,
            lib::AHEAD,
        ],
    };
    let all = [lib::FRAME, lib::SUMS, lib::MATH, lib::LIGHT, lib::COUNTERS];
    [&all, &rays(inside, precision)[..], optics, &[met], cut, ahead].concat()
}

/// Parts of the stages that walk along rays.
fn walking(along: Along, precision: Precision) -> Vec<&'static str> {
    let values = match (FragmentKind::integrated(along.how, along.inside), along.inside) {
        (FragmentKind::Plain, Inside::Volume) => &[lib::NO_VERTEX_VALUES][..],
        (FragmentKind::Plain, Inside::Surfaces | Inside::Cells) => &[lib::NO_VERTEX_VALUES, lib::BEHIND_VERTICES],
        (FragmentKind::Joint, _) => &[lib::VERTEX_VALUES, lib::BEHIND_VERTICES],
    };
    let walk = [lib::CELLS, lib::ACTIVE, lib::CROSSING, lib::WALK];
    [&gathering(along, precision), values, &walk].concat()
}

/// Parts for planar geometry.
fn rays(inside: Inside, precision: Precision) -> [&'static str; 3] {
    let numbers = match precision {
        Precision::Single => lib::RAY_SINGLE,
        Precision::Double => lib::RAY_DOUBLE,
    };
    let scalar = match inside {
        Inside::Volume | Inside::Cells => lib::SCALAR_AS_IS,
        Inside::Surfaces => lib::SCALAR_WITHIN_FACE,
    };
    [numbers, lib::RAY, scalar]
}

/// Parts of the stages that find points.
const POINTS: [&str; 4] = [lib::POINT_LIST, lib::POINT_BOXES, lib::POINT_CENTER, lib::BEHIND_VERTICES];

/// Parts of the stages that find cells as points.
const OF_CELLS: [&str; 3] = [lib::CORNERS, lib::POINT_CORNERS, lib::POINT_SHAPE];

/// Parts of the stages that find slabs.
const SLABS: [&str; 2] = [lib::ELLIPSOID, lib::SLAB_HITS];

/// Parts of the stages that find fragments.
fn finding(element: Element, pass: Pass, precision: Precision) -> Vec<&'static str> {
    let (lists, kept) = match pass {
        Pass::Count => (LISTS, &[lib::FRAGMENTS_COUNT, lib::PIECES][..]),
        Pass::Store(..) => (LISTS, &[lib::FRAGMENTS, lib::FRAGMENTS_STORE][..]),
        Pass::Layers => (LAYERS, &[lib::LAYERS_KEEP, lib::PIECES][..]),
    };
    let found = match element {
        Element::Face if pass == Pass::Layers => vec![lib::FACE_HITS, lib::BOUNDARY_FACES],
        Element::Face => vec![lib::FACE_HITS, lib::MESH_FACES],
        Element::Tet => [&POINTS[..], &OF_CELLS, &[lib::TET_HITS]].concat(),
        Element::Slab => [&POINTS[..], &OF_CELLS, &SLABS, &[lib::SLAB_OF_CELL]].concat(),
        Element::Ball => [&POINTS[..], &SLABS, &[lib::SLAB_OF_BALL]].concat(),
    };
    let (values, inside) = match (pass, element) {
        (Pass::Store(FragmentKind::Joint, inside), Element::Face) => {
            (&[lib::VERTEX_VALUES, lib::BEHIND_VERTICES][..], inside)
        }
        (Pass::Store(FragmentKind::Joint, inside), _) => (&[lib::VERTEX_VALUES][..], inside),
        (Pass::Store(FragmentKind::Plain, inside), _) => (&[lib::NO_VERTEX_VALUES][..], inside),
        (Pass::Count | Pass::Layers, _) => (&[lib::NO_VERTEX_VALUES][..], Inside::Volume),
    };
    let boxes = [lib::SUMS, lib::BOXES];
    [&[lib::FRAME], &lists[..], &boxes, &rays(inside, precision), &[lib::HITS], &found, values, kept].concat()
}
