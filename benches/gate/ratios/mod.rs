//! Ratios of run times within one process. Each has an upper limit: one and a half times the reference machine's ratio; vectors may not be
//! slower than scalar code. Times of different days or machines are never compared.

mod cores;
mod data;
mod frames;
mod renderers;

use crate::table::{print, row};
use crate::{Failures, Trouble, Verdict};
use std::error::Error;
use std::process::Command;
use std::time::Instant;

/// Limit of a ratio, as a multiple of the reference machine's.
const SLACK: f64 = 1.5;

/// Number of measurements of a ratio beyond its limit before it fails.
const ATTEMPTS: usize = 3;

/// A ratio of run times.
struct Ratio {
    /// Name of the ratio, and of the place that slows it down.
    name: &'static str,
    what: &'static str,
    /// Ratio on the reference machine: two cores of a Xeon with AVX-512.
    here: f64,
    /// Whether it compares vectors with scalar code: the gain depends on the processor, but there may be no loss.
    of_vectors: bool,
    /// Whether several threads work at once: it then requires a free core for each of two.
    threads: bool,
    measure: fn() -> Result<f64, Box<dyn Error>>,
}

const RATIOS: [Ratio; 12] = [
    Ratio {
        name: "skipping",
        what: "all that can be is left out / nothing",
        here: 0.49,
        of_vectors: false,
        threads: false,
        measure: frames::skipping,
    },
    Ratio {
        name: "lanes",
        what: "ray caster, lanes / portable",
        // Measured: 0.51, and 0.79 on a Xeon with AMX, whose scalar code is faster by that much.
        here: 0.79,
        of_vectors: true,
        threads: false,
        measure: renderers::lanes,
    },
    Ratio {
        name: "face_lanes",
        what: "faces, lanes / portable",
        here: 0.73,
        of_vectors: true,
        threads: false,
        measure: renderers::face_lanes,
    },
    Ratio {
        name: "decode_lanes",
        what: "a step of codec vq / a plain loop",
        // Measured: 0.34 to 0.45, and 0.49 on a Xeon with AMX.
        here: 0.49,
        of_vectors: true,
        threads: false,
        measure: data::decode_lanes,
    },
    Ratio {
        name: "pipelined",
        what: "30 frames, pipelined / in turn",
        here: 1.0,
        of_vectors: false,
        threads: true,
        measure: frames::pipelined,
    },
    Ratio {
        name: "few_faces",
        what: "10 % of the inner faces / all",
        // Measured: 0.25, and 0.31 on a Xeon with AMX.
        here: 0.31,
        of_vectors: false,
        threads: false,
        measure: renderers::few_faces,
    },
    Ratio {
        name: "opaque_rays",
        what: "the slowest opacity from .5 to 1 / .05",
        here: 0.8,
        of_vectors: false,
        threads: false,
        measure: renderers::opaque_rays,
    },
    Ratio {
        name: "large_meshes",
        what: "a frame per cell, 1M cells / 100k",
        here: 0.22,
        of_vectors: false,
        threads: false,
        measure: renderers::large_meshes,
    },
    Ratio {
        name: "coarse_meshes",
        what: "10k cells / 100k",
        // On two cores of an EPYC, like the next one.
        here: 0.63,
        of_vectors: false,
        threads: false,
        measure: renderers::coarse_meshes,
    },
    Ratio {
        name: "first_frame",
        what: "the first frame / the fifth",
        here: 14.0,
        of_vectors: false,
        threads: false,
        measure: frames::first_frame,
    },
    Ratio {
        name: "late_frames",
        what: "frames around 490 / around 10",
        here: 1.0,
        of_vectors: false,
        threads: false,
        measure: frames::late_frames,
    },
    Ratio {
        name: "import",
        what: "import of .vtu files / a hash of their bytes",
        here: 1.9,
        of_vectors: false,
        threads: true,
        measure: data::import,
    },
];

impl Ratio {
    fn limit(&self) -> f64 {
        let limit = SLACK * self.here;
        match self.of_vectors {
            true if has_avx512() => limit.min(1.0),
            // Processors with shorter vectors.
            true => 1.0,
            false => limit,
        }
    }

