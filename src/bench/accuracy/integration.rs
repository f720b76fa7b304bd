//! The error of integrating one segment, by method and table size: difficult transfer functions, lengths from 1e-9 to 1e3 unit distances.
//! Without mesh or image the only rounding is the method's own; covers cases that the suite's scenes may not contain.
//!
//! The truth is [`quadrature`] in f64, whose own error (1e-14) is tested.

use crate::node_table::{Node, NodeTable, NodeTableError};
use crate::optics::exact::ExactTable;
use crate::optics::partial::PartialTable;
use crate::optics::quadrature::quadrature;
use crate::optics::table3d::{Table3d, Table3dResolution};
use crate::optics::{Accumulator, Integrator, OpticsKind};
use crate::random::SplitMix64;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Decades of the lengths of segments, in unit distances.
pub const LENGTH_DECADES: std::ops::RangeInclusive<i32> = -9..=3;
/// Longest segment of the pre-integrated tables in unit distances: an edge of a tenth of the box's diagonal. Longer ones are
/// composited in parts.
const TABLE_LENGTH: f64 = 10.0;
/// Seed of the segments.
const SEED: u64 = 0x5e6;
/// Optical depth of a panel of the quadrature.
const PANEL_DEPTH: f64 = 0.5;

/// The errors of one method on the segments of one length through one transfer function.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IntegrationRun {
    /// Name of the transfer function.
    pub case: String,
    /// `exact`, `partial` or `table3d`.
    pub optics: String,
    /// Entries of the table along a scalar axis; `None` without a table.
    pub table_size: Option<usize>,
    /// Length of the segments in unit distances.
    pub length: f64,
    /// Number of segments.
    pub segments: usize,
    /// Largest error of a channel of premultiplied colour.
    pub color_max: f64,
    /// Root mean square error of colour, over segments and channels.
    pub color_rms: f64,
    /// Largest error of opacity.
    pub opacity_max: f64,
    /// Root mean square error of opacity, over segments.
    pub opacity_rms: f64,
    /// Largest relative error of opacity, where opacity is not 0.
    pub opacity_relative: f64,
}

/// A transfer function with its segments.
struct Case {
    name: &'static str,
    table: NodeTable,
    /// Draws the scalars at the ends of a segment.
    segment: fn(&mut SplitMix64) -> (f64, f64),
}

/// Errors of all methods on all cases, with tables of these sizes and `segments` segments of each length.
///
/// # Errors
/// None in practice: the transfer functions are constants of this module.
pub fn integration_errors(table_sizes: &[usize], segments: usize) -> Result<Vec<IntegrationRun>, NodeTableError> {
    let mut runs = Vec::new();
    for case in cases()? {
        let table = &case.table;
        let mut measure = |optics: OpticsKind, size, run: &dyn Fn(&Case, f64) -> Errors| {
            runs.extend(LENGTH_DECADES.map(|decade| {
                let length = 10f64.powi(decade);
                run(&case, length).as_run(case.name, optics, size, length)
            }));
        };
        let (exact, partial) = (ExactTable::new(table, 1.0), PartialTable::new(table, 1.0));
        measure(OpticsKind::Exact, None, &|case, length| errors_of(&exact, case, length, segments));
        measure(OpticsKind::Partial, None, &|case, length| errors_of(&partial, case, length, segments));
        for &scalars in table_sizes {
            let resolution = Table3dResolution { scalars, ..Table3dResolution::default() };
            let table3d = Table3d::new(table, Table3d::range_of(table), TABLE_LENGTH, 1.0, resolution);
            let of_table = |case: &Case, length| errors_of(&table3d, case, length, segments);
            measure(OpticsKind::Table3d, Some(scalars), &of_table);
        }
    }
    Ok(runs)
}

/// Error sums over segments.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    segments: usize,
    color_max: f64,
    color_squares: f64,
    opacity_max: f64,
    opacity_squares: f64,
    opacity_relative: f64,
}

