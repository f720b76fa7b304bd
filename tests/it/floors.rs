//! The modules are floors of a house: each imports only from floors below its own. The table is the one in `src/lib.rs`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Row of the table, counted from the bottom, of every top-level module.
type Floors = BTreeMap<String, usize>;

/// The names in back quotes of each row of the table in the crate's documentation.
fn table(lib_rs: &str) -> Floors {
    let rows = lib_rs.lines().filter_map(|line| line.strip_prefix("//! |"));
    let rows = rows.map(|row| row.split('`').skip(1).step_by(2)).filter(|names| names.clone().next().is_some());
    let place = |(floor, names): (usize, _)| {
        Iterator::map(names, move |name: &str| (name.trim_start_matches("mod@").to_owned(), floor))
    };
    rows.enumerate().flat_map(place).collect()
}

/// The source without comments and literals, each replaced by a space.
fn bare_code(source: &str) -> String {
    let mut out = String::new();
    let mut rest = source;
    while let Some(c) = rest.chars().next() {
        let skipped = literal_or_comment(rest);
        if skipped > 0 {
            out.push(' ');
            rest = &rest[skipped..];
        } else {
            out.push(c);
            rest = &rest[c.len_utf8()..];
        }
    }
    out
}

/// Bytes of the comment, string or character that begins here; 0 if none does.
fn literal_or_comment(text: &str) -> usize {
    let to = |end: Option<usize>| end.unwrap_or(text.len());
    if text.starts_with("//") {
        return to(text.find('\n'));
    }
    if text.starts_with("/*") {
        return block_comment(text);
    }
    if text.starts_with('"') {
        return quoted(text, '"');
    }
    if text.starts_with('\'') {
        // A lifetime has no closing quote behind its first character.
        let mut chars = text.chars().skip(1);
        let is_char = matches!((chars.next(), chars.next()), (Some('\\'), _) | (_, Some('\'')));
        return if is_char { quoted(text, '\'') } else { 1 };
    }
    let hashes = text.strip_prefix('r').map(|t| t.len() - t.trim_start_matches('#').len());
    if let Some(hashes) = hashes
        && text[1 + hashes..].starts_with('"')
    {
        let end = format!("\"{}", "#".repeat(hashes));
        return to(text[2 + hashes..].find(&end).map(|at| 2 + hashes + at + end.len()));
    }
    0
}

/// Length of a block comment; they nest.
fn block_comment(text: &str) -> usize {
    let mut depth = 0;
    let mut at = 0;
    while at < text.len() {
        let rest = &text[at..];
        if rest.starts_with("/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if rest.starts_with("*/") {
            (depth, at) = (depth - 1, at + 2);
            if depth == 0 {
                break;
            }
        } else {
            at += rest.chars().next().map_or(1, char::len_utf8);
        }
    }
    at
}

/// Length of a literal in these quotes.
fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            _ if c == quote => return at + 1,
            _ => {}
        }
    }
    text.len()
}

fn is_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The tokens of bare code: names, `::`, and single characters.
fn tokens(code: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut rest = code.trim_start();
    while let Some(c) = rest.chars().next() {
        let name = rest.find(|c: char| !is_name(c)).unwrap_or(rest.len());
        let length = if rest.starts_with("::") { 2 } else { name.max(c.len_utf8()) };
        tokens.push(&rest[..length]);
        rest = rest[length..].trim_start();
    }
    tokens
}

/// What a file takes from the root of the crate: the first name of each path from there, and `*` for all of it. `depth` is
/// the number of modules around its code: 1 in `src/mesh/mod.rs`, 2 in `src/mesh/build.rs`. Of paths that begin with `super`
/// only those to modules of the table count: others may begin deeper, in a module of tests.
fn imports(floors: &Floors, source: &str, depth: usize) -> Vec<String> {
    let code = bare_code(source);
    let tokens = tokens(&code);
    let mut found = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let supers = tokens[at..].chunks(2).take_while(|pair| **pair == ["super", "::"]).count();
        let begin = at + 2 * supers;
        at += 1;
        if tokens[at - 1] == "crate" && tokens.get(at) == Some(&"::") {
            found.extend(first_names(&tokens[at + 1..]));
        } else if tokens[at - 1] == "crate" && tokens.get(at) == Some(&"as") {
            found.push("*".to_owned());
        } else if supers >= depth {
            found.extend(first_names(&tokens[begin..]).into_iter().filter(|name| floors.contains_key(name)));
            at = begin;
        }
    }
    found
}

/// The first names of a path or of the braces that begin here.
fn first_names(tokens: &[&str]) -> Vec<String> {
    if tokens.first() != Some(&"{") {
        return tokens.first().map(|name| (*name).to_owned()).into_iter().collect();
    }
    let mut names = Vec::new();
    let mut depth = 0;
    for pair in tokens.windows(2) {
        match pair[0] {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            break;
        }
        if depth == 1 && matches!(pair[0], "{" | ",") && pair[1] != "}" {
            names.push(pair[1].to_owned());
        }
    }
    names
}

