//! The colour maps that come with the program.

use super::color_map::ColorMap;
use super::paraview;
use std::sync::LazyLock;

/// Name and text of the maps that come with the program. `data/colormaps/README.md` has their sources and licences.
const BUILT_IN: [(&str, &str); 9] = [
    ("viridis", include_str!("../../data/colormaps/viridis.json")),
    ("inferno", include_str!("../../data/colormaps/inferno.json")),
    ("plasma", include_str!("../../data/colormaps/plasma.json")),
    ("cividis", include_str!("../../data/colormaps/cividis.json")),
    ("turbo", include_str!("../../data/colormaps/turbo.json")),
    ("cool-to-warm", include_str!("../../data/colormaps/cool-to-warm.json")),
    ("batlow", include_str!("../../data/colormaps/batlow.json")),
    ("vik", include_str!("../../data/colormaps/vik.json")),
    ("gray", include_str!("../../data/colormaps/gray.json")),
];

static BUILT_IN_MAPS: LazyLock<Vec<ColorMap>> = LazyLock::new(|| {
    let entries = BUILT_IN.iter().filter_map(|(name, text)| paraview::parse(name.as_ref(), text).ok());
    entries.flatten().map(|entry| entry.map).collect()
});

impl ColorMap {
    /// The built-in map called `name`.
    pub fn built_in(name: &str) -> Option<&'static ColorMap> {
        BUILT_IN_MAPS.iter().find(|map| map.name() == name)
    }

    /// Names of all built-in maps.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_maps_of_the_program_can_be_read() {
        let names: Vec<&str> = BUILT_IN_MAPS.iter().map(ColorMap::name).collect();
        assert_eq!(names, ColorMap::built_in_names().collect::<Vec<_>>());
        for map in BUILT_IN_MAPS.iter() {
            assert_eq!(map.points()[0].position, 0.0);
            assert_eq!(map.points().last().unwrap().position, 1.0);
        }
    }

    #[test]
    fn maps_have_the_published_colours() {
        // matplotlib 3.11 and cmcrameri 1.10: first, middle and last entries of their tables.
        let is_close = |map: &str, position: f64, rgb: [f64; 3]| {
            let ours = ColorMap::built_in(map).unwrap().eval(position);
            // Half a unit of the sixth digit, in which the tables are published.
            ours.iter().zip(rgb).all(|(a, b)| (a - b).abs() <= 5e-7)
        };
        let close = |map, position, rgb| assert!(is_close(map, position, rgb), "{map} {position}");
        close("viridis", 0.0, [0.267004, 0.004874, 0.329415]);
        close("viridis", 1.0, [0.993248, 0.906157, 0.143936]);
        close("inferno", 1.0, [0.988362, 0.998364, 0.644924]);
        close("cividis", 0.0, [0.000000, 0.135112, 0.304751]);
        close("turbo", 0.0, [0.18995, 0.07176, 0.23217]);
        close("vik", 0.0, [0.001328, 0.069836, 0.379529]);
        close("gray", 0.25, [0.25; 3]);
        assert!(!is_close("viridis", 0.001, [0.267004, 0.004874, 0.329415]), "a quarter of an entry off");
    }
}
