//! Shadow maps of the CPU renderer against rays cast in f64, of the Vulkan renderer against the CPU's; what they cost, and what
//! scenes without shadows cost nothing.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_render::commands::{Command, RecordOptions, record};
use choreo_render::plan::Features;
use choreo_render::*;
use choreo_stage::*;
use glam::{Affine3A, DAffine3, DQuat, DVec3, Vec3, Vec4};

fn record_of(plan: &Plan) -> commands::Recording {
    record(plan, RecordOptions::default(), |_| 2)
}

fn white_material() -> Material {
    Material { specular: 0.0, ..matte(Vec4::ONE) }
}

fn flat_on_the_floor() -> DAffine3 {
    DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2)
}

/// The square that casts the shadow: half its side, its center, and its rotation about the vertical.
const BLOCKER: (f64, DVec3, f64) = (0.6, DVec3::new(0.1, 1.0, -0.2), 0.4);

/// A floor 8 m wide, seen vertically from above, and a horizontal square over it.
fn floor_and_square() -> Scene {
    let from_above = CameraState {
        camera: None,
        world_from_view: DAffine3::from_rotation_translation(
            DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2),
            DVec3::new(0.0, 10.0, 0.0),
        ),
        projection: Projection::Orthographic { height: 4.0, near: 0.1, far: 100.0 },
    };
    let mut scene = Scene::with_camera(from_above);
    scene.add(&asset(vec![quad(4.0, 4.0)], vec![white_material()], vec![]), flat_on_the_floor());
    let (half, middle, turn) = BLOCKER;
    let square = asset(vec![quad(half as f32, half as f32)], vec![white_material()], vec![]);
    scene.add(
        &square,
        DAffine3::from_translation(middle) * DAffine3::from_rotation_y(turn) * flat_on_the_floor(),
    );
    scene
}

fn add_shadow_light(scene: &mut Scene, light: Light, position: DVec3, direction: DVec3, shadow: Shadow) {
    let direction = direction.normalize().as_vec3();
    scene.snapshot.lights.push(LightState {
        light,
        position,
        direction,
        shadow: Some(shadow),
        attenuation: None,
    });
}

fn white_light(kind: LightKind, intensity: f32) -> Light {
    Light { kind, color: Vec3::ONE, intensity, range: None }
}

/// Distance in metres, in the square's plane, by which the ray from a point of the floor to the light passes inside the square's edge;
/// negative if it passes outside.
fn depth_inside_square(floor: DVec3, to_light: DVec3) -> f64 {
    let (half, middle, turn) = BLOCKER;
    let hit = floor + to_light * (middle.y / to_light.y);
    let local = DQuat::from_rotation_y(-turn) * (hit - middle);
    half - local.x.abs().max(local.z.abs())
}

/// Largest difference to cast rays that pass farther than `band` from the shadow's edge, and the share of the floor in shadow.
/// `to_light`: direction from a point of the floor to the light.
fn compare_with_rays(
    frame: &choreo_plugin::Frame,
    band: f64,
    to_light: impl Fn(DVec3) -> DVec3,
    lit: impl Fn(DVec3) -> f64,
) -> (f64, usize) {
    let (n, mut worst, mut dark) = (frame.width, 0.0f64, 0);
    for y in 0..n {
        for x in 0..n {
            let metres = |p: u32| (f64::from(p) + 0.5) / f64::from(n) * 4.0 - 2.0;
            let floor = DVec3::new(metres(x), 0.0, metres(y));
            let (half, middle, turn) = BLOCKER;
            let under = DQuat::from_rotation_y(-turn) * (floor - middle);
            // Pixels that show the square are skipped.
            if under.x.abs().max(under.z.abs()) < half + 0.02 {
                continue;
            }
            let depth = depth_inside_square(floor, to_light(floor));
            dark += usize::from(depth > band);
            if depth.abs() > band {
                let expected = if depth > 0.0 { 0.0 } else { lit(floor) };
                worst = worst.max((decode(pixel(frame, x, y)[0]) - expected).abs());
            }
        }
    }
    (worst, dark)
}

#[test]
fn sun_shadows_match_cast_rays() {
    let direction = DVec3::new(-0.5, -1.0, -0.3).normalize();
    let nl = -direction.y;
    for (size, softness) in [(2048, 0.0), (512, 0.0), (2048, 0.05), (256, 0.1)] {
        let mut scene = floor_and_square();
        let sun = white_light(LightKind::Directional, 0.8);
        add_shadow_light(&mut scene, sun, DVec3::ZERO, direction, Shadow { size, softness: Some(softness) });
        let (_, plan) = scene.plan(&PlanOptions::new([160, 160], 1));
        let texel = f64::from(plan.shadow_maps.as_ref().unwrap().views[0].texel);
        let frame = draw_at(&scene, [160, 160], 1);
        // Half the filter and a texel's diagonal, projected to the inclined plane.
        let band = 3.0 * texel / nl + 1e-3;
        let (worst, dark) = compare_with_rays(&frame, band, |_| -direction, |_| 0.8 * nl);
        println!(
            "sun, {size} texels, {softness} m: texel {texel:.4} m, worst {worst:.4} beyond {band:.3} m, {dark} dark"
        );
        assert!(worst < 0.01 && dark > 300, "{size} {softness}: {worst}, {dark} dark");
        // The comparison fails with the rays of another sun.
        let other = DQuat::from_rotation_y(0.5) * -direction;
        assert!(compare_with_rays(&frame, band, |_| other, |_| 0.8 * nl).0 > 0.5);
    }
}

