//! Several icons at once (Xue and Crawfis 2004, section 2.1): each from a value on, cross-faded around it.

use super::icon::{Icon, IconSums, TEXELS};
use super::picture::Picture;
use super::{FlowScene, splat::smoothstep};
use crate::field::Scalars;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A pattern of splats.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pattern {
    /// A generated one.
    Icon(Icon),
    /// The user's.
    Picture(Arc<Picture>),
}

impl Pattern {
    /// The texels, 0 to 1: rows across, in each the texels along.
    pub(in crate::render) fn texels(&self) -> Vec<[f64; TEXELS]> {
        match self {
            Self::Icon(icon) => icon.texels(),
            Self::Picture(picture) => picture.texels(),
        }
    }

    pub(super) fn sums(&self) -> &IconSums {
        match self {
            Self::Icon(icon) => IconSums::of(*icon),
            Self::Picture(picture) => picture.sums(),
        }
    }
}

/// Icons over a value: one from below, and each further one from its threshold on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds<T> {
    /// The one from below.
    pub first: T,
    /// The further ones, each with its threshold before it.
    pub further: Vec<(f64, T)>,
}

impl<T> Thresholds<T> {
    /// Checks that thresholds are finite and ascend.
    ///
    /// # Errors
    /// The first that does not.
    pub fn check(&self) -> Result<(), String> {
        let thresholds = || self.further.iter().map(|(from, _)| *from);
        if let Some(from) = thresholds().find(|from| !from.is_finite()) {
            return Err(format!("an icon is shown from {from} on; thresholds are finite numbers"));
        }
        match thresholds().zip(thresholds().skip(1)).find(|(before, from)| before >= from) {
            Some((before, from)) => Err(format!(
                "an icon is shown from {from} on, behind one from {before} on; put them in the order of their thresholds"
            )),
            None => Ok(()),
        }
    }

    /// The same thresholds with something else for each icon.
    ///
    /// # Errors
    /// The first error of `of`.
    pub fn try_map<U, E>(&self, of: impl Fn(&T) -> Result<U, E>) -> Result<Thresholds<U>, E> {
        let further = self.further.iter().map(|(from, icon)| Ok((*from, of(icon)?)));
        Ok(Thresholds { first: of(&self.first)?, further: further.collect::<Result<_, E>>()? })
    }

    /// The least distance between two thresholds.
    fn least_gap(&self) -> f64 {
        let gaps = self.further.iter().zip(self.further.iter().skip(1)).map(|((before, _), (from, _))| from - before);
        gaps.fold(f64::INFINITY, f64::min)
    }
}

/// The icons of a layer of flow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlowIcons {
    /// The icons over the field's values.
    pub icons: Thresholds<Pattern>,
    /// Name of that field as options have it; `None`: the length of the vectors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<String>,
    /// Width of the cross-fade around each threshold, in the unit of the values.
    pub fade: f64,
}

impl FlowIcons {
    /// Share of a field's range over which icons are cross-faded.
    pub const FADE: f64 = 0.02;

    /// Icons by a field of this range over the whole series: cross-faded over [`Self::FADE`] of it, or less where thresholds are closer, so that
    /// two are mixed at most.
    pub fn new(icons: Thresholds<Pattern>, by: Option<String>, [least, greatest]: [f64; 2]) -> Self {
        let fade = (Self::FADE * (greatest - least)).min(icons.least_gap());
        Self { icons, by, fade }
    }

    /// Checks that all is in range.
    ///
    /// # Errors
    /// If thresholds are not finite or do not ascend, or the width of cross-fades is negative, not finite, or more than is between two of them.
    pub fn check(&self) -> Result<(), String> {
        self.icons.check()?;
        let Self { fade, .. } = self;
        if !(*fade >= 0.0 && fade.is_finite()) {
            return Err(format!("icons are cross-faded over {fade}; it must be zero or above"));
        }
        let gap = self.icons.least_gap();
        let problem =
            || format!("icons are cross-faded over {fade}, and two thresholds are {gap} apart; fade over that");
        if *fade > gap { Err(problem()) } else { Ok(()) }
    }

    /// The icons of a value, which is finite.
    fn at(&self, value: f64) -> Mix {
        let further = &self.icons.further;
        let passed = further.partition_point(|(from, _)| from - 0.5 * self.fade <= value);
        let Some(last) = passed.checked_sub(1) else { return Mix::default() };
        let share = if self.fade > 0.0 { smoothstep((value - further[last].0) / self.fade + 0.5) } else { 1.0 };
        if share < 1.0 { Mix { icon: last, share } } else { Mix { icon: passed, share: 0.0 } }
    }
}

/// The icon of this number, or with a share of the one after it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Mix {
    pub(super) icon: usize,
    /// Share of the next icon, 0..1.
    pub(super) share: f64,
}

