//! The settings of a look as those of a project.

use super::LookSettings;
use super::flow::differing;
use crate::look::Look;
use crate::pipeline::{RenderMode, Shown, SurfaceLook, TetDraw};
use crate::render::functions::SheetSpacing;
use crate::render::surfaces::{ByField, CutText, IsosurfaceText};

impl LookSettings {
    /// The settings that give this look; those that it shares with `usual`, the look without settings, are left out. Colours, opacities and
    /// range are the ensembles', whose `ensemble` is shown where the timeline has none. Colours of surfaces come back to the nearest of 256
    /// levels.
    pub fn of(look: &Look, usual: &Look, ensemble: Option<String>) -> Self {
        let (mode, faces) = (look.mode, look.faces);
        // Without faces there is nothing to say about them.
        let draw = look.draw(mode, faces);
        let spacing = |of: &Look| (mode == RenderMode::Sheets).then_some(of.sheets.spacing);
        let spacing = spacing(look).filter(|of| Some(*of) != spacing(usual));
        let functions = if draw.drawn_by().is_of_functions() { look.functions } else { usual.functions };
        let draws_faces = matches!(draw, TetDraw::Faces(_));
        let points = if mode == RenderMode::Points { look.points } else { usual.points };
        let of_faces = |differs: bool| draws_faces && differs;
        let of_points = |differs: bool| mode == RenderMode::Points && differs;
        let is_sampled =
            of_faces(faces.sampling != usual.faces.sampling) || of_points(faces.sampling.importance().is_some());
        let unit = look.lengths.unit_distance;
        Self {
            ensemble,
            opacity_kind: differing(look.opacity_kind, usual.opacity_kind),
            unit_distance: differing(unit, usual.lengths.unit_distance),
            mode: differing(mode, usual.mode),
            representation: differing(look.representation, usual.representation)
                .filter(|_| mode == RenderMode::Reference),
            backend: differing(look.backend, usual.backend),
            // The reference has its own.
            optics: differing(look.optics, usual.optics).filter(|_| mode != RenderMode::Reference),
            lod: differing(draw.lod(), usual.faces.lod).filter(|_| draws_faces || mode == RenderMode::Points),
            sampling: is_sampled.then(|| faces.sampling.to_string()),
            k: of_faces(faces.k_buffer.k != usual.faces.k_buffer.k).then_some(faces.k_buffer.k),
            inexact_order: (of_faces(!faces.k_buffer.exact_order) || !points.exact_order).then_some(true),
            footprint: differing(points.footprint, usual.points.footprint),
            compositing: differing(points.compositing, usual.points.compositing),
            point_radius: differing(points.radius, usual.points.radius),
            sheets: spacing.and_then(|spacing| match spacing {
                SheetSpacing::Count(count) => Some(count),
                SheetSpacing::Error(_) => None,
            }),
            sampling_error: spacing.and_then(|spacing| match spacing {
                SheetSpacing::Error(error) => Some(error),
                SheetSpacing::Count(_) => None,
            }),
            domain: functions.domain,
            normalise: differing(functions.normalise, usual.functions.normalise),
            camera: Some(look.camera.to_string()),
            ..Self::of_surfaces(&look.surfaces, &usual.surfaces)
        }
    }

    /// The settings of surfaces alone.
    fn of_surfaces(look: &SurfaceLook, usual: &SurfaceLook) -> Self {
        let by = |place: Option<u8>| -> Option<ByField> {
            let place = usize::from(place?);
            let field = look.beside.get(place)?.field.parse().ok()?;
            Some(ByField { field, map: look.maps.get(place).cloned().flatten() })
        };
        let iso = look.isosurfaces.iter().filter(|_| look.shown != Shown::Volume);
        let (shading, usual) = (&look.shading, &usual.shading);
        Self {
            iso: iso.map(|&surface| IsosurfaceText { surface, by: by(surface.by) }.to_string()).collect(),
            cut: look.cuts.iter().map(|&cut| CutText { cut, by: by(cut.by) }.to_string()).collect(),
            crop: look.crop,
            surface: look.domain.iter().map(ToString::to_string).collect(),
            parts: look.parts.clone(),
            regions: look.regions.clone(),
            no_volume: (look.shown == Shown::Surfaces).then_some(true),
            shade: differing(shading.normals, usual.normals),
            shade_volume: differing(shading.volume, usual.volume),
            light: differing(shading.light, usual.light),
            ao: differing(shading.ambient_occlusion, usual.ambient_occlusion),
            no_smoothing: differing(!shading.smooth, !usual.smooth),
            ..Self::default()
        }
    }
}
