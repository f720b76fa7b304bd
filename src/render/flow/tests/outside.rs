//! Splats that hang out of the cells that are shown.

use super::kernels::with_kernels;
use super::*;
use crate::mesh::test_meshes::kuhn_grid_of;
use glam::DQuat;

/// Two parts, one with a hole through it.
pub(super) fn with_gaps() -> Arc<Mesh> {
    let keep = |[x, y, z]: [usize; 3]| x != 3 && !(x == 1 && y == 1) && [x, y, z] != [5, 0, 1];
    Arc::new(Mesh::build(jittered(kuhn_grid_of([6, 3, 3], keep), &mut Random::new(4))).unwrap().0)
}

/// The scene with these cells alone, and the splats at their vertices.
pub(super) fn of_cells(scene: FlowScene, keep: impl Fn(u32) -> bool + Sync) -> FlowScene {
    let cells = CellSet::of(scene.mesh.topology.tets.len(), |cell| keep(cell as u32));
    let mut shown = vec![false; scene.mesh.positions.local.len()];
    let tets = scene.mesh.topology.tets.iter().enumerate();
    for (_, tet) in tets.filter(|(cell, _)| cells.contains(*cell as u32)) {
        tet.iter().for_each(|&vertex| shown[vertex as usize] = true);
    }
    FlowScene { cells: Arc::new(cells), shown: Arc::new(shown), ..scene }
}

/// The scene with all fragments of its splats.
fn uncut(scene: &FlowScene, view: &View) -> FlowScene {
    let (width, height) = view.plane_px();
    FlowScene { inside: Some(Arc::new(Inside::everywhere(width * height))), ..scene.clone() }
}

/// Pixels in which one has a fragment that can be seen at a depth at which the other has none.
fn differing(a: &LayerFragments, b: &LayerFragments) -> usize {
    let has_all = |a: &LayerFragments, b: &LayerFragments, pixel| {
        let mut seen = a.of_pixel(pixel).iter().filter(|fragment| fragment.rgba[3] > 1e-3);
        // The judge's depths are rounded in another order.
        seen.all(|seen| b.of_pixel(pixel).iter().any(|other| (other.depth - seen.depth).abs() < 1e-9))
    };
    (0..a.pixels()).filter(|&pixel| !(has_all(a, b, pixel) && has_all(b, a, pixel))).count()
}

#[test]
fn what_is_left_out_is_what_the_judge_leaves_out() {
    for (mesh, number) in [mesh(3), with_gaps()].into_iter().zip(0..) {
        let (mut random, mut noticed) = (Random::new(20 + number), 0);
        for camera in cameras(&mesh) {
            let holes: Vec<bool> = mesh.topology.tets.iter().map(|_| random.below(8) == 0).collect();
            let all = scene(&mesh, FlowStyle::default(), vortex);
            let some = of_cells(all.clone(), |cell| !holes[cell as usize]);
            let middle = mesh.positions.origin;
            let normals = [DVec3::new(0.9, 0.3, -0.4), DVec3::new(-0.5, 0.1, 1.0)];
            let clip = |normal: DVec3| {
                Plane::new(&mesh.positions, middle + 0.3 * mesh.positions.scale * normal, normal).unwrap()
            };
            let clipped = FlowScene { clips: normals.map(clip).to_vec(), ..some.clone() };
            let job = job(&mesh, &camera, (40, 32));
            let view = job.local_view();
            for scene in [all, some, clipped] {
                let [(found, cut), (judged, asked)] =
                    [scene.fragments(&view, None).unwrap(), flow_fragments(&scene, &view).unwrap()];
                assert_eq!(differing(&found, &judged), 0, "mesh {number}");
                assert!(found.count() > 300 && cut.outside > 300, "{} {cut:?} {asked:?}", found.count());
                let expected = image(&mut Reference::new(), &job, judged.clone());
                let compared = difference(&image(&mut Raycast::new(), &job, found), &expected);
                assert!(is_within(compared), "mesh {number}: {compared:?}");
                assert!(differing(&uncut(&scene, &view).fragments(&view, None).unwrap().0, &judged) > 50);
                // One cell less is noticed, where it has fragments.
                let least = (0..).find(|&cell| scene.cells.contains(cell)).unwrap();
                let cells = CellSet::of(scene.cells.universe(), |cell| {
                    scene.cells.contains(cell as u32) && cell as u32 != least
                });
                let less = FlowScene { cells: Arc::new(cells), ..scene };
                noticed += differing(&less.fragments(&view, None).unwrap().0, &judged);
            }
        }
        assert!(noticed > 20, "{noticed}");
    }
}