    fn measured(&self) -> Result<f64, Trouble> {
        (self.measure)().map_err(|e| Trouble(format!("ratio '{}': {e}", self.name)))
    }
}

fn has_avx512() -> bool {
    #[cfg(target_arch = "x86_64")]
    return matches!(pulp::Arch::new(), pulp::Arch::V4(_));
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Measures all ratios; returns those beyond their limits.
pub fn gate() -> Failures {
    let started = Instant::now();
    let mut rows = vec![row(["ratio", "here", "limit", "value", "verdict", "what"])];
    let mut failures = Vec::new();
    for ratio in &RATIOS {
        let (value, verdict) = judged(ratio)?;
        let [here, limit, value] = [ratio.here, ratio.limit(), value].map(|number| format!("{number:.3}"));
        if verdict == SLOWER {
            failures.push(format!("{} is {value}, beyond {limit} ({})", ratio.name, ratio.what));
        }
        rows.push(row([ratio.name, &here, &limit, &value, verdict, ratio.what]));
    }
    print(&rows);
    let all_said = if failures.is_empty() {
        "none is beyond its limit"
    } else {
        "something has become slower beside something else"
    };
    println!("ratios: {all_said}");
    eprintln!("ratios taken in {:.0} s", started.elapsed().as_secs_f64());
    Ok(failures)
}

const SLOWER: &str = "SLOWER";

/// Measures a ratio until it is within its limit, or the attempts are used up; returns it with the verdict.
fn judged(ratio: &Ratio) -> Result<(f64, &'static str), Trouble> {
    let (mut value, mut counts) = (f64::NAN, false);
    for attempt in 1..=ATTEMPTS {
        let was_free = !ratio.threads || cores::are_free();
        value = ratio.measured()?;
        if value <= ratio.limit() {
            return Ok((value, if attempt == 1 { "ok" } else { "ok, measured again" }));
        }
        let is_free = was_free && (!ratio.threads || cores::are_free());
        counts |= is_free;
        let why = if is_free { "" } else { ", and the cores were NOT FREE: this says nothing" };
        println!("{}: {value:.3} is beyond {:.3} (attempt {attempt} of {ATTEMPTS}{why})", ratio.name, ratio.limit());
    }
    Ok((value, if counts { SLOWER } else { "NOT JUDGED: no two free cores" }))
}

/// Measures one ratio once; returns whether it is within its limit.
pub fn once(name: &str) -> Verdict {
    let ratio = RATIOS.iter().find(|ratio| ratio.name == name).ok_or(format!("there is no ratio '{name}'"))?;
    let value = ratio.measured()?;
    println!("{value}");
    Ok(value <= ratio.limit())
}

/// Shows that each ratio is within its limit, and beyond it if slowed down.
pub fn prove() -> Verdict {
    let mut all = gate()?.is_empty();
    let mut rows = vec![row(["ratio", "limit", "slowed down", "verdict"])];
    for ratio in &RATIOS {
        let mut command = Command::new(std::env::current_exe()?);
        let output = command.args(["ratio", ratio.name]).env("TETREEL_SLOWDOWN", ratio.name).output()?;
        let value = String::from_utf8_lossy(&output.stdout).trim().parse::<f64>().map_err(|_| {
            Trouble(format!("ratio '{}': {}", ratio.name, String::from_utf8_lossy(&output.stderr).trim()))
        })?;
        let verdict = if output.status.code() == Some(1) { "trips" } else { "DOES NOT TRIP" };
        all &= verdict == "trips";
        rows.push(row([ratio.name, &format!("{:.3}", ratio.limit()), &format!("{value:.3}"), verdict]));
    }
    print(&rows);
    Ok(all)
}

/// Runs `work` with a single rayon thread.
fn on_one_thread<T: Send>(work: impl FnOnce() -> Result<T, String> + Send) -> Result<T, Box<dyn Error>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(work).map_err(Into::into)
}
