//! Points, previews, files, settings and screens of the player window.

use egui::Key;
use egui_kittest::kittest::{NodeT, Queryable};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tetreel::look::Look;
use tetreel::pipeline::Series;
use tetreel::playback::Mode;
use tetreel::transfer::TransferFunction;
use tetreel::ui::settings::SettingsFile;
use tetreel::ui::shortfall;
use tetreel::ui::window::Start;
use tetreel_ui_tests::desk::{Desk, STEPS, options, store};

#[test]
fn a_point_under_the_mouse_has_a_value_and_a_click_follows_it_over_time() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let middle = desk.place("Picture of").center();
    desk.harness.hover_at(middle);
    desk.until("the value is known", |session| session.hover().is_some());
    let hover = desk.session().hover().unwrap().clone();
    let probe = hover.found.clone().unwrap().expect("the volume is in the middle");
    let [lo, hi] = desk.session().series().field().range.unwrap().map(f64::from);
    assert!((lo..=hi).contains(&probe.scalar));
    desk.harness.drag_at(middle);
    desk.harness.step();
    desk.harness.drop_at(middle);
    desk.harness.step();
    desk.until("its curve is known", |session| {
        session.picked().and_then(|picked| picked.curve).is_some_and(|curve| curve.done == STEPS)
    });
    let picked = desk.session().picked().unwrap();
    let curve = picked.curve.unwrap();
    // The value at the step that was shown is the one that was under the mouse, but for rounding to f32.
    assert!((f64::from(curve.values[0]) - probe.scalar).abs() <= 1e-6 * hi.abs().max(lo.abs()));
    assert!(curve.values.windows(2).any(|pair| pair[0] != pair[1]), "it changes over time: {:?}", curve.values);
    desk.settle();
    assert!(desk.harness.query_by_label("Value of the point over time").is_some());
    desk.save("point.png");
    desk.click("Forget the point");
    assert!(desk.session().picked().is_none());
}

#[test]
fn a_click_right_after_a_move_picks_what_is_under_the_mouse_then() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let middle = desk.place("Picture of").center();
    desk.harness.hover_at(middle - egui::vec2(120.0, 60.0));
    desk.until("the value there is known", |session| session.hover().is_some());
    let there = desk.session().hover().unwrap().found.clone().unwrap().unwrap();
    let elsewhere = middle + egui::vec2(60.0, 40.0);
    desk.harness.hover_at(elsewhere);
    desk.harness.drag_at(elsewhere);
    desk.harness.step();
    desk.harness.drop_at(elsewhere);
    desk.until("a point is picked", |session| session.picked().is_some());
    let picked = desk.session().picked().unwrap();
    assert_ne!(picked.position, there.position, "not where the mouse was before");
    desk.harness.hover_at(elsewhere);
    desk.until("the value here is known", |session| session.hover().is_some());
    let here = desk.session().hover().unwrap().found.clone().unwrap().unwrap();
    assert_eq!(picked.position, here.position);
}

#[test]
fn the_timeline_shows_the_values_of_each_step_and_a_small_picture_under_the_mouse() {
    let Some(mut desk) = Desk::open() else { return };
    desk.until("all steps were looked at", |session| session.survey().is_over);
    let survey = desk.session().survey();
    assert_eq!((survey.done, survey.failed), (STEPS, 0));
    let strip = desk.place("Least, mean and greatest");
    desk.harness.hover_at(strip.center());
    desk.harness.step();
    let is_preview = |label: String| label.starts_with("step ") && label.contains("mean");
    let begin = Instant::now();
    while desk.harness.query_all_by(|node| node.label().or(node.value()).is_some_and(is_preview)).count() == 0 {
        desk.harness.step();
        std::thread::sleep(Duration::from_millis(5));
        assert!(begin.elapsed() < Duration::from_secs(60), "no preview");
    }
    desk.until_there("Small picture of the step");
    desk.save("preview.png");
    let before = desk.step();
    desk.harness.drag_at(strip.center());
    desk.harness.step();
    desk.harness.drop_at(strip.center());
    desk.harness.step();
    desk.harness.step();
    assert_ne!(desk.step(), before, "a click goes there");
}

