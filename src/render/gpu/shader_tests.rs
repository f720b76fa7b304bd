//! Every shader is compiled, and its structs compared with the Rust ones, without a GPU.

use super::layout::{
    self, FaceParams, JointParams, LayerLists, Lists, Params, RayLists, RayParams, SheetParams, SurfaceParams,
    UpsampleParams, VqStep,
};
use super::resources::{Binding, Kind};
use super::shaders::{
    FragmentKind, Gathering, Inside, Moment, Pass, Precision, RECORD_PARTS_MAX, RecordSplit, Stage, Valued, stages,
};
use crate::optics::OpticsKind;
use crate::optics::table3d::Table3dParams;
use std::mem::offset_of;

const SPLITS: [RecordSplit; 2] =
    [RecordSplit { parts: 1, shift: 22 }, RecordSplit { parts: RECORD_PARTS_MAX, shift: 10 }];

/// A compiled shader, with naga's analysis of it.
type Checked = (naga::Module, naga::valid::ModuleInfo);

/// Parses a shader and validates it for a WebGPU device without optional features.
fn parse(source: &str) -> Result<naga::Module, String> {
    parse_with(source, Precision::Single).map(|(module, _)| module)
}

fn parse_with(source: &str, precision: Precision) -> Result<Checked, String> {
    let optional = match precision {
        Precision::Single => naga::valid::Capabilities::empty(),
        Precision::Double => naga::valid::Capabilities::FLOAT64,
    };
    let capabilities = naga::valid::Capabilities::default() | optional;
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let info = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
        .validate(&module)
        .map_err(|e| e.emit_to_string(source))?;
    Ok((module, info))
}

fn parse_stage(stage: Stage, split: RecordSplit) -> Result<naga::Module, String> {
    parse_with(&stage.source(split), stage.precision()).map(|(module, _)| module)
}

fn module(stage: Stage) -> naga::Module {
    parse_stage(stage, SPLITS[0]).unwrap()
}

#[test]
fn every_shader_is_valid_and_has_its_entry_point() {
    let mut checked = 0;
    for stage in stages() {
        for split in SPLITS {
            let module = parse_stage(stage, split).unwrap_or_else(|e| panic!("{stage:?}, {split:?}: {e}"));
            let names: Vec<_> = module.entry_points.iter().map(|e| e.name.as_str()).collect();
            assert_eq!(names, [stage.name()]);
            checked += 1;
        }
    }
    assert_eq!(checked, 2 * 129);
    // Only those in f64 need a device that has it.
    let double = Stage::Walk(Gathering::Scalar(OpticsKind::Exact), Inside::Volume, Precision::Double).source(SPLITS[0]);
    assert!(parse(&double).is_err());
    // The check can fail.
    let broken = Stage::ViewTransform.source(SPLITS[0]).replacen("params.vertex_count", "params.vertices", 1);
    assert!(parse(&broken).is_err());
}

/// A variable that is bound.
#[derive(Debug, PartialEq)]
struct Bound {
    name: String,
    group: u32,
    number: u32,
    space: naga::AddressSpace,
    /// Whether some function writes it, if one uses it.
    is_written: Option<bool>,
}

/// The bindings of a compiled shader, in the order of their numbers.
fn bound((module, info): &Checked) -> Vec<Bound> {
    let functions = module.functions.iter().map(|(handle, _)| &info[handle]);
    let functions: Vec<_> = functions.chain([info.get_entry_point(0)]).collect();
    let entry = |(handle, global): (naga::Handle<_>, &naga::GlobalVariable)| {
        let naga::ResourceBinding { group, binding } = global.binding?;
        let used = functions.iter().fold(naga::valid::GlobalUse::empty(), |used, function| used | function[handle]);
        let is_written = (!used.is_empty()).then(|| used.contains(naga::valid::GlobalUse::WRITE));
        Some(Bound { name: global.name.clone()?, group, number: binding, space: global.space, is_written })
    };
    let mut found: Vec<_> = module.global_variables.iter().filter_map(entry).collect();
    found.sort_by_key(|bound| (bound.group, bound.number));
    found
}

