//! Draws a [`Chart`] as SVG, with plotters.

use super::ticks::{exponent, label, log_ticks, power_of_ten};
use super::{Chart, Line, Panel, Point, Style};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;
use std::ops::Range;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn Error>>;

/// Size of a panel in pixels.
const PANEL_PX: (u32, u32) = (900, 540);
/// Colour-blind safe colours (Okabe and Ito), and two greys.
const COLORS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
    RGBColor(140, 140, 140),
];
const FONT: &str = "sans-serif";
/// Radius of a point without and with a name.
const RADIUS_PX: [i32; 2] = [3, 5];

/// The chart as an SVG document.
pub(super) fn svg(chart: &Chart) -> Result<String, Box<dyn Error>> {
    let mut svg = String::new();
    {
        let size = (PANEL_PX.0, PANEL_PX.1 * chart.panels.len().max(1) as u32);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        let areas = root.split_evenly((chart.panels.len().max(1), 1));
        areas.iter().zip(&chart.panels).try_for_each(|(area, panel)| draw_panel(area, chart, panel))?;
        root.present()?;
    }
    svg.push('\n');
    Ok(svg)
}

fn draw_panel(area: &Area<'_>, chart: &Chart, panel: &Panel) -> Drawn {
    let (across, up) = (across(panel), up(panel));
    let x_ticks = chart.x.ticks.clone().unwrap_or_else(|| log_ticks(across.start, across.end));
    let y_ticks = log_ticks(up.start, up.end);
    let has_zero = points_of(panel).any(|point| point.y <= 0.0);
    let note = if has_zero { " (errors of 0 lie on the lower edge)" } else { "" };
    let mut axes = ChartBuilder::on(area)
        .caption(format!("{}{note}", panel.title), (FONT, 20))
        .margin(14)
        .x_label_area_size(50)
        .y_label_area_size(80)
        .build_cartesian_2d(
            across.clone().log_scale().with_key_points(x_ticks),
            up.clone().log_scale().with_key_points(y_ticks),
        )?;
    axes.configure_mesh()
        .x_desc(chart.x.name.as_str())
        .y_desc(chart.y.as_str())
        .x_label_formatter(&|x| label(*x))
        .y_label_formatter(&|y| label(*y))
        .bold_line_style(BLACK.mix(0.15))
        .light_line_style(TRANSPARENT)
        .axis_desc_style((FONT, 15))
        .label_style((FONT, 13))
        .draw()?;
    let middle = (across.start * across.end).sqrt();
    for (line, color) in panel.lines.iter().zip(COLORS.iter().cycle()) {
        if line.points.is_empty() {
            continue;
        }
        let at = |point: &Point| (point.x, point.y.max(up.start));
        if line.style != Style::Points {
            axes.draw_series(LineSeries::new(line.points.iter().map(at), color.stroke_width(1)))?;
        }
        let color = *color;
        let circles = circles(line)
            .map(|point| Circle::new(at(point), RADIUS_PX[usize::from(point.name.is_some())], color.filled()));
        // Rectangles, so that every circle is a data point.
        let legend = move |(x, y)| Rectangle::new([(x, y - 3), (x + 14, y + 3)], color.filled());
        axes.draw_series(circles)?.label(line.name.as_str()).legend(legend);
    }
    for (point, aside) in named(panel) {
        let (anchor, along) = if point.x < middle { (HPos::Left, 8) } else { (HPos::Right, -8) };
        let style = (FONT, 12).into_font().color(&BLACK).pos(Pos::new(anchor, VPos::Center));
        let name = Text::new(point.name.clone().unwrap_or_default(), (along, aside), style);
        axes.draw_series([EmptyElement::at((point.x, point.y.max(up.start))) + name])?;
    }
    axes.configure_series_labels()
        .position(emptiest_corner(panel, &across, &up))
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .label_font((FONT, 13))
        .draw()?;
    Ok(())
}

/// The points that are drawn; a [`Style::Path`] draws none of its own.
fn circles(line: &Line) -> impl Iterator<Item = &Point> {
    line.points.iter().filter(|_| line.style != Style::Path)
}

/// Named points from left to right, with the offset of their names below: neighbours differ, as names are long.
fn named(panel: &Panel) -> impl Iterator<Item = (&Point, i32)> {
    const ASIDE_PX: [i32; 4] = [-9, 10, -22, 23];
    let mut named: Vec<&Point> = points_of(panel).filter(|point| point.name.is_some()).collect();
    named.sort_by(|a, b| a.x.total_cmp(&b.x));
    named.into_iter().zip(ASIDE_PX.into_iter().cycle())
}

fn points_of(panel: &Panel) -> impl Iterator<Item = &Point> {
    panel.lines.iter().flat_map(circles)
}

/// The corner with the fewest points, where the legend goes.
fn emptiest_corner(panel: &Panel, across: &Range<f64>, up: &Range<f64>) -> SeriesLabelPosition {
    /// Share of the panel that a legend covers, along each axis.
    const SHARE: f64 = 0.35;
    let share =
        |value: f64, range: &Range<f64>| (value.max(range.start) / range.start).ln() / (range.end / range.start).ln();
    let corners = [
        (SeriesLabelPosition::UpperRight, 1.0, 1.0),
        (SeriesLabelPosition::LowerLeft, 0.0, 0.0),
        (SeriesLabelPosition::LowerRight, 1.0, 0.0),
        (SeriesLabelPosition::UpperLeft, 0.0, 1.0),
    ];
    let points_in = |x: f64, y: f64| {
        let is_near = |p: &&Point| (share(p.x, across) - x).abs() < SHARE && (share(p.y, up) - y).abs() < SHARE;
        points_of(panel).filter(is_near).count()
    };
    let emptiest = corners.into_iter().min_by_key(|&(_, x, y)| points_in(x, y));
    emptiest.map_or(SeriesLabelPosition::UpperRight, |(corner, ..)| corner)
}