/// Icons of a scene in place of its style's.
#[derive(Clone, Debug)]
pub(crate) struct Mixture {
    pub(crate) icons: FlowIcons,
    /// The values by which they are chosen, one per site; `None`: the lengths of the vectors.
    pub(crate) values: Option<Scalars>,
}

impl FlowScene {
    /// The patterns of the splats, and the thresholds between them.
    pub(in crate::render) fn patterns(&self) -> Thresholds<Pattern> {
        let of_style = || Thresholds { first: Pattern::Icon(self.style.icon), further: Vec::new() };
        self.mixture.as_ref().map_or_else(of_style, |mixture| mixture.icons.icons.clone())
    }

    /// The value by which the icon of a site is chosen; `None` if it is not finite.
    pub(in crate::render) fn icon_value(&self, site: u32) -> Option<f64> {
        let scalars = self.mixture.as_ref().and_then(|mixture| mixture.values.as_ref());
        let value = match scalars {
            Some(scalars) => f64::from(scalars.values()[site as usize]),
            None => self.vector(site).length(),
        };
        value.is_finite().then_some(value)
    }

    /// The icons of a site's splat; `None` if it has none.
    pub(super) fn mix(&self, site: u32) -> Option<Mix> {
        let Some(Mixture { icons, .. }) = &self.mixture else { return Some(Mix::default()) };
        self.icon_value(site).map(|value| icons.at(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn icons(further: &[(f64, Icon)]) -> Thresholds<Pattern> {
        let further = further.iter().map(|(from, icon)| (*from, Pattern::Icon(*icon))).collect();
        Thresholds { first: Pattern::Icon(Icon::Strokes), further }
    }

    #[test]
    fn icons_go_over_into_each_other_around_thresholds_and_two_are_mixed_at_most() {
        let icons = FlowIcons::new(icons(&[(2.0, Icon::Lines), (4.0, Icon::Arrows)]), None, [0.0, 10.0]);
        assert!(icons.check().is_ok() && (icons.fade - 0.2).abs() < 1e-15);
        let mix = |icon, share| Mix { icon, share };
        for (value, expected) in [(-9.0, mix(0, 0.0)), (1.89, mix(0, 0.0)), (3.0, mix(1, 0.0)), (4.11, mix(2, 0.0))] {
            assert_eq!(icons.at(value), expected, "{value}");
        }
        // A quarter of the way: 3 / 16 - 2 / 64. Numbers near 2 are rounded by 2e-16, a tenth of the width of the fade by 1e-15 of it.
        for (value, icon, share) in [(2.0, 0, 0.5), (1.95, 0, 0.156_25), (4.05, 1, 0.843_75)] {
            let found = icons.at(value);
            assert!(found.icon == icon && (found.share - share).abs() < 1e-13, "{value}: {found:?}");
        }
        // It ascends without a step.
        let along: Vec<f64> =
            (0..=5000).map(|i| icons.at(f64::from(i) * 1e-3)).map(|m| m.icon as f64 + m.share).collect();
        // The smoothstep's slope is at most 1.5.
        assert!(along.windows(2).all(|pair| (0.0..=1.5 * 1e-3 / 0.2 + 1e-9).contains(&(pair[1] - pair[0]))));
        assert_eq!((along[0], along[5000]), (0.0, 2.0));
    }

    #[test]
    fn fades_are_no_wider_than_thresholds_are_apart_and_of_one_value_there_is_none() {
        let close = FlowIcons::new(icons(&[(2.0, Icon::Lines), (2.5, Icon::Arrows)]), None, [0.0, 100.0]);
        assert!(close.fade == 0.5 && close.check().is_ok());
        assert_eq!(close.at(2.25), Mix { icon: 1, share: 0.0 });
        let wide = FlowIcons { fade: 0.6, ..close.clone() };
        assert!(wide.check().unwrap_err().contains("0.5 apart"));
        let sharp = FlowIcons::new(icons(&[(3.0, Icon::Lines)]), None, [3.0, 3.0]);
        assert_eq!([2.999, 3.0].map(|value| sharp.at(value).icon), [0, 1]);
        for (bad, part) in [
            (FlowIcons { fade: -1.0, ..sharp.clone() }, "zero or above"),
            (FlowIcons { fade: f64::NAN, ..sharp }, "zero or above"),
            (FlowIcons { icons: icons(&[(f64::NAN, Icon::Lines)]), ..close.clone() }, "finite"),
            (FlowIcons { icons: icons(&[(1.0, Icon::Lines), (1.0, Icon::Arrows)]), ..close }, "order"),
        ] {
            assert!(bad.check().unwrap_err().contains(part), "{bad:?}");
        }
    }
}
