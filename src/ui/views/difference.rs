//! The difference of two pictures of the same moment, on a thread of its own.

use crate::image::{MetricsError, RawDifference, RgbaImage, compare_raw};
use crate::pipeline::SharedFrame;
use crate::task::Cancel;
use crate::transfer::ColorMap;
use crate::ui::Session;
use crate::ui::picture::Picture;
use crate::ui::worker::{Slot, Worker};
use std::io;
use std::sync::Arc;

/// Colours of differences.
const COLORS: &str = "cool-to-warm";

/// The colour of a difference from -1 to 1, in ends of the colours ([`Difference::span`]).
pub fn color(share: f64) -> [f64; 3] {
    ColorMap::built_in(COLORS).map_or([0.5; 3], |map| map.eval(0.5 + 0.5 * share))
}

/// The difference of two pictures.
#[derive(Clone, Debug)]
pub struct Difference {
    /// Largest difference and root mean square, over all pixels and four channels of the raw accumulators.
    pub raw: RawDifference,
    /// The ends of the colours: differences from minus this to this. The first of 1, 2, 5, 10, .. times a power of ten that the largest
    /// difference does not exceed, so that they rarely change over time.
    pub span: f64,
    /// In each pixel, the difference of the channel that differs most, by [`color`].
    pub picture: Arc<Picture>,
    /// The time of both in the unit of the left one's file.
    pub time: f64,
}

/// Two final pictures in full of the same moment and size.
#[derive(Clone)]
pub(super) struct Pair {
    frames: [SharedFrame; 2],
    time: f64,
}

impl Pair {
    /// The pictures on the screen, if they can be compared.
    pub(super) fn of(left: &Session, right: &Session) -> Option<Self> {
        let [a, b] = [left.shown()?, right.shown()?];
        let are_there = [(left, a), (right, b)].iter().all(|(session, shown)| {
            let is_due = session.state().frame == Some(shown.request.time) && !session.is_waiting();
            is_due && shown.is_final && !shown.frame.planes.color.pixels.is_empty()
        });
        let is_one_size = a.request.size_px == b.request.size_px;
        let time = a.request.time.time(left.series().times());
        (are_there && is_one_size).then(|| Self { frames: [a.frame.clone(), b.frame.clone()], time })
    }

    /// Compares by pointer, not by content.
    fn is(&self, other: &Self) -> bool {
        self.frames.iter().zip(&other.frames).all(|(a, b)| std::ptr::eq::<crate::render::Frame>(&**a, &**b))
    }
}

/// The number of a pair, and its difference or why there is none.
type Found = (u64, Result<Arc<Difference>, String>);

/// Compares the newest pair.
pub(super) struct Comparer {
    worker: Worker<(u64, Pair)>,
    slot: Arc<Slot<Found>>,
    /// The last pair that was asked for, and its number.
    asked: (u64, Option<Pair>),
}

impl Comparer {
    /// Starts the thread, which ends with its owner. `wake` is called when a difference was found.
    pub(super) fn start(wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        let slot = Arc::new(Slot::default());
        let work = |_: &mut (), (number, pair): (u64, Pair), _: &Cancel, put: &dyn Fn(Found)| {
            let [a, b] = pair.frames.each_ref().map(|frame| &frame.planes.color);
            put((number, Difference::of(a, b, pair.time).map(Arc::new).map_err(|error| error.to_string())));
        };
        let worker = Worker::start("difference", slot.filler(wake), work, |(number, _), text| (number, Err(text)))?;
        Ok(Self { worker, slot, asked: (0, None) })
    }

    /// Requests the difference of a pair, unless it was the last one requested.
    pub(super) fn compare(&mut self, pair: Pair) {
        let (number, last) = &mut self.asked;
        if !last.as_ref().is_some_and(|last| last.is(&pair)) {
            *number += 1;
            self.worker.give((*number, pair.clone()));
            *last = Some(pair);
        }
    }

    /// The last difference, or why there is none; `None` before the first.
    pub(super) fn found(&self) -> Option<Result<Arc<Difference>, String>> {
        self.slot.get().map(|(_, found)| found)
    }

