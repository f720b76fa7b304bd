//! Meshes of points: radii that are given or estimated, and what is left out.

use glam::DVec3;
use tetreel::mesh::{Cells, Mesh, MeshError, RawMesh};

/// The neighbour to which half the distance is the radius of a point without one.
const NEIGHBOUR: usize = 4;

fn cloud(points: Vec<DVec3>, radii: Vec<f64>) -> RawMesh {
    let cells = Cells { points: (0..points.len() as u32).collect(), radii, ..Cells::default() };
    RawMesh { points, cells }
}

fn scattered(count: usize, seed: u64) -> Vec<DVec3> {
    let mut random = tetreel::random::SplitMix64::new(seed);
    (0..count).map(|_| DVec3::from_array([(); 3].map(|()| random.between(-1.0, 1.0)))).collect()
}

#[test]
fn points_without_a_radius_and_named_again_are_left_out_and_counted() {
    let radii = vec![1.0, 0.0, -1.0, f64::NAN, f64::INFINITY, 0.5, 1e-300];
    let mut raw = cloud((0..7).map(|i| DVec3::new(f64::from(i), 5.0, 1e6)).collect(), radii);
    raw.cells.points.push(5);
    raw.cells.radii.push(2.0);
    raw.points.push(DVec3::NAN);
    let (mesh, report) = Mesh::build_cloud(&raw).unwrap();
    let found = report.cloud.unwrap();
    assert_eq!((report.cells_in, report.vertices_in, report.cells_out, report.vertices_out), (8, 8, 2, 2));
    assert_eq!((found.without_radius, report.duplicate_cells, report.unreferenced_vertices), (5, 1, 1));
    assert_eq!((found.radius, found.estimated), ([0.5, 1.0], false));
    let text = report.to_string();
    assert!(text.starts_with("2 points, radius 0.5 to 1\n") && text.contains("above zero dropped: 5"), "{text}");
    let radii = mesh.radii.as_ref().unwrap();
    for (vertex, &source) in mesh.vertex_source.iter().enumerate() {
        assert_eq!(mesh.positions.world(vertex), raw.points[source as usize]);
        assert_eq!(mesh.positions.scale * f64::from(radii[vertex]), raw.cells.radii[source as usize]);
        assert_eq!(mesh.topology.tets[vertex], [vertex as u32; 4]);
    }
    assert_eq!(mesh.vertex_source, mesh.cell_source);
    assert_eq!(mesh.frame(), (DVec3::new(-1.0, 4.0, 1e6 - 1.0), DVec3::new(5.5, 6.0, 1e6 + 1.0)));
    assert!(mesh.is_cloud() && !mesh.is_connected);
    let volume = mesh.total_volume() * mesh.positions.scale.powi(3);
    assert!((volume / (4.0 / 3.0 * std::f64::consts::PI * 1.125) - 1.0).abs() < 1e-12);
}

#[test]
fn points_without_a_volume_are_left_out_and_the_others_fill_their_balls_by_it() {
    let ball = |radius: f64| tetreel::mesh::ball_volume(radius);
    let volumes = vec![0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300, 1e300, 2.0 * ball(0.1), ball(0.2), 0.3 * ball(0.3)];
    let radii = vec![0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.2, 0.3];
    let mut raw = cloud(scattered(9, 5), radii.clone());
    raw.cells.volumes = volumes.clone();
    let (mesh, report) = Mesh::build_cloud(&raw).unwrap();
    let found = report.cloud.unwrap();
    assert_eq!((report.cells_out, found.without_radius, found.without_volume), (3, 0, 6));
    assert_eq!(found.volume, Some([volumes[6], volumes[8]]));
    let text = report.to_string();
    assert!(text.contains(", volume 0.008") && text.contains("without a volume above zero dropped: 6"), "{text}");
    for (point, &source) in mesh.cell_source.iter().enumerate() {
        // Radius and ratio are rounded to 24 bits once each; the radius counts three times.
        let [expected, found] =
            [volumes[source as usize], mesh.cell_volume(point as u32) * mesh.positions.scale.powi(3)];
        assert!((found / expected - 1.0).abs() < 2f64.powi(-24) + 1e-15, "{found} {expected}");
    }
    let whole = |volumes: &[f64]| volumes.iter().sum::<f64>();
    let total = mesh.total_volume() * mesh.positions.scale.powi(3);
    assert!((total / whole(&volumes[6..]) - 1.0).abs() < 1e-6);
    raw.cells.volumes.pop();
    assert!(matches!(Mesh::build_cloud(&raw).unwrap_err(), MeshError::WrongLength { array: "volumes", .. }));
    raw.cells.volumes = vec![0.0; 9];
    assert_eq!(Mesh::build_cloud(&raw).unwrap_err(), MeshError::NoVolumes(9));
    // Neither cubes nor ratios of sizes that f64 has leave it.
    for radius in [1e-150, 1e-38, 1e38, 1e150] {
        let mut raw = cloud(vec![DVec3::ZERO], vec![radius]);
        raw.cells.volumes = vec![1e-300f64.max(ball(radius)).min(1e300)];
        let expected = raw.cells.volumes[0] / ball(1.0) / radius / radius / radius;
        match Mesh::build_cloud(&raw) {
            Ok((mesh, _)) => assert!((mesh.filling_of(0) / expected - 1.0).abs() < 1e-6, "{radius}"),
            Err(error) => assert!((error, !(1e-45..1e38).contains(&expected)) == (MeshError::NoVolumes(1), true)),
        }
    }
}

