//! Structs and constants of the shaders against the Rust ones, without a GPU.

use super::flow_layout::{FlowLists, FlowParams};
use super::layout::{
    self, JointParams, LayerLists, ListParams, Lists, Params, RayLists, RayParams, SheetParams, SurfaceParams,
    UpsampleParams, VqStep,
};
use super::point_params::{PointParams, point_flags};
use super::shader_tests::{SPLITS, module, parse, parse_with};
use super::shaders::{
    Along, Element, FLOW, FragmentKind, Gathering, Inside, OtherLayers, Pass, Precision, Stage, stages,
};
use crate::optics::OpticsKind;
use crate::optics::table3d::Table3dParams;
use std::mem::offset_of;

/// Name, offset and size of the members of a struct.
fn members(module: &naga::Module, name: &str) -> (Vec<(String, usize)>, usize) {
    let found = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
    let Some((_, naga::Type { inner: naga::TypeInner::Struct { members, span }, .. })) = found else {
        panic!("no struct {name}");
    };
    (members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect(), *span as usize)
}

#[test]
fn structs_have_the_same_layout_in_rust_and_in_the_shaders() {
    macro_rules! rust_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(Params, $field))),*] };
    }
    let rust = rust_offsets!(
        eye_hi,
        eye_lo,
        axes,
        pitch,
        depth_origin,
        scalar_offset,
        scalar_scale,
        size_px,
        tiles,
        image_px,
        stride_px,
        near,
        vertex_count,
        face_count,
        eye_count,
        item_count,
        pair_capacity,
        first_tile,
        flags,
        interval_count,
        pivot,
        cell_count,
        zero,
    );
    for stage in stages().filter(|stage| !matches!(stage, Stage::DecodeVq(..) | Stage::Present | Stage::SplitSlice)) {
        let (shader, span) = members(&module(stage), "Params");
        assert_eq!((&shader, span), (&rust, size_of::<Params>()), "{stage:?}");
    }
    // The comparison notices a renamed member.
    let renamed = Stage::ViewTransform.source(SPLITS[0]).replacen("item_count: u32,", "item_counts: u32,", 1);
    assert_ne!(members(&parse(&renamed).unwrap(), "Params").0, rust);
    let (_, span) = members(&module(Stage::ViewTransform), "ViewVertex");
    assert_eq!(span as u64, layout::VIEW_VERTEX_BYTES);
    macro_rules! step_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(VqStep, $field))),*] };
    }
    let rust_step = step_offsets!(
        count,
        row_8,
        row_64,
        means,
        exponents,
        first,
        second,
        per_word_log2,
        weight,
        zero,
        weight_before,
        unused,
    );
    for stage in stages().filter(|stage| matches!(stage, Stage::DecodeVq(..))) {
        assert_eq!(members(&module(stage), "VqStep"), (rust_step.clone(), size_of::<VqStep>()), "{stage:?}");
    }
}

#[test]
fn the_parameters_of_the_face_renderer_have_the_same_layout() {
    macro_rules! rust_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(ListParams, $field))),*] };
    }
    let rust = rust_offsets!(
        drawn_count,
        eye_count,
        first,
        end,
        first_tile,
        end_tile,
        first_pixel,
        end_pixel,
        face_part,
        fragment_part,
        piece_capacity,
        k,
        tie,
        flags,
        sort_mask,
        unused,
    );
    let mut checked = 0;
    for stage in stages().filter(|stage| ["face", "fragments"].iter().any(|begin| stage.name().starts_with(begin))) {
        assert_eq!(members(&module(stage), "ListParams"), (rust.clone(), size_of::<ListParams>()), "{stage:?}");
        checked += 1;
    }
    assert_eq!(checked, 165);
}

