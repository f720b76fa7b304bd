//! Fields of functions on rays, in float64: all functions, no lists, no sheets.
//!
//! On a ray x(t) = o + t r a function's distance is d^2 = q (t - t0)^2 + least, with a = L^-1 (o - mu), b = L^-1 r, q = |b|^2,
//! t0 = - a b / q, least = |a x b|^2 / q. It ends where d = c. Between the ends of all functions the field is smooth: it is divided there until
//! it is linear within [`LINEAR`] of its range, beginning with pieces of half the narrowest width on the ray. By coverage it is divided, too,
//! until that changes by [`STEP`] at most in a piece. Each half of a piece has the mean of the parabola through the coverages at its ends and
//! middle; the change of extinction within it times that of coverage, over 12, is left out. Light, where the field is lit, changes by as much
//! at most, and each half has the mean of the parabola through it.
//!
//! **Smaller than a pixel.** Seen from the eye a function has a covariance on the image plane at its centre. Where the square root of an
//! eigenvalue is below [`LEAST_RADIUS`] pixels over c, the function is stretched along that eigenvector, across the ray of its centre, until it
//! is that: the function then reaches as far as half a pixel's diagonal.

use super::integrate::Sum;
use crate::camera::View;
use crate::functions::Placed;
use crate::render::RenderJob;
use crate::render::functions::{FunctionScene, Normalise, SlopeLight, depths_in_box};
use crate::render::medium::{Medium, RayLine, RayPoint, Segment};
use glam::{DMat3, DVec2, DVec3};

/// Largest deviation from linear, of the field's range.
const LINEAR: f64 = 1e-7;
/// Largest change of coverage in a piece.
const STEP: f64 = 2e-3;
/// Largest deviation of coverage from linear: what is left of a parabola is far less.
const BENT: f64 = 1e-5;
/// How far inside of an interval its ends are evaluated, of its length: moves a value by as much of its change there.
const LIMIT: f64 = 1e-9;
/// Halvings of a piece at most: what is not linear then is not smooth.
const HALVINGS: u32 = 40;

/// Least distance on the screen to which functions reach, in pixels.
const LEAST_RADIUS: f64 = 0.75;

/// A function as a view has it.
struct Seen {
    /// Centre, view coordinates: right, up, forward.
    center: DVec3,
    /// From a place behind the centre, in view coordinates, to one in widths.
    in_widths: DMat3,
    value: f64,
}

/// The functions of a job with finite values.
pub(super) struct Field {
    scene: FunctionScene,
    functions: Vec<Seen>,
    /// Largest deviation from linear.
    tolerance: f64,
    /// Largest piece to begin with, in the narrowest width on a ray.
    piece: f64,
    /// Largest change of coverage and of light in a piece, and deviation from linear.
    of_coverage: [f64; 2],
    /// Right, up and forward of the view.
    axes: DMat3,
}

/// The linear pieces of the field on a ray.
#[derive(Default)]
pub(super) struct Pieces {
    /// In place of the cell each has its number.
    pub(super) segments: Vec<Segment>,
    /// What the colours of each are multiplied by.
    pub(super) lights: Vec<f64>,
}

/// Pieces of a field with light in a medium.
pub(super) struct Lit<'a, M> {
    pub(super) inner: &'a M,
    pub(super) lights: &'a [f64],
}

impl<M: Medium<Ray = (), Light = Sum>> Medium for Lit<'_, M> {
    type Ray = ();
    type Light = Sum;
    const HAS_VALUES: bool = M::HAS_VALUES;

    fn pass(&self, (): &mut (), segment: &Segment, sum: &mut Sum) -> u32 {
        let before = std::mem::take(&mut sum.rgb);
        let count = self.inner.pass(&mut (), segment, sum);
        let lit = self.lights[segment.cell as usize];
        sum.rgb = [0, 1, 2].map(|c| before[c] + lit * sum.rgb[c]);
        count
    }
}

/// The field at a depth.
#[derive(Clone, Copy, Debug)]
struct Point {
    depth: f64,
    scalar: f64,
    /// Share of the optical depth.
    coverage: f64,
    /// What colours are multiplied by.
    light: f64,
}

