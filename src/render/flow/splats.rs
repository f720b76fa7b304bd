//! The splats of a view: renderers draw their fragments, or, on a GPU, their lists by tiles.

use super::super::cpu::layers::Inside;
#[cfg(feature = "gpu")]
use super::FlowFidelity;
use super::icon::IconSums;
#[cfg(feature = "gpu")]
use super::lists::Strip;
use super::mixture::Pattern;
use super::splat::Splat;
use super::{FlowCounts, FlowScene, Thresholds, rows};
use crate::camera::{Samples, View};
use crate::render::{LayerFragments, RenderError};
use rayon::prelude::*;
use std::sync::Arc;
#[cfg(feature = "gpu")]
use std::sync::OnceLock;

/// The splats of a frame in its view.
#[derive(Debug)]
pub struct FlowSplats {
    /// In the order of (depth, site).
    pub(super) splats: Vec<Splat>,
    /// The icons that they are of.
    pub(super) patterns: Vec<Pattern>,
    /// Opacity of an icon where it is 1.
    pub(super) opacity: f64,
    /// How their kernels are composited; `None` if they have none.
    #[cfg(feature = "gpu")]
    pub(super) kernels: Option<FlowFidelity>,
    /// Where they are drawn; `None`: everywhere.
    pub(super) inside: Option<Arc<Inside>>,
    /// The view, in local coordinates.
    pub(super) view: View,
    /// World length of a local unit.
    per_unit: f64,
    /// The fragments of the frame's other layers, which lie in front at equal depths.
    others: Option<Arc<LayerFragments>>,
    /// The tiles that they reach, once these are known; `None`: too many.
    #[cfg(feature = "gpu")]
    pub(super) reached: OnceLock<Option<Vec<Strip>>>,
}

impl FlowScene {
    /// The splats in a view in local coordinates.
    pub(crate) fn splats(&self, view: &View) -> FlowSplats {
        let seen = |site: u32| Splat::of(self, site, view);
        let mut splats: Vec<Splat> = self.sites().into_par_iter().filter_map(seen).collect();
        splats.par_sort_by(|a, b| a.depth.total_cmp(&b.depth).then(a.site.cmp(&b.site)));
        let Thresholds { first, further } = self.patterns();
        FlowSplats {
            splats,
            patterns: std::iter::once(first).chain(further.into_iter().map(|(_, icon)| icon)).collect(),
            opacity: self.style.opacity,
            #[cfg(feature = "gpu")]
            kernels: self.kernels.is_some().then_some(self.style.fidelity),
            inside: self.inside(view),
            view: view.clone(),
            per_unit: self.mesh.positions.scale,
            others: None,
            #[cfg(feature = "gpu")]
            reached: OnceLock::new(),
        }
    }
}

impl FlowSplats {
    /// These, with the fragments of the frame's other layers, if it has some.
    pub(crate) fn among(self, others: Option<Arc<LayerFragments>>) -> Self {
        Self { others, ..self }
    }

    /// The icons that they are of.
    #[cfg(feature = "gpu")]
    pub(in crate::render) fn patterns(&self) -> &[Pattern] {
        &self.patterns
    }

    /// The fragments of the frame's other layers.
    pub(in crate::render) fn others(&self) -> Option<&Arc<LayerFragments>> {
        self.others.as_ref()
    }

    /// Pixels of the plane that is rendered.
    pub(in crate::render) fn pixels(&self) -> usize {
        let (columns, rows) = self.view.plane_px();
        columns * rows
    }

    /// The number of splats, and of fast ones.
    pub(crate) fn counts(&self) -> FlowCounts {
        let fast = self.splats.iter().filter(|splat| FlowCounts::is_fast(splat.blur)).count() as u64;
        FlowCounts { splats: self.splats.len() as u64, fast, outside: 0 }
    }

    /// The fragments of the splats, in the memory of others that nobody needs, if there are some.
    ///
    /// # Errors
    /// If there are more than memory is for.
    pub(crate) fn fragments(&self, spare: Option<LayerFragments>) -> Result<(LayerFragments, FlowCounts), RenderError> {
        let listed = if let Samples::Pixels(pixels) = &self.view.samples { pixels.ascending() } else { None };
        let Some((ascending, places)) = listed else { return self.fragments_in(&self.view, spare) };
        let view = View { samples: Samples::Pixels(Arc::new(ascending)), ..self.view.clone() };
        self.fragments_in(&view, spare).map(|(found, counts)| (found.at(&places), counts))
    }

    fn fragments_in(
        &self,
        view: &View,
        spare: Option<LayerFragments>,
    ) -> Result<(LayerFragments, FlowCounts), RenderError> {
        let icons: Vec<&IconSums> = self.patterns.iter().map(Pattern::sums).collect();
        let spare = spare.map(LayerFragments::into_lists).unwrap_or_default();
        let (of_icons, of_view) = ((&icons[..], self.opacity), (view, self.inside.as_deref()));
        let (fragments, outside) = rows::fragments(&self.splats, of_icons, of_view, self.per_unit, spare)?;
        Ok((fragments, FlowCounts { outside, ..self.counts() }))
    }

    /// Fragments of the splats with those of the frame's other layers.
    pub(crate) fn with_others(&self, fragments: Arc<LayerFragments>) -> Arc<LayerFragments> {
        match &self.others {
            Some(others) => Arc::new(others.with(&fragments)),
            None => fragments,
        }
    }
}

#[cfg(test)]
impl FlowScene {
    /// The fragments of a view in local coordinates.
    pub(super) fn fragments(
        &self,
        view: &View,
        spare: Option<LayerFragments>,
    ) -> Result<(LayerFragments, FlowCounts), RenderError> {
        self.splats(view).fragments(spare)
    }
}
