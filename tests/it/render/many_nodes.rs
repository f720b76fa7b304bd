//! Tables of many nodes: segments that cross many of them, where lanes take the pieces from node to node side by side.

use super::transparent_cells::{bits, counts};
use super::*;
use crate::meshes::{build, grid, noise, sample};
use proptest::prelude::*;
use tetreel::visibility::Skip;

/// A table of many nodes over the range of [`wave`]: extinctions of any magnitude, transparent and opaque plateaus, steps, and nodes a millionth
/// apart.
fn random_table(seed: u64, count: u64, strongest: f64) -> NodeTable {
    let random = |i: u64| 0.5 + 0.5 * noise(seed, i);
    let mut nodes: Vec<(f64, [f64; 3], f64)> = Vec::new();
    let mut scalar = -1.4;
    let mut plateau = 0;
    for i in 0..count {
        let rgb = [0, 1, 2].map(|c| random(1000 + 3 * i + c));
        let before = nodes.last().map_or(0.0, |node| node.2);
        // Plateaus of up to 40 nodes; else between 1e-9 of the strongest and all of it.
        let tau = if plateau > 0 { before } else { strongest * 1e-9f64.powf(random(5000 + i)) };
        let kind = (random(9000 + i) * 20.0) as i32;
        plateau = match kind {
            0 | 1 => (random(13_000 + i) * 40.0) as i32,
            _ => (plateau - 1).max(0),
        };
        let tau = if kind == 0 { 0.0 } else { tau };
        nodes.push((scalar, rgb, tau));
        if kind == 2 {
            nodes.push((scalar, rgb.map(|c| 1.0 - c), strongest - tau));
        }
        scalar += if kind == 3 { 1e-6 } else { 2.8 / count as f64 };
    }
    table(&nodes)
}

fn scene(seed: u64, count: u64, strongest: f64, quantum: f64) -> RenderJob {
    let mesh = Arc::new(build(grid(2 + (seed % 4) as usize, 0.16, seed, |c| c.length() > 0.2)));
    let scalars = sample(&mesh, |p| if quantum > 0.0 { (wave(p) / quantum).round() * quantum } else { wave(p) });
    let position = 4.0 * DVec3::from_array([1, 2, 3].map(|i| noise(seed, i))).normalize_or(DVec3::X);
    let projection = match seed % 2 {
        0 => Projection::Perspective { view_angle: 35.0 },
        _ => Projection::Parallel { scale: 1.27 },
    };
    job(&mesh, scalars, &camera(position, projection), (29, 23), random_table(seed, count, strongest))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn lanes_have_the_bits_and_the_pieces_of_one_ray_after_the_other(
        seed in 0u64..10_000, count in prop_oneof![2u64..40, 200u64..600], strength in -3..9,
        quantum in prop_oneof![Just(0.0), Just(0.25)], stops in any::<bool>(),
    ) {
        let skip = Skip { opaque: stops, ..Skip::ALL };
        let job = RenderJob { skip, ..scene(seed, count, 10f64.powi(strength), quantum) };
        let one = Raycast::portable().render(job.clone()).unwrap().clone();
        let lanes = Raycast::new().render(job.clone()).unwrap().clone();
        prop_assert!(bits(&lanes) == bits(&one), "seed {seed}, {count} nodes, 1e{strength}");
        prop_assert_eq!(counts(&lanes), counts(&one));
    }
}

#[test]
fn segments_of_many_pieces_agree_with_the_reference() {
    for (seed, strongest) in [(1, 1.0), (2, 3.0), (3, 40.0), (4, 1e4), (7, 1e9)] {
        let job = scene(seed, 500, strongest, 0.0);
        let frame = Raycast::new().render(job.clone()).unwrap().clone();
        let (pieces, steps) = (frame.stats.segments, frame.stats.steps);
        assert!(strongest > 40.0 || pieces > 4 * steps, "{pieces} pieces of {steps} segments");
        assert!(bits(&Raycast::portable().render(job.clone()).unwrap().clone()) == bits(&frame));
        let other = scene(seed, 501, strongest, 0.0);
        assert!(bits(&Raycast::portable().render(other).unwrap().clone()) != bits(&frame), "one node more is noticed");
        let judge = reference(&job);
        assert_within(&format!("{strongest:e}"), &frame.planes.color, &judge);
        // A wider view would be noticed.
        assert_noticed(&format!("{strongest:e}, stretched"), &raycast(&stretched(&job)), &judge);
    }
}