/// The imports of a file (`mesh/build.rs`) that do not go down. Names that are no module are items of the crate's root,
/// of which there are none.
fn upward(floors: &Floors, file: &Path, source: &str) -> Vec<String> {
    let mut modules: Vec<String> = file.iter().map(|part| part.to_string_lossy().replace(".rs", "")).collect();
    modules.retain(|name| name != "mod");
    let module = modules[0].as_str();
    let own = floors.get(module);
    let goes_down = |name: &str| name == module || floors.get(name).zip(own).is_some_and(|(other, own)| other < own);
    let imports = imports(floors, source, modules.len());
    let wrong = imports.iter().filter(|name| !goes_down(name));
    wrong.map(|name| format!("src/{}: {module} imports {name}", file.display())).collect()
}

fn source_dir() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// All `.rs` files below a folder, relative to it, sorted.
fn rust_files(dir: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![dir.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path.strip_prefix(dir).unwrap().to_owned());
            }
        }
    }
    files.sort();
    files
}

#[test]
fn every_module_imports_only_from_floors_below_its_own() {
    let dir = source_dir();
    let floors = table(&std::fs::read_to_string(dir.join("lib.rs")).unwrap());
    let mut wrong = Vec::new();
    let mut checked = 0;
    // The roots of library and command stand outside the house.
    for file in rust_files(&dir).iter().filter(|f| !["lib.rs", "main.rs"].iter().any(|root| f.as_os_str() == *root)) {
        let source = std::fs::read_to_string(dir.join(file)).unwrap();
        checked += imports(&floors, &source, file.iter().count()).len();
        wrong.extend(upward(&floors, file, &source));
    }
    assert!(wrong.is_empty(), "against the table in src/lib.rs:\n{}", wrong.join("\n"));
    // One per module is far too few; none would mean that imports are no longer found.
    assert!(checked > floors.len(), "only {checked} imports found");
}

#[test]
fn every_module_has_one_place_in_the_table() {
    let dir = source_dir();
    let lib = std::fs::read_to_string(dir.join("lib.rs")).unwrap();
    let in_table: Vec<String> = table(&lib).into_keys().collect();
    let mut declared: Vec<&str> = lib.lines().filter_map(|line| line.split_once("mod ")?.1.strip_suffix(';')).collect();
    declared.sort_unstable();
    assert_eq!(in_table, declared);
    let names = lib.lines().filter(|line| line.starts_with("//! |")).map(|row| row.matches('`').count() / 2);
    assert_eq!(names.sum::<usize>(), in_table.len(), "a module is in the table twice");
}

#[test]
fn an_upward_import_is_found_in_every_spelling() {
    let floors = table("//! | 0 | [`low`], [`side`] |\n//! | 1 | [`middle`] |\n//! | 2 | [`mod@high`] |\n");
    assert_eq!(floors, Floors::from([("low", 0), ("side", 0), ("middle", 1), ("high", 2)].map(|(n, f)| (n.into(), f))));
    for bad in [
        "use crate::high::Thing;",
        "use crate::{low::A, high};",
        "use crate::{\n    low::{A, B},\n    high::{C, D},\n};",
        "fn f() { let c = '\\''; crate::high::go(c) }",
        "fn f<'a>(x: &'a str) -> &'a str { crate :: high::go(x) }",
        "/* a /* nested */ comment */ pub use crate::high as other;",
        "const S: &str = r#\"a \" quote\"#; const B: &[u8] = br\"\\\"; use crate::high::X;",
        "use super::super::high::X;",
        "mod deep { use super::super::super::high::X; }",
        "use super::super::{low, high};",
        "use crate::*;",
        "use crate as tetreel;",
        "use crate::nowhere::X;",
    ] {
        assert_eq!(upward(&floors, Path::new("middle/part.rs"), bad).len(), 1, "{bad}");
    }
    assert_eq!(upward(&floors, Path::new("low.rs"), "use crate::side::X;").len(), 1, "the same floor");
    assert_eq!(upward(&floors, Path::new("unknown.rs"), "use crate::low::X;").len(), 1, "a module without a floor");
}

#[test]
fn what_goes_down_or_is_no_import_is_let_through() {
    let floors = table("//! | 0 | [`low`] |\n//! | 1 | [`middle`] |\n//! | 2 | [`high`] |\n");
    for good in [
        "use crate::low::{A, B};",
        "use crate::middle::Other;",
        "use super::high::X; // a part of middle that has the same name",
        "/// See [`crate::high`].\n// use crate::high;\n/* crate::high */",
        "const S: &str = \"crate::high\"; const R: &str = r\"crate::high\\\"; const C: char = '\"';",
        "pub(crate) fn f() {}",
        "mod tests { use super::*; }",
    ] {
        assert_eq!(upward(&floors, Path::new("middle/part.rs"), good), Vec::<String>::new(), "{good}");
    }
    assert_eq!(upward(&floors, Path::new("middle/mod.rs"), "mod tests { use super::*; }"), Vec::<String>::new());
}
