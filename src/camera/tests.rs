use super::*;
use glam::DVec2;
use proptest::prelude::*;

/// Rounding of a few operations on numbers of size one to four. Measured: 1.8e-15.
const ROUNDING: f64 = 1e-14;

fn camera() -> Camera {
    Camera {
        position: DVec3::new(0.0, -4.0, 0.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle: 90.0 },
        near: 0.0,
    }
}

fn corners(lo: DVec3, hi: DVec3) -> impl Iterator<Item = DVec3> {
    (0..8).map(move |i| {
        DVec3::new(
            if i & 1 == 0 { lo.x } else { hi.x },
            if i & 2 == 0 { lo.y } else { hi.y },
            if i & 4 == 0 { lo.z } else { hi.z },
        )
    })
}

/// Image-plane position of a world point.
fn project(view: &View, world: DVec3) -> (f64, f64) {
    let p = view.to_view(world);
    if view.perspective { (p.x / p.z, p.y / p.z) } else { (p.x, p.y) }
}

#[test]
fn the_frame_is_right_handed_with_x_right_y_up_and_w_forward() {
    let view = camera().view(20, 10).unwrap();
    assert_eq!((view.right, view.up, view.forward), (DVec3::X, DVec3::Z, DVec3::Y));
    assert!((view.half_height - 1.0).abs() < ROUNDING && (view.half_width - 2.0).abs() < ROUNDING);
    assert_eq!(view.to_view(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(1.0, 3.0, 6.0));
}

#[test]
fn row_zero_is_on_top_and_rays_pass_pixel_centres() {
    let view = camera().view(4, 2).unwrap();
    let (px, py) = view.ray(0, 0);
    assert!((px - -1.5).abs() < ROUNDING && (py - 0.5).abs() < ROUNDING);
    let (px, py) = view.ray(3, 1);
    assert!((px - 1.5).abs() < ROUNDING && (py - -0.5).abs() < ROUNDING);
    let (px, py) = camera().view(5, 3).unwrap().ray(2, 1);
    assert!(px.abs() < ROUNDING && py.abs() < ROUNDING);
}

#[test]
fn depth_is_stretched_along_oblique_perspective_rays_only() {
    let mut c = camera();
    assert_eq!(c.view(8, 8).unwrap().length_per_depth(2.0, 2.0), 3.0);
    c.projection = Projection::Parallel { scale: 2.5 };
    let view = c.view(8, 4).unwrap();
    assert_eq!((view.length_per_depth(2.0, 2.0), view.half_width, view.half_height), (1.0, 5.0, 2.5));
    assert_eq!(view.near, f64::NEG_INFINITY);
}

#[test]
fn an_up_along_the_view_is_replaced_always_by_the_same_axis() {
    let mut c = camera();
    c.view_up = DVec3::Y;
    assert_eq!(c.view(1, 1).unwrap().up, DVec3::Z);
    c.view_up = DVec3::ZERO;
    assert_eq!(c.view(1, 1).unwrap().up, DVec3::Z);
    c.position = DVec3::new(0.0, 0.0, 9.0);
    c.view_up = DVec3::Z;
    assert_eq!(c.view(1, 1).unwrap().up, DVec3::Y);
    c.view_up = DVec3::new(1e-12, 0.0, 1.0);
    assert_eq!(c.view(1, 1).unwrap().up, DVec3::Y);
}

#[test]
fn impossible_cameras_are_errors() {
    let fails = |change: fn(&mut Camera)| {
        let mut c = camera();
        change(&mut c);
        c.view(4, 4).unwrap_err()
    };
    assert_eq!(fails(|c| c.position = c.focal_point), CameraError::NoDirection);
    assert_eq!(fails(|c| c.position.x = f64::NAN), CameraError::NotFinite("position"));
    assert_eq!(fails(|c| c.view_up.x = f64::INFINITY), CameraError::NotFinite("up"));
    assert_eq!(fails(|c| c.near = f64::NAN), CameraError::NotFinite("near distance"));
    assert_eq!(fails(|c| c.near = -1.0), CameraError::BadNear(-1.0));
    for angle in [0.0, -1.0, 180.0, 1e9] {
        let mut c = camera();
        c.projection = Projection::Perspective { view_angle: angle };
        assert_eq!(c.view(4, 4), Err(CameraError::BadAngle(angle)));
    }
    assert!(matches!(
        fails(|c| c.projection = Projection::Perspective { view_angle: f64::NAN }),
        CameraError::BadAngle(_)
    ));
    assert_eq!(fails(|c| c.projection = Projection::Parallel { scale: 0.0 }), CameraError::BadScale(0.0));
    assert_eq!(camera().view(0, 4), Err(CameraError::NoPixels(0, 4)));
    assert!(camera().view(65_537, 65_535).is_ok());
    for (width, height) in [(65_536, 65_536), (usize::MAX, 2), (2, usize::MAX)] {
        assert_eq!(camera().view(width, height), Err(CameraError::TooManyPixels(width, height)));
    }
    assert_eq!(
        fails(|c| {
            c.position.x = -f64::MAX;
            c.focal_point.x = f64::MAX;
        }),
        CameraError::NotFinite("distance")
    );
}

#[test]
fn huge_offsets_keep_their_digits() {
    // At an offset of one million f32 fails at pixel scale, while f64 is exact if the eye is subtracted first.
    let offset = DVec3::new(1_048_576.0, -2_097_152.0, 4_194_304.0);
    let near_by = camera();
    let far_off = Camera { position: near_by.position + offset, focal_point: near_by.focal_point + offset, ..near_by };
    let (a, b) = (near_by.view(64, 64).unwrap(), far_off.view(64, 64).unwrap());
    let p = DVec3::new(0.25, -0.5, 0.125);
    assert_eq!(a.to_view(p), b.to_view(p + offset));
    assert_eq!(a.ray(3, 5), b.ray(3, 5));
}

#[test]
fn the_eye_is_subtracted_before_anything_is_rounded() {
    // At ten million, f32 has no fractional bits; f64 has 2^-29.
    let offset = DVec3::new(1e7, -1e7, 1e7);
    let near_by = camera();
    let far_off = Camera { position: near_by.position + offset, focal_point: near_by.focal_point + offset, ..near_by };
    let (a, b) = (near_by.view(64, 64).unwrap(), far_off.view(64, 64).unwrap());
    let p = DVec3::new(0.3, -0.6, 0.45);
    // Each coordinate of the eye and of the point is rounded by 2^-30 at most, and a direction within the view by as much.
    let bound = 16.0 * 2.0f64.powi(-30);
    assert!((a.to_view(p) - b.to_view(p + offset)).length() <= bound);
    // In f32 world coordinates, as in a naive vertex shader, the point jumps.
    let naive = (p + offset).as_vec3() - far_off.position.as_vec3();
    let exact = p - near_by.position;
    assert!((naive.as_dvec3() - exact).length() > 0.1, "{naive} instead of {exact}");
}

#[test]
fn the_default_camera_frames_boxes_of_any_shape_size_and_place() {
    let boxes = [
        (DVec3::splat(-1.0), DVec3::ONE),
        (DVec3::ZERO, DVec3::new(100.0, 1.0, 1.0)),
        (DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0)),
        (DVec3::new(0.0, 5.0, 0.0), DVec3::new(3.0, 5.0, 4.0)),
        (DVec3::splat(1e9), DVec3::splat(1e9 + 1.0)),
        (DVec3::splat(-1e-200), DVec3::splat(1e-200)),
        (DVec3::splat(-1e300), DVec3::splat(1e300)),
        (DVec3::splat(-1e-310), DVec3::splat(1e-310)),
    ];
    for (lo, hi) in boxes {
        let view = Camera::default_for((lo, hi)).unwrap().view(64, 64).unwrap();
        let mut reach: f64 = 0.0;
        for corner in corners(lo, hi) {
            let (px, py) = project(&view, corner);
            assert!(view.to_view(corner).z > 0.0, "{lo} {hi}: behind the eye");
            reach = reach.max(px.abs() / view.half_width).max(py.abs() / view.half_height);
        }
        assert!(reach <= 1.0, "{lo} {hi}: cut off at {reach}");
        assert!(reach > 0.4, "{lo} {hi}: lost in the image at {reach}");
    }
}