#[test]
fn flow_comes_by_a_key_with_its_controls_and_goes_on_while_a_step_is_held() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    desk.press(Key::F);
    let held = |session: &tetreel::ui::Session| {
        let flow =
            session.shown().and_then(|shown| shown.request.layers.iter().find_map(|layer| layer.flow()).cloned());
        flow.map(|flow| (flow.held, flow.style.icon))
    };
    desk.until("the flow goes on", |session| held(session).is_some_and(|(held, _)| held > 0.0));
    let (before, icon) = held(desk.session()).unwrap();
    desk.until("and on", |session| held(session).is_some_and(|(held, _)| held > 2.0 * before));
    desk.press(Key::G);
    desk.until("another icon", |session| held(session).is_some_and(|(_, shown)| shown != icon));
    desk.save("flow.png");
    for control in [
        "Flow (F)",
        "Icon (G)",
        "Icon of strokes",
        "Icon of arrows",
        "Splats",
        "Opacity of the flow",
        "Colours of the flow",
    ] {
        assert!(desk.harness.query_by_label(control).is_some(), "{control}");
    }
    desk.click("Colours of the flow");
    desk.until_there("velocity:mag");
    desk.click("velocity:mag");
    let is_coloured = |session: &tetreel::ui::Session| {
        session.look().flow.as_ref().is_some_and(|flow| flow.color_by.is_some() && flow.layer.colors.is_some())
    };
    desk.until("it is coloured", is_coloured);
    // A picture is saved while it goes on.
    desk.press(Key::S);
    desk.until("the file is there", |session| !session.notices().is_empty());
    assert!(desk.session().notices()[0].text.starts_with("saved "), "{:?}", desk.session().notices());
    desk.press(Key::Space);
    desk.until("a step that is played", |session| held(session).is_some_and(|(held, _)| held == 0.0));
    desk.press(Key::Space);
    desk.press(Key::F);
    desk.until("no flow", |session| held(session).is_none());
    desk.settle();
}

#[test]
fn every_control_has_a_name() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    // Those of flow are there with it.
    desk.press(Key::F);
    desk.until_there("Icon (G)");
    let mut controls = 0;
    for node in desk.harness.query_all_by(|_| true) {
        let node = node.accesskit_node();
        let role = format!("{:?}", node.role());
        let is_control = ["Button", "CheckBox", "ComboBox", "Slider", "SpinButton", "TextInput", "ColorWell", "Image"];
        if is_control.contains(&role.as_str()) {
            controls += 1;
            assert!(
                node.label().is_some_and(|label| !label.is_empty()),
                "a {role} at {:?} has no name",
                node.raw_bounds()
            );
        }
    }
    assert!(controls > 40, "there are controls: {controls}");
}

#[test]
fn another_file_is_named_in_the_menu_while_one_is_played() {
    let Some(mut desk) = Desk::open() else { return };
    desk.click("Open...");
    // As a hand does, not by the focus alone.
    desk.click("Path to open");
    desk.click("Path to open");
    desk.harness.get_by_label("Path to open").type_text("/nowhere/at/all.pvd");
    desk.harness.step();
    desk.harness.key_press(Key::Enter);
    desk.harness.step();
    desk.until("it says that there is no such file", |session| {
        session.notices().iter().any(|notice| notice.text.contains("/nowhere/at/all.pvd"))
    });
}

#[test]
fn files_are_opened_by_name_and_what_cannot_be_opened_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = store(folder.path());
    let Some(mut desk) = Desk::with([900.0, 600.0], 1.0, options(folder.path(), Start::Nothing), folder) else {
        return;
    };
    desk.harness.step();
    desk.harness.step();
    desk.save("welcome.png");
    let open = |desk: &mut Desk, path: PathBuf| {
        desk.harness.get_by_label("Path to open").focus();
        desk.harness.step();
        desk.harness.get_by_label("Path to open").type_text(path.to_str().unwrap());
        desk.harness.step();
        desk.harness.key_press(Key::Enter);
        desk.harness.step();
        desk.harness.step();
    };
    open(&mut desk, PathBuf::from("/nowhere/at/all.pvd"));
    let begin = Instant::now();
    while desk.window().notices().is_empty() {
        desk.harness.step();
        assert!(begin.elapsed() < Duration::from_secs(60), "nothing is said");
    }
    let said = desk.window().notices()[0].text.clone();
    assert!(said.contains("/nowhere/at/all.pvd"), "{said}");
    assert!(desk.window().session().is_none());
    desk.harness.step();
    desk.save("no_such_file.png");
    desk.click("Dismiss message 1");
    // What was typed is still there.
    desk.harness.get_by_label("Path to open").focus();
    desk.harness.step();
    desk.harness.key_press_modifiers(egui::Modifiers::COMMAND, Key::A);
    open(&mut desk, path);
    desk.begin();
    assert_eq!(desk.session().state().steps, STEPS);
}

