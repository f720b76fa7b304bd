//! Scenes whose image is known: every path and the reference, in perspective and in parallel.
//!
//! A ray through a slab of depth D, of length L per unit of depth, sees extinction t(u) and colour c(u) at depth u behind the
//! front. With t = t0 + t1 u and c = c0 + c1 u the optical depth is O(u) = L (t0 u + t1 u^2 / 2), and
//!
//! ```text
//! alpha = 1 - exp(-O(D))
//! C     = integral from 0 to D of c L t exp(-O) du = [-c exp(-O)] + c1 integral of exp(-O) du     (by parts)
//!       = c0 - (c0 + c1 D) exp(-O(D)) + c1 exp(a b^2) sqrt(pi / a) / 2 (erf(sqrt(a) (D + b)) - erf(sqrt(a) b)),
//! a     = L t1 / 2,    b = t0 / t1                                                       (the square completed)
//! ```
//!
//! For O -> 0 the integral is that of the quadratic c t: a cubic in D.

use super::*;
use crate::meshes::{build, grid, sample};
use crate::render::{difference, raycast, reference};
use glam::DVec3;
use std::f64::consts::PI;
use tetreel::camera::View;

/// What a channel may be off by: a ray ends when less than 2^-17 = 7.6e-6 shines through. Measured on the CPU: that, in slabs of an
/// optical depth of 80, else 3.2e-7.
const TOLERANCE: f64 = 1e-5;
const SIZE: (usize, usize) = (21, 21);
/// The slab of [-1, 1]^3 along the view.
const THICKNESS: f64 = 2.0;

/// Views from `direction` of the box that see only the inside of its near and far side.
fn views(direction: DVec3) -> [Camera; 2] {
    [Projection::Perspective { view_angle: 20.0 }, Projection::Parallel { scale: 0.9 }]
        .map(|projection| camera(4.0 * direction, projection))
}

fn images(job: &RenderJob) -> Vec<(&'static str, RgbaImage)> {
    let drawn = paths().into_iter().filter_map(|path| Some((path.name, (path.render)(job)?.planes.color)));
    std::iter::once(("reference", reference(job))).chain(drawn).collect()
}

/// What is right for a ray: premultiplied colour and opacity.
type Expected = dyn Fn(&View, (f64, f64)) -> [f64; 4];

/// The largest error of an image.
fn error(image: &RgbaImage, view: &View, expected: &Expected) -> f64 {
    let mut worst = 0f64;
    for (n, rgba) in image.pixels.iter().enumerate() {
        let right = expected(view, view.ray(n % view.width_px, n / view.width_px));
        for (ours, right) in rgba.iter().zip(right) {
            assert!(ours.is_finite());
            worst = worst.max((f64::from(*ours) - right).abs());
        }
    }
    worst
}

/// Each path's image is what is expected, relative to `unit`, and would not be if one scalar in a hundred were another.
fn assert_known(name: &str, job: &RenderJob, unit: f64, expected: &Expected) {
    for (path, image) in images(job) {
        let worst = error(&image, &job.view, expected) / unit;
        eprintln!("{name} | {path} | {worst:.1e}");
        assert!(worst <= TOLERANCE, "{name}, {path}: off by {worst:.2e}");
    }
    let mut other = job.clone();
    other.view.half_width *= 1.01;
    let stretched = error(&raycast(&other), &job.view, expected) / unit;
    let mut scalars = job.scalars.values().to_vec();
    scalars.iter_mut().step_by(10).for_each(|s| *s += 0.1);
    let mut nodes = job.table.nodes().to_vec();
    nodes.iter_mut().for_each(|n| n.tau *= 1.001);
    let denser = RenderJob { table: Arc::new(NodeTable::new(nodes).unwrap()), ..job.clone() };
    let changed =
        error(&raycast(&RenderJob { scalars: Arc::new(scalars).into(), ..job.clone() }), &job.view, expected) / unit;
    let denser = error(&raycast(&denser), &job.view, expected) / unit;
    let most = stretched.max(changed).max(denser);
    assert!(most > TOLERANCE, "{name}: {stretched:.1e}, {changed:.1e}, {denser:.1e}");
}

/// A job for each view of a jittered box with this field.
fn jobs(seed: u64, direction: DVec3, table: &NodeTable, field: impl Fn(DVec3) -> f64) -> Vec<RenderJob> {
    let mesh = Arc::new(build(grid(6, 0.16, seed, |_| true)));
    let scalars = sample(&mesh, field);
    views(direction).iter().map(|camera| job(&mesh, scalars.clone(), camera, SIZE, table.clone())).collect()
}

