//! The list of plots and their contents.

use super::{Axis, Chart, Line, Panel, Point, Style};
use crate::bench::accuracy::{Curves, Family, PathSummary, Setting, curves, summaries};
use crate::bench::accuracy::{front_of, is_judged_by, series_of, transfer_functions_of};
use crate::bench::{BenchRun, JUDGE_RAW, JUDGE_REFERENCE};
use crate::render::KBuffer;

/// A plot of the suite.
pub(super) struct Kind {
    /// File name.
    pub file: &'static str,
    /// Data that the plot needs.
    pub needs: &'static str,
    shows: Shows,
}

/// Content of a plot.
enum Shows {
    Time,
    Families,
    Factor(Factor),
}

/// A plot of error against one setting.
struct Factor {
    /// Title after "error against".
    title: &'static str,
    /// Label of the x axis, with its unit.
    axis: &'static str,
    /// Whether the x axis has ticks at its points only.
    ticks_at_points: bool,
    /// Position of a run on the x axis, and the name of its line on the CPU; `None` leaves it out.
    place: fn(&BenchRun) -> Option<(f64, &'static str)>,
    /// Whether values changed by a codec are required.
    is_of_codecs: bool,
}

/// Y axis of all plots except by family.
const ERROR_AXIS: &str = "largest RMSE of the scenes [1 = full intensity]";

/// All plots.
pub(super) static CHARTS: [Kind; 7] = [
    Kind { file: "accuracy_time.svg", needs: "a path that was judged", shows: Shows::Time },
    Kind {
        file: "accuracy_families.svg",
        needs: "all rays beside fewer of them, small images or faces, on the CPU",
        shows: Shows::Families,
    },
    Kind {
        file: "accuracy_ratio.svg",
        needs: "a series in a lossy codec beside the same in codec raw",
        shows: Shows::Factor(Factor {
            title: "compression",
            axis: "bytes as f32 over bytes in the store [1]",
            ticks_at_points: false,
            place: |run| (is_plain(run) && run.mode == "raycast").then_some((run.ratio?, "ray caster")),
            is_of_codecs: true,
        }),
    },
    Kind {
        file: "accuracy_k.svg",
        needs: "faces with several sizes of the buffer",
        shows: Shows::Factor(Factor {
            title: "the buffer of fragments",
            axis: "fragments that a pixel holds back, k [fragments]",
            ticks_at_points: true,
            place: |run| {
                let line = if run.exact_order? { "exact order" } else { "as they come" };
                (run.lod == 1.0 && is_plain(run)).then_some((f64::from(run.k?), line))
            },
            is_of_codecs: false,
        }),
    },
    Kind {
        file: "accuracy_lod.svg",
        needs: "faces at several levels of detail",
        shows: Shows::Factor(Factor {
            title: "the level of detail",
            axis: "interior faces that are drawn [%]",
            ticks_at_points: true,
            place: |run| {
                let is_usual = has_usual_buffer(run) && is_plain(run);
                is_usual.then_some((100.0 * run.lod, "faces"))
            },
            is_of_codecs: false,
        }),
    },
    Kind {
        file: "accuracy_table.svg",
        needs: "tables of several sizes",
        shows: Shows::Factor(Factor {
            title: "the size of the pre-integrated table",
            axis: "entries along each scalar axis [entries]",
            ticks_at_points: true,
            place: |run| {
                let is_alone = run.mode == "raycast" && run.image_scale == 1.0;
                is_alone.then_some((run.table_size? as f64, "ray caster"))
            },
            is_of_codecs: false,
        }),
    },
    Kind {
        file: "accuracy_scale.svg",
        needs: "images of several sizes",
        shows: Shows::Factor(Factor {
            title: "the size of the image that is rendered and enlarged",
            axis: "width rendered over width shown [1]",
            ticks_at_points: true,
            place: |run| {
                let is_bilinear = run.upsample.as_ref().is_none_or(|filter| filter == "bilinear");
                let is_alone =
                    run.mode == "raycast" && run.table_size.is_none() && run.contrast.is_none() && is_bilinear;
                is_alone.then_some((run.image_scale, "ray caster"))
            },
            is_of_codecs: false,
        }),
    },
];

/// Whether a run is at full size and integrated without a table.
fn is_plain(run: &BenchRun) -> bool {
    run.image_scale == 1.0 && run.table_size.is_none() && run.contrast.is_none()
}

fn has_usual_buffer(run: &BenchRun) -> bool {
    let KBuffer { k, exact_order } = KBuffer::default();
    run.k == Some(k) && run.exact_order == Some(exact_order)
}

/// The plot of these runs; `None` without data.
pub(super) fn chart(kind: &Kind, runs: &[BenchRun]) -> Option<Chart> {
    let chart = match &kind.shows {
        Shows::Time => against_time(runs),
        Shows::Families => by_family(runs),
        Shows::Factor(factor) => against(factor, runs),
    };
    Some(chart).filter(|chart| !chart.panels.is_empty())
}

/// Error against time, a panel for each series.
fn against_time(runs: &[BenchRun]) -> Chart {
    let all = summaries(runs);
    let panels = series_of(&all).into_iter().filter_map(|series| time_panel(&all, series)).collect();
    let x = Axis { name: "time of a frame, median of the scenes [ms]".to_owned(), ticks: None };
    Chart { x, y: ERROR_AXIS.to_owned(), panels }
}

/// The paths of a series by renderer and backend, and their Pareto front.
fn time_panel(all: &[PathSummary<'_>], series: &str) -> Option<Panel> {
    let front = front_of(all, series);
    let point = |at: usize| {
        let (summary, is_in_front) = (&all[at], front.contains(&at));
        let y = summary.worst?.0;
        (summary.series == series).then(|| Point { x: summary.ms, y, name: is_in_front.then(|| summary.label.clone()) })
    };
    let kinds = [
        ("ray caster", "raycast", "cpu"),
        ("faces", "havs", "cpu"),
        ("ray caster, GPU", "raycast", "gpu"),
        ("faces, GPU", "havs", "gpu"),
    ];
    let line = |(name, mode, backend): (&str, &str, &str)| {
        let is_of_kind =
            |at: &usize| all[*at].runs.first().is_some_and(|run| run.mode == mode && run.backend == backend);
        let points = (0..all.len()).filter(is_of_kind).filter_map(point).collect();
        Line { name: name.to_owned(), points, style: Style::Points }
    };
    let mut lines: Vec<Line> = kinds.into_iter().map(line).collect();
    let through = front.iter().filter_map(|&at| Some(Point { name: None, ..point(at)? })).collect();
    lines.push(Line { name: "Pareto front".to_owned(), points: through, style: Style::Path });
    let is_empty = lines.iter().all(|line| line.points.is_empty());
    (!is_empty).then(|| Panel { title: format!("Error against time: {series}"), lines })
}

/// Error against time by family, a panel for each series and transfer function.
fn by_family(runs: &[BenchRun]) -> Chart {
    let panels = curves(runs).iter().map(family_panel).collect();
    let x = Axis { name: "time of a frame, mean of the scenes [ms]".to_owned(), ticks: None };
    Chart { x, y: "RMSE of the scenes together [1 = full intensity]".to_owned(), panels }
}

/// A line per family through its settings (of filters only the bilinear one), and the full frame. Only the first and last point of a line
/// have names, since others would overlap.
fn family_panel(curves: &Curves<'_>) -> Panel {
    let line = |(family, settings): (Family, &Vec<Setting>)| {
        let is_usual = |of: &&Setting| of.upsample.as_ref().is_none_or(|filter| filter == "bilinear");
        let point = |of: &Setting| Point { x: of.ms, y: of.rmse, name: Some(of.how().to_owned()) };
        let mut points: Vec<Point> = settings.iter().filter(is_usual).map(point).collect();
        if let [_, between @ .., _] = points.as_mut_slice() {
            between.iter_mut().for_each(|point| point.name = None);
        }
        Line { name: family.name().to_owned(), points, style: Style::Joined }
    };
    let mut lines: Vec<Line> = Family::ALL.into_iter().zip(&curves.families).map(line).collect();
    let whole = Point { x: curves.whole.ms, y: curves.whole.rmse, name: None };
    lines.push(Line { name: "all rays".to_owned(), points: vec![whole], style: Style::Points });
    let title = format!("Error against time: {}, {}", curves.series, curves.transfer_function);
    Panel { title, lines }
}

/// Error against one setting, a panel for each transfer function, a line for each series and variant.
fn against(factor: &Factor, runs: &[BenchRun]) -> Chart {
    let is_wanted = |run: &&BenchRun| {
        let is_own = is_judged_by(run, JUDGE_REFERENCE);
        run.scene.is_some()
            && (is_own || factor.is_of_codecs && is_judged_by(run, JUDGE_RAW))
            && (factor.place)(run).is_some()
    };
    let runs: Vec<&BenchRun> = runs.iter().filter(is_wanted).collect();
    let panel = |function: &str| {
        let lines: Vec<Line> = lines(factor, &runs, function);
        (!lines.is_empty()).then(|| Panel { title: format!("Error against {}: {function}", factor.title), lines })
    };
    let panels: Vec<Panel> = transfer_functions_of(&runs).into_iter().filter_map(panel).collect();
    let points = panels.iter().flat_map(|panel| &panel.lines).flat_map(|line| &line.points);
    let mut ticks: Vec<f64> = points.map(|point| point.x).collect();
    ticks.sort_by(f64::total_cmp);
    ticks.dedup();
    let x = Axis { name: factor.axis.to_owned(), ticks: factor.ticks_at_points.then_some(ticks) };
    Chart { x, y: ERROR_AXIS.to_owned(), panels }
}

/// The lines of a transfer function: the largest error of runs at each position. A line needs two positions.
fn lines(factor: &Factor, runs: &[&BenchRun], function: &str) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for run in runs {
        let (Some(scene), Some(error), Some((x, variant))) = (&run.scene, &run.error, (factor.place)(run)) else {
            continue;
        };
        if scene.transfer_function != function {
            continue;
        }
        let on_gpu = if run.backend == "gpu" { ", GPU" } else { "" };
        let name = format!("{}, {variant}{on_gpu}", scene.series);
        let at = lines.iter().position(|line| line.name == name).unwrap_or_else(|| {
            lines.push(Line { name, points: Vec::new(), style: Style::Joined });
            lines.len() - 1
        });
        match lines[at].points.iter_mut().find(|point| point.x == x) {
            Some(point) => point.y = point.y.max(error.rmse),
            None => lines[at].points.push(Point { x, y: error.rmse, name: None }),
        }
    }
    lines.iter_mut().for_each(|line| line.points.sort_by(|a, b| a.x.total_cmp(&b.x)));
    lines.retain(|line| line.points.len() > 1);
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::test_runs::run;

    fn kind(file: &str) -> &'static Kind {
        CHARTS.iter().find(|kind| kind.file == file).unwrap()
    }

