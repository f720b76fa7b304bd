//! Plots of the accuracy suite, as SVG: error against time (with the Pareto front, and by family), and error against single settings.
//!
//! All axes are logarithmic. An error of 0 is drawn at the lower edge, with a note in the plot.

mod charts;
mod draw;
mod ticks;

use super::BenchRun;
use crate::error::{FileError, FileResult};
use crate::files;
use charts::{CHARTS, chart};
use std::path::{Path, PathBuf};

/// Result of writing the plots.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlotReport {
    /// Written files.
    pub written: Vec<PathBuf>,
    /// Names of plots without data, which were not written, and the data that each needs.
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
    /// Positions of the ticks; `None` places them at round numbers.
    ticks: Option<Vec<f64>>,
}

#[derive(Clone, Debug, PartialEq)]
struct Panel {
    title: String,
    lines: Vec<Line>,
}

/// A series of points in one style.
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
    /// A line alone, through points drawn by others.
    Path,
}

#[derive(Clone, Debug, PartialEq)]
struct Point {
    x: f64,
    y: f64,
    /// Label of the point; labelled points are larger.
    name: Option<String>,
}

/// Checks before the measurements that plots can be written to a folder, which is created if missing.
///
/// # Errors
/// If the folder cannot be created or written to.
pub fn check_folder(folder: &Path) -> FileResult<()> {
    std::fs::create_dir_all(folder).map_err(|e| FileError::io(folder, "make the folder", &e))?;
    CHARTS.iter().try_for_each(|kind| files::check_place(&folder.join(kind.file)))
}

/// Writes the plots of these runs to a folder. Each file is written whole or not at all; a plot without data is not written, and an older
/// file of its name stays.
///
/// # Errors
/// If a file cannot be written.
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
