//! The splats of a view: renderers draw their fragments, or, on a GPU, project and list them.

use super::super::cpu::layers::Inside;
use super::icon::IconSums;
use super::mixture::Pattern;
#[cfg(feature = "gpu")]
use super::ready::Ready;
use super::splat::Splat;
use super::{FlowCounts, FlowScene, Thresholds, rows};
use crate::camera::{Samples, View};
use crate::render::{LayerFragments, RenderError};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// The splats of a frame in its view.
#[derive(Debug)]
pub struct FlowSplats {
    /// What they are of.
    scene: FlowScene,
    /// The view, in local coordinates.
    view: View,
    /// The icons that they are of.
    pub(super) patterns: Vec<Pattern>,
    /// Where they are drawn; `None`: everywhere.
    pub(super) inside: Option<Arc<Inside>>,
    /// The fragments of the frame's other layers, which lie in front at equal depths.
    others: Option<Arc<LayerFragments>>,
    /// On the screen, in the order of (depth, site), once somebody asks for their fragments.
    projected: OnceLock<Vec<Splat>>,
    /// In that order, as a GPU projects them, once one does.
    #[cfg(feature = "gpu")]
    ready: OnceLock<Ready>,
}

impl FlowScene {
    /// The splats in a view in local coordinates.
    pub(crate) fn splats(&self, view: &View) -> FlowSplats {
        let Thresholds { first, further } = self.patterns();
        FlowSplats {
            scene: self.clone(),
            view: view.clone(),
            patterns: std::iter::once(first).chain(further.into_iter().map(|(_, icon)| icon)).collect(),
            inside: self.inside(view),
            others: None,
            projected: OnceLock::new(),
            #[cfg(feature = "gpu")]
            ready: OnceLock::new(),
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

    /// What they are of.
    #[cfg(feature = "gpu")]
    pub(in crate::render) fn scene(&self) -> &FlowScene {
        &self.scene
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

    /// The splats on the screen, in the order of (depth, site).
    pub(super) fn projected(&self) -> &[Splat] {
        self.projected.get_or_init(|| {
            let seen = |site: u32| Splat::of(&self.scene, site, &self.view);
            let mut splats: Vec<Splat> = self.scene.sites().into_par_iter().filter_map(seen).collect();
            splats.par_sort_by(|a, b| a.depth.total_cmp(&b.depth).then(a.site.cmp(&b.site)));
            splats
        })
    }

    /// The splats in that order, as a GPU projects them.
    #[cfg(feature = "gpu")]
    pub(in crate::render) fn ready(&self) -> &Ready {
        self.ready.get_or_init(|| Ready::of(&self.scene, &self.view, &self.patterns))
    }

    /// Makes them ready for a GPU. Returns the number of splats, and of fast ones.
    #[cfg(feature = "gpu")]
    pub(crate) fn make_ready(&self) -> FlowCounts {
        self.ready().counts
    }

    /// The number of splats on the screen, and of fast ones.
    pub(crate) fn counts(&self) -> FlowCounts {
        let splats = self.projected();
        let fast = splats.iter().filter(|splat| FlowCounts::is_fast(splat.blur)).count() as u64;
        FlowCounts { splats: splats.len() as u64, fast, outside: 0 }
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
        let (of_icons, of_view) = ((&icons[..], self.scene.style.opacity), (view, self.inside.as_deref()));
        let (splats, per_unit) = (self.projected(), self.scene.mesh.positions.scale);
        let (fragments, outside) = rows::fragments(splats, of_icons, of_view, per_unit, spare)?;
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
