//! Integration of a chain of segments by the definition.

use super::joint;
use crate::node_table::{Node, NodeTable};
use crate::optics::quadrature::pieces;
use crate::render::medium::{Medium, Segment};
use crate::render::{JointScene, LayerFragment, RenderJob};
use glam::DVec3;

/// Ten-point Gauss-Legendre on [-1, 1], positive half.
const GAUSS: [(f64, f64); 5] = [
    (0.148_874_338_981_631_2, 0.295_524_224_714_752_87),
    (0.433_395_394_129_247_2, 0.269_266_719_309_996_35),
    (0.679_409_568_299_024_4, 0.219_086_362_515_982_04),
    (0.865_063_366_688_984_5, 0.149_451_349_150_580_6),
    (0.973_906_528_517_171_7, 0.066_671_344_308_688_14),
];

/// Optical depth of a sub-piece: the ten-point rule is then exact to rounding.
const SUB_PIECE_DEPTH: f64 = 0.5;

/// Light from behind this optical depth is below f64's rounding of the image.
pub(in crate::render) const END_DEPTH: f64 = 40.0;

/// The transfer function of a job, by its table.
#[derive(Clone, Copy)]
pub(in crate::render) enum Transfer<'a> {
    Scalar(&'a NodeTable),
    Joint(&'a JointScene),
}

impl<'a> Transfer<'a> {
    pub(in crate::render) fn of(job: &'a RenderJob) -> Self {
        job.joint.as_ref().map_or(Self::Scalar(&job.table), Self::Joint)
    }

    /// Cuts the segment into linear pieces: colour and extinction at both ends of each, as limits from inside, and its share of the
    /// length.
    pub(in crate::render) fn pieces(self, segment: &Segment) -> Vec<(Node, Node, f64)> {
        match self {
            Self::Scalar(table) => {
                let [near, far] = segment.part_scalar;
                pieces(table, near, far)
            }
            Self::Joint(scene) => joint::pieces(scene, segment),
        }
    }
}

impl Medium for Transfer<'_> {
    type Ray = ();
    type Light = Sum;
    const HAS_VALUES: bool = true;

    fn pass(&self, (): &mut (), segment: &Segment, sum: &mut Sum) -> u32 {
        let [near, far] = segment.part;
        let (mut passed, mut count) = (0.0, 0);
        for (from, to, share) in self.pieces(segment) {
            if from.tau.max(to.tau) > 0.0 {
                sum.visible_from = sum.visible_from.min(near + passed * (far - near));
            }
            passed += share;
            add_piece(&mut sum.rgb, &mut sum.depth_so_far, &from, &to, share * segment.length());
            count += 1;
            if sum.depth_so_far > END_DEPTH {
                break;
            }
        }
        count
    }
}

/// Accumulated light of a ray.
pub(in crate::render) struct Sum {
    pub(super) rgb: [f64; 3],
    pub(super) depth_so_far: f64,
    /// Depth at which the first piece with extinction begins; infinite if there was none.
    pub(super) visible_from: f64,
    /// The number of the surface whose normal is in `rgb`, if guides are rendered.
    guide: Option<u32>,
}

/// Result of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// Premultiplied colour and opacity.
    pub(super) rgba: [f64; 4],
    /// Depth at which the first piece with extinction begins; infinite if there is none.
    pub(super) visible_from: f64,
}

/// Colour, opacity and first visible depth of a ray through a chain of segments and the fragments of other layers, nearest first; `scale`
/// is the world length of a local unit.
pub(super) fn integrate<M: Medium<Light = Sum>>(
    medium: &M,
    chain: impl Iterator<Item = Segment>,
    fragments: &[LayerFragment],
    scale: f64,
) -> Light {
    let (mut sum, mut ray) = (Sum::new(), M::Ray::default());
    let mut fragments = fragments.iter().map(|fragment| (fragment.depth / scale, fragment.rgba)).peekable();
    for segment in chain {
        let mut rest = segment;
        while let Some((depth, rgba)) = fragments.next_if(|(depth, _)| *depth < segment.part[1]) {
            let (near, behind) = rest.split(depth);
            near.iter().for_each(|near| _ = medium.pass(&mut ray, near, &mut sum));
            sum.add_fragment(depth, rgba);
            rest = behind;
        }
        medium.pass(&mut ray, &rest, &mut sum);
        if sum.depth_so_far > END_DEPTH {
            return sum.light();
        }
    }
    fragments.for_each(|(depth, rgba)| sum.add_fragment(depth, rgba));
    sum.light()
}

impl Sum {
    fn new() -> Self {
        Self { rgb: [0.0; 3], depth_so_far: 0.0, visible_from: f64::INFINITY, guide: None }
    }

