//! Splats that are the volume.

use super::*;

/// The scene with kernels of the scalars of [`job`].
pub(super) fn with_kernels(scene: FlowScene, job: &RenderJob) -> FlowScene {
    let volumes = Arc::new(volumes_of_splats(&scene.mesh, scene.shapes.sites, None));
    let kernels = Kernels { scalars: job.scalars.clone(), table: job.table.clone(), volumes };
    let style = FlowStyle { volume: FlowVolume::Splats, ..scene.style };
    FlowScene { style, kernels: Some(kernels), ..scene }
}

#[test]
fn kernels_with_their_icons_agree_with_the_judge() {
    let mesh = mesh(4);
    for (fidelity, camera) in cameras(&mesh)
        .into_iter()
        .flat_map(|camera| [FlowFidelity::Smooth, FlowFidelity::Paper].map(|fidelity| (fidelity, camera)))
    {
        let job = job(&mesh, &camera, (40, 30));
        let view = job.local_view();
        // A vector of no length and one that is none have a kernel, a scalar that is none has nothing.
        let flow = |p: DVec3| if p.x > 0.5 { DVec3::ZERO } else { vortex(p) };
        let style = FlowStyle { fidelity, opacity: 0.9, ..FlowStyle::default() };
        let mut scene = with_kernels(scene(&mesh, style, flow), &job);
        let mut scalars = job.scalars.values().to_vec();
        scalars[40] = f32::NAN;
        let kernels = scene.kernels.take().unwrap();
        scene.kernels = Some(Kernels { scalars: crate::field::Scalars::Vertices(Arc::new(scalars)), ..kernels });
        let (found, counts) = scene.fragments(&view, None).unwrap();
        let (judged, judge_counts) = flow_fragments(&scene, &view).unwrap();
        assert!(counts.splats <= judge_counts.splats && judge_counts.splats < scene.sites().len() as u64);
        // Without cells: the image is that of the splats alone.
        let clear = RenderJob { table: Arc::new(NodeTable::transparent()), ..job.clone() };
        let [found, judged] = [found, judged].map(|all| image(&mut Raycast::new(), &clear, all));
        let apart = difference(&found, &judged);
        assert!(is_within(apart), "{fidelity}: {apart:?}");
        // A kernel that is not there is noticed.
        let less = FlowScene { kernels: None, ..scene };
        let other = image(&mut Raycast::new(), &clear, less.fragments(&view, None).unwrap().0);
        assert!(!is_within(difference(&other, &judged)));
    }
}

#[test]
fn kernels_of_a_constant_field_are_as_dark_as_its_cells() {
    let mesh = mesh(8);
    let node = Node { scalar: 0.0, rgb: [0.2, 0.5, 0.8], tau: 0.4 };
    let table = Arc::new(NodeTable::new(vec![node]).unwrap());
    let depths = |image: Vec<[f32; 4]>| -> Vec<f64> { image.iter().map(|p| -f64::from(-p[3]).ln_1p()).collect() };
    let [perspective, parallel, ..] = cameras(&mesh);
    for camera in [perspective, parallel] {
        let job = RenderJob { table: table.clone(), ..job(&mesh, &camera, (60, 60)) };
        let exact = depths(Raycast::new().render(job.clone()).unwrap().planes.color.pixels.clone());
        let clear = RenderJob { table: Arc::new(NodeTable::transparent()), ..job.clone() };
        let of = |fidelity: FlowFidelity| {
            let style = FlowStyle { fidelity, opacity: 0.0, ..FlowStyle::default() };
            let scene = with_kernels(scene(&mesh, style, vortex), &job);
            depths(image(&mut Raycast::new(), &clear, scene.fragments(&job.local_view(), None).unwrap().0))
        };
        let deepest = exact.iter().fold(0.0, |a: f64, &b| a.max(b));
        // Rays through the middle, away from the rim, over which kernels reach; and all rays.
        let inside = |i: &usize| exact[*i] > 0.5 * deepest;
        let ratio = |found: &[f64], which: &dyn Fn(&usize) -> bool| {
            let sum = |of: &[f64]| (0..of.len()).filter(which).map(|i| of[i]).sum::<f64>();
            sum(found) / sum(&exact)
        };
        let found = of(FlowFidelity::Smooth);
        let [middle, all] = [ratio(&found, &inside), ratio(&found, &|_| true)];
        assert!((middle - 1.0).abs() < 0.05 && (all - 1.0).abs() < 0.05, "{middle} {all}");
        // As printed, each kernel is a cloud of its own, however many there are.
        let printed = ratio(&of(FlowFidelity::Paper), &inside);
        assert!((printed - 1.0).abs() > 0.2, "{printed}");
    }
}
