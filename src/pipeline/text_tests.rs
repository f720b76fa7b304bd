//! Round trips of requests through text, and invalid texts.

use super::*;
use crate::camera::{Camera, Projection};
use crate::moments::CovDenominator;
use crate::node_table::{JointTable, Node, NodeTable, TransferTable};
use crate::optics::OpticsKind;
use crate::pipeline::{Backend, DepthEdges, ImageScale, SampleSet, Sampling, TetDraw, TetLayer, UpsampleFilter};
use crate::render::KBuffer;
use crate::render::points::{Compositing, Footprint, PointStyle};
use crate::render::surfaces::{Cut, Isosurface, Light, Normals, SurfaceShading};
use crate::transfer::{
    BlendedEnsembles, ColorWeighting, Ensemble, Lengths, MappedRange, OpacityKind, TransferContent, TransferFunction,
    TransferSource,
};
use crate::visibility::Skip;
use glam::DVec3;
use proptest::prelude::*;
use std::collections::HashSet;
use std::num::NonZeroUsize;
use std::sync::Arc;

/// Any finite number, of all magnitudes.
fn number() -> impl Strategy<Value = f64> {
    use prop::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    NORMAL | SUBNORMAL | ZERO | POSITIVE | NEGATIVE
}

fn finite() -> impl Strategy<Value = f64> {
    number().prop_filter("finite", |x| x.is_finite())
}

fn camera() -> impl Strategy<Value = Camera> {
    let point = || prop::array::uniform3(finite()).prop_map(DVec3::from);
    let projection = prop_oneof![
        finite().prop_map(|view_angle| Projection::Perspective { view_angle }),
        finite().prop_map(|scale| Projection::Parallel { scale }),
    ];
    (point(), point(), point(), projection, finite()).prop_map(|(position, focal_point, view_up, projection, near)| {
        Camera { position, focal_point, view_up, projection, near }
    })
}

fn table() -> impl Strategy<Value = TransferTable> {
    let scalar = prop::collection::vec((finite(), prop::array::uniform4(0.0..=1.0_f64)), 1..9).prop_map(|mut nodes| {
        nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
        nodes.dedup_by_key(|node| node.0);
        let node = |(scalar, [r, g, b, tau]): (f64, [f64; 4])| Node { scalar, rgb: [r, g, b], tau: 1e3 * tau };
        TransferTable::from(Arc::new(NodeTable::new(nodes.into_iter().map(node).collect()).unwrap()))
    });
    let joint = prop::collection::vec(prop::array::uniform4(0.0..=1.0_f32), 12).prop_map(|values| {
        let table = JointTable::new(vec![-1.5, 0.1, 0.1], vec![0.0, 1e-3], vec![0.0, 7.25], values);
        TransferTable::from(Arc::new(table.unwrap()))
    });
    prop_oneof![scalar, joint]
}

/// An ensemble of one member with all optional entries.
fn ensemble(name: &str, weight: f64) -> Ensemble {
    let text = r#"{"name": "e", "members": [{"name": "m", "weight": 0.5, "range": "step", "map": {"points": [[0.25, 0.5]]},
        "function": {"transfer-function": {"color_map": "viridis", "points": [[0, 0.1], [1, 0.7]]}}}]}"#;
    let mut ensemble: Ensemble = serde_json::from_str(text).unwrap();
    (ensemble.name, ensemble.members[0].weight) = (name.to_owned(), weight);
    ensemble
}