/// The bindings that a stage describes, all of them in use.
fn described(stage: Stage) -> Vec<Bound> {
    let storage = |access| naga::AddressSpace::Storage { access };
    let entry = |(number, binding): (u32, Binding)| {
        let resource = binding.resource();
        let (space, is_written) = match (resource.kind(), binding) {
            (Kind::Uniform(_), Binding::Read(_)) => (naga::AddressSpace::Uniform, false),
            (Kind::Storage(_), Binding::Read(_)) => (storage(naga::StorageAccess::LOAD), false),
            (Kind::Storage(_), Binding::Write(_) | Binding::Atomic(_)) => {
                (storage(naga::StorageAccess::LOAD | naga::StorageAccess::STORE), true)
            }
            (Kind::Texture, Binding::Read(_)) => (naga::AddressSpace::Handle, false),
            (Kind::Plane(_), Binding::Write(_)) => (naga::AddressSpace::Handle, true),
            other => panic!("{stage:?}: {other:?}"),
        };
        Bound { name: resource.name().to_owned(), group: 0, number, space, is_written: Some(is_written) }
    };
    (0..).zip(stage.bindings()).map(entry).collect()
}

#[test]
fn shaders_bind_what_their_stages_describe_and_use_all_of_it() {
    for stage in stages() {
        for split in SPLITS {
            let checked = parse_with(&stage.source(split), stage.precision()).unwrap();
            assert_eq!(bound(&checked), described(stage), "{stage:?}, {split:?}");
        }
    }
    // The comparison notices another place, another access, one more, and what is not used or not written.
    let more = "@group(0) @binding(3) var<uniform> more: u32;\n";
    for (stage, from, to) in [
        (Stage::FaceScan, "@binding(1)", "@binding(5)"),
        (Stage::FaceScan, "@group(0) @binding(1)", "@group(1) @binding(1)"),
        (Stage::FaceScan, "fn add_up", &format!("{more}fn add_up")),
        (Stage::ViewTransform, "var<storage, read> positions", "var<storage, read_write> positions"),
        (Stage::DecodeVq(Moment::Step, Valued::Wholes), "scalars[i] = ", "let unused = "),
        (Stage::Present, "textureStore(screen, at.xy, textureLoad(color, at.xy, 0));", ""),
    ] {
        let source = stage.source(SPLITS[0]);
        let changed = source.replacen(from, to, 1);
        assert_ne!(changed, source);
        assert_ne!(bound(&parse_with(&changed, Precision::Single).unwrap()), described(stage), "{to}");
    }
}

#[test]
fn every_shader_keeps_within_the_default_limits_of_webgpu() {
    for stage in stages() {
        let module = module(stage);
        let storage = |g: &&naga::GlobalVariable| matches!(g.space, naga::AddressSpace::Storage { .. });
        let buffers = module.global_variables.iter().map(|(_, g)| g).filter(storage).count();
        assert!(buffers <= 8, "{stage:?}: {buffers} storage buffers");
        let threads: u32 = module.entry_points[0].workgroup_size.iter().product();
        assert!(threads <= 256, "{stage:?}: {threads} threads");
    }
}

/// Binary operators that WGSL's grammar does not let stand side by side without parentheses.
#[derive(Clone, Copy, PartialEq)]
enum Operator {
    Shift,
    And,
    Or,
    Xor,
    Arithmetic,
    Relation,
}

impl Operator {
    fn of(word: &str) -> Option<Self> {
        Some(match word {
            "<<" | ">>" => Self::Shift,
            "&" => Self::And,
            "|" => Self::Or,
            "^" => Self::Xor,
            "+" | "-" | "*" | "/" | "%" => Self::Arithmetic,
            "==" | "!=" | "<" | "<=" | ">" | ">=" => Self::Relation,
            _ => return None,
        })
    }

    /// Whether one may be an operand of the other: of relations, shifts and sums may. (Two shifts may not, either.)
    fn goes_with(self, other: Self) -> bool {
        let is_operand = |of: Self, a: Self| of == Self::Relation && matches!(a, Self::Shift | Self::Arithmetic);
        self == other && self != Self::Shift || is_operand(self, other) || is_operand(other, self)
    }
}

