//! Parsers with bugs, which the replay must find.

use super::run_apart;
use super::targets::{Outcome, Target};
use std::fs;
use std::hint::black_box;
use std::path::Path;

/// Mutants of each of them.
pub const MUTANTS: u64 = 300;

pub const TARGETS: &[Target] = &[
    Target { name: "planted_none", run: |bytes| checked(bytes, |_| ()) },
    Target { name: "planted_panic", run: |bytes| checked(bytes, |n| assert!(n < 100, "a planted bug")) },
    Target { name: "planted_memory", run: |bytes| checked(bytes, memory) },
    Target { name: "planted_depth", run: |bytes| checked(bytes, deep) },
    Target { name: "planted_blind", run: |_| Ok(()) },
];

pub fn seeds(target: &str) -> Option<Vec<(String, Vec<u8>)>> {
    target.starts_with("planted").then(|| vec![("seed".to_owned(), b"7 0123456789".to_vec())])
}

/// A number and at least so many bytes; `act` gets the number.
fn checked(bytes: &[u8], act: impl Fn(u64)) -> Outcome {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let (number, rest) = text.split_once(' ').ok_or("no number")?;
    let number: u64 = number.parse().map_err(|_| "no number")?;
    act(number.min(1 << 20));
    if rest.len() as u64 >= number { Ok(()) } else { Err("too short".to_owned()) }
}

/// Believes a file that claims 4 GiB.
fn memory(number: u64) {
    let bytes: Vec<u8> = Vec::with_capacity((number as usize) << 24);
    black_box(bytes);
}

/// Goes as deep as a file says.
fn deep(number: u64) {
    black_box(depth(number * number));
}

fn depth(number: u64) -> u64 {
    let frame = black_box([number; 64]);
    if number == 0 { 0 } else { depth(number - 1) + frame[number as usize % 64] }
}

#[test]
fn planted_bugs_are_found_and_their_inputs_kept() {
    for (name, kept) in [
        ("planted_none", None),
        ("planted_panic", Some("seed_")),
        ("planted_memory", Some("last")),
        ("planted_depth", Some("last")),
        ("planted_blind", None),
    ] {
        // Memory is limited there only.
        if name == "planted_memory" && !cfg!(target_os = "linux") {
            continue;
        }
        let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz").join(name);
        let _ = fs::remove_dir_all(&out);
        fs::create_dir_all(&out).unwrap();
        let result = run_apart(name, &out);
        assert_eq!(result.is_ok(), name == "planted_none", "{name}: {result:?}");
        if let Some(kept) = kept {
            let is_kept = |entry: fs::DirEntry| entry.file_name().to_string_lossy().starts_with(kept);
            assert!(fs::read_dir(&out).unwrap().any(|entry| is_kept(entry.unwrap())), "{name}");
        }
    }
}
