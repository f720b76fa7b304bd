use super::*;
use crate::transfer::{ColorMap, Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use std::collections::HashSet;

const TIMES: [f64; 4] = [-0.5, 0.0, 9.5, 100.0];

fn about() -> AboutSeries<'static> {
    AboutSeries { dataset: "jet", field: "T", times: &TIMES, time_units: None }
}

fn everything(background: Option<[f32; 3]>) -> Annotator {
    Annotator::new(&"time,legend,title".parse().unwrap(), &about(), background)
}

fn bar(range: MappedRange) -> ColorBar {
    ColorBar { title: "T [K]".to_owned(), map: ColorMap::built_in("viridis").unwrap().clone(), range }
}

fn unit_bar() -> ColorBar {
    bar(MappedRange::new(0.0, 1.0, false).unwrap())
}

/// An image whose pixels all differ, some of them more than opaque by rounding.
fn gradient(width: usize, height: usize) -> RgbaImage {
    let mut image = RgbaImage::new(width, height);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        *pixel = [0.1, 0.2, 0.3, 1.0].map(|c| c * (1.0 + i as f32 * 1e-7));
    }
    image
}

#[test]
fn the_flag_names_any_subset() {
    let title = |text: &str| Some(Title::Text(text.to_owned()));
    for (text, time, legend, expected) in [
        ("time", true, false, None),
        ("legend, time", true, true, None),
        ("time,legend,title", true, true, Some(Title::FieldAndDataset)),
        ("title=Jet, cold,legend", false, true, title("Jet, cold")),
        ("title=", false, false, title("")),
        ("title=a=b", false, false, title("a=b")),
    ] {
        assert_eq!(text.parse(), Ok(Annotations { time, legend, title: expected }), "{text}");
    }
}

#[test]
fn the_flag_refuses_what_it_does_not_know() {
    for (text, named) in
        [("", "''"), ("tim", "'tim'"), ("time,", "''"), ("time,time", "twice"), ("title,title=x", "twice")]
    {
        let error = text.parse::<Annotations>().unwrap_err();
        assert!(error.contains(named), "{text}: {error}");
    }
}

#[test]
fn nothing_asked_for_is_nothing_drawn() {
    let mut image = gradient(200, 150);
    Annotator::new(&Annotations::default(), &about(), None).draw(&mut image, 0.0, &[unit_bar()]);
    assert_eq!(image, gradient(200, 150));
}

#[test]
fn the_bar_has_the_colours_of_the_map_and_of_the_table_where_its_ticks_are() {
    let map = ColorMap::built_in("viridis").unwrap();
    for range in [MappedRange::new(-3.0, 5.0, false).unwrap(), MappedRange::new(1e-6, 2.0, true).unwrap()] {
        let sizes = Sizes::of(1024, 768);
        let bars = [bar(range)];
        let annotator = everything(None);
        let mut image = gradient(1024, 768);
        annotator.draw(&mut image, 0.0, &bars);
        let legend = annotator.layout(&sizes, 0.0, &bars).legends.remove(0);
        let tf = TransferFunction::parse("viridis@0:0.1,1:0.9").unwrap();
        let table = build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_unit_distance(1.0)).unwrap();
        let found = ticks::ticks(&range);
        assert_eq!(found.ticks.len(), legend.marks.len());
        for (tick, &row) in found.ticks.iter().zip(&legend.marks) {
            let drawn = image.pixels[row as usize * 1024 + legend.bar.left as usize + 3];
            // The centre of the row is at most one row from the tick; the map's slope bounds the colour difference.
            let position = range.position_of(tick.scalar);
            let row_height = 1.0 / (legend.bar.bottom - legend.bar.top) as f64;
            let around = [position - row_height, position + row_height].map(|p| map.eval(p));
            let exact = table.eval(tick.scalar).rgb;
            for c in 0..3 {
                let slack = (around[1][c] - around[0][c]).abs() + crate::transfer::COLOR_TOLERANCE;
                assert!((f64::from(drawn[c]) - exact[c]).abs() <= slack, "{tick:?} {drawn:?} {exact:?}");
            }
            assert_eq!(drawn[3], 1.0);
        }
        // Detects a bar that is upside down.
        let first = found.ticks[0].scalar;
        let upside_down = map.reversed().eval(range.position_of(first));
        assert!((upside_down[1] - table.eval(first).rgb[1]).abs() > 0.1);
    }
}

#[test]
fn a_second_bar_is_below_the_first_one_or_left_out() {
    let annotator = everything(None);
    let gray = ColorBar {
        title: "a long name of a speed [m/s]".to_owned(),
        map: ColorMap::built_in("gray").unwrap().clone(),
        range: MappedRange::new(-1000.0, 2000.0, false).unwrap(),
    };
    let bars = [unit_bar(), gray];
    let legends = |height: usize| annotator.layout(&Sizes::of(1024, height), 0.0, &bars).legends;
    let [first, second] = &legends(768)[..] else { panic!("both have room") };
    assert!(first.bar.bottom < second.bar.top && first.bar.left == second.bar.left);
    assert!(second.labels.iter().all(|label| label.baseline > first.bar.bottom));
    let mut image = gradient(1024, 768);
    annotator.draw(&mut image, 0.0, &bars);
    let middle = (second.bar.top + second.bar.bottom) / 2;
    let [r, g, b, _] = image.pixels[middle as usize * 1024 + second.bar.left as usize + 3];
    assert!(r == g && g == b && (r - 0.5).abs() < 0.1, "{r}");
    // Alone, the first one is as if there were no other.
    assert_eq!(legends(240), annotator.layout(&Sizes::of(1024, 240), 0.0, &bars[..1]).legends);
}