/// A function on a ray.
#[derive(Clone, Copy, Debug)]
struct Span {
    value: f64,
    q: f64,
    at: f64,
    least: f64,
    ends: [f64; 2],
    /// A depth near `at`.
    rough: f64,
    /// The gradient of d^2 / 2 in view coordinates is the first and, by depth behind `rough`, the second.
    slope: [DVec3; 2],
}

/// The functions that reach an interval of a ray.
struct Reach {
    spans: Vec<Span>,
    /// Direction of the ray, world coordinates.
    along: DVec3,
}

impl Span {
    fn distance_squared(&self, depth: f64) -> f64 {
        let away = depth - self.at;
        self.q * away * away + self.least
    }

    /// The gradient of d^2 / 2 in view coordinates.
    fn slope(&self, depth: f64) -> DVec3 {
        self.slope[0] + (depth - self.rough) * self.slope[1]
    }
}

impl Field {
    /// The field of a job's functions, in its local view.
    pub(super) fn of(job: &RenderJob, scene: FunctionScene, view: &View) -> Self {
        let values = job.scalars.values().iter().enumerate().filter(|(_, value)| value.is_finite());
        let cut = scene.kernels.cut();
        let functions =
            values.filter_map(|(i, &value)| Some(seen(&scene.kernels.get(i)?, f64::from(value), cut, view))).collect();
        let tolerance = LINEAR * scene.range;
        let axes = DMat3::from_cols(view.right, view.up, view.forward);
        Self { scene, functions, tolerance, piece: 0.5, of_coverage: [STEP, BENT], axes }
    }

    /// Whether it is inside of cells.
    pub(super) fn is_in_cells(&self) -> bool {
        self.scene.domain.within().is_none()
    }

    /// Where the ray of an image-plane point is in the field's domain; `None` if that is inside of cells. `scale` is the world length of a
    /// local unit.
    pub(super) fn inside(&self, view: &View, scale: f64, (px, py): (f64, f64)) -> Option<Option<Segment>> {
        let within = self.scene.domain.within()?;
        let line = RayLine { px, py, length_per_depth: scale * view.length_per_depth(px, py) };
        let ends = depths_in_box(view, (px, py), within).map(|ends| ends.map(|depth| RayPoint { depth, scalar: 0.0 }));
        Some(ends.map(|[near, far]| Segment::of_scalars(0, near, far, line)))
    }

    /// The linear pieces of the field on the ray of an image-plane point, where it is inside some segments.
    pub(super) fn pieces(&self, view: &View, (px, py): (f64, f64), inside: &[Segment]) -> Pieces {
        let (origin, direction) =
            if view.perspective { (DVec3::ZERO, DVec3::new(px, py, 1.0)) } else { (DVec3::new(px, py, 0.0), DVec3::Z) };
        let spans: Vec<Span> = self.functions.iter().filter_map(|of| self.span(of, origin, direction)).collect();
        let mut out = Pieces::default();
        for segment in inside {
            let [from, to] = segment.part;
            let mut ends: Vec<f64> = spans.iter().flat_map(|span| span.ends).filter(|t| *t > from && *t < to).collect();
            ends.extend([from, to]);
            ends.sort_unstable_by(f64::total_cmp);
            for pair in ends.windows(2) {
                let middle = 0.5 * (pair[0] + pair[1]);
                let reach = spans.iter().filter(|span| span.ends[0] <= middle && middle <= span.ends[1]);
                let there = Reach { spans: reach.copied().collect(), along: self.axes * direction };
                self.divide(&there, [pair[0], pair[1]], segment, &mut out);
            }
        }
        out
    }

    fn span(&self, Seen { center, in_widths, value }: &Seen, origin: DVec3, direction: DVec3) -> Option<Span> {
        let b = *in_widths * direction;
        let q = b.length_squared();
        // About the nearest place, not about the eye: thousands of widths away squares would lose the digits of the distance.
        let rough = -(*in_widths * (origin - *center)).dot(b) / q;
        let a = *in_widths * (origin + rough * direction - *center);
        let (at, least) = (rough - a.dot(b) / q, a.cross(b).length_squared() / q);
        let cut = self.scene.kernels.cut();
        let half = ((cut * cut - least) / q).sqrt();
        // NaN for a function that the ray misses.
        (half > 0.0).then(|| {
            let slope = [a, b].map(|in_widths_of| in_widths.transpose() * in_widths_of);
            Span { value: *value, q, at, least, ends: [at - half, at + half], rough, slope }
        })
    }

