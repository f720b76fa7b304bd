//! Flow in a session.

use super::desk::Desk;
use super::tracks::{KeyAction, KeyValue, Track};
use super::worker::tests::wait_for;
use super::{Action, NoticeKind};
use crate::calculator::calculated;
use crate::ingest::{IngestOptions, ingest};
use crate::look::FlowLook;
use crate::pipeline::{FlowLayer, FrameRequest, Pipeline, ResidualBase, ResidualRequest, SampleSet, Series};
use crate::playback::{Command, Mode};
use crate::render::flow::{FlowIcons, FlowStyle, Icon, IconName, Thresholds};
use crate::render::surfaces::ByField;
use crate::store::Store;
use crate::synth::{SeriesName, SynthSpec, generate};
use crate::task::{Cancel, Silent};
use std::sync::Arc;

/// The flow of the picture on the screen.
fn flow(desk: &Desk) -> Option<FlowLayer> {
    desk.shown().request.layers.iter().find_map(|layer| layer.flow()).cloned()
}

/// A session of a tornado with flow, whose usual rate is known.
fn desk() -> Desk {
    let mut desk = Desk::open();
    desk.settle();
    assert_eq!(flow(&desk), None);
    desk.act(Action::ToggleFlow);
    wait_for("rate of the flow", || {
        desk.session.tick(desk.now);
        desk.session.flow_rate()
    });
    desk.settle();
    desk
}

#[test]
fn a_held_step_flows_on_and_a_played_one_is_blurred_until_the_next() {
    let mut desk = desk();
    let (usual, pixels) = (desk.session.flow_rate().unwrap(), desk.shown().frame.planes.color.clone());
    assert!(usual > 0.0);
    assert_eq!(flow(&desk).map(|flow| (flow.field, flow.held)), Some(("velocity".to_owned(), 0.0)));
    desk.settle();
    let mut held = 0.0;
    for ms in [20, 40, 5000] {
        desk.later(ms);
        assert!(desk.settle() > 0, "{ms}");
        let flow = flow(&desk).unwrap();
        // What is late jumps no farther than a quarter of a second.
        let way = usual * (0.001 * ms as f64).min(0.25);
        held += way;
        // A few roundings of times below a second.
        assert!((flow.shutter / way - 1.0).abs() < 1e-12 && (flow.held / held - 1.0).abs() < 1e-12, "{flow:?} {way}");
    }
    assert!(desk.shown().frame.planes.color != pixels, "patterns moved");
    let (is_new, wait) = desk.session.tick(desk.now);
    assert!(!is_new && wait.is_some_and(|wait| wait.as_millis() < 20), "it goes on by itself: {wait:?}");
    // The frame on the screen stays as it is when playing begins: further ones are blurred.
    for command in [Command::Step(1), Command::Play, Command::Pause, Command::SeekStep(0), Command::Step(1)] {
        desk.act(Action::Play(command));
        desk.settle();
        assert_eq!(flow(&desk).map(|flow| (flow.held, flow.shutter)), Some((0.0, 0.0)), "{command:?}");
    }
    // Of a frame that is played, the pattern is averaged until the next step.
    let times = desk.session.series().times().values.clone();
    desk.act(Action::Play(Command::Play));
    desk.later(40);
    desk.settle();
    assert_eq!((desk.step(), desk.session.state().playing), (2, true));
    assert_eq!(flow(&desk).map(|flow| (flow.held, flow.shutter)), Some((0.0, times[3] - times[2])));
    desk.act(Action::Play(Command::Pause));
    desk.settle();
    assert_eq!((desk.step(), flow(&desk).unwrap().shutter), (2, 0.0), "at rest it is sharp");
    // At a rate of zero a held step stands still.
    let still = FlowLook { rate: Some(0.0), ..desk.session.look().flow.clone().unwrap() };
    desk.act(Action::Flow(Some(Box::new(still))));
    desk.settle();
    desk.later(1000);
    desk.settle();
    desk.later(100);
    assert_eq!((desk.settle(), flow(&desk).unwrap().held), (0, 0.0));
}

#[test]
fn frames_that_are_played_are_open_for_the_nominal_time_of_a_frame_and_the_last_one_closes() {
    let mut desk = desk();
    let times = desk.session.series().times().clone();
    let shutter = |desk: &Desk| flow(desk).unwrap().shutter;
    desk.act(Action::Play(Command::Stride(2)));
    desk.act(Action::Play(Command::Play));
    desk.settle();
    desk.later(40);
    desk.settle();
    // The end of what is played: it stands still.
    assert_eq!((desk.step(), desk.session.state().playing, shutter(&desk)), (2, false, 0.0));
    let speed = 20.0;
    let real_time = [Command::Mode(Mode::RealTime), Command::Interpolate(true), Command::Speed(speed)];
    for command in [Command::Stride(1)].into_iter().chain(real_time) {
        desk.act(Action::Play(command));
    }
    desk.act(Action::Play(Command::SeekStep(0)));
    desk.settle();
    assert_eq!(shutter(&desk), 0.0);
    desk.act(Action::Play(Command::Play));
    // Within the first interval.
    desk.later((0.3 * (times.values[1] - times.values[0]) / speed * 1e3) as u64);
    desk.settle();
    assert!(desk.session.state().playing && desk.shown().request.time.toward().is_some());
    assert_eq!(shutter(&desk), speed / 25.0);
    // Frames that are compared with another view's are as at rest.
    desk.session.share(2, true);
    desk.settle();
    assert_eq!(shutter(&desk), 0.0);
}