impl Errors {
    fn add(&mut self, truth: [f64; 4], found: [f32; 4]) {
        let off: [f64; 4] = std::array::from_fn(|c| (f64::from(found[c]) - truth[c]).abs());
        // A NaN counts as the largest error.
        let off = off.map(|d| if d.is_nan() { f64::MAX } else { d });
        self.segments += 1;
        self.color_max = off[..3].iter().copied().fold(self.color_max, f64::max);
        self.color_squares += off[..3].iter().map(|d| d * d).sum::<f64>();
        self.opacity_max = self.opacity_max.max(off[3]);
        self.opacity_squares += off[3] * off[3];
        // Below this f32 loses significant bits.
        if truth[3] > f64::from(f32::MIN_POSITIVE) {
            self.opacity_relative = self.opacity_relative.max(off[3] / truth[3]);
        }
    }

    fn as_run(self, case: &str, optics: OpticsKind, table_size: Option<usize>, length: f64) -> IntegrationRun {
        let count = self.segments.max(1) as f64;
        IntegrationRun {
            case: case.to_owned(),
            optics: optics.to_string(),
            table_size,
            length,
            segments: self.segments,
            color_max: self.color_max,
            color_rms: (self.color_squares / (3.0 * count)).sqrt(),
            opacity_max: self.opacity_max,
            opacity_rms: (self.opacity_squares / count).sqrt(),
            opacity_relative: self.opacity_relative,
        }
    }
}

/// Errors of an integrator on the segments of a case, which are the same for each integrator and length.
fn errors_of<I: Integrator>(integrator: &I, case: &Case, length: f64, segments: usize) -> Errors {
    let mut random = SplitMix64::new(SEED);
    let mut errors = Errors::default();
    for _ in 0..segments {
        let (s0, s1) = (case.segment)(&mut random);
        let mut light = Accumulator::TRANSPARENT;
        integrator.segment(&mut integrator.enter(s0), s0, s1, length, &mut light);
        errors.add(quadrature(&case.table, s0, s1, length, PANEL_DEPTH), light.pixel());
    }
    errors
}

/// The cases: scalars from 0 to 1 except in the last, unit distance 1.
fn cases() -> Result<Vec<Case>, NodeTableError> {
    let tau = |alpha: f64| -(-alpha).ln_1p();
    let rainbow = |i: usize| [[1.0, 0.2, 0.0], [0.1, 0.9, 0.2], [0.1, 0.3, 1.0], [0.9, 0.9, 0.3]][i % 4];
    let table = |nodes: Vec<(f64, [f64; 3], f64)>| {
        NodeTable::new(nodes.into_iter().map(|(scalar, rgb, tau)| Node { scalar, rgb, tau }).collect())
    };
    let wave = |s: f64, k: f64| 0.5 + 0.5 * (k * s).sin();
    let smooth = (0..=32).map(|i| {
        let s = f64::from(i) / 32.0;
        (s, [wave(s, 3.0), wave(s, 4.0), wave(s, 5.0)], tau(0.05 + 0.45 * s))
    });
    let opaque = tau(1.0 - 1e-7);
    let spike =
        [(0.0, 0.01), (SPIKE, 0.01), (SPIKE + SPIKE_WIDTH / 2.0, opaque), (SPIKE + SPIKE_WIDTH, 0.01), (1.0, 0.0)];
    let plateau = [(0.0, 0.0), (0.35, 0.0), (0.4, opaque), (0.6, opaque), (0.65, 0.1), (1.0, 0.1)];
    let colored = |of: &[(f64, f64)]| of.iter().enumerate().map(|(i, &(s, tau))| (s, rainbow(i), tau)).collect();
    let steps = (0..8).flat_map(|i| {
        let value = (rainbow(i), tau([0.0, 0.9, 0.1, 0.5][i % 4]));
        [i, i + 1].map(|end| (end as f64 / 8.0, value.0, value.1))
    });
    let wide = (0..=76)
        .step_by(4)
        .enumerate()
        .map(|(i, decade)| (10f64.powi(decade - 38), rainbow(i), tau([0.3, 0.0, 0.8][i % 3])));
    Ok(vec![
        Case { name: "smooth", table: table(smooth.collect())?, segment: anywhere },
        Case { name: "spike of 1/4096", table: table(colored(&spike))?, segment: at_the_spike },
        Case { name: "alpha 1 - 1e-7", table: table(colored(&plateau))?, segment: anywhere },
        Case { name: "steps", table: table(steps.collect())?, segment: anywhere },
        Case { name: "1e-38 to 1e38", table: table(wide.collect())?, segment: of_all_magnitudes },
    ])
}

