//! Converts raw accumulators to pixels of the screen, on a thread of its own.

use crate::pipeline::SharedFrame;
use crate::render::Frame;
use crossbeam::channel::{Receiver, Sender, bounded};
use std::io;

/// The colours of `pixels` (premultiplied accumulators) over an opaque background, as 8-bit RGBA. Rounded as by
/// [`write_png`](crate::image::write_png), except that values within an f32 rounding error of half a unit may be rounded up: exact rounding
/// would take four times as long.
pub fn over_background(pixels: &[[f32; 4]], background: [f32; 3]) -> Vec<[u8; 4]> {
    let over = |&[r, g, b, a]: &[f32; 4]| {
        let rest = 1.0 - a;
        let byte = |c: f32, behind: f32| ((c + rest * behind) * 255.0 + 0.5) as u8;
        [byte(r, background[0]), byte(g, background[1]), byte(b, background[2]), 255]
    };
    pixels.iter().map(over).collect()
}

/// An image for the screen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// RGBA, opaque, row 0 on top.
    pub pixels: Vec<[u8; 4]>,
}

impl Picture {
    /// The picture of a frame.
    pub fn of(frame: &Frame, background: [f32; 3]) -> Self {
        let color = &frame.planes.color;
        Self { size: [color.width, color.height], pixels: over_background(&color.pixels, background) }
    }
}

/// The name, the frame, and the background colour.
type Job<N> = (N, SharedFrame, [f32; 3]);

/// Makes pictures of frames; of pending ones, only the newest. A name `N` identifies each.
#[derive(Debug)]
pub struct PictureMaker<N> {
    to: Sender<Job<N>>,
    waiting: Receiver<Job<N>>,
    done: Receiver<(N, Picture)>,
}

impl<N: Send + 'static> PictureMaker<N> {
    /// Starts the thread, which ends with its maker. `made` is called when there is a picture to take.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub fn start(made: impl Fn() + Send + 'static) -> io::Result<Self> {
        let (to, waiting) = bounded::<Job<N>>(1);
        let (to_owner, done) = bounded(1);
        let (jobs, stale) = (waiting.clone(), done.clone());
        std::thread::Builder::new().name("picture".to_owned()).spawn(move || {
            while let Ok((name, frame, background)) = jobs.recv() {
                send_newest(&to_owner, &stale, (name, Picture::of(&frame, background)));
                drop(frame);
                made();
            }
        })?;
        Ok(Self { to, waiting, done })
    }

    /// Requests the picture of a frame, replacing a pending request.
    pub fn make(&self, name: N, frame: SharedFrame, background: [f32; 3]) {
        send_newest(&self.to, &self.waiting, (name, frame, background));
    }

    /// The newest picture not taken yet.
    pub fn take(&self) -> Option<(N, Picture)> {
        self.done.try_recv().ok()
    }
}

/// Sends a value, replacing a waiting one.
fn send_newest<T>(to: &Sender<T>, waiting: &Receiver<T>, mut value: T) {
    while let Err(error) = to.try_send(value) {
        if error.is_disconnected() {
            return;
        }
        value = error.into_inner();
        let _ = waiting.try_recv();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::RgbaImage;
    use proptest::prelude::*;

    /// Distance of the colour times 255 from where its rounding changes.
    fn to_half(c: f32) -> f32 {
        ((c * 255.0).fract() - 0.5).abs()
    }

    proptest! {
        #[test]
        fn pictures_have_the_colours_of_a_png(
            pixels in prop::collection::vec(prop::array::uniform4(0.0..1.0_f32), 1..50),
            background in prop::array::uniform3(0.0..1.0_f32),
        ) {
            let image = RgbaImage { width: pixels.len(), height: 1, pixels };
            let expected = image.over(background);
            let ours = over_background(&image.pixels, background);
            for (ours, expected) in ours.iter().zip(&expected) {
                prop_assert_eq!(ours[3], 255);
                for (&byte, &c) in ours.iter().zip(expected) {
                    // Two operations on numbers below 256, each with a rounding error of 2^-16 at most.
                    let exact = (c * 255.0).round() as u8;
                    prop_assert!(byte == exact || (to_half(c) <= 1.0 / 32768.0 && byte.abs_diff(exact) == 1));
                }
            }
        }
    }

    #[test]
    fn accumulators_beyond_a_colour_are_clamped_and_what_is_none_is_black() {
        let pixels = [[1.5, -0.5, 0.0, 0.0], [f32::NAN, 0.25, 0.0, 1.0]];
        assert_eq!(over_background(&pixels, [0.0; 3]), [[255, 0, 0, 255], [0, 64, 0, 255]]);
        assert_eq!(over_background(&[[0.0; 4]], [1.0, 0.5, 0.0]), [[255, 128, 0, 255]]);
    }

    #[test]
    fn only_the_newest_of_those_that_wait_is_made() {
        let (to, waiting) = bounded(1);
        (0..5).for_each(|i| send_newest(&to, &waiting, i));
        assert_eq!(waiting.try_iter().collect::<Vec<_>>(), [4]);
    }
}
