//! Settings that are kept, and damage to the file.

use super::*;
use crate::transfer::{Lengths, OpacityPoint};
use glam::DVec3;
use proptest::prelude::*;
use std::fs;

fn look(scale: f64) -> Look {
    let camera = Camera::default_for((DVec3::splat(-scale), DVec3::splat(scale))).unwrap();
    let tf = TransferFunction::parse("inferno@0:0,0.3:0.125,1:0.5").unwrap();
    let (range, opacity_kind) = (RangePolicy::Manual(-scale, 0.1), Default::default());
    let (mode, backend, optics) = Default::default();
    Look {
        surfaces: Default::default(),
        camera,
        tf,
        range,
        opacity_kind,
        lengths: Lengths::of_unit_distance(0.01),
        mode,
        representation: Default::default(),
        faces: Default::default(),
        points: Default::default(),
        sheets: Default::default(),
        functions: Default::default(),
        flow: None,
        backend,
        optics,
        skip: Default::default(),
        followed: Default::default(),
    }
}

/// Settings with every field set.
fn full() -> Settings {
    let mut settings = Settings { image_scale: 0.5, target_rate: 30.0, shows_side: false, ..Default::default() };
    settings.screenshot_folder = absolute("pictures").ok();
    (0..3).for_each(|i| settings.remember_file(format!("{i}.zarr").as_ref()));
    settings.remember_look("0.zarr".as_ref(), "T", &look(3.0));
    settings
}

fn names(settings: &Settings) -> Vec<String> {
    settings.recent.iter().map(|file| file.path.file_name().unwrap().to_str().unwrap().to_owned()).collect()
}

fn list(dir: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn what_was_saved_is_there_again() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("not/yet");
    let mut file = SettingsFile::at(&folder);
    assert_eq!(file.load(), (Settings::default(), None));
    assert!(!folder.exists(), "looking makes nothing");
    let mut settings = full();
    assert_eq!(file.save(&mut settings), None);
    assert_eq!(settings, full_like(&settings));
    assert_eq!(SettingsFile::at(&folder).load(), (settings.clone(), None));
    assert_eq!(list(&folder), ["settings.json"]);
    let mut seen = look(1.0);
    settings.look_of("0.zarr".as_ref()).unwrap().apply_to(&mut seen);
    assert_eq!(seen, look(3.0));
    assert!(settings.look_of("1.zarr".as_ref()).is_none());
}

/// [`full`] with the times of others.
fn full_like(other: &Settings) -> Settings {
    let mut settings = full();
    settings.recent.iter_mut().zip(&other.recent).for_each(|(a, b)| a.opened_ms = b.opened_ms);
    settings.looks.iter_mut().zip(&other.looks).for_each(|(a, b)| a.used_ms = b.used_ms);
    settings
}

#[test]
fn recent_files_are_absolute_newest_first_without_repetition_and_few() {
    let mut settings = Settings::default();
    for i in (0..RECENT_MAX + 3).chain([5]) {
        settings.remember_file(format!("{i}.zarr").as_ref());
        settings.remember_look(format!("{i}.zarr").as_ref(), "T", &look(1.0));
    }
    let found = names(&settings);
    assert_eq!((found.len(), &found[..3]), (RECENT_MAX, &["5.zarr", "12.zarr", "11.zarr"].map(str::to_owned)[..]));
    assert!(settings.recent.iter().all(|file| file.path.is_absolute() && !file.path.exists()));
    assert_eq!(settings.looks.len(), RECENT_MAX + 3);
    (0..99).for_each(|i| settings.remember_look(format!("{i}").as_ref(), "T", &look(1.0)));
    assert_eq!(settings.looks.len(), LOOKS_MAX);
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        let before = settings.clone();
        settings.remember_file(std::ffi::OsStr::from_bytes(b"/no \xff text").as_ref());
        assert_eq!(settings, before, "JSON has no such text");
    }
}

#[test]
fn two_windows_keep_the_recent_files_of_both_and_what_one_forgot_stays_forgotten() {
    let dir = tempfile::tempdir().unwrap();
    let mut files = [SettingsFile::at(dir.path()), SettingsFile::at(dir.path())];
    let mut start = Settings::default();
    start.remember_file("old.zarr".as_ref());
    assert_eq!(files[0].save(&mut start), None);
    let [mut a, mut b] = files.each_mut().map(|file| file.load().0);
    a.remember_file("a.zarr".as_ref());
    a.remember_look("a.zarr".as_ref(), "T", &look(1.0));
    a.image_scale = 2.0;
    assert_eq!(files[0].save(&mut a), None);
    b.remember_file("b.zarr".as_ref());
    let old = absolute("old.zarr").unwrap();
    b.recent.retain(|file| file.path != old);
    assert_eq!(files[1].save(&mut b), None);
    let mut found = names(&b);
    found.sort();
    assert_eq!((found, b.image_scale), (vec!["a.zarr".to_owned(), "b.zarr".to_owned()], 1.0));
    assert!(b.look_of("a.zarr".as_ref()).is_some());
    assert_eq!(SettingsFile::at(dir.path()).load(), (b, None));
}

