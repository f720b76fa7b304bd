//! In what variants stages come: by number type, elements, passes, and what fragments and segments are.

use super::layout::{FRAGMENT_BYTES, JOINT_FRAGMENT_BYTES};
use super::resources::{Binding, Resource};
use crate::field::Scalars;
use crate::optics::OpticsKind;
use crate::render::RenderJob;

/// Number type of the rays' planar geometry and of depths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// f32, and sums of two: within WebGPU's defaults.
    #[default]
    Single,
    /// f64, an optional feature of devices.
    Double,
}

/// What fragments are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// Faces of the mesh.
    Face,
    /// Cells as points, in their own shape.
    Tet,
    /// Cells as points, in other shapes.
    Slab,
    /// Points without cells.
    Ball,
}

impl Element {
    /// Whether its fragments are slabs of one scalar.
    pub fn is_slab(self) -> bool {
        matches!(self, Self::Slab | Self::Ball)
    }

    /// What decides on the scalar of its fragments: that of a cell is none of its faces', nor are slabs cut by surfaces.
    pub fn inside_of_fragments(self, inside: Inside) -> Inside {
        if inside == Inside::Cells || self.is_slab() { Inside::Volume } else { inside }
    }

    /// The element whose stages sort and resolve its fragments.
    pub fn resolved_as(self) -> Self {
        if self.is_slab() { Self::Tet } else { self }
    }

    /// The numbers of its geometry where the cells ask for `precision`: slabs are not cells, and in f32.
    pub fn precision(self, precision: Precision) -> Precision {
        if self.is_slab() { Precision::Single } else { precision }
    }
}

/// What a pass over the elements does with the fragments that it finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// Counts them per pixel.
    Count,
    /// Stores them.
    Store(FragmentKind, Inside),
    /// Keeps the nearest depths of each pixel, for faces of the boundary.
    Layers,
}

/// What the decoder writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// The scalars of a step.
    Step,
    /// A mixture of the scalars of a step with those that have been written before it.
    Mixture,
}

/// What has the values of a block that is decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Valued {
    /// The vertices, or the cells.
    Each,
    /// Cells of the source, of which several cells of the mesh are parts.
    Wholes,
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
    /// As `Plain`, and the value at vertices, for a joint table over these.
    Joint,
}

impl FragmentKind {
    /// The kind of the fragments of a job's faces.
    pub fn of(job: &RenderJob) -> Self {
        Self::integrated(Gathering::of(job), Inside::of(job))
    }

    /// The kind of fragments that are integrated so. Values of cells are none of their faces'.
    pub fn integrated(how: Gathering, inside: Inside) -> Self {
        match (how, inside) {
            (Gathering::Joint, Inside::Volume | Inside::Surfaces) => Self::Joint,
            (Gathering::Joint, Inside::Cells) | (Gathering::Scalar(_), _) => Self::Plain,
        }
    }

    /// Bytes of a fragment.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Plain => FRAGMENT_BYTES,
            Self::Joint => JOINT_FRAGMENT_BYTES,
        }
    }
}

/// What there is along rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Along {
    /// How segments are integrated.
    pub how: Gathering,
    /// What rays meet inside cells.
    pub inside: Inside,
    /// What of other layers lies between segments.
    pub layers: OtherLayers,
}

/// What of other layers lies between the segments of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherLayers {
    /// Nothing.
    None,
    /// Fragments.
    Fragments,
    /// Fragments, and splats of flow.
    Flow,
}

impl OtherLayers {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::None, Self::Fragments, Self::Flow];

    /// Those of a job.
    pub fn of(job: &RenderJob) -> Self {
        match (&job.flow, &job.fragments) {
            (Some(_), _) => Self::Flow,
            (None, Some(_)) => Self::Fragments,
            (None, None) => Self::None,
        }
    }

    fn bindings(self) -> &'static [Binding] {
        const FRAGMENTS: Binding = Binding::Read(Resource::LayerFragments);
        match self {
            Self::None => &[],
            Self::Fragments => &[FRAGMENTS],
            Self::Flow => &[
                FRAGMENTS,
                Binding::Read(Resource::FlowLists),
                Binding::Read(Resource::FlowIcons),
                Binding::Read(Resource::FlowInside),
            ],
        }
    }
}

impl Along {
    /// Segments alone.
    pub const fn cells(how: Gathering, inside: Inside) -> Self {
        Self { how, inside, layers: OtherLayers::None }
    }

    /// All of them, with other layers and without.
    pub fn all() -> impl Iterator<Item = Self> + Clone {
        let cells = Gathering::ALL.into_iter().flat_map(|how| Inside::ALL.map(|inside| Self::cells(how, inside)));
        cells.flat_map(|cells| OtherLayers::ALL.map(|layers| Self { layers, ..cells }))
    }

    /// What there is along the rays of a job.
    pub fn of(job: &RenderJob) -> Self {
        Self { how: Gathering::of(job), inside: Inside::of(job), layers: OtherLayers::of(job) }
    }

    /// Bindings of what there is between and inside cells, of the walk, and of renderers with lists.
    pub(super) fn bindings(self) -> [Vec<Binding>; 2] {
        self.inside.bindings().map(|inside| [self.how.tables(), inside, self.layers.bindings()].concat())
    }
}

/// What rays meet inside cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inside {
    /// The volume alone.
    Volume,
    /// The volume and isosurfaces.
    Surfaces,
    /// The volume, of scalars of cells.
    Cells,
}

impl Inside {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Volume, Self::Surfaces, Self::Cells];
    /// Those that fragments are stored for.
    pub const OF_VERTICES: [Self; 2] = [Self::Volume, Self::Surfaces];

    /// What rays of a job meet.
    pub fn of(job: &RenderJob) -> Self {
        match job.scalars {
            Scalars::Cells(_) => Self::Cells,
            Scalars::Vertices(_) if job.surfaces.is_some() => Self::Surfaces,
            Scalars::Vertices(_) => Self::Volume,
        }
    }

    /// Bindings beyond those of [`Gathering`]: of the walk, and of the face renderer.
    fn bindings(self) -> [&'static [Binding]; 2] {
        const SURFACES: Binding = Binding::Read(Resource::Surfaces);
        match self {
            Self::Volume => [&[], &[]],
            Self::Cells => [&[], &[Binding::Read(Resource::Vertices)]],
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
}