/// erf by its series, which alternates: below 5 the largest term is exp(25) / 25, of which f64 leaves 1e-6 at worst; used
/// below 3, where it leaves 1e-13.
fn erf(x: f64) -> f64 {
    assert!(x.abs() <= 3.0);
    let (mut term, mut sum) = (x, x);
    for n in 1..200 {
        term *= -x * x / f64::from(n);
        sum += term / f64::from(2 * n + 1);
    }
    sum * 2.0 / PI.sqrt()
}

#[test]
fn the_series_of_erf_is_that_of_the_tables() {
    for (x, expected) in
        [(0.5, 0.520_499_877_813_046_5), (1.0, 0.842_700_792_949_714_9), (2.0, 0.995_322_265_018_952_7)]
    {
        // Terms up to 2.2 alternate: a few roundings of those. Measured: 5.6e-16.
        assert!((erf(x) - expected).abs() < 5e-15);
        assert_eq!(erf(-x), -erf(x));
    }
}

#[test]
fn a_homogeneous_slab_lets_exp_of_minus_tau_d_through() {
    for jitter in [0.0, 0.16] {
        let mesh = Arc::new(build(grid(5, jitter, 1, |_| true)));
        for tau in [1e-6, 0.01, 0.5, 3.0, 40.0] {
            for direction in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X] {
                for camera in views(direction) {
                    let scalars = vec![0.25; mesh.positions.local.len()];
                    let nodes = table(&[(0.0, [1.0, 0.5, 0.0], tau), (1.0, [1.0, 0.5, 0.0], tau)]);
                    let job = job(&mesh, scalars, &camera, SIZE, nodes);
                    // That of the clearest is judged by its own size.
                    let unit = f64::min(1.0, THICKNESS * tau);
                    let name = format!("slab, jitter {jitter}, tau {tau}, {direction}");
                    assert_known_of_slab(&name, &job, unit, tau);
                }
            }
        }
    }
}

fn assert_known_of_slab(name: &str, job: &RenderJob, unit: f64, tau: f64) {
    let expected = move |view: &View, (px, py): (f64, f64)| {
        let alpha = -(-tau * THICKNESS * view.length_per_depth(px, py)).exp_m1();
        [alpha, 0.5 * alpha, 0.0, alpha]
    };
    for (path, image) in images(job) {
        let worst = error(&image, &job.view, &expected) / unit;
        assert!(worst <= TOLERANCE, "{name}, {path}: off by {worst:.2e}");
    }
    let mut longer = job.clone();
    longer.table = Arc::new(table(&[(0.0, [0.999, 0.5, 0.0], tau)]));
    assert!(error(&raycast(&longer), &job.view, &expected) / unit > TOLERANCE, "{name}: another red");
}

/// Extinction and colour (three channels) as linear functions of the depth: at the front, and per unit of depth.
#[derive(Clone, Copy)]
struct Linear {
    tau: [f64; 2],
    rgb: [[f64; 2]; 3],
}

impl Linear {
    /// The table of the field s = x seen along +x: u = s + 1.
    fn table(&self) -> NodeTable {
        let at = |[value, slope]: [f64; 2], u: f64| value + slope * u;
        let node = |u: f64| (u - 1.0, self.rgb.map(|c| at(c, u)), at(self.tau, u));
        table(&[node(0.0), node(THICKNESS)])
    }

    fn expected(self, view: &View, (px, py): (f64, f64)) -> [f64; 4] {
        let length = view.length_per_depth(px, py);
        let [t0, t1] = self.tau;
        let depth = length * (t0 + 0.5 * t1 * THICKNESS) * THICKNESS;
        let (a, b) = (0.5 * length * t1, t0 / t1);
        let between = erf(a.sqrt() * (THICKNESS + b)) - erf(a.sqrt() * b);
        let rest = (a * b * b).exp() * (PI / a).sqrt() / 2.0 * between;
        let color = |[c0, c1]: [f64; 2]| c0 - (c0 + c1 * THICKNESS) * (-depth).exp() + c1 * rest;
        let [r, g, b] = self.rgb.map(color);
        [r, g, b, -(-depth).exp_m1()]
    }
}

#[test]
fn a_linear_ramp_has_the_analytic_integral() {
    // Extinction from 0 to 4, red from 0 to 1, green constant, blue falling.
    let ramp = Linear { tau: [0.0, 2.0], rgb: [[0.0, 0.5], [1.0, 0.0], [0.8, -0.3]] };
    for job in jobs(2, DVec3::NEG_X, &ramp.table(), |p| p.x) {
        assert_known("linear ramp", &job, 1.0, &move |view, ray| ramp.expected(view, ray));
    }
}

#[test]
fn a_product_of_linear_colour_and_linear_extinction_has_the_analytic_integral() {
    for (name, tau) in [("rising", [0.5, 0.75]), ("steep", [0.1, 3.0]), ("shallow", [0.3, 0.2])] {
        let quadratic = Linear { tau, rgb: [[0.1, 0.45], [0.9, -0.4], [0.5, 0.1]] };
        for job in jobs(5, DVec3::NEG_X, &quadratic.table(), |p| p.x) {
            assert_known(&format!("quadratic, {name}"), &job, 1.0, &move |view, ray| quadratic.expected(view, ray));
        }
    }
}

