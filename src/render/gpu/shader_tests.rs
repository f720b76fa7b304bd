//! Every shader is compiled, and held against what it says of itself, without a GPU.

use super::layout::{self};
use super::resources::{Binding, Kind};
use super::shaders::{
    Along, Element, FragmentKind, Gathering, Inside, Moment, OtherLayers, Pass, Precision, RECORD_PARTS_MAX,
    RecordSplit, Stage, Valued, stages,
};
use crate::optics::OpticsKind;

pub(super) const SPLITS: [RecordSplit; 2] =
    [RecordSplit { parts: 1, shift: 22 }, RecordSplit { parts: RECORD_PARTS_MAX, shift: 10 }];

/// A compiled shader, with naga's analysis of it.
type Checked = (naga::Module, naga::valid::ModuleInfo);

/// Parses a shader and validates it for a WebGPU device without optional features.
pub(super) fn parse(source: &str) -> Result<naga::Module, String> {
    parse_with(source, Precision::Single).map(|(module, _)| module)
}

pub(super) fn parse_with(source: &str, precision: Precision) -> Result<Checked, String> {
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

pub(super) fn module(stage: Stage) -> naga::Module {
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
    assert_eq!(checked, 2 * 288);
    // Only those in f64 need a device that has it.
    let exact = Along::cells(Gathering::Scalar(OpticsKind::Exact), Inside::Volume);
    let double = Stage::Walk(exact, Precision::Double).source(SPLITS[0]);
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
        (Stage::FragmentScan, "@binding(1)", "@binding(5)"),
        (Stage::FragmentScan, "@group(0) @binding(1)", "@group(1) @binding(1)"),
        (Stage::FragmentScan, "fn add_up", &format!("{more}fn add_up")),
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

/// Whether a function of a shader has statements.
fn is_empty(stage: Stage, function: &str) -> bool {
    let module = module(stage);
    let (_, found) = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some(function)).unwrap();
    found.body.iter().all(|statement| matches!(statement, naga::Statement::Return { .. }))
}

#[test]
fn frames_without_surfaces_have_none_of_their_code() {
    // What lies in lib/surfaces.wgsl, and in what goes with it.
    let of_surfaces = ["Surfaces", "Sheet", "surface_ray", "pass_sheets", "light_on", "clamp(scalar"];
    let has = |stage: Stage, name: &str| stage.source(SPLITS[0]).contains(name);
    for stage in stages() {
        let along = match stage {
            Stage::Walk(along, _) | Stage::WalkRays(along, _) | Stage::Resolve(_, along, _) => Some(along),
            Stage::Find(_, Pass::Store(_, inside), _)
            | Stage::FindPieces(_, Pass::Store(_, inside), _)
            | Stage::FaceStarts(Pass::Store(_, inside), _) => {
                assert_eq!(has(stage, "clamp(scalar"), inside == Inside::Surfaces, "{stage:?}");
                None
            }
            _ => None,
        };
        // Other layers cut segments, too.
        let is_cut = along.is_some_and(|along| along.layers != OtherLayers::None || along.inside == Inside::Surfaces);
        assert_eq!(has(stage, "fn medium_part"), is_cut, "{stage:?}");
        let layers = along.map_or(OtherLayers::None, |along| along.layers);
        assert_eq!(has(stage, "layer_fragments"), layers != OtherLayers::None, "{stage:?}");
        assert_eq!(has(stage, "flow_lists"), layers == OtherLayers::Flow, "{stage:?}");
        match along.map(|along| along.inside) {
            Some(Inside::Surfaces) => assert!(of_surfaces.iter().all(|name| has(stage, name)), "{stage:?}"),
            Some(Inside::Volume | Inside::Cells) => {
                assert!(!of_surfaces.iter().any(|name| has(stage, name)), "{stage:?}")
            }
            None => assert!(!of_surfaces[..5].iter().any(|name| has(stage, name)), "{stage:?}"),
        }
    }
    let exact = Gathering::Scalar(OpticsKind::Exact);
    let walk = |inside| Stage::Walk(Along::cells(exact, inside), Precision::Single);
    assert!(is_empty(walk(Inside::Volume), "medium_ray") && !is_empty(walk(Inside::Surfaces), "medium_ray"));
    let reads_cells = |inside| has(walk(inside), "number_behind_vertices(cell)");
    assert_eq!(Inside::ALL.map(reads_cells), [false, false, true]);
    // With a joint table, the values of its rows too; and fragments have none.
    let joint = Stage::Resolve(Element::Face, Along::cells(Gathering::Joint, Inside::Cells), Precision::Single);
    let of_rows = "params.cell_count + 7u) / 8u * 8u + cell)";
    assert!(has(joint, of_rows) && !has(walk(Inside::Cells), of_rows));
    assert!(has(joint, &format!("FRAGMENT_PAIRS: u32 = {}u;", layout::FRAGMENT_BYTES / 8)));
}

#[test]
fn transfer_functions_of_the_scalar_do_nothing_for_a_joint_table() {
    // What they call is empty, and what fragments have is what they had.
    for optics in OpticsKind::ALL {
        for function in ["medium_begin", "medium_pass", "medium_cut"] {
            let along = Along::cells(Gathering::Scalar(optics), Inside::Volume);
            assert!(is_empty(Stage::Walk(along, Precision::Single), function), "{optics}, {function}");
        }
    }
    let joint = Along::cells(Gathering::Joint, Inside::Volume);
    assert!(!is_empty(Stage::Walk(joint, Precision::Single), "medium_pass"));
    assert_eq!(FragmentKind::Plain.bytes(), layout::FRAGMENT_BYTES);
}