#[test]
fn nothing_is_drawn_where_rays_miss_the_cells_whatever_the_volume_shows() {
    let mesh = with_gaps();
    for camera in cameras(&mesh) {
        let node = Node { scalar: 0.0, rgb: [1.0; 3], tau: 1e3 };
        let table = Arc::new(NodeTable::new(vec![node]).unwrap());
        let job = RenderJob { table, ..job(&mesh, &camera, (60, 48)) };
        let dark = Reference::new().render(job.clone()).unwrap().planes.color.pixels.clone();
        let (scene, view) = (scene(&mesh, FlowStyle { size: 1.0, ..FlowStyle::default() }, vortex), job.local_view());
        let [cut, uncut] = [&scene, &uncut(&scene, &view)].map(|scene| scene.fragments(&view, None).unwrap().0);
        let missing = (0..dark.len()).filter(|&pixel| dark[pixel][3] == 0.0);
        let count = |of: &LayerFragments| missing.clone().map(|pixel| of.of_pixel(pixel).len()).sum::<usize>();
        assert_eq!(count(&cut), 0);
        assert!(cut.count() > 1000 && (missing.clone().count() == 0 || count(&uncut) > 100), "{}", count(&uncut));
    }
}

#[test]
fn what_is_inside_keeps_its_bits_and_kernels_keep_all() {
    let mesh = mesh(6);
    for camera in cameras(&mesh) {
        let (all, job) = (scene(&mesh, FlowStyle::default(), vortex), job(&mesh, &camera, (40, 32)));
        let view = job.local_view();
        let cut_and_uncut =
            |scene: &FlowScene| [scene, &uncut(scene, &view)].map(|scene| scene.fragments(&view, None).unwrap());
        let [(cut, counts), (whole, uncounted)] = cut_and_uncut(&all);
        assert!(counts.outside > 0 && uncounted.outside == 0 && counts.splats == uncounted.splats);
        assert_eq!(cut.count() as u64 + counts.outside, whole.count() as u64);
        for pixel in 0..cut.pixels() {
            let mut rest = whole.of_pixel(pixel).iter();
            assert!(cut.of_pixel(pixel).iter().all(|kept| rest.any(|fragment| fragment == kept)));
        }
        // Small splats near the middle of a mesh that is 1.5 wide.
        let is_middle = |vertex: &u32| mesh.positions.local[*vertex as usize].abs().max_element() < 0.3;
        let chosen = Some(Arc::new(all.sites().into_iter().filter(is_middle).collect()));
        let middle = FlowScene { chosen, style: FlowStyle { size: 0.2, ..all.style }, ..all.clone() };
        let [(cut, counts), (whole, _)] = cut_and_uncut(&middle);
        assert!(counts.outside == 0 && cut == whole && cut.count() > 100, "{counts:?} {}", cut.count());
        let kernels = with_kernels(all, &job);
        let [(cut, counts), (whole, _)] = cut_and_uncut(&kernels);
        assert!(counts.outside == 0 && cut == whole);
        assert_eq!(flow_fragments(&kernels, &view).unwrap().1.outside, 0);
    }
}

#[test]
fn splats_on_a_boundary_that_faces_the_viewer_are_whole() {
    let mut off_by_rounding = 0;
    for turn in 0..8 {
        let by = DQuat::from_axis_angle(DVec3::new(0.3, 0.8, -0.5).normalize(), 0.37 + f64::from(turn));
        let mut raw = kuhn_grid([6, 6, 2]);
        raw.points.iter_mut().for_each(|point| *point = by * *point);
        let mesh = Arc::new(Mesh::build(raw).unwrap().0);
        // In the middle of the side at z = 2, or of that at z = 0, which is seen from behind.
        let level = f64::from(2 * (turn % 2));
        let in_file = |vertex: &u32| {
            let Mesh { positions, .. } = &*mesh;
            let local = positions.local[*vertex as usize].as_dvec3();
            by.inverse() * (positions.origin + positions.scale * local)
        };
        let is_on = |vertex: &u32| {
            let DVec3 { x, y, z } = in_file(vertex);
            (z - level).abs() < 1e-3 && (x - 3.0).abs() < 1.5 && (y - 3.0).abs() < 1.5
        };
        let focal_point = by * DVec3::new(3.0, 3.0, 1.0);
        for projection in [Projection::Perspective { view_angle: 40.0 }, Projection::Parallel { scale: 4.0 }] {
            let position = focal_point + 10.0 * (by * DVec3::Z);
            let camera = Camera { position, focal_point, view_up: by * DVec3::Y, projection, near: 0.0 };
            let view = local_view(&mesh, &camera, (60, 60));
            let all = scene(&mesh, FlowStyle { size: 0.3, ..FlowStyle::default() }, |_| by * DVec3::new(1.0, 0.5, 0.0));
            let chosen: Vec<u32> = all.sites().into_iter().filter(is_on).collect();
            assert_eq!(chosen.len(), 9);
            let scene = FlowScene { chosen: Some(Arc::new(chosen)), ..all };
            let (found, counts) = scene.fragments(&view, None).unwrap();
            assert!(counts.splats == 9 && counts.outside == 0 && found.count() > 300, "{counts:?}");
            let of = (&scene.mesh, &scene.cells);
            let exact = InsideFinder::default().find(of, &[], 0.0, &view, &Cancel::new());
            off_by_rounding += FlowScene { inside: exact, ..scene }.fragments(&view, None).unwrap().1.outside;
        }
    }
    assert!(off_by_rounding > 100, "{off_by_rounding}");
}
