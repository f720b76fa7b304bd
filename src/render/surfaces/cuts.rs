//! Planes through the cells: sections, clips, and crop boxes of six clips.

use super::text::ByField;
use crate::mesh::{Plane, Positions};
use crate::short::Short;
use crate::visibility::CutPlanes;
use crate::words::numbers;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A plane through the cells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// A point of the plane, world coordinates.
    pub point: [f64; 3],
    /// Normal of the plane, world coordinates, of any length but 0.
    pub normal: [f64; 3],
    /// Whether the side that the normal points to is cut away; otherwise the section is drawn, opaque and unlit, in the colours of the
    /// transfer function.
    #[serde(default)]
    pub clips: bool,
    /// Index of the field beside whose colours the section has, instead of those of the transfer function.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<u8>,
}

impl Cut {
    /// The plane moved along its normal by a world length.
    #[must_use]
    pub fn moved(&self, by: f64) -> Self {
        let normal = DVec3::from(self.normal);
        let unit = (normal / normal.abs().max_element()).normalize_or_zero();
        Self { point: (DVec3::from(self.point) + by * unit).to_array(), ..*self }
    }
}

/// A box that clips everything outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CropBox {
    /// The corner with the least coordinates, world.
    pub min: [f64; 3],
    /// The corner with the greatest coordinates, world.
    pub max: [f64; 3],
}

impl CropBox {
    /// The sides of the box as clips.
    pub fn cuts(&self) -> [Cut; 6] {
        let side = |axis: usize, point: [f64; 3], sign: f64| {
            let mut normal = [0.0; 3];
            normal[axis] = sign;
            Cut { point, normal, clips: true, by: None }
        };
        std::array::from_fn(|at| if at < 3 { side(at, self.min, -1.0) } else { side(at - 3, self.max, 1.0) })
    }
}

/// A point or normal that defines no plane.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "cut {place} has the point {point:?} and the normal {normal:?}; both are three finite numbers, not all of the normal 0"
)]
pub struct CutError {
    /// Zero-based index in the list.
    pub place: usize,
    /// Point given.
    pub point: [f64; 3],
    /// Normal given.
    pub normal: [f64; 3],
}

/// Checks that the planes are defined.
///
/// # Errors
/// If a point or a normal is not finite, or a normal is 0.
pub fn check_cuts(cuts: &[Cut]) -> Result<(), CutError> {
    let is_none = |cut: &Cut| !cut.point.iter().chain(&cut.normal).all(|x| x.is_finite()) || cut.normal == [0.0; 3];
    match cuts.iter().position(is_none) {
        None => Ok(()),
        Some(place) => Err(CutError { place, point: cuts[place].point, normal: cuts[place].normal }),
    }
}

/// The planes in the local coordinates of a mesh.
///
/// # Errors
/// As [`check_cuts`]; also if a plane is too far away for local coordinates.
pub fn cut_planes(cuts: &[Cut], positions: &Positions) -> Result<CutPlanes, CutError> {
    check_cuts(cuts)?;
    let mut planes = CutPlanes::default();
    for (place, &Cut { point, normal, clips, .. }) in cuts.iter().enumerate() {
        let plane = Plane::new(positions, point.into(), normal.into()).ok_or(CutError { place, point, normal })?;
        if clips { planes.clips.push(plane) } else { planes.sections.push(plane) }
    }
    Ok(planes)
}

/// A cut in the syntax of options: `point=x,y,z normal=x,y,z [clip] [field=NAME[@MAP]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct CutText {
    /// The plane.
    pub cut: Cut,
    /// The field that its section shows.
    pub by: Option<ByField>,
}

impl FromStr for CutText {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (fields, rest): (Vec<&str>, Vec<&str>) =
            text.split_whitespace().partition(|part| part.starts_with("field="));
        let cut: Cut = rest.join(" ").parse()?;
        let by = match fields[..] {
            [] => None,
            [field] => Some(field.trim_start_matches("field=").parse()?),
            _ => return Err("field= comes twice; a section shows one".to_owned()),
        };
        if cut.clips && by.is_some() {
            return Err("a clip has no section to show a field on; leave 'clip' or field= out".to_owned());
        }
        Ok(Self { cut, by })
    }
}

impl fmt::Display for CutText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.cut)?;
        self.by.as_ref().map_or(Ok(()), |by| write!(f, " field={by}"))
    }
}

impl FromStr for Cut {
    type Err = String;

    /// Parses `point=x,y,z normal=x,y,z`, with `clip` for a clip.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut cut = Parts::read(text, ["point", "normal"], "point=x,y,z normal=x,y,z, with or without clip")?;
        let clips = cut.words.pop_if(|word| word == "clip").is_some();
        if let Some(word) = cut.words.first() {
            return Err(format!("'{word}' is no part of a cut; write point=x,y,z normal=x,y,z, with or without clip"));
        }
        let [point, normal] = cut.values;
        if normal == [0.0; 3] {
            return Err("normal=0,0,0 has no direction; write one that has, as in normal=0,0,1".to_owned());
        }
        Ok(Self { point, normal, clips, by: None })
    }
}

impl fmt::Display for Cut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { point, normal, clips, .. } = self;
        write!(f, "point={} normal={}{}", Triple(point), Triple(normal), if *clips { " clip" } else { "" })
    }
}

impl FromStr for CropBox {
    type Err = String;

