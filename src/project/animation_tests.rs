//! A project evaluated at times of a series.

use super::*;
use crate::node_table::TransferTable;
use crate::pipeline::test_series::jet;
use std::path::Path;

fn project(timeline: &str) -> Project {
    let text = format!(
        "version = 1\n[data]\nsource = \"x.zarr\"\n{timeline}\n\
         [[ensembles]]\nname = \"mapped\"\n[[ensembles.members]]\nname = \"one\"\nmap = {{ points = [[0.2, 0.7]] }}\n\
         function = {{ transfer-function = {{ color_map = \"viridis\", points = [[0, 0], [1, 0.3]] }} }}\n\
         [[ensembles]]\nname = \"depths\"\n[[ensembles.members]]\nname = \"one\"\n\
         function = {{ transfer-function = {{ color_map = \"gray\", values = \"extinction\", points = [[0, 2], [1, 8]] }} }}\n\
         [[ensembles]]\nname = \"nothing\"\n"
    );
    Project::parse(&text, Path::new("p.toml")).unwrap()
}

/// The tables at these times.
fn tables(timeline: &str, times: &[f64]) -> Vec<TransferTable> {
    let mut animation =
        Animation::new(Arc::new(project(timeline)), jet(), OpacityKind::Alpha, Lengths::of_unit_distance(0.5));
    times.iter().map(|&at| animation.at(0.into(), at, &Cancel::new()).unwrap().colors.unwrap().table).collect()
}

fn keys(names: [&str; 2]) -> String {
    std::iter::zip([0.0, 1.0], names)
        .map(|(time, name)| format!("[[timeline.ensembles]]\ntime = {time:?}\nvalue = \"{name}\"\n"))
        .collect()
}

#[test]
fn a_track_of_range_maps_without_keys_leaves_the_members_own() {
    let track = "[[timeline.maps]]\nensemble = \"mapped\"\nmember = \"one\"\n";
    let own = tables("", &[0.0]);
    assert_eq!(tables(&format!("{track}keys = []\n"), &[0.0]), own);
    let identity = "[[timeline.maps.keys]]\ntime = 0.0\nvalue = { points = [] }\n";
    assert_ne!(tables(&format!("{track}{identity}"), &[0.0]), own, "one with keys does not");
}

#[test]
fn extinctions_fade_to_nothing_and_back() {
    let extinction = |table: &TransferTable| table.over_scalars().eval(1e9).tau;
    for (names, expected) in [(["depths", "nothing"], [8.0, 6.0, 0.0]), (["nothing", "depths"], [0.0, 2.0, 8.0])] {
        let taus: Vec<f64> = tables(&keys(names), &[0.0, 0.25, 1.0]).iter().map(extinction).collect();
        // A few rounding errors.
        assert!(std::iter::zip(&taus, expected).all(|(got, tau)| (got - tau).abs() < 1e-12), "{names:?}: {taus:?}");
    }
}

#[test]
fn between_two_keys_of_one_ensemble_its_table_stays_the_same_one() {
    let still = tables(&keys(["mapped", "mapped"]), &[0.0, 0.25, 0.75]);
    assert!(still.iter().all(|table| Arc::ptr_eq(table.over_scalars(), still[0].over_scalars())));
    let changing = tables(&keys(["mapped", "nothing"]), &[0.25, 0.75]);
    assert_ne!(changing[0], changing[1]);
}
