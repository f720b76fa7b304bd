//! Holds a frame rate by the level of detail.
//!
//! ```text
//! sample  = drawn fraction * aim / its milliseconds      the fraction that would just be fast enough, if cost were linear
//! wanted  = median of the last three samples             one slow frame changes nothing, a lasting step counts from the second
//! fall    at once, if wanted is below the fraction by more than the lower margin
//! rise    by a factor at most, if it is above it by more than the upper margin, or if it is 1 or more
//! ```
//! A sample knows the fraction that it was drawn with, so frames may be measured late (they are rendered in a pipeline) without
//! being counted against a fraction that they did not have: nothing winds up.
//!
//! Real cost is a + b l, a part that does not depend on the level. The sample is then g(l) = l aim / (a + b l): it grows with l, has
//! its fixed point where a + b l = aim, and a slope a / aim < 1 there if the aim can be reached at all. Repeated, also with a delay,
//! it therefore goes to that level from either side without overshooting; if it cannot be reached, it falls to the floor.

/// Frames whose median counts.
const FRAMES: usize = 3;
/// The time aimed at, as a share of the target: what varies by less stays below the target.
const AIM: f64 = 0.9;
/// Fractions wanted between these shares of the present one change nothing. With the aim, that is a frame of 0.78 to 1.0 of the
/// target.
const MARGINS: [f64; 2] = [AIM, 1.15];
/// Most that the fraction rises by at a time.
const RISE: f64 = 1.5;

/// Chooses the level of detail from the cost of the last frames. No clock: it is told what frames took.
#[derive(Clone, Debug, PartialEq)]
pub struct Controller {
    target_ms: f64,
    floor: f64,
    fraction: f64,
    samples: [f64; FRAMES],
    /// Samples so far, up to [`FRAMES`], and where the next one goes.
    count: usize,
    next: usize,
}

impl Controller {
    /// The lowest fraction, unless another one is set.
    pub const FLOOR: f64 = 0.02;

    /// Begins at 1. `target_ms`: milliseconds that a frame may take; what is no positive number is no limit.
    pub fn new(target_ms: f64) -> Self {
        let mut controller = Self {
            target_ms: f64::INFINITY,
            floor: Self::FLOOR,
            fraction: 1.0,
            samples: [1.0; FRAMES],
            count: 0,
            next: 0,
        };
        controller.set_target(target_ms);
        controller
    }

    /// The same with another lowest fraction, above 0 and up to 1.
    #[must_use]
    pub fn with_floor(mut self, floor: f64) -> Self {
        self.floor = if floor.is_nan() { Self::FLOOR } else { floor.clamp(f64::EPSILON, 1.0) };
        self.fraction = self.fraction.max(self.floor);
        self
    }

    /// Another target, as [`Self::new`] has it. What frames took before counts for it, too.
    pub fn set_target(&mut self, target_ms: f64) {
        let target_ms = if target_ms > 0.0 { target_ms } else { f64::INFINITY };
        // Samples are proportional to it. Without a limit before or now they say nothing.
        match target_ms / self.target_ms {
            ratio if ratio.is_finite() && ratio > 0.0 => self.samples.iter_mut().for_each(|sample| *sample *= ratio),
            _ => (self.count, self.next) = (0, 0),
        }
        self.target_ms = target_ms;
        if target_ms.is_infinite() {
            self.fraction = 1.0;
        }
    }

    /// Milliseconds that a frame may take.
    pub fn target_ms(&self) -> f64 {
        self.target_ms
    }

    /// The fraction to draw the next frame with, from the floor to 1.
    pub fn fraction(&self) -> f64 {
        self.fraction
    }

    /// Takes what a frame took that was drawn with `fraction`; returns the fraction for the next one. Numbers that are not
    /// positive and finite are no measurements.
    pub fn measured(&mut self, ms: f64, fraction: f64) -> f64 {
        let is_number = |x: f64| x.is_finite() && x > 0.0;
        if !is_number(ms) || !is_number(fraction) || self.target_ms.is_infinite() {
            return self.fraction;
        }
        self.samples[self.next] = fraction.min(1.0) * AIM * self.target_ms / ms;
        self.next = (self.next + 1) % FRAMES;
        self.count = (self.count + 1).min(FRAMES);
        let wanted = self.wanted();
        if wanted < MARGINS[0] * self.fraction {
            self.fraction = wanted.max(self.floor);
        } else if wanted > MARGINS[1] * self.fraction || (wanted >= 1.0 && self.fraction < 1.0) {
            self.fraction = wanted.min(RISE * self.fraction).clamp(self.floor, 1.0);
        }
        self.fraction
    }

    /// The median; the greater of two.
    fn wanted(&self) -> f64 {
        // Before the ring is full, its first entries are the samples.
        let mut samples = self.samples;
        let samples = &mut samples[..self.count];
        samples.sort_unstable_by(f64::total_cmp);
        samples[samples.len() / 2]
    }
}
