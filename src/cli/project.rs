//! Projects on the command line: the settings of a project become options, overridden by the user's.

use super::Cli;
use crate::export::movie::MovieFormat;
use crate::export::run::{RunError, pattern_in};
use crate::export::still::StillFormat;
use crate::files;
use crate::pipeline::{RenderMode, Representation};
use crate::project::{FlowSettings, LookSettings, Output, Project, ProjectError};
use crate::scene::SceneError;
use anyhow::{Context, bail};
use clap::parser::ValueSource;
use clap::{ArgMatches, CommandFactory, FromArgMatches};
use serde::Serialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml::Value;

/// A project, and the command's arguments with it.
pub(super) struct Opened<A> {
    pub(super) project: Arc<Project>,
    /// Its store or source.
    pub(super) source: PathBuf,
    /// The options; the user's override the project's.
    pub(super) args: Box<A>,
}

/// A command that takes a project.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taker {
    Render,
    #[cfg(feature = "gui")]
    Play,
}

impl Taker {
    /// Name of the subcommand.
    fn word(self) -> &'static str {
        match self {
            Self::Render => "render",
            #[cfg(feature = "gui")]
            Self::Play => "play",
        }
    }
}

/// Options that timeline keys would change from frame to frame; given by the user, they hold for all frames.
const ON_THE_TIMELINE: [&str; 5] = ["tf", "camera", "lod", "flow_opacity", "optics"];

/// Reads the project, and parses the options again with those of the project.
pub(super) fn open<A: FromArgMatches>(path: &Path, words: &[OsString], taker: Taker) -> anyhow::Result<Opened<A>> {
    let mut project = Project::read(path)?;
    let (word, wrong) = (taker.word(), "a project is for another command");
    let given = Cli::command().try_get_matches_from(words)?;
    let given = given.subcommand_matches(word).context(wrong)?;
    let says = |option: &str| given.value_source(option) == Some(ValueSource::CommandLine);
    let timeline = &mut project.timeline;
    for option in ON_THE_TIMELINE.into_iter().filter(|option| says(option)) {
        match option {
            "tf" => (timeline.ensembles, project.ensembles) = Default::default(),
            "camera" => timeline.cameras = Default::default(),
            "lod" => timeline.lod = Default::default(),
            "flow_opacity" => timeline.flow = Default::default(),
            _ => timeline.optics = Default::default(),
        }
    }
    leave_out_the_other_representation(&mut project.look, given);
    if says("mode")
        && matches!(given.get_one("mode"), Some(RenderMode::Raycast | RenderMode::Sheets | RenderMode::Reference))
    {
        // These modes draw all cells.
        (timeline.lod, project.look.lod) = Default::default();
    }
    if says("mode") && given.get_one("mode") != Some(&RenderMode::Points) {
        let look = &mut project.look;
        (look.footprint, look.compositing, look.point_radius) = Default::default();
    }
    // One of them replaces the other.
    if says("sheets") {
        project.look.sampling_error = None;
    }
    if says("sampling_error") {
        project.look.sheets = None;
    }
    // Repeatable options would add to the project's.
    if says("iso") {
        project.look.iso.clear();
        (project.timeline.isovalue, project.timeline.iso_opacity) = Default::default();
    }
    if says("parts") {
        project.look.parts.clear();
    }
    if says("surface") {
        project.look.surface.clear();
    }
    if says("cut") {
        (project.look.cut, project.timeline.cut) = Default::default();
    }
    let words = &with_camera(words, &project).with_context(|| path.display().to_string())?[..];
    if let Some(camera) = project.look.camera.as_deref() {
        project.look.camera = project.named_camera(camera)?.map(ToString::to_string).or(project.look.camera);
    }
    // The first word is the program's name, which is arbitrary.
    let Some(at) = words.iter().skip(1).position(|given| given == word).map(|at| at + 1) else { bail!(wrong) };
    let (before, after) = words.split_at(at + 1);
    if says("range") && !project.ensembles.is_empty() {
        bail!("--range is for --tf; the members of {}'s ensembles have ranges of their own", path.display());
    }
    let folder = files::parent_of(path);
    if let Some(flow) = project.flow.take() {
        let by = flow.by.clone().filter(|_| !says("flow_icon"));
        project.flow = Some(FlowSettings { by, ..flow.with_paths(|file| folder.join(file)) });
    }
    let mut options = scene_options(&project)?;
    if taker == Taker::Render {
        leave_out_what_does_not_fit(&mut project.output, given);
        options.extend(output_options(&project, folder)?);
    }
    let all = before.iter().chain(&options).chain(after);
    let command = Cli::command().mut_subcommand(word, |command| command.args_override_self(true));
    let mut matches = command.try_get_matches_from(all).with_context(|| format!("{} as options", path.display()))?;
    let (_, mut matches) = matches.remove_subcommand().context(wrong)?;
    let args = Box::new(A::from_arg_matches_mut(&mut matches)?);
    let source = folder.join(&project.data.source);
    Ok(Opened { project: Arc::new(project), source, args })
}

