//! Error at equal time: the least that each family reaches within a share of the full frame's time.

use super::summary::{path_label, series_of, summaries, transfer_functions_of};
use super::{PathSummary, is_judged_by};
use crate::bench::JUDGE_REFERENCE;
use crate::bench::report::BenchRun;
use crate::optics::OpticsKind;
use crate::render::KBuffer;
use std::fmt;

/// Time budgets as shares of a full frame's time.
pub const BUDGETS: [f64; 5] = [0.05, 0.1, 0.25, 0.5, 1.0];

/// What a family reduces to save time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Number of rays, by contrast.
    Rays,
    /// Number of pixels: a small image is enlarged.
    Image,
    /// Number of faces, by level of detail.
    Faces,
}

impl Family {
    /// All families.
    pub const ALL: [Self; 3] = [Self::Rays, Self::Image, Self::Faces];

    /// The family of a run on the CPU; `None` if it reduces nothing, or something else.
    pub fn of(run: &BenchRun) -> Option<Self> {
        let usual = KBuffer::default();
        let is_usual = is_comparable(run) && run.k.is_none_or(|k| k == usual.k) && run.exact_order != Some(false);
        match (&*run.mode, run.contrast, run.image_scale < 1.0) {
            _ if !is_usual => None,
            ("raycast", Some(_), false) => Some(Self::Rays),
            ("raycast", None, true) => Some(Self::Image),
            ("havs", None, false) if run.upsample.is_none() => Some(Self::Faces),
            _ => None,
        }
    }

    /// Name of the family in words.
    pub(in crate::bench) fn name(self) -> &'static str {
        match self {
            Self::Rays => "fewer rays",
            Self::Image => "small image",
            Self::Faces => "faces",
        }
    }
}

/// Whether a run has exact optics on the CPU, and values that are their own truth.
fn is_comparable(run: &BenchRun) -> bool {
    run.backend == "cpu" && run.optics == OpticsKind::Exact.to_string() && is_judged_by(run, JUDGE_REFERENCE)
}

/// Whether a run casts all rays at full size.
fn is_whole(run: &BenchRun) -> bool {
    is_comparable(run) && run.mode == "raycast" && run.contrast.is_none() && run.image_scale == 1.0
}

/// A path on all scenes of a series with one transfer function.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Difference from the default settings.
    pub label: String,
    /// Mean milliseconds of a frame over the scenes.
    pub ms: f64,
    /// Root mean square error over the scenes.
    pub rmse: f64,
    /// The upsampling filter of a small image, if it is named.
    pub upsample: Option<String>,
}

impl Setting {
    /// Difference from the default settings of its renderer.
    pub fn how(&self) -> &str {
        self.label.split_once(", ").map_or("all", |(_, how)| how)
    }
}

/// Error and time of each family on the scenes of a series with one transfer function.
#[derive(Clone, Debug, PartialEq)]
pub struct Curves<'a> {
    /// Name of the series.
    pub series: &'a str,
    /// Name of the transfer function.
    pub transfer_function: &'a str,
    /// The full frame, with all rays.
    pub whole: Setting,
    /// The settings of each family, in the order of [`Family::ALL`] and of their runs.
    pub families: [Vec<Setting>; 3],
}

/// The best settings within a time budget.
#[derive(Clone, Debug, PartialEq)]
pub struct EqualTime<'a> {
    /// Name of the series.
    pub series: &'a str,
    /// Name of the transfer function.
    pub transfer_function: &'a str,
    /// The budget, as a share of the full frame's time.
    pub budget: f64,
    /// The setting with the least error of each family, in the order of [`Family::ALL`]; `None` if all take longer.
    pub best: [Option<Setting>; 3],
}

impl EqualTime<'_> {
    /// The family with the least error; `None` if none is within the budget.
    pub fn winner(&self) -> Option<Family> {
        let reached = Family::ALL.into_iter().zip(&self.best).filter_map(|(of, best)| Some((of, best.as_ref()?.rmse)));
        reached.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(family, _)| family)
    }
}