    /// Divides an interval in which the same functions reach the ray.
    fn divide(&self, there: &Reach, [from, to]: [f64; 2], segment: &Segment, out: &mut Pieces) {
        let narrowest = 1.0 / there.spans.iter().fold(0.0f64, |most, span| most.max(span.q)).sqrt();
        let count = ((to - from) / (self.piece * narrowest)).ceil().max(1.0) as usize;
        let at = |i: usize| if i == count { to } else { from + (to - from) / count as f64 * i as f64 };
        // At the ends the last function may have no weight any more: the limits from inside are asked for.
        let limit = LIMIT * (to - from);
        let point = |depth: f64| Some(Point { depth, ..self.point(there, depth.max(from + limit).min(to - limit))? });
        for i in 0..count {
            if let (Some(near), Some(far)) = (point(at(i)), point(at(i + 1))) {
                self.refine(there, [near, far], HALVINGS, segment, out);
            }
        }
    }

    /// The field at a depth, by functions that reach the interval that it is in or at the end of; `None` without one.
    fn point(&self, there: &Reach, depth: f64) -> Option<Point> {
        let (mut sum, mut weights) = (0.0, 0.0);
        for span in &there.spans {
            let weight = self.scene.kernels.weight(span.distance_squared(depth));
            (sum, weights) = (sum + weight * span.value, weights + weight);
        }
        let coverage = self.scene.domain.coverage().map_or(1.0, |coverage| coverage.at(weights));
        (weights > 0.0).then(|| {
            let scalar = self.scene.normalise.value(sum, weights);
            let lit = |light: SlopeLight| light.share(self.gradient(there, depth, [scalar, weights]), there.along);
            Point { depth, scalar, coverage, light: self.scene.light.map_or(1.0, lit) }
        })
    }

    /// The gradient, world directions per local unit, at a depth where the field has this value for this sum of weights.
    fn gradient(&self, there: &Reach, depth: f64, [scalar, weights]: [f64; 2]) -> DVec3 {
        let (mut of_sum, mut of_weights) = (DVec3::ZERO, DVec3::ZERO);
        for span in &there.spans {
            let slope = -(-0.5 * span.distance_squared(depth)).exp() * span.slope(depth);
            (of_sum, of_weights) = (of_sum + span.value * slope, of_weights + slope);
        }
        let in_view = match self.scene.normalise {
            Normalise::Eq20 if weights < 1.0 => of_sum,
            _ => (of_sum - scalar * of_weights) / weights,
        };
        self.axes * in_view
    }

    /// Adds the interval between two points in linear pieces.
    fn refine(&self, there: &Reach, [near, far]: [Point; 2], left: u32, segment: &Segment, out: &mut Pieces) {
        let Some(middle) = self.point(there, 0.5 * (near.depth + far.depth)) else { return };
        let bent = |of: fn(&Point) -> f64| (of(&middle) - 0.5 * (of(&near) + of(&far))).abs();
        let [step, most_bent] = self.of_coverage;
        let is_linear = bent(|of| of.scalar) <= self.tolerance
            && bent(|of| of.coverage) <= most_bent
            && (far.coverage - near.coverage).abs() <= step
            && bent(|of| of.light) <= most_bent
            && (far.light - near.light).abs() <= step;
        if left == 0 || is_linear {
            // Means of the parabola over both halves.
            let means = |of: fn(&Point) -> f64| {
                let [a, b, c] = [&near, &middle, &far].map(of);
                [(5.0 * a + 8.0 * b - c) / 12.0, (8.0 * b + 5.0 * c - a) / 12.0]
            };
            let (coverages, lights) = (means(|of| of.coverage), means(|of| of.light));
            for (half, [near, far]) in [[near, middle], [middle, far]].into_iter().enumerate() {
                let [near, far] = [near, far].map(|Point { depth, scalar, .. }| RayPoint { depth, scalar });
                let length_per_depth = segment.line.length_per_depth * coverages[half].max(0.0);
                let line = RayLine { length_per_depth, ..segment.line };
                out.segments.push(Segment::of_scalars(out.lights.len() as u32, near, far, line));
                out.lights.push(lights[half]);
            }
        } else {
            self.refine(there, [near, middle], left - 1, segment, out);
            self.refine(there, [middle, far], left - 1, segment, out);
        }
    }
}

