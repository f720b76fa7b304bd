//! Icons of flow on the command line: several at once, and the user's.

use super::Place;
use super::flow::{FLOW, exr, rmse, tornado};
use super::points::apart;
use std::path::Path;

/// Writes a picture of 64 x 64 pixels by the levels of its columns and rows.
fn write(path: &Path, color: png::ColorType, level: impl Fn(u32, u32) -> u8) {
    let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), 64, 64);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    let pixels = (0..64).flat_map(|row| (0..64).map(move |column| (column, row)));
    let levels = pixels.flat_map(|(column, row)| vec![level(column, row); color.samples()]);
    encoder.write_header().unwrap().write_image_data(&levels.collect::<Vec<u8>>()).unwrap();
}

/// Stripes across the flow, `wide` pixels of each `every`.
fn stripes(wide: u32, every: u32) -> impl Fn(u32, u32) -> u8 {
    move |column, _| if column % every < wide { 220 } else { 10 }
}

fn with_flow(place: &Place, options: &[&str]) -> tetreel::image::Planes {
    exr(place, "11", &[&FLOW[..], options].concat())
}

#[test]
fn several_icons_are_drawn_as_the_judge_draws_them_by_speed_and_by_a_field() {
    let place = tornado();
    write(&place.path("tile.png"), png::ColorType::Grayscale, stripes(8, 32));
    let mut seen = ["strokes", "lines", "arrows"].map(|icon| with_flow(&place, &["--flow-icon", icon])).to_vec();
    // Speeds are between 0.12 and 1.82, pressures between -791 and -1.
    for options in [
        &["--flow-icon", "strokes,lines@0.6,arrows@1"][..],
        &["--flow-icon", "strokes,lines@0.9,arrows@1"],
        &["--flow-icon", "strokes,lines@0.6,tile.png@1"],
        &["--flow-icon", "tile.png"],
        &["--flow-icon", "lines,arrows@-60", "--flow-by", "pressure"],
        &["--flow-icon", "lines,arrows@-60", "--flow-by", "velocity:2"],
    ] {
        let found = with_flow(&place, options);
        // Of vertical speeds none is below -60.
        let is_arrows = options.contains(&"velocity:2");
        let differs = |(number, other)| (is_arrows && number == 2) != (apart(other, &found) > 1e-3);
        assert!(seen.iter().enumerate().all(differs), "{options:?}");
        let judge = with_flow(&place, &[options, &["--mode", "reference"]].concat());
        assert!(rmse(&found, &judge) <= 1e-5 && apart(&found, &judge) <= 1e-3, "{options:?}");
        if !is_arrows {
            seen.push(found);
        }
    }
    // The length of the vectors is a field, too: as it is computed here and as it is stored, rounded to 24 bits.
    let icons = ["--flow-icon", "strokes,lines@0.6,arrows@1"];
    let by_length = with_flow(&place, &[&icons[..], &["--flow-by", "velocity:mag"]].concat());
    assert!(apart(&by_length, &with_flow(&place, &icons)) < 1e-4);
}

