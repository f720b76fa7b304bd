//! Flow of a series that plays: patterns are averaged until the next frame.

use super::Place;
use super::flow::{FLOW, exr, rmse, stats, tornado};
use super::points::apart;
use tetreel::image::{Planes, read_exr};

/// Renders the flow alone, and reads its frames.
fn frames(place: &Place, name: &str, options: &[&str]) -> Vec<Planes> {
    let words = ["render", "t.zarr", "--field", "pressure", "--size", "48x36", "--no-volume", "--exr", "raw"];
    let files = format!("{name}_%d.exr");
    place.ok(&[&words[..], &["-o", &files, "--stats", "s.json"], &FLOW, options].concat());
    let frames = (0..).map(|i| place.path(&format!("{name}_{i}.exr"))).take_while(|file| file.exists());
    frames.map(|file| read_exr(&file).unwrap().planes).collect()
}

/// The splats of each frame whose patterns are too fast to be followed.
fn fast(place: &Place) -> Vec<u64> {
    stats(place).iter().map(|frame| frame["stats"]["flow_fast"].as_u64().unwrap_or(0)).collect()
}

#[test]
fn a_frame_between_two_steps_is_blurred_until_the_next_one_as_the_judge_blurs_it() {
    let place = tornado();
    let options = ["--steps", "8..10", "--duration", "0.5", "--fps", "10", "--interpolate", "--flow-speed", "8"];
    let played = frames(&place, "played", &options);
    let (fast, times) = (fast(&place), stats(&place));
    assert!(played.len() == 5 && fast.iter().all(|count| *count > 100), "{fast:?}");
    let judged = frames(&place, "judged", &[&options[..], &["--mode", "reference"]].concat());
    // A picture alone is no motion.
    let time = times[1]["time"].as_f64().unwrap();
    let still = ["--times", &format!("{time}..{time}"), "--duration", "0.1", "--fps", "10", "--interpolate"];
    let sharp = frames(&place, "sharp", &[&still[..], &["--flow-speed", "8"]].concat());
    assert_eq!((sharp.len(), self::fast(&place)), (1, vec![0]));
    assert!(apart(&sharp[0], &played[1]) > 1e-2, "{}", apart(&sharp[0], &played[1]));
    for (played, judged) in played.iter().zip(&judged) {
        assert!(rmse(played, judged) <= 1e-5 && apart(played, judged) <= 1e-3, "{}", apart(played, judged));
    }
}

#[test]
fn images_of_steps_are_sharp_and_a_step_that_several_frames_show_is_drawn_once() {
    let place = tornado();
    let of_steps = frames(&place, "steps", &["--steps", "8..10"]);
    assert_eq!(fast(&place), [0; 3]);
    assert!(of_steps[1] == exr(&place, "9", &[&FLOW[..], &["--no-volume"]].concat()));
    let motion = ["--steps", "8..10", "--duration", "0.6", "--fps", "10", "--resume"];
    let played = frames(&place, "played", &motion);
    let origins = |place: &Place| -> Vec<String> {
        stats(place).iter().map(|frame| frame["origin"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(origins(&place), ["rendered", "repeated", "repeated", "rendered", "repeated", "rendered"]);
    assert!(played[3] == played[4] && apart(&played[3], &of_steps[1]) > 1e-3);
    let count = fast(&place)[3];
    assert!(count > 0);
    // Other frames around are another blur.
    frames(&place, "played", &motion);
    assert_eq!(origins(&place), ["kept"; 6]);
    let sparse = ["--steps", "8..12:2", "--duration", "0.6", "--fps", "10", "--resume"];
    frames(&place, "played", &sparse);
    assert!(origins(&place)[0] == "rendered" && fast(&place)[0] > count);
}

#[test]
fn the_only_step_of_a_series_is_held_without_being_named() {
    let place = Place::empty();
    place.ok(&["synth", "tornado", "--cells", "600", "--steps", "1", "-o", "t.zarr", "--quiet"]);
    let held = ["--flow-hold", "0.3", "--fps", "10"];
    let frames = [&[][..], &["--steps", "0"]].map(|options| frames(&place, "held", &[&held[..], options].concat()));
    assert!(frames[0].len() == 3 && frames[0] == frames[1] && frames[0][0] != frames[0][1]);
}

#[test]
fn a_run_that_is_continued_draws_again_what_has_travelled_through_other_vectors() {
    let place = Place::empty();
    place.ok(&["synth", "tornado", "--cells", "600", "--steps", "12", "-o", "run", "--quiet"]);
    // From a step on, or until one, the vectors are others.
    let import = |of: &str| {
        let define = format!("w = velocity * (1 + max(0, {of}))");
        place.ok(&["import", "run/run.pvd", "-o", "t.zarr", "--overwrite", "--define", &define, "--quiet"]);
    };
    let origins = || -> Vec<bool> {
        let words = ["render", "t.zarr", "-o", "f_%02d.png", "--field", "pressure", "--size", "16x12", "--flow", "w"];
        place.ok(&[&words[..], &["--stats", "s.json", "--resume", "--quiet"]].concat());
        stats(&place).iter().map(|frame| frame["origin"] == "kept").collect()
    };
    import("0");
    assert_eq!(origins(), [false; 12]);
    let times: Vec<f64> = stats(&place).iter().map(|frame| frame["time"].as_f64().unwrap()).collect();
    import("0");
    assert_eq!(origins(), [true; 12]);
    import(&format!("time - {}", times[8]));
    let until_there: Vec<bool> = (0..12).map(|step| step <= 8).collect();
    assert_eq!(origins(), until_there);
    import(&format!("{} - time", times[2]));
    assert_eq!(origins(), [false; 12], "where the vectors are as before, the way is another");
    assert_eq!(origins(), [true; 12]);
}