/// A function that ends at the distance `cut`, as a view has it.
fn seen(function: &Placed, value: f64, cut: f64, view: &View) -> Seen {
    let center = view.to_view(function.center);
    let in_widths =
        DMat3::from_cols(function.unscaled(view.right), function.unscaled(view.up), function.unscaled(view.forward));
    if view.perspective && center.z <= 0.0 {
        return Seen { center, in_widths, value };
    }
    // To the image plane: x and y less what the depth moves them by, over the depth.
    let (slope, depth) = if view.perspective { (center.truncate() / center.z, center.z) } else { (DVec2::ZERO, 1.0) };
    let [r0, r1, r2] = function.factor;
    let on_axis = |axis: DVec3| axis.x * r0 + axis.y * r1 + axis.z * r2;
    let [x, y, w] = [view.right, view.up, view.forward].map(on_axis);
    let (u, v) = ((x - slope.x * w) / depth, (y - slope.y * w) / depth);
    let [uu, uv, vv] = [u.dot(u), u.dot(v), v.dot(v)];
    // Eigenvalues of the covariance on the image plane, by trace and difference.
    let (middle, half) = (0.5 * (uu + vv), (0.25 * (uu - vv).powi(2) + uv * uv).sqrt());
    let pixel = 2.0 * view.half_height / view.height_px as f64;
    let least = LEAST_RADIUS * pixel / cut;
    let [large, small] = [middle + half, (middle - half).max(0.0)].map(|of| (of.sqrt() / least).min(1.0));
    // The symmetric matrix with these factors for the same eigenvectors.
    let (mean, spread) = (0.5 * (large + small), if half > 0.0 { 0.5 * (large - small) / half } else { 0.0 });
    let across = [mean + spread * 0.5 * (uu - vv), spread * uv, mean - spread * 0.5 * (uu - vv)];
    let [gxx, gxy, gyy] = across;
    let moved = DVec2::new(slope.x - gxx * slope.x - gxy * slope.y, slope.y - gxy * slope.x - gyy * slope.y);
    let narrower = DMat3::from_cols(DVec3::new(gxx, gxy, 0.0), DVec3::new(gxy, gyy, 0.0), moved.extend(1.0));
    Seen { center, in_widths: in_widths * narrower, value }
}