/// A floor under a roof, seen from below the roof, over the depth of several shadow cascades.
fn floor_under_a_roof() -> (Scene, usize) {
    let camera = CameraState {
        camera: None,
        world_from_view: DAffine3::from_rotation_translation(
            // The camera is rolled, so that seams of cascades cross the quads of pixels that are looked up together.
            DQuat::from_rotation_x(-0.3) * DQuat::from_rotation_z(0.4),
            DVec3::new(0.0, 1.5, 0.0),
        ),
        projection: Projection::Perspective { yfov: 0.6, near: 0.05, far: None },
    };
    let mut scene = Scene::with_camera(camera);
    let level = |half: f32| asset(vec![quad(half, half)], vec![white_material()], vec![]);
    scene.add(&level(200.0), flat_on_the_floor());
    let roof = scene.add(&level(400.0), DAffine3::from_translation(DVec3::Y * 3.0) * flat_on_the_floor());
    scene.sun(Vec3::new(-0.1, -1.0, 0.05), Vec3::ONE, 0.7);
    scene.snapshot.lights[0].shadow = Some(Shadow::default());
    (scene, roof)
}

/// A pixel outside of one cascade is looked up in the next one, whichever cascade its neighbors use.
fn check_no_light_under_a_roof(draw: &mut dyn FnMut(&Scene) -> choreo_plugin::Frame) {
    let (mut scene, roof) = floor_under_a_roof();
    let (_, plan) = scene.plan(&PlanOptions::new([160, 120], 1));
    let maps = plan.shadow_maps.as_ref().unwrap().views.len();
    assert!(maps > 1, "{maps} map has no seam");
    let lit = |frame: &choreo_plugin::Frame| frame.rgba.chunks_exact(4).filter(|p| p[0] > 0).count();
    assert_eq!(lit(&draw(&scene)), 0, "pixels under the roof that light reaches");
    scene.snapshot.actors[roof].visible = false;
    assert!(lit(&draw(&scene)) > 10_000, "without the roof light reaches the floor");
}

#[test]
fn no_light_leaks_at_the_seams_of_cascades() {
    check_no_light_under_a_roof(&mut |scene| draw_at(scene, [160, 120], 1));
    let Some(mut r) = vulkan(GpuOptions::default()) else { return };
    check_no_light_under_a_roof(&mut |scene| draw_with(&mut r, scene, &PlanOptions::new([160, 120], 1)));
}

#[test]
fn point_and_spot_shadows_match_cast_rays() {
    let at = DVec3::new(0.8, 2.5, 0.5);
    let lit = |floor: DVec3| {
        let way = at - floor;
        4.0 * (way.y / way.length()) / way.length_squared()
    };
    let cone = LightKind::Spot { inner: 1.0, outer: 1.04 };
    for (kind, what) in [(cone, "spot"), (LightKind::Point, "point")] {
        let mut scene = floor_and_square();
        let shadow = Shadow { size: 1024, softness: Some(0.0) };
        add_shadow_light(&mut scene, white_light(kind, 4.0), at, DVec3::NEG_Y, shadow);
        let (_, plan) = scene.plan(&PlanOptions::new([160, 160], 1));
        let shadows = plan.shadow_maps.as_ref().unwrap();
        let texel = f64::from(shadows.views[0].texel) * at.y;
        let frame = draw_at(&scene, [160, 160], 1);
        let inside_cone = |floor: DVec3| ((at - floor).normalize().y.acos()) < 0.98;
        let lit = |floor: DVec3| if inside_cone(floor) || what == "point" { lit(floor) } else { f64::NAN };
        let (worst, dark) = compare_with_rays(&frame, 4.0 * texel, |floor| at - floor, lit);
        println!("{what}: {} maps, texel {texel:.4} m, worst {worst:.4}, {dark} dark", shadows.views.len());
        assert!(worst < 0.012 && dark > 300, "{what}: {worst}, {dark} dark");
        let moved = at + DVec3::new(-1.0, 0.0, 0.0);
        assert!(compare_with_rays(&frame, 4.0 * texel, |floor| moved - floor, lit).0 > 0.2);
    }
}

