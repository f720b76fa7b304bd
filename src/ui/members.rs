//! Changes of ensembles and their members, for the editor: as edits of the project.

use super::tracks::{KeyValue, Track, map_track};
use super::{opacity, shapes};
use crate::project::{Edit, LookSettings, MapTrack, Project, TrackEdit};
use crate::timeline::Key;
use crate::transfer::{
    ColorMap, ColorPoint, Ensemble, Function, MappedRange, Member, OpacityPoint, OpacityValues, Polyline,
    PolylinePoint, PositionKind, RangeMap, Space, TransferFunction,
};

/// Indices of an ensemble and of a member in it.
pub type Place = (usize, usize);

/// The member at a place.
pub fn member_at(project: &Project, (ensemble, index): Place) -> Option<&Member> {
    project.ensembles.get(ensemble)?.members.get(index)
}

/// A name that is not taken: the wanted one, or the first of `NAME 2`, `NAME 3`, ...
pub fn free_name<'a>(wanted: &str, taken: impl Iterator<Item = &'a str>) -> String {
    let taken: Vec<&str> = taken.collect();
    let base = wanted.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end();
    let base = if base.is_empty() { wanted } else { base };
    let numbered = (2..).map(|number| format!("{base} {number}"));
    let mut names = std::iter::once(wanted.to_owned()).chain(numbered);
    names.find(|name| !taken.contains(&name.as_str())).unwrap_or_default()
}

fn names_of(ensemble: &Ensemble) -> impl Iterator<Item = &str> {
    ensemble.members.iter().map(|member| member.name.as_str())
}

/// Adds a member with one shape behind another, over the same quantities and range.
pub fn added(project: &Project, (ensemble, index): Place) -> Option<Edit> {
    let of = project.ensembles.get(ensemble)?;
    let like = of.members.get(index).cloned();
    let space = like.as_ref().map_or(Space::Scalar, |member| member.space);
    let function = Function::Widgets(vec![shapes::Kind::first_of(space.axes()).shape(of.members.len())]);
    let name = free_name("member", names_of(of));
    let range = like.map_or_else(Default::default, |member| member.range);
    let member = Box::new(Member { space, range, ..Member::new(name, function) });
    Some(Edit::InsertMember { ensemble, index: (index + 1).min(of.members.len()), member })
}

/// Adds a copy of a member behind it, with the track of its range maps.
pub fn copied(project: &Project, (ensemble, index): Place) -> Option<Edit> {
    let of = project.ensembles.get(ensemble)?;
    let member = of.members.get(index)?;
    let name = free_name(&member.name, names_of(of));
    let copy = Box::new(Member { name: name.clone(), ..member.clone() });
    let mut edits = vec![Edit::InsertMember { ensemble, index: index + 1, member: copy }];
    if let Some((_, track)) = map_track(project, ensemble, index) {
        let track = MapTrack { member: name, ..track.clone() };
        edits.push(Edit::InsertMapTrack { index: project.timeline.maps.len(), track });
    }
    Some(Edit::All(edits))
}

/// Removes a member and the track of its range maps; the last one stays.
pub fn removed(project: &Project, (ensemble, index): Place) -> Option<Edit> {
    let of = project.ensembles.get(ensemble).filter(|of| of.members.len() > 1)?;
    of.members.get(index)?;
    let track = map_track(project, ensemble, index).map(|(index, _)| Edit::RemoveMapTrack { index });
    Some(Edit::All(track.into_iter().chain([Edit::RemoveMember { ensemble, index }]).collect()))
}

/// Adds a copy of an ensemble behind it, with the tracks of its range maps.
pub fn copied_ensemble(project: &Project, index: usize) -> Option<Edit> {
    let of = project.ensembles.get(index)?;
    let name = free_name(&of.name, project.ensembles.iter().map(|ensemble| ensemble.name.as_str()));
    let tracks = &project.timeline.maps;
    let copies = tracks.iter().filter(|track| track.ensemble == of.name);
    let copies = copies.zip(tracks.len()..).map(|(track, index)| {
        let track = MapTrack { ensemble: name.clone(), ..track.clone() };
        Edit::InsertMapTrack { index, track }
    });
    let ensemble = Ensemble { name: name.clone(), ..of.clone() };
    Some(Edit::All(std::iter::once(Edit::InsertEnsemble { index: index + 1, ensemble }).chain(copies).collect()))
}

/// Removes an ensemble with all that names it: its keys, the tracks of its range maps, and its being the one shown without keys. The last one
/// stays.
pub fn removed_ensemble(project: &Project, index: usize) -> Option<Edit> {
    let of = project.ensembles.get(index).filter(|_| project.ensembles.len() > 1)?;
    let timeline = &project.timeline;
    let tracks = (0..timeline.maps.len()).rev().filter(|&track| timeline.maps[track].ensemble == of.name);
    let keys = timeline.ensembles.keys();
    let keys = (0..keys.len()).rev().filter(|&key| keys[key].value == of.name);
    let mut edits: Vec<Edit> = tracks.map(|index| Edit::RemoveMapTrack { index }).collect();
    edits.extend(keys.map(|index| Edit::Ensembles(TrackEdit::Remove { index })));
    if project.look.ensemble.as_ref() == Some(&of.name) {
        let look = LookSettings { ensemble: None, ..project.look.clone() };
        edits.push(Edit::SetLook(Box::new(look)));
    }
    edits.push(Edit::RemoveEnsemble { index });
    Some(Edit::All(edits))
}