#[test]
fn a_box_of_size_zero_is_framed_also_far_from_the_origin() {
    for point in [DVec3::ZERO, DVec3::ONE, DVec3::splat(1e17), DVec3::new(0.0, 0.0, -1e-300)] {
        let view = Camera::default_for((point, point)).unwrap().view(8, 8).unwrap();
        let seen = view.to_view(point);
        assert!(seen.z > 0.0 && (seen.x / seen.z).abs() < ROUNDING && (seen.y / seen.z).abs() < ROUNDING);
    }
}

#[test]
fn bounds_and_directions_that_frame_nothing_are_errors() {
    let frame = |hi: DVec3, direction, angle| Camera::frame(DVec3::ZERO, hi, direction, DVec3::Z, angle);
    assert_eq!(frame(DVec3::NAN, DVec3::X, 30.0), Err(CameraError::NotFinite("bounds")));
    assert_eq!(frame(DVec3::ONE, DVec3::ZERO, 30.0), Err(CameraError::NoDirection));
    assert_eq!(frame(DVec3::ONE, DVec3::X, 190.0), Err(CameraError::BadAngle(190.0)));
    assert!(frame(DVec3::ONE, DVec3::Z, 30.0).is_ok(), "looking along up is allowed");
}

#[test]
fn a_narrow_image_still_shows_the_whole_sphere() {
    let (lo, hi) = (DVec3::splat(-1.0), DVec3::ONE);
    let perspective = Camera::default_for((lo, hi)).unwrap();
    let parallel = Camera { projection: Projection::Parallel { scale: 3.0_f64.sqrt() }, ..perspective };
    for c in [perspective, parallel] {
        let view = c.fit_to_aspect(100, 400).view(100, 400).unwrap();
        for corner in corners(lo, hi) {
            assert!(project(&view, corner).0.abs() <= view.half_width);
        }
        let unfitted = c.view(100, 400).unwrap();
        assert!(corners(lo, hi).any(|p| project(&unfitted, p).0.abs() > unfitted.half_width), "nothing to fit");
        assert_eq!(c.fit_to_aspect(400, 100), c);
    }
}