/// The first line in which operators are mixed as naga takes them and browsers do not ("WebGPU Shading Language", operator precedence
/// and associativity). Binary operators are those with spaces around them.
fn mixed_operators(source: &str) -> Option<&str> {
    // For each open parenthesis the operators of the expression in it.
    let mut open: Vec<Vec<Operator>> = vec![Vec::new()];
    for line in source.lines() {
        let code = line.split("//").next().unwrap_or_default();
        let innermost = "a parenthesis is closed that was not opened";
        let spaced: String =
            code.chars().map(|c| if "()[]{},;".contains(c) { format!(" {c} ") } else { c.to_string() }).collect();
        for word in spaced.split_whitespace() {
            match word {
                "(" | "[" => open.push(Vec::new()),
                ")" | "]" => drop(open.pop()),
                "," | ";" | "{" | "}" | "&&" | "||" => open.last_mut().expect(innermost).clear(),
                _ if word.ends_with('=') && Operator::of(word).is_none() => open.last_mut().expect(innermost).clear(),
                _ => {
                    if let Some(operator) = Operator::of(word) {
                        let others = open.last_mut().expect(innermost);
                        if others.iter().any(|&other| !operator.goes_with(other)) {
                            return Some(line);
                        }
                        others.push(operator);
                    }
                }
            }
        }
    }
    None
}

#[test]
fn operators_are_mixed_as_browsers_take_it() {
    for stage in stages() {
        for split in SPLITS {
            assert_eq!(mixed_operators(&stage.source(split)), None, "{stage:?}");
        }
    }
    assert_eq!(mixed_operators(include_str!("../../../shaders/picture.wgsl")), None);
    for refused in [
        "let a = b >> 4u & 15u;",
        "let a = b | c << 4u;",
        "let a = b\n    | c & d;",
        "if a & 1u == 0u {",
        "let a = b << c << d;",
        "let a = f(b + c, d + e >> 1u);",
        "let a = b << c + 1u;",
    ] {
        assert!(mixed_operators(refused).is_some(), "{refused}");
    }
    for taken in [
        "let a = (b >> 4u) & 15u;",
        "let a = b | (c << 4u) | d;",
        "if (a & 1u) == 0u && b < c + 1u {",
        "a |= b << 4u;",
        "let a: array<vec4<u32>, 4> = f(&b, -c); // b >> 4u & 15u",
        "let a = x[b >> 5u] + 1u;",
    ] {
        assert_eq!(mixed_operators(taken), None);
    }
}

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
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(FaceParams, $field))),*] };
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
    for stage in stages().filter(|stage| stage.name().starts_with("face")) {
        assert_eq!(members(&module(stage), "FaceParams"), (rust.clone(), size_of::<FaceParams>()), "{stage:?}");
        checked += 1;
    }
    assert_eq!(checked, 59);
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
    let walk = Stage::Walk(Gathering::Scalar(OpticsKind::Exact), Inside::Volume, Precision::Single);
    let resolve = Stage::FaceResolve(Gathering::Scalar(OpticsKind::Exact), Inside::Volume, Precision::Single);
    for (name, rust) in [
        ("TILE_PIXELS", layout::TILE_PIXELS as f64),
        ("FACE_WORDS", layout::FACE_WORDS as f64),
        ("EYE_WORDS", layout::EYE_WORDS as f64),
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
    let sort = |kind| value(Stage::FaceSort(kind), "FRAGMENT_PAIRS");
    let joint_pairs = layout::JOINT_FRAGMENT_BYTES as f64 / 8.0;
    assert_eq!(sort(FragmentKind::Joint), joint_pairs);
    assert_eq!(value(Stage::FaceSort(FragmentKind::Plain), "JOINT_PAIRS"), joint_pairs);
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
fn the_lists_of_rays_have_the_same_layout() {
    macro_rules! rust_offsets {
        ($($field:ident),* $(,)?) => { vec![$((stringify!($field).to_owned(), offset_of!(RayParams, $field))),*] };
    }
    let rust = rust_offsets!(contrast, listed_at, met_at, list_at, states_at);
    let walk = Stage::WalkRays(Gathering::Joint, Inside::Surfaces, Precision::Single);
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
        assert_eq!(members(&module, "FaceParams").1, size_of::<FaceParams>(), "{stage:?}");
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
        &module(Stage::Walk(Gathering::Scalar(OpticsKind::Table3d), Inside::Volume, Precision::Single)),
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
    for stage in [
        Stage::Walk(Gathering::Joint, Inside::Volume, Precision::Single),
        Stage::FaceResolve(Gathering::Joint, Inside::Volume, Precision::Single),
    ] {
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
        let inside = Inside::Surfaces;
        for stage in [Stage::Walk(how, inside, Precision::Single), Stage::FaceResolve(how, inside, Precision::Double)] {
            let (module, _) = parse_with(&stage.source(SPLITS[0]), stage.precision()).unwrap();
            assert_eq!(members(&module, "Surfaces"), (rust.clone(), size_of::<SurfaceParams>()), "{stage:?}");
            assert_eq!(members(&module, "Sheet"), (rust_sheet.clone(), size_of::<SheetParams>()), "{stage:?}");
        }
    }
}

/// Whether a function of a shader has statements.
fn is_empty(stage: Stage, function: &str) -> bool {
    let module = module(stage);
    let (_, found) = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some(function)).unwrap();
    found.body.iter().all(|statement| matches!(statement, naga::Statement::Return { .. }))
}

