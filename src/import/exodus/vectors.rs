//! Vectors and tensors, which files hold as a variable for each component.

use std::collections::{HashMap, HashSet};

/// The ends of names of components, in the order of the components; tensors first, whose names also end as those of vectors.
const ENDS: &[&[&str]] = &[
    &["XX", "YY", "ZZ", "XY", "YZ", "XZ"],
    &["XX", "YY", "ZZ", "XY", "YZ", "ZX"],
    &["xx", "yy", "zz", "xy", "yz", "xz"],
    &["xx", "yy", "zz", "xy", "yz", "zx"],
    &["X", "Y", "Z"],
    &["x", "y", "z"],
];
/// What may stand between a name and such an end.
const SEPARATORS: &[char] = &['_', '.', '-', ' ', ':'];

/// An array: its name, and the positions of its components among all names.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Components {
    pub(super) name: String,
    pub(super) members: Vec<usize>,
}

/// Joins names that differ in their ends alone, of one case, in the order of the first member of each. Other names stay alone, as do
/// those whose common name is another variable's.
pub(super) fn joined(names: &[String]) -> Vec<Components> {
    let mut positions = HashMap::new();
    for (position, name) in names.iter().enumerate() {
        positions.entry(name.as_str()).or_insert(position);
    }
    let mut arrays: Vec<(usize, Components)> = Vec::new();
    let (mut taken, mut given) = (HashSet::new(), HashSet::new());
    for ends in ENDS {
        for name in names {
            let Some(stem) = name.strip_suffix(ends[0]) else { continue };
            let find = |end: &&str| positions.get(format!("{stem}{end}").as_str()).copied();
            let Some(members) = ends.iter().map(find).collect::<Option<Vec<usize>>>() else { continue };
            let common = stem.trim_end_matches(SEPARATORS);
            let is_free = !common.is_empty() && !positions.contains_key(common) && !given.contains(common);
            if is_free && members.iter().all(|member| !taken.contains(member)) {
                taken.extend(members.iter().copied());
                given.insert(common);
                let least = members.iter().copied().min().unwrap_or(0);
                arrays.push((least, Components { name: common.to_owned(), members }));
            }
        }
    }
    let alone = names.iter().enumerate().filter(|(position, _)| !taken.contains(position));
    arrays.extend(alone.map(|(at, name)| (at, Components { name: name.clone(), members: vec![at] })));
    arrays.sort_by_key(|(least, _)| *least);
    arrays.into_iter().map(|(_, array)| array).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(names: &[&str]) -> Vec<String> {
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        joined(&names).iter().map(|array| format!("{}{:?}", array.name, array.members)).collect()
    }

    #[test]
    fn components_are_joined_wherever_they_stand() {
        assert_eq!(run(&["T", "disp_z", "disp_x", "p", "disp_y"]), ["T[0]", "disp[2, 4, 1]", "p[3]"]);
        assert_eq!(run(&["VELX", "VELY", "VELZ"]), ["VEL[0, 1, 2]"]);
        assert_eq!(run(&["dispX", "dispY", "dispz"]), ["dispX[0]", "dispY[1]", "dispz[2]"], "of two cases");
        assert_eq!(run(&["x", "y", "z", "_x", "_y", "_z"]).len(), 6, "without a name");
        assert_eq!(run(&["flux", "B_x", "B_y"]).len(), 3, "not all of them");
        assert_eq!(run(&["u", "u_x", "u_y", "u_z"]).len(), 4, "the name is taken");
        assert_eq!(run(&["a_x", "a_y", "a_z", "ax", "ay", "az"]), ["a[0, 1, 2]", "ax[3]", "ay[4]", "az[5]"]);
    }

    #[test]
    fn tensors_are_no_vectors() {
        let six = ["s_xx", "s_yy", "s_zz", "s_xy", "s_yz", "s_xz"];
        assert_eq!(run(&six), ["s[0, 1, 2, 3, 4, 5]"]);
        let nine = ["s_xx", "s_xy", "s_xz", "s_yx", "s_yy", "s_yz", "s_zx", "s_zy", "s_zz"];
        assert_eq!(run(&nine), ["s[0, 4, 8, 1, 5, 2]", "s_yx[3]", "s_zx[6]", "s_zy[7]"]);
        let other = ["SXX", "SYY", "SZZ", "SXY", "SYZ", "SZX"];
        assert_eq!(run(&other), ["S[0, 1, 2, 3, 4, 5]"]);
    }
}
