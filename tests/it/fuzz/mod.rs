//! Every parser and the store reader on the committed corpus (`fuzz/corpus`) and on mutations of it: what is read is sound, what
//! is not read is one error that names the file; no panic, no abort, no endless loop, no memory for what a file merely claims.
//!
//! The mutants of a target are run by a process of its own, whose memory is limited: what ends a process ends only that one. The
//! same functions are run by `cargo fuzz`; see `fuzz/README.md`.

mod mutate;
mod planted;
mod seeds;
mod targets;

use mutate::{Random, mutated};
use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};
use targets::{TARGETS, Target};

const CORPUS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/corpus");

/// Further seeds of a target: files of that extension in a folder of the tests.
const FURTHER: &[(&str, &str, &str)] = &[("vtu", "tests/data/vtu", "vtu"), ("vtk", "tests/data/vtk", "vtk")];

/// Mutants of each target; fewer where each is a folder of many files, or one that is decompressed.
const MUTANTS: &[(&str, u64)] = &[
    ("vtu", 1500),
    ("pvd", 500),
    ("parts", 800),
    ("vtk", 1500),
    ("xdmf", 1200),
    ("exodus", 1200),
    ("exodus_parts", 500),
    ("ensight", 800),
    ("vtkhdf", 1200),
    ("npz", 800),
    ("raw", 800),
    ("transfer_function", 800),
    ("color_maps", 800),
    ("settings", 400),
    ("png", 1200),
    ("exr", 1200),
    ("store", 400),
    ("vq", 1200),
    ("chunk", 1200),
    ("camera", 500),
    ("tf_text", 500),
    ("options", 800),
    ("request", 800),
    ("command_line", 600),
];

const fn total() -> u64 {
    let (mut sum, mut i) = (0, 0);
    while i < MUTANTS.len() {
        sum += MUTANTS[i].1;
        i += 1;
    }
    sum
}
const _: () = assert!(total() >= 10_000);

/// The seed of the first mutant; those that follow count up. `TETREEL_FUZZ_SEED` is another one, `TETREEL_FUZZ_MUTANTS` another
/// number of mutants.
const SEED: u64 = 9;

/// Address space of a process that runs mutants, KiB. Without inputs it takes less than a third of this (threads, their stacks
/// and arenas); inputs are at most 60 kB, which a compressor can make 62 MB of.
const MEMORY_KIB: u64 = 1 << 20;

/// A process that has not ended by then hangs; it takes a few seconds on two cores.
const HANGS_AFTER: Duration = Duration::from_secs(300);

/// Share of mutants that must be refused: mutation that changes nothing of consequence finds nothing. The least that was measured
/// is 0.78 (`store`, much of which can be derived again).
const REFUSED_MIN: f64 = 0.1;

/// What a child is told.
const CHILD_TARGET: &str = "TETREEL_FUZZ_TARGET";
const CHILD_OUT: &str = "TETREEL_FUZZ_OUT";

macro_rules! replayed {
    ($($test:ident: $target:literal;)*) => {
        $(
            #[test]
            fn $test() {
                replay($target);
            }
        )*

        const REPLAYED: &[&str] = &[$($target),*];
    };
}

replayed! {
    any_bytes_are_a_vtu_file_or_an_error: "vtu";
    any_bytes_are_a_collection_or_an_error: "pvd";
    any_bytes_are_files_in_parts_or_an_error: "parts";
    any_bytes_are_a_legacy_file_or_an_error: "vtk";
    any_bytes_are_an_xdmf_series_or_an_error: "xdmf";
    any_bytes_are_an_exodus_file_or_an_error: "exodus";
    any_bytes_are_parts_of_an_exodus_file_or_an_error: "exodus_parts";
    any_bytes_are_an_ensight_case_or_an_error: "ensight";
    any_bytes_are_a_vtkhdf_series_or_an_error: "vtkhdf";
    any_bytes_are_arrays_of_numpy_or_an_error: "npz";
    any_bytes_are_a_raw_volume_or_an_error: "raw";
    any_bytes_are_a_transfer_function_or_an_error: "transfer_function";
    any_bytes_are_colour_maps_or_an_error: "color_maps";
    any_bytes_are_settings_or_a_notice: "settings";
    any_bytes_are_a_png_or_an_error: "png";
    any_bytes_are_an_exr_or_an_error: "exr";
    any_bytes_are_a_store_or_an_error: "store";
    any_bytes_are_blocks_or_an_error: "vq";
    any_bytes_are_a_chunk_or_an_error: "chunk";
    any_text_is_a_camera_or_an_error: "camera";
    any_text_is_a_transfer_function_or_an_error: "tf_text";
    any_text_is_an_option_or_an_error: "options";
    any_text_is_a_request_or_an_error: "request";
    any_words_are_a_command_line_or_an_error: "command_line";
}