#[test]
fn a_positive_azimuth_takes_the_eye_to_its_right_and_elevation_lifts_it() {
    let quarter = camera().orbit(90.0, 0.0).unwrap();
    assert!(quarter.position.distance(DVec3::new(4.0, 0.0, 0.0)) < ROUNDING);
    let lifted = camera().orbit(0.0, 30.0).unwrap();
    let expected = DVec3::new(0.0, -4.0 * 30.0_f64.to_radians().cos(), 2.0);
    assert!(lifted.position.distance(expected) < ROUNDING);
}

#[test]
fn an_orbit_stops_before_the_pole_and_starts_on_it() {
    let mut c = camera();
    for _ in 0..10 {
        c = c.orbit(10.0, 30.0).unwrap();
    }
    assert!(c.position.z < 4.0 && c.position.z > 3.99);
    assert_eq!(c.view_up, DVec3::Z);
    let on_the_pole = Camera { position: DVec3::new(0.0, 0.0, 4.0), ..camera() };
    let moved = on_the_pole.orbit(90.0, 0.0).unwrap();
    assert!(moved.position.distance(DVec3::new(4.0, 0.0, 0.0)) < ROUNDING, "around +Y, the up of that view");
    assert!(camera().orbit(f64::NAN, 0.0).is_err());
}