fn formula() -> impl Strategy<Value = Arc<TransferSource>> {
    let function =
        (prop::sample::select(vec!["gray@0:0,1:1", "inferno@0:0,0.3:0.25,1:0.4"]), -3.0..0.0_f64, 1e-9..1e9_f64)
            .prop_map(|(text, lo, hi)| TransferContent::Function {
                function: TransferFunction::parse(text).unwrap(),
                range: MappedRange::new(lo, hi, false).unwrap(),
            });
    let known = prop_oneof![Just((-1.0, 0.1 + 0.2)), Just((0.0, f64::MAX))];
    let blended =
        (0.0..=1.0_f64, prop::option::of(0.0..=1.0_f64), ".{0,9}", known).prop_map(|(weight, share, name, series)| {
            let toward = share.map(|share| (ensemble("next", 1.0), share));
            let (ensemble, colors) = (ensemble(&name, weight), ColorWeighting::Opacity);
            TransferContent::Ensembles(Box::new(BlendedEnsembles { ensemble, toward, colors, series, step: series }))
        });
    (prop_oneof![function, blended], 1e-9..1e9_f64).prop_map(|(content, unit)| {
        Arc::new(TransferSource { content, kind: OpacityKind::Alpha, lengths: Lengths::of_unit_distance(unit) })
    })
}

fn draw() -> impl Strategy<Value = TetDraw> {
    let texts = ["error", "random", "global", "plain", "regular", "logarithmic:3", "greedy:40"];
    let named = prop::sample::select(texts.to_vec()).prop_map(|text| text.parse::<Sampling>().unwrap());
    let floored = (0.0..=1.0_f64).prop_map(|share| Sampling::Global(CovDenominator::Floored { share }));
    let faces = (0.0..=1.0_f64, prop_oneof![named, floored], 2..=32_u8, prop::bool::ANY).prop_map(
        |(lod, sampling, k, exact_order)| {
            TetDraw::Faces(FaceDetail { lod, sampling, k_buffer: KBuffer { k, exact_order } })
        },
    );
    let footprint = prop::sample::select(Footprint::ALL.to_vec());
    let compositing = prop::sample::select(Compositing::ALL.to_vec());
    let importance = prop::option::of((0.0..=1.0_f64).prop_map(|share| CovDenominator::Floored { share }));
    let flags = [prop::bool::ANY; 2];
    let points = (footprint, compositing, 1e-9..=8.0_f64, 0.0..=1.0_f64, flags, importance).prop_map(
        |(footprint, compositing, radius, lod, [exact_order, constant_scalar], importance)| {
            let style = PointStyle { footprint, compositing, radius, lod, exact_order, importance, constant_scalar };
            TetDraw::Points(style)
        },
    );
    prop_oneof![
        Just(TetDraw::Auto),
        Just(TetDraw::Raycast),
        Just(TetDraw::Reference),
        Just(TetDraw::Judge),
        faces,
        points
    ]
}

fn surfaces() -> impl Strategy<Value = (Vec<Isosurface>, Vec<Cut>, SurfaceShading)> {
    let rgb = || prop::option::of(prop::array::uniform3(0.0..=1.0_f64));
    let surface = (finite(), rgb(), rgb(), 0.0..=1.0_f64).prop_map(|(value, front, back, opacity)| Isosurface {
        value,
        front,
        back,
        opacity,
        by: None,
    });
    let normals = prop::sample::select(Normals::ALL.to_vec());
    let direction = prop::array::uniform3(finite()).prop_filter("a direction", |direction| *direction != [0.0; 3]);
    let light = prop_oneof![Just(Light::Headlight), direction.prop_map(Light::From)];
    let shading = (normals, light, prop::bool::ANY, prop::bool::ANY, prop::bool::ANY).prop_map(
        |(normals, light, volume, ambient_occlusion, smooth)| SurfaceShading {
            normals,
            light,
            volume,
            ambient_occlusion,
            smooth,
        },
    );
    let vector = || prop::array::uniform3(finite());
    let normal = vector().prop_filter("a normal", |normal| *normal != [0.0; 3]);
    let cut =
        (vector(), normal, prop::bool::ANY).prop_map(|(point, normal, clips)| Cut { point, normal, clips, by: None });
    (prop::collection::vec(surface, 0..4), prop::collection::vec(cut, 0..3), shading)
}

fn layer() -> impl Strategy<Value = Layer> {
    let field = prop::option::of(".{0,12}");
    let optics = prop::sample::select(OpticsKind::ALL.to_vec());
    (field, table(), prop::option::of(formula()), optics, surfaces(), prop::bool::ANY, draw()).prop_map(
        |(field, table, formula, optics, (surfaces, cuts, shading), volume, draw)| {
            let layer = TetLayer::new(table);
            Layer::Tets(TetLayer { field, formula, optics, surfaces, cuts, shading, volume, draw, ..layer })
        },
    )
}