    #[test]
    fn the_front_is_named_and_a_line_goes_through_it() {
        let small = |scale: f64, ms, rmse| BenchRun { image_scale: scale, ..run("jet", ms, rmse) };
        let runs = [small(1.0, 10.0, 0.0), small(0.5, 5.0, 1e-2), small(0.25, 6.0, 1e-1), run("heart", 3.0, 1e-7)];
        let chart = chart(kind("accuracy_time.svg"), &runs).unwrap();
        assert_eq!(chart.panels.len(), 2);
        let lines = &chart.panels[0].lines;
        let names: Vec<Option<&str>> = lines[0].points.iter().map(|point| point.name.as_deref()).collect();
        assert_eq!(names, [Some("raycast"), Some("raycast, image 1/2"), None]);
        let front: Vec<f64> = lines.last().unwrap().points.iter().map(|point| point.x).collect();
        assert_eq!(front, [5.0, 10.0]);
        assert_eq!(chart.panels[1].title, "Error against time: heart");
    }

    #[test]
    fn each_family_has_a_line_through_what_it_reaches() {
        let fewer = |contrast, ms, rmse| BenchRun { contrast: Some(contrast), ..run("jet", ms, rmse) };
        let small = |filter: &str, ms, rmse| BenchRun {
            image_scale: 0.25,
            upsample: Some(filter.to_owned()),
            ..run("jet", ms, rmse)
        };
        let faces = |lod, ms, rmse| BenchRun { mode: "havs".to_owned(), lod, ..run("jet", ms, rmse) };
        let runs = [
            run("jet", 100.0, 1e-7),
            fewer(0.2, 9.0, 2e-3),
            fewer(0.1, 12.0, 1e-3),
            fewer(0.05, 20.0, 4e-4),
            small("joint", 30.0, 2e-3),
            small("bilinear", 5.0, 3e-3),
            faces(0.5, 70.0, 1e-2),
            run("heart", 10.0, 1e-7),
        ];
        let chart = chart(kind("accuracy_families.svg"), &runs).unwrap();
        assert_eq!(chart.panels.len(), 1, "a series without a family has no lines");
        let of = |line: &Line| (line.name.clone(), line.points.iter().map(|p| (p.x, p.y)).collect::<Vec<_>>());
        let lines: Vec<_> = chart.panels[0].lines.iter().map(of).collect();
        let expected = [
            ("fewer rays", vec![(9.0, 2e-3), (12.0, 1e-3), (20.0, 4e-4)]),
            ("small image", vec![(5.0, 3e-3)]),
            ("faces", vec![(70.0, 1e-2)]),
            ("all rays", vec![(100.0, 1e-7)]),
        ];
        assert_eq!(lines, expected.map(|(name, points)| (name.to_owned(), points)));
        let names: Vec<_> = chart.panels[0].lines[0].points.iter().map(|point| point.name.as_deref()).collect();
        assert_eq!(names, [Some("contrast 0.2"), None, Some("contrast 0.05")]);
    }

