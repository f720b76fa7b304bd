//! Files, checks, edits.

use super::*;
use crate::camera::Camera;
use crate::optics::OpticsKind;
use crate::pipeline::RenderMode;
use crate::render::flow::{FlowFidelity, FlowVolume};
use crate::render::surfaces::{Light, Normals};
use crate::timeline::{Key, Keyframed, Transition};
use crate::transfer::{Blend, ColorMap, ColorWeighting, Function, Member, RangeMap, RangePolicy, TransferFunction};
use glam::DVec3;
use proptest::prelude::*;
use std::path::{Path, PathBuf};

fn key<T>(time: f64, value: T) -> Key<T> {
    Key { time, transition: Transition::Linear, value }
}

fn keys<T>(keys: Vec<Key<T>>) -> Keyframed<T> {
    keys.try_into().unwrap()
}

fn member(name: &str, map: &str) -> Member {
    let tf = TransferFunction::ramp(ColorMap::built_in(map).unwrap().clone());
    Member::new(name, Function::TransferFunction(tf))
}

fn camera(x: f64) -> Camera {
    Camera { position: DVec3::new(x, -8.0, 3.0), ..Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap() }
}

/// A project with every setting.
fn whole() -> Project {
    let mut sharp = member("sharp", "viridis");
    (sharp.range, sharp.weight, sharp.blend) = (RangePolicy::LogManual(1e-3, 0.1 + 0.2), 1.0 / 3.0, Blend::Xor8);
    sharp.map = RangeMap::new(&[[0.1, 0.7], [0.2, 0.75]]).unwrap();
    let ensemble = |name: &str, members| Ensemble { name: name.into(), colors: ColorWeighting::Opacity, members };
    let mut project = Project::new(Data { source: "torso.zarr".into(), field: Some("v:mag".parse().unwrap()) });
    project.ensembles = vec![
        ensemble("overview", vec![member("all", "gray"), sharp]),
        ensemble("detail", vec![member("one", "turbo")]),
        ensemble("nothing", vec![]),
    ];
    project.look = LookSettings {
        ensemble: Some("overview".into()),
        unit_distance: Some(1e-3),
        lod: Some(0.5),
        iso: vec!["0.5:#ff0000:0.25".into(), "-2.5".into()],
        cut: vec!["point=0,0,1 normal=0,0,1 clip".into(), "point=0,0,0 normal=1,0,0".into()],
        crop: Some("min=-1,-1,-1 max=1,1,2.5".parse().unwrap()),
        regions: Some("block=0,2..3".parse().unwrap()),
        no_volume: Some(true),
        shade: Some(Normals::Vertex),
        light: Some(Light::From([0.0, 0.5, -1.0])),
        optics: Some(OpticsKind::Table3d),
        ..Default::default()
    };
    project.flow = Some(FlowSettings {
        field: "velocity".into(),
        icon: Some("lines,tiles/a, b.png@-2.5".parse().unwrap()),
        by: Some("v:0".parse().unwrap()),
        splats: Some(900),
        size: Some(0.7),
        length: Some(1.0 / 7.0),
        opacity: Some(0.4),
        speed: Some(1e3),
        rate: Some(0.0),
        fidelity: Some(FlowFidelity::Paper),
        volume: Some(FlowVolume::Splats),
        color: Some("velocity:mag@viridis".parse().unwrap()),
    });
    project.cameras = ["front", "from the left"]
        .map(|name| NamedCamera { name: name.into(), camera: camera(name.len() as f64) })
        .into();
    project.output = Output { size: Some("64x48".into()), duration: Some(2.5), ..Default::default() };
    project.playback.frames_per_second = 12.5;
    let cubic = Transition::Cubic { handles: [[0.25, 0.1], [0.3, 1.0]] };
    project.timeline = Timeline {
        colors: ColorWeighting::Opacity,
        ensembles: keys(vec![
            Key { transition: cubic, ..key(0.0, "overview".to_owned()) },
            Key { transition: Transition::Step { at: 0.3 }, ..key(1.0 / 3.0, "detail".to_owned()) },
            key(4.0, "overview".to_owned()),
        ]),
        maps: vec![MapTrack {
            ensemble: "overview".into(),
            member: "sharp".into(),
            keys: keys(vec![key(0.0, RangeMap::default()), key(2.0, RangeMap::new(&[[0.5, 0.1]]).unwrap())]),
        }],
        cameras: keys(vec![key(0.0, camera(0.1)), key(3.0, camera(5.0))]),
        lod: keys(vec![key(0.0, 0.1), key(1.0, 1.0)]),
        isovalue: keys(vec![key(0.5, -1.25), key(2.0, 3.5)]),
        iso_opacity: keys(vec![key(0.0, 1.0), key(2.0, 0.25)]),
        cut: keys(vec![key(0.0, -0.5), key(2.0, 0.25)]),
        flow: keys(vec![key(0.5, 0.0), key(2.0, 1.0)]),
        optics: keys(vec![key(2.0, OpticsKind::Exact)]),
    };
    project.check().unwrap();
    project
}