/// The curves of each series and transfer function for which the full frame and at least one family were measured.
pub fn curves(runs: &[BenchRun]) -> Vec<Curves<'_>> {
    let all = summaries(runs);
    let mut found = Vec::new();
    for series in series_of(&all) {
        let of_series: Vec<&PathSummary<'_>> = all.iter().filter(|path| path.series == series).collect();
        let its_runs: Vec<&BenchRun> = of_series.iter().flat_map(|path| path.runs.iter().copied()).collect();
        for transfer_function in transfer_functions_of(&its_runs) {
            let has =
                |run: &BenchRun| run.scene.as_ref().is_some_and(|scene| scene.transfer_function == transfer_function);
            let paths = of_series.iter().map(|path| path.runs.iter().copied().filter(|run| has(run)).collect());
            let paths: Vec<Vec<&BenchRun>> = paths.collect();
            let Some(whole) = paths.iter().find(|runs| !runs.is_empty() && runs.iter().all(|run| is_whole(run))) else {
                continue;
            };
            let settings = |family| {
                let is_of =
                    |runs: &&Vec<&BenchRun>| !runs.is_empty() && runs.iter().all(|run| Family::of(run) == Some(family));
                paths.iter().filter(is_of).map(|runs| setting(runs)).collect::<Vec<_>>()
            };
            let families = Family::ALL.map(settings);
            if families.iter().any(|settings| !settings.is_empty()) {
                found.push(Curves { series, transfer_function, whole: setting(whole), families });
            }
        }
    }
    found
}

/// The best settings of each curve at each budget.
pub fn equal_time(runs: &[BenchRun]) -> Vec<EqualTime<'_>> {
    fn at<'a>(curves: &Curves<'a>, budget: f64) -> EqualTime<'a> {
        let best = curves.families.each_ref().map(|settings| {
            let within = settings.iter().filter(|setting| setting.ms <= budget * curves.whole.ms);
            within.min_by(|a, b| a.rmse.total_cmp(&b.rmse)).cloned()
        });
        EqualTime { series: curves.series, transfer_function: curves.transfer_function, budget, best }
    }
    curves(runs).into_iter().flat_map(|curves| BUDGETS.map(|budget| at(&curves, budget))).collect()
}

/// Combines the scenes of one path.
fn setting(runs: &[&BenchRun]) -> Setting {
    let count = runs.len() as f64;
    let label = runs.first().map(|run| path_label(run)).unwrap_or_default();
    let ms = runs.iter().map(|run| run.ms.p50).sum::<f64>() / count;
    let square = |run: &&BenchRun| run.error.as_ref().map_or(f64::NAN, |error| error.rmse * error.rmse);
    let rmse = (runs.iter().map(square).sum::<f64>() / count).sqrt();
    let upsample = runs.first().and_then(|run| run.upsample.clone());
    Setting { label, ms, rmse, upsample }
}

/// Runs of the accuracy suite at equal time, as Markdown: the winner of each row in bold.
#[derive(Clone, Copy, Debug)]
pub struct EqualTimeTable<'a>(pub &'a [BenchRun]);

