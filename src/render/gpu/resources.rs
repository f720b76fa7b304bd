//! The buffers and textures of the stages, by name. A stage lists its bindings ([`Stage::bindings`](super::shaders::Stage::bindings));
//! its WGSL declarations, bind group layout and bind group all come from that list, and from the table here.

use std::fmt;

/// A buffer or a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resource {
    /// Parameters of a frame.
    Params,
    /// Parameters of lists of fragments.
    ListParams,
    /// Parameters of cells as points.
    PointParams,
    /// Parameters of a step of codec `vq`.
    VqStep,
    /// Parameters of a pre-integrated table.
    Table3dParams,
    /// Parameters of a joint table.
    JointParams,
    /// Parameters of isosurfaces.
    Surfaces,
    /// Parameters of contrast-adaptive sampling.
    RayParams,
    /// Parameters of upsampling.
    UpsampleParams,
    /// A block of codec `vq`.
    Block,
    /// For each cell of the mesh the source's cell that it is a part of.
    SourceCells,
    /// Positions of the vertices, local units.
    Positions,
    /// Scalars of the vertices, or of the cells.
    Scalars,
    /// Vertices in view coordinates.
    Vertices,
    /// Records of the first cells: four vertices, four neighbours.
    Records0,
    /// Records of the next cells.
    Records1,
    /// Records of the remaining cells.
    Records2,
    /// Vertices of the cells, for stages without records.
    Corners,
    /// Radii of a cloud's points, and halves of their thicknesses.
    Balls,
    /// Entry faces, and the cells at the eye.
    Items,
    /// One bit per cell.
    ActiveCells,
    /// Ends of the tiles' lists, their sum, the lists.
    Bins,
    /// The transfer function.
    Table,
    /// Counters of the tiles, eight each.
    Counters,
    /// The faces or cells that are drawn, and, with faces, the cells at the eye.
    Drawn,
    /// The first faces of the mesh.
    Faces0,
    /// The next faces.
    Faces1,
    /// The remaining faces.
    Faces2,
    /// Fragments of each tile and pixel, and pieces of large elements: [`Lists`](super::layout::Lists).
    Lists,
    /// The first fragments.
    Fragments0,
    /// The remaining fragments.
    Fragments1,
    /// List and progress of adaptively cast rays: [`RayLists`](super::layout::RayLists).
    Rays,
    /// Depth layers: [`LayerLists`](super::layout::LayerLists).
    Depths,
    /// The least and the greatest depth of the boundary in view.
    DepthRange,
    /// Workgroup counts of indirect dispatches: columns, rows and 1 each.
    Args,
    /// Accumulators of adaptively cast rays.
    SeenColorPlane,
    /// Depths of adaptively cast rays.
    SeenDepthPlane,
    /// `SeenColorPlane`, to be read.
    SeenColor,
    /// `SeenDepthPlane`, to be read.
    SeenDepth,
    /// Depth layers of a view, mapped to 0 to 1.
    ReferencePlane,
    /// `ReferencePlane` of the full image, to be read.
    Reference,
    /// `ReferencePlane` of the small image's samples, to be read.
    SmallReference,
    /// Fragments of other layers, by pixels, to be read.
    LayerFragments,
    /// What splats of flow have in common.
    FlowParams,
    /// What splats of flow have of their sites: place and shape.
    FlowSites,
    /// The splats of a view, in the order of depths.
    FlowReady,
    /// These on the screen.
    FlowRecords,
    /// Ends of the tiles' lists of splats, the lists.
    FlowBins,
    /// Splats of flow, by tiles.
    FlowPlane,
    /// `FlowPlane`, to be read.
    FlowLists,
    /// Sums of the icons of flow, to be read.
    FlowIcons,
    /// Where rays are inside of the cells that are shown, by pixels, to be read.
    FlowInside,
    /// Accumulators of the small image.
    SmallColor,
    /// Depths of the small image.
    SmallDepth,
    /// Accumulators of the full image before the joint filter.
    EnlargedPlane,
    /// `EnlargedPlane`, to be read.
    Enlarged,
    /// Accumulators of the image.
    ColorPlane,
    /// Depths of the image.
    DepthPlane,
    /// Accumulators of a finished image.
    Color,
    /// The texture that a window samples.
    Screen,
}