/// A bulge on a floor under an inclined light: lit surfaces must not shadow themselves.
fn bulge_on_floor(shadow: Option<Shadow>) -> Scene {
    let mut scene = Scene::perspective(0.8, 5.0);
    scene.snapshot.camera.world_from_view =
        DAffine3::from_rotation_translation(DQuat::from_rotation_x(-0.5), DVec3::new(0.0, 2.6, 4.2));
    scene.add(&asset(vec![quad(3.0, 3.0)], vec![white_material()], vec![]), flat_on_the_floor());
    let toon = Material {
        shading: Shading::Toon,
        toon: Some(Toon { shade_color: Vec3::new(0.3, 0.2, 0.4), ..Toon::default() }.into()),
        ..matte(Vec4::new(0.9, 0.7, 0.6, 1.0))
    };
    let phong =
        Material { shading: Shading::BlinnPhong, shininess: 20.0, ..matte(Vec4::new(0.5, 0.6, 0.9, 1.0)) };
    let leaf = image(16, 16, |x, y| [40, 160, 60, if (x / 4 + y / 4) % 2 == 0 { 255 } else { 0 }]);
    let holes = Material {
        alpha_mode: AlphaMode::Mask(0.5),
        double_sided: true,
        base_color_texture: Some(texture(0)),
        ..white_material()
    };
    let coat =
        layered::layered(MaterialLayers { clearcoat: 1.0, ..MaterialLayers::default() }, white_material());
    for (i, material) in [white_material(), toon, phong, holes, coat].into_iter().enumerate() {
        let a = asset(vec![layered::bulge(0.4)], vec![material], vec![leaf.clone()]);
        let place = DVec3::new(i as f64 * 0.95 - 1.9, 0.25, 0.2 * (i % 2) as f64);
        scene.add(&a, DAffine3::from_translation(place) * DAffine3::from_rotation_x(-1.2));
    }
    scene.sun(Vec3::new(-0.7, -0.8, -0.3), Vec3::ONE, 0.7);
    scene.snapshot.lights[0].shadow = shadow;
    scene.snapshot.ambient_up = Vec3::splat(0.2);
    scene
}

#[test]
fn lit_surfaces_have_no_shadow_acne() {
    // A floor and a bulge that faces the light: every pixel is the same with and without shadows.
    for softness in [0.0, 0.05, 0.2] {
        let mut scene = Scene::ortho(2.0);
        let a = asset(vec![layered::bulge(0.8)], vec![white_material()], vec![]);
        for degrees in [0.0f64, 40.0, 75.0] {
            scene.stage.actors.clear();
            scene.snapshot.actors.clear();
            scene.snapshot.lights.clear();
            scene.add(&a, DAffine3::IDENTITY);
            let l = DQuat::from_rotation_y(degrees.to_radians()) * DVec3::NEG_Z;
            scene.sun(l.as_vec3(), Vec3::ONE, 0.8);
            let bare = draw_at(&scene, [96, 96], 1);
            scene.snapshot.lights[0].shadow = Some(Shadow { size: 512, softness: Some(softness) });
            let shaded = draw_at(&scene, [96, 96], 1);
            let darker = bare.rgba.iter().zip(&shaded.rgba).filter(|(a, b)| a.abs_diff(**b) > 3).count();
            // From 45° on, the bulge does shadow itself where its slope is steeper than the light.
            if degrees < 45.0 {
                assert_eq!(darker, 0, "{softness} m at {degrees}°");
            }
        }
    }
}

#[test]
fn alpha_tested_holes_let_light_through() {
    let share = |mask: bool| {
        let mut scene = floor_and_square();
        let holes = image(8, 8, |x, _| [255, 255, 255, if x < 4 { 255 } else { 0 }]);
        let mode = if mask { AlphaMode::Mask(0.5) } else { AlphaMode::Opaque };
        let material =
            Material { alpha_mode: mode, base_color_texture: Some(texture(0)), ..white_material() };
        scene.stage.actors.pop();
        scene.snapshot.actors.pop();
        let a = asset(vec![quad(0.6, 0.6)], vec![material], vec![holes]);
        scene.add(&a, DAffine3::from_translation(DVec3::Y) * flat_on_the_floor());
        let sun = white_light(LightKind::Directional, 0.8);
        let shadow = Shadow { softness: Some(0.01), ..Shadow::default() };
        add_shadow_light(&mut scene, sun, DVec3::ZERO, DVec3::new(1.0, -0.8, 0.0), shadow);
        let frame = draw_at(&scene, [160, 160], 1);
        frame.rgba.chunks_exact(4).filter(|p| p[0] < 20).count()
    };
    let (whole, half) = (share(false), share(true));
    let ratio = half as f64 / whole as f64;
    assert!((ratio - 0.5).abs() < 0.03, "{half} of {whole}");
}

