//! `tetreel play`: the player window.

use super::progress::Terminal;
use super::project;
use super::scene::{SceneArgs, SizePx};
use super::{Outcome, surfaces};
use crate::export::still::Background;
use crate::import::Format;
use crate::ingest::Origin;
use crate::look::{DEFAULT_TF, Look};
use crate::pipeline::{PipelinedOptions, Series};
use crate::project::{Animation, Project, is_project};
use crate::store::{Store, is_store};
use crate::task::Cancel;
use crate::transfer::{Space, TransferFunction};
use crate::ui::opening::{Opened, OpeningOptions};
use crate::ui::settings::SettingsFile;
use crate::ui::window::{self, Dress, Dressed, ReadProject, Start, WindowOptions};
use anyhow::{Context, bail};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Play a series in a window
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  tetreel play case.zarr --field T --tf 'inferno@0:0,0.3:0,1:0.4'
  tetreel play case.pvd             imported to a cache first; the next time it is there
  tetreel play running.zarr --follow
  tetreel play PROJECT.toml         with its ensembles, its timeline and its camera path (docs/projects.md)
  tetreel play                      drop a file on the window

In the window, H shows all keys: Space plays and pauses, Left and Right step, a drag turns, the wheel zooms, a click follows a
point over time, S saves the picture, Ctrl E exports images and movies.")]
pub(super) struct Args {
    #[arg(value_name = "NAME.zarr|PROJECT.toml")]
    #[arg(help = format!("A store, a source ({}) to import to the cache first (several .vtu files are one series), or a project \
        (docs/projects.md); none: ask for one", Format::extensions()))]
    paths: Vec<PathBuf>,
    /// Take up steps that are added to the store while it plays (by import --append)
    #[arg(long)]
    follow: bool,
    /// Show this store, source or project beside it, on one clock; where the field has the same name it has the same colours
    #[arg(long, value_name = "NAME.zarr|PROJECT.toml")]
    beside: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    /// Size of the window in points: pixels, unless the screen is scaled (default: as it was last)
    #[arg(long, value_name = "WxH")]
    size: Option<SizePx>,
    /// Colour behind the volume: #rrggbb, black, white or gray (default: as it was last)
    #[arg(long, value_name = "COLOR", value_parser = parse_color)]
    background: Option<[f32; 3]>,
}

/// Image size for which a camera frames the mesh, until the window has its own.
const FRAMING: SizePx = SizePx(1280, 800);

/// Parses a colour; a window cannot be transparent.
fn parse_color(text: &str) -> Result<[f32; 3], String> {
    let problem = "a window is not transparent; write #rrggbb, black, white or gray";
    text.parse::<Background>()?.color().ok_or_else(|| problem.to_owned())
}

/// Runs the command; `words` are the whole command line, which overrides a project.
pub(super) fn run(args: &Args, words: &[OsString], terminal: &Terminal) -> anyhow::Result<Outcome> {
    match &*args.paths {
        [path] if is_project(path) => {
            let opened = project::open::<Args>(path, words, project::Taker::Play)?;
            let project = OfFile { project: opened.project, file: std::path::absolute(path)? };
            let played = play(&[opened.source], &opened.args, Some(project), terminal);
            played.map_err(|error| project::in_file(error, Some(path)))
        }
        paths => {
            if let Some(project) = paths.iter().find(|path| is_project(path)) {
                bail!("{}: a project is played alone", project.display());
            }
            play(paths, args, None, terminal)
        }
    }
}

fn play(paths: &[PathBuf], args: &Args, of: Option<OfFile>, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let project = of.as_ref().map(|of| of.project.clone());
    // Invalid options fail here, before there is a window.
    if args.scene.tf != DEFAULT_TF {
        TransferFunction::parse(&args.scene.tf).with_context(|| format!("--tf '{}'", args.scene.tf.display()))?;
    }
    let start = match paths {
        [] if args.follow => bail!("--follow needs a store to follow"),
        [] => Start::Nothing,
        [path] if is_store(path) || path.extension().is_some_and(|e| e == "zarr") => {
            let opened = open_store(path, &args.scene)?;
            let look = args.scene.look(&opened.series, FRAMING)?;
            surfaces::check(&look.surfaces, project.as_deref(), &opened.series)?;
            if let Some(project) = &project {
                check(project, &opened.series, &look)?;
            }
            Start::Play(Box::new(opened))
        }
        paths => {
            if let Some(missing) = paths.iter().find(|path| !path.exists()) {
                bail!("{}: there is no such file", missing.display());
            }
            Start::Open(paths.to_vec())
        }
    };
    if let Some(beside) = &args.beside {
        if paths.is_empty() {
            bail!("--beside needs a series to be beside");
        }
        if !beside.exists() {
            bail!("--beside: {}: there is no such file", beside.display());
        }
    }
    if !has_display() {
        bail!(
            "there is no display for a window (DISPLAY and WAYLAND_DISPLAY are not set); `tetreel render` makes pictures without one"
        );
    }
    let (background, follows, size, beside) = (args.background, args.follow, args.size, args.beside.clone());
    show(start, &args.scene, &Playing { background, follows, beside, size, plays: false, project: of }, terminal)?;
    Ok(Outcome::Done)
}

