//! Instruction counts: this program runs itself under callgrind, once for each kernel.

use crate::baseline::{BAND, Baseline, Change, Counts, Tools, compare};
use crate::table::{grouped, print, row};
use crate::tools::{baseline_path, tools};
use crate::{Failures, RENEW, Trouble, Verdict, kernels, parent};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// The function that callgrind counts, `kernels::counted_by_callgrind`, with any mangling.
const COUNTED: &str = "*counted_by_callgrind*";

/// Counts, and compares with the baseline, or with the parent commit if the tools differ from the baseline's.
pub fn gate() -> Failures {
    let tools = tools()?;
    let baseline = committed()?;
    let Some(other) = baseline.other_tools(&tools) else {
        let counts = count(false)?;
        return Ok(judge(&baseline.kernels, &counts, "baseline"));
    };
    println!("the baseline is not of these tools ({other}): the counts are compared with those of the parent commit");
    let before = parent::counts()?;
    Ok(judge(&before, &count(false)?, "parent"))
}

/// The committed baseline.
pub fn committed() -> Result<Baseline, Trouble> {
    let path = baseline_path();
    let text =
        fs::read_to_string(&path).map_err(|e| Trouble(format!("{}: {e}; write it with: {RENEW}", path.display())))?;
    Baseline::parse(&text, &path, &kernels::names(), RENEW).map_err(Trouble)
}

/// Prints the counts for another gate: `{ name: count }`.
pub fn print_json() -> Verdict {
    let _: Tools = tools()?;
    println!("{}", serde_json::to_string(&count(false)?)?);
    Ok(true)
}

/// Prints counts beside older ones; returns those that are not within the band.
pub fn judge(old: &Counts, new: &Counts, of: &str) -> Vec<String> {
    let mut rows = vec![row(["kernel", of, "instructions", "change", "verdict"])];
    let (mut worst, mut failures) = (None, Vec::new());
    for (name, &count) in new {
        let before = old.get(name).copied();
        let (more, change) = compare(before, count);
        let verdict = match change {
            Change::Same => "ok",
            Change::Slower => "SLOWER",
            Change::Faster => "FASTER",
            Change::New => "new",
        };
        worst = worst.max(match change {
            Change::Same | Change::New => None,
            Change::Faster => Some(false),
            Change::Slower => Some(true),
        });
        let (before, more) = match before {
            Some(before) => (grouped(before), format!("{:+.2} %", 100.0 * more)),
            None => ("-".to_owned(), "-".to_owned()),
        };
        if !matches!(change, Change::Same | Change::New) {
            failures.push(format!("{name} takes {} instructions, {more} ({verdict})", grouped(count)));
        }
        rows.push(row([name, &before, &grouped(count), &more, verdict]));
    }
    print(&rows);
    let band = 100.0 * BAND;
    match worst {
        None => println!("counts: all within {band} %"),
        Some(true) => {
            println!("counts: kernels take over {band} % more instructions than before. If that is worth it: {RENEW}")
        }
        Some(false) => {
            println!("counts: kernels take over {band} % fewer instructions than before. So that this stays: {RENEW}")
        }
    }
    failures
}

/// Counts all kernels, one per processor at a time; if `slowed`, each with its own place slowed down.
pub fn count(slowed: bool) -> Result<Counts, Trouble> {
    let started = Instant::now();
    // A name of fixed length without dots, since some kernels process paths.
    let scratch = tempfile::Builder::new().prefix("gate-").rand_bytes(8).tempdir()?;
    let (next, found) = (Mutex::new(kernels::names().into_iter()), Mutex::new(Vec::new()));
    let work = || {
        loop {
            let name = next.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(name) = name else { return };
            let count = count_one(name, &scratch.path().join(name), slowed);
            found.lock().unwrap_or_else(PoisonError::into_inner).push((name.to_owned(), count));
        }
    };
    std::thread::scope(|scope| {
        let side_by_side = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        (0..side_by_side).for_each(|_| _ = scope.spawn(work));
    });
    let found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
    let counts = found.into_iter().map(|(name, count)| Ok((name, count?))).collect::<Result<_, Trouble>>()?;
    eprintln!("counted in {:.0} s", started.elapsed().as_secs_f64());
    Ok(counts)
}

/// Counts one kernel, with files of its own in `folder`.
fn count_one(name: &str, folder: &Path, slowed: bool) -> Result<u64, Trouble> {
    let fail = |problem: String| Trouble(format!("kernel '{name}': {problem}"));
    let (data, out) = (folder.join("data"), folder.join("out"));
    fs::create_dir_all(&data)?;
    fs::create_dir_all(&out)?;
    let mut command = Command::new("valgrind");
    command.args(["--quiet", "--tool=callgrind", "--separate-threads=yes", "--callgrind-out-file=../out/counts"]);
    command.arg(format!("--toggle-collect={COUNTED}"));
    command.arg(std::env::current_exe()?).args(["kernel", name, "."]);
    // Environment variables and names of temporary folders must not change a count.
    command.env_clear().current_dir(&data);
    // Small allocations come from lists by size; otherwise they depend on the lengths of folder names.
    command.env("GLIBC_TUNABLES", "glibc.malloc.tcache_max=65536:glibc.malloc.tcache_count=127");
    if slowed {
        command.env("TETREEL_SLOWDOWN", name);
    }
    let output = command.output().map_err(|e| fail(format!("valgrind cannot be run: {e}")))?;
    if !output.status.success() {
        return Err(fail(format!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr).trim())));
    }
    let mut counts = Vec::new();
    for entry in fs::read_dir(&out)? {
        let text = fs::read_to_string(entry?.path())?;
        // The file without a thread number is empty.
        if text.is_empty() {
            continue;
        }
        let total = text.lines().find_map(|line| line.strip_prefix("totals:")?.trim().parse::<u64>().ok());
        counts.push(total.ok_or_else(|| fail("callgrind gives no totals".to_owned()))?);
    }
    // One file per thread that was ever started.
    match counts[..] {
        [0] => Err(fail("nothing was counted: callgrind did not see the function that is counted".to_owned())),
        [count] => Ok(count),
        [] => Err(fail("callgrind has written nothing".to_owned())),
        _ => Err(fail(format!("{} threads, and only the main thread is counted: {counts:?}", counts.len()))),
    }
}
