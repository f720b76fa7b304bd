//! Plots of the accuracy suite, as SVG: error against time with the Pareto front and by what is given up, and against what it depends on.
//!
//! All axes are logarithmic. An error of 0 has no place on such an axis: it is drawn at the lower edge, and the plot says so.

mod charts;
mod draw;
mod ticks;

use super::BenchRun;
use crate::error::{FileError, FileResult};
use crate::files;
use charts::{CHARTS, chart};
use std::path::{Path, PathBuf};

/// What became of the plots.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlotReport {
    /// Files that were written.
    pub written: Vec<PathBuf>,
    /// Names of those that were not, as there is nothing to show in them, and what would be.
    pub empty: Vec<(&'static str, &'static str)>,
}

/// A plot: axes, and panels from top to bottom.
#[derive(Clone, Debug, PartialEq)]
struct Chart {
    x: Axis,
    y: String,
    panels: Vec<Panel>,
}

#[derive(Clone, Debug, PartialEq)]
struct Axis {
    name: String,
    /// Where its ticks are; `None`: at round numbers.
    ticks: Option<Vec<f64>>,
}

#[derive(Clone, Debug, PartialEq)]
struct Panel {
    title: String,
    lines: Vec<Line>,
}

/// Points of one kind.
#[derive(Clone, Debug, PartialEq)]
struct Line {
    name: String,
    points: Vec<Point>,
    style: Style,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Style {
    /// Points alone.
    Points,
    /// Points joined by a line.
    Joined,
    /// A line alone, through points that others have drawn.
    Path,
}

#[derive(Clone, Debug, PartialEq)]
struct Point {
    x: f64,
    y: f64,
    /// What is written beside it; those with a name are larger.
    name: Option<String>,
}

/// Checks that plots can be written to a folder, which is made if it is not there: before long work, not after it.
///
/// # Errors
/// If it cannot be made, or takes no file.
pub fn check_folder(folder: &Path) -> FileResult<()> {
    std::fs::create_dir_all(folder).map_err(|e| FileError::io(folder, "make the folder", &e))?;
    CHARTS.iter().try_for_each(|kind| files::check_place(&folder.join(kind.file)))
}

/// Writes the plots of these runs to a folder. Each file is written whole or not at all; one with nothing to show is not
/// written, and one of an earlier run with its name stays.
///
/// # Errors
/// If the folder does not take them.
pub fn write_plots(folder: &Path, runs: &[BenchRun]) -> FileResult<PlotReport> {
    let mut report = PlotReport::default();
    for kind in &CHARTS {
        let path = folder.join(kind.file);
        match chart(kind, runs) {
            Some(chart) => {
                let svg = draw::svg(&chart).map_err(|e| FileError::invalid(&path, "", format!("not drawn: {e}")))?;
                files::replace_with(&path, svg.as_bytes())?;
                report.written.push(path);
            }
            None => report.empty.push((kind.file, kind.needs)),
        }
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::test_runs::run;

    #[test]
    fn a_plot_with_nothing_to_show_is_not_written_but_said() {
        let temp = tempfile::tempdir().unwrap();
        let folder = temp.path().join("plots/here");
        check_folder(&folder).unwrap();
        let report = write_plots(&folder, &[run("jet", 10.0, 1e-3)]).unwrap();
        assert_eq!(report.written, [folder.join("accuracy_time.svg")]);
        assert_eq!(report.empty.len(), CHARTS.len() - 1);
        assert!(report.empty.iter().any(|(name, needs)| *name == "accuracy_ratio.svg" && needs.contains("codec")));
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "nothing is left beside it");
        assert_eq!(write_plots(&folder, &[]).unwrap().written, [] as [PathBuf; 0]);
    }

    #[test]
    fn a_folder_that_is_a_file_is_refused() {
        let temp = tempfile::tempdir().unwrap();
        std::fs::write(temp.path().join("file"), "").unwrap();
        assert!(check_folder(&temp.path().join("file")).is_err());
        assert!(check_folder(&temp.path().join("file/below")).is_err());
    }
}