fn parse(text: &str) -> Result<Project, ProjectError> {
    Project::parse(text, Path::new("p.toml"))
}

#[test]
fn a_file_reads_back_as_the_same_project() {
    for project in [whole(), Project::new(Data { source: "a b.zarr".into(), field: None })] {
        let text = project.to_toml().unwrap();
        assert_eq!(parse(&text).unwrap(), project, "{text}");
        // The text is the same, too.
        assert_eq!(parse(&text).unwrap().to_toml().unwrap(), text);
    }
    let changed = whole().to_toml().unwrap().replace("0.30000000000000004", "0.3");
    assert_ne!(parse(&changed).unwrap(), whole(), "the last bit of a number counts");
}

#[test]
fn the_shortest_file_is_a_source() {
    let project = parse("version = 1\n[data]\nsource = \"x.zarr\"\n").unwrap();
    assert_eq!(project, Project::new(Data { source: "x.zarr".into(), field: None }));
}

#[test]
fn faults_of_a_file_are_named_with_their_line() {
    let text = whole().to_toml().unwrap();
    let line_of = |part: &str| 1 + text[..text.find(part).unwrap()].matches('\n').count();
    for (from, to, expected) in [
        ("weight = 0.3333333333333333", "wieght = 0.33", "wieght"),
        ("size = \"64x48\"", "siez = \"64x48\"", "siez"),
        ("lod = 0.5", "lod = \"half\"", "half"),
        ("optics = \"table3d\"", "optics = \"table4d\"", "table4d"),
        ("blend = \"xor8\"", "blend = \"nor\"", "nor"),
        ("position = [0.1, -8.0, 3.0]", "angle = 60\nposition = [0.1, -8.0, 3.0]", "angle"),
        ("position = [0.1, -8.0, 3.0]", "position = [0.1, -8.0, 3.0, 1.0]", "more values"),
        ("points = [[0.5, 0.1]]", "points = [[0.5, 0.1, 0.9]]", "more values"),
        ("weight = 0.3333333333333333", "weight = 1.8", "a weight of 1.8; it is a share, 0 to 1"),
        ("weight = 0.3333333333333333", "weight = -1", "a weight of -1"),
        ("weight = 0.3333333333333333", "weight = nan", "a weight of NaN"),
        ("lod = 0.5", "lod = 1.5", "a level of detail of 1.5"),
        ("icon = \"lines", "icons = \"lines", "unknown field `icons`, expected one of `field`, `icon`, `by`, `splats`"),
        ("icon = \"lines", "icon = \"fish", "fish"),
        ("color = \"velocity:mag@viridis\"", "color = \"velocity:mag@\"", "velocity:mag@"),
        ("handles = [[0.25, 0.1], [0.3, 1.0]]", "handles = [[0.25, 0.1], [0.3, 1.0], [1, 1]]", "more values"),
    ] {
        assert_eq!(text.matches(from).count(), 1, "{from} in {text}");
        let message = parse(&text.replace(from, to)).unwrap_err().to_string();
        assert!(message.contains("p.toml") && message.contains(expected), "{message}");
        assert!(message.contains(&format!("line {} ", line_of(from))), "{message}, of line {}", line_of(from));
    }
    let newer = parse("version = 2\n[data]\nsource = \"a\"\n[lights]\nsun = 1\n").unwrap_err().to_string();
    assert!(newer.contains("p.toml: version") && newer.contains("reads 1 to 1"), "{newer}");
    for bad in ["", "version = 1", "version = 2\n[data]\nsource = \"a\"", "version = 1\n[data]\nsource = 3", "\0", "[["]
    {
        let message = parse(bad).unwrap_err().to_string();
        assert!(message.contains("p.toml"), "{bad:?}: {message}");
    }
}