/// The range map of a member at a time: that of its track, if that has keys.
pub fn map_at(project: &Project, (ensemble, member): Place, time: Option<f64>) -> RangeMap {
    let of_track = time.and_then(|time| Track::Map { ensemble, member }.value_at(project, time));
    match of_track {
        Some(KeyValue::Map(map)) => map,
        _ => member_at(project, (ensemble, member)).map(|member| member.map.clone()).unwrap_or_default(),
    }
}

/// Sets the range map of a member: at this time, if its maps have keys; a new key has the transition of the one before it.
pub fn with_map(project: &Project, place: Place, time: Option<f64>, map: RangeMap) -> Option<Edit> {
    let (ensemble, index) = place;
    let track = Track::Map { ensemble, member: index };
    let keys = track.keys(project);
    if let (Some(time), Some(first)) = (time, keys.first()) {
        let before = keys.iter().rev().find(|key| key.time <= time).unwrap_or(first);
        return track.insert(project, Key { time, value: KeyValue::Map(map), transition: before.transition });
    }
    let member = Box::new(Member { map, ..member_at(project, place)?.clone() });
    Some(Edit::SetMember { ensemble, index, member })
}

/// The member over other quantities: a curve or shapes that cannot be used there are replaced.
#[must_use]
pub fn in_space(member: &Member, space: Space, range: Option<&MappedRange>) -> Member {
    let axes = space.axes();
    let function = match &member.function {
        Function::TransferFunction(tf) if axes == 1 => match range {
            Some(range) if space == Space::Cov => relative(tf, range).map(Function::TransferFunction),
            _ => Some(Function::TransferFunction(tf.clone())),
        },
        Function::TransferFunction(_) => None,
        Function::Widgets(widgets) => {
            Some(Function::Widgets(widgets.iter().map(|widget| shapes::on_axes(widget, axes)).collect()))
        }
    };
    let function = function.unwrap_or_else(|| Function::Widgets(vec![shapes::Kind::first_of(axes).shape(0)]));
    Member { space, function, ..member.clone() }
}

/// The transfer function with its points as fractions of the range.
fn relative(tf: &TransferFunction, range: &MappedRange) -> Option<TransferFunction> {
    let points = opacity::relative_points(tf, range);
    TransferFunction::new(tf.color_map().clone(), points, PositionKind::Relative, tf.values()).ok()
}

/// Intervals between positions at which colours of a map are taken for points of a polyline.
const COLORS: usize = 16;

/// A transfer function as one polyline, whose points are those of the opacity and 17 of the colours; values above 1 become 1.
pub fn as_polyline(tf: &TransferFunction, range: &MappedRange) -> Function {
    let curve = opacity::relative_points(tf, range);
    let colors = (0..=COLORS).map(|i| i as f64 / COLORS as f64);
    let mut positions: Vec<f64> = colors.chain(curve.iter().map(|point| point.position)).collect();
    positions.sort_by(f64::total_cmp);
    positions.dedup();
    let points = positions.into_iter().flat_map(|position| {
        let rgb = tf.color_map().eval(position);
        let [left, right] = opacity::sides_at(&curve, position);
        let sides = if left == right { vec![right] } else { vec![left, right] };
        sides.into_iter().map(move |value| PolylinePoint { position, rgb, opacity: value.clamp(0.0, 1.0) })
    });
    Function::Widgets(vec![shapes::polyline(points.collect())])
}

/// A polyline as a transfer function: it is transparent before its first point and behind its last one.
pub fn as_curve(polyline: &Polyline) -> Option<TransferFunction> {
    let (first, last) = (polyline.points.first()?, polyline.points.last()?);
    let ends = [(0.0, first.rgb), (1.0, last.rgb)].map(|(position, rgb)| ColorPoint { position, rgb });
    let inner = polyline.points.iter().map(|point| ColorPoint { position: point.position, rgb: point.rgb });
    let colors = ends[..1].iter().copied().chain(inner).chain(ends[1..].iter().copied());
    let map = ColorMap::new("polyline", colors.collect(), None).ok()?;
    let clear = |point: &PolylinePoint| OpacityPoint { position: point.position, value: 0.0 };
    let points = polyline.points.iter().map(|point| OpacityPoint { position: point.position, value: point.opacity });
    let before = Some(clear(first)).filter(|point| point.position > 0.0);
    let behind = Some(clear(last)).filter(|point| point.position < 1.0);
    let points = before.into_iter().chain(points).chain(behind).collect();
    TransferFunction::new(map, points, PositionKind::Relative, OpacityValues::Opacity).ok()
}

#[cfg(test)]
#[path = "members_tests.rs"]
mod tests;