#[test]
fn a_flow_that_fades_on_the_timeline_is_drawn_so_until_another_opacity_is_chosen() {
    let mut desk = desk();
    desk.act(Action::FlowOpacity(0.5));
    desk.settle();
    let add = Action::Keys(KeyAction::Add(Track::Flow));
    desk.act(add.clone());
    desk.act(Action::Play(Command::SeekStep(2)));
    desk.act(add);
    desk.act(Action::Keys(KeyAction::SetValue(KeyValue::Number(0.0))));
    desk.settle();
    let shown = |desk: &Desk| (flow(desk).unwrap().style.opacity, desk.shown().frame.stats.flow_splats);
    assert_eq!(shown(&desk), (0.0, 0));
    let (held, wait) = (desk.settle(), desk.session.tick(desk.now).1);
    assert!(held == 0 && wait.is_none_or(|wait| wait.as_millis() > 20), "nothing that is seen goes on: {wait:?}");
    desk.act(Action::Play(Command::SeekStep(1)));
    desk.settle();
    let (opacity, splats) = shown(&desk);
    assert!(opacity > 0.1 && opacity < 0.4 && splats > 0, "{opacity} {splats}");
    assert_eq!(desk.session.value_shown(Track::Flow), Ok(KeyValue::Number(opacity)));
    // The user's own holds at all times, until the timeline's is asked for again.
    desk.act(Action::FlowOpacity(0.75));
    desk.act(Action::FlowOpacity(f64::NAN));
    desk.settle();
    assert_eq!((shown(&desk).0, desk.session.value_shown(Track::Flow)), (0.75, Ok(KeyValue::Number(0.75))));
    desk.act(Action::Keys(KeyAction::Select(Track::Flow, 1)));
    desk.settle();
    assert_eq!(shown(&desk), (0.0, 0));
    // Hidden flow whose opacity has keys stays in the project.
    desk.act(Action::ToggleFlow);
    desk.settle();
    let saved = desk.session.to_project("a.toml".as_ref());
    assert!(flow(&desk).is_none() && saved.flow.is_some() && saved.check().is_ok());
    (0..3).for_each(|_| desk.act(Action::Undo));
    assert_eq!(desk.session.project().timeline.flow.number(1e9), Some(0.0), "keys are undone as others are");
}

#[test]
fn flow_is_switched_changed_coloured_and_undone() {
    let mut desk = desk();
    let style = FlowStyle { size: 0.9, ..FlowStyle::default() };
    desk.act(Action::Flow(Some(Box::new(FlowLook::new("velocity".to_owned(), style)))));
    desk.act(Action::NextIcon);
    desk.settle();
    assert_eq!(flow(&desk).unwrap().style, FlowStyle { icon: Icon::Lines, ..style });
    (0..3).for_each(|_| desk.act(Action::NextIcon));
    assert_eq!(desk.session.look().flow.as_ref().unwrap().layer.style, style);
    let by: ByField = "velocity:mag@viridis".parse().unwrap();
    desk.act(Action::FlowColors(Some(by.clone())));
    wait_for("colours", || {
        desk.session.tick(desk.now);
        desk.session.look().flow.as_ref().unwrap().layer.colors.clone()
    });
    desk.settle();
    let colors = flow(&desk).unwrap().colors.unwrap().colors;
    let bar = desk.session.flow_bar().unwrap();
    assert_eq!(bar.title, "velocity:mag");
    for position in [0.0, 0.25, 1.0] {
        let [shown, drawn] = [bar.map.eval(position), colors.eval(bar.range.scalar_at(position)).rgb];
        // Both are linear between the same nodes, at places that differ by roundings.
        assert!((0..3).all(|c| (shown[c] - drawn[c]).abs() < 1e-9), "{position}: {shown:?} {drawn:?}");
    }
    assert_eq!(desk.session.to_project("a.toml".as_ref()).flow.unwrap().color, Some(by));
    desk.act(Action::Undo);
    assert_eq!(desk.session.look().flow.as_ref().unwrap().layer.colors, None, "colours are a change of their own");
    desk.act(Action::Redo);
    // Switched off and on again, it is as before.
    let before = desk.session.look().flow.clone();
    desk.act(Action::ToggleFlow);
    desk.settle();
    assert_eq!(flow(&desk), None);
    desk.act(Action::ToggleFlow);
    assert_eq!(desk.session.look().flow, before);
    desk.act(Action::Undo);
    assert_eq!(desk.session.look().flow, None);
    desk.act(Action::NextIcon);
    desk.act(Action::FlowColors(None));
    // A size that no splat can have is not applied, nor a rate that runs backwards.
    let bad = FlowLook::new("velocity".to_owned(), FlowStyle { size: -1.0, ..style });
    let backwards = FlowLook { rate: Some(-1.0), ..FlowLook::new("velocity".to_owned(), style) };
    [bad, backwards].into_iter().for_each(|flow| desk.act(Action::Flow(Some(Box::new(flow)))));
    assert_eq!((desk.session.look().flow.as_ref(), desk.session.notices()), (None, &[][..]));
    desk.act(Action::ToggleFlow);
    desk.act(Action::FlowColors(Some("wind@viridis".parse().unwrap())));
    let notice = wait_for("a message", || {
        desk.session.tick(desk.now);
        desk.session.notices().first().cloned()
    });
    assert!(notice.kind == NoticeKind::Error && notice.text.contains("'wind"), "{notice:?}");
}