#[test]
fn the_parameters_of_points_have_the_same_layout() {
    macro_rules! rust_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(PointParams, $field))),*] };
    }
    let rust = rust_offsets!(enlarged_by, scale, radius, stands_for, least, flags, unused);
    let find = |element| Stage::Find(element, Pass::Count, Precision::Single);
    let resolve = Stage::Resolve(Element::Tet, Along::cells(Gathering::Joint, Inside::Volume), Precision::Single);
    for stage in [find(Element::Tet), find(Element::Slab), find(Element::Ball), resolve] {
        assert_eq!(members(&module(stage), "PointParams"), (rust.clone(), size_of::<PointParams>()), "{stage:?}");
        for (name, flag) in [
            ("SQUARE", point_flags::SQUARE),
            ("BALL", point_flags::BALL),
            ("SLABS", point_flags::SLABS),
            ("GAPS", point_flags::GAPS),
            ("AS_CELLS", point_flags::AS_CELLS),
        ] {
            assert_eq!(constant(&module(stage), name), f64::from(flag), "{name}");
        }
    }
}

/// A constant of a shader.
fn constant(module: &naga::Module, name: &str) -> f64 {
    let (_, constant) = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name)).unwrap();
    match module.global_expressions[constant.init] {
        naga::Expression::Literal(naga::Literal::U32(v)) => f64::from(v),
        naga::Expression::Literal(naga::Literal::F32(v)) => f64::from(v),
        ref other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn constants_are_the_same_in_rust_and_in_the_shaders() {
    let value = |stage: Stage, name: &str| constant(&module(stage), name);
    let along = Along::cells(Gathering::Scalar(OpticsKind::Exact), Inside::Volume);
    let walk = Stage::Walk(along, Precision::Single);
    let resolve = Stage::Resolve(Element::Face, along, Precision::Single);
    for (name, rust) in [
        ("TILE_PIXELS", layout::TILE_PIXELS as f64),
        ("FACE_WORDS", layout::FACE_WORDS as f64),
        ("EYE_WORDS", layout::EYE_WORDS as f64),
        ("POINT_EYE_WORDS", layout::POINT_EYE_WORDS as f64),
        ("FRAGMENT_PAIRS", layout::FRAGMENT_BYTES as f64 / 8.0),
        ("PIECE_WORDS", layout::PIECE_WORDS as f64),
        ("DEEP", f64::from(layout::DEEP)),
        ("LISTS_HEAD", Lists::HEAD as f64),
        ("COMPLETE", f64::from(layout::flags::COMPLETE)),
        ("EXACT_ORDER", f64::from(layout::flags::EXACT_ORDER)),
        ("COUNTERS", layout::COUNTERS as f64),
    ] {
        assert_eq!(value(resolve, name), rust, "{name}");
    }
    let sort = |kind| value(Stage::FragmentSort(Element::Face, kind), "FRAGMENT_PAIRS");
    let joint_pairs = layout::JOINT_FRAGMENT_BYTES as f64 / 8.0;
    assert_eq!(sort(FragmentKind::Joint), joint_pairs);
    assert_eq!(value(Stage::FragmentSort(Element::Face, FragmentKind::Plain), "JOINT_PAIRS"), joint_pairs);
    assert_ne!(sort(FragmentKind::Plain), joint_pairs);
    for (name, rust) in [
        ("TILE_PX", layout::TILE_PX as f64),
        ("PAIR_WORDS", layout::PAIR_WORDS as f64),
        ("PLANE_SCALE", layout::PLANE_SCALE),
        ("PERSPECTIVE", f64::from(layout::flags::PERSPECTIVE)),
        ("EARLY_TERMINATION", f64::from(layout::flags::EARLY_TERMINATION)),
        ("ALL_ACTIVE", f64::from(layout::flags::ALL_ACTIVE)),
        ("COUNTERS", layout::COUNTERS as f64),
        ("NOWHERE", f64::from(layout::FAR)),
        ("OPAQUE", f64::from(crate::optics::OPAQUE_TRANSMITTANCE)),
        ("NONE", f64::from(crate::mesh::NONE)),
    ] {
        assert_eq!(value(walk, name), rust, "{name}");
    }
}

#[test]
fn lists_in_textures_have_the_same_layout() {
    let cells = Along::cells(Gathering::Scalar(OpticsKind::Exact), Inside::Volume);
    let walk = |layers| module(Stage::Walk(Along { layers, ..cells }, Precision::Single));
    let of_flow = walk(OtherLayers::Flow);
    for module in [&walk(OtherLayers::Fragments), &of_flow] {
        assert_eq!(constant(module, "TEXELS_WIDE"), layout::TEXELS_WIDE as f64);
        assert_eq!(constant(module, "COUNT_BASE"), f64::from(layout::COUNT_BASE));
    }
    #[cfg(feature = "gpu")]
    for (name, rust) in crate::render::flow::constants_of_drawing() {
        assert_eq!(constant(&of_flow, name) as f32, rust as f32, "{name}");
    }
}

#[test]
fn what_the_stages_of_flow_are_given_has_the_same_layout() {
    macro_rules! rust_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(FlowParams, $field))),*] };
    }
    let rust = rust_offsets!(head, periods, size, opacity, fades, splat_count, splat_words, place_capacity);
    let [project, count, _, store, sort] = FLOW.map(module);
    for module in [&project, &count, &store, &sort] {
        assert_eq!(members(module, "FlowParams"), (rust.clone(), size_of::<FlowParams>()));
        for (name, rust) in [
            ("FLOW_HEAD", FlowLists::HEAD_TEXELS as f64),
            ("SPLAT_TEXELS", FlowLists::SPLAT_TEXELS as f64),
            ("PLACE_TEXELS", FlowLists::PLACE_TEXELS as f64),
            ("RECORD_VECTORS", FlowLists::RECORD_BYTES as f64 / 16.0),
            ("END", crate::render::flow::END),
        ] {
            assert_eq!(constant(module, name), rust, "{name}");
        }
    }
    #[cfg(feature = "gpu")]
    for (name, rust) in crate::render::flow::constants_of_projecting() {
        assert_eq!(constant(&project, name), rust, "{name}");
    }
    for module in [&store, &sort] {
        assert_eq!(constant(module, "BINS_HEAD"), FlowLists::BINS_HEAD as f64);
    }
    assert_eq!(constant(&sort, "LONGEST"), f64::from(FlowLists::LONGEST));
}

