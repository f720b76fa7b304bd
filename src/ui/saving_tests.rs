//! Projects where nothing can be written: one message, and what was there stays.

use super::desk::Desk;
use super::worker::tests::wait_for;
use super::*;
use crate::transfer::RangePolicy;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Saves to a file, with a change, and waits for the answer.
fn save(desk: &mut Desk, to: &Path) {
    desk.act(Action::Range(RangePolicy::Manual(0.0, 3.0)));
    desk.act(Action::SaveProject { to: Some(to.to_owned()), may_replace: true });
    wait_for("the answer", || {
        desk.session.tick(desk.now);
        (!desk.session.is_saving()).then_some(())
    });
}

/// Saves to a file that cannot be written: there is one message with the file, the problem and the remedy; the change stays, unsaved.
fn refused(desk: &mut Desk, to: &Path, problems: &[&str]) {
    save(desk, to);
    let [Notice { kind: NoticeKind::Error, text, .. }] = desk.session.notices() else {
        panic!("{:?}", desk.session.notices())
    };
    assert!(text.starts_with(&format!("{}: cannot write", to.display())), "{text}");
    assert!(problems.iter().any(|problem| text.contains(problem)), "{text}");
    assert!(text.ends_with(crate::files::PLACE_REMEDY), "{text}");
    assert_eq!((desk.session.project_file(), desk.session.is_changed()), (None, true));
    assert_eq!(desk.session.member().unwrap().range, RangePolicy::Manual(0.0, 3.0));
    desk.settle();
    assert!(desk.session.shown().is_some(), "it goes on");
}

/// A folder in which nothing can be made: the system's, since root may write to any other.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_is_read_only_is_refused() {
    refused(&mut Desk::open(), Path::new("/sys/p.toml"), &["Permission denied", "Read-only file system"]);
}

/// Names the folder of a child process that may write nothing.
const FOLDER: &str = "TETREEL_TEST_FULL_DISK";

#[test]
fn the_child_on_a_full_disk() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
    let file = folder.join("p.toml");
    let (mut desk, before) = (Desk::open(), std::fs::read(&file).unwrap());
    let limit = Command::new("prlimit").args(["--fsize=0", "--pid", &std::process::id().to_string()]).status();
    assert!(limit.unwrap().success());
    refused(&mut desk, &file, &["File too large", "No space left on device"]);
    assert_eq!(std::fs::read(&file).unwrap(), before, "what was on disk stays");
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "nothing is left behind");
    println!("refused on a full disk");
}

/// The limit of the size of files stands for a disk without room: the file can be made, and its bytes cannot be written.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_refused_and_the_project_on_it_stays() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.toml"), "version = 1\n[data]\nsource = \"x.zarr\"\n").unwrap();
    let child = "ui::saving_tests::the_child_on_a_full_disk";
    let output = Command::new("sh")
        .args(["-c", "trap '' XFSZ; exec \"$0\" --exact \"$1\" --nocapture"])
        .arg(std::env::current_exe().unwrap())
        .arg(child)
        .env(FOLDER, folder.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("refused on a full disk"), "{output:?}");
}