#[test]
fn every_target_has_a_program_a_corpus_and_a_test() {
    let names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
    assert_eq!(names, REPLAYED);
    assert_eq!(names, MUTANTS.iter().map(|(name, _)| *name).collect::<Vec<_>>());
    let manifest = fs::read_to_string(Path::new(CORPUS).with_file_name("Cargo.toml")).unwrap();
    for name in &names {
        assert!(manifest.contains(&format!("name = \"{name}\"\npath = \"fuzz_targets/{name}.rs\"")), "{name}");
        let program = Path::new(CORPUS).with_file_name("fuzz_targets").join(format!("{name}.rs"));
        assert!(fs::read_to_string(program).unwrap().contains(&format!("targets::run(\"{name}\", bytes)")), "{name}");
    }
    let list = |folder: &str| fs::read_dir(Path::new(CORPUS).with_file_name(folder)).unwrap().count();
    assert_eq!((list("corpus"), list("fuzz_targets")), (names.len(), names.len()), "nothing is left over");
}

/// Runs a target in a process of its own.
fn replay(name: &str) {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz").join(name);
    let _ = fs::remove_dir_all(&out);
    fs::create_dir_all(&out).unwrap();
    if let Err(problem) = run_apart(name, &out) {
        panic!(
            "{name}: {problem}\ninputs that failed are in {}; fix the bug and keep one in {CORPUS}/{name}",
            out.display()
        );
    }
}

/// Runs the test that is the child's side, with limited memory where a shell can limit it; the error has what the child said.
fn run_apart(name: &str, out: &Path) -> Result<(), String> {
    let mut command = if cfg!(target_os = "linux") {
        let mut shell = Command::new("sh");
        let limit = format!("ulimit -c 0; ulimit -v {MEMORY_KIB} && exec \"$0\" \"$@\"");
        shell.args(["-c", &limit]).arg(std::env::current_exe().unwrap());
        shell
    } else {
        Command::new(std::env::current_exe().unwrap())
    };
    command.args(["--exact", "fuzz::the_mutants_of_one_target", "--ignored", "--nocapture", "--test-threads=1"]);
    command.env(CHILD_TARGET, name).env(CHILD_OUT, out);
    // Two threads at most: each has an arena and a stack, and there are tests beside this one.
    command.env("RAYON_NUM_THREADS", "2").env("MALLOC_ARENA_MAX", "2").env_remove("RUST_BACKTRACE");
    let (said, log) = (out.join("log"), fs::File::create(out.join("log")).unwrap());
    command.stdout(log.try_clone().unwrap()).stderr(log).stdin(Stdio::null());
    let mut child = command.spawn().unwrap();
    let begin = Instant::now();
    let status = loop {
        match child.try_wait().unwrap() {
            Some(status) => break status,
            None if begin.elapsed() > HANGS_AFTER => {
                let _ = child.kill();
                break child.wait().unwrap();
            }
            None => std::thread::sleep(Duration::from_millis(20)),
        }
    };
    let said = fs::read_to_string(said).unwrap_or_default();
    print!("{}", said.lines().filter(|line| line.starts_with("fuzz ")).map(|l| format!("{l}\n")).collect::<String>());
    if status.success() {
        return Ok(());
    }
    let hung = if begin.elapsed() > HANGS_AFTER { "did not end; " } else { "" };
    Err(format!("{hung}{status} ('{LAST}' is the input at hand)\n{said}"))
}

/// The input that is being run.
const LAST: &str = "last";

#[test]
#[ignore = "the tests beside it run it, with --ignored, in a process of its own for each target"]
fn the_mutants_of_one_target() {
    let (Ok(name), Some(out)) = (std::env::var(CHILD_TARGET), std::env::var_os(CHILD_OUT)) else { return };
    let known = TARGETS.iter().chain(planted::TARGETS).find(|target| target.name == name);
    let seeds = planted::seeds(&name).unwrap_or_else(|| corpus(&name));
    run_mutants(known.expect("a target"), &seeds, &PathBuf::from(out));
}