/// Position and width of the spike.
const SPIKE: f64 = 0.3;
const SPIKE_WIDTH: f64 = 1.0 / 4096.0;

/// Segments that span 1e-4 to all of the range, some partly outside.
fn anywhere(random: &mut SplitMix64) -> (f64, f64) {
    let s0 = random.between(-0.05, 1.05);
    (s0, s0 + span(random, -4.0))
}

/// [`anywhere`], with half of the segments beginning within four widths of the spike.
fn at_the_spike(random: &mut SplitMix64) -> (f64, f64) {
    let (s0, s1) = anywhere(random);
    let near = SPIKE + SPIKE_WIDTH * random.between(-4.0, 5.0);
    if random.unit() < 0.5 { (s0, s1) } else { (near, near + (s1 - s0)) }
}

/// Ends of any magnitude.
fn of_all_magnitudes(random: &mut SplitMix64) -> (f64, f64) {
    let [a, b] = [(); 2].map(|()| 10f64.powf(random.between(-38.5, 38.0)));
    (a, b)
}

/// A random signed share of the range, uniform in its logarithm.
fn span(random: &mut SplitMix64, least: f64) -> f64 {
    let size = 10f64.powf(random.between(least, 0.0));
    if random.unit() < 0.5 { size } else { -size }
}

/// The runs as a Markdown table: for each method and case the worst over all lengths, the largest colour error up to a tenth of and up to
/// one unit distance, and the relative opacity error of the shortest.
#[derive(Clone, Copy, Debug)]
pub struct IntegrationTable<'a>(pub &'a [IntegrationRun]);

impl fmt::Display for IntegrationTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(first) = self.0.first() else { return Ok(()) };
        let is_alike = |a: &IntegrationRun, b: &IntegrationRun| {
            (&a.case, &a.optics, a.table_size) == (&b.case, &b.optics, b.table_size)
        };
        let lengths = self.0.iter().filter(|run| is_alike(run, first)).count();
        writeln!(f, "\n### One segment\n\n{} segments of each of {lengths} lengths\n", first.segments)?;
        writeln!(
            f,
            "| transfer function | optics | colour: max to 0.1 | to 1 | all | RMS | opacity: max | RMS | shortest |"
        )?;
        writeln!(f, "|---|---|---|---|---|---|---|---|---|")?;
        self.0.chunk_by(is_alike).try_for_each(|runs| row(f, runs))
    }
}

/// Writes the row of some lengths with one method.
fn row(f: &mut fmt::Formatter<'_>, runs: &[IntegrationRun]) -> fmt::Result {
    let Some(first) = runs.first() else { return Ok(()) };
    let worst = |longest: f64, of: fn(&IntegrationRun) -> f64| {
        runs.iter().filter(|run| run.length <= longest).map(of).fold(0.0, f64::max)
    };
    let size = first.table_size.map_or_else(String::new, |size| format!(" {size}"));
    write!(f, "| {} | {}{size} |", first.case, first.optics)?;
    for longest in [0.1, 1.0, f64::INFINITY] {
        write!(f, " {:.1e} |", worst(longest, |run| run.color_max))?;
    }
    let all: [fn(&IntegrationRun) -> f64; 3] = [|run| run.color_rms, |run| run.opacity_max, |run| run.opacity_rms];
    all.iter().try_for_each(|of| write!(f, " {:.1e} |", worst(f64::INFINITY, *of)))?;
    let shortest = runs.iter().min_by(|a, b| a.length.total_cmp(&b.length)).map_or(0.0, |run| run.opacity_relative);
    writeln!(f, " {shortest:.1e} |")
}
