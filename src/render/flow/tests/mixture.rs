//! Splats with several icons, and with the user's.

use super::*;
use crate::field::Scalars;
use crate::render::flow::picture::tests::waves;

fn picture() -> Pattern {
    Pattern::Picture(Arc::new(waves()))
}

/// Strokes, the user's waves and arrows, from these values on.
pub(super) fn icons([waves, arrows]: [f64; 2], fade: f64) -> FlowIcons {
    let further = vec![(waves, picture()), (arrows, Pattern::Icon(Icon::Arrows))];
    FlowIcons { icons: Thresholds { first: Pattern::Icon(Icon::Strokes), further }, by: None, fade }
}

/// The scene of a vortex with these icons, by its speed or by other values.
pub(super) fn with_icons(mesh: &Arc<Mesh>, icons: FlowIcons, values: Option<Vec<f32>>) -> FlowScene {
    let values = values.map(|values| Scalars::Vertices(Arc::new(values)));
    FlowScene { mixture: Some(Mixture { icons, values }), ..scene(mesh, FlowStyle::default(), vortex) }
}

fn alone(pattern: Pattern) -> FlowIcons {
    FlowIcons { icons: Thresholds { first: pattern, further: Vec::new() }, by: None, fade: 0.0 }
}

/// Whether the image of the fragments of `found` is that of the judge's of `judged`.
fn agree(mesh: &Arc<Mesh>, camera: &Camera, found: &FlowScene, judged: &FlowScene) -> bool {
    let job = job(mesh, camera, (40, 32));
    let view = job.local_view();
    let [(found, drawn), (judged, _)] = [found.fragments(&view, None).unwrap(), flow_fragments(judged, &view).unwrap()];
    assert!(drawn.splats > 5 && found.count() > 100, "{drawn:?} {}", found.count());
    let expected = image(&mut Reference::new(), &job, judged);
    is_within(difference(&image(&mut Raycast::new(), &job, found), &expected))
}

#[test]
fn several_icons_and_the_users_agree_with_the_judge() {
    let mesh = mesh(4);
    let plain = scene(&mesh, FlowStyle::default(), vortex);
    let mut speeds: Vec<f64> = plain.sites().into_iter().map(|site| plain.vector(site).length()).collect();
    speeds.sort_by(f64::total_cmp);
    // A third of the vertices is below the first threshold, another one between both.
    let [low, high] = [1, 2].map(|third| speeds[third * speeds.len() / 3]);
    let by = |low| with_icons(&mesh, icons([low, high], 0.6 * (high - low)), None);
    let by_speed = by(low);
    let mixes: Vec<_> = by_speed.sites().into_iter().filter_map(|vertex| by_speed.mix(vertex)).collect();
    for (icon, is_mixed) in [(0, true), (1, true), (2, false)] {
        assert!(mixes.iter().filter(|mix| mix.icon == icon && (mix.share > 0.0) == is_mixed).count() > 5);
    }
    let height = |(vertex, p): (usize, &glam::Vec3)| if vertex % 7 == 0 { f32::NAN } else { p.y };
    let heights = mesh.positions.local.iter().enumerate().map(height).collect();
    let by_height = with_icons(&mesh, icons([-0.2, 0.15], 0.0), Some(heights));
    let users = with_icons(&mesh, alone(picture()), None);
    let others = [
        by(0.9 * low + 0.1 * high),
        FlowScene { mixture: users.mixture.clone(), ..by_height.clone() },
        with_icons(&mesh, alone(Pattern::Icon(Icon::Lines)), None),
    ];
    for (number, camera) in cameras(&mesh).iter().enumerate() {
        for (scene, other) in [&by_speed, &by_height, &users].into_iter().zip(&others) {
            // One is held, with some patterns blurred over more than a period.
            let held = if number == 1 { HeldFlow { time: 7.0, shutter: 0.8 } } else { HeldFlow::default() };
            let [scene, other] = [scene, other].map(|scene| FlowScene { held, ..scene.clone() });
            assert!(agree(&mesh, camera, &scene, &scene), "{number}");
            assert!(!agree(&mesh, camera, &other, &scene), "{number}: another threshold or icon is noticed");
        }
    }
}

#[test]
fn one_generated_icon_has_its_bits_wherever_it_is_named_and_values_that_are_not_finite_have_no_splat() {
    let mesh = mesh(3);
    let view = local_view(&mesh, &camera(&mesh), (64, 48));
    let of = |scene: &FlowScene| scene.fragments(&view, None).unwrap();
    let style = FlowStyle { icon: Icon::Arrows, ..FlowStyle::default() };
    let (expected, counts) = of(&scene(&mesh, style, vortex));
    let arrows = Pattern::Icon(Icon::Arrows);
    let named = with_icons(&mesh, alone(arrows.clone()), None);
    assert!(of(&named).0 == expected);
    // Beyond all of the values, and below them.
    for (first, from, second) in [(arrows.clone(), 9.0, picture()), (picture(), -9.0, arrows)] {
        let icons = FlowIcons::new(Thresholds { first, further: vec![(from, second)] }, None, [0.0, 2.0]);
        assert!(of(&with_icons(&mesh, icons, None)).0 == expected, "{from}");
    }
    let heights = |bad: f32| mesh.positions.local.iter().map(|p| if p.x > 0.0 { bad } else { p.y }).collect();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let some = of(&with_icons(&mesh, icons([0.5, 1.0], 0.1), Some(heights(bad)))).1;
        assert!(some.splats > 10 && some.splats < counts.splats, "{some:?}");
    }
    assert_eq!(of(&with_icons(&mesh, icons([0.5, 1.0], 0.1), Some(heights(0.7)))).1.splats, counts.splats);
}

#[test]
fn opacity_stays_while_one_icon_goes_over_into_another() {
    let mesh = mesh(3);
    let view = local_view(&mesh, &camera(&mesh), (64, 48));
    let held = HeldFlow { time: 0.0, shutter: 1e9 };
    let further = vec![(0.7, Pattern::Icon(Icon::Lines))];
    let icons = Thresholds { first: Pattern::Icon(Icon::Particles), further };
    let scene = FlowScene { held, ..with_icons(&mesh, FlowIcons { icons, by: None, fade: 0.8 }, None) };
    let sums = [Icon::Particles, Icon::Lines].map(IconSums::of);
    let mut mixed = 0;
    for vertex in scene.sites() {
        let (Some(splat), Some(mix)) = (Splat::of(&scene, vertex, &view), scene.mix(vertex)) else { continue };
        let of = |row: i32| splat.across(f64::from(row) / 64.0).mixed([2.0, 1.0], 1.0, splat.icons_of(&sums));
        // Blurred over many periods, all rows together are the icons' mean.
        let mean = (0..64).map(of).sum::<f64>() / 64.0;
        // Sums in f32, as in icon.rs, mixed, and a product by the window.
        assert!((mean / (MEAN * f64::from(lanes::window(1.0))) - 1.0).abs() < 5e-7, "{mean}");
        mixed += u32::from(mix.share > 0.1 && mix.share < 0.9);
    }
    assert!(mixed > 10, "{mixed}");
}
