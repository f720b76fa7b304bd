//! Ensembles and range maps between keys of a timeline (dissertation 7.4).

use super::TransferError;
use super::blend::ColorWeighting;
use super::curve::Curve;
use super::ensemble::{Context, Ensemble, Sample};
use super::profile::Side;
use super::range_map::RangeMap;
use crate::timeline::{At, Keyframed};

impl Keyframed<Ensemble> {
    /// The curve over the scalar at a time: that of an ensemble at its key, and [`Curve::mix`] between two. Clear without
    /// keys.
    ///
    /// # Errors
    /// As [`Ensemble::curve`] and [`Curve::mix`].
    pub fn curve(&self, time: f64, context: &Context, colors: ColorWeighting) -> Result<Curve, TransferError> {
        match self.at(time) {
            None => Ok(Curve::new(Vec::new(), context.kind)),
            Some(At::One(ensemble)) => ensemble.curve(context),
            Some(At::Between { a, b, weight }) => Curve::mix(&a.curve(context)?, &b.curve(context)?, weight, colors),
        }
    }

    /// Colour and opacity at a time and a place, by the formula of [`Curve::mix`] on the true values of both ensembles,
    /// whichever spaces their members have.
    ///
    /// # Errors
    /// As [`Ensemble::evaluator`], and if one ensemble has opacities and the other optical depths.
    pub fn eval(
        &self,
        time: f64,
        context: &Context,
        colors: ColorWeighting,
        sample: &Sample,
    ) -> Result<([f64; 3], f64), TransferError> {
        match self.at(time) {
            None => Ok(([0.0; 3], 0.0)),
            Some(At::One(ensemble)) => Ok(ensemble.evaluator(context)?.eval(sample)),
            Some(At::Between { a, b, weight }) => {
                let (a, b) = (a.evaluator(context)?, b.evaluator(context)?);
                if a.kind() != b.kind() {
                    return Err(TransferError::MixedKinds);
                }
                let [a, b] = [a, b].map(|e| e.eval(sample)).map(|(rgb, value)| Side { rgb, value });
                let side = Side::mix_weighted(&a, &b, weight, colors);
                Ok((side.rgb, side.value))
            }
        }
    }
}

impl Keyframed<RangeMap> {
    /// The map at a time: [`RangeMap::mix`] between two keys; the map that changes nothing without any.
    pub fn map(&self, time: f64) -> RangeMap {
        match self.at(time) {
            None => RangeMap::default(),
            Some(At::One(map)) => map.clone(),
            Some(At::Between { a, b, weight }) => RangeMap::mix(a, b, weight),
        }
    }
}

#[cfg(test)]
#[path = "keyframes_tests.rs"]
mod tests;
