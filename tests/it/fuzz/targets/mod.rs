//! What every parser and the store reader do with any bytes: a panic here is a bug, an error is not.
//!
//! The same functions are run by `cargo fuzz` (`fuzz/fuzz_targets`) and, on the committed corpus and on mutations of it, by
//! `cargo test` (`tests/it/fuzz`). Each writes its input to files where the library reads files, reads all that is there, and
//! checks what must hold of anything that was read.

pub mod archive;
mod stored;
mod texts;

use std::fs;
use std::path::{Path, PathBuf};
use tetreel::error::FileResult;
use tetreel::field::{Association, Component};
use tetreel::image::{read_image, read_png_text};
use tetreel::import;
use tetreel::mesh::Mesh;
use tetreel::transfer::{ColorMapEntry, TransferError, TransferFunction, read_color_maps};
use tetreel::ui::settings::SettingsFile;

/// Nothing, or what the user reads.
pub type Outcome = Result<(), String>;

/// A parser, and what to do with bytes.
pub struct Target {
    /// Name of its folder in `fuzz/corpus` and of its program in `fuzz/fuzz_targets`.
    pub name: &'static str,
    /// Reads bytes; panics only if there is a bug.
    pub run: fn(&[u8]) -> Outcome,
}

/// All targets.
pub const TARGETS: &[Target] = &[
    Target { name: "vtu", run: |bytes| file_of(bytes, "fuzzed.vtu") },
    Target { name: "pvd", run: |bytes| series_of(bytes, "fuzzed.pvd") },
    Target { name: "parts", run: |bytes| series_of(bytes, "fuzzed.vtu.series") },
    Target { name: "vtk", run: |bytes| file_of(bytes, "fuzzed.vtk") },
    Target { name: "xdmf", run: |bytes| series_of(bytes, "fuzzed.xdmf") },
    Target { name: "exodus", run: |bytes| file_of(bytes, "fuzzed.e") },
    Target { name: "exodus_parts", run: |bytes| series_of(bytes, "fuzzed.e.2.0") },
    Target { name: "ensight", run: |bytes| series_of(bytes, "fuzzed.case") },
    Target { name: "vtkhdf", run: |bytes| file_of(bytes, "fuzzed.vtkhdf") },
    Target { name: "npz", run: |bytes| file_of(bytes, "fuzzed.npz") },
    // What a file begins with says which of the two headers it has.
    Target { name: "raw", run: |bytes| file_of(bytes, "fuzzed.mha") },
    Target { name: "transfer_function", run: transfer_function },
    Target { name: "color_maps", run: color_maps },
    Target { name: "settings", run: settings },
    Target { name: "png", run: png },
    Target { name: "exr", run: exr },
    Target { name: "store", run: stored::store },
    Target { name: "vq", run: stored::vq },
    Target { name: "chunk", run: stored::chunk },
    Target { name: "camera", run: texts::camera },
    Target { name: "tf_text", run: texts::tf_text },
    Target { name: "options", run: texts::options },
    Target { name: "request", run: texts::request },
    Target { name: "command_line", run: texts::command_line },
];

/// Runs the target of that name.
#[allow(dead_code, reason = "for the programs of cargo fuzz")]
pub fn run(name: &str, bytes: &[u8]) {
    let target = TARGETS.iter().find(|target| target.name == name).expect("a target");
    let _ = (target.run)(bytes);
}

/// Most steps that are read: what is wrong with a series shows in the first few.
const STEPS_MAX: usize = 3;

/// A folder for one input.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    fn with(name: &str, bytes: &[u8]) -> (Self, PathBuf) {
        let folder = Self::new();
        let path = folder.path().join(name);
        fs::write(&path, bytes).expect("a file");
        (folder, path)
    }

    /// The message of an error, which must name a file of this folder.
    pub fn judge<T>(&self, result: FileResult<T>) -> Outcome {
        let Err(error) = result else { return Ok(()) };
        let message = error.to_string();
        assert!(message.contains(&*self.path().to_string_lossy()), "names no file: {message}");
        assert!(!error.problem.is_empty(), "says nothing: {message}");
        Err(message)
    }
}

/// A file that is a series by itself.
fn file_of(bytes: &[u8], name: &str) -> Outcome {
    let (folder, path) = Folder::with(name, bytes);
    folder.judge(read_series(&path))
}