#[test]
fn colour_maps_are_built_in_or_stand_in_full() {
    let text = whole().to_toml().unwrap();
    assert!(parse(&text.replace("\"turbo\"", "\"turbo_r\"")).is_ok());
    let error = parse(&text.replace("\"turbo\"", "\"heat.json\"")).unwrap_err().to_string();
    assert!(error.contains("p.toml: line") && error.contains("'heat.json'") && error.contains("viridis"), "{error}");
    let full = "{ Name = \"ink\", ColorSpace = \"RGB\", RGBPoints = [0, 1, 1, 1, 1, 0.1, 0.1, 0.2] }";
    let inked = parse(&text.replace("\"turbo\"", full)).unwrap();
    assert_ne!(inked, whole());
    assert_eq!(parse(&inked.to_toml().unwrap()).unwrap(), inked);
}

#[test]
fn parts_that_do_not_belong_together_are_errors() {
    let broken = |change: fn(&mut Project)| {
        let mut project = whole();
        change(&mut project);
        let text = project.check().unwrap_err().to_string();
        assert!(parse(&project.to_toml().unwrap()).is_err(), "{text}");
        text
    };
    assert!(broken(|p| p.ensembles[1].name = "overview".into()).contains("overview"));
    assert!(broken(|p| p.ensembles[0].members[1].name = "all".into()).contains("all"));
    assert!(broken(|p| p.look.ensemble = Some("gone".into())).contains("overview, detail, nothing"));
    assert!(broken(|p| p.timeline.ensembles = keys(vec![key(0.0, "gone".to_owned())])).contains("gone"));
    assert!(broken(|p| p.timeline.maps[0].member = "gone".into()).contains("gone"));
    assert!(
        broken(|p| p.timeline.maps.push(p.timeline.maps[0].clone()))
            .contains("two tracks of range maps for the member 'sharp'")
    );
    assert!(broken(|p| p.timeline.lod = keys(vec![key(0.0, 1.5)])).contains("1.5"));
    assert!(broken(|p| p.timeline.isovalue = keys(vec![key(0.0, f64::NAN)])).contains("isovalues are finite"));
    assert!(broken(|p| p.timeline.iso_opacity = keys(vec![key(0.0, 1.5)])).contains("an opacity of 1.5"));
    assert!(broken(|p| p.look.iso.clear()).contains("no surface; add iso"));
    assert!(broken(|p| p.look.iso.push("warm".into())).contains("iso: 'warm' is no isovalue"));
    assert!(broken(|p| p.timeline.cut = keys(vec![key(0.0, f64::INFINITY)])).contains("distances are finite"));
    assert!(broken(|p| p.look.cut.clear()).contains("[look] has none; add cut"));
    assert!(broken(|p| p.look.cut.push("clip".into())).contains("cut: point= is missing"));
    let raycast = broken(|p| (p.look.mode, p.look.lod) = (Some(RenderMode::Raycast), None));
    assert!(
        broken(|p| (p.look.mode, p.timeline.lod) = (Some(RenderMode::Raycast), keys(vec![]))).contains("all cells")
    );
    assert!(raycast.contains("'raycast' always draws all cells") && raycast.contains("'havs'"), "{raycast}");
    assert!(
        broken(|p| {
            (p.look.mode, p.look.lod) = (Some(RenderMode::Reference), None);
            p.timeline.lod = keys(vec![key(0.0, 1.0)]);
            p.timeline.optics = keys(vec![key(2.0, OpticsKind::Partial)]);
        })
        .contains("has its own")
    );
    let opacity = broken(|p| p.timeline.flow = keys(vec![key(0.0, 1.0), key(7.0, 1.5)]));
    assert!(
        opacity.contains("[[timeline.flow]] has an opacity of 1.5 at time 7; it lies between 0 and 1"),
        "{opacity}"
    );
    assert!(broken(|p| p.timeline.flow = keys(vec![key(0.0, f64::NAN)])).contains("an opacity of NaN at time 0"));
    assert!(broken(|p| p.flow = None).contains("add [flow] with field"));
    assert!(broken(|p| p.playback.stride = 0).contains("stride"));
    assert!(broken(|p| p.playback.frames_per_second = 0.0).contains("speed of 0"));
    assert!(broken(|p| p.cameras[1].name = "front".into()).contains("two cameras 'front'"));
    assert!(broken(|p| p.cameras[1].name = "x=1".into()).contains("'x=1' is no name"));
    assert!(broken(|p| p.look.camera = Some("back".into())).contains("'back'; there are: front, from the left"));
    assert!(broken(|p| (p.cameras, p.look.camera) = (vec![], Some("back".into()))).contains("names none"));
    assert!(broken(|p| p.cameras[0].camera.near = -1.0).contains("the camera 'front': near"));
    let nowhere = |p: &mut Project| {
        let camera = camera(1.0);
        p.timeline.cameras = keys(vec![key(7.0, Camera { position: camera.focal_point, ..camera })]);
    };
    assert!(broken(nowhere).contains("time 7"));
}