#[cfg(test)]
mod tests {
    use super::super::integrate::{Light, Transfer, integrate};
    use super::*;
    use crate::camera::Camera;
    use crate::functions::vertices::VertexFunctions;
    use crate::functions::{Kernels, value_at};
    use crate::mesh::Mesh;
    use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};
    use crate::node_table::{Node, NodeTable};
    use crate::render::functions::{FieldDomain, FunctionDomain, Normalise, SheetStyle};
    use crate::render::medium::RayLine;
    use crate::render::testing;
    use glam::Vec3;
    use std::sync::Arc;

    fn job() -> RenderJob {
        let mesh = Arc::new(Mesh::build(jittered(kuhn_grid([3; 3]), &mut Random::new(7))).unwrap().0);
        let camera = Camera::default_for(mesh.positions.world_bounds()).unwrap();
        let values = mesh.positions.local.iter().map(|p| (4.0 * p.x).sin() * (3.0 * p.y + p.z).cos()).collect();
        let node = |scalar, rgb, tau| Node { scalar, rgb, tau };
        let nodes = vec![node(-1.0, [0.1, 0.2, 0.9], 0.2), node(0.2, [1.0; 3], 4.0), node(1.0, [0.9, 0.3, 0.1], 0.0)];
        let kernels = Arc::new(VertexFunctions::default().of(&mesh).unwrap().kernels);
        let functions = Some(FunctionScene::new(kernels, SheetStyle::default(), 2.0));
        let table = Arc::new(NodeTable::new(nodes).unwrap());
        RenderJob { functions, ..testing::job(&mesh, values, &camera, (8, 8), table) }
    }

    fn field_of(job: &RenderJob) -> Field {
        Field::of(job, FunctionScene::of_job(job).unwrap(), &job.local_view())
    }

    /// A segment through the whole mesh, whatever the ray.
    fn inside(view: &View, (px, py): (f64, f64)) -> Segment {
        let middle = view.forward.dot(-view.eye);
        let ends = [-0.6, 0.6].map(|by| RayPoint { depth: middle + by, scalar: 0.0 });
        let line = RayLine { px, py, length_per_depth: view.length_per_depth(px, py) };
        Segment::of_scalars(0, ends[0], ends[1], line)
    }

    #[test]
    fn pieces_of_half_the_size_and_a_half_of_the_bound_move_no_pixel_by_a_millionth() {
        use FunctionDomain::{Box, Coverage, Mesh};
        for (domain, normalise, is_lit) in [
            (Mesh, Normalise::Sum, false),
            (Coverage, Normalise::Sum, false),
            (Box, Normalise::Eq20, false),
            (Mesh, Normalise::Sum, true),
        ] {
            let scene = job().functions.map(|of| FunctionScene {
                domain: FieldDomain::of(domain, &of.kernels),
                normalise,
                light: is_lit.then(|| SlopeLight::new(Some(DVec3::X), of.kernels.box_of_centers().unwrap(), of.range)),
                ..of
            });
            pieces_of_half_the_size(RenderJob { functions: scene, ..job() });
        }
    }

    fn pieces_of_half_the_size(job: RenderJob) {
        let view = job.local_view();
        let field = field_of(&job);
        let of = |field: &Field, by: f64| Field {
            tolerance: by * field.tolerance,
            of_coverage: field.of_coverage.map(|bound| by * bound),
            ..field_of(&job)
        };
        let finer = Field { piece: 0.5 * field.piece, ..of(&field, 0.5) };
        let coarser = Field { piece: 8.0, ..of(&field, 1e5) };
        let light = |field: &Field, at: (f64, f64)| -> Light {
            let through =
                field.inside(&view, 1.0, at).map_or(vec![inside(&view, at)], |inside| inside.into_iter().collect());
            let pieces = field.pieces(&view, at, &through);
            let lit = Lit { inner: &Transfer::of(&job), lights: &pieces.lights };
            integrate(&lit, pieces.segments.into_iter(), &[], job.mesh.positions.scale)
        };
        let apart = |a: Light, b: Light| a.rgba.iter().zip(b.rgba).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let (mut most, mut coarse, mut opaque) = (0.0f64, 0.0f64, 0.0f64);
        for pixel in (0..64).filter(|pixel| pixel % 3 == 0) {
            let at = view.ray(pixel % 8, pixel / 8);
            let found = light(&field, at);
            most = most.max(apart(found, light(&finer, at)));
            coarse = coarse.max(apart(found, light(&coarser, at)));
            opaque = opaque.max(found.rgba[3]);
        }
        assert!(most <= 1e-6 && opaque > 0.2, "{most} {opaque}");
        assert!(coarse > 1e-6, "the comparison can fail: {coarse}");
    }

    #[test]
    fn one_function_by_coverage_has_the_optical_depth_of_its_integral() {
        let kernels = Kernels::new(vec![Vec3::ZERO], vec![[0.2, 0.0, 0.2, 0.0, 0.0, 0.2]], 3.0).unwrap();
        let scene = |kernels: Kernels| FunctionScene {
            domain: FieldDomain::of(FunctionDomain::Coverage, &kernels),
            ..FunctionScene::new(Arc::new(kernels), SheetStyle::default(), 1.0)
        };
        let (job, scene) = (job(), scene(kernels.clone()));
        let coverage = scene.domain.coverage().unwrap();
        let table = NodeTable::new([0.0, 1.0].map(|scalar| Node { scalar, rgb: [1.0; 3], tau: 3.0 }).to_vec()).unwrap();
        let view = job.local_view();
        let field = Field {
            functions: vec![seen(&kernels.get(0).unwrap(), 0.5, 3.0, &view)],
            tolerance: LINEAR,
            piece: 0.5,
            of_coverage: [STEP, BENT],
            axes: field_of(&job).axes,
            scene,
        };
        for pixel in [27, 28, 36, 19, 20] {
            let at = view.ray(pixel % 8, pixel / 8);
            let through: Vec<Segment> = field.inside(&view, 1.0, at).unwrap().into_iter().collect();
            let pieces = field.pieces(&view, at, &through).segments;
            let found = integrate(&Transfer::Scalar(&table), pieces.into_iter(), &[], 1.0).rgba[3];
            let direction = view.forward + at.0 * view.right + at.1 * view.up;
            // Midpoints of a million parts of six widths.
            let (middle, part) = (-view.eye.dot(direction) / direction.length_squared(), 1.3e-6);
            let depth: f64 = (-500_000..500_000)
                .map(|i| view.eye + (middle + (f64::from(i) + 0.5) * part) * direction)
                .map(|place| coverage.at(kernels.weight(place.length_squared() / 0.04)))
                .sum();
            let expected = -(-3.0 * depth * part * direction.length()).exp_m1();
            // L is rounded to f32.
            assert!((found - expected).abs() < 1e-7, "{found} {expected}");
        }
    }

    #[test]
    fn pieces_have_the_values_of_the_sum_of_all_functions() {
        let job = job();
        let view = job.local_view();
        let field = field_of(&job);
        let (kernels, mut count) = (&job.functions.as_ref().unwrap().kernels, 0);
        for pixel in [9, 27, 36, 54] {
            let at = view.ray(pixel % 8, pixel / 8);
            let beside = at.0 * view.right + at.1 * view.up;
            for piece in field.pieces(&view, at, &[inside(&view, at)]).segments.iter().step_by(50) {
                for (depth, scalar) in piece.depth.into_iter().zip(piece.scalar) {
                    let place = view.eye + depth * (view.forward + beside);
                    let Some(expected) = value_at(kernels, job.scalars.values(), place) else { continue };
                    // At ends the value is a limit, of a billionth of an interval away; values change by some ten times their range there.
                    assert!((scalar - expected).abs() < 1e-7, "{scalar} {expected}");
                    count += 1;
                }
            }
        }
        assert!(count > 100, "{count}");
    }

    #[test]
    fn functions_on_rays_are_the_gaussian_in_space() {
        let mut random = Random::new(23);
        let job = job();
        let (view, field) = (job.local_view(), field_of(&job));
        let mut most = 0.0f64;
        for _ in 0..1_000_000 {
            let factor = crate::functions::random_factor(&mut random).map(|width| 3.0 * width);
            let center = 0.3 * Vec3::new(random.signed() as f32, random.signed() as f32, random.signed() as f32);
            let function = Kernels::new(vec![center], vec![factor], 3.0).unwrap().get(0).unwrap();
            let axes = [view.right, view.up, view.forward];
            let in_widths = DMat3::from_cols_array_2d(&axes.map(|axis| function.unscaled(axis).to_array()));
            let seen = Seen { center: view.to_view(function.center), in_widths, value: 1.0 };
            let within = 1.7 * DVec3::new(random.signed(), random.signed(), random.signed());
            let [a, b, c] = function.factor;
            let place = function.center + DVec3::new(a.dot(within), b.dot(within), c.dot(within));
            let at = view.to_view(place);
            if at.z < 0.5 {
                // Image-plane points of places beside the eye are anywhere.
                continue;
            }
            let span = field.span(&seen, DVec3::ZERO, DVec3::new(at.x / at.z, at.y / at.z, 1.0)).unwrap();
            let height = |d: f64| (-0.5 * d).exp();
            most = most.max((height(span.distance_squared(at.z)) - height(within.length_squared())).abs());
            // The gradient of d^2 / 2 along the way from the centre is d^2.
            let along = span.slope(at.z).dot(at - seen.center);
            most = most.max((height(along) - height(within.length_squared())).abs());
        }
        println!("{most:.1e}");
        // Places are rounded by 2^-52 of their distance from the eye, by a thousand times as many widths of a needle.
        assert!(most < 1e-12, "{most}");
    }
}