    /// Whether the difference of the last pair is pending.
    pub(super) fn is_waiting(&self) -> bool {
        self.asked.0 > 0 && self.slot.get().is_none_or(|(number, _)| number != self.asked.0)
    }
}

impl Difference {
    /// The difference `a - b`.
    ///
    /// # Errors
    /// If sizes differ, there are no pixels, or one is not finite.
    fn of(a: &RgbaImage, b: &RgbaImage, time: f64) -> Result<Self, MetricsError> {
        let raw = compare_raw(a, b)?;
        let span = round_up(raw.max);
        let pixel = |d: f64| {
            let [r, g, b] = color(d / span).map(|c| (255.0 * c).round() as u8);
            [r, g, b, 255]
        };
        let pixels = a.pixels.iter().zip(&b.pixels).map(|(a, b)| pixel(largest(a, b))).collect();
        Ok(Self { raw, span, picture: Arc::new(Picture { size: [a.width, a.height], pixels }), time })
    }
}

/// The difference of the channel that differs most.
fn largest(a: &[f32; 4], b: &[f32; 4]) -> f64 {
    let differences = a.iter().zip(b).map(|(&a, &b)| f64::from(a) - f64::from(b));
    differences.fold(0.0, |most: f64, d| if d.abs() > most.abs() { d } else { most })
}

/// The first of 1, 2, 5, 10, .. times a power of ten that is not below `x`, which is not negative; 1 for 0.
fn round_up(x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let power = 10_f64.powf(x.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|digit| digit * power).find(|&rounded| rounded >= x).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: &[[f32; 4]]) -> RgbaImage {
        RgbaImage { width: pixels.len(), height: 1, pixels: pixels.to_vec() }
    }

    #[test]
    fn colours_say_which_is_greater_and_numbers_by_how_much() {
        let a = image(&[[0.5, 0.5, 0.5, 0.5], [0.5, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 0.0]]);
        let b = image(&[[0.5, 0.5, 0.5, 0.5], [0.5, 0.0, 0.0, 0.25], [0.0, 0.0, 0.125, 0.0]]);
        let found = Difference::of(&a, &b, 2.0).unwrap();
        assert_eq!((found.raw.max, found.span, found.time), (0.25, 0.5, 2.0));
        assert_eq!(found.raw.rmse, ((0.0625 + 0.015625) / 12.0_f64).sqrt());
        let map = ColorMap::built_in(COLORS).unwrap();
        let byte = |position: f64| map.eval(position).map(|c| (255.0 * c).round() as u8);
        let expected = [0.5, 0.75, 0.375].map(byte).map(|[r, g, b]| [r, g, b, 255]);
        assert_eq!(found.picture.pixels, expected);
        assert_ne!(expected[0], expected[1], "the test can fail");
    }

    #[test]
    fn equal_pictures_have_one_colour_and_others_cannot_be_compared() {
        let a = image(&[[0.25; 4], [0.75; 4]]);
        let found = Difference::of(&a, &a, 0.0).unwrap();
        assert_eq!((found.raw.max, found.raw.rmse, found.span), (0.0, 0.0, 1.0));
        assert_eq!(found.picture.pixels[0], found.picture.pixels[1]);
        assert!(Difference::of(&a, &image(&[[0.25; 4]]), 0.0).is_err(), "another size");
        let error = Difference::of(&a, &image(&[[0.25; 4], [f32::NAN; 4]]), 0.0).unwrap_err().to_string();
        assert!(error.contains("not finite"), "{error}");
    }

    #[test]
    fn ends_of_colours_are_round_and_never_below_the_difference() {
        let found = [1.0, 0.99, 0.5, 0.3, 0.0101, 2e-7, 1e-300].map(round_up);
        for (found, expected) in found.into_iter().zip([1.0, 1.0, 0.5, 0.5, 0.02, 2e-7, 1e-300]) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} for {expected}");
        }
        assert!(round_up(f64::MIN_POSITIVE / 16.0) > 0.0, "denormal");
    }
}
