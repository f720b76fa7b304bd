//! Scalars: not finite, denormal, constant, of all magnitudes at once, with a mean of zero, far from zero.

use super::*;
use crate::meshes::{build, grid, noise, sample};
use glam::DVec3;

fn mesh() -> Arc<Mesh> {
    Arc::new(build(grid(5, 0.16, 23, |_| true)))
}

/// Blue, green, orange over three scalars.
fn three(lo: f64, middle: f64, hi: f64) -> NodeTable {
    table(&[(lo, [0.1, 0.2, 0.9], 0.1), (middle, [0.2, 0.9, 0.3], 1.0), (hi, [1.0, 0.4, 0.1], 0.3)])
}

fn case(name: &str, mesh: &Arc<Mesh>, scalars: Vec<f32>, table: NodeTable) -> Case {
    Case::new(name, mesh, scalars, table)
}

#[test]
fn scalars_that_are_not_finite_are_holes() {
    let mesh = mesh();
    let [mut a_few, mut many] = [sample(&mesh, wave), sample(&mesh, wave)];
    for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -f32::NAN].into_iter().enumerate() {
        a_few[40 * i + 10] = bad;
        for (v, s) in many.iter_mut().enumerate() {
            *s = if noise(i as u64, v as u64) > 0.9 { bad } else { *s };
        }
    }
    let cases = [("a few not finite", a_few), ("many not finite", many)].map(|(name, scalars)| {
        let case = Case { cameras: cameras::oblique(), size: (48, 48), ..case(name, &mesh, scalars, dense()) };
        let active = &case.jobs()[0].active;
        assert!(active.count() < active.universe() && active.count() > 0, "{name}");
        case
    });
    run(cases);
    // Nothing is left: nothing is drawn, by anyone.
    let nothing = Case::new("NaN", &mesh, vec![f32::NAN; mesh.positions.local.len()], dense());
    for path in paths() {
        if let Some(frame) = (path.render)(&nothing.jobs()[0]) {
            assert!(frame.planes.color.pixels.iter().flatten().all(|&v| v == 0.0), "{}", path.name);
        }
    }
}

#[test]
fn ranges_at_the_ends_of_f32_agree() {
    let mesh = mesh();
    let ranges = [("denormal", 1e-42, 3e-41), ("smallest normal", 1.2e-38, 4e-38), ("huge", -3e38, 3e38)];
    run(ranges.map(|(name, lo, hi)| {
        let scalars = sample(&mesh, |p| lo + (hi - lo) * (0.5 + 0.3 * wave(p)));
        case(name, &mesh, scalars, three(lo, 0.5 * lo + 0.5 * hi, hi))
    }));
}

#[test]
fn all_magnitudes_in_one_field_agree() {
    let mesh = mesh();
    // Neighbours are powers of ten apart; whole parts of the mesh are below what the others are rounded to.
    let magnitudes = sample(&mesh, |p| 10f64.powf(38.0 * (0.9 * p.z + 0.07 * wave(p))));
    let signed: Vec<f32> = (0..).zip(&magnitudes).map(|(v, &s)| if noise(3, v) > 0.0 { -s } else { s }).collect();
    let (least, most) = magnitudes.iter().fold((f32::MAX, 0f32), |(lo, hi), &s| (lo.min(s), hi.max(s)));
    assert!(least < 1e-35 && most > 1e35, "{least:e} to {most:e}");
    let over = |name: &str, scalars: &Vec<f32>, nodes: NodeTable| case(name, &mesh, scalars.clone(), nodes);
    run([
        over("1e-38..1e38", &magnitudes, three(1e-38, 1.0, 1e38)),
        over("1e-38..1e38, seen from 1 to 1e3", &magnitudes, three(1.0, 30.0, 1e3)),
        over("1e-38..1e38, seen at the small end", &magnitudes, three(1e-38, 1e-30, 1e-25)),
        // Next to a node at zero, segments are 1e-38 times as long in scalars as the table is wide.
        over("+-1e-38..1e38", &signed, three(-1e38, 0.0, 1e38)),
    ]);
}

#[test]
fn constant_fields_agree() {
    let mesh = mesh();
    let constant = |value: f32| vec![value; mesh.positions.local.len()];
    run([
        case("constant", &mesh, constant(0.25), dense()),
        // On a node that is a step: the right side holds.
        case("constant on a step", &mesh, constant(0.5), table(&[(0.5, [0.1; 3], 0.1), (0.5, [0.9; 3], 1.5)])),
        case("constant beyond the table", &mesh, constant(7e37), dense()),
        case("constant denormal", &mesh, constant(1e-44), three(0.0, 1e-44, 1e-43)),
    ]);
}

#[test]
fn fields_with_a_mean_of_zero_and_far_from_zero_agree() {
    let mesh = mesh();
    let odd = sample(&mesh, |p| p.x + 0.5 * p.y.powi(3));
    let far = |offset: f64, reach: f64| sample(&mesh, move |p| offset + reach * wave(p));
    run([
        case("zero mean", &mesh, odd, three(-1.5, 0.0, 1.5)),
        // A sixteenth is what f32 can tell apart at a million.
        case("1e6 + 1.4", &mesh, far(1e6, 1.0), three(1e6 - 1.4, 1e6, 1e6 + 1.4)),
        case("1e7 + 45", &mesh, far(1e7, 32.0), three(1e7 - 45.0, 1e7, 1e7 + 45.0)),
        case("-1e6 + 1e-1", &mesh, far(-1e6, 0.1), three(-1e6 - 0.2, -1e6, -1e6 + 0.2)),
    ]);
}

#[test]
fn a_single_spike_in_the_field_agrees() {
    let mesh = mesh();
    let mut scalars = vec![0.0; mesh.positions.local.len()];
    let middle = (0..scalars.len()).min_by(|&a, &b| {
        let distance = |v| mesh.positions.world(v).distance_squared(DVec3::new(0.1, 0.2, 0.0));
        distance(a).total_cmp(&distance(b))
    });
    scalars[middle.unwrap()] = 1e30;
    let nodes = [(0.0, [1.0; 3], 0.0), (1e27, [0.9, 0.1, 0.1], 3.0), (1e30, [0.1, 0.1, 0.9], 0.5)];
    run([case("one vertex of 1e30", &mesh, scalars, table(&nodes))]);
}
