//! The baseline of the throughput gate: what is read, what is refused, and what counts as a change.

#[path = "../../benches/gate/baseline.rs"]
mod baseline;

use baseline::{BAND, Baseline, Change, Counts, Tools, VERSION, compare};
use std::path::Path;

const NAMES: [&str; 2] = ["sort", "walk"];

fn tools() -> Tools {
    Tools { rustc: "1.0.0 (abc)".into(), valgrind: "valgrind-3".into(), target: "x86_64".into() }
}

fn here() -> Baseline {
    Baseline::new(tools(), "the first one", Counts::from([("sort".into(), 1_000_000), ("walk".into(), 7)]))
}

/// The message of a file that is refused.
fn refused(text: &str) -> String {
    let message = Baseline::parse(text, Path::new("b.json"), &NAMES, "renew it").unwrap_err();
    assert!(message.starts_with("b.json: ") && message.ends_with("renew it"), "{message}");
    message
}

#[test]
fn what_was_written_comes_back() {
    let text = here().text().unwrap();
    assert_eq!(Baseline::parse(&text, Path::new("b.json"), &NAMES, "").unwrap(), here());
    assert!(text.contains(&format!("\"version\": {VERSION}")) && text.ends_with("}\n"));
}

#[test]
fn damaged_files_and_other_versions_are_refused_with_place_and_remedy() {
    let text = here().text().unwrap();
    for cut in [0, 1, text.len() / 2, text.len() - 3] {
        assert!(refused(&text[..cut]).contains("line"), "{cut}");
    }
    assert!(refused(&text.replace("\"version\": 1", "\"version\": 2")).contains("'version' is 2"));
    assert!(refused(&text.replace("version", "colour")).contains("no 'version'"));
    assert!(refused(&text.replace("\"walk\": 7", "\"walk\": \"7\"")).contains("line 9"), "the place");
    assert!(refused(&text.replace("\"walk\": 7", "\"walk\": -7")).contains("damaged"));
    assert!(refused(&text.replace("\"walk\": 7", "\"walk\": 0")).contains("'walk'"));
    assert!(refused(&text.replace("reason", "season")).contains("season"));
}

#[test]
fn a_missing_and_an_additional_kernel_are_named() {
    let text = here().text().unwrap();
    assert!(refused(&text.replace("sort", "sart")).contains("lacks 'sort'"));
    assert!(refused(&text.replace("\"walk\": 7", "\"walk\": 7, \"fly\": 8")).contains("'fly'"));
}

#[test]
fn counts_in_the_band_are_the_same_and_beyond_it_on_either_side_not() {
    assert_eq!(BAND, 0.05);
    let change = |new: u64| compare(Some(1_000_000), new).1;
    assert_eq!([change(1_000_000), change(1_049_999), change(950_001)], [Change::Same; 3]);
    assert_eq!([change(1_050_100), change(1_100_000), change(u64::MAX)], [Change::Slower; 3]);
    assert_eq!([change(949_900), change(0)], [Change::Faster; 2]);
    assert_eq!(compare(None, 5).1, Change::New);
    assert!((compare(Some(200), 230).0 - 0.15).abs() < 1e-12);
}

#[test]
fn counts_of_other_tools_are_no_measure() {
    assert_eq!(here().other_tools(&tools()), None);
    let other = Tools { rustc: "1.1.0 (def)".into(), ..tools() };
    let said = here().other_tools(&other).unwrap();
    assert!(said.contains("1.0.0 (abc)") && said.contains("1.1.0 (def)") && !said.contains("valgrind"), "{said}");
    let both = here().other_tools(&Tools { valgrind: "valgrind-4".into(), target: "arm".into(), ..tools() }).unwrap();
    assert!(both.contains("valgrind-4") && both.contains("arm") && !both.contains("compiler"), "{both}");
}