/// Removes the project's representation or mode that does not go with the user's mode or representation.
fn leave_out_the_other_representation(look: &mut LookSettings, given: &ArgMatches) {
    let of_user = |option: &str| given.value_source(option) == Some(ValueSource::CommandLine);
    let mode = given.get_one::<RenderMode>("mode").copied().filter(|_| of_user("mode"));
    let representation = given.get_one::<Representation>("representation").copied();
    match (mode, representation) {
        (Some(mode), None) => look.representation = look.representation.filter(|of| mode.of(Some(*of)).is_ok()),
        (None, Some(_)) => look.mode = look.mode.filter(|mode| mode.of(representation).is_ok()),
        _ => {}
    }
    let mode = mode.or(look.mode).unwrap_or_default();
    let representation = representation.or(look.representation);
    if mode.of(representation) == Ok(RenderMode::Sheets) {
        return;
    }
    (look.sheets, look.sampling_error) = Default::default();
    if (mode, representation) != (RenderMode::Reference, Some(Representation::Vertices)) {
        (look.domain, look.normalise) = Default::default();
    }
}

/// The command line with the camera itself in place of the name of one.
fn with_camera(words: &[OsString], project: &Project) -> Result<Vec<OsString>, ProjectError> {
    const OPTION: &str = "--camera";
    let mut words = words.to_vec();
    for at in 0..words.len() {
        let text = |word: Option<&OsString>| word.and_then(|word| word.to_str()).map(str::to_owned);
        let Some(word) = text(words.get(at)) else { continue };
        let (at, before, name) = match word.strip_prefix(OPTION) {
            Some("") => (at + 1, "", text(words.get(at + 1))),
            Some(rest) => (at, "--camera=", rest.strip_prefix('=').map(str::to_owned)),
            None => continue,
        };
        let Some(name) = name else { continue };
        if let (Some(camera), Some(word)) = (project.named_camera(&name)?, words.get_mut(at)) {
            *word = format!("{before}{camera}").into();
        }
    }
    Ok(words)
}

/// Adds the project's file to the error, if it concerns the project.
pub(super) fn in_file(error: anyhow::Error, project: Option<&Path>) -> anyhow::Error {
    let is_in_scene = |error: &SceneError| matches!(error, SceneError::Project(_));
    let is_of_project = error.is::<ProjectError>()
        || error.downcast_ref().is_some_and(is_in_scene)
        || matches!(error.downcast_ref(), Some(RunError::Scene(error)) if is_in_scene(error));
    match project.filter(|_| is_of_project) {
        Some(file) => error.context(file.display().to_string()),
        None => error,
    }
}

/// Removes output settings of the project that are for another kind of file than the user's, that spread frames over time if the user
/// names the steps, or that are about a small image if the user names its size.
fn leave_out_what_does_not_fit(output: &mut Output, given: &ArgMatches) {
    let says = |option: &str| given.value_source(option) == Some(ValueSource::CommandLine);
    if says("steps") && !says("duration") {
        (output.duration, output.interpolate) = (None, None);
    }
    if says("image_scale") && !says("upsample") {
        (output.upsample, output.kernel, output.sigma_depth, output.layers) = Default::default();
    }
    let asked = given.get_raw("output").and_then(|mut words| words.next()).map(PathBuf::from);
    let Some(path) = asked.or_else(|| output.output.clone()) else { return };
    let is_movie = MovieFormat::of(&path).is_some();
    if !is_movie && output.duration.is_none() && !says("duration") {
        output.fps = None;
    }
    if !says("output") {
        return;
    }
    let format = StillFormat::of(&path);
    if format != Some(StillFormat::Exr) {
        (output.exr, output.exr_compression) = (None, None);
    }
    if format.is_none() || format != output.output.as_deref().and_then(StillFormat::of) {
        output.bit_depth = None;
    }
    if format == Some(StillFormat::Exr) {
        output.background = None;
    }
}