#[test]
fn scenes_without_shadows_draw_no_shadow_maps() {
    let of = |shadow: Option<Shadow>| {
        let scene = bulge_on_floor(shadow);
        let (_, plan) = scene.plan(&PlanOptions::new([64, 64], 1));
        let recording = record_of(&plan);
        (plan, recording)
    };
    let (plan, recording) = of(None);
    assert!(plan.shadow_maps.is_none());
    assert!(plan.draws.iter().all(|d| !d.pipeline.features.has(Features::SHADOW)));
    assert_eq!((recording.counts().passes, recording.counts().shadow_views), (1, 0));
    let why = |plan: &Plan| plan.left_out.iter().find(|l| l.part == "shadow maps").map(|l| l.why.clone());
    assert_eq!(why(&plan).as_deref(), Some("no light casts shadows"));
    let (with, recording) = of(Some(Shadow::default()));
    let counts = recording.counts();
    assert_eq!((counts.passes, counts.shadow_views), (2, 1));
    assert_eq!(why(&with), None);
    // Six draws into the image, and five into the shadow map, which leaves out the flat floor. Opaque casters share a pipeline and bind no material.
    assert_eq!(with.instances.len(), plan.instances.len() + 5);
    let before = recording.commands.iter().position(|c| matches!(c, Command::BeginPass { .. })).unwrap();
    let count = |f: fn(&Command) -> bool| recording.commands[..before].iter().filter(|c| f(c)).count();
    assert_eq!(count(|c| matches!(c, Command::BindPipeline(_))), 2, "solid, and with holes");
    assert_eq!(count(|c| matches!(c, Command::BindMaterial { .. })), 1, "that with holes");
    // Without a lit surface in view, or without a caster, there is no map.
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![quad(1.0, 1.0)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
    scene.sun(Vec3::NEG_Z, Vec3::ONE, 1.0);
    scene.snapshot.lights[0].shadow = Some(Shadow::default());
    let (_, plan) = scene.plan(&PlanOptions::new([64, 64], 1));
    assert_eq!(why(&plan).as_deref(), Some("nothing lit is in view"));
    assert!(plan.shadow_maps.is_none());
}

#[test]
fn casters_out_of_view_are_drawn_into_shadow_maps_only() {
    let mut scene = Scene::ortho(2.0);
    let a = asset(vec![quad(1.0, 1.0)], vec![white_material()], vec![]);
    scene.at(&a, 0.0, 0.0, 0.0);
    // A caster right of the image, between it and the sun; and one whose shadow misses the image.
    scene.at(&a, 4.0, 0.0, 4.0);
    scene.at(&a, -40.0, 0.0, 0.0);
    scene.sun(Vec3::new(-0.7, 0.0, -0.7), Vec3::ONE, 1.0);
    scene.snapshot.lights[0].shadow = Some(Shadow::default());
    let (_, plan) = scene.plan(&PlanOptions::new([32, 32], 1));
    let view = &plan.shadow_maps.as_ref().unwrap().views[0];
    let actors: Vec<u32> = view
        .draws
        .iter()
        .flat_map(|d| d.first_instance..d.first_instance + d.instance_count)
        .map(|i| plan.instance_actors[i as usize])
        .collect();
    // The square in view is flat and shadows nothing else.
    assert_eq!(actors, [1]);
    assert_eq!(plan.draws.iter().map(|d| d.instance_count).sum::<u32>(), 1);
    let frame = draw_at(&scene, [32, 32], 1);
    assert!(pixel(&frame, 16, 16)[0] < 10, "in the shadow of what is not seen");
}

#[test]
fn forcing_all_features_in_changes_no_shadowed_pixel() {
    for shadow in [None, Some(Shadow::default())] {
        let scene = bulge_on_floor(shadow);
        let options = PlanOptions::new([120, 90], 1);
        let lean = draw(&scene, &options);
        let forced = draw(&scene, &PlanOptions { force_all: true, ..options.clone() });
        let worst = lean.rgba.iter().zip(&forced.rgba).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(1), "{shadow:?}: {worst:?}");
        let single = draw(&scene, &PlanOptions { no_instancing: true, no_culling: true, ..options });
        assert_eq!(lean.rgba, single.rgba, "{shadow:?}");
    }
}