#[test]
fn next_to_clear_the_integral_of_a_quadratic_is_its_cubic() {
    // Optical depths of 1e-7: exp(-O) is 1 to what is asked for.
    let scale = 1e-7;
    let thin = Linear { tau: [0.2 * scale, 0.4 * scale], rgb: [[0.1, 0.45], [0.9, -0.4], [0.0, 0.5]] };
    let expected = move |view: &View, (px, py): (f64, f64)| {
        let length = view.length_per_depth(px, py);
        let ([t0, t1], d) = (thin.tau, THICKNESS);
        let cubic =
            |[c0, c1]: [f64; 2]| length * (c0 * t0 * d + (c0 * t1 + c1 * t0) * d * d / 2.0 + c1 * t1 * d * d * d / 3.0);
        let [r, g, b] = thin.rgb.map(cubic);
        [r, g, b, cubic([1.0, 0.0])]
    };
    for job in jobs(6, DVec3::NEG_X, &thin.table(), |p| p.x) {
        // Judged by its own size: the opacity is 1.2e-7.
        assert_known("cubic", &job, scale, &expected);
    }
}

#[test]
fn two_layers_composite_front_to_back() {
    // A step of the table in a linear field: the layers meet at x = 0, wherever cells do. Seen from both sides.
    let (front, back) = (([0.9, 0.2, 0.1], 0.6), ([0.1, 0.4, 1.0], 1.5));
    let nodes = table(&[(0.0, front.0, front.1), (0.0, back.0, back.1)]);
    for (name, direction, layers) in
        [("two layers", DVec3::NEG_X, [front, back]), ("two layers from behind", DVec3::X, [back, front])]
    {
        let expected = move |view: &View, (px, py): (f64, f64)| {
            let length = 0.5 * THICKNESS * view.length_per_depth(px, py);
            let [through, behind] = layers.map(|(_, tau)| (-tau * length).exp());
            let color = |c: usize| (1.0 - through) * layers[0].0[c] + through * (1.0 - behind) * layers[1].0[c];
            [color(0), color(1), color(2), 1.0 - through * behind]
        };
        for job in jobs(4, direction, &nodes, |p| p.x) {
            assert_known(name, &job, 1.0, &expected);
        }
    }
}

#[test]
fn a_step_in_the_table_is_sharp() {
    // Transparent to x = 0.5: the slab from there to 1 has an optical depth of 1.
    let nodes = table(&[(0.5, [1.0; 3], 0.0), (0.5, [1.0; 3], 2.0)]);
    let expected = |view: &View, (px, py): (f64, f64)| [-(-view.length_per_depth(px, py)).exp_m1(); 4];
    for direction in [DVec3::X, DVec3::NEG_X] {
        for job in jobs(4, direction, &nodes, |p| p.x) {
            assert_known("step", &job, 1.0, &expected);
        }
    }
}

#[test]
fn a_spike_narrower_than_a_ten_thousandth_of_the_range_is_drawn() {
    // A tent of half width 1e-5 and height 1e5 around 0.123: area 1.
    let (s, h) = (0.123, 1e-5);
    let nodes = table(&[(s - h, [1.0; 3], 0.0), (s, [1.0; 3], 1.0 / h), (s + h, [1.0; 3], 0.0)]);
    let expected = |view: &View, (px, py): (f64, f64)| [-(-view.length_per_depth(px, py)).exp_m1(); 4];
    for job in jobs(4, DVec3::X, &nodes, |p| p.x) {
        for (path, image) in images(&job) {
            let worst = error(&image, &job.view, &expected);
            eprintln!("spike | {path} | {worst:.1e}");
            // Scalars are f32, so that s = x holds to 2^-24 at the vertices and the tent is met at a slope of 1 + 2^-24 / (h of a
            // cell, 0.2); vertices beside it would have it at another place, not of another area. On the GPU scalars of hits
            // are f32, too: a piece of the tent may be off by 2^-24 / 1e-5 of its area where it is cut by a face. Measured on the
            // CPU: 8.6e-8.
            let bound = if path.ends_with("GPU") { 1e-3 } else { 5e-7 };
            assert!(worst <= bound, "{path}: {worst:.1e}");
        }
        let mut wider = job.table.nodes().to_vec();
        wider[2].scalar += 0.1 * h;
        let wider = RenderJob { table: Arc::new(NodeTable::new(wider).unwrap()), ..job.clone() };
        assert!(error(&raycast(&wider), &job.view, &expected) > 1e-3, "a spike that is a twentieth wider");
        assert!(difference(&raycast(&wider), &reference(&job)).1 > 1e-3);
    }
}
