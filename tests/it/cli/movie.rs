//! `tetreel render` over time: movies, frames between steps, turntables, and runs that go on where they stopped.

use super::{Place, SMALL, STEPS, files, render};
use crate::common;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tetreel::camera::Camera;
use tetreel::export::still::{FrameAttributes, OutputFrame, StillOptions, write_still};
use tetreel::image::{Planes, RgbaImage, compare, read_png};

/// Whether there are ffmpeg and ffprobe.
fn has_ffmpeg() -> bool {
    for program in ["ffmpeg", "ffprobe"] {
        if Command::new(program).arg("-version").stdout(Stdio::null()).status().is_err() {
            common::skip("ffmpeg", &format!("{program} is not on the path"));
            return false;
        }
    }
    true
}

/// What ffprobe says of the only stream of a movie, its frames counted one by one.
fn probe(movie: &Path) -> Value {
    let args = ["-v", "error", "-count_frames", "-show_streams", "-show_format", "-of", "json"];
    let output = Command::new("ffprobe").args(args).arg(movie).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let all: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(all["streams"].as_array().unwrap().len(), 1);
    all
}

/// A frame of a movie.
fn frame_of(movie: &Path, index: usize) -> RgbaImage {
    let png = movie.with_extension(format!("{index}.png"));
    let select = format!("select=eq(n\\,{index})");
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-y", "-i"]).arg(movie).args(["-vf", &select, "-frames:v", "1"]).arg(&png);
    assert!(command.status().unwrap().success());
    let image = read_png(&png).unwrap();
    std::fs::remove_file(png).unwrap();
    image
}

fn stats(place: &Place) -> Vec<Value> {
    let text = std::fs::read(place.path("stats.json")).unwrap();
    serde_json::from_slice::<Value>(&text).unwrap().as_array().unwrap().clone()
}