#[test]
fn vulkan_draws_the_same_shadows() {
    let Some(mut r) = vulkan(GpuOptions::default()) else { return };
    let mut on_vulkan = |scene: &Scene, options: &PlanOptions| draw_with(&mut r, scene, options);
    let mut lamps = bulge_on_floor(Some(Shadow { size: 1024, softness: Some(0.1) }));
    let at = DVec3::new(0.3, 1.6, 1.0);
    add_shadow_light(
        &mut lamps,
        white_light(LightKind::Point, 1.0),
        at,
        DVec3::NEG_Y,
        Shadow { size: 512, softness: Some(0.0) },
    );
    let spot = LightKind::Spot { inner: 0.4, outer: 0.6 };
    add_shadow_light(
        &mut lamps,
        white_light(spot, 6.0),
        DVec3::new(-1.0, 3.0, 1.0),
        DVec3::new(0.3, -1.0, -0.3),
        Shadow::default(),
    );
    let scenes = [
        ("sun", bulge_on_floor(Some(Shadow { size: 1024, softness: Some(0.0) }))),
        ("sun, point and spot", lamps),
        ("none", bulge_on_floor(None)),
        ("sun again", bulge_on_floor(Some(Shadow::default()))),
    ];
    for (what, scene) in &scenes {
        for samples in [1, 4] {
            let options = PlanOptions::new([200, 150], samples);
            let (a, b) = (on_vulkan(scene, &options), draw(scene, &options));
            let c = compare(&a, &b, 2).unwrap();
            println!("{what}, {samples} samples: {c}");
            assert!(c.mean < 0.15 && c.share_beyond < 0.01, "{what}: {c}");
            let forced = on_vulkan(scene, &PlanOptions { force_all: true, ..options });
            let c = compare(&a, &forced, 2).unwrap();
            assert!(c.mean < 0.05 && c.share_beyond < 0.002, "{what}, everything forced in: {c}");
        }
    }
    // A missing shadow exceeds the bound.
    let options = PlanOptions::new([200, 150], 1);
    let c = compare(&on_vulkan(&scenes[0].1, &options), &draw(&scenes[2].1, &options), 2).unwrap();
    assert!(c.mean > 0.15 && c.share_beyond > 0.01, "{c}");
}

/// A post 0.4 m wide and 1.6 m high on a square floor, 3 m in front of the camera; everything is scaled by `scale`. `far_box`: side
/// of an additional box 5 km away.
fn post_on_floor(floor: f64, scale: f64, far_box: Option<f64>) -> Scene {
    let camera = CameraState {
        camera: None,
        world_from_view: DAffine3::from_rotation_translation(
            DQuat::from_rotation_x(-0.3),
            DVec3::new(0.0, 1.2, 3.0) * scale,
        ),
        projection: Projection::Perspective { yfov: 0.8, near: (0.05 * scale) as f32, far: None },
    };
    let mut scene = Scene::with_camera(camera);
    let half = (0.5 * floor * scale) as f32;
    scene.add(&asset(vec![quad(half, half)], vec![white_material()], vec![]), flat_on_the_floor());
    let block = asset(vec![cube(0.5)], vec![white_material()], vec![]);
    let turned = DAffine3::from_translation(DVec3::Y * 0.8 * scale) * DAffine3::from_rotation_y(0.3);
    let post = scene.add(&block, turned * DAffine3::from_scale(DVec3::new(0.4, 1.6, 0.4) * scale));
    // Large triangles are split according to the sizes in the stage.
    scene.stage.actors[post].transform.scale = DVec3::new(0.4, 1.6, 0.4) * scale;
    if let Some(side) = far_box {
        let place = DAffine3::from_translation(DVec3::new(0.0, 0.5 * side, -5000.0));
        scene.add(&block, place * DAffine3::from_scale(DVec3::splat(side)));
    }
    scene.sun(Vec3::new(-0.7, -1.0, 0.3), Vec3::ONE, 0.7);
    scene.snapshot.lights[0].shadow = Some(Shadow::default());
    scene.snapshot.ambient_up = Vec3::splat(0.1);
    scene
}

/// The lower half of an image, where the feet are.
fn lower_half(frame: &choreo_plugin::Frame) -> &[u8] {
    &frame.rgba[frame.rgba.len() / 2..]
}

/// Largest difference, and number of values that differ by more than 2.
fn difference_of_bytes(a: &[u8], b: &[u8]) -> (u8, usize) {
    assert_eq!(a.len(), b.len());
    let differences = || a.iter().zip(b).map(|(a, b)| a.abs_diff(*b));
    (differences().max().unwrap_or(0), differences().filter(|d| *d > 2).count())
}