#[test]
fn a_cloud_of_the_radii_that_are_kept_is_the_same_cloud() {
    for seed in 0..20 {
        let mut random = tetreel::random::SplitMix64::new(seed);
        let radii: Vec<f64> = (0..40).map(|_| random.between(0.01, 0.7)).collect();
        let mut raw = cloud(scattered(40, seed), radii.clone());
        raw.cells.volumes = radii.iter().map(|radius| 0.7 * radius * radius).collect();
        let (first, _) = Mesh::build_cloud(&raw).unwrap();
        let mut by_source: Vec<u32> = (0..40).collect();
        by_source.sort_by_key(|&point| first.cell_source[point as usize]);
        let of = |size: &dyn Fn(u32) -> f64| by_source.iter().map(|&point| size(point)).collect();
        let scale = first.positions.scale;
        raw.cells.radii = of(&|point| scale * f64::from(first.radii.as_ref().unwrap()[point as usize]));
        raw.cells.volumes = of(&|point| scale.powi(3) * first.cell_volume(point));
        assert_ne!(raw.cells.radii, radii);
        let (second, _) = Mesh::build_cloud(&raw).unwrap();
        let parts = |mesh: &Mesh| (mesh.positions.clone(), mesh.radii.clone(), mesh.filling.clone());
        assert!(parts(&first) == parts(&second), "seed {seed}");
    }
}

#[test]
fn estimated_radii_are_half_the_distance_to_the_fourth_nearest_by_a_naive_search() {
    for (points, unit) in [(scattered(300, 1), 1.0), (scattered(5, 2), 1e200), (scattered(3, 3), 1e-200)] {
        let points: Vec<DVec3> = points.into_iter().map(|p| unit * p).collect();
        let (mesh, report) = Mesh::build_cloud(&cloud(points.clone(), Vec::new())).unwrap();
        assert!(report.cloud.unwrap().estimated);
        for (vertex, &source) in mesh.vertex_source.iter().enumerate() {
            let at = points[source as usize];
            let mut distances: Vec<f64> = points.iter().map(|p| unit * ((*p - at) / unit).length()).collect();
            distances.sort_by(f64::total_cmp);
            let expected = 0.5 * distances[NEIGHBOUR.min(points.len() - 1)];
            let found = mesh.positions.scale * f64::from(mesh.radii.as_ref().unwrap()[vertex]);
            // Rounded to f32 once, after a handful of operations in f64.
            assert!((found / expected - 1.0).abs() < 2f64.powi(-24) + 1e-12, "{found} {expected}");
        }
    }
}

#[test]
fn coincident_single_and_extreme_points_are_no_panic() {
    let same = vec![DVec3::ONE; 20_000];
    assert_eq!(Mesh::build_cloud(&cloud(same.clone(), Vec::new())).unwrap_err(), MeshError::NoRadii(20_000));
    let (mesh, report) = Mesh::build_cloud(&cloud(same, vec![0.5; 20_000])).unwrap();
    assert_eq!((report.cells_out, mesh.positions.scale * f64::from(mesh.radii.unwrap()[0])), (20_000, 0.5));
    // Most at one place, of either sign of zero: their fourth neighbours are there, too.
    let mut mixed = [vec![DVec3::ZERO; 50], vec![-DVec3::ZERO; 50]].concat();
    mixed.extend(scattered(50, 4));
    let report = Mesh::build_cloud(&cloud(mixed, Vec::new())).unwrap().1;
    assert_eq!((report.cells_out, report.cloud.unwrap().without_radius), (50, 100));
    let one = Mesh::build_cloud(&cloud(vec![DVec3::ONE], Vec::new()));
    assert_eq!(one.unwrap_err(), MeshError::NoRadii(1));
    for radius in [1e-38, 1.0, 1e38, 1e300] {
        let (mesh, _) = Mesh::build_cloud(&cloud(vec![DVec3::ZERO], vec![radius])).unwrap();
        let found = mesh.positions.scale * f64::from(mesh.radii.unwrap()[0]);
        assert!((found / radius - 1.0).abs() <= 2f64.powi(-24), "{radius}");
    }
    // Far below f32 beside the other.
    let two = Mesh::build_cloud(&cloud(vec![DVec3::ZERO, DVec3::ONE], vec![1.0, 1e-60])).unwrap().1;
    assert_eq!(two.cloud.unwrap().without_radius, 1);
    assert!(matches!(
        Mesh::build_cloud(&cloud(vec![DVec3::ZERO], vec![f64::MAX])).unwrap_err(),
        MeshError::TooLarge(_)
    ));
    assert_eq!(Mesh::build_cloud(&RawMesh::default()).unwrap_err(), MeshError::NoCells);
    let far = RawMesh { points: vec![DVec3::INFINITY], ..cloud(vec![DVec3::ZERO], vec![1.0]) };
    assert!(matches!(Mesh::build_cloud(&far).unwrap_err(), MeshError::NotFinite { point: 0, .. }));
    let missing = RawMesh { points: Vec::new(), ..cloud(vec![DVec3::ZERO], vec![1.0]) };
    assert!(matches!(Mesh::build_cloud(&missing).unwrap_err(), MeshError::VertexOutOfRange { .. }));
}

#[test]
fn a_cloud_does_not_depend_on_the_number_of_threads() {
    let raw = cloud(scattered(5000, 8), Vec::new());
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (mesh, report) = pool.install(|| Mesh::build_cloud(&raw).unwrap());
        (mesh.positions, mesh.radii, mesh.vertex_source, report)
    };
    assert_eq!(on(1), on(3));
}
