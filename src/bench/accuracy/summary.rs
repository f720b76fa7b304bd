//! Summary of the accuracy suite by path: worst error over the scenes, and median time.

use crate::bench::pareto_front;
use crate::bench::report::{BenchRun, RunError};
use crate::bench::statistics::median;
use crate::codec::raw;
use crate::optics::OpticsKind;
use crate::pipeline::UpsampleKind;
use crate::render::KBuffer;
use crate::render::functions::SheetSpacing;
use std::fmt;

/// A path on one data set.
#[derive(Clone, Debug)]
pub struct PathSummary<'a> {
    /// The data set whose values are the truth.
    pub series: &'a str,
    /// The data set that was rendered.
    pub dataset: &'a str,
    /// Name of the path.
    pub label: String,
    /// Runs of the path, scene by scene.
    pub runs: Vec<&'a BenchRun>,
    /// Median over the scenes of the median milliseconds of a frame.
    pub ms: f64,
    /// Largest error of any scene: RMSE, and maximum of a channel. `None` for the judge.
    pub worst: Option<(f64, f64)>,
}

/// Label of a run's path: renderer, and differences from the defaults.
pub fn path_label(run: &BenchRun) -> String {
    let mut label = run.mode.clone();
    if run.backend == "gpu" {
        label.push_str(" GPU");
    }
    if run.lod < 1.0 {
        label.push_str(&format!(", {} % of faces", percent(run.lod)));
    }
    let usual = KBuffer::default();
    match (run.k, run.exact_order) {
        (Some(k), Some(true)) if k != usual.k => label.push_str(&format!(", k = {k}")),
        (Some(k), Some(false)) => label.push_str(&format!(", k = {k} inexact")),
        _ => {}
    }
    match run.sheets {
        Some(SheetSpacing::Error(error)) => label.push_str(&format!(", error {error}")),
        Some(SheetSpacing::Count(count)) => label.push_str(&format!(", {count} sheets")),
        None => {}
    }
    if run.optics == OpticsKind::Partial.to_string() {
        label.push_str(", partial");
    }
    if let Some(size) = run.table_size {
        label.push_str(&format!(", table {size}"));
    }
    if run.image_scale != 1.0 {
        label.push_str(&format!(", image 1/{}", percent(1.0 / run.image_scale / 100.0)));
    }
    if let Some(filter) = run.upsample.as_ref().filter(|&filter| *filter != UpsampleKind::default().to_string()) {
        label.push_str(&format!(", {filter}"));
    }
    if let Some(contrast) = run.contrast {
        label.push_str(&format!(", contrast {}", (contrast * 1e6).round() / 1e6));
    }
    if let (false, Some(ratio)) = (run.codec == raw::NAME, run.ratio) {
        label.push_str(&format!(", {} {ratio:.0}:1", run.codec));
    }
    label
}

/// A share in per cent, without rounding residue.
fn percent(share: f64) -> f64 {
    (share * 1e4).round() / 1e2
}

/// The runs of the accuracy suite grouped by path, in the order of their first runs. Other runs are ignored.
pub fn summaries(runs: &[BenchRun]) -> Vec<PathSummary<'_>> {
    let mut all: Vec<PathSummary<'_>> = Vec::new();
    for run in runs {
        let Some(scene) = &run.scene else { continue };
        let label = path_label(run);
        let same = |s: &&mut PathSummary<'_>| s.series == scene.series && s.dataset == run.dataset && s.label == label;
        match all.iter_mut().find(same) {
            Some(summary) => summary.runs.push(run),
            None => all.push(PathSummary {
                series: &scene.series,
                dataset: &run.dataset,
                label,
                runs: vec![run],
                ms: 0.0,
                worst: None,
            }),
        }
    }
    for summary in &mut all {
        summary.ms = median(&summary.runs.iter().map(|run| run.ms.p50).collect::<Vec<_>>());
        summary.worst = summary.worst_where(|_| true);
    }
    all
}