#[test]
fn many_that_write_at_once_leave_a_whole_file() {
    let dir = tempfile::tempdir().unwrap();
    std::thread::scope(|scope| {
        for writer in 0..4 {
            let dir = &dir;
            scope.spawn(move || {
                let mut file = SettingsFile::at(dir.path());
                let (mut settings, _) = file.load();
                for i in 0..5 {
                    settings.remember_file(format!("{writer}_{i}.zarr").as_ref());
                    assert_eq!(file.save(&mut settings), None);
                    assert_eq!(file.load().1, None);
                }
            });
        }
    });
    let (settings, notice) = SettingsFile::at(dir.path()).load();
    assert_eq!((notice, list(dir.path())), (None, vec!["settings.json".to_owned()]));
    assert!(settings.recent.len() >= 5, "one of them wrote last");
}

#[test]
fn values_out_of_range_come_back_within_it() {
    let dir = tempfile::tempdir().unwrap();
    let text = r#"{"version": 1, "window_size": [1, 1e9], "background": [-1, 0.5, 7], "image_scale": 100, "target_rate": 0.5,
        "frame_cache_bytes": 18446744073709551615, "screenshot_folder": "here", "of_the_future": [1, {"a": null}]}"#;
    fs::write(dir.path().join("settings.json"), text).unwrap();
    let mut file = SettingsFile::at(dir.path());
    let (mut settings, notice) = file.load();
    assert_eq!(notice, None);
    let expected = Settings {
        window_size: WINDOW_SIDE,
        background: [0.0, 0.5, 1.0],
        image_scale: *IMAGE_SCALES.end(),
        target_rate: *TARGET_FPS.start(),
        frame_cache_bytes: FRAME_CACHE_MAX,
        ..Default::default()
    };
    assert_eq!(settings, expected);
    settings.image_scale = f64::NAN;
    settings.background = [f32::INFINITY; 3];
    assert_eq!(file.save(&mut settings), None);
    assert_eq!((settings.image_scale, settings.background), (1.0, Settings::default().background));
    let text = fs::read_to_string(dir.path().join("settings.json")).unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["of_the_future"], serde_json::json!([1, {"a": null}]), "unknown keys stay");
}

#[test]
fn a_target_rate_is_one_that_a_session_takes() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("settings.json"), r#"{"version": 1, "target_rate": 200}"#).unwrap();
    assert_eq!(SettingsFile::at(dir.path()).load().0.target_rate, *TARGET_FPS.end());
}

#[test]
fn a_damaged_file_is_kept_aside_and_a_newer_one_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("settings.json");
    fs::write(&path, r#"{"image_scale": 2.0, "recent""#).unwrap();
    let mut file = SettingsFile::at(dir.path());
    let (settings, notice) = file.load();
    assert_eq!(settings, Settings::default());
    assert!(notice.is_some_and(|text| text.contains("damaged") && text.contains("settings.json.bad")));
    assert_eq!(list(dir.path()), ["settings.json.bad"]);
    fs::write(&path, r#"{"image_scale": 2.0, "recent": 7}"#).unwrap();
    let (settings, notice) = SettingsFile::at(dir.path()).load();
    assert_eq!((settings.image_scale, list(dir.path())), (2.0, vec!["settings.json.bad".to_owned()]));
    assert!(notice.is_some_and(|text| text.contains("recent")));
    let newer = r#"{"version": 2, "image_scale": 2.0}"#;
    fs::write(&path, newer).unwrap();
    let (mut settings, notice) = file.load();
    assert!(settings.image_scale == 2.0 && notice.is_some_and(|text| text.contains("newer")));
    assert_eq!((file.save(&mut settings), fs::read_to_string(&path).unwrap().as_str()), (None, newer));
}

#[test]
fn where_nothing_can_be_written_that_is_said_once() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("file"), "").unwrap();
    for mut file in [SettingsFile::default(), SettingsFile::at(dir.path().join("file"))] {
        let first = [file.load().1, file.save(&mut full())].into_iter().flatten().collect::<Vec<_>>();
        assert!(first.last().is_some_and(|text| text.contains("TETREEL_CONFIG")), "{first:?}");
        assert_eq!(file.save(&mut full()), None);
    }
}