fn time() -> impl Strategy<Value = FrameTime> {
    let between = (any::<usize>(), any::<usize>(), 0.0..1.0_f64);
    prop_oneof![any::<usize>().prop_map(FrameTime::from), between.prop_map(|(a, b, w)| FrameTime::between(a, b, w))]
}

fn upsampling() -> impl Strategy<Value = Upsampling> {
    let edges = (f64::MIN_POSITIVE..f64::MAX, 1..=3_usize);
    let edges = edges.prop_map(|(sigma_depth, layers)| DepthEdges { sigma_depth, layers });
    let joint = (1..=64_usize, edges.clone()).prop_map(|(kernel_px, edges)| UpsampleFilter::Joint { kernel_px, edges });
    let filter = prop_oneof![
        Just(UpsampleFilter::Nearest),
        Just(UpsampleFilter::Bilinear),
        joint,
        edges.prop_map(|edges| UpsampleFilter::Joint2x2 { edges }),
    ];
    (prop::sample::select(&ImageScale::ALL[..]), filter).prop_map(|(scale, filter)| Upsampling { scale, filter })
}

fn request() -> impl Strategy<Value = FrameRequest> {
    let backend = prop::sample::select(vec![Backend::Auto, Backend::Cpu, Backend::Gpu]);
    let skip = prop::sample::select(vec!["all", "none", "all,-opaque", "transparent-cells,outside"]);
    let layers = prop::collection::vec(layer(), 0..3);
    let lattice = |stride| SampleSet::Lattice { stride_px: NonZeroUsize::new(stride).unwrap() };
    let adaptive = |contrast: f32| SampleSet::Adaptive { contrast: contrast.try_into().unwrap() };
    let samples =
        prop_oneof![Just(SampleSet::All), (1..usize::MAX).prop_map(lattice), (0.0..=1.0_f32).prop_map(adaptive)];
    let pixels = prop::collection::hash_set(0..u32::MAX, 1..20);
    let samples = (samples, prop::option::of(pixels), prop::option::of(upsampling()));
    (time(), camera(), (1..400_000_usize, 1..9000_usize), layers, samples, backend, skip).prop_map(
        |(time, camera, size_px, layers, (samples, pixels, upsampling), backend, skip)| {
            let of_image = |pixels: HashSet<u32>| {
                let all = (size_px.0 * size_px.1) as u32;
                pixels.into_iter().map(|pixel| pixel % all).collect::<HashSet<u32>>().into_iter().collect()
            };
            let samples = pixels.map_or(samples, |pixels| SampleSet::Pixels(of_image(pixels)));
            let (skip, guides) = (skip.parse::<Skip>().unwrap(), layers.len() > 1);
            FrameRequest {
                time,
                camera,
                size_px,
                layers,
                samples,
                upsampling,
                guides,
                backend,
                skip,
                for_window: false,
                previews: Vec::new(),
                residual: None,
            }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_request_is_the_same_after_a_round_trip_and_so_is_its_text(request in request()) {
        let text = request.to_text().unwrap();
        let read = FrameRequest::from_text(&text).unwrap();
        prop_assert_eq!(read.to_text().unwrap(), text);
        prop_assert_eq!(read, request);
    }
}

/// A request with every property set.
fn plain() -> FrameRequest {
    let camera = Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap();
    let node = |scalar| Node { scalar, rgb: [0.5; 3], tau: 1.0 };
    let table = NodeTable::new(vec![node(0.0), node(1.0), node(2.0)]).unwrap();
    let request = FrameRequest::new(FrameTime::between(3, 4, 0.25), camera, Arc::new(table), (640, 480))
        .with_draw(TetDraw::Faces(FaceDetail { lod: 0.5, ..FaceDetail::ALL }));
    let filter = UpsampleFilter::Joint { kernel_px: 8, edges: DepthEdges::USUAL };
    FrameRequest { upsampling: Some(Upsampling { scale: ImageScale::Quarter, filter }), ..request }
}

fn refused(text: &str) -> String {
    FrameRequest::from_text(text).unwrap_err().to_string()
}

#[test]
fn what_is_not_said_is_as_by_default() {
    let text = r#"{"version": 2, "frame": {"time": {"step": 3}, "size_px": [8, 9],
        "camera": {"position": [1, 2, 3], "focal_point": [0, 0, 0], "view_up": [0, 0, 1], "projection": {"parallel": {"scale": 2}}, "near": 0},
        "layers": [{"tets": {"table": {"scalar": {"nodes": [{"scalar": 0, "rgb": [1, 1, 1], "tau": 1}]}}}}]}}"#;
    let read = FrameRequest::from_text(text).unwrap();
    let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0; 3], tau: 1.0 }]).unwrap();
    assert_eq!(read, FrameRequest::new(3, read.camera, Arc::new(table), (8, 9)));
}