#[test]
fn flow_that_cannot_be_is_an_error() {
    type Change = fn(&mut FlowSettings);
    let changes: [(Change, &str); 7] = [
        (|of| of.opacity = Some(1.5), "[flow]: flow has an opacity of 1.5; it lies between 0 and 1"),
        (|of| of.opacity = Some(f64::NAN), "an opacity of NaN"),
        (|of| of.size = Some(0.0), "a size of 0; it must be above zero"),
        (|of| of.length = Some(-1.0), "a length of -1"),
        (|of| of.speed = Some(f64::INFINITY), "a speed of inf"),
        (|of| of.rate = Some(-0.5), "a rate of -0.5"),
        (|of| of.splats = Some(0), "no splats"),
    ];
    for (change, expected) in changes {
        let mut project = whole();
        change(project.flow.as_mut().unwrap());
        let read = parse(&project.to_toml().unwrap()).unwrap_err().to_string();
        assert!(read.contains("p.toml") && read.contains(expected), "{read}");
    }
}

#[test]
fn writing_replaces_a_file_as_a_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.toml");
    whole().write(&path).unwrap();
    assert_eq!(Project::read(&path).unwrap(), whole());
    let mut bad = whole();
    bad.look.ensemble = Some("gone".into());
    assert!(bad.write(&path).is_err());
    assert_eq!(Project::read(&path).unwrap(), whole());
    let nowhere = PathBuf::from("/nowhere/p.toml");
    assert!(whole().write(&nowhere).unwrap_err().to_string().contains("/nowhere"));
    assert!(Project::read(&nowhere).unwrap_err().to_string().contains("/nowhere"));
}