/// The look of a project, as options.
fn scene_options(project: &Project) -> anyhow::Result<Vec<OsString>> {
    // Ensembles have no option.
    let look = LookSettings { ensemble: None, ..project.look.clone() };
    let field = project.data.field.as_ref().map(|field| format!("--field={field}").into());
    let flow = project.flow.as_ref().map(|flow| options(flow, of_flow)).transpose()?.unwrap_or_default();
    Ok(field.into_iter().chain(options(&look, str::to_owned)?).chain(flow).collect())
}

/// The option of a key of flow.
fn of_flow(key: &str) -> String {
    if key == "field" { "flow".to_owned() } else { format!("flow-{key}") }
}

/// The output settings of a project, as options.
fn output_options(project: &Project, folder: &Path) -> anyhow::Result<Vec<OsString>> {
    let mut options = options(&Output { output: None, ..project.output.clone() }, str::to_owned)?;
    if let Some(output) = &project.output.output {
        let mut word = OsString::from("--output=");
        word.push(pattern_in(folder, output));
        options.push(word);
    }
    Ok(options)
}

/// The keys of a table as options of these names: a key that is true without a value, a list as repeated options.
fn options(table: &impl Serialize, name_of: impl Fn(&str) -> String) -> anyhow::Result<Vec<OsString>> {
    fn add(options: &mut Vec<OsString>, name: &str, value: &Value) {
        match value {
            Value::Boolean(false) => {}
            Value::Boolean(true) => options.push(format!("--{name}").into()),
            Value::Array(values) => values.iter().for_each(|value| add(options, name, value)),
            Value::String(text) => options.push(format!("--{name}={text}").into()),
            value => options.push(format!("--{name}={value}").into()),
        }
    }
    let mut options = Vec::new();
    toml::Table::try_from(table)?.iter().for_each(|(key, value)| add(&mut options, &name_of(key), value));
    Ok(options)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::scene::{SceneArgs, SizePx};
    use crate::ingest::{IngestOptions, ingest};
    use crate::look::Look;
    use crate::project::{Data, NamedCamera, is_project};
    use crate::store::Store;
    use crate::synth::{SeriesName, SynthSpec, generate};
    use crate::task::{Cancel, Silent};
    use crate::timeline::Key;
    use glam::DVec3;

    /// Options of looks, by what they set.
    const LOOKS: [&str; 20] = [
        "",
        "--opacity-kind extinction --unit-distance 0.1 --optics partial --backend cpu",
        "--mode havs --lod 0.3 --sampling greedy:9 --k 12 --inexact-order",
        "--mode points --footprint ellipse --compositing gap --point-radius 0.6 --lod 0.5 --inexact-order",
        "--mode points --lod 0.5 --sampling plain",
        "--mode sheets --sheets 40",
        "--mode sheets --sampling-error 0.01",
        "--mode raycast --camera pos=1,2,3_focal=0.1,0,0.3_up=0,0,1_angle=20.5_near=0.25",
        "--mode reference --camera parallel=3",
        "--mode reference --representation vertices",
        "--mode reference --representation cells --camera parallel=2",
        "--representation vertices --sheets 40 --domain box",
        "--mode reference --representation vertices --domain coverage --normalise eq20",
        "--iso=-9:#ff8000/#102030:0.4 --iso=-50:by=velocity:0@gray:0.25 --iso=-120.5:by=velocity:1 --shade vertex --ao",
        "--iso=-30.2 --no-volume --light 1,2,3 --shade-volume --no-smoothing",
        "--cut point=1,2,3_normal=0,0.6,0.8_clip --cut point=0,0,5_normal=1,0,0_field=velocity:2@inferno",
        "--flow velocity --flow-icon arrows --flow-splats 90 --flow-size 0.7 --flow-length 3 --flow-opacity 0.5 --flow-speed 2 --flow-rate 3 --flow-fidelity paper --flow-color velocity:mag@gray",
        "--flow velocity --flow-icon particles,lines@0.5,arrows@2",
        "--flow velocity --flow-icon lines,arrows@-70 --flow-by pressure",
        "--surface solid:#ff0000:0.5 --surface edges --crop min=-3,-3,-3_max=3,3,9 --parts 0",
    ];

    #[test]
    fn a_camera_is_named_on_the_command_line_or_in_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("p.toml");
        let camera = |angle: f64| {
            let projection = crate::camera::Projection::Perspective { view_angle: angle };
            crate::camera::Camera {
                projection,
                ..crate::camera::Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap()
            }
        };
        let named = |name: &str, angle| NamedCamera { name: name.to_owned(), camera: camera(angle) };
        let mut project = Project::new(Data { source: "x.zarr".into(), field: None });
        project.cameras = vec![named("front", 20.0), named("from the left", 30.0)];
        project.look.camera = Some("front".into());
        project.timeline.cameras =
            vec![Key { time: 0.0, transition: Default::default(), value: camera(40.0) }].try_into().unwrap();
        project.write(&file).unwrap();
        let opened = |options: &[&str]| {
            let words =
                ["tetreel", "render", file.to_str().unwrap(), "-o", "x.png"].into_iter().chain(options.iter().copied());
            let words: Vec<OsString> = words.map(OsString::from).collect();
            open::<SceneArgs>(&file, &words, Taker::Render)
        };
        let of_look = opened(&[]).unwrap();
        assert_eq!(of_look.args.camera, Some(camera(20.0).to_string()));
        assert_eq!(of_look.project.timeline.cameras.keys().len(), 1);
        for options in [&["--camera", "from the left"][..], &["--camera=from the left"]] {
            let opened = opened(options).unwrap();
            assert_eq!(opened.args.camera, Some(camera(30.0).to_string()));
            assert!(opened.project.timeline.cameras.keys().is_empty(), "it holds for all frames");
        }
        assert_eq!(opened(&["--camera", "angle=7"]).unwrap().args.camera.as_deref(), Some("angle=7"));
        let error = format!("{:#}", opened(&["--camera", "back"]).map(drop).unwrap_err());
        assert!(error.contains("p.toml") && error.contains("'back'; there are: front, from the left"), "{error}");
    }

    #[test]
    fn a_look_that_is_saved_is_the_same_look_when_it_is_opened() {
        let folder = tempfile::tempdir().unwrap();
        let source = generate(&SynthSpec { cells: 600, steps: 2, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
        let store = folder.path().join("x.zarr");
        ingest(&source, &store, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        let look_of = |path: &Path, options: &[&str]| -> Look {
            let words = ["tetreel", "render", path.to_str().unwrap(), "-o", "x.png"];
            let options = options.iter().map(|word| word.replace('_', " ").into());
            let words: Vec<OsString> = words.into_iter().map(OsString::from).chain(options).collect();
            let args = if is_project(path) {
                let opened = open::<SceneArgs>(path, &words, Taker::Render).unwrap();
                assert_eq!(opened.source, store);
                opened.args
            } else {
                let matches = Cli::command().try_get_matches_from(&words).unwrap();
                Box::new(SceneArgs::from_arg_matches(matches.subcommand_matches("render").unwrap()).unwrap())
            };
            args.open(&Store::open(&store).unwrap(), SizePx(64, 48), None, &Cancel::new()).unwrap().look
        };
        for options in LOOKS {
            let options: Vec<&str> = options.split_whitespace().collect();
            let look = look_of(&store, &options);
            let usual = look_of(&store, &[]);
            let mut project = Project::new(Data { source: "x.zarr".into(), field: None });
            project.look = LookSettings::of(&look, &usual, None);
            project.flow = look.flow.as_ref().map(FlowSettings::of);
            let file = folder.path().join("p.toml");
            project.write(&file).unwrap();
            assert_eq!(look_of(&file, &[]), look, "{options:?}: {}", project.to_toml().unwrap());
            assert!(options.is_empty() || look != usual);
        }
    }
}
