//! A series for a reader beside its player.
//!
//! Thumbnails, curves and surveys read steps in an order of their own. Through the player's blocks they would evict blocks about to be
//! shown and read ahead steps that nobody plays. So they have blocks of their own, and use the player's where these are in memory.

use super::series::{Series, StepSource};
use crate::codec::vq::VqBlock;
use crate::codec::{BlockCache, DecodeStats, StepRequest};
use crate::error::FileResult;
use crate::histograms::Counted;
use crate::mesh::Mesh;
use crate::store::FieldReader;
use crate::task::Cancel;
use std::sync::Arc;

/// Source of a player's steps for a reader beside the player.
struct Apart {
    player: Arc<Series>,
    own: Box<dyn StepSource>,
}

impl Apart {
    /// The source that gives a step without loading anything into the player's blocks.
    fn source(&self, step: usize) -> &dyn StepSource {
        if self.player.is_resident(step) { &*self.player.source } else { &*self.own }
    }
}

impl StepSource for Apart {
    fn decode_step(&self, request: StepRequest<'_>, out: &mut [f32]) -> FileResult<Option<DecodeStats>> {
        self.source(request.step).decode_step(request, out)
    }

    fn vq_block(&self, step: usize) -> FileResult<Option<Arc<VqBlock>>> {
        self.source(step).vq_block(step)
    }

    fn expect(&self, upcoming: &[usize]) {
        self.own.expect(upcoming);
    }

    fn prefetch(&self, cancel: &Cancel) -> FileResult<bool> {
        self.own.prefetch(cancel)
    }

    fn is_resident(&self, step: usize) -> bool {
        self.player.is_resident(step) || self.own.is_resident(step)
    }

    fn reader(&self) -> Option<&FieldReader> {
        self.own.reader()
    }

    fn go_on_counting(
        &self,
        counted: &mut Option<Counted>,
        mesh: &Mesh,
        cancel: &Cancel,
        told: &mut dyn FnMut(&Counted) -> bool,
    ) -> FileResult<bool> {
        self.own.go_on_counting(counted, mesh, cancel, told)
    }

    fn with_blocks(&self, blocks: Arc<BlockCache>) -> Box<dyn StepSource> {
        Box::new(Self { player: self.player.clone(), own: self.own.with_blocks(blocks) })
    }
}

impl Series {
    /// The same series for a reader beside its player: it uses blocks that the player has in memory, and loads others into `block_bytes` of
    /// its own. Steps that it is told to expect do not reach the player either. Data that do not change over time are computed once for
    /// both.
    #[must_use]
    pub fn apart(self: &Arc<Self>, block_bytes: u64) -> Arc<Self> {
        let blocks = Arc::new(BlockCache::new(block_bytes));
        let own = self.source.with_blocks(blocks.clone());
        let source = Box::new(Apart { player: self.clone(), own });
        Arc::new(Self {
            mesh: self.mesh.clone(),
            times: self.times.clone(),
            field: self.field.clone(),
            source,
            blocks,
            rankings: Default::default(),
            ranges: Default::default(),
            quantities: self.quantities.clone(),
            beside: self.beside.of_the_same_store(),
            functions: self.functions.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::vq::VqOptions;
    use crate::field::FieldSelector;
    use crate::ingest::{CodecChoice, IngestOptions, ingest};
    use crate::store::Store;
    use crate::synth::{SeriesName, SynthSpec, generate};
    use crate::task::Silent;

    /// 70 steps: two blocks of codec `vq`.
    fn stored(codec: CodecChoice) -> (tempfile::TempDir, Store) {
        let dir = tempfile::tempdir().unwrap();
        let source = generate(&SynthSpec { cells: 600, steps: 70, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
        let path = dir.path().join("tornado.zarr");
        ingest(&source, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
        (dir, Store::open(path).unwrap())
    }

    fn vq() -> CodecChoice {
        CodecChoice::new(VqOptions { entries: 16, ..VqOptions::default() })
    }

    fn decoded(series: &Series, step: usize) -> Vec<f32> {
        let mut out = vec![0.0; series.scalar_count()];
        assert!(series.decode_step(step, &mut out, &Cancel::new()).unwrap());
        out
    }

    #[test]
    fn steps_are_the_same_for_every_field_magnitudes_included() {
        for codec in [CodecChoice::default(), vq()] {
            let (_dir, store) = stored(codec);
            let mut magnitudes = 0;
            for field in store.fields() {
                magnitudes += usize::from(!field.magnitude_of.is_empty());
                let selector: FieldSelector = field.name.parse().unwrap();
                let series = Arc::new(Series::open(&store, Some(&selector)).unwrap());
                let apart = series.apart(1 << 20);
                for step in [0, 1, 40, 63, 64, 69] {
                    assert_eq!(decoded(&apart, step), decoded(&series, step), "{} {step}", field.name);
                }
                assert_ne!(decoded(&apart, 0), decoded(&series, 69), "the test can fail");
            }
            assert!(magnitudes > 0);
        }
    }

    #[test]
    fn nothing_is_loaded_into_the_blocks_of_the_player_and_what_is_there_is_used() {
        let (_dir, store) = stored(vq());
        let series = Arc::new(Series::open(&store, None).unwrap());
        let loads = |series: &Series| series.blocks().statistics().loads;
        let apart = series.apart(1 << 20);
        decoded(&apart, 2);
        decoded(&apart, 69);
        assert_eq!(loads(&series), 0);
        let for_both_blocks = loads(&apart);
        assert!(for_both_blocks >= 2 && apart.is_resident(2) && !series.is_resident(2));
        decoded(&series, 2);
        let other = series.apart(1 << 20);
        decoded(&other, 2);
        assert!(other.is_resident(2) && !other.is_resident(69));
        assert_eq!((loads(&series), loads(&other)), (for_both_blocks / 2, 0));
    }
}
