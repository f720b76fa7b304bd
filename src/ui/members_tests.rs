use super::*;
use crate::project::Data;
use crate::timeline::{Keyframed, Transition};
use crate::transfer::RangePolicy;
use proptest::prelude::*;

fn tf(text: &str) -> TransferFunction {
    TransferFunction::parse(text).unwrap()
}

fn project() -> Project {
    let member = Member::new("one", Function::TransferFunction(tf("viridis@0:0,0.5:0.3,0.5:0.8,1:1")));
    let ensemble = Ensemble { name: "a".to_owned(), members: vec![member], ..Ensemble::default() };
    Project { ensembles: vec![ensemble], ..Project::new(Data { source: "a.zarr".into(), field: None }) }
}

fn after(project: &Project, edit: Option<Edit>) -> Project {
    let mut changed = project.clone();
    edit.expect("an edit").apply(&mut changed).unwrap();
    changed
}

fn names(project: &Project, ensemble: usize) -> Vec<&str> {
    names_of(&project.ensembles[ensemble]).collect()
}

fn with_track(project: &Project, keys: &[f64]) -> Project {
    let key = |&time| Key { time, value: RangeMap::default(), transition: Transition::default() };
    let keys = Keyframed::try_from(keys.iter().map(key).collect::<Vec<_>>()).unwrap();
    let track = MapTrack { ensemble: "a".to_owned(), member: "one".to_owned(), keys };
    after(project, Some(Edit::InsertMapTrack { index: 0, track }))
}

#[test]
fn names_are_free_and_count_on() {
    let name = |wanted: &str, taken: &[&str]| free_name(wanted, taken.iter().copied());
    assert_eq!(name("member", &[]), "member");
    assert_eq!(name("member", &["member"]), "member 2");
    assert_eq!(name("member 2", &["member", "member 2"]), "member 3");
    assert_eq!(name("7", &["7"]), "7 2", "a name of digits alone");
}

#[test]
fn members_come_and_go_with_their_tracks_and_one_stays() {
    let first = project();
    let two = after(&first, added(&first, (0, 0)));
    assert_eq!(names(&two, 0), ["one", "member"]);
    let keyed = with_track(&two, &[0.0]);
    let copy = after(&keyed, copied(&keyed, (0, 0)));
    assert_eq!((names(&copy, 0), copy.timeline.maps.len()), (vec!["one", "one 2", "member"], 2));
    assert_eq!(copy.timeline.maps[1].member, "one 2");
    let without = after(&copy, removed(&copy, (0, 0)));
    assert_eq!((names(&without, 0), without.timeline.maps.len()), (vec!["one 2", "member"], 1));
    assert_eq!(removed(&first, (0, 0)), None);
    assert_eq!((added(&first, (3, 0)), copied(&first, (0, 3)), removed(&two, (0, 3))), (None, None, None));
}

#[test]
fn an_ensemble_takes_what_names_it_with_it() {
    let keyed = with_track(&project(), &[0.0]);
    let two = after(&keyed, copied_ensemble(&keyed, 0));
    assert_eq!((two.ensembles[1].name.as_str(), two.timeline.maps[1].ensemble.as_str()), ("a 2", "a 2"));
    let key = |time, name: &str| {
        let key = Key { time, value: name.to_owned(), transition: Transition::default() };
        Some(Edit::Ensembles(TrackEdit::Insert(key)))
    };
    let named = after(&after(&two, key(0.0, "a")), key(1.0, "a 2"));
    let look = LookSettings { ensemble: Some("a".to_owned()), ..named.look.clone() };
    let named = after(&named, Some(Edit::SetLook(Box::new(look))));
    let one = after(&named, removed_ensemble(&named, 0));
    let left: Vec<&str> = one.timeline.ensembles.keys().iter().map(|key| key.value.as_str()).collect();
    assert_eq!((one.ensembles.len(), left, one.timeline.maps.len()), (1, vec!["a 2"], 1));
    assert_eq!((one.look.ensemble.as_ref(), removed_ensemble(&one, 0)), (None, None));
}