#[test]
fn parts_of_the_text_that_are_missing_are_the_defaults() {
    let c = Camera::parse("pos=1,2,3", &camera()).unwrap();
    assert_eq!(c, Camera { position: DVec3::new(1.0, 2.0, 3.0), ..camera() });
    let c = Camera::parse("parallel=2.5 up=0,1,0.5", &camera()).unwrap();
    assert_eq!(c.projection, Projection::Parallel { scale: 2.5 });
    assert_eq!(Camera::parse("", &camera()), Ok(camera()));
}

#[test]
fn text_errors_name_the_part() {
    let cases = [
        ("pos=1,2", "pos=1,2"),
        ("pos=1,2,3 focal=a,0,0", "focal=a,0,0"),
        ("up=0,0,inf", "up=0,0,inf"),
        ("zoom=2", "zoom=2"),
        ("pos", "pos"),
        ("angle=30 parallel=2", "parallel=2"),
        ("near=1 near=2", "near=2"),
        ("pos=", "pos="),
    ];
    for (text, part) in cases {
        match Camera::parse(text, &camera()) {
            Err(CameraError::BadText { part: named, .. }) => assert_eq!(named, part),
            other => panic!("{text}: {other:?}"),
        }
    }
    assert_eq!(Camera::parse("angle=200", &camera()), Err(CameraError::BadAngle(200.0)));
    assert_eq!(Camera::parse("pos=0,0,0", &camera()), Err(CameraError::NoDirection));
}

