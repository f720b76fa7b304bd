//! Generated series across modules: exported as `.vtu` files and looked at as another program would.

use tetreel::export::vtu::{VtuOptions, write_series};
use tetreel::field::SeriesSource as _;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

#[test]
fn every_series_is_exported_with_its_own_times_and_the_size_that_its_arrays_need() {
    let temp = tempfile::tempdir().unwrap();
    for name in SeriesName::ALL {
        let series = generate(&SynthSpec { cells: 1000, steps: 3, ..SynthSpec::new(name) }).unwrap();
        let dir = temp.path().join(name.as_str());
        let report = write_series(&series, &dir, &VtuOptions::default(), &Silent, &Cancel::new()).unwrap();
        let pvd = std::fs::read_to_string(&report.pvd).unwrap();
        let times: Vec<f64> =
            pvd.split("timestep=\"").skip(1).map(|rest| rest.split('"').next().unwrap().parse().unwrap()).collect();
        assert_eq!(times, series.times().values, "{name}");

        let components: usize = series.fields().iter().map(|f| f.components).sum();
        let (points, cells) = (series.vertex_count(), series.cell_count() as usize);
        // Values f32; coordinates f64; connectivity and offsets i64; a type byte.
        let arrays = points * (4 * components + 3 * 8) + cells * (5 * 8 + 1);
        let size = std::fs::metadata(dir.join(format!("{name}_0002.vtu"))).unwrap().len() as usize;
        // The head and the block sizes are below 4 KiB.
        assert!((arrays..arrays + 4096).contains(&size), "{name}: {size} for {arrays}");
    }
}