impl PathSummary<'_> {
    /// Largest errors of the runs that `wanted` accepts: RMSE, and maximum of a channel.
    pub fn worst_where(&self, wanted: impl Fn(&BenchRun) -> bool) -> Option<(f64, f64)> {
        let errors = self.runs.iter().filter(|run| wanted(run)).filter_map(|run| run.error.as_ref());
        errors.fold(None, |worst: Option<(f64, f64)>, error| {
            let (rmse, max) = worst.unwrap_or_default();
            Some((rmse.max(error.rmse), max.max(error.max)))
        })
    }

    /// The largest FLIP of any scene.
    pub fn worst_flip(&self) -> Option<f64> {
        let flips = self.runs.iter().filter_map(|run| run.error.as_ref()?.flip);
        flips.reduce(f64::max)
    }
}

/// Pareto front of a series in time and error: indices into `all`.
pub fn front_of(all: &[PathSummary<'_>], series: &str) -> Vec<usize> {
    let of_series: Vec<(usize, [f64; 2])> = all
        .iter()
        .enumerate()
        .filter(|(_, summary)| summary.series == series)
        .filter_map(|(at, summary)| Some((at, [summary.ms, summary.worst?.0])))
        .collect();
    let points: Vec<[f64; 2]> = of_series.iter().map(|(_, point)| *point).collect();
    pareto_front(&points).into_iter().map(|at| of_series[at].0).collect()
}

/// Names of the judged series, in order.
pub(in crate::bench) fn series_of<'a>(all: &[PathSummary<'a>]) -> Vec<&'a str> {
    distinct(all.iter().map(|summary| summary.series))
}

/// Names of the transfer functions of some runs, in order.
pub(in crate::bench) fn transfer_functions_of<'a>(runs: &[&'a BenchRun]) -> Vec<&'a str> {
    let scenes = runs.iter().filter_map(|run| run.scene.as_ref());
    distinct(scenes.map(|scene| scene.transfer_function.as_str()))
}

/// The items without repetitions, in order.
pub(super) fn distinct<T: PartialEq>(items: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut distinct = Vec::new();
    for item in items {
        if !distinct.contains(&item) {
            distinct.push(item);
        }
    }
    distinct
}

/// Runs of the accuracy suite as Markdown: a table for each series, with the Pareto front of time and error in bold.
#[derive(Clone, Copy, Debug)]
pub struct AccuracyTable<'a>(pub &'a [BenchRun]);

impl fmt::Display for AccuracyTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = summaries(self.0);
        for series in series_of(&all) {
            let of_series: Vec<(usize, &PathSummary<'_>)> =
                all.iter().enumerate().filter(|(_, summary)| summary.series == series).collect();
            let Some(first) = of_series.first().and_then(|(_, summary)| summary.runs.first()) else { continue };
            let scenes = of_series[0].1.runs.len();
            let ([width, height], cells) = (first.size, first.cells);
            writeln!(f, "\n{series}: {cells} cells, {width}x{height}, {scenes} scenes, {} threads\n", first.threads)?;
            let functions =
                transfer_functions_of(&of_series.iter().flat_map(|(_, s)| s.runs.clone()).collect::<Vec<_>>());
            let columns: String = functions.iter().map(|tf| format!(" {tf}: RMSE | max |")).collect();
            writeln!(f, "| path | ms |{columns} FLIP |")?;
            writeln!(f, "|---|---|{}---|", "---|---|".repeat(functions.len()))?;
            let front = front_of(&all, series);
            for (at, summary) in of_series {
                row(f, summary, &functions, front.contains(&at))?;
            }
        }
        Ok(())
    }
}

fn row(f: &mut fmt::Formatter<'_>, summary: &PathSummary<'_>, functions: &[&str], is_in_front: bool) -> fmt::Result {
    let mark = if is_in_front { "**" } else { "" };
    write!(f, "| {mark}{}{mark} | {:.1} |", summary.label, summary.ms)?;
    for function in functions {
        let of_function = |run: &BenchRun| run.scene.as_ref().is_some_and(|scene| scene.transfer_function == *function);
        match summary.worst_where(of_function) {
            Some((rmse, max)) => write!(f, " {rmse:.1e} | {max:.1e} |")?,
            None => write!(f, " - | - |")?,
        }
    }
    match summary.worst_flip() {
        Some(flip) => writeln!(f, " {flip:.1e} |"),
        None => writeln!(f, " - |"),
    }
}