#[test]
fn a_range_map_is_set_at_a_time_where_it_has_keys() {
    let map = RangeMap::new(&[[0.5, 0.2]]).unwrap();
    let plain = project();
    let set = after(&plain, with_map(&plain, (0, 0), Some(2.0), map.clone()));
    assert_eq!((&set.ensembles[0].members[0].map, map_at(&set, (0, 0), Some(7.0))), (&map, map.clone()));
    // A track without keys changes nothing.
    let empty = with_track(&plain, &[]);
    assert_eq!(map_at(&after(&empty, with_map(&empty, (0, 0), Some(2.0), map.clone())), (0, 0), Some(3.0)), map);
    let keyed = with_track(&plain, &[0.0, 4.0]);
    let set = after(&keyed, with_map(&keyed, (0, 0), Some(2.0), map.clone()));
    let times: Vec<f64> = set.timeline.maps[0].keys.keys().iter().map(|key| key.time).collect();
    assert_eq!((times, map_at(&set, (0, 0), Some(2.0))), (vec![0.0, 2.0, 4.0], map.clone()));
    assert_eq!(set.ensembles, plain.ensembles, "the member's own map is not shown, and stays");
    // Before the first picture there is no time: the member's own.
    assert_eq!(map_at(&set, (0, 0), None), RangeMap::default());
}

#[test]
fn over_other_quantities_a_member_is_valid() {
    let range = MappedRange::new(10.0, 20.0, false).unwrap();
    let absolute = TransferFunction::new(
        ColorMap::built_in("gray").unwrap().clone(),
        [(12.0, 0.0), (20.0, 1.0)].map(|(position, value)| OpacityPoint { position, value }).to_vec(),
        PositionKind::Absolute,
        OpacityValues::Opacity,
    );
    let functions = [
        Function::TransferFunction(absolute.unwrap()),
        Function::Widgets(shapes::Kind::ALL.iter().filter(|kind| kind.shape(0).suits(1)).map(|k| k.shape(0)).collect()),
    ];
    for function in functions {
        let member = Member { range: RangePolicy::Manual(10.0, 20.0), ..Member::new("m", function) };
        for space in [Space::Cov, Space::ScalarGradient, Space::ScalarCov, Space::Scalar] {
            let there = in_space(&member, space, Some(&range));
            assert_eq!(there.space, space);
            match &there.function {
                Function::Widgets(shapes) => assert!(shapes.iter().all(|shape| shape.suits(space.axes()))),
                Function::TransferFunction(tf) if space == Space::Cov => {
                    assert_eq!((tf.positions(), tf.points()[0].position), (PositionKind::Relative, 0.2));
                }
                Function::TransferFunction(_) => assert_eq!(space, Space::Scalar),
            }
        }
    }
}

proptest! {
    /// A curve becomes a polyline and a curve again: opacities stay, within the gap that a step has.
    #[test]
    fn a_curve_and_its_polyline_have_the_same_opacities(
        values in prop::collection::vec((0..9_u8, 0.0..1.0_f64), 1..6),
        at in 0.0..1.0_f64,
    ) {
        let mut points: Vec<OpacityPoint> =
            values.iter().map(|&(eighth, value)| OpacityPoint { position: f64::from(eighth) / 8.0, value }).collect();
        points.sort_by(|a, b| a.position.total_cmp(&b.position));
        points.dedup_by_key(|point| point.position);
        let map = ColorMap::built_in("viridis").unwrap().clone();
        let tf = TransferFunction::new(map, points, PositionKind::Relative, OpacityValues::Opacity).unwrap();
        let range = MappedRange::new(0.0, 1.0, false).unwrap();
        let Function::Widgets(shapes) = as_polyline(&tf, &range) else { panic!("a polyline") };
        let [line] = &shapes[..] else { panic!("one polyline") };
        prop_assert_eq!(line.problem(), None);
        let value = opacity::sides_at(tf.points(), at)[1];
        prop_assert!((line.eval_on_line(at).1 - value).abs() < 1e-9);
        let crate::transfer::Widget::Polyline(line) = line else { panic!("a polyline") };
        let back = as_curve(line).unwrap();
        prop_assert!((opacity::sides_at(back.points(), at)[1] - value).abs() < 1e-9);
    }
}
