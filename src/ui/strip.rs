//! The scalar over time (dissertation 7.4): an image of the histogram of each step.

use super::survey::{MOST_STEPS, STEP_BINS, Surveyed};

/// An image of the histograms of the steps read so far: columns over time, rows from the greatest value down.
#[derive(Clone, Debug, PartialEq)]
pub struct StripImage {
    /// Number of columns; there are [`STEP_BINS`] rows.
    pub columns: usize,
    /// Number of steps in a column; the last one may have fewer.
    pub steps_per_column: usize,
    /// Shades, row by row: 0 without values, 255 for the most. They are logarithms of counts: most volumes are mostly surroundings.
    pub shades: Vec<u8>,
}

impl StripImage {
    /// The image of a survey; `None` as long as it has no step.
    pub fn of(survey: &Surveyed) -> Option<Self> {
        let steps = survey.steps.len();
        survey.steps.iter().flatten().next()?;
        // Of more steps than are read there is one in any four times as many as there are of each.
        let steps_per_column = if steps <= MOST_STEPS { 1 } else { 4 * steps.div_ceil(MOST_STEPS) };
        let of_column = survey.steps.chunks(steps_per_column).map(|steps| {
            let mut logs = vec![0.0_f64; STEP_BINS];
            for step in steps.iter().flatten() {
                logs.iter_mut().zip(&step.counts).for_each(|(log, &count)| *log = log.max((count as f64).ln_1p()));
            }
            logs
        });
        let logs: Vec<Vec<f64>> = of_column.collect();
        let most = logs.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
        let row = |bin: usize| logs.iter().map(move |column| (255.0 * column[bin] / most).round() as u8);
        let shades = (0..STEP_BINS).rev().flat_map(row).collect();
        Some(Self { columns: logs.len(), steps_per_column, shades })
    }

    /// The parts of the image's width at which the first and the last of so many steps lie.
    pub fn ends(&self, steps: usize) -> [f32; 2] {
        let width = (self.columns * self.steps_per_column).max(1) as f32;
        [0.5 / width, (steps as f32 - 0.5) / width]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::moments::{AxisScale, Bins, Histogram1d, StepSummary};
    use crate::ui::survey::StepSurvey;
    use std::sync::Arc;

    fn survey(steps: usize, known: impl Fn(usize) -> Option<usize>) -> Surveyed {
        let step = |step: usize| {
            let mut counts = vec![0; STEP_BINS];
            counts[known(step)?] = 1 + step as u64;
            Some(Arc::new(StepSurvey { summary: StepSummary::of(&[0.0]), mean: 0.0, counts }))
        };
        Surveyed {
            steps: (0..steps).map(step).collect(),
            histogram: Histogram1d::over(Bins::new(None, AxisScale::Linear, 1)),
            done: 0,
            total: steps,
            failed: 0,
            problem: None,
            is_over: true,
        }
    }

    #[test]
    fn each_step_has_a_column_with_the_greatest_values_on_top() {
        assert_eq!(StripImage::of(&survey(3, |_| None)), None);
        let image = StripImage::of(&survey(3, |step| (step != 1).then_some(if step == 0 { 0 } else { STEP_BINS - 1 })))
            .unwrap();
        assert_eq!((image.columns, image.steps_per_column, image.shades.len()), (3, 1, 3 * STEP_BINS));
        let bottom = image.shades.len() - 3;
        assert_eq!(image.shades[bottom..], [128, 0, 0], "log 2 of log 4");
        assert_eq!(image.shades[..3], [0, 0, 255]);
        assert_eq!(image.ends(3), [0.5 / 3.0, 2.5 / 3.0]);
    }

    #[test]
    fn of_very_many_steps_several_share_a_column() {
        let image = StripImage::of(&survey(3000, |step| (step % 7 == 0).then_some(step % STEP_BINS))).unwrap();
        assert_eq!((image.columns, image.steps_per_column), (250, 12));
        let [first, last] = image.ends(3000);
        assert!(first > 0.0 && last < 1.0 && first < last);
        let is_empty = |column: usize| (0..STEP_BINS).all(|row| image.shades[row * image.columns + column] == 0);
        assert!(!(0..image.columns).any(is_empty));
    }
}
