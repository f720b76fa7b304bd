//! Transfer functions: opaque, narrow, stepped; and optical depths next to nothing.

use super::*;
use crate::meshes::{build, grid, noise, sample};
use glam::DVec3;

fn mesh() -> Arc<Mesh> {
    Arc::new(build(grid(6, 0.16, 19, |c| c.length() > 0.4)))
}

fn case(name: impl Into<String>, table: NodeTable) -> Case {
    let mesh = mesh();
    let scalars = sample(&mesh, wave);
    // The hole has flat sides: an even size, off the axes.
    Case { cameras: cameras::oblique(), size: (48, 48), ..Case::new(name, &mesh, scalars, table) }
}

/// Extinction of opacity `alpha` per unit distance, a hundredth of the box's diagonal.
fn tau(alpha_below_1: f64) -> f64 {
    -alpha_below_1.ln() / (0.01 * 12f64.sqrt())
}

#[test]
fn opacities_next_to_1_agree() {
    let (high, higher) = (tau(1e-7), tau(1e-300));
    run([
        case("alpha 1 - 1e-7", table(&[(-1.5, [0.2, 0.2, 1.0], high), (1.5, [1.0, 0.2, 0.1], high)])),
        case("transparent to 1 - 1e-7", table(&[(-1.5, [0.2, 0.2, 1.0], 0.0), (1.5, [1.0, 0.2, 0.1], high)])),
        case("transparent to 1 - 1e-300", table(&[(-1.5, [0.2, 0.2, 1.0], 0.0), (1.5, [1.0, 0.2, 0.1], higher)])),
        // As good as a surface, on and off.
        case(
            "opaque bands",
            table(&[
                (-0.7, [0.2, 0.2, 1.0], 0.0),
                (-0.7, [0.2, 0.2, 1.0], 1e6),
                (-0.6, [0.2, 0.2, 1.0], 1e6),
                (-0.6, [0.2, 0.2, 1.0], 0.1),
                (0.8, [1.0, 0.5, 0.1], 0.0),
                (0.8, [1.0, 0.5, 0.1], 1e6),
            ]),
        ),
    ]);
}

/// A tent of this half width and area 1 at `s`.
fn spike(s: f64, half_width: f64, rgb: [f64; 3]) -> [(f64, [f64; 3], f64); 3] {
    [(s - half_width, rgb, 0.0), (s, rgb, 1.0 / half_width), (s + half_width, rgb, 0.0)]
}

#[test]
fn spikes_of_a_4096th_and_of_a_millionth_of_the_range_agree() {
    // The range of the field is 2.8.
    run([1.0 / 4096.0, 1e-6].map(|share| {
        let nodes = [(-0.6, [0.1, 0.9, 0.2]), (-0.05, [0.9, 0.1, 0.1]), (0.44, [0.2, 0.3, 1.0])]
            .map(|(s, rgb)| spike(s, 0.5 * share * 2.8, rgb))
            .concat();
        case(format!("spikes of {share:.0e}"), table(&nodes))
    }));
}

/// Whole numbers at the vertices, most cells constant, and steps of the table exactly there.
fn labels() -> Case {
    let mesh = Arc::new(build(grid(6, 0.16, 19, |_| true)));
    let scalars = sample(&mesh, |p| (2.5 * p.x).floor());
    let nodes: Vec<_> = (-3..3)
        .flat_map(|i| {
            let rgb = |i: i32| [0.1 * f64::from(i + 4), 0.5, 0.9 - 0.1 * f64::from(i + 4)];
            let tau = |i: i32| if i % 2 == 0 { 0.7 } else { 0.0 };
            [(f64::from(i), rgb(i), tau(i)), (f64::from(i), rgb(i + 1), tau(i + 1))]
        })
        .collect();
    Case::new("labels on steps", &mesh, scalars, table(&nodes))
}

#[test]
fn steps_at_the_values_of_vertices_agree() {
    // Steps at the scalars of eight vertices of a smooth field: rays meet them in a vertex, or next to one.
    let mesh = mesh();
    let scalars = sample(&mesh, wave);
    let mut at: Vec<f64> = (0..8).map(|i| f64::from(scalars[37 * i + 5])).collect();
    at.sort_by(f64::total_cmp);
    let nodes = (0u64..).zip(&at).flat_map(|(i, &s)| {
        let rgb = |j: u64| [0, 1, 2].map(|c| 0.5 + 0.5 * noise(j, c));
        [(s, rgb(i), 0.3 * i as f64), (s, rgb(i + 1), 2.0 - 0.2 * i as f64)]
    });
    run([labels(), case("steps at vertices", table(&nodes.collect::<Vec<_>>()))]);
}

/// The world becomes thin and the extinction stays: the image is next to nothing, and is judged by its own size.
#[test]
fn optical_depths_next_to_zero_keep_their_digits() {
    for length in [1e-7, 1e-12, 1e-20] {
        let thin = Case { table: dense(), ..geometry::displaced(DVec3::ZERO, length) };
        let deepest = thin.jobs().into_iter().flat_map(|job| crate::render::reference(&job).pixels).map(|p| p[3]);
        let unit = f64::from(deepest.fold(0.0, f32::max));
        assert!(unit < 4.0 * length, "{unit:e}");
        run([Case { unit, name: format!("a box of {length:.0e}"), ..thin }]);
    }
}
