//! Series of any shape, with any names and any values, through a store and back.

use super::{Formulas, dirty_grid, field, import};
use crate::meshes::noise;
use proptest::prelude::*;
use tetreel::field::{Association, FieldInfo, TimeAxis};
use tetreel::ingest::{IngestOptions, StepRange};
use tetreel::store::Store;

/// Bits of every kind of number.
const KINDS: [u32; 9] = [
    0x7fc0_1234,
    0xff80_0000,
    0x7f80_0000,
    0x0000_0001,
    0x8000_0000,
    0x807f_ffff,
    0x7f7f_ffff,
    0x3f80_0001,
    0xc2f6_e979,
];

/// The value of a field: a number of any kind, or any number at all.
fn value(seed: u64, name: &str, component: usize, step: usize, index: usize) -> f32 {
    let name: u64 = name.bytes().map(u64::from).sum();
    let at = (index + 1000 * (step + 100 * component)) as u64;
    let drawn = noise(seed ^ name, at);
    if drawn > 0.8 { f32::from_bits(KINDS[at as usize % KINDS.len()]) } else { (drawn * 1e3) as f32 }
}

/// Names of fields as files have them, and as they should not.
fn names() -> impl Strategy<Value = String> {
    prop_oneof![
        "[a-zA-Z0-9_]{1,8}",
        "\\PC{1,12}",
        Just("zarr.json".to_owned()),
        Just("..".to_owned()),
        Just("a/b".to_owned())
    ]
}

fn series() -> impl Strategy<Value = (u32, Vec<FieldInfo>, Vec<f64>, u64)> {
    let components = prop::collection::vec((names(), 1_usize..4), 1..4);
    let times = prop::collection::vec(-1e6..1e6_f64, 1..6);
    (1_u32..4, components, times, any::<u64>()).prop_map(|(n, fields, mut times, seed)| {
        times.sort_by(f64::total_cmp);
        times.dedup();
        let mut fields: Vec<FieldInfo> =
            fields.iter().map(|(name, components)| field(name, *components, Association::Point)).collect();
        // Names with a colon and a number may be those of components of another field.
        fields.retain(|field| !field.name.contains(':') && !field.name.trim().is_empty());
        fields.sort_by(|a, b| a.name.cmp(&b.name));
        fields.dedup_by(|a, b| a.name == b.name);
        (n, fields, times, seed)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_series_comes_back_bit_for_bit((n, fields, times, seed) in series(), stride in 1_usize..3) {
        prop_assume!(!fields.is_empty());
        let source = Formulas {
            mesh: dirty_grid(n),
            times: TimeAxis { values: times.clone() },
            fields: fields.clone(),
            value: Box::new(move |name, component, step, index| value(seed, name, component, step, index)),
            fail_at: None,
            cancel_at: None,
            long_at: None,
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.zarr");
        let options = IngestOptions { steps: StepRange { first: 0, last: None, stride }, ..Default::default() };
        import(&source, &path, &options).unwrap();
        let store = Store::open(&path).unwrap();
        let mesh = store.mesh().unwrap();
        let kept: Vec<usize> = (0..times.len()).step_by(stride).collect();
        let read: Vec<u64> = store.times().values.iter().map(|t| t.to_bits()).collect();
        prop_assert_eq!(read, kept.iter().map(|&step| times[step].to_bits()).collect::<Vec<_>>());
        let mut nothing = true;
        for field in &fields {
            for component in 0..field.components {
                let name = if field.components == 1 { field.name.clone() } else { format!("{}:{component}", field.name) };
                let reader = store.field(&name.parse().unwrap()).unwrap();
                prop_assert_eq!(&reader.info().name, &name);
                let mut out = vec![0.0; reader.value_count()];
                for (step, &of_source) in kept.iter().enumerate() {
                    reader.decode_step(step, &mut out).unwrap();
                    for (got, &vertex) in out.iter().zip(&mesh.vertex_source) {
                        let expected = value(seed, &field.name, component, of_source, vertex as usize);
                        prop_assert_eq!(got.to_bits(), expected.to_bits(), "{}, step {}", name, step);
                        nothing &= got.to_bits() == value(seed ^ 1, &field.name, component, of_source, vertex as usize).to_bits();
                    }
                }
            }
        }
        prop_assert!(!nothing, "values of another seed would be noticed");
    }
}