/// A file that names others, all in one input.
fn series_of(bytes: &[u8], name: &str) -> Outcome {
    let folder = Folder::new();
    archive::unpack(bytes, folder.path());
    folder.judge(read_series(&folder.path().join(name)))
}

/// Reads all that a series has, and makes a mesh of what it says is one.
fn read_series(path: &Path) -> FileResult<()> {
    import::files(path)?;
    let source = import::open(path)?;
    let mesh = source.mesh()?;
    let times = source.times();
    assert!(times.values.iter().all(|t| t.is_finite()) && times.values.is_sorted_by(|a, b| a < b), "{times:?}");
    let mut out = Vec::new();
    for field in source.fields() {
        for step in 0..times.len().min(STEPS_MAX) {
            for component in [Component::Index(0), Component::Index(field.components - 1), Component::Magnitude] {
                source.read(field, component, step, &mut out)?;
                let values = match field.association {
                    Association::Point => mesh.points.len(),
                    Association::Cell => mesh.cells.len(),
                };
                assert_eq!(out.len(), values, "{field:?}");
            }
        }
    }
    if let Ok((mesh, _)) = Mesh::build(mesh) {
        assert_eq!(mesh.check(), Ok(()));
    }
    Ok(())
}

/// An error of a transfer function that was read from a file of `folder`.
fn judge_transfer<T>(folder: &Folder, result: Result<T, TransferError>) -> Result<T, String> {
    result.map_err(|error| {
        let message = error.to_string();
        assert!(message.contains(&*folder.path().to_string_lossy()), "names no file: {message}");
        message
    })
}

/// A transfer function, and the files of colour maps that it names.
fn transfer_function(bytes: &[u8]) -> Outcome {
    let folder = Folder::new();
    archive::unpack(bytes, folder.path());
    let tf = judge_transfer(&folder, TransferFunction::read(&folder.path().join("fuzzed.json")))?;
    texts::check_transfer_function(&tf);
    let json = folder.path().join("again.json");
    fs::write(&json, tf.to_json()).expect("a file");
    assert_eq!(TransferFunction::read(&json).expect("what was written is read"), tf);
    Ok(())
}

fn color_maps(bytes: &[u8]) -> Outcome {
    let (folder, path) = Folder::with("fuzzed.json", bytes);
    let result = read_color_maps(&path);
    let entries: Vec<ColorMapEntry> = result.clone().unwrap_or_default();
    for entry in &entries {
        for i in 0..=16 {
            let rgb = entry.map.eval(f64::from(i) / 16.0);
            assert!(rgb.iter().all(|c| (0.0..=1.0).contains(c)), "{rgb:?}");
        }
        texts::check_transfer_function(&TransferFunction::ramp(entry.map.clone()));
    }
    folder.judge(result)
}

/// Settings never fail: what cannot be read is a notice.
fn settings(bytes: &[u8]) -> Outcome {
    let (folder, _) = Folder::with("settings.json", bytes);
    let mut file = SettingsFile::at(folder.path());
    let (mut settings, notice) = file.load();
    let saved = file.save(&mut settings);
    let (again, _) = SettingsFile::at(folder.path()).load();
    // What is of a newer version is not written over.
    assert!(saved.is_some() || notice.is_some() || again == settings, "{again:?} instead of {settings:?}");
    notice.map_or(Ok(()), Err)
}

fn png(bytes: &[u8]) -> Outcome {
    let (folder, path) = Folder::with("fuzzed.png", bytes);
    let _ = folder.judge(read_png_text(&path, "Software"));
    folder.judge(read_image(&path).map(|planes| {
        let image = planes.color;
        assert_eq!(image.pixels.len(), image.width * image.height);
        assert!(image.pixels.iter().flatten().all(|c| (0.0..=1.0).contains(c)), "premultiplied values are 0..1");
    }))
}

fn exr(bytes: &[u8]) -> Outcome {
    let (folder, path) = Folder::with("fuzzed.exr", bytes);
    folder.judge(read_image(&path).map(|planes| {
        let pixels = planes.color.width * planes.color.height;
        let others = [planes.depth.pixels.len(), planes.normal.pixels.len(), planes.id.pixels.len()];
        assert_eq!(planes.color.pixels.len(), pixels);
        assert!(others.iter().all(|&other| other == 0 || other == pixels));
    }))
}