#[test]
fn the_lists_of_rays_have_the_same_layout() {
    macro_rules! rust_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(RayParams, $field))),*] };
    }
    let rust = rust_offsets!(contrast, listed_at, met_at, list_at, states_at);
    let walk = Stage::WalkRays(Along::cells(Gathering::Joint, Inside::Surfaces), Precision::Single);
    for stage in [walk, Stage::SplitDecide, Stage::SplitAppend, Stage::Fill] {
        assert_eq!(members(&module(stage), "RayParams"), (rust.clone(), size_of::<RayParams>()), "{stage:?}");
    }
    let slice = module(Stage::SplitSlice);
    for (name, rust) in [
        ("LISTED", RayLists::LISTED),
        ("STEP", RayLists::STEP),
        ("IS_DONE", RayLists::IS_DONE),
        ("PAIRS", RayLists::PAIRS),
        ("GROUPS_LEFT", RayLists::GROUPS_LEFT),
        ("GROUPS_DONE", RayLists::GROUPS_DONE),
        ("RAYS_BY_LEVEL", RayLists::RAYS_BY_LEVEL),
        ("BLOCKS", RayLists::BLOCKS),
        ("SUMS", RayLists::SUMS),
        ("LAST_STEP", RayLists::STEPS),
        ("GROUP_RAYS", RayLists::GROUP_RAYS),
    ] {
        assert_eq!(constant(&slice, name), rust as f64, "{name}");
    }
    // What stays from contrast to contrast comes first, and sums of two words last.
    assert!(["LISTED", "COUNTED", "CAST"].into_iter().all(|name| constant(&slice, name) < RayLists::STEP as f64));
    assert_eq!(RayLists::HEAD, RayLists::SUMS + 2 * layout::COUNTERS);
}