fn origins(place: &Place) -> Vec<String> {
    stats(place).iter().map(|record| record["origin"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_movie_has_the_frames_that_rate_and_duration_ask_for() {
    if !has_ffmpeg() {
        return;
    }
    let place = Place::with_slab();
    for (name, options, frames, rate, codec) in [
        ("a.mp4", &["--background", "white"][..], STEPS, "25/1", "h264"),
        ("b.mkv", &["--fps", "30000/1001", "--duration", "1"], 30, "30000/1001", "h264"),
        ("c.mov", &["--fps", "12.5", "--duration", "0.8", "--interpolate"], 10, "25/2", "h264"),
        ("d.webm", &["--steps", "1..4", "--fps", "5", "--duration", "2.3"], 12, "5/1", "vp9"),
        ("e.mp4", &["--steps", "2"], 1, "25/1", "h264"),
    ] {
        place.ok(&render(&[&["-o", name], options].concat()));
        let found = probe(&place.path(name));
        let stream = &found["streams"][0];
        assert_eq!(stream["nb_read_frames"], frames.to_string(), "{name}");
        assert_eq!((&stream["r_frame_rate"], &stream["codec_name"]), (&rate.into(), &codec.into()), "{name}");
        assert_eq!((&stream["pix_fmt"], &stream["color_space"]), (&"yuv420p".into(), &"bt709".into()), "{name}");
        let title = found["format"]["tags"].as_object().unwrap().iter().find(|(k, _)| k.eq_ignore_ascii_case("title"));
        assert_eq!(title.unwrap().1, "slab: linear", "{name}");
    }
    let named = files(place.0.path()).into_keys().filter(|p| p.parent() == Some(place.0.path()));
    let left: Vec<PathBuf> = named.filter(|p| p.is_file()).collect();
    assert_eq!(left, ["a.mp4", "b.mkv", "c.mov", "d.webm", "e.mp4"].map(|n| place.path(n)), "nothing but the movies");
}

#[test]
fn a_movie_shows_what_images_of_the_same_request_show() {
    if !has_ffmpeg() {
        return;
    }
    let place = Place::with_slab();
    let scene = ["--background", "#203040", "--size", "65x49"];
    let of = |output: &'static str| {
        let mut args = vec!["render", "slab.zarr", "--field", "linear", "--tf", "viridis@0:0.01,1:0.2", "-o", output];
        args.extend(scene);
        args
    };
    place.ok(&of("f_%d.png"));
    for movie in ["m.mp4", "m.webm"] {
        place.ok(&of(movie));
        for index in [0, STEPS - 1] {
            let image = read_png(&place.path(&format!("f_{index}.png"))).unwrap();
            let shown = frame_of(&place.path(movie), index);
            assert_eq!((shown.width, shown.height), (66, 50), "odd sizes are padded");
            let rows = shown.pixels.chunks_exact(66).take(49);
            let mut cut =
                RgbaImage { width: 65, height: 49, pixels: rows.flat_map(|row| &row[..65]).copied().collect() };
            // What is lost is colour at half resolution, along the outline of the slab.
            let psnr = compare(&image, &cut, [0.0; 3]).unwrap().psnr;
            assert!(psnr > 30.0, "{movie} frame {index}: {psnr} dB");
            cut.pixels.iter_mut().for_each(|p| p.swap(0, 2));
            let wrong = compare(&image, &cut, [0.0; 3]).unwrap().psnr;
            assert!(wrong < 25.0, "red and blue exchanged are not seen: {wrong} dB");
        }
        // In the padding and beside it. Rounding to 8-bit YCbCr costs up to 2 / 255, the encoder about as much; another
        // matrix than that of the tags (BT.601) would move this green by 20.
        let flat = ["-o", movie, "--steps", "0", "--background", "#20c040", "--size", "65x65"];
        place.ok(&[&["render", "slab.zarr"], &flat[..]].concat());
        let flat = frame_of(&place.path(movie), 0);
        for pixel in [flat.pixels[0], flat.pixels[65], flat.pixels[66 * 66 - 1]] {
            let off = [0x20, 0xc0, 0x40].iter().zip(pixel).map(|(&c, p)| (c as f32 - 255.0 * p).abs());
            assert!(off.clone().all(|off| off <= 5.0), "{movie}: {:?}", off.collect::<Vec<_>>());
        }
    }
}

#[cfg(unix)]
fn script(place: &Place, name: &str, body: &str) -> PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let path = place.path(name);
    let encoders = "case \"$*\" in *-encoders*) echo libx264 libvpx-vp9; exit 0;; esac";
    std::fs::write(&path, format!("#!/bin/sh\n{encoders}\n{body}\n")).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// A run with another ffmpeg.
fn run_with(place: &Place, ffmpeg: &Path, args: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tetreel"));
    let output = command.args(args).current_dir(place.0.path()).env("TETREEL_FFMPEG", ffmpeg).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn without_ffmpeg_a_movie_is_refused_before_anything_is_done() {
    let place = Place::with_slab();
    std::fs::write(place.path("m.mp4"), "an older movie").unwrap();
    let before = files(place.0.path());
    // The source does not exist: it is not even looked for.
    let args = ["render", "none.pvd", "-o", "m.mp4"];
    let (code, err) = run_with(&place, &place.path("no/such/ffmpeg"), &args);
    assert_eq!(code, Some(2));
    for part in ["no/such/ffmpeg", "install ffmpeg", "TETREEL_FFMPEG", "frame_%04d.png"] {
        assert!(err.contains(part), "'{part}' is missing in: {err}");
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_tetreel"));
    command.args(args).current_dir(place.0.path()).env("PATH", "").env_remove("TETREEL_FFMPEG");
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("install ffmpeg"));
    assert!(files(place.0.path()) == before);
}

#[cfg(unix)]
#[test]
fn an_ffmpeg_that_fails_midway_is_quoted_and_leaves_the_older_movie() {
    let place = Place::with_slab();
    let half = "for file; do :; done; echo half > \"${file#file:}\"; head -c 20000 > /dev/null";
    let fails = script(&place, "fails", &format!("{half}; echo 'first line' >&2; echo 'disk is full' >&2; exit 1"));
    let stops = script(&place, "stops", &format!("{half}; exit 0"));
    let empty = script(&place, "empty", "cat > /dev/null; exit 0");
    // As ffmpeg does on a full disk.
    let cut = format!("{half}; cat > /dev/null; echo 'Error writing trailer' >&2; exit 0");
    let cut = script(&place, "cut", &cut);
    std::fs::write(place.path("m.mp4"), "an older movie").unwrap();
    let before = files(place.0.path());
    let args = render(&["-o", "m.mp4", "--fps", "25", "--duration", "4"]);
    for (ffmpeg, parts) in [
        (&fails, &["m.mp4", "disk is full", "exit status: 1"][..]),
        (&stops, &["m.mp4", "before it had read all frames"]),
        (&cut, &["m.mp4", "Error writing trailer"]),
        (&empty, &["m.mp4", "wrote nothing for 100 frames"]),
    ] {
        let (code, err) = run_with(&place, ffmpeg, &args);
        assert_eq!(code, Some(2), "{err}");
        assert!(parts.iter().all(|part| err.contains(part)), "{err}");
        assert!(files(place.0.path()) == before, "{:?}", files(place.0.path()).keys());
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_encoder_and_leaves_the_older_movie() {
    let place = Place::with_slab();
    // Reads a little and then nothing: the pipe is full when the interruption comes.
    let stuck = script(&place, "stuck", "echo $$ > pid; head -c 1000 > /dev/null; exec sleep 1000");
    std::fs::write(place.path("m.mp4"), "an older movie").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_tetreel"));
    command.args(render(&["-o", "m.mp4", "--duration", "60"])).current_dir(place.0.path());
    let mut child = command.env("TETREEL_FFMPEG", &stuck).stderr(Stdio::null()).spawn().unwrap();
    let pid = loop {
        assert_eq!(child.try_wait().unwrap(), None, "ended by itself");
        let text = std::fs::read_to_string(place.path("pid")).unwrap_or_default();
        if text.ends_with('\n') {
            break text.trim().to_owned();
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    };
    let signal = |name: &str, pid: &str| Command::new("kill").args([name, pid]).stderr(Stdio::null()).status().unwrap();
    assert!(signal("-INT", &child.id().to_string()).success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(!signal("-0", &pid).success(), "the encoder still runs");
    assert_eq!(std::fs::read(place.path("m.mp4")).unwrap(), b"an older movie");
    let hidden =
        files(place.0.path()).into_keys().filter(|p| p.file_name().unwrap().to_string_lossy().starts_with('.'));
    assert_eq!(hidden.count(), 0);
}

#[test]
fn combinations_without_a_meaning_are_refused() {
    let place = Place::with_slab();
    std::fs::create_dir(place.path("folder.mp4")).unwrap();
    for (args, parts) in [
        (&["-o", "m_%d.mp4"][..], &["m_%d.mp4", "one file"][..]),
        (&["-o", "m.mp4", "--resume"], &["--resume", "images"]),
        (&["-o", "m.avi"], &["m.avi", ".mp4", ".png"]),
        (&["-o", "folder.mp4"], &["folder.mp4", "is a folder"]),
        (&["-o", "no/such/m.mp4"], &["no/such"]),
        (&["-o", "f_%d.png", "--fps", "30"], &["--fps", "--duration"]),
        (&["-o", "f_%d.png", "--fps", "0"], &["--fps"]),
        (&["-o", "f_%d.png", "--duration", "0"], &["--duration"]),
        (&["-o", "f_%d.png", "--duration", "0.001"], &["no frame"]),
        (&["-o", "f_%d.png", "--turntable", "360", "--steps", "1"], &["--turntable", "--duration"]),
        (&["-o", "f_%d.png", "--turntable", "nan"], &["--turntable"]),
        (&["-o", "f.png", "--duration", "1"], &["25 frames", "frame_%04d.png"]),
    ] {
        place.refuses(&render(args), parts);
    }
    let run = place.run(&render(&["-o", "f_%d.png", "--interpolate"]));
    assert!(run.code == Some(2) && run.err.contains("--duration"), "{}", run.err);
}

#[test]
fn frames_between_steps_follow_the_times_of_the_file_and_at_a_step_are_that_step() {
    let place = Place::with_slab();
    place.ok(&render(&["-o", "plain_%d.png", "--stats", "stats.json"]));
    let times: Vec<f64> = stats(&place).iter().map(|record| record["time"].as_f64().unwrap()).collect();
    assert!(times.windows(3).any(|t| t[1] - t[0] != t[2] - t[1]), "evenly spaced steps would test less: {times:?}");
    let spread = ["--fps", "17", "--duration", "1"];
    place.ok(&render(&[&["-o", "held_%d.png", "--stats", "stats.json"], &spread[..]].concat()));
    assert_eq!(origins(&place).iter().filter(|origin| *origin == "rendered").count(), STEPS);
    place.ok(&render(&[&["-o", "mixed_%d.png", "--interpolate", "--stats", "stats.json"], &spread[..]].concat()));
    let records = stats(&place);
    let image = |name: String| read_png(&place.path(&name)).unwrap();
    let mut at_steps = 0;
    for (frame, record) in records.iter().enumerate() {
        let time = frame as f64 / 16.0;
        let last = times.iter().rposition(|&t| t <= time).unwrap();
        let plain = image(format!("plain_{last}.png"));
        assert_eq!(image(format!("held_{frame}.png")), plain, "{frame}");
        let is_step = times.contains(&time);
        assert_eq!(image(format!("mixed_{frame}.png")) == plain, is_step, "{frame}");
        assert_eq!((&record["step"], &record["time"]), (&last.into(), &time.into()), "{frame}");
        if is_step {
            at_steps += 1;
            assert_eq!(record["toward"], Value::Null, "{frame}");
        } else {
            let weight = (time - times[last]) / (times[last + 1] - times[last]);
            assert_eq!(record["toward"][0], last + 1, "{frame}");
            // Both are the quotient of two differences in f64, of times below 1: three roundings.
            assert!((record["toward"][1].as_f64().unwrap() - weight).abs() < 1e-15, "{frame}");
        }
    }
    assert!(at_steps > 2, "more than the two ends");
    let decoded: u64 = records.iter().map(|r| r["stats"]["vertices_decoded"].as_u64().unwrap()).sum();
    let one: u64 = records[0]["stats"]["vertices_decoded"].as_u64().unwrap();
    assert_eq!(decoded, one * STEPS as u64, "each step is decoded once");
}

#[test]
fn a_turntable_shows_what_an_orbited_camera_shows() {
    let place = Place::with_slab();
    let base = "pos=3,-2,1.5 focal=0.5,0.5,0.5 up=0,0,1 angle=30";
    let camera = Camera::parse(base, &Camera::default_for((glam::DVec3::ZERO, glam::DVec3::ONE)).unwrap()).unwrap();
    let turned = ["--steps", "3", "--turntable", "360", "--duration", "0.32", "--camera", base];
    place.ok(&render(&[&["-o", "t_%d.png"], &turned[..]].concat()));
    let all: Vec<RgbaImage> = (0..8).map(|i| read_png(&place.path(&format!("t_{i}.png"))).unwrap()).collect();
    for (frame, image) in all.iter().enumerate() {
        let here = if frame == 0 { camera } else { camera.orbit(45.0 * frame as f64, 0.0).unwrap() };
        place.ok(&render(&["-o", "single.png", "--steps", "3", "--camera", &here.to_string()]));
        assert_eq!(*image, read_png(&place.path("single.png")).unwrap(), "{frame}");
        assert!(all[frame + 1..].iter().all(|other| other != image), "frame {frame} is there twice");
    }
    // Time and angle together.
    place.ok(&render(&["-o", "b_%d.png", "--turntable", "-90", "--camera", base]));
    let here = camera.orbit(-36.0, 0.0).unwrap().to_string();
    place.ok(&render(&["-o", "single.png", "--steps", "2", "--camera", &here]));
    assert_eq!(read_png(&place.path("b_2.png")).unwrap(), read_png(&place.path("single.png")).unwrap());
}

#[test]
fn resume_keeps_what_the_same_request_made_and_renders_the_rest() {
    let place = Place::with_slab();
    let again = |more: &[&str]| {
        place.ok(&render(&[&["-o", "f_%d.png", "--resume", "--stats", "stats.json"], more].concat()));
        origins(&place)
    };
    let frame = |i: usize| place.path(&format!("f_{i}.png"));
    place.ok(&render(&["-o", "f_%d.png"]));
    let whole = files(place.0.path());
    assert_eq!(again(&[]), ["kept"; 5]);
    assert_eq!(std::fs::read(frame(1)).unwrap(), whole[&frame(1)]);

    // One missing, one cut in the pixels, one in the last chunk, one with a byte changed.
    std::fs::remove_file(frame(0)).unwrap();
    let bytes = &whole[&frame(1)];
    std::fs::write(frame(1), &bytes[..bytes.len() / 2]).unwrap();
    std::fs::write(frame(2), &whole[&frame(2)][..whole[&frame(2)].len() - 6]).unwrap();
    let mut changed = whole[&frame(3)].clone();
    let middle = changed.len() / 2;
    changed[middle] ^= 1;
    std::fs::write(frame(3), changed).unwrap();
    assert_eq!(again(&[]), ["rendered", "rendered", "rendered", "rendered", "kept"]);
    for i in 0..STEPS {
        assert_eq!(std::fs::read(frame(i)).unwrap(), whole[&frame(i)], "{i}");
    }

    // A frame of another step under its name, and an image of somebody else.
    std::fs::copy(frame(4), frame(2)).unwrap();
    std::fs::write(frame(3), b"no image").unwrap();
    assert_eq!(again(&[]), ["kept", "kept", "rendered", "rendered", "kept"]);
    for other in [
        &["--background", "white"][..],
        &["--tf", "inferno@0:0,1:0.5"],
        &["--turntable", "30"],
        &["--range", "0,3"],
        &["--size", "32x32"],
    ] {
        let args: Vec<&str> = SMALL.chunks(2).filter(|pair| pair[0] != other[0]).flatten().copied().collect();
        let args = [&["render", "slab.zarr", "-o", "f_%d.png", "--resume", "--stats", "stats.json"], &args[..], other];
        place.ok(&args.concat());
        // The first frame of a turntable is where the camera is anyway.
        let first = if other[0] == "--turntable" { "kept" } else { "rendered" };
        assert_eq!((&origins(&place)[0][..], &origins(&place)[1][..]), (first, "rendered"), "{other:?}");
        place.ok(&render(&["-o", "f_%d.png"]));
    }

    // Other data under the same name.
    place.ok(&["synth", "slab", "-o", "slab.zarr", "--cells", "3000", "--steps", "5", "--overwrite"]);
    assert_eq!(again(&[]), ["rendered"; 5]);
}

#[test]
fn frames_of_an_older_tetreel_are_rendered_anew_which_is_said_once() {
    let place = Place::with_slab();
    let args = render(&["-o", "f_%d.png", "--resume", "--stats", "stats.json"]);
    place.ok(&args);
    let frame = |i: usize| place.path(&format!("f_{i}.png"));
    let whole = files(place.0.path());
    for i in 1..3 {
        // As they were signed before fingerprints had a version.
        let extras = [(FrameAttributes::FINGERPRINT.to_owned(), "0123456789abcdef".repeat(4))].into();
        let attributes = FrameAttributes { extras, ..Default::default() };
        let planes = Planes { color: read_png(&frame(i)).unwrap(), ..Default::default() };
        write_still(&frame(i), &OutputFrame { planes, attributes }, &StillOptions::default()).unwrap();
    }
    let run = place.run(&args);
    assert_eq!(run.code, Some(0), "{}", run.err);
    let said = "f_1.png was rendered by an older tetreel: it is rendered anew";
    assert!(run.err.contains(said) && run.err.matches("older").count() == 1, "{}", run.err);
    assert_eq!(origins(&place), ["kept", "rendered", "rendered", "kept", "kept"]);
    for i in 0..STEPS {
        assert_eq!(std::fs::read(frame(i)).unwrap(), whole[&frame(i)], "{i}");
    }
    assert!(!place.run(&args).err.contains("older"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_takes_no_file_is_an_error_before_anything_is_rendered() {
    let place = Place::with_slab();
    for output in ["/proc/f_%d.png", "/proc/frames/f_%d.png", "/proc/m.mp4"] {
        place.refuses(&render(&["-o", output]), &["/proc/"]);
    }
}