#[test]
fn what_was_chosen_is_there_again_the_next_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = store(folder.path());
    let kept = folder.path().to_owned();
    let open = |start| options(&kept, start);
    let Some(mut desk) = Desk::with([1280.0, 800.0], 1.0, open(Start::Open(vec![path.clone()])), folder) else {
        return;
    };
    desk.begin();
    desk.click("Colour map");
    desk.settle();
    desk.click("turbo");
    desk.press(Key::X);
    desk.click("Side panel");
    let look = desk.session().look().clone();
    let folder = desk.close();
    let (settings, told) = SettingsFile::at(folder.path().join("settings")).load();
    assert_eq!(told, None);
    assert_eq!(settings.recent[0].path, path);
    assert!(!settings.shows_side);

    let mut desk = Desk::with([1280.0, 800.0], 1.0, open(Start::Nothing), folder).unwrap();
    desk.harness.step();
    desk.click("tornado.zarr");
    desk.begin();
    assert_eq!(desk.session().function().unwrap().color_map().name(), "turbo");
    assert_eq!(desk.session().look().camera, look.camera);
    assert!(desk.harness.query_by_label("Colour map").is_none(), "the panel is still away");
}

#[test]
fn a_dense_screen_gets_all_its_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let start = Start::Open(vec![store(folder.path())]);
    let Some(mut desk) = Desk::with([900.0, 600.0], 2.0, options(folder.path(), start), folder) else { return };
    desk.begin();
    desk.settle();
    let picture = desk.place("Picture of");
    let size = desk.session().shown().unwrap().request.size_px;
    let pixels = |points: f32| (2.0 * points).round() as usize;
    assert_eq!(size, (pixels(picture.width()), pixels(picture.height())));
    desk.settle();
    desk.save("dense.png");
}

#[test]
fn a_machine_that_cannot_keep_up_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let start = Start::Open(vec![store(folder.path())]);
    // The reference takes a while for each frame.
    let dress = |series: &Series| {
        let look = Look::default_for(series, TransferFunction::parse("viridis").unwrap()).unwrap();
        Ok(Look { mode: tetreel::pipeline::RenderMode::Reference, ..look }.into())
    };
    let options = tetreel::ui::window::WindowOptions { dress: Arc::new(dress), ..options(folder.path(), start) };
    let Some(mut desk) = Desk::with([1280.0, 800.0], 1.0, options, folder) else { return };
    desk.begin();
    desk.press(Key::L);
    for _ in 0..16 {
        desk.press(Key::CloseBracket);
    }
    desk.press(Key::Space);
    desk.until("it is slower than asked", |session| shortfall(&session.state()).is_some());
    assert_eq!(desk.session().state().dropped, 0, "every step is shown");
    desk.harness.step();
    desk.save("slow.png");
    desk.press(Key::A);
    assert_eq!(desk.session().state().settings.mode, Mode::RealTime);
    // Faster than any machine: the whole series in a moment.
    for _ in 0..16 {
        desk.press(Key::CloseBracket);
    }
    desk.until("steps are dropped", |session| session.state().dropped > 0);
    assert!(shortfall(&desk.session().state()).unwrap().contains("dropping"));
}

