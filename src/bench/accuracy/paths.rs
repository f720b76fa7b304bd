//! The paths that the suite measures: most change one setting, some a pair of settings.

use super::summary::distinct;
use crate::optics::OpticsKind;
use crate::optics::table3d::Table3dResolution;
use crate::pipeline::{Backend, FaceDetail, ImageScale, RenderMode, UpsampleFilter, UpsampleKind, Upsampling};
use crate::render::functions::SheetSpacing;
use crate::render::{Contrast, KBuffer};

/// One way from scalars to pixels: a choice of all settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccuracyPath {
    /// Ray caster, face renderer, points, functions on sheets or reference.
    pub mode: RenderMode,
    /// CPU or GPU.
    pub backend: Backend,
    /// Integration of segments.
    pub optics: OpticsKind,
    /// Entries of the pre-integrated table along a scalar axis, if the optics use it.
    pub table_scalars: usize,
    /// Share of the interior faces that is drawn, by the face renderer.
    pub lod: f64,
    /// The k-buffer of the face renderer.
    pub k_buffer: KBuffer,
    /// Scale and filter of a smaller rendered image; `None` at full size.
    pub upsampling: Option<Upsampling>,
    /// The contrast that decides which rays are cast; `None` casts all.
    pub contrast: Option<Contrast>,
    /// How far sheets are apart, where functions are drawn on some.
    pub sheets: SheetSpacing,
}

/// Levels of detail besides 1.
pub const LODS: [f64; 4] = [0.5, 0.25, 0.1, 0.05];
/// Sizes of the k-buffer.
pub const KS: [u8; 5] = [2, 4, 8, 16, 32];
/// Entries along a scalar axis of pre-integrated tables.
pub const TABLE_SIZES: [usize; 4] = [32, 64, 128, 256];
/// Errors between sheets, of the field's range.
pub const SHEET_ERRORS: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];
/// Numbers of sheets.
pub const SHEET_COUNTS: [u32; 3] = [32, 128, 512];
/// Image scales besides 1.
pub const IMAGE_SCALES: [ImageScale; 3] = [ImageScale::Half, ImageScale::Quarter, ImageScale::Eighth];
/// Contrasts that decide which rays are cast.
pub const CONTRASTS: [Contrast; 5] = [contrast(0.2), contrast(0.1), contrast(0.05), contrast(0.02), contrast(0.01)];

/// A contrast constant; an invalid one does not compile.
const fn contrast(contrast: f32) -> Contrast {
    match Contrast::new(contrast) {
        Some(contrast) => contrast,
        None => panic!("0 to 1"),
    }
}

/// The ray caster on the CPU in full: every other path differs from it, or from [`FACES`], in one or two settings.
const RAYS: AccuracyPath = AccuracyPath {
    mode: RenderMode::Raycast,
    backend: Backend::Cpu,
    optics: OpticsKind::Exact,
    table_scalars: 128,
    lod: 1.0,
    k_buffer: KBuffer::USUAL,
    upsampling: None,
    contrast: None,
    sheets: SheetSpacing::Error(1e-3),
};
const FACES: AccuracyPath = AccuracyPath { mode: RenderMode::Havs, ..RAYS };
/// All cells as points, each by itself, exactly.
const POINTS: AccuracyPath = AccuracyPath { mode: RenderMode::Points, ..RAYS };
/// Functions at the vertices. They are another field than the cells', with a judge of their own.
const SHEETS: AccuracyPath = AccuracyPath { mode: RenderMode::Sheets, ..RAYS };
/// The reference with the table instead of the formula: the error of the table itself.
const REFERENCE_TABLE: AccuracyPath = AccuracyPath { mode: RenderMode::Reference, ..RAYS };

/// Paths for values changed by a codec: the codec's error is the same on every exact path.
pub const CODEC_PATHS: [AccuracyPath; 4] =
    [RAYS, FACES, AccuracyPath { lod: 0.1, ..FACES }, AccuracyPath { upsampling: HALF, ..RAYS }];

/// Paths that change two settings: combinations for a preview on a slow machine.
const PAIRS: [AccuracyPath; 4] = [
    AccuracyPath { optics: OpticsKind::Table3d, upsampling: HALF, ..RAYS },
    AccuracyPath { lod: 0.1, upsampling: HALF, ..FACES },
    AccuracyPath { lod: 0.1, k_buffer: KBuffer { k: 2, exact_order: false }, ..FACES },
    AccuracyPath { lod: 0.25, optics: OpticsKind::Table3d, ..FACES },
];

/// Half scale, bilinear.
const HALF: Option<Upsampling> = Some(Upsampling { scale: ImageScale::Half, filter: UpsampleFilter::Bilinear });

/// Every filter at every scale.
fn upsamplings() -> impl Iterator<Item = Upsampling> {
    let filters = |scale: ImageScale| UpsampleKind::ALL.map(|kind| Upsampling { scale, filter: kind.usual(scale) });
    IMAGE_SCALES.into_iter().flat_map(filters)
}

/// All paths on these backends.
pub fn paths(backends: &[Backend]) -> Vec<AccuracyPath> {
    let mut all = vec![RAYS, FACES, POINTS, REFERENCE_TABLE];
    all.extend([RAYS, FACES].map(|path| AccuracyPath { optics: OpticsKind::Partial, ..path }));
    all.push(AccuracyPath { optics: OpticsKind::Table3d, ..FACES });
    all.extend(TABLE_SIZES.map(|table_scalars| AccuracyPath { optics: OpticsKind::Table3d, table_scalars, ..RAYS }));
    all.extend(upsamplings().map(|upsampling| AccuracyPath { upsampling: Some(upsampling), ..RAYS }));
    let filter = UpsampleKind::Joint.usual(ImageScale::Full);
    all.push(AccuracyPath { lod: 0.1, upsampling: Some(Upsampling { scale: ImageScale::Full, filter }), ..FACES });
    all.extend(CONTRASTS.map(|contrast| AccuracyPath { contrast: Some(contrast), ..RAYS }));
    all.extend(LODS.map(|lod| AccuracyPath { lod, ..FACES }));
    for exact_order in [true, false] {
        all.extend(KS.map(|k| AccuracyPath { k_buffer: KBuffer { k, exact_order }, ..FACES }));
    }
    all.extend(PAIRS);
    // The default face path occurs again among the k-buffers.
    on_backends(&distinct(all), backends)
}