/// The inputs that are kept, by name.
fn corpus(name: &str) -> Vec<(String, Vec<u8>)> {
    let mut seeds = BTreeMap::new();
    let mut add = |folder: &Path, extension: Option<&str>| {
        for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
            let path = entry.unwrap().path();
            if extension.is_none_or(|wanted| path.extension().is_some_and(|e| e == wanted)) {
                seeds.insert(path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&path).unwrap());
            }
        }
    };
    add(&Path::new(CORPUS).join(name), None);
    for (_, folder, extension) in FURTHER.iter().filter(|further| further.0 == name) {
        add(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), Some(extension));
    }
    seeds.into_iter().collect()
}

/// Where the last panic was.
static PANICKED_AT: Mutex<String> = Mutex::new(String::new());

/// Outcomes of one target.
#[derive(Default)]
struct Tally {
    read: u64,
    refused: u64,
    /// Inputs that panicked, by the place of the panic.
    panics: BTreeMap<String, (String, u64)>,
    slowest: (Duration, String),
}

impl Tally {
    /// Runs one input, which is in a file meanwhile for when it ends the process. Keeps it if it panics.
    fn run(&mut self, target: &Target, input: &[u8], name: &str, out: &Path) -> bool {
        fs::write(out.join(LAST), input).unwrap();
        let begin = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| (target.run)(input)));
        if begin.elapsed() > self.slowest.0 {
            self.slowest = (begin.elapsed(), name.to_owned());
        }
        match outcome {
            Ok(Ok(())) => self.read += 1,
            Ok(Err(_)) => self.refused += 1,
            Err(_) => {
                let place = PANICKED_AT.lock().unwrap().clone();
                let count = &mut self.panics.entry(place).or_insert((name.to_owned(), 0)).1;
                *count += 1;
                if *count == 1 {
                    fs::write(out.join(name), input).unwrap();
                }
            }
        }
        matches!(outcome, Ok(Ok(())))
    }
}

fn run_mutants(target: &Target, seeds: &[(String, Vec<u8>)], out: &Path) {
    std::panic::set_hook(Box::new(|info| *PANICKED_AT.lock().unwrap() = info.to_string()));
    let number = |variable: &str| std::env::var(variable).ok().and_then(|text| text.parse().ok());
    let first: u64 = number("TETREEL_FUZZ_SEED").unwrap_or(SEED);
    let planned = MUTANTS.iter().find(|(name, _)| *name == target.name).map_or(planted::MUTANTS, |(_, count)| *count);
    let count: u64 = number("TETREEL_FUZZ_MUTANTS").unwrap_or(planned);
    let mut kept = Tally::default();
    let sound = seeds.iter().filter(|(name, bytes)| kept.run(target, bytes, &format!("corpus_{name}"), out)).count();
    let mut mutants = Tally::default();
    for seed in first..first + count {
        let mut random = Random::new(seed);
        let (input, other) = (&seeds[random.below(seeds.len())].1, &seeds[random.below(seeds.len())].1);
        mutants.run(target, &mutated(input, other, &mut random), &format!("seed_{seed}"), out);
    }
    let (read, refused) = (mutants.read, mutants.refused);
    let (slowest, name) = (mutants.slowest.0.as_secs_f64() * 1e3, &mutants.slowest.1);
    println!("\nfuzz {}: {sound} of {} inputs of the corpus are read", target.name, seeds.len());
    println!(
        "fuzz {}: of {count} mutants from seed {first} on {read} read, {refused} refused; slowest {slowest:.0} ms ({name})",
        target.name
    );
    let panics: Vec<_> = kept.panics.iter().chain(&mutants.panics).collect();
    for (place, (name, count)) in &panics {
        println!("{count} panics, the first with input {name}: {place}");
    }
    let _ = std::panic::take_hook();
    assert!(panics.is_empty(), "{} different panics", panics.len());
    assert!(sound > 0, "no seed is read: the parser is not reached");
    assert!(refused as f64 >= REFUSED_MIN * count as f64, "{refused} of {count} mutants are refused");
}