/// Kind and element type of a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A uniform buffer: one struct of this WGSL type.
    Uniform(&'static str),
    /// A storage buffer: an array of this WGSL type.
    Storage(&'static str),
    /// A texture that is read.
    Texture,
    /// A storage texture that is written.
    Plane(Texel),
}

/// Format of a storage texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Texel {
    /// Four numbers of 32 bits.
    Rgba32Float,
    /// One number of 32 bits.
    R32Float,
    /// Four numbers of 16 bits.
    Rgba16Float,
}

impl Texel {
    /// Its name in WGSL.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rgba32Float => "rgba32float",
            Self::R32Float => "r32float",
            Self::Rgba16Float => "rgba16float",
        }
    }
}

impl Resource {
    /// The parts of the records.
    pub const RECORDS: [Self; 3] = [Self::Records0, Self::Records1, Self::Records2];
    /// The parts of the faces.
    pub const FACES: [Self; 3] = [Self::Faces0, Self::Faces1, Self::Faces2];
    /// The parts of the fragments.
    pub const FRAGMENTS: [Self; 2] = [Self::Fragments0, Self::Fragments1];

    /// Its name in the shaders, its label in messages, and its kind.
    fn described(self) -> (&'static str, &'static str, Kind) {
        use Kind::{Plane, Storage, Texture, Uniform};
        match self {
            Self::Params => ("params", "parameters", Uniform("Params")),
            Self::ListParams => ("list_params", "parameters of the lists", Uniform("ListParams")),
            Self::PointParams => ("point_params", "parameters of the points", Uniform("PointParams")),
            Self::VqStep => ("step", "parameters of the step", Uniform("VqStep")),
            Self::Table3dParams => ("table3d", "parameters of the table", Uniform("Table3dParams")),
            Self::JointParams => ("joint", "parameters of the table", Uniform("JointParams")),
            Self::Surfaces => ("surfaces", "parameters of the surfaces", Uniform("Surfaces")),
            Self::RayParams => ("ray_params", "parameters of rays", Uniform("RayParams")),
            Self::UpsampleParams => ("upsample_params", "parameters of filters", Uniform("UpsampleParams")),
            Self::Block => ("block", "compressed block", Storage("u32")),
            Self::SourceCells => ("source_cells", "cells of the source", Storage("u32")),
            Self::Positions => ("positions", "positions", Storage("f32")),
            Self::Scalars => ("scalars", "scalars", Storage("f32")),
            Self::Vertices => ("vertices", "view vertices", Storage("ViewVertex")),
            Self::Records0 => ("records_0", "cells, first part", Storage("vec4<u32>")),
            Self::Records1 => ("records_1", "cells, second part", Storage("vec4<u32>")),
            Self::Records2 => ("records_2", "cells, third part", Storage("vec4<u32>")),
            Self::Corners => ("corners", "corners of the cells", Storage("vec4<u32>")),
            Self::Balls => ("balls", "radii of the points", Storage("vec2<f32>")),
            Self::Items => ("items", "entry faces", Storage("u32")),
            Self::ActiveCells => ("active_cells", "active cells", Storage("u32")),
            Self::Bins => ("bins", "lists of entries", Storage("u32")),
            Self::Table => ("table", "table", Storage("vec4<f32>")),
            Self::Counters => ("counters", "counters", Storage("u32")),
            Self::Drawn => ("drawn", "list of what is drawn", Storage("u32")),
            Self::Faces0 => ("faces_0", "faces, first part", Storage("u32")),
            Self::Faces1 => ("faces_1", "faces, second part", Storage("u32")),
            Self::Faces2 => ("faces_2", "faces, third part", Storage("u32")),
            Self::Lists => ("lists", "fragments of each pixel", Storage("u32")),
            Self::Fragments0 => ("fragments_0", "fragments, first part", Storage("vec2<u32>")),
            Self::Fragments1 => ("fragments_1", "fragments, second part", Storage("vec2<u32>")),
            Self::Rays => ("rays", "rays that contrast asks for", Storage("u32")),
            Self::Depths => ("depths", "layers of depth", Storage("u32")),
            Self::DepthRange => ("depth_range", "range of depths", Storage("f32")),
            Self::Args => ("args", "workgroups to start", Storage("u32")),
            Self::SeenColorPlane => ("color_plane", "colour of rays", Plane(Texel::Rgba32Float)),
            Self::SeenDepthPlane => ("depth_plane", "depth of rays", Plane(Texel::R32Float)),
            Self::SeenColor => ("seen_color", "colour of rays", Texture),
            Self::SeenDepth => ("seen_depth", "depth of rays", Texture),
            Self::ReferencePlane => ("reference_plane", "layers of depth, 0 to 1", Plane(Texel::Rgba32Float)),
            Self::Reference => ("reference", "layers of depth, 0 to 1", Texture),
            Self::SmallReference => ("small_reference", "layers of depth at the samples, 0 to 1", Texture),
            Self::LayerFragments => ("layer_fragments", "fragments of other layers", Texture),
            Self::FlowParams => ("flow_params", "parameters of the flow", Uniform("FlowParams")),
            Self::FlowSites => ("flow_sites", "sites of flow", Storage("vec4<f32>")),
            Self::FlowReady => ("flow_ready", "splats of flow in their order", Storage("u32")),
            Self::FlowRecords => ("flow_records", "splats of flow on the screen", Storage("vec4<f32>")),
            Self::FlowBins => ("bins", "lists of splats of flow", Storage("u32")),
            Self::FlowPlane => ("flow_plane", "splats of flow", Plane(Texel::Rgba32Float)),
            Self::FlowLists => ("flow_lists", "splats of flow", Texture),
            Self::FlowIcons => ("flow_icons", "icons of flow", Texture),
            Self::FlowInside => ("flow_inside", "depths inside of cells", Texture),
            Self::SmallColor => ("small_color", "colour of the small image", Texture),
            Self::SmallDepth => ("small_depth", "depth of the small image", Texture),
            Self::EnlargedPlane => ("color_plane", "colour before the filter", Plane(Texel::Rgba32Float)),
            Self::Enlarged => ("enlarged", "colour before the filter", Texture),
            Self::ColorPlane => ("color_plane", "colour", Plane(Texel::Rgba32Float)),
            Self::DepthPlane => ("depth_plane", "depth", Plane(Texel::R32Float)),
            Self::Color => ("color", "colour", Texture),
            Self::Screen => ("screen", "frame for the window", Plane(Texel::Rgba16Float)),
        }
    }