    /// Adds a fragment of opacity a, whose optical depth is -ln(1 - a).
    fn add_fragment(&mut self, depth: f64, rgba: [f32; 4]) {
        let [light @ .., opacity] = rgba.map(f64::from);
        let through = (-self.depth_so_far).exp();
        self.rgb.iter_mut().zip(light).for_each(|(sum, c)| *sum += through * c);
        self.depth_so_far -= (-opacity).ln_1p();
        if rgba != [0.0; 4] {
            self.visible_from = self.visible_from.min(depth);
        }
    }

    /// Adds a surface of this opacity and colour, not premultiplied.
    pub(super) fn add_surface(&mut self, depth: f64, rgb: [f64; 3], opacity: f64) {
        if opacity == 0.0 {
            return;
        }
        let light = (-self.depth_so_far).exp() * opacity;
        self.rgb.iter_mut().zip(rgb).for_each(|(sum, c)| *sum += light * c);
        self.depth_so_far -= (-opacity).ln_1p();
        self.visible_from = self.visible_from.min(depth);
    }

    /// Records the normal and number of the nearest surface, which hides all else.
    pub(super) fn end_with_guide(&mut self, depth: f64, normal: DVec3, number: u32) {
        if self.guide.is_some() {
            return;
        }
        (self.rgb, self.guide) = (normal.to_array(), Some(number));
        (self.depth_so_far, self.visible_from) = (f64::INFINITY, depth);
    }

    fn light(&self) -> Light {
        let [r, g, b] = self.rgb;
        let opacity = -(-self.depth_so_far).exp_m1();
        Light { rgba: [r, g, b, self.guide.map_or(opacity, f64::from)], visible_from: self.visible_from }
    }
}

/// Adds the integral of c tau T over a piece on which colour and extinction are linear.
fn add_piece(rgb: &mut [f64; 3], depth_so_far: &mut f64, from: &Node, to: &Node, length: f64) {
    let (t0, slope) = (from.tau * length, (to.tau - from.tau) * length);
    let optical_depth = |u: f64| u * (t0 + 0.5 * slope * u);
    let total = optical_depth(1.0);
    if total <= 0.0 {
        return;
    }
    // The point at which the optical depth reaches x (the stable root of the quadratic).
    let place = |x: f64| 2.0 * x / (t0 + (t0 * t0 + 2.0 * slope * x).max(0.0).sqrt());
    let count = (total.min(END_DEPTH) / SUB_PIECE_DEPTH).ceil() as usize;
    let mut begin = 0.0;
    for k in 1..=count {
        let target = total.min(END_DEPTH) * k as f64 / count as f64;
        let end = if k == count && total <= END_DEPTH { 1.0 } else { place(target).clamp(begin, 1.0) };
        let (middle, half) = (0.5 * (begin + end), 0.5 * (end - begin));
        for (x, weight) in GAUSS.iter().flat_map(|&(x, w)| [(x, w), (-x, w)]) {
            let u = middle + half * x;
            let light = weight * half * (t0 + slope * u) * (-(*depth_so_far + optical_depth(u))).exp();
            for (sum, (a, b)) in rgb.iter_mut().zip(from.rgb.iter().zip(&to.rgb)) {
                *sum += light * (a + (b - a) * u);
            }
        }
        begin = end;
    }
    *depth_so_far += total;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::medium::{RayLine, RayPoint};

    #[test]
    fn thin_layers_keep_their_relative_opacity() {
        for tau in [1e-300, 1e-18, 1e-9, 1e-3] {
            let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0, 0.5, 0.0], tau }]).unwrap();
            let point = |i: i32| RayPoint { depth: f64::from(i), scalar: 0.1 * f64::from(i) };
            let line = RayLine { length_per_depth: 0.1, ..RayLine::default() };
            let chain = (0..10).map(|i| Segment::of_scalars(0, point(i), point(i + 1), line));
            let [red, green, _, alpha] = integrate(&Transfer::Scalar(&table), chain, &[], 1.0).rgba;
            // Ten segments of a tenth: an optical depth of tau. The series' first term leaves an error of half its square, plus roundings
            // of f64 (measured: 2.2e-16 of it, colours 6.7e-16).
            assert!((alpha / tau - 1.0).abs() <= 0.5 * tau + 2e-15, "{tau:e}: {alpha:e}");
            assert!((red / alpha - 1.0).abs() < 5e-15 && (green / alpha - 0.5).abs() < 5e-15, "{tau:e}");
        }
        // The naive form gives nothing, or half of it.
        let naive = |tau: f64| 1.0 - (-tau).exp();
        assert!(naive(1e-18) == 0.0 && (naive(1e-16) / 1e-16 - 1.0).abs() > 0.1);
    }
}