/// The lower half of the image is the same for any floor size, any scale of the scene, and with a box at the horizon.
fn check_same_lower_half(draw: &mut dyn FnMut(&Scene) -> choreo_plugin::Frame) {
    let room = draw(&post_on_floor(10.0, 1.0, None));
    let dark = lower_half(&room).chunks_exact(4).filter(|p| p[0] < 110).count();
    assert!(dark > 300, "{dark} pixels are in shadow");
    for floor in [100.0, 1e3, 1e4, 1e5] {
        let (worst, beyond) =
            difference_of_bytes(lower_half(&room), lower_half(&draw(&post_on_floor(floor, 1.0, None))));
        println!("a floor of {floor} m: {worst} at worst, {beyond} beyond 2");
        assert_eq!(beyond, 0, "a floor of {floor} m: {worst}");
    }
    let with_box = draw(&post_on_floor(10.0, 1.0, Some(0.5)));
    assert_eq!(difference_of_bytes(lower_half(&room), lower_half(&with_box)), (0, 0), "a box 5 km away");
    // The box is large enough to be drawn, and stands on a ground that receives its shadow.
    let far = post_on_floor(1e5, 1.0, Some(100.0));
    let (_, plan) = far.plan(&PlanOptions::new([160, 120], 1));
    let maps = plan.shadow_maps.as_ref().unwrap();
    let casters: u32 = maps.views.iter().flat_map(|view| &view.draws).map(|draw| draw.instance_count).sum();
    assert!(casters > 1, "the box casts no shadow");
    let (worst, beyond) = difference_of_bytes(lower_half(&room), lower_half(&draw(&far)));
    assert_eq!(beyond, 0, "a large box 5 km away: {worst}");
    // Texel sizes change in steps that divide an octave, so that a factor of two gives the same image.
    for scale in [1.0 / 1024.0, 0.125, 32.0, 1024.0] {
        let scaled = draw(&post_on_floor(10.0, scale, None));
        assert_eq!(
            difference_of_bytes(lower_half(&room), lower_half(&scaled)),
            (0, 0),
            "{scale} times as large"
        );
    }
    // At other factors, texels have other sizes and positions, which changes the edges of the post's shadow.
    for scale in [1e-3, 1e3] {
        let scaled = draw(&post_on_floor(10.0, scale, None));
        let off =
            lower_half(&room).iter().zip(lower_half(&scaled)).map(|(a, b)| (decode(*a) - decode(*b)).abs());
        let beyond = off.clone().filter(|off| *off > 0.02).count();
        let worst = off.fold(0.0, f64::max);
        println!("{scale} times as large: {worst:.3} of white at worst, {beyond} values beyond 0.02");
        assert!(
            worst < 0.15 && beyond <= lower_half(&room).len() / 64,
            "{scale} times as large: {worst}, {beyond}"
        );
    }
}

#[test]
fn the_extent_of_a_scene_changes_no_shadow_near_the_camera() {
    check_same_lower_half(&mut |scene| draw_at(scene, [160, 120], 1));
    let Some(mut r) = vulkan(GpuOptions::default()) else { return };
    check_same_lower_half(&mut |scene| draw_with(&mut r, scene, &PlanOptions::new([160, 120], 1)));
}

/// The shadow edge of a square 0.25 m and 0.75 m high, against the part of the sun's disc that is visible from each point.
#[test]
fn penumbra_width_matches_the_disc_of_the_sun() {
    let mut widths = Vec::new();
    for height in [0.25, 0.75] {
        let from_above = CameraState {
            camera: None,
            world_from_view: DAffine3::from_rotation_translation(
                DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2),
                DVec3::new(0.0, 10.0, 0.0),
            ),
            projection: Projection::Orthographic { height: 0.004, near: 0.1, far: 100.0 },
        };
        let mut scene = Scene::with_camera(from_above);
        scene.add(&asset(vec![quad(4.0, 4.0)], vec![white_material()], vec![]), flat_on_the_floor());
        // The edge of the shadow is the line x = 0; the sun and the square are on the left.
        let l = DVec3::new(1.0, -1.0, 0.0).normalize();
        let middle = DVec3::new(-1.0 - height, height, 0.0);
        let square = asset(vec![quad(1.0, 1.0)], vec![white_material()], vec![]);
        scene.add(&square, DAffine3::from_translation(middle) * flat_on_the_floor());
        scene.sun(l.as_vec3(), Vec3::ONE, 0.8);
        scene.snapshot.lights[0].shadow = Some(Shadow::default());
        let frame = draw_at(&scene, [120, 4], 1);
        let light: Vec<f64> = (0..120).map(|x| decode(pixel(&frame, x, 2)[0])).collect();
        let lit = light[119];
        assert!(light[0] < 0.01 && lit > 0.5, "{} to {lit}", light[0]);
        // Number of pixels of 1 mm between a tenth and nine tenths of the light: 0.8 of the width of the disc's projection.
        let between = light.iter().filter(|v| (0.1..0.9).contains(&(**v / lit))).count() as f64 * 1e-3;
        let distance = height * 2f64.sqrt();
        // The floor is inclined by 45°.
        let exact = 0.8 * f64::from(SUN_ANGLE) * distance * 2f64.sqrt();
        println!("from {height} m: {:.1} mm, of the disc {:.1} mm", between * 1e3, exact * 1e3);
        assert!((between - exact).abs() < 0.25 * exact + 1e-3, "{between} instead of {exact}");
        widths.push(between);
    }
    assert!(widths[1] > 2.0 * widths[0], "{widths:?}");
}