impl fmt::Display for EqualTimeTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = equal_time(self.0);
        if rows.is_empty() {
            return Ok(());
        }
        let [rays, image, faces] = Family::ALL.map(Family::name);
        writeln!(f, "\nLeast RMSE within a share of the time of all rays\n")?;
        writeln!(f, "| series | transfer function | time | {rays} | {image} | {faces} |")?;
        writeln!(f, "|---|---|---|---|---|---|")?;
        for row in &rows {
            write!(f, "| {} | {} | {} % |", row.series, row.transfer_function, 100.0 * row.budget)?;
            for (family, best) in Family::ALL.into_iter().zip(&row.best) {
                let mark = if row.winner() == Some(family) { "**" } else { "" };
                match best {
                    None => write!(f, " - |")?,
                    Some(setting) => write!(f, " {mark}{:.1e}{mark} ({}) |", setting.rmse, setting.how())?,
                }
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::test_runs::run;

    fn faces(lod: f64, ms: f64, rmse: f64) -> BenchRun {
        let k = Some(KBuffer::default().k);
        BenchRun { mode: "havs".to_owned(), k, exact_order: Some(true), lod, ..run("jet", ms, rmse) }
    }

    fn rays(contrast: f64, ms: f64, rmse: f64) -> BenchRun {
        BenchRun { contrast: Some(contrast), ..run("jet", ms, rmse) }
    }

    fn image(scale: f64, ms: f64, rmse: f64) -> BenchRun {
        BenchRun { image_scale: scale, ..run("jet", ms, rmse) }
    }

    #[test]
    fn the_least_error_within_each_time_wins() {
        let runs = [
            run("jet", 100.0, 1e-7),
            rays(0.05, 9.0, 4e-4),
            rays(0.01, 40.0, 5e-5),
            image(0.25, 4.0, 3e-3),
            faces(1.0, 90.0, 1e-7),
            faces(0.1, 24.0, 2e-3),
        ];
        let rows = equal_time(&runs);
        let rmse = |row: &EqualTime<'_>| row.best.each_ref().map(|best| best.as_ref().map(|best| best.rmse));
        assert_eq!(rows.iter().map(|row| row.budget).collect::<Vec<_>>(), BUDGETS);
        assert_eq!(rmse(&rows[0]), [None, Some(3e-3), None]);
        assert_eq!(rmse(&rows[1]), [Some(4e-4), Some(3e-3), None]);
        assert_eq!(rmse(&rows[2]), [Some(4e-4), Some(3e-3), Some(2e-3)]);
        assert_eq!(rmse(&rows[3]), [Some(5e-5), Some(3e-3), Some(2e-3)]);
        assert_eq!(rmse(&rows[4]), [Some(5e-5), Some(3e-3), Some(1e-7)]);
        let winners = [Family::Image, Family::Rays, Family::Rays, Family::Rays, Family::Faces].map(Some);
        assert_eq!(rows.iter().map(EqualTime::winner).collect::<Vec<_>>(), winners);
        let text = EqualTimeTable(&runs).to_string();
        assert!(
            text.contains("| jet | dense | 10 % | **4.0e-4** (contrast 0.05) | 3.0e-3 (image 1/4) | - |"),
            "{text}"
        );
        assert!(text.contains("**1.0e-7** (all) |"), "{text}");
    }

    #[test]
    fn what_gives_up_two_things_or_something_else_is_no_family() {
        assert_eq!(Family::of(&run("jet", 1.0, 1e-7)), None);
        assert_eq!(Family::of(&BenchRun { image_scale: 0.5, ..faces(0.1, 1.0, 1.0) }), None);
        assert_eq!(Family::of(&BenchRun { upsample: Some("joint".to_owned()), ..faces(0.1, 1.0, 1.0) }), None);
        assert_eq!(Family::of(&BenchRun { k: Some(2), ..faces(0.1, 1.0, 1.0) }), None);
        assert_eq!(Family::of(&BenchRun { exact_order: Some(false), ..faces(0.1, 1.0, 1.0) }), None);
        assert_eq!(Family::of(&BenchRun { backend: "gpu".to_owned(), ..faces(0.1, 1.0, 1.0) }), None);
        assert_eq!(Family::of(&BenchRun { optics: "table3d".to_owned(), ..image(0.5, 1.0, 1.0) }), None);
        assert!(equal_time(&[rays(0.05, 1.0, 1.0)]).is_empty(), "nothing to compare with");
        assert!(equal_time(&[run("jet", 1.0, 1.0)]).is_empty() && EqualTimeTable(&[]).to_string().is_empty());
    }

    #[test]
    fn scenes_of_a_transfer_function_count_together() {
        let side = |run: BenchRun| {
            let mut run = run;
            run.scene.as_mut().unwrap().view = "side".to_owned();
            run
        };
        let runs = [
            run("jet", 100.0, 0.0),
            side(run("jet", 300.0, 0.0)),
            rays(0.05, 10.0, 3e-4),
            side(rays(0.05, 20.0, 4e-4)),
        ];
        let rows = equal_time(&runs);
        assert_eq!(rows[0].best[0], None);
        let best = rows[1].best[0].as_ref().unwrap();
        assert_eq!(best.ms, 15.0);
        assert!((best.rmse - (0.5 * (9e-8 + 16e-8_f64)).sqrt()).abs() < 1e-12);
    }
}