fn numbers() -> impl Strategy<Value = DVec3> {
    let any = prop_oneof![-1e3..1e3, -1e-20..1e-20, -1e30..1e30];
    (any.clone(), any.clone(), any).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

proptest! {
    #[test]
    fn text_round_trips(position in numbers(), focal_point in numbers(), view_up in numbers(), v in 1e-3..179.0, near in 0.0..1e9) {
        for projection in [Projection::Perspective { view_angle: v }, Projection::Parallel { scale: v * 1e20 }] {
            let c = Camera { position, focal_point, view_up, projection, near };
            prop_assume!(position != focal_point);
            prop_assert_eq!(Camera::parse(&c.to_string(), &camera()), Ok(c));
        }
    }

    #[test]
    fn frames_are_orthonormal_and_look_at_the_focal_point(
        position in numbers(), focal_point in numbers(), view_up in numbers(),
    ) {
        let c = Camera { position, focal_point, view_up, ..camera() };
        prop_assume!(position != focal_point);
        let v = c.view(3, 3).unwrap();
        // A cross product of unit vectors at the smallest allowed sine keeps eight digits.
        for (a, b) in [(v.right, v.up), (v.up, v.forward), (v.forward, v.right)] {
            prop_assert!((a.length() - 1.0).abs() < ROUNDING && a.dot(b).abs() < 1e-7);
        }
        prop_assert!(v.right.cross(v.up).dot(v.forward) < -0.999, "right-handed world: right x up points backwards");
    }

    #[test]
    fn an_orbit_keeps_distance_and_turns_back(azimuth in -360.0..360.0, elevation in -40.0..40.0) {
        let there = camera().orbit(azimuth, elevation).unwrap();
        prop_assert!((there.position.length() - 4.0).abs() < ROUNDING);
        let back = there.orbit(-azimuth, -elevation).unwrap();
        prop_assert!(back.position.distance(camera().position) < ROUNDING);
    }
}

/// Oracle: column, row and plane index of the rendered pixels, tested one by one.
fn rendered_one_by_one(view: &View) -> Vec<(usize, usize, usize)> {
    let pixels = (0..view.height_px).flat_map(|row| (0..view.width_px).map(move |column| (column, row)));
    let rendered: Vec<_> = pixels.filter(|&(column, row)| view.renders(column, row)).collect();
    let places: Vec<usize> = match &view.samples {
        Samples::Lattice(_) => (0..rendered.len()).collect(),
        Samples::Pixels(set) => {
            let place = |pixel| (0..set.len()).find(|&place| set.pixel(place) == pixel).unwrap();
            rendered.iter().map(|&pixel| place(pixel)).collect()
        }
    };
    rendered.into_iter().zip(places).map(|((column, row), place)| (column, row, place)).collect()
}

#[test]
fn rows_of_a_view_have_its_pixels_at_their_places_in_the_plane() {
    let camera = Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap();
    let lattice = |stride| Samples::Lattice(Lattice::new(std::num::NonZeroUsize::new(stride).unwrap()));
    let listed = |pixels: &[u32]| Samples::Pixels(std::sync::Arc::new(PixelSet::new((11, 7), pixels).unwrap()));
    let all_samples = [lattice(1), lattice(3), lattice(4), lattice(100), listed(&[76, 0, 13, 12, 40]), listed(&[5])];
    for samples in all_samples {
        let view = View { samples, ..camera.view(11, 7).unwrap() };
        let expected = rendered_one_by_one(&view);
        let (columns, rows) = view.plane_px();
        assert_eq!(expected.len(), columns * rows);
        assert!(expected.iter().all(|&(column, row, place)| view.pixel_at(place) == (column, row)));
        for (from, to) in [(0, 11), (2, 9), (4, 4), (7, 8)] {
            for (first, end) in [(0, 7), (1, 4), (3, 3)] {
                let is_in = |&&(column, row, _): &&(usize, usize, usize)| {
                    (from..to).contains(&column) && (first..end).contains(&row)
                };
                let found: Vec<_> = (first..end)
                    .flat_map(|row| view.rendered_in(row, from..to).map(move |(column, place)| (column, row, place)))
                    .collect();
                assert_eq!(found, expected.iter().filter(is_in).copied().collect::<Vec<_>>(), "{:?}", view.samples);
                assert_eq!(view.renders_some_in(from..to, first..end), !found.is_empty());
            }
        }
        for places in [0..columns * rows, 0..1, columns * rows - 1..columns * rows, 0..0] {
            let rows = view.rows_of(places.clone());
            let of_places = expected.iter().filter(|(.., place)| places.contains(place));
            assert!(of_places.clone().all(|(_, row, _)| rows.contains(row)), "{places:?} of {:?}", view.samples);
            assert!(rows.len() <= view.height_px);
        }
    }
}

#[test]
fn a_plane_follows_the_mouse_along_its_normal() {
    let focal_point = DVec3::new(1.0, 2.0, 3.0);
    for projection in [Projection::Parallel { scale: 2.0 }, Projection::Perspective { view_angle: 40.0 }] {
        let position = focal_point + DVec3::new(0.0, -7.0, 0.0);
        let camera = Camera { position, focal_point, view_up: DVec3::Z, projection, near: 0.0 };
        let view = camera.view(100, 100).unwrap();
        let height = 2.0 * view.half_height * if view.perspective { 7.0 } else { 1.0 };
        // Movement to the right by a tenth of the height; the length of the normal does not matter.
        for (normal, by, expected) in [
            (DVec3::X, DVec2::new(0.1, 0.0), 0.1 * height),
            (DVec3::new(-5e200, 0.0, 0.0), DVec2::new(0.1, 0.05), -0.1 * height),
            (DVec3::Z, DVec2::new(0.3, 0.2), 0.2 * height),
            (DVec3::new(1.0, 0.0, 1.0), DVec2::new(0.1, 0.1), 0.1 * 2f64.sqrt() * height),
            // The plane faces the eye, which is at negative y: up is nearer.
            (DVec3::Y, DVec2::new(0.3, 0.2), -0.2 * height),
            (-DVec3::Y, DVec2::new(0.3, 0.2), 0.2 * height),
        ] {
            let found = camera.length_along(normal, by);
            assert!((found - expected).abs() < 1e-9 * height, "{normal} {by}: {found}, not {expected}");
        }
    }
}