/// Changes of all kinds, some of them invalid.
fn edits() -> impl Strategy<Value = Edit> {
    let at = 0..4_usize;
    let time = prop_oneof![Just(0.0), Just(1.0 / 3.0), Just(4.0), -5.0..5.0_f64, Just(f64::NAN)];
    let name = prop_oneof![Just("overview"), Just("detail"), Just("nothing"), Just("gone"), Just("new")];
    let member_name = prop_oneof![Just("all"), Just("sharp"), Just("other")];
    let camera_name = prop_oneof![Just("front"), Just("back"), Just("from the left"), Just("a=b"), Just("")];
    let new = |name: &str| Box::new(member(name, "inferno"));
    prop_oneof![
        name.clone()
            .prop_map(|n| Edit::SetLook(Box::new(LookSettings { ensemble: Some(n.into()), ..Default::default() }))),
        (at.clone(), name.clone()).prop_map(|(index, n)| Edit::RenameEnsemble { index, name: n.into() }),
        (at.clone(), name.clone()).prop_map(|(index, n)| {
            Edit::InsertEnsemble { index, ensemble: Ensemble { name: n.into(), ..Default::default() } }
        }),
        at.clone().prop_map(|index| Edit::RemoveEnsemble { index }),
        at.clone().prop_map(|ensemble| Edit::SetColors { ensemble, colors: ColorWeighting::Plain }),
        (at.clone(), at.clone(), member_name.clone()).prop_map(move |(ensemble, index, n)| Edit::InsertMember {
            ensemble,
            index,
            member: new(n)
        }),
        (at.clone(), at.clone(), member_name).prop_map(move |(ensemble, index, n)| Edit::SetMember {
            ensemble,
            index,
            member: new(n)
        }),
        (at.clone(), at.clone()).prop_map(|(ensemble, index)| Edit::RemoveMember { ensemble, index }),
        (at.clone(), at.clone(), at.clone()).prop_map(|(ensemble, from, to)| Edit::MoveMember { ensemble, from, to }),
        (time.clone(), name).prop_map(|(t, n)| Edit::Ensembles(TrackEdit::Insert(key(t, n.to_owned())))),
        (at.clone(), time.clone()).prop_map(|(index, time)| Edit::Ensembles(TrackEdit::Move { index, time })),
        at.clone().prop_map(|index| Edit::Ensembles(TrackEdit::Remove { index })),
        (at.clone(), 0.0..2.0_f64).prop_map(|(index, at)| Edit::Cameras(TrackEdit::SetTransition {
            index,
            transition: Transition::Step { at }
        })),
        (time.clone(), 0.0..1.2_f64).prop_map(|(t, lod)| Edit::Lod(TrackEdit::Insert(key(t, lod)))),
        (time.clone(), 0.0..1.2_f64).prop_map(|(t, opacity)| Edit::Flow(TrackEdit::Insert(key(t, opacity)))),
        Just(Edit::SetFlow(None)),
        (time.clone(), -9.0..9.0_f64).prop_map(|(t, value)| Edit::Isovalue(TrackEdit::Insert(key(t, value)))),
        (at.clone(), time)
            .prop_map(|(track, t)| Edit::Maps { track, edit: TrackEdit::Insert(key(t, RangeMap::default())) }),
        at.clone().prop_map(|index| Edit::RemoveMapTrack { index }),
        (at.clone(), camera_name.clone()).prop_map(|(index, name)| Edit::InsertCamera {
            index,
            camera: NamedCamera { name: name.into(), camera: camera(7.0) }
        }),
        (at.clone(), camera_name.clone()).prop_map(|(index, name)| Edit::RenameCamera { index, name: name.into() }),
        (at.clone(), 0.0..9.0_f64).prop_map(|(index, x)| Edit::SetCamera { index, camera: camera(x) }),
        at.prop_map(|index| Edit::RemoveCamera { index }),
        camera_name.prop_map(|name| {
            Edit::SetLook(Box::new(LookSettings {
                camera: Some(name.into()),
                iso: vec!["1".into()],
                ..Default::default()
            }))
        }),
    ]
}

proptest! {
    #[test]
    fn whatever_is_edited_stays_consistent_and_comes_back_from_its_text(edits in prop::collection::vec(edits(), 1..30)) {
        let mut project = whole();
        for edit in edits {
            let before = project.clone();
            if edit.apply(&mut project).is_err() {
                prop_assert_eq!(&project, &before, "what fails changes nothing");
            }
            prop_assert!(project.check().is_ok());
        }
        prop_assert_eq!(&parse(&project.to_toml().unwrap()).unwrap(), &project);
    }
}