/// The pixels that a shadow darkens, in both renderers.
#[test]
fn actors_cast_and_receive_shadows_as_their_settings_say() {
    let mut vulkan = vulkan(GpuOptions::default());
    let mut darker_beside = |square: ActorShadow, floor: ActorShadow, board: bool| {
        let mut scene = floor_and_square();
        if board {
            // A board over the left half of the square's shadow.
            let at = DAffine3::from_translation(DVec3::new(-4.4, 0.01, 0.0));
            scene.add(&asset(vec![quad(4.0, 4.0)], vec![white_material()], vec![]), at * flat_on_the_floor());
        }
        let sun = white_light(LightKind::Directional, 0.8);
        add_shadow_light(&mut scene, sun, DVec3::ZERO, DVec3::new(-0.5, -1.0, -0.3), Shadow::default());
        scene.stage.actors[0].shadow = floor;
        scene.stage.actors[1].shadow = square;
        let dark = |frame: &choreo_plugin::Frame| frame.rgba.chunks_exact(4).filter(|p| p[0] < 20).count();
        let options = PlanOptions::new([160, 160], 1);
        let on_cpu = draw(&scene, &options);
        if let Some(r) = &mut vulkan {
            let c = compare(&draw_with(r, &scene, &options), &on_cpu, 2).unwrap();
            assert!(c.mean < 0.15 && c.share_beyond < 0.01, "{c}");
        }
        let why =
            scene.plan(&options).1.left_out.iter().find(|l| l.part == "shadow maps").map(|l| l.why.clone());
        (dark(&on_cpu), why)
    };
    let as_usual = ActorShadow::default();
    // An actor that receives no shadows stays bright beside one that does.
    let aside = ActorShadow { receive: false, ..as_usual };
    let [whole, half] = [as_usual, aside].map(|floor| darker_beside(as_usual, floor, true).0);
    assert!(half > whole / 4 && half < whole / 4 * 3, "{half} of {whole}");
    let mut darker = |square: ActorShadow, floor: ActorShadow| darker_beside(square, floor, false);
    let (dark, why) = darker(as_usual, as_usual);
    assert!(dark > 500 && why.is_none(), "{dark}, {why:?}");
    let off =
        "no shadow of an actor that casts is seen on one that receives; some are switched off by `shadow`";
    for (square, floor) in [
        (ActorShadow { cast: false, ..as_usual }, as_usual),
        (as_usual, ActorShadow { receive: false, ..as_usual }),
    ] {
        assert_eq!(darker(square, floor), (0, Some(off.to_string())));
    }
    // An actor that receives nothing still casts, and one that casts nothing still receives.
    let silent = ActorShadow { cast: false, ..as_usual };
    assert_eq!(darker(ActorShadow { receive: false, ..as_usual }, silent), (dark, None));
}

/// A shadow map is drawn again only if something in it changes; a kept map gives the same image as a new one.
#[test]
fn unchanged_shadow_maps_are_kept() {
    let options = PlanOptions::new([96, 96], 1);
    let mut renderer = CpuRenderer::new(&[]);
    let mut maps = |scene: &Scene| {
        let before = renderer.stage_times().shadow_maps();
        let frame = draw_with(&mut renderer, scene, &options);
        assert!(frame == draw(scene, &options), "a kept map shows something else");
        renderer.stage_times().shadow_maps() - before
    };
    let mut scene = floor_and_square();
    let bent = skinned_asset(vec![quad(0.2, 0.5)], vec![Material { double_sided: true, ..white_material() }]);
    let figure = scene.add(&bent, DAffine3::from_translation(DVec3::new(-0.8, 0.5, 0.5)));
    let spot = LightKind::Spot { inner: 1.0, outer: 1.04 };
    let shadow = Shadow { size: 256, softness: None };
    add_shadow_light(&mut scene, white_light(spot, 4.0), DVec3::new(0.8, 2.5, 0.5), DVec3::NEG_Y, shadow);
    assert_eq!([maps(&scene), maps(&scene)], [1, 0]);
    // The camera turns in place, and the light's intensity changes: the map is kept.
    scene.snapshot.camera.world_from_view *= DAffine3::from_rotation_z(0.3);
    scene.snapshot.lights[0].light.intensity = 3.0;
    assert_eq!(maps(&scene), 0);
    // A second light gets its own map; the first light keeps its map, at another position of the image.
    let further = DVec3::new(-1.2, 2.0, 0.2);
    scene.snapshot.lights.insert(0, LightState { position: further, ..scene.snapshot.lights[0] });
    assert_eq!([maps(&scene), maps(&scene)], [1, 0]);
    scene.snapshot.lights.remove(0);
    assert_eq!(maps(&scene), 0);
    // The map is redrawn if another mesh replaces the caster, the caster moves, its joint turns, it disappears, or the light moves.
    scene.stage.actors[1].asset = asset(vec![quad(0.3, 0.3)], vec![white_material()], vec![]);
    assert_eq!([maps(&scene), maps(&scene)], [1, 0]);
    scene.snapshot.actors[1].world_from_model.translation.x += 0.1;
    assert_eq!([maps(&scene), maps(&scene)], [1, 0]);
    scene.snapshot.actors[figure].model_from_joint[1] *= Affine3A::from_rotation_z(0.4);
    assert_eq!([maps(&scene), maps(&scene)], [1, 0]);
    scene.snapshot.actors[figure].visible = false;
    assert_eq!([maps(&scene), maps(&scene)], [1, 0]);
    scene.snapshot.lights[0].position.x += 0.1;
    assert_eq!([maps(&scene), maps(&scene)], [1, 0]);
    // Maps with cut-outs are redrawn in every frame.
    let holes = Material { alpha_mode: AlphaMode::Mask(0.5), double_sided: true, ..white_material() };
    scene.add(&asset(vec![quad(0.3, 0.3)], vec![holes], vec![]), DAffine3::from_translation(DVec3::Y));
    assert_eq!([maps(&scene), maps(&scene)], [1, 1]);
}