#[test]
fn a_project_names_icons_beside_its_file_and_another_picture_under_the_name_is_drawn_again() {
    let place = tornado();
    std::fs::create_dir(place.path("sub, two")).unwrap();
    let tile = place.path("sub, two/tile.png");
    write(&tile, png::ColorType::Grayscale, stripes(8, 32));
    let project = "version = 1\n[data]\nsource = \"../t.zarr\"\nfield = \"pressure\"\n[flow]\nfield = \"velocity\"\n\
                   icon = \"lines,tile.png@-60\"\nby = \"pressure\"\n";
    std::fs::write(place.path("sub, two/p.toml"), project).unwrap();
    let size = ["--size", "48x36", "--steps", "11"];
    let of_project = |options: &[&str]| {
        let words = ["render", "sub, two/p.toml", "--exr", "raw", "-o", "p.exr"];
        place.ok(&[&words[..], &size, options].concat());
        tetreel::image::read_exr(&place.path("p.exr")).unwrap().planes
    };
    let options = ["--flow-icon", "lines,sub, two/tile.png@-60", "--flow-by", "pressure"];
    assert!(of_project(&[]) == with_flow(&place, &options));
    // Another list of icons has another field, or none.
    for icons in ["arrows", "lines,arrows@0.8"] {
        let options = ["--flow-icon", icons];
        assert!(of_project(&[&FLOW[..], &options].concat()) == with_flow(&place, &options), "{icons}");
    }
    let kept = |options: &[&str]| {
        let words = ["render", "sub, two/p.toml", "-o", "k.png", "--resume", "--stats", "s.json"];
        place.ok(&[&words[..], &size, options].concat());
        std::fs::read_to_string(place.path("s.json")).unwrap().contains("\"kept\"")
    };
    assert_eq!([kept(&[]), kept(&[])], [false, true]);
    write(&tile, png::ColorType::Grayscale, stripes(9, 32));
    assert_eq!([kept(&[]), kept(&[])], [false, true], "it is another picture");
    std::fs::rename(&tile, place.path("moved.png")).unwrap();
    let moved = ["--flow-icon", "lines,moved.png@-60", "--flow-by", "pressure"];
    assert!(kept(&[&FLOW[..], &moved].concat()), "it is the same picture");
    std::fs::write(place.path("sub, two/bad.toml"), project.replace("lines,tile", "fish,tile")).unwrap();
    let words = ["render", "sub, two/bad.toml", "-o", "x.png", "--steps", "1"];
    place.refuses(&words, &["bad.toml", "line 7", "'fish'", "strokes, lines, particles or arrows"]);
    place.refuses(&["render", "sub, two/p.toml", "-o", "x.png", "--steps", "1"], &["--flow-icon", "sub, two/tile.png"]);
}

#[test]
fn icons_that_cannot_be_shown_are_refused_with_place_and_remedy() {
    let place = tornado();
    write(&place.path("ramp.png"), png::ColorType::Grayscale, |column, _| 4 * column as u8);
    write(&place.path("steps.png"), png::ColorType::Grayscale, |_, row| 4 * row as u8);
    write(&place.path("color.png"), png::ColorType::Rgb, stripes(8, 32));
    write(&place.path("alpha.png"), png::ColorType::GrayscaleAlpha, stripes(8, 32));
    write(&place.path("black.png"), png::ColorType::Grayscale, |_, _| 0);
    let file = std::fs::File::create(place.path("wide.png")).unwrap();
    let mut encoder = png::Encoder::new(file, 96, 64);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[9; 96 * 64]).unwrap();
    std::fs::write(place.path("text.png"), "no picture").unwrap();
    let icons = |icons: &'static str| vec!["--flow-icon", icons];
    let by = |field: &'static str| vec!["--flow-icon", "lines,arrows@1", "--flow-by", field];
    for (options, parts) in [
        (icons("fish"), &["--flow-icon", "'fish'", "strokes, lines, particles or arrows", "tile.png"][..]),
        (icons("lines,fish@1"), &["'fish'"]),
        (icons("lines,arrows"), &["'arrows'", "arrows@3"]),
        (icons("lines@1"), &["'lines@1'", "without a threshold"]),
        (icons("lines,arrows@fast"), &["'fast'", "arrows@3"]),
        (icons("lines,arrows@nan"), &["finite"]),
        (icons("lines,arrows@1,strokes@0.5"), &["from 0.5", "from 1", "order"]),
        (icons("lines,arrows@1,strokes@1"), &["order"]),
        (icons("none.png"), &["--flow-icon", "none.png", "open"]),
        (icons("lines,text.png@1"), &["text.png", "whole PNG"]),
        (icons("ramp.png"), &["ramp.png", "left and right edges", "not periodic", "tile"]),
        (icons("steps.png"), &["steps.png", "top and bottom edges", "not periodic", "tile"]),
        (icons("color.png"), &["color.png", "header", "colours", "shades of grey"]),
        (icons("alpha.png"), &["alpha.png", "header", "alpha", "shades of grey"]),
        (icons("black.png"), &["black.png", "white on black"]),
        (icons("wide.png"), &["wide.png", "96 x 64", "64 x 64"]),
        (by("wind"), &["--flow-by", "'wind'", "pressure"]),
        (vec!["--flow-by", "pressure"], &["--flow-by", "several icons", "leave it out"]),
    ] {
        let words = ["render", "t.zarr", "--field", "pressure", "-o", "x.png", "--steps", "1", "--size", "8x8"];
        place.refuses(&[&words[..], &FLOW, &options].concat(), parts);
    }
}