#[test]
fn surfaces_of_regions_come_back_and_those_of_the_domain_are_written_and_read_as_before() {
    let with = |texts: &[&str]| {
        plain().with_tets(|tets| tets.domain = texts.iter().map(|text| text.parse().unwrap()).collect())
    };
    let request = with(&["solid:block=1,3..5:#ff8000:0.25", "edges"]);
    let text = request.to_text().unwrap();
    assert!(text.contains(r#"{"style":"solid","regions":"block=1,3..5","color":["#), "{text}");
    assert_eq!(FrameRequest::from_text(&text).unwrap(), request);
    let said = refused(&text.replace("block=1,3..5", "block"));
    assert!(said.contains("'block' is no choice of regions") && said.contains("line 1 column"), "{said}");
    let of_domain = with(&["wireframe"]);
    let text = of_domain.to_text().unwrap();
    assert!(text.contains(r#""domain":[{"style":"wireframe","opacity":1.0}]"#), "{text}");
    assert_eq!(FrameRequest::from_text(&text).unwrap(), of_domain);
}

#[test]
fn what_cannot_be_asked_for_is_refused_by_name_and_place() {
    let text = plain().to_text().unwrap();
    assert_eq!(FrameRequest::from_text(&text).unwrap(), plain());
    for (from, to, words) in [
        ("\"version\":2", "\"version\":1", &["version 1", "reads 2"][..]),
        ("\"version\":2,", "", &["version"]),
        ("[640,480]", "[0,480]", &["0 x 480 pixels"]),
        ("[640,480]", "[-1,480]", &["-1"]),
        ("\"tets\"", "\"points\"", &["points", "tets"]),
        ("\"surfaces\":[]", "\"surfaces\":[\"iso\"]", &["iso"]),
        ("\"surfaces\":[]", "\"surfaces\":[{\"value\":0,\"hue\":1}]", &["hue"]),
        ("\"normals\":\"cell\"", "\"normals\":\"face\"", &["face", "vertex"]),
        ("\"volume\":true", "\"volume\":true,\"more\":1", &["more"]),
        ("\"near\":0.0", "\"near\":NaN", &["line 1 column"]),
        ("\"near\":0.0", "\"near\":null", &["null"]),
        ("\"near\":0.0", "\"near\":1e999", &["out of range"]),
        ("\"scalar\":1.0", "\"scalar\":-1.0", &["node 1 lies before"]),
        ("\"scalar\":1.0", "\"scalar\":0.0,\"more\":0", &["more"]),
        ("\"tau\":1.0", "\"tau\":-1.0", &["node 0", "negative"]),
        ("\"scalar\":2.0", "\"scalar\":1e400", &["out of range"]),
        ("\"lod\":0.5", "\"lod\":1.5", &["a level of detail of 1.5"]),
        ("\"k\":8", "\"k\":1", &["a buffer of 1"]),
        ("[4,0.25]", "[4,1.0]", &["between steps 3 and 4 at 1"]),
        ("\"samples\":\"all\"", "\"samples\":\"some\"", &["some", "lattice"]),
        ("\"samples\":\"all\"", "\"samples\":{\"lattice\":{\"stride_px\":0}}", &["0", "nonzero"]),
        ("\"samples\":\"all\"", "\"samples\":{\"lattice\":{\"stride\":2}}", &["stride"]),
        ("\"scale\":\"1/4\"", "\"scale\":\"1/3\"", &["1/3", "1/8"]),
        ("\"kernel_px\":8", "\"kernel_px\":65", &["a kernel of 65", "1 to 64"]),
        ("\"sigma_depth\":0.01", "\"sigma_depth\":0", &["sigma", "above 0"]),
        ("\"layers\":3", "\"layers\":4", &["4 layers", "1 to 3"]),
        ("\"backend\":\"auto\"", "\"backend\":\"fpga\"", &["fpga"]),
        ("\"skip\":\"all\"", "\"skip\":\"everything\"", &["'everything' cannot be skipped"]),
    ] {
        assert!(text.contains(from), "{from}: {text}");
        let said = refused(&text.replacen(from, to, 1));
        assert!(words.iter().all(|word| said.contains(word)), "{to}: {said}");
        assert!(to.contains("version\":1") || said.contains("line 1 column"), "{to}: {said}");
    }
    let third = text.replace("\"scalar\":1.0", "\"scalar\":0.0").replace("\"scalar\":2.0", "\"scalar\":0.0");
    assert!(refused(&third).contains("node 2 is the third at one scalar"));
    let joint = Arc::new(JointTable::new(vec![0.0, 1.0], vec![0.0], vec![0.0], vec![[0.5; 4]; 2]).unwrap());
    let text = plain().with_tets(|tets| tets.table = joint.into()).to_text().unwrap();
    let said = refused(&text.replace("\"scalars\":[0.0,1.0]", "\"scalars\":[1.0,0.0]"));
    assert!(said.contains("place 1 of the Scalar axis") && said.contains("line 1 column"), "{said}");
    assert!(refused(&text[..text.len() - 1]).contains("EOF"));
}

#[test]
fn pixels_that_are_not_those_of_the_image_are_refused_by_their_place() {
    let listed = |pixels: &[u32]| FrameRequest { samples: SampleSet::Pixels(pixels.into()), ..plain() };
    let text = listed(&[307_199, 0]).to_text().unwrap();
    assert!(text.contains("\"samples\":{\"pixels\":[307199,0]}"), "{text}");
    assert_eq!(FrameRequest::from_text(&text).unwrap(), listed(&[307_199, 0]));
    for (pixels, words) in [
        ("[307200,0]", "pixel 307200 at place 0 of the list lies beyond an image of 640 x 480 pixels"),
        ("[7,307199,7]", "pixel 7 is at places 0 and 2"),
        ("[]", "no pixels"),
        ("[-1]", "-1"),
        ("[0.5]", "0.5"),
    ] {
        let said = refused(&text.replace("[307199,0]", pixels));
        assert!(said.contains(words), "{pixels}: {said}");
    }
    assert!(listed(&[1, 1]).to_text().unwrap_err().to_string().contains("at places 0 and 1"));
}

#[test]
fn a_request_that_could_not_be_read_has_no_text() {
    let no_text = |request: FrameRequest| request.to_text().unwrap_err().to_string();
    let mut request = plain();
    request.camera.position.y = f64::NAN;
    assert!(no_text(request).contains("frame.camera.position[1] is not finite"));
    let source = |unit_distance| TransferSource {
        content: TransferContent::Function {
            function: TransferFunction::parse("gray@0:1").unwrap(),
            range: MappedRange::new(0.0, 1.0, false).unwrap(),
        },
        kind: OpacityKind::Alpha,
        lengths: Lengths::new(unit_distance, 1.0),
    };
    let infinite = plain().with_tets(|tets| tets.formula = Some(Arc::new(source(f64::INFINITY))));
    assert!(no_text(infinite).contains("frame.layers[0].tets.formula.lengths.unit_distance is not finite"));
    assert!(no_text(FrameRequest { size_px: (3, 0), ..plain() }).contains("3 x 0 pixels"));
    let detail =
        |lod: f64, k| TetDraw::Faces(FaceDetail { lod, k_buffer: KBuffer { k, ..KBuffer::USUAL }, ..FaceDetail::ALL });
    assert!(no_text(plain().with_draw(detail(f64::NAN, 8))).contains("tets.draw.faces.lod is not finite"));
    assert!(no_text(plain().with_draw(detail(-0.5, 8))).contains("a level of detail of -0.5"));
    assert!(no_text(plain().with_draw(detail(0.5, 33))).contains("a buffer of 33"));
    let points = |radius, lod| TetDraw::Points(PointStyle { radius, lod, ..PointStyle::EXACT });
    assert!(no_text(plain().with_draw(points(9.0, 1.0))).contains("a point radius of 9"));
    assert!(no_text(plain().with_draw(points(1.0, 2.0))).contains("a level of detail of 2"));
    let of_surfaces = |surfaces: &[Isosurface]| plain().with_tets(|tets| tets.surfaces = surfaces.to_vec());
    assert!(no_text(of_surfaces(&[Isosurface::new(1.0); 33])).contains("33 isosurfaces"));
    assert!(no_text(of_surfaces(&[Isosurface::new(f64::NAN)])).contains("isovalues are finite"));
}

#[test]
fn a_series_without_a_finite_value_has_no_range_in_a_text() {
    let none = (f64::NAN, f64::NAN);
    let (ensemble, colors) = (ensemble("e", 1.0), ColorWeighting::Plain);
    let blended = BlendedEnsembles { ensemble, toward: None, colors, series: none, step: none };
    let content = TransferContent::Ensembles(Box::new(blended));
    let source = TransferSource { content, kind: OpacityKind::Alpha, lengths: Lengths::of_unit_distance(1.0) };
    let text = plain().with_tets(|tets| tets.formula = Some(Arc::new(source))).to_text().unwrap();
    let read = FrameRequest::from_text(&text).unwrap();
    let Some(TransferContent::Ensembles(blended)) = read.tets().unwrap().formula.as_ref().map(|f| &f.content) else {
        panic!("{text}");
    };
    assert!(blended.series.0.is_nan() && blended.step.1.is_nan());
    assert_eq!(read.to_text().unwrap(), text);
}

#[test]
fn what_does_not_change_the_picture_is_left_out_of_what_tells_pictures_apart() {
    let source = |unit: f64| {
        let range = MappedRange::new(0.0, 1.0, false).unwrap();
        let content = TransferContent::Function { function: TransferFunction::parse("gray@0:1").unwrap(), range };
        Some(Arc::new(TransferSource { content, kind: OpacityKind::Alpha, lengths: Lengths::of_unit_distance(unit) }))
    };
    let text = |request: &FrameRequest| request.clone().without_hints().to_text().unwrap();
    let of_formula = |unit| plain().with_tets(|tets| tets.formula = source(unit));
    for same in [
        FrameRequest { backend: Backend::Gpu, ..plain() },
        FrameRequest { skip: Skip::NONE, ..plain() },
        FrameRequest { for_window: true, ..plain() },
        of_formula(1.0),
    ] {
        assert_eq!(text(&same), text(&plain()));
    }
    assert_ne!(text(&plain().with_draw(TetDraw::Auto)), text(&plain()));
    let lit = |surfaces: &[Isosurface], normals| {
        let shading = SurfaceShading { normals, ..Default::default() };
        text(&plain().with_tets(|tets| (tets.surfaces, tets.shading) = (surfaces.to_vec(), shading)))
    };
    assert_eq!(lit(&[], Normals::Vertex), text(&plain()), "nothing is lit");
    let one = [Isosurface::new(0.5)];
    assert!(lit(&one, Normals::Vertex) != lit(&one, Normals::Cell) && lit(&one, Normals::Cell) != text(&plain()));
    let judged = [1.0, 2.0].map(|unit| text(&of_formula(unit).with_draw(TetDraw::Reference)));
    assert_ne!(judged[0], judged[1], "the judge looks at the formula");
}
