use super::*;
use crate::camera::{Camera, Projection};
use crate::mesh::test_meshes::cloud;
use crate::node_table::{Node, NodeTable};
use crate::render::Renderer;
use crate::render::points::PointStyle;
use crate::render::testing::{self, with_selection};
use crate::visibility::{CellSet, Selection};
use glam::DVec3;

#[test]
fn balls_around_one_place_come_in_one_order_on_all_rays() {
    let place = DVec3::new(0.3, -0.2, 0.1);
    let mesh = cloud(&[(place, 1.0), (place, 0.7), (place, 0.4)], &[]);
    let node = |scalar: f64| Node { scalar, rgb: [scalar, 0.5, 1.0 - scalar], tau: 1.0 };
    let table = Arc::new(NodeTable::new([0.0, 1.0].map(node).to_vec()).unwrap());
    let perspective = Projection::Perspective { view_angle: 60.0 };
    for projection in [perspective, Projection::Parallel { scale: 1.1 }] {
        let position = DVec3::new(1.9, 2.3, -1.1);
        let camera = Camera { position, focal_point: 0.9 * place, view_up: DVec3::Z, projection, near: 0.0 };
        let job = testing::job(&mesh, vec![0.1, 0.9, 0.5], &camera, (64, 64), table.clone());
        let of = |balls: &[u32]| {
            let ids = CellSet::of(3, |ball| balls.contains(&(ball as u32)));
            let selection = Arc::new(Selection { ids, is_complete: balls.len() == 3 });
            let job = with_selection(&job, PointStyle::BALLS, selection);
            Points::new().render(job).unwrap().planes.color.pixels.clone()
        };
        let (all, each) = (of(&[0, 1, 2]), [2, 1, 0].map(|ball| of(&[ball])));
        let behind = |front: [f32; 4], back: [f32; 4]| [0, 1, 2, 3].map(|i| front[i] + (1.0 - front[3]) * back[i]);
        // The thinnest first. Three sums of f32, each rounded to 2^-24 of at most 1, on either side.
        let is_near = |a: [f32; 4], b: [f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 6.0 / (1 << 24) as f32);
        let mut overlapping = 0;
        for pixel in 0..all.len() {
            let [small, middle, large] = each.each_ref().map(|image| image[pixel]);
            assert!(is_near(all[pixel], behind(behind(small, middle), large)), "{projection:?}, {pixel}");
            overlapping += usize::from(!is_near(all[pixel], behind(behind(large, middle), small)));
        }
        assert!(overlapping > 300, "{overlapping}: the order shows");
    }
}