#[test]
fn pixels_outside_of_the_annotations_keep_every_bit() {
    let (width, height) = (640, 480);
    let sizes = Sizes::of(width, height);
    let annotator = everything(Some([0.0; 3]));
    let layout = annotator.layout(&sizes, 9.5, &[unit_bar()]);
    let reach = sizes.halo_px.ceil() as i64 + sizes.stroke_px;
    let legend = layout.legends[0].clone();
    // The box that the letters of a label may reach: one line high.
    let box_of = |label: &Label| {
        let size = label.size_px.ceil() as i64;
        let width = text::width_px(&label.text, label.size_px).ceil() as i64;
        (label.x - reach, label.baseline - size - reach, label.x + width + reach, label.baseline + size / 2 + reach)
    };
    let mut boxes: Vec<_> = layout.labels.iter().chain(&legend.labels).map(box_of).collect();
    let bar = legend.bar.grown(reach + sizes.text_px as i64 / 2);
    boxes.push((bar.left, bar.top, bar.right, bar.bottom));
    let (before, mut after) = (gradient(width, height), gradient(width, height));
    annotator.draw(&mut after, 9.5, &[unit_bar()]);
    let mut changed = 0;
    for (i, (a, b)) in before.pixels.iter().zip(&after.pixels).enumerate() {
        let (x, y) = ((i % width) as i64, (i / width) as i64);
        let is_inside = boxes.iter().any(|&(l, t, r, b)| (l..r).contains(&x) && (t..b).contains(&y));
        let same = a.map(f32::to_bits) == b.map(f32::to_bits);
        assert!(is_inside || same, "pixel {x}, {y} changed");
        changed += usize::from(!same);
    }
    assert!(changed > 5000, "only {changed} pixels were drawn");
}

#[test]
fn the_time_stays_in_its_place_over_the_series() {
    let annotator = Annotator::new(&"time".parse().unwrap(), &about(), None);
    let sizes = Sizes::of(800, 600);
    let places: HashSet<(i64, i64, i64)> = TIMES
        .map(|t| {
            let labels = annotator.layout(&sizes, t, &[unit_bar()]).labels;
            // Right ends are compared after rounding, since pens start on whole pixels.
            let end = labels[1].x as f32 + text::width_px(&labels[1].text, sizes.text_px);
            (labels[0].x, end.round() as i64, labels[2].x)
        })
        .into_iter()
        .collect();
    let ends: Vec<i64> = places.iter().map(|p| p.1).collect();
    let spread = ends.iter().max().unwrap() - ends.iter().min().unwrap();
    assert!(spread <= 1, "{places:?}");
    assert_eq!(places.iter().map(|p| (p.0, p.2)).collect::<HashSet<_>>().len(), 1);
}

#[test]
fn parts_that_do_not_fit_are_left_out_legend_first_and_time_last() {
    let annotator = everything(None);
    let parts = |width, height| {
        let layout = annotator.layout(&Sizes::of(width, height), 0.0, &[unit_bar()]);
        let has_time = layout.labels.iter().any(|l| l.text == PREFIX);
        let has_title = layout.labels.iter().any(|l| l.size_px > 11.0 && l.text.starts_with('T'));
        (has_time, has_title, !layout.legends.is_empty())
    };
    assert_eq!(parts(320, 240), (true, true, true));
    assert_eq!(parts(320, 120), (true, true, false));
    assert_eq!(parts(320, 50), (true, false, false));
    assert_eq!(parts(320, 20), (false, false, false));
    assert_eq!(parts(80, 240), (true, true, false));
    assert_eq!(parts(30, 240), (false, false, false));
}

#[test]
fn any_range_text_and_size_can_be_drawn() {
    let strange = AboutSeries {
        dataset: "\u{1F600}\n漢字",
        field: "∂T/∂t · ρ (µ°²)",
        times: &[1e-300, 1e300],
        time_units: Some("\u{0}"),
    };
    let annotator = Annotator::new(&"time,legend,title".parse().unwrap(), &strange, None);
    let ends = [(0.0, 1e-42), (-3.4e38, 3.4e38), (-2e-45, -1e-45), (101_325.0, 101_325.01), (-1e308, -1.0)];
    for (width, height) in [(1, 1), (7, 300), (300, 7), (160, 120), (640, 480)] {
        for (lo, hi) in ends {
            let mut image = gradient(width, height);
            let range = MappedRange::new(lo, hi, false).unwrap();
            for time in [1e-300, 1e300, -1.0, f64::NAN] {
                let title = "∂T/∂t · ρ (µ°²) [kg·m⁻³]".to_owned();
                annotator.draw(&mut image, time, &[ColorBar { title, ..bar(range) }, bar(range)]);
            }
            assert_eq!(image.first_not_finite(), None);
        }
    }
}

#[test]
fn text_grows_with_the_image() {
    let sizes = [240, 768, 2160, 4320].map(|height| Sizes::of(height * 4 / 3, height).text_px);
    assert_eq!(sizes, [11.0, 21.0, 60.0, 120.0]);
}