#[test]
fn what_depth_layers_and_filters_are_given_has_the_same_layout() {
    macro_rules! rust_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(UpsampleParams, $field))),*] };
    }
    let rust = rust_offsets!(small_px, samples_per_pixel, half_px, domain_per_square, reference_per_square, unused);
    let mut checked = 0;
    for stage in stages().filter(|stage| stage.name().starts_with("upsample")) {
        let found = members(&module(stage), "UpsampleParams");
        assert_eq!(found, (rust.clone(), size_of::<UpsampleParams>()), "{stage:?}");
        checked += 1;
    }
    assert_eq!(checked, 5);
    for stage in [Stage::LayersPlan, Stage::LayersRange, Stage::LayersReference] {
        let module = module(stage);
        assert_eq!(members(&module, "ListParams").1, size_of::<ListParams>(), "{stage:?}");
        for (name, rust) in [
            ("PIECE_COUNT", LayerLists::PIECE_COUNT),
            ("PIECES_FROM", LayerLists::PIECES_FROM),
            ("PIECES_TO", LayerLists::PIECES_TO),
            ("LISTS_HEAD", LayerLists::HEAD as usize),
        ] {
            assert_eq!(constant(&module, name), rust as f64, "{name}");
        }
    }
    let missing = constant(&module(Stage::LayersReference), "MISSING");
    assert_eq!(missing, f64::from(crate::render::cpu::layers::MISSING));
    let joint2x2 = module(Stage::UpsampleJoint2x2);
    assert_eq!(constant(&joint2x2, "LEAST_SUM") as f32, crate::image::upsample::LEAST_SUM);
    assert_eq!(constant(&joint2x2, "COUNTERS"), layout::COUNTERS as f64);
}

#[test]
fn the_parameters_of_the_pre_integrated_table_have_the_same_layout() {
    macro_rules! rust_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(Table3dParams, $field))),*] };
    }
    let rust = rust_offsets!(
        below,
        above,
        scalar_lo,
        scalar_lo_rest,
        scalar_hi,
        scalar_hi_rest,
        intervals_per_scalar,
        length_max,
        scalars,
        lengths,
    );
    let shader = members(
        &module(Stage::Walk(Along::cells(Gathering::Scalar(OpticsKind::Table3d), Inside::Volume), Precision::Single)),
        "Table3dParams",
    );
    assert_eq!(shader, (rust, size_of::<Table3dParams>()));
}

#[test]
fn the_parameters_of_a_grid_have_the_same_layout() {
    macro_rules! rust_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(JointParams, $field))),*] };
    }
    let rust = rust_offsets!(
        scalar_intervals,
        scalar_count,
        row_intervals,
        row_count,
        values,
        columns,
        layer_values,
        cells,
        cell_count,
    );
    let joint = Along::cells(Gathering::Joint, Inside::Volume);
    for stage in [Stage::Walk(joint, Precision::Single), Stage::Resolve(Element::Face, joint, Precision::Single)] {
        assert_eq!(members(&module(stage), "JointParams"), (rust.clone(), size_of::<JointParams>()), "{stage:?}");
    }
}

#[test]
fn the_parameters_of_surfaces_have_the_same_layout() {
    macro_rules! rust_offsets {
        ($of:ident: $($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!($of, $field))),*] };
    }
    let rust = rust_offsets!(SurfaceParams: light, count, normals, is_headlight, gradients, has_volume, sheets);
    let rust_sheet = rust_offsets!(SheetParams: front, back);
    for how in Gathering::ALL {
        let along = Along::cells(how, Inside::Surfaces);
        for stage in [Stage::Walk(along, Precision::Single), Stage::Resolve(Element::Face, along, Precision::Double)] {
            let (module, _) = parse_with(&stage.source(SPLITS[0]), stage.precision()).unwrap();
            assert_eq!(members(&module, "Surfaces"), (rust.clone(), size_of::<SurfaceParams>()), "{stage:?}");
            assert_eq!(members(&module, "Sheet"), (rust_sheet.clone(), size_of::<SheetParams>()), "{stage:?}");
        }
    }
}