    /// Parses `min=x,y,z max=x,y,z`.
    fn from_str(text: &str) -> Result<Self, String> {
        let Parts { values: [min, max], words } = Parts::read(text, ["min", "max"], "min=x,y,z max=x,y,z")?;
        if let Some(word) = words.first() {
            return Err(format!("'{word}' is no part of a box; write min=x,y,z max=x,y,z"));
        }
        match (0..3).find(|&axis| min[axis] >= max[axis]) {
            None => Ok(Self { min, max }),
            Some(axis) => Err(format!(
                "the box goes from {} to {} in {}; the first of them is the lesser",
                Short(min[axis]),
                Short(max[axis]),
                ["x", "y", "z"][axis]
            )),
        }
    }
}

impl fmt::Display for CropBox {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "min={} max={}", Triple(&self.min), Triple(&self.max))
    }
}

struct Triple<'a>(&'a [f64; 3]);

impl fmt::Display for Triple<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0.map(Short);
        write!(f, "{x},{y},{z}")
    }
}

/// Two named triples of numbers, and the other words.
struct Parts {
    values: [[f64; 3]; 2],
    words: Vec<String>,
}

impl Parts {
    fn read(text: &str, names: [&str; 2], form: &str) -> Result<Self, String> {
        let (mut values, mut words) = ([None; 2], Vec::new());
        for part in text.split_whitespace() {
            let named =
                part.split_once('=').and_then(|(key, value)| Some((names.iter().position(|n| *n == key)?, value)));
            match named {
                None => words.push(part.to_owned()),
                Some((at, _)) if values[at].is_some() => return Err(format!("'{part}' comes twice; write {form}")),
                Some((at, value)) => {
                    let wrong = || format!("'{part}' has not three finite numbers; write {form}");
                    values[at] = Some(numbers(value).ok_or_else(wrong)?);
                }
            }
        }
        let missing = |at: usize| format!("{}= is missing; write {form}", names[at]);
        let [first, second] = values;
        Ok(Self { values: [first.ok_or_else(|| missing(0))?, second.ok_or_else(|| missing(1))?], words })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_no_cut_is_refused_by_what_is_wrong() {
        for (text, words) in [
            ("", "point= is missing"),
            ("point=0,0,0", "normal= is missing"),
            ("point=0,0 normal=0,0,1", "'point=0,0' has not three finite numbers"),
            ("point=0,0,nan normal=0,0,1", "has not three finite numbers"),
            ("point=0,0,0 normal=0,0,0", "has no direction"),
            ("point=0,0,0 normal=0,0,1 normal=1,0,0", "'normal=1,0,0' comes twice"),
            ("point=0,0,0 normal=0,0,1 clop", "'clop' is no part of a cut"),
            ("point=0,0,0 normal=0,0,1 clip clip", "'clip' is no part of a cut"),
        ] {
            let said = text.parse::<Cut>().unwrap_err();
            assert!(said.contains(words), "{text}: {said}");
        }
        for (text, words) in [
            ("min=0,0,0", "max= is missing"),
            ("min=0,0,0 max=1,0,1", "from 0 to 0 in y"),
            ("min=0,0,0 max=1,1,1 clip", "'clip' is no part of a box"),
        ] {
            let said = text.parse::<CropBox>().unwrap_err();
            assert!(said.contains(words), "{text}: {said}");
        }
        let bad = Cut { point: [0.0; 3], normal: [0.0, f64::NAN, 1.0], clips: false, by: None };
        assert_eq!(check_cuts(&[bad]).unwrap_err().place, 0);
        assert_eq!(
            check_cuts(&[Cut { normal: [1.0; 3], ..bad }, Cut { normal: [0.0; 3], ..bad }]).unwrap_err().place,
            1
        );
    }

    #[test]
    fn a_box_is_its_six_sides() {
        let crop: CropBox = "min=-1,0,2 max=1,3,5".parse().unwrap();
        let inside =
            |p: DVec3| crop.cuts().iter().all(|cut| DVec3::from(cut.normal).dot(p - DVec3::from(cut.point)) <= 0.0);
        assert!(inside(DVec3::new(0.9, 0.1, 4.9)) && inside(DVec3::new(-1.0, 3.0, 2.0)));
        for out in
            [[1.1, 1.0, 3.0], [-1.1, 1.0, 3.0], [0.0, -0.1, 3.0], [0.0, 3.1, 3.0], [0.0, 1.0, 1.9], [0.0, 1.0, 5.1]]
        {
            assert!(!inside(out.into()), "{out:?}");
        }
    }

    #[test]
    fn a_cut_moves_along_its_normal_by_world_lengths() {
        let cut: Cut = "point=1,2,3 normal=0,-1e-200,0".parse().unwrap();
        assert_eq!(cut.moved(0.5).point, [1.0, 1.5, 3.0]);
    }

    proptest! {
        #[test]
        fn texts_come_back(point: [i32; 3], normal in prop::array::uniform3(1e-3..1e3_f64), clips: bool) {
            let cut = Cut { point: point.map(|x| f64::from(x) / 64.0), normal, clips, by: None };
            prop_assert_eq!(cut.to_string().parse::<Cut>().unwrap(), cut);
            let crop = CropBox { min: cut.point, max: [0, 1, 2].map(|axis| cut.point[axis] + normal[axis]) };
            prop_assert_eq!(crop.to_string().parse::<CropBox>().unwrap(), crop);
        }
    }
}