/// Whether a run was compared with this judge.
pub(in crate::bench) fn is_judged_by(run: &BenchRun, judge: &str) -> bool {
    run.error.as_ref().is_some_and(|error: &RunError| error.judge == judge)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::test_runs::run;

    #[test]
    fn labels_say_how_a_path_differs_from_the_usual() {
        assert_eq!(path_label(&run("jet", 1.0, 1e-6)), "raycast");
        let havs = BenchRun { mode: "havs".to_owned(), k: Some(8), exact_order: Some(true), ..run("jet", 1.0, 0.0) };
        assert_eq!(path_label(&havs), "havs");
        assert_eq!(path_label(&BenchRun { lod: 0.05, ..havs.clone() }), "havs, 5 % of faces");
        assert_eq!(path_label(&BenchRun { k: Some(2), ..havs.clone() }), "havs, k = 2");
        let inexact = BenchRun { exact_order: Some(false), backend: "gpu".to_owned(), ..havs };
        assert_eq!(path_label(&inexact), "havs GPU, k = 8 inexact");
        let small = BenchRun { image_scale: 0.25, table_size: Some(64), ..run("jet", 1.0, 0.0) };
        assert_eq!(path_label(&small), "raycast, table 64, image 1/4");
        let sheets = |spacing| BenchRun { sheets: Some(spacing), mode: "sheets".to_owned(), ..run("jet", 1.0, 0.0) };
        assert_eq!(path_label(&sheets(SheetSpacing::Error(1e-3))), "sheets, error 0.001");
        assert_eq!(path_label(&sheets(SheetSpacing::Count(128))), "sheets, 128 sheets");
        let fewer = BenchRun { contrast: Some(f64::from(0.05_f32)), ..run("jet", 1.0, 0.0) };
        assert_eq!(path_label(&fewer), "raycast, contrast 0.05");
        let partial = BenchRun { optics: "partial".to_owned(), ..run("jet", 1.0, 0.0) };
        assert_eq!(path_label(&partial), "raycast, partial");
        let packed = BenchRun { codec: "vq".to_owned(), ratio: Some(12.4), ..run("jet", 1.0, 0.0) };
        assert_eq!(path_label(&packed), "raycast, vq 12:1");
    }

    #[test]
    fn the_table_has_the_worst_of_each_transfer_function_and_the_front_in_bold() {
        let with = |function: &str, ms: f64, rmse: f64, scale: f64| {
            let mut run = BenchRun { image_scale: scale, ..run("jet", ms, rmse) };
            run.scene.as_mut().unwrap().transfer_function = function.to_owned();
            run
        };
        let runs = [
            with("dense", 10.0, 1e-7, 1.0),
            with("tents", 30.0, 3e-7, 1.0),
            with("dense", 12.0, 2e-7, 1.0),
            with("dense", 5.0, 1e-2, 0.5),
            with("dense", 25.0, 1e-1, 0.25),
        ];
        let all = summaries(&runs);
        assert_eq!((all.len(), all[0].ms, all[0].worst.unwrap().0), (3, 12.0, 3e-7));
        let text = AccuracyTable(&runs).to_string();
        let rows: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
        assert_eq!(rows[0], "| path | ms | dense: RMSE | max | tents: RMSE | max | FLIP |");
        assert_eq!(rows[2], "| **raycast** | 12.0 | 2.0e-7 | 2.0e-6 | 3.0e-7 | 3.0e-6 | 1.0e-3 |");
        assert_eq!(rows[3], "| **raycast, image 1/2** | 5.0 | 1.0e-2 | 1.0e-1 | - | - | 1.0e-3 |");
        assert!(rows[4].starts_with("| raycast, image 1/4 |"), "{text}");
    }
}
