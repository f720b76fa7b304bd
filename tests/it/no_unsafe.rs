//! Which modules of the library may have unsafe code: none. What is needed of it (typed views of bytes, SIMD, file locks) is in
//! dependencies made for that; `.ci/run` runs the tests of the SIMD loops under valgrind.

use std::fs;
use std::path::{Path, PathBuf};

/// Files below `src` that allow it, each with a reason beside the attribute.
const ALLOWED: [&str; 0] = [];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
}

/// Whether a source takes back the lint of `Cargo.toml`, which denies unsafe code, for itself or a part of it.
fn allows(text: &str) -> bool {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<String>();
    let code: String = code.split_whitespace().collect();
    let attributes = code.match_indices("#[").chain(code.match_indices("#![")).map(|(at, _)| &code[at..]);
    attributes.filter_map(|rest| rest.split_once(']')).any(|(attribute, _)| {
        let loosens = ["allow(", "warn(", "expect("].iter().any(|level| attribute.contains(level));
        loosens && attribute.contains("unsafe_code")
    })
}

#[test]
fn no_module_allows_unsafe_code() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = fs::read_to_string(root.join("Cargo.toml")).unwrap();
    assert!(manifest.contains("\nunsafe_code = \"deny\""), "the lint is what makes unsafe code an error");
    let sources: Vec<PathBuf> =
        sources(&root.join("src")).into_iter().filter(|path| path.extension().is_some_and(|e| e == "rs")).collect();
    assert!(sources.len() > 200, "{} files are not the library", sources.len());
    let name = |path: &PathBuf| path.strip_prefix(root.join("src")).unwrap().to_str().unwrap().replace('\\', "/");
    let found: Vec<String> =
        sources.iter().filter(|path| allows(&fs::read_to_string(path).unwrap())).map(name).collect();
    assert_eq!(found, ALLOWED);
    // And one would be found.
    for text in [
        "#![allow(unsafe_code)]",
        "#[allow(dead_code, unsafe_code, reason = \"mapping\")]\nfn f() {}",
        "#[cfg_attr(unix,\n    expect(\n    unsafe_code))]",
    ] {
        assert!(allows(text), "{text}");
    }
    assert!(!allows("// #![allow(unsafe_code)]") && !allows("#[allow(dead_code)] fn unsafe_code() {}"));
}