    #[test]
    fn a_line_has_the_worst_of_the_views_in_the_order_of_its_axis() {
        let faces = |k: u8, exact_order: bool, rmse: f64| BenchRun {
            mode: "havs".to_owned(),
            k: Some(k),
            exact_order: Some(exact_order),
            ..run("jet", 1.0, rmse)
        };
        let level = BenchRun { lod: 0.5, ..faces(8, true, 0.5) };
        let runs = [faces(8, false, 1e-3), faces(2, false, 1e-2), faces(2, false, 2e-2), faces(8, true, 0.0), level];
        let k = chart(kind("accuracy_k.svg"), &runs).unwrap();
        let points: Vec<(f64, f64)> = k.panels[0].lines[0].points.iter().map(|point| (point.x, point.y)).collect();
        assert_eq!((points.as_slice(), k.panels[0].lines.len()), (&[(2.0, 2e-2), (8.0, 1e-3)][..], 1));
        assert_eq!((k.x.ticks, k.panels[0].lines[0].name.as_str()), (Some(vec![2.0, 8.0]), "jet, as they come"));
        let lod = chart(kind("accuracy_lod.svg"), &runs).unwrap();
        assert_eq!(lod.x.ticks, Some(vec![50.0, 100.0]));
        assert!(chart(kind("accuracy_table.svg"), &runs).is_none());
    }

    #[test]
    fn compression_is_shown_only_against_the_values_from_before_it() {
        let packed = |judge: &str| {
            let mut packed = BenchRun { codec: "vq".to_owned(), ratio: Some(20.0), ..run("jet", 1.0, 1e-2) };
            packed.error.as_mut().unwrap().judge = judge.to_owned();
            packed
        };
        let ratio = kind("accuracy_ratio.svg");
        let shown = chart(ratio, &[run("jet", 1.0, 1e-7), packed(JUDGE_RAW)]).unwrap();
        assert_eq!(shown.panels[0].lines[0].points.len(), 2);
        assert!(chart(ratio, &[run("jet", 1.0, 1e-7), run("jet", 2.0, 1e-7)]).is_none());
        assert!(chart(kind("accuracy_scale.svg"), &[packed(JUDGE_RAW), run("jet", 1.0, 1e-7)]).is_none());
    }
}