/// All maps of a device lie in one image, so a kept map keeps its position beside a redrawn one.
#[test]
fn vulkan_keeps_unchanged_shadow_maps() {
    let (Some(mut keeping), Some(mut fresh)) = (vulkan(GpuOptions::default()), vulkan(GpuOptions::default()))
    else {
        return;
    };
    let options = PlanOptions::new([96, 96], 1);
    let mut maps = |scene: &Scene, options: &PlanOptions| {
        let frame = draw_with(&mut keeping, scene, options);
        // Setting the effects again redraws all maps.
        fresh.set_effects(&[]).unwrap();
        assert!(frame == draw_with(&mut fresh, scene, options), "a kept map shows something else");
        let passes = |recording: &commands::Recording| {
            recording.commands.iter().filter(|c| matches!(c, Command::BeginShadows { .. })).count()
        };
        let [kept, all] = [&keeping, &fresh].map(|renderer| renderer.last_recording().unwrap().clone());
        assert_eq!((passes(&kept), passes(&all)), (usize::from(kept.counts().shadow_views > 0), 1));
        assert_eq!(all.counts().shadow_views, scene.snapshot.lights.len());
        kept.counts().shadow_views
    };
    let mut scene = floor_and_square();
    let small =
        asset(vec![quad(0.2, 0.3)], vec![Material { double_sided: true, ..white_material() }], vec![]);
    let aslant = DAffine3::from_rotation_x(-1.2);
    let figure = scene.add(&small, DAffine3::from_translation(DVec3::new(1.4, 0.8, 1.4)) * aslant);
    let spot = LightKind::Spot { inner: 0.28, outer: 0.3 };
    for at in [DVec3::new(0.1, 3.0, -0.2), DVec3::new(1.4, 3.0, 1.4)] {
        add_shadow_light(
            &mut scene,
            white_light(spot, 12.0),
            at,
            DVec3::NEG_Y,
            Shadow { size: 256, softness: None },
        );
    }
    assert_eq!([maps(&scene, &options), maps(&scene, &options)], [2, 0]);
    scene.snapshot.lights[0].light.intensity = 9.0;
    scene.snapshot.camera.world_from_view *= DAffine3::from_rotation_z(0.3);
    assert_eq!(maps(&scene, &options), 0);
    // The figure turns in the light of only one lamp, so only that lamp's map is redrawn.
    for angle in [0.4, 0.8] {
        scene.snapshot.actors[figure].world_from_model *= DAffine3::from_rotation_y(angle);
        assert_eq!([maps(&scene, &options), maps(&scene, &options)], [1, 0]);
    }
    // The figure disappears: its map is cleared.
    scene.snapshot.actors[figure].visible = false;
    assert_eq!([maps(&scene, &options), maps(&scene, &options)], [1, 0]);
    // A frame of another size has new images, and a map at another position is redrawn.
    let larger = PlanOptions::new([128, 128], 1);
    assert_eq!([maps(&scene, &larger), maps(&scene, &larger), maps(&scene, &options)], [2, 0, 2]);
    scene.snapshot.lights.swap(0, 1);
    assert_eq!([maps(&scene, &options), maps(&scene, &options)], [2, 0]);
    // Maps with cut-outs are redrawn in every frame.
    let holes = Material { alpha_mode: AlphaMode::Mask(0.5), double_sided: true, ..white_material() };
    let floating = asset(vec![quad(0.3, 0.3)], vec![holes], vec![]);
    scene.add(&floating, DAffine3::from_translation(DVec3::new(0.1, 1.5, -0.2)));
    assert_eq!([maps(&scene, &options), maps(&scene, &options)], [1, 1]);
}