    /// Its name in the shaders.
    pub fn name(self) -> &'static str {
        self.described().0
    }

    /// Its label in messages.
    pub fn label(self) -> &'static str {
        self.described().1
    }

    /// Its kind and element type.
    pub fn kind(self) -> Kind {
        self.described().2
    }
}

/// Access of a stage to a resource. Uniforms and textures are read, planes written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binding {
    /// The stage reads it.
    Read(Resource),
    /// The stage reads and writes it; planes are only written.
    Write(Resource),
    /// The stage reads and writes it atomically.
    Atomic(Resource),
}

impl Binding {
    /// The resource.
    pub fn resource(self) -> Resource {
        match self {
            Self::Read(resource) | Self::Write(resource) | Self::Atomic(resource) => resource,
        }
    }
}

/// The variable's WGSL declaration, without group and binding number.
impl fmt::Display for Binding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.resource().name();
        match (self.resource().kind(), self) {
            (Kind::Uniform(of), _) => write!(f, "var<uniform> {name}: {of};"),
            (Kind::Storage(of), Self::Read(_)) => write!(f, "var<storage, read> {name}: array<{of}>;"),
            (Kind::Storage(of), Self::Write(_)) => write!(f, "var<storage, read_write> {name}: array<{of}>;"),
            (Kind::Storage(of), Self::Atomic(_)) => write!(f, "var<storage, read_write> {name}: array<atomic<{of}>>;"),
            (Kind::Texture, _) => write!(f, "var {name}: texture_2d<f32>;"),
            (Kind::Plane(texel), _) => write!(f, "var {name}: texture_storage_2d<{}, write>;", texel.name()),
        }
    }
}

/// The WGSL declarations of a stage's bindings, numbered in order.
pub fn declarations(bindings: &[Binding]) -> String {
    let line = |(number, binding)| format!("@group(0) @binding({number}) {binding}\n");
    bindings.iter().enumerate().map(line).collect()
}
