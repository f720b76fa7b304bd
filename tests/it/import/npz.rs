//! Arrays of NumPy (`tests/interop/write_npz.py`).

use std::path::Path;
use tetreel::field::Component;
use tetreel::import;

#[test]
fn arrays_of_numpy_are_a_mesh_with_fields_at_all_steps() {
    for (name, times, cells) in
        [("stored.npz", &[0.25, 0.5, 2.0][..], 3), ("deflated.npz", &[0.25, 0.5, 2.0], 3), ("lists.npz", &[0.0], 2)]
    {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/npz").join(name);
        let source = import::open(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(source.times().values, times, "{name}");
        let mesh = source.mesh().expect("a mesh");
        assert_eq!((mesh.points.len(), mesh.cells.len()), (8, cells), "{name}");
        for step in 0..times.len() {
            let read = |name: &str, component: usize| {
                let field = source.fields().iter().find(|field| field.name == name).expect("a field");
                let mut values = Vec::new();
                source.read(field, Component::Index(component), step, &mut values).expect("values");
                values
            };
            assert_eq!(read("T", 0), (0..8).map(|i| (i + 100 * step) as f32).collect::<Vec<_>>(), "{name}");
            if cells == 3 {
                assert_eq!(read("U", 2), [step as f32; 8]);
                assert_eq!(read("on", 0), [0, 1, 2].map(|i| f32::from(u8::from((i + step) % 2 == 0))));
            }
        }
    }
}