#[test]
fn another_name_follows_everywhere() {
    let mut project = whole();
    Edit::RenameEnsemble { index: 0, name: "first".into() }.apply(&mut project).unwrap();
    let mut renamed = project.ensembles[0].members[1].clone();
    renamed.name = "keen".into();
    Edit::SetMember { ensemble: 0, index: 1, member: Box::new(renamed) }.apply(&mut project).unwrap();
    let text = project.to_toml().unwrap();
    assert!(!text.contains("\"overview\"") && !text.contains("\"sharp\""), "{text}");
    assert_eq!(text.matches("\"first\"").count(), 5, "its own, the look's, two keys', a track's");
}

#[test]
fn a_camera_is_found_by_its_name_which_the_look_follows() {
    let mut project = whole();
    project.look.camera = Some("front".into());
    Edit::RenameCamera { index: 0, name: "ahead".into() }.apply(&mut project).unwrap();
    assert_eq!(project.look.camera.as_deref(), Some("ahead"));
    assert_eq!(project.named_camera("ahead").unwrap(), Some(&camera(5.0)));
    assert_eq!(project.named_camera("angle=20").unwrap(), None);
    assert!(Edit::RemoveCamera { index: 0 }.apply(&mut project).is_err(), "the look names it");
    assert!(project.named_camera("front").unwrap_err().to_string().contains("there are: ahead, from the left"));
}

#[test]
fn edits_are_data() {
    let edit = Edit::Cameras(TrackEdit::Insert(key(0.5, camera(2.0))));
    let text = serde_json::to_string(&edit).unwrap();
    assert_eq!(serde_json::from_str::<Edit>(&text).unwrap(), edit);
}

#[test]
fn what_the_manual_shows_and_what_is_shipped_is_read() {
    let manual = include_str!("../../docs/projects.md");
    let block = manual.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let shown = Project::parse(block, Path::new("docs/projects.md")).unwrap();
    assert_eq!((shown.ensembles.len(), shown.timeline.cameras.keys().len()), (2, 1));
    let kept = include_str!("../../docs/transfer-functions.md").split("```toml\n").nth(1).unwrap();
    let kept = Project::parse(kept.split("```").next().unwrap(), Path::new("docs/transfer-functions.md")).unwrap();
    assert!(kept.ensembles[0].keeps_axes());
    let shipped = include_str!("../../data/projects/tornado.toml");
    let shipped = Project::parse(shipped, Path::new("data/projects/tornado.toml")).unwrap();
    assert_eq!((shipped.ensembles.len(), shipped.timeline.ensembles.keys().len()), (2, 2));
}

#[test]
fn files_of_flow_are_found_from_another_folder() {
    let flow = whole().flow.unwrap();
    let moved = flow.clone().with_paths(|file| Path::new("folder").join(file));
    assert_eq!(moved.icon.as_ref().unwrap().to_string(), "lines,folder/tiles/a, b.png@-2.5");
    let back = moved.with_paths(|file| file.strip_prefix("folder").unwrap().to_owned());
    assert_eq!(back, flow);
}

#[test]
fn every_range_of_a_member_that_the_manual_lists_is_read() {
    #[derive(Deserialize)]
    struct Shown {
        range: RangePolicy,
    }
    let manual = include_str!("../../docs/projects.md");
    let forms = manual.lines().find_map(|line| line.split_once("`range` (")).unwrap().1.split_once(')').unwrap().0;
    let read: Vec<RangePolicy> = forms
        .split('`')
        .skip(1)
        .step_by(2)
        .map(|form| toml::from_str::<Shown>(&format!("range = {form}")).unwrap_or_else(|e| panic!("{form}: {e}")).range)
        .collect();
    let all = [
        RangePolicy::Series,
        RangePolicy::Step,
        RangePolicy::Symmetric,
        RangePolicy::Log,
        RangePolicy::Manual(-1.0, 2.5),
        RangePolicy::LogManual(0.1, 10.0),
        RangePolicy::Percentile(1.0, 99.0),
        RangePolicy::SymmetricPercentile(1.0, 99.0),
    ];
    assert_eq!(read, all);
}