/// The paths of functions at the vertices.
pub fn function_paths() -> Vec<AccuracyPath> {
    let spacings = SHEET_ERRORS.map(SheetSpacing::Error).into_iter().chain(SHEET_COUNTS.map(SheetSpacing::Count));
    spacings.map(|sheets| AccuracyPath { sheets, ..SHEETS }).collect()
}

/// These paths on each of the backends that support them.
pub fn on_backends(paths: &[AccuracyPath], backends: &[Backend]) -> Vec<AccuracyPath> {
    let on = |&backend: &Backend| {
        paths
            .iter()
            .filter(move |path| backend != Backend::Gpu || path.is_of_gpu())
            .map(move |path| AccuracyPath { backend, ..*path })
    };
    backends.iter().flat_map(on).collect()
}

impl AccuracyPath {
    /// Whether the GPU supports this path and it is not a duplicate: the GPU has no reference, one table size, and no k-buffer in exact
    /// order.
    fn is_of_gpu(&self) -> bool {
        let KBuffer { k, exact_order } = self.k_buffer;
        self.mode != RenderMode::Reference
            && self.table_scalars == Table3dResolution::default().scalars
            && (!exact_order || k == RAYS.k_buffer.k)
    }

    /// Level of detail and k-buffer of the faces.
    pub(super) fn faces(&self) -> FaceDetail {
        FaceDetail { lod: self.lod, k_buffer: self.k_buffer, ..FaceDetail::default() }
    }

    /// Entries of the table along a scalar axis, if a table is used.
    pub(super) fn table_size(&self) -> Option<usize> {
        (self.optics == OpticsKind::Table3d).then_some(self.table_scalars)
    }

    /// Name of renderer and backend.
    pub(super) fn mode_name(&self) -> &'static str {
        match (self.mode, self.backend) {
            (RenderMode::Havs, Backend::Gpu) => "havs on the GPU",
            (RenderMode::Havs, _) => "havs",
            (RenderMode::Points, Backend::Gpu) => "points on the GPU",
            (RenderMode::Points, _) => "points",
            (RenderMode::Sheets, _) => "sheets",
            (RenderMode::Reference, _) => "reference by the table",
            (_, Backend::Gpu) => "raycast on the GPU",
            _ => "raycast",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_of_every_factor_is_there_once_and_the_table_of_the_list_is_the_products() {
        let all = paths(&[Backend::Cpu]);
        assert_eq!(RAYS.table_scalars, Table3dResolution::default().scalars);
        assert_eq!(FACES.faces(), FaceDetail::default());
        assert_eq!((all[0], all[1]), (RAYS, FACES));
        for (at, path) in all.iter().enumerate() {
            assert!(!all[..at].contains(path), "{path:?} is there twice");
        }
        let has = |path: AccuracyPath| assert!(all.contains(&path), "{path:?}");
        LODS.into_iter().for_each(|lod| has(AccuracyPath { lod, ..FACES }));
        TABLE_SIZES
            .into_iter()
            .for_each(|table_scalars| has(AccuracyPath { optics: OpticsKind::Table3d, table_scalars, ..RAYS }));
        assert_eq!(upsamplings().count(), 12);
        upsamplings().for_each(|upsampling| has(AccuracyPath { upsampling: Some(upsampling), ..RAYS }));
        CONTRASTS.into_iter().for_each(|contrast| has(AccuracyPath { contrast: Some(contrast), ..RAYS }));
        for exact_order in [true, false] {
            KS.into_iter().for_each(|k| has(AccuracyPath { k_buffer: KBuffer { k, exact_order }, ..FACES }));
        }
        CODEC_PATHS.into_iter().for_each(has);
        let sheets = function_paths();
        assert!(sheets.iter().all(|path| path.mode == RenderMode::Sheets && !all.contains(path)));
        assert_eq!((sheets.len(), distinct(sheets.clone()).len()), (7, 7));
        has(REFERENCE_TABLE);
        has(POINTS);
    }

    #[test]
    fn a_gpu_has_its_own_paths_of_every_kind_but_no_other_tables() {
        let both = paths(&[Backend::Cpu, Backend::Gpu]);
        let gpu: Vec<_> = both.iter().filter(|path| path.backend == Backend::Gpu).collect();
        let cpu = paths(&[Backend::Cpu]);
        assert_eq!(both.len(), cpu.len() + gpu.len());
        for optics in OpticsKind::ALL {
            for mode in [RenderMode::Raycast, RenderMode::Havs] {
                let on_gpu = gpu.iter().filter(|path| (path.optics, path.mode) == (optics, mode)).count();
                assert!(on_gpu >= 1, "{optics} {mode:?}");
            }
        }
        assert!(gpu.iter().any(|path| path.mode == RenderMode::Points));
        assert!(gpu.iter().any(|path| path.lod == 0.05) && gpu.iter().any(|path| path.upsampling == HALF));
        let contrasts = gpu.iter().filter(|path| path.contrast.is_some()).count();
        assert_eq!(contrasts, CONTRASTS.len());
        assert!(gpu.iter().all(|path| path.table_scalars == 128));
    }
}