#[cfg(unix)]
#[test]
fn a_link_stays_a_link() {
    let dir = tempfile::tempdir().unwrap();
    let (link, target) = (dir.path().join("settings.json"), dir.path().join("elsewhere.json"));
    fs::write(&target, "{}").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    assert_eq!(SettingsFile::at(dir.path()).save(&mut full()), None);
    assert!(link.symlink_metadata().unwrap().is_symlink() && fs::read(&target).unwrap().len() > 2);
}

#[test]
fn the_folder_is_the_first_that_is_named() {
    let all = [("TETREEL_CONFIG", "/a"), ("XDG_CONFIG_HOME", "/b"), ("HOME", "/c"), ("APPDATA", "/d")];
    let folder = |system: &str, set: &[(&str, &str)]| {
        let found = folder_from(system, |name| set.iter().find(|(n, _)| *n == name).map(|(_, v)| OsString::from(v)));
        found.map(|path| path.to_str().unwrap().to_owned())
    };
    let linux = [0, 1, 2, 3].map(|skip| folder("linux", &all[skip..]));
    assert_eq!(
        linux.each_ref().map(Option::as_deref),
        [Some("/a"), Some("/b/tetreel"), Some("/c/.config/tetreel"), None]
    );
    assert_eq!(folder("macos", &all[2..]).as_deref(), Some("/c/Library/Application Support/tetreel"));
    assert_eq!(folder("windows", &all[2..]).as_deref(), Some("/d/tetreel"));
    assert_eq!(folder("linux", &[("TETREEL_CONFIG", ""), ("HOME", "/c")]).as_deref(), Some("/c/.config/tetreel"));
}

/// Any settings, within bounds.
fn any_settings() -> impl Strategy<Value = Settings> {
    let files = prop::collection::vec(("[a-zäö \"\\\\]{1,12}", any::<u64>()), 0..14);
    let looks = prop::collection::vec(("[a-z]{1,3}", any::<u64>(), 1e-3..1e6, 0.0..1.0), 0..24);
    let plain = (any::<[f32; 2]>(), any::<bool>(), any::<[f32; 3]>(), any::<f64>(), any::<f64>(), any::<u64>());
    (files, looks, plain).prop_map(|(files, looks, (window_size, shows_side, background, scale, rate, bytes))| {
        let recent =
            files.into_iter().map(|(name, opened_ms)| RecentFile { path: Path::new("/").join(name), opened_ms });
        let saved = |(name, used_ms, scale, value): (String, u64, f64, f64)| {
            let Look { camera, range, tf, .. } = look(scale);
            let point = OpacityPoint { position: value, value };
            let tf = TransferFunction::new(tf.color_map().clone(), vec![point], tf.positions(), tf.values()).unwrap();
            SavedLook { path: Path::new("/").join(&name), used_ms, field: name, camera, tf, range }
        };
        let settings = Settings {
            recent: recent.collect(),
            looks: looks.into_iter().map(saved).collect(),
            window_size,
            shows_side,
            background,
            image_scale: scale,
            target_rate: rate,
            gives_up: shows_side.then_some(Family::Rays),
            frame_cache_bytes: bytes,
            screenshot_folder: None,
            open_sections: [("Opacity".to_owned(), shows_side)].into(),
        };
        settings.within_bounds()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_settings_come_back_as_they_were(settings in any_settings()) {
        let dir = tempfile::tempdir().unwrap();
        let mut written = settings.clone();
        prop_assert_eq!(SettingsFile::at(dir.path()).save(&mut written), None);
        prop_assert_eq!(&written, &settings);
        prop_assert_eq!(SettingsFile::at(dir.path()).load(), (settings, None));
    }

    #[test]
    fn a_file_that_was_damaged_anywhere_is_never_lost(cut in 0.0..1.0_f64, changes in prop::collection::vec((0.0..1.0_f64, any::<u8>()), 0..4)) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("settings.json");
        prop_assert_eq!(SettingsFile::at(dir.path()).save(&mut full()), None);
        let mut bytes = fs::read(&path).unwrap();
        let at = |share: f64, length: usize| (share * length as f64) as usize;
        for (share, byte) in &changes {
            let place = at(*share, bytes.len());
            bytes[place] = *byte;
        }
        if changes.is_empty() {
            bytes.truncate(at(cut, bytes.len()));
        }
        fs::write(&path, &bytes).unwrap();
        let mut file = SettingsFile::at(dir.path());
        let (mut settings, notice) = file.load();
        let bad = dir.path().join("settings.json.bad");
        prop_assert_eq!(bad.exists(), notice.as_ref().is_some_and(|text| text.contains(".bad")));
        let kept = if bad.exists() { &bad } else { &path };
        prop_assert_eq!(fs::read(kept).unwrap(), bytes);
        if !file.is_frozen {
            prop_assert_eq!(file.save(&mut settings), None);
            prop_assert_eq!(SettingsFile::at(dir.path()).load(), (settings, None));
        }
    }
}
