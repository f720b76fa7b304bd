//! A picture of a source before its mesh is known: some cells of the first step, as points.

use super::picture::Picture;
use crate::ingest::{FirstStep, IngestOptions, ingest};
use crate::look::{Keyed, Look, mapped_range};
use crate::mesh::ConnectivityChoice;
use crate::pipeline::{Backend, FaceDetail, Pipeline, RenderMode, Series, SurfaceLook};
use crate::render::points::{Footprint, PointStyle};
use crate::store::Store;
use crate::task::{Cancel, Silent};
use std::fmt;
use std::sync::Arc;

/// Chooses the look of a series; `None`: there is no picture.
pub type FirstLook = dyn Fn(&Series) -> Option<Look> + Send + Sync;

/// How such a picture looks.
#[derive(Clone)]
pub struct FirstPicture {
    /// The look, of which the renderer is not used.
    pub look: Arc<FirstLook>,
    /// Width and height, pixels.
    pub size_px: (usize, usize),
    /// Display-referred colour behind the cells.
    pub background: [f32; 3],
}

impl fmt::Debug for FirstPicture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FirstPicture").field("size_px", &self.size_px).finish_non_exhaustive()
    }
}

impl FirstPicture {
    /// The picture; `None` if it was cancelled, or cannot be drawn: the import, which goes on, then says why, or the series is seen when it
    /// is open.
    pub(super) fn of(&self, step: &FirstStep, cancel: &Cancel) -> Option<Picture> {
        let folder = tempfile::tempdir().ok()?;
        let store = folder.path().join("first.zarr");
        let options = IngestOptions { connectivity: ConnectivityChoice::None, ..Default::default() };
        ingest(step, &store, &options, &Silent, cancel).ok()?;
        let series = Arc::new(Series::open(&Store::open(&store).ok()?, None).ok()?);
        let look = (self.look)(&series)?;
        let usual = PointStyle::usual_of(series.mesh());
        let footprint = if series.mesh().is_cloud() { usual.footprint } else { Footprint::Ellipse };
        let look = Look {
            mode: RenderMode::Points,
            faces: FaceDetail::default(),
            points: PointStyle { footprint, ..usual },
            surfaces: SurfaceLook::default(),
            backend: Backend::Cpu,
            ..look
        };
        let range = mapped_range(&series, &look.range, 0.into()).ok()?;
        let colors = || look.colors(&range);
        let request = look.request(0.into(), self.size_px, &Keyed::default(), colors).ok()?;
        let mut pipeline = Pipeline::new(series);
        let frame = pipeline.render_unless(&request, cancel).ok()?;
        Some(Picture::of(frame, self.background))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::SeriesSource;
    use crate::ingest::ReadMesh;
    use crate::scene::Scene;
    use crate::synth::{SeriesName, SynthSpec, generate};

    /// Mean of each channel, 0..=255.
    fn means(pixels: &[[u8; 4]]) -> [f64; 3] {
        [0, 1, 2].map(|c| pixels.iter().map(|pixel| f64::from(pixel[c])).sum::<f64>() / pixels.len() as f64)
    }

    #[test]
    fn the_picture_is_about_as_bright_as_the_first_frame() {
        let source = generate(&SynthSpec { cells: 20_000, steps: 2, ..SynthSpec::new(SeriesName::Dipole) }).unwrap();
        let dir = tempfile::tempdir().unwrap();
        let store = dir.path().join("dipole.zarr");
        ingest(&source, &store, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        let mut scene = Scene::open(&store).unwrap();
        scene.size_px = (96, 64);
        let frame = Picture::of(scene.render(0).unwrap(), [0.0; 3]);
        let look = scene.look.clone();
        let first = FirstPicture {
            look: Arc::new(move |_: &Series| Some(look.clone())),
            size_px: scene.size_px,
            background: [0.0; 3],
        };
        let raw = source.mesh().unwrap();
        let read = ReadMesh { source: &source, raw: &raw };
        for most in [20_000, 4_000] {
            let step = read.some_cells(None, most).unwrap();
            let picture = first.of(&step, &Cancel::new()).unwrap();
            assert_eq!(picture.size, frame.size);
            let [ours, theirs] = [&picture, &frame].map(|picture| means(&picture.pixels));
            println!("{most} cells: {ours:?}, all: {theirs:?}");
            // Gaps between ellipses and their overlaps make a dense volume less opaque.
            for (ours, theirs) in ours.into_iter().zip(theirs) {
                assert!((0.9 * theirs..=1.05 * theirs).contains(&ours), "{ours} {theirs}");
            }
        }
        let step = read.some_cells(None, 100).unwrap();
        let cancel = Cancel::new();
        cancel.cancel();
        assert!(first.of(&step, &cancel).is_none());
        let nothing = FirstPicture { look: Arc::new(|_: &Series| None), ..first };
        assert!(nothing.of(&step, &Cancel::new()).is_none());
    }
}