#[test]
fn that_nothing_flows_is_said_once() {
    let folder = tempfile::tempdir().unwrap();
    let tornado = generate(&SynthSpec { cells: 600, steps: 3, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
    let definitions = ["still = 0 * velocity".parse().unwrap()];
    let source = calculated(Box::new(tornado), &definitions, &[]).unwrap();
    let path = folder.path().join("s.zarr");
    ingest(source.as_ref(), &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
    let series = Arc::new(Series::open(&Store::open(&path).unwrap(), None).unwrap());
    let mut desk = Desk::of(series, folder.path());
    let show = |desk: &mut Desk, field: &str| {
        let flow = FlowLook::new(field.to_owned(), FlowStyle::default());
        desk.act(Action::Flow(Some(Box::new(flow))));
        desk.settle();
        let stats = &desk.shown().frame.stats;
        (stats.flow_still, stats.flow_splats > 0)
    };
    assert_eq!(show(&mut desk, "velocity"), (false, true));
    assert!(desk.session.notices().is_empty());
    assert_eq!(show(&mut desk, "still"), (true, false));
    for _ in 0..2 {
        desk.act(Action::Play(Command::Step(1)));
        desk.settle();
        assert!(desk.shown().frame.stats.flow_still);
    }
    let [notice] = desk.session.notices() else { panic!("{:?}", desk.session.notices()) };
    assert!(notice.kind == NoticeKind::Done && notice.count == 1 && notice.text.contains("'still'"), "{notice:?}");
}

#[test]
fn the_next_icon_takes_the_place_of_several_and_a_project_names_a_picture_by_its_place_beside_the_file() {
    let mut desk = desk();
    let mut several = desk.session.look().flow.clone().unwrap();
    let names: Thresholds<IconName> = "strokes,arrows@0.5".parse().unwrap();
    let icons = names.try_map(IconName::read).unwrap();
    several.layer.icons = Some(FlowIcons::new(icons, Some("velocity:0".to_owned()), [0.0, 1.0]));
    several.icons = Some("strokes,/folder/tile.png@0.5".parse().unwrap());
    desk.act(Action::Flow(Some(Box::new(several.clone()))));
    desk.settle();
    assert_eq!(flow(&desk).unwrap().icons, several.layer.icons);
    for (file, named) in [("/folder/p.toml", "tile.png"), ("/other/p.toml", "/folder/tile.png")] {
        let flow = desk.session.to_project(file.as_ref()).flow.unwrap();
        assert_eq!(flow.icon.unwrap().to_string(), format!("strokes,{named}@0.5"));
        assert_eq!(flow.by, "velocity:0".parse().ok());
    }
    desk.act(Action::NextIcon);
    desk.settle();
    let next = flow(&desk).unwrap();
    assert_eq!((next.icons, next.style.icon), (None, Icon::Lines));
    assert_eq!(desk.session.to_project("a.toml".as_ref()).flow.unwrap().by, None);
    desk.act(Action::Undo);
    assert_eq!(desk.session.look().flow, Some(several));
}

#[test]
fn frames_with_flow_have_no_details_of_earlier_ones() {
    let desk = desk();
    let (request, frame) = (desk.shown().request.clone(), desk.shown().frame.clone());
    let mut without = request.clone();
    without.layers.retain(|layer| layer.flow().is_none());
    assert!(without.may_have_details() && !request.may_have_details());
    let residual = Some(ResidualRequest { base: ResidualBase::exact(frame), anew: 0..1 });
    let mut pipeline = Pipeline::new(desk.session.series().clone());
    let mut render = |request: FrameRequest| pipeline.render(&request).map(|_| ()).map_err(|why| why.to_string());
    let with_details = |request| FrameRequest { residual: residual.clone(), samples: SampleSet::All, ..request };
    assert_eq!(render(with_details(without)), Ok(()));
    let refused = render(with_details(request)).unwrap_err();
    assert!(refused.contains("without flow"), "{refused}");
}