/// Checks that a project's first frame can be evaluated. Members that need histograms are left to the window: these may have to be counted.
fn check(project: &Project, series: &Arc<Series>, look: &Look) -> anyhow::Result<()> {
    let Some(&first) = series.times().values.first() else { return Ok(()) };
    let mut project = project.clone();
    for member in project.ensembles.iter_mut().flat_map(|ensemble| &mut ensemble.members) {
        member.enabled &= member.space == Space::Scalar;
    }
    let mut animation = Animation::new(Arc::new(project), series.clone(), look.opacity_kind, look.lengths);
    animation.at(0.into(), first, &Cancel::new())?;
    Ok(())
}

/// Opens a store and its chosen field.
pub(super) fn open_store(path: &Path, scene: &SceneArgs) -> anyhow::Result<Opened> {
    let store = Arc::new(Store::open(path)?);
    let series = scene.series(&store)?;
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    Ok(Opened { store, series, path, name, origin: Origin::Store })
}

/// Options of the window.
pub(super) struct Playing {
    /// Colour behind the volume; `None`: the saved one.
    pub(super) background: Option<[f32; 3]>,
    /// Whether steps added to the store are shown.
    pub(super) follows: bool,
    /// What is shown beside the series.
    pub(super) beside: Option<PathBuf>,
    /// Size in points; `None`: the saved one.
    pub(super) size: Option<SizePx>,
    /// Whether it plays at once, in a loop.
    pub(super) plays: bool,
    /// The project, which overrides the look over time.
    pub(super) project: Option<OfFile>,
}

/// A project and its file.
#[derive(Clone)]
pub(super) struct OfFile {
    project: Arc<Project>,
    file: PathBuf,
}

/// Shows a window until it is closed.
///
/// # Errors
/// If the system opens no window, or Ctrl-C closed it.
pub(super) fn show(start: Start, scene: &SceneArgs, playing: &Playing, terminal: &Terminal) -> anyhow::Result<()> {
    let &Playing { background, follows, size, plays, .. } = playing;
    let dress = dress(scene.clone(), playing.project.clone());
    let is_default = scene.field.is_none() && scene.tf == DEFAULT_TF && scene.range.is_none();
    let restores = is_default && scene.camera.is_none() && playing.project.is_none();
    let opening =
        OpeningOptions { block_bytes: scene.block_memory.0, field: scene.field.clone(), ..Default::default() };
    let options = WindowOptions {
        start,
        dress,
        projects: Arc::new(|path: &Path| read_project(path).map_err(|error| format!("{error:#}"))),
        restores,
        beside: playing.beside.clone(),
        follows,
        plays,
        opening,
        threads: PipelinedOptions { give_way: true, ..Default::default() },
        background,
        screenshot_folder: std::path::absolute(".").unwrap_or_else(|_| PathBuf::from(".")),
        gpu: scene.gpu(),
        size: size.map(|size| [size.0 as f32, size.1 as f32]),
        settings: SettingsFile::of_user(),
        dialogs: window::system_dialogs(),
    };
    window::run(options, &terminal.cancel)?;
    terminal.check_interrupted()?;
    Ok(())
}

/// The look that the options give a series.
fn dress(args: SceneArgs, of: Option<OfFile>) -> Dress {
    Arc::new(move |series: &Series| {
        let (project, file) = of.clone().map(|of| (of.project, of.file)).unzip();
        let look = args.look(series, FRAMING).and_then(|look| {
            surfaces::check(&look.surfaces, project.as_deref(), series)?;
            Ok(look)
        });
        let look = look.map_err(|error| format!("{error:#}"))?;
        // A camera without a position or scale still frames the mesh.
        let says_where = |camera: &str| camera.contains("pos=") || camera.contains("parallel=");
        let camera_is_chosen = args.camera.as_deref().is_some_and(says_where);
        Ok(Dressed { look, camera_is_chosen, project, file })
    })
}

/// Reads a project that is opened in the window, as `tetreel play` reads it.
fn read_project(path: &Path) -> anyhow::Result<ReadProject> {
    let words = ["tetreel".into(), "play".into(), path.into()];
    let opened = project::open::<Args>(path, &words, project::Taker::Play)?;
    let (args, file) = (opened.args, std::path::absolute(path)?);
    let of = OfFile { project: opened.project, file };
    Ok(ReadProject { source: opened.source, field: args.scene.field.clone(), dress: dress(args.scene, Some(of)) })
}

/// Whether there is a display for a window.
pub(super) fn has_display() -> bool {
    let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    cfg!(any(windows, target_os = "macos")) || is_set("DISPLAY") || is_set("WAYLAND_DISPLAY")
}