#[test]
fn isosurfaces_come_with_m_are_moved_by_keys_and_kept_in_the_side_panel() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let volume = desk.session().shown().unwrap().frame.planes.color.clone();
    let shown = |desk: &Desk| {
        let request = &desk.session().shown().unwrap().request;
        let tets = request.tets().unwrap();
        (tets.volume, tets.surfaces.iter().map(|surface| surface.value).collect::<Vec<_>>())
    };
    let [lo, hi] = desk.session().series().field().range.unwrap().map(f64::from);
    desk.press(Key::M);
    desk.settle();
    assert_eq!(shown(&desk), (false, vec![0.5 * lo + 0.5 * hi]));
    assert!(desk.session().shown().unwrap().frame.planes.color != volume);
    desk.save("surfaces.png");
    desk.press(Key::J);
    desk.settle();
    let moved = shown(&desk).1[0];
    assert!((moved - (0.49 * hi + 0.51 * lo)).abs() < 1e-6 * (hi - lo), "{moved}");
    desk.click("Add isosurface");
    desk.settle();
    assert_eq!(shown(&desk).1.len(), 2);
    assert!(desk.harness.query_by_label("Isovalue").is_some() && desk.harness.query_by_label("Isovalue 2").is_some());
    desk.click("Light on surfaces");
    desk.click("smooth");
    desk.press(Key::M);
    desk.settle();
    assert_eq!((shown(&desk).0, shown(&desk).1.len()), (true, 2));
    desk.save("surfaces_both.png");
    desk.press(Key::M);
    desk.settle();
    assert_eq!(shown(&desk), (true, vec![]));
    assert!(desk.session().notices().is_empty() && desk.harness.query_by_label("Add isosurface").is_none());
}

#[test]
fn cuts_and_the_surface_of_the_domain_are_made_moved_and_removed_in_the_side_panel() {
    let Some(mut desk) = Desk::open() else { return };
    desk.settle();
    let volume = desk.session().shown().unwrap().frame.planes.color.clone();
    let tets = |desk: &Desk| desk.session().shown().unwrap().request.tets().unwrap().clone();
    desk.click("Cuts, light on the volume, surface of the domain, regions");
    desk.click("Add section");
    desk.settle();
    let section = tets(&desk).cuts[0];
    assert!(!section.clips && desk.session().shown().unwrap().frame.planes.color != volume);
    desk.click("Cut across x");
    desk.settle();
    assert_eq!(tets(&desk).cuts[0].normal, [1.0, 0.0, 0.0]);
    desk.save("section.png");
    desk.click("Add clip");
    desk.settle();
    let [.., clip] = &tets(&desk).cuts[..] else { panic!("there is a clip") };
    assert!(clip.clips && clip.normal == [0.0, 0.0, 1.0]);
    let before = clip.point[2];
    desk.click("Keep the other side 2");
    desk.settle();
    assert_eq!(tets(&desk).cuts[1].normal, [-0.0, -0.0, -1.0]);
    let middle = desk.place("Picture of").center();
    let camera = desk.session().camera();
    let held = |held: egui::Modifiers| egui::Event::ModifiersChanged(held);
    desk.harness.event(held(egui::Modifiers::COMMAND));
    desk.drag(middle, middle + egui::vec2(0.0, 40.0));
    desk.harness.event(held(egui::Modifiers::NONE));
    desk.settle();
    assert_eq!(desk.session().camera(), camera, "it does not turn");
    assert!(tets(&desk).cuts[1].point[2] < before, "the plane follows the mouse downwards");
    desk.click("Surface of the domain");
    desk.click("domain: feature edges");
    desk.settle();
    assert_eq!(tets(&desk).domain.len(), 1);
    desk.save("clip.png");
    desk.click("Remove the cut 2");
    desk.click("Remove the cut");
    desk.settle();
    assert!(tets(&desk).cuts.is_empty());
    assert!(desk.session().notices().is_empty(), "{:?}", desk.session().notices());
}

/// Two parts: two cells, and one.
const TWO_PARTS: &str = r#"<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>
<Piece NumberOfPoints="9" NumberOfCells="3">
<PointData><DataArray type="Float32" Name="u" format="ascii">0 1 2 3 4 5 6 7 8</DataArray></PointData>
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">
0 0 0 1 0 0 0 1 0 0 0 1 1 1 1 3 0 0 4 0 0 3 1 0 3 0 1</DataArray></Points>
<Cells><DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3 1 2 3 4 5 6 7 8</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">4 8 12</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10 10 10</DataArray></Cells>
</Piece></UnstructuredGrid></VTKFile>"#;