/// The range of the x axis, with a margin on both sides.
fn across(panel: &Panel) -> Range<f64> {
    const ROOM: f64 = 1.25;
    let positive = || points_of(panel).map(|point| point.x).filter(|&x| x > 0.0 && x.is_finite());
    match (positive().reduce(f64::min), positive().reduce(f64::max)) {
        (Some(lo), Some(hi)) => lo / ROOM..hi * ROOM,
        _ => 1.0..10.0,
    }
}

/// The range of the y axis: whole decades around the values above 0, and one more below if there are others.
fn up(panel: &Panel) -> Range<f64> {
    let positive = || points_of(panel).map(|point| point.y).filter(|&y| y > 0.0 && y.is_finite());
    let (Some(lo), Some(hi)) = (positive().reduce(f64::min), positive().reduce(f64::max)) else { return 1e-9..1e-8 };
    let has_zero = points_of(panel).any(|point| point.y <= 0.0);
    let first = exponent(lo, f64::floor) - i32::from(has_zero);
    power_of_ten(first)..power_of_ten(exponent(hi, f64::ceil).max(first + 1))
}

#[cfg(test)]
mod tests {
    use super::super::Axis;
    use super::*;
    use quick_xml::Reader;
    use quick_xml::events::Event;

    fn chart(panels: &[&[(f64, f64)]]) -> Chart {
        let panel = |points: &&[(f64, f64)]| {
            let point = |&(x, y): &(f64, f64)| Point { x, y, name: (x < 5.0).then(|| "a < b & \"c\"".to_owned()) };
            let points: Vec<Point> = points.iter().map(point).collect();
            let front = Line { name: "front".to_owned(), points: points.clone(), style: Style::Path };
            let joined = Line { name: "of it".to_owned(), points, style: Style::Joined };
            Panel { title: "<A & B>".to_owned(), lines: vec![joined, front] }
        };
        let x = Axis { name: "x [ms]".to_owned(), ticks: None };
        Chart { x, y: "y [1]".to_owned(), panels: panels.iter().map(panel).collect() }
    }

    /// Element names and text of an SVG, which must be well-formed.
    fn read(svg: &str) -> (Vec<String>, String) {
        let mut reader = Reader::from_str(svg);
        let (mut names, mut text, mut depth) = (Vec::new(), String::new(), 0);
        loop {
            match reader.read_event().unwrap() {
                Event::Start(e) => {
                    names.push(e.name().as_ref().to_owned());
                    depth += 1;
                }
                Event::Empty(e) => names.push(e.name().as_ref().to_owned()),
                Event::End(_) => depth -= 1,
                Event::Text(t) => text.push_str(&format!("{}\n", &*t)),
                Event::GeneralRef(r) => text.push_str(&format!("&{};", &*r)),
                Event::Eof => break,
                _ => {}
            }
        }
        assert_eq!(depth, 0, "elements are open at the end");
        (names, text)
    }

    #[test]
    fn the_document_is_well_formed_and_has_a_circle_for_every_point() {
        for points in [&[(1.0, 1e-7), (10.0, 1e-3), (20.0, 2e-2)][..], &[(3.0, 1e-3)], &[(1.0, 0.0), (2.0, 0.0)]] {
            let (names, _) = read(&svg(&chart(&[points, points])).unwrap());
            assert_eq!(names.iter().filter(|name| *name == "circle").count(), 2 * points.len(), "{points:?}");
            assert_eq!(names[0], "svg");
        }
        assert!(read(&svg(&chart(&[&[(1.0, 1.0)]])).unwrap()).1.contains("&lt;"), "names are escaped");
    }

    #[test]
    fn an_error_of_zero_lies_on_the_lower_edge_and_is_said() {
        let has_note = |points: &[(f64, f64)]| read(&svg(&chart(&[points])).unwrap()).1.contains("errors of 0");
        assert!(has_note(&[(1.0, 0.0), (2.0, 1e-3)]));
        assert!(!has_note(&[(1.0, 1e-5), (2.0, 1e-3)]));
        let range = |points: &[(f64, f64)]| up(&chart(&[points]).panels[0]);
        assert_eq!(range(&[(1.0, 0.0), (2.0, 2e-3)]), 1e-4..1e-2);
        assert_eq!(range(&[(1.0, 1e-3), (2.0, 1e-3)]), 1e-3..1e-2);
        assert_eq!(range(&[(1.0, 0.0)]), 1e-9..1e-8);
    }

    #[test]
    fn every_decade_has_its_label() {
        let (_, text) = read(&svg(&chart(&[&[(1.0, 2e-6), (300.0, 0.5)]])).unwrap());
        for tick in ["1e-6", "1e-5", "1e-4", "0.001", "0.01", "0.1", "1", "10", "100"] {
            assert!(text.lines().any(|line| line.trim() == tick), "{tick} is missing in {text}");
        }
    }
}