#[test]
fn frames_without_surfaces_have_none_of_their_code() {
    // What lies in lib/surfaces.wgsl, and in what goes with it.
    let of_surfaces = ["Surfaces", "Sheet", "surface_ray", "pass_sheets", "light_on", "clamp(scalar", "medium_part"];
    let has = |stage: Stage, name: &str| stage.source(SPLITS[0]).contains(name);
    for stage in stages() {
        let inside = match stage {
            Stage::Walk(_, inside, _) | Stage::WalkRays(_, inside, _) | Stage::FaceResolve(_, inside, _) => {
                Some(inside)
            }
            Stage::Faces(Pass::Store(_, inside), _)
            | Stage::FacePieces(Pass::Store(_, inside), _)
            | Stage::FaceStarts(Pass::Store(_, inside), _) => {
                assert_eq!(has(stage, "clamp(scalar"), inside == Inside::Surfaces, "{stage:?}");
                None
            }
            _ => None,
        };
        match inside {
            Some(Inside::Surfaces) => assert!(of_surfaces.iter().all(|name| has(stage, name)), "{stage:?}"),
            Some(Inside::Volume | Inside::Cells) => {
                assert!(!of_surfaces.iter().any(|name| has(stage, name)), "{stage:?}")
            }
            None => assert!(!of_surfaces[..5].iter().any(|name| has(stage, name)), "{stage:?}"),
        }
    }
    let walk = |inside| Stage::Walk(Gathering::Scalar(OpticsKind::Exact), inside, Precision::Single);
    assert!(is_empty(walk(Inside::Volume), "medium_ray") && !is_empty(walk(Inside::Surfaces), "medium_ray"));
    let reads_cells = |inside| has(walk(inside), "number_behind_vertices(cell)");
    assert_eq!(Inside::ALL.map(reads_cells), [false, false, true]);
    // With a joint table, the values of its rows too; and fragments have none.
    let joint = Stage::FaceResolve(Gathering::Joint, Inside::Cells, Precision::Single);
    let of_rows = "params.cell_count + 7u) / 8u * 8u + cell)";
    assert!(has(joint, of_rows) && !has(walk(Inside::Cells), of_rows));
    assert!(has(joint, &format!("FRAGMENT_PAIRS: u32 = {}u;", layout::FRAGMENT_BYTES / 8)));
}

#[test]
fn transfer_functions_of_the_scalar_do_nothing_for_a_joint_table() {
    // What they call is empty, and what fragments have is what they had.
    for optics in OpticsKind::ALL {
        for function in ["medium_begin", "medium_pass", "medium_cut"] {
            assert!(
                is_empty(Stage::Walk(Gathering::Scalar(optics), Inside::Volume, Precision::Single), function),
                "{optics}, {function}"
            );
        }
    }
    assert!(!is_empty(Stage::Walk(Gathering::Joint, Inside::Volume, Precision::Single), "medium_pass"));
    assert_eq!(FragmentKind::Plain.bytes(), layout::FRAGMENT_BYTES);
}