#[test]
fn connected_parts_are_switched_off_and_on_by_number() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("parts.vtu");
    std::fs::write(&path, TWO_PARTS).unwrap();
    let options = options(folder.path(), Start::Open(vec![path]));
    let Some(mut desk) = Desk::with([1280.0, 800.0], 1.0, options, folder) else { return };
    desk.begin();
    desk.settle();
    let shown = |desk: &Desk| {
        let shown = desk.session().shown().unwrap();
        (shown.request.tets().unwrap().parts.clone(), shown.frame.stats.cells_active)
    };
    assert_eq!(shown(&desk), (vec![], 3));
    desk.click("Cuts, light on the volume, surface of the domain, regions");
    desk.click("Connected parts");
    desk.click("0: 2 cells");
    desk.settle();
    assert_eq!(shown(&desk), (vec![1], 1));
    // The last one stays, and the list stays open.
    desk.click("1: 1 cell");
    desk.settle();
    assert_eq!(shown(&desk), (vec![1], 1));
    desk.save("parts.png");
    desk.click("0: 2 cells");
    desk.settle();
    assert_eq!(shown(&desk), (vec![], 3));
    assert!(desk.session().notices().is_empty(), "{:?}", desk.session().notices());
}

#[test]
fn regions_are_chosen_by_a_field_of_cells_and_its_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("regions.vtu");
    let blocks =
        "<CellData><DataArray type=\"Float32\" Name=\"block\" format=\"ascii\">0 3 5</DataArray></CellData>\n<Points>";
    std::fs::write(&path, TWO_PARTS.replace("<Points>", blocks)).unwrap();
    let options = options(folder.path(), Start::Open(vec![path]));
    let Some(mut desk) = Desk::with([1280.0, 800.0], 1.0, options, folder) else { return };
    desk.begin();
    desk.settle();
    let shown = |desk: &Desk| {
        let shown = desk.session().shown().unwrap();
        let regions = shown.request.tets().unwrap().regions.as_ref().map(ToString::to_string);
        (regions, shown.frame.stats.cells_active)
    };
    assert_eq!(shown(&desk), (None, 3));
    desk.click("Cuts, light on the volume, surface of the domain, regions");
    desk.click("Field of the regions");
    desk.click("block");
    desk.settle();
    assert_eq!(shown(&desk), (Some("block=0..5".to_owned()), 3));
    for (typed, expected, cells) in [("3..7,-1", "block=3..7,-1", 2), ("5", "block=5", 1), ("5..", "block=5", 1)] {
        desk.harness.get_by_label("Values of the regions").focus();
        desk.harness.run_steps(2);
        desk.harness.key_press_modifiers(egui::Modifiers::COMMAND, Key::A);
        desk.harness.event(egui::Event::Text(typed.to_owned()));
        desk.harness.run_steps(2);
        desk.settle();
        assert_eq!(shown(&desk), (Some(expected.to_owned()), cells), "{typed}");
    }
    desk.until_there("'5..' is no list of values; write VALUE,FROM..TO, as in 0,3..5");
    desk.save("regions.png");
    desk.click("Field of the regions");
    desk.click("all regions");
    desk.settle();
    assert_eq!(shown(&desk), (None, 3));
    // Surfaces of regions, beside that of the domain.
    let surfaces = |desk: &Desk| {
        let shown = desk.session().shown().unwrap();
        shown.request.tets().unwrap().domain.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    // Room for all lines of the surfaces.
    desk.click("Colours");
    desk.click("Opacity");
    desk.settle();
    desk.click("Add surface of regions");
    desk.settle();
    assert_eq!(surfaces(&desk), ["solid:block=0..5::0.3"]);
    desk.harness.get_by_label("Values of the regions' surface").focus();
    desk.harness.run_steps(2);
    desk.harness.key_press_modifiers(egui::Modifiers::COMMAND, Key::A);
    desk.harness.event(egui::Event::Text("3".to_owned()));
    desk.harness.run_steps(2);
    desk.click("Style of the regions' surface");
    desk.click("wireframe");
    desk.click("Surface of the domain");
    desk.click("domain: feature edges");
    desk.settle();
    assert_eq!(surfaces(&desk), ["edges", "wireframe:block=3::0.3"]);
    desk.save("region_surface.png");
    desk.click("Remove the regions' surface");
    desk.settle();
    assert_eq!(surfaces(&desk), ["edges"]);
    assert!(desk.session().notices().is_empty(), "{:?}", desk.session().notices());
}
