//! Scenes whose image is known.

use super::*;
use crate::meshes::{build, grid, sample};

const PARALLEL: Projection = Projection::Parallel { scale: 0.9 };

/// All pixels of a view that sees only the inside of the box's face.
fn assert_alpha(name: &str, image: &RgbaImage, alpha: f64) {
    for p in &image.pixels {
        assert!((f64::from(p[3]) - alpha).abs() <= 1e-5, "{name}: {} instead of {alpha}", p[3]);
    }
}

#[test]
fn a_homogeneous_slab_lets_exp_of_minus_tau_d_through() {
    for jitter in [0.0, 0.16] {
        let mesh = Arc::new(build(grid(5, jitter, 1, |_| true)));
        for tau in [1e-6, 0.01, 0.5, 3.0, 40.0] {
            for direction in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X] {
                let scalars = vec![0.25; mesh.positions.local.len()];
                let table = table(&[(0.0, [1.0, 0.5, 0.0], tau), (1.0, [1.0, 0.5, 0.0], tau)]);
                let job = job(&mesh, scalars, &camera(5.0 * direction, PARALLEL), (33, 33), table);
                let alpha = 1.0 - (-2.0 * tau).exp();
                for (name, image) in [("raycast", raycast(&job)), ("reference", reference(&job))] {
                    assert_alpha(name, &image, alpha);
                    let p = image.pixels[100];
                    assert!((f64::from(p[1]) - 0.5 * alpha).abs() <= 1e-5, "premultiplied colour");
                }
            }
        }
    }
}

#[test]
fn a_linear_field_has_the_analytic_integral() {
    let mesh = Arc::new(build(grid(6, 0.16, 2, |_| true)));
    // s = x seen along +x from the front: tau goes from 0 to 4 over a length of 2; red from 0 to 1.
    let scalars = sample(&mesh, |p| p.x);
    let table = table(&[(-1.0, [0.0, 1.0, 0.0], 0.0), (1.0, [1.0, 1.0, 0.0], 4.0)]);
    let job = job(&mesh, scalars, &camera(-5.0 * DVec3::X, PARALLEL), (17, 17), table);
    // Optical depth u^2 with u = s + 1 in [0, 2]: alpha = 1 - e^-4; red = integral of u/2 2u e^(-u^2) du from 0 to 2
    // = [-u e^(-u^2) / 2] + integral of e^(-u^2) / 2 = -e^-4 + sqrt(pi)/4 erf(2), erf(2) = 0.995322265018953.
    let alpha = 1.0 - (-4.0f64).exp();
    let red = -(-4.0f64).exp() + std::f64::consts::PI.sqrt() / 4.0 * 0.995_322_265_018_953;
    for (name, image) in [("raycast", raycast(&job)), ("reference", reference(&job))] {
        assert_alpha(name, &image, alpha);
        for p in &image.pixels {
            assert!((f64::from(p[0]) - red).abs() <= 1e-5, "{name}: {} instead of {red}", p[0]);
        }
    }
}

#[test]
fn a_perspective_ray_is_as_long_as_its_slant() {
    let mesh = Arc::new(build(grid(4, 0.16, 3, |_| true)));
    let scalars = vec![1.0; mesh.positions.local.len()];
    let table = table(&[(0.0, [1.0; 3], 0.3)]);
    let camera = camera(DVec3::new(0.0, -4.0, 0.0), Projection::Perspective { view_angle: 20.0 });
    let job = job(&mesh, scalars, &camera, (21, 21), table);
    for (name, image) in [("raycast", raycast(&job)), ("reference", reference(&job))] {
        for (n, p) in image.pixels.iter().enumerate() {
            // Depth 3 to 5 along y; the view is narrow enough to leave through the far face.
            let (px, py) = job.view.ray(n % 21, n / 21);
            let alpha = 1.0 - (-0.3 * 2.0 * (1.0 + px * px + py * py).sqrt()).exp();
            assert!((f64::from(p[3]) - alpha).abs() <= 1e-5, "{name} pixel {n}: {} instead of {alpha}", p[3]);
        }
    }
}

#[test]
fn a_step_in_the_table_is_sharp() {
    let mesh = Arc::new(build(grid(6, 0.16, 4, |_| true)));
    let scalars = sample(&mesh, |p| p.x);
    // Opaque to 1/e from x = 0.5 on: the slab from 0.5 to 1 has optical depth 1.
    let table = table(&[(0.5, [1.0; 3], 0.0), (0.5, [1.0; 3], 2.0)]);
    for direction in [DVec3::X, -DVec3::X] {
        let job = job(&mesh, scalars.clone(), &camera(5.0 * direction, PARALLEL), (9, 9), table.clone());
        assert_alpha("raycast", &raycast(&job), 1.0 - (-1.0f64).exp());
        assert_alpha("reference", &reference(&job), 1.0 - (-1.0f64).exp());
    }
}

#[test]
fn a_spike_narrower_than_a_ten_thousandth_of_the_range_is_drawn() {
    let mesh = Arc::new(build(grid(6, 0.16, 4, |_| true)));
    let scalars = sample(&mesh, |p| p.x);
    // A tent of half width 1e-5 and height 1e5 around 0.123: area 1.
    let (s, h) = (0.123, 1e-5);
    let table = table(&[(s - h, [1.0; 3], 0.0), (s, [1.0; 3], 1.0 / h), (s + h, [1.0; 3], 0.0)]);
    let job = job(&mesh, scalars, &camera(5.0 * DVec3::X, PARALLEL), (9, 9), table);
    // Vertices are f32: the tent's position is off by 2^-24 / 1e-5 of its width at most, its area by less than 1e-3.
    for image in [raycast(&job), reference(&job)] {
        for p in &image.pixels {
            assert!((f64::from(p[3]) - (1.0 - (-1.0f64).exp())).abs() <= 1e-3, "{}", p[3]);
        }
    }
}
