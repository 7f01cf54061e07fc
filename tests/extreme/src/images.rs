//! Images at the limits of what can be drawn, with the CPU renderer, to which every driver is compared.

use crate::{Case, refused};
use choreo_asset::{
    AlphaMode, Asset, Image, Light, LightKind, Material, Mesh, MeshInstance, Primitive, Projection, Sampler,
    Shading, TextureRef,
};
use choreo_motion::{Skeleton, Time, Transform};
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_stage::{Background, Camera, Placement, Rig, Shadow, Stage, StageLight, ViewTransform};
use glam::{Affine2, Affine3A, DQuat, DVec3, Vec2, Vec3, Vec4};
use std::f32::consts::PI;
use std::sync::Arc;

pub const CASES: &[Case] = &[
    Case::new("1 mm apart, 1 m away", "share of pixels of the farther", 0.0, || wrong_depth_fraction(1.0)),
    Case::new("1 mm apart, 100 m away", "share of pixels of the farther", 0.0, || {
        wrong_depth_fraction(100.0)
    }),
    Case::new("1 mm apart, 1 km away", "share of pixels of the farther", 0.0, || wrong_depth_fraction(1e3)),
    Case::new("1 mm apart, 10 km away", "share of pixels of the farther", 0.0, || wrong_depth_fraction(1e4)),
    Case::new("near plane at 0.1 mm, a wall at 0.2 mm", "share of pixels it misses", 0.0, || {
        wall(2e-4, 1e-4)
    }),
    Case::new("near plane at 0.1 mm, a wall at 10,000 km", "share of pixels it misses", 0.0, || {
        wall(1e7, 1e-4)
    }),
    Case::new("10,000 km from the origin", "steps of 255 off the same at the origin", 0.0, far_away),
    Case::new("a shadow on a ground of 10 m", "share of pixels off rays in f64, edges apart", 0.0, || {
        shadow_off_rays(&shadow(10.0, 1.0, false))
    }),
    Case::new(
        "a shadow on a ground of 100 km, by rays",
        "share of pixels off them, edges apart",
        0.0,
        || shadow_off_rays(&shadow(1e5, 1.0, false)),
    ),
    Case::new("a shadow on a ground of 1 km", "share over 2 of 255 off that on 10 m", 0.0, || {
        shadow_moved(1e3, 1.0, false)
    }),
    Case::new("a shadow on a ground of 10 km", "share over 2 of 255 off that on 10 m", 0.0, || {
        shadow_moved(1e4, 1.0, false)
    }),
    Case::new("a shadow on a ground of 100 km", "share over 2 of 255 off that on 10 m", 0.0, || {
        shadow_moved(1e5, 1.0, false)
    }),
    Case::new("a shadow, and a box 5 km away", "share over 2 of 255 off that without", 0.0, || {
        shadow_moved(10.0, 1.0, true)
    }),
    Case::new("a shadow, and a tower 5 km away", "share over 2 of 255 off that on 10 m", 0.0, || {
        let mut stage = shadow(1e5, 1.0, false);
        add_actor(
            &mut stage,
            asset(quad(50.0), Material { double_sided: true, ..matte() }),
            Placement::at(0.0, 50.0, -5e3),
        );
        off_room(&stage)
    }),
    Case::new("a shadow in a scene of 1 cm", "share over 2 of 255 off that on 10 m", 0.0, || {
        shadow_moved(10.0, 1.0 / 1024.0, false)
    }),
    Case::new("a shadow in a scene of 10 km", "share over 2 of 255 off that on 10 m", 0.0, || {
        shadow_moved(10.0, 1024.0, false)
    }),
    // The edges of the board's shadow differ, because texels have other sizes and places at factors that are not powers of two.
    Case::new("a shadow, all 1,000 times smaller", "share over 2 of 255 off that on 10 m", 0.02, || {
        shadow_moved(10.0, 1e-3, false)
    }),
    Case::new("a shadow, all 1,000 times larger", "share over 2 of 255 off that on 10 m", 0.02, || {
        shadow_moved(10.0, 1e3, false)
    }),
    Case::new("normals of zero", "steps of 255 off ambient light alone", 1.0, || normals(Vec3::ZERO)),
    Case::new("normals that point away", "steps of 255 off ambient light alone", 1.0, || normals(-Vec3::Z)),
    Case::new("a mirrored relief", "steps of 255 off the mirrored image", 1.0, mirrored_relief),
    Case::new("a vertex that is not a number", "pixels drawn of its mesh", 0.0, || broken(Vec3::NAN)),
    Case::new("a vertex at infinity", "pixels drawn of its mesh", 0.0, || broken(Vec3::INFINITY)),
    Case::new("triangles without an area", "pixels drawn", 0.0, no_area),
    Case::new("a texture of no pixels", "steps of 255 off none", 0.0, || textured([0, 0])),
    Case::new("a texture of 16,384 × 4 pixels", "steps of 255 off its color", 1.0, || textured([16384, 4])),
    Case::new("100,000 copies", "draws", 1.0, || copies(100_000)),
    Case::new("an image of one pixel", "steps of 255 off its color", 1.0, || sized([1, 1])),
    Case::new("an image 16,384 wide", "steps of 255 off its color", 1.0, || sized([16384, 16])),
    Case::new("an image 16,385 wide", "named error (0) or not (1)", 0.0, || {
        refused(draw(&facing(), [16385, 16]).map(|_| ()), "16385")
    }),
    Case::new("an image of no height", "named error (0) or not (1)", 0.0, || {
        refused(draw(&facing(), [16, 0]).map(|_| ()), "height")
    }),
];

const SIZE: [u32; 2] = [32, 32];

fn quad(half: f32) -> Primitive {
    let at = [Vec2::new(-1.0, -1.0), Vec2::new(1.0, -1.0), Vec2::ONE, Vec2::new(-1.0, 1.0)];
    Primitive {
        indices: vec![0, 1, 2, 0, 2, 3],
        positions: at.iter().map(|p| (*p * half).extend(0.0)).collect(),
        normals: vec![Vec3::Z; 4],
        uvs: [at.iter().map(|p| Vec2::new(p.x, -p.y) * 0.5 + 0.5).collect(), vec![]],
        material: Some(0),
        ..Primitive::default()
    }
}

fn unlit(color: Vec4) -> Material {
    Material { shading: Shading::Unlit, base_color: color, ..Material::default() }
}

fn matte() -> Material {
    Material { metallic: 0.0, ..Material::default() }
}

const GREEN: Vec4 = Vec4::new(0.0, 1.0, 0.0, 1.0);

fn asset(primitive: Primitive, material: Material) -> Asset {
    let joint = Skeleton::new(vec!["root".into()], vec![None], vec![Transform::IDENTITY]);
    Asset {
        skeleton: joint.map(Arc::new).unwrap_or_default(),
        meshes: vec![Arc::new(Mesh { primitives: vec![primitive], ..Mesh::default() })],
        instances: vec![MeshInstance::default()],
        materials: vec![material],
        ..Asset::default()
    }
}

/// A camera at `position` that looks along −Z; black background, no light, no view transform.
fn stage(position: DVec3, near: f32) -> Stage {
    let mut stage = Stage::default();
    stage.settings.background = Background::Color(Vec4::W);
    stage.settings.view_transform = ViewTransform::None;
    (stage.settings.ambient_up, stage.settings.ambient_down) = (Vec3::ZERO, Vec3::ZERO);
    let rig = Rig::Fixed { position, rotation: DQuat::IDENTITY, look_at: None };
    let projection = Projection::Perspective { yfov: 0.8, near, far: None };
    stage.shoot(Camera { projection, ..Camera::new("camera", rig) });
    stage
}

fn add_actor(stage: &mut Stage, asset: Asset, at: Placement) {
    let actor = stage.cast(&format!("actor {}", stage.actors.len()), Arc::new(asset));
    stage.actors[actor].transform = at;
}

fn draw(stage: &Stage, size: [u32; 2]) -> Result<Vec<u8>, String> {
    let snapshot = stage.at(Time::ZERO).map_err(|e| e.to_string())?;
    let resources = Arc::new(SceneResources::new(stage));
    let plan = Plan::new(&resources, stage, &snapshot, &PlanOptions::new(size, 1));
    let mut renderer = CpuRenderer::new(&[]);
    renderer.load(resources).map_err(|e| e.to_string())?;
    renderer.submit(plan).map_err(|e| e.to_string())?;
    Ok(renderer.collect(None).map_err(|e| e.to_string())?.rgba)
}

/// Fraction of the pixels for which `holds` is true; NaN without an image.
fn pixel_fraction(stage: &Stage, holds: impl Fn([u8; 4]) -> bool) -> f64 {
    let Ok(rgba) = draw(stage, SIZE) else { return f64::NAN };
    let pixels = rgba.as_chunks::<4>().0;
    pixels.iter().filter(|p| holds(**p)).count() as f64 / pixels.len() as f64
}

/// Largest difference between two images, in steps of 255.
fn pixel_difference(a: &Result<Vec<u8>, String>, b: &Result<Vec<u8>, String>) -> f64 {
    match (a, b) {
        (Ok(a), Ok(b)) if a.len() == b.len() => {
            a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).fold(0.0, f64::max)
        }
        _ => f64::NAN,
    }
}

/// Fraction of wrong pixels for a red wall one millimetre in front of a green one, at this distance. The worse of both drawing orders.
fn wrong_depth_fraction(metres: f64) -> f64 {
    let wall = |color| asset(quad(metres as f32), unlit(color));
    let worst = [false, true].map(|near_first| {
        let mut stage = stage(DVec3::new(0.0, 0.0, metres), 0.1);
        let mut walls = [(0.001, Vec4::new(1.0, 0.0, 0.0, 1.0)), (0.0, GREEN)];
        if !near_first {
            walls.reverse();
        }
        for (z, color) in walls {
            add_actor(&mut stage, wall(color), Placement::at(0.0, 0.0, z));
        }
        pixel_fraction(&stage, |p| p[0] != 255)
    });
    worst[0].max(worst[1])
}

fn wall(metres: f64, near: f32) -> f64 {
    let mut stage = stage(DVec3::ZERO, near);
    add_actor(&mut stage, asset(quad(metres as f32), unlit(GREEN)), Placement::at(0.0, 0.0, -metres));
    pixel_fraction(&stage, |p| p[1] != 255)
}

fn sun() -> StageLight {
    StageLight::sun("sun", Vec3::new(-0.4, -0.3, -0.8).normalize(), PI)
}

fn far_away() -> f64 {
    let at = |origin: DVec3| {
        let mut stage = stage(origin + DVec3::new(0.3, 0.2, 4.0), 0.1);
        stage.lights.push(sun());
        let lamp = Light { kind: LightKind::Point, color: Vec3::X, intensity: 3.0 * PI, range: Some(9.0) };
        stage.lights.push(StageLight { light: lamp, position: origin + DVec3::Z, ..sun() });
        let place = Placement { translation: origin, ..Placement::default() }.turned(0.4);
        add_actor(&mut stage, asset(quad(1.0), matte()), place);
        draw(&stage, SIZE)
    };
    pixel_difference(&at(DVec3::ZERO), &at(DVec3::new(1e7, -1e7, 1e7)))
}

/// A board on a square ground in the sun, scaled by `scale`.
fn shadow(ground: f64, scale: f64, far_box: bool) -> Stage {
    let mut stage = stage(DVec3::new(0.0, 1.0, 3.0) * scale, (0.05 * scale) as f32);
    stage.lights.push(StageLight { shadow: Some(Shadow::default()), ..sun() });
    let level = DQuat::from_rotation_x(-0.5 * f64::from(PI));
    let wide = |half: f64| asset(quad((half * scale) as f32), Material { double_sided: true, ..matte() });
    add_actor(&mut stage, wide(0.5 * ground), Placement { rotation: level, ..Placement::default() });
    add_actor(&mut stage, wide(0.5), Placement::at(0.0, 0.5 * scale, 0.0).turned(0.3));
    if far_box {
        add_actor(&mut stage, wide(0.25), Placement::at(0.0, 0.25, -5e3));
    }
    stage
}

/// Fraction of wrong pixels, against rays in f64. Only pixels of the ground count that are completely lit or completely in the shadow of
/// the board, over the whole pixel and the whole disc of the sun.
fn shadow_off_rays(stage: &Stage) -> f64 {
    const SIDE: usize = 96;
    let Ok(rgba) = draw(stage, [SIDE as u32; 2]) else { return f64::NAN };
    let sun = -DVec3::new(-0.4, -0.3, -0.8).normalize();
    let (across, up) = (sun.cross(DVec3::Y).normalize(), sun.cross(DVec3::Y).normalize().cross(sun));
    // The disc is doubled, since edges are also filtered over texels.
    let disc = f64::from(choreo_stage::SUN_ANGLE);
    let suns = [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
        .map(|(x, y)| (sun + (across * x + up * y) * disc).normalize());
    let turn = DQuat::from_rotation_y(0.3);
    let hits_board = |from: DVec3, way: DVec3| {
        let (from, way) = (turn.inverse() * (from - DVec3::new(0.0, 0.5, 0.0)), turn.inverse() * way);
        let at = from - way * (from.z / way.z);
        from.z / way.z < 0.0 && at.x.abs() < 0.5 && at.y.abs() < 0.5
    };
    let eye = DVec3::new(0.0, 1.0, 3.0);
    // Whether a point of the ground in the image is in shadow; `None` if the board hides it.
    let ground = |x: f64, y: f64, sun: DVec3| {
        let half = libm::tan(0.4) * 2.0 / SIDE as f64;
        let way = DVec3::new((x - SIDE as f64 / 2.0) * half, (SIDE as f64 / 2.0 - y) * half, -1.0);
        let at = eye - way * (eye.y / way.y);
        (!hits_board(eye, way) && way.y < 0.0).then(|| hits_board(at, sun))
    };
    let (mut sure, mut dark, mut wrong) = (0u32, 0u32, 0u32);
    for (x, y) in (SIDE * 2 / 3..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))) {
        let places = [-1.0, 0.5, 2.0].map(|dx| [-1.0, 0.5, 2.0].map(|dy| (x as f64 + dx, y as f64 + dy)));
        let all: Vec<Option<bool>> =
            places.iter().flatten().flat_map(|(x, y)| suns.map(|sun| ground(*x, *y, sun))).collect();
        let Some(shaded) = all[0].filter(|first| all.iter().all(|other| *other == Some(*first))) else {
            continue;
        };
        sure += 1;
        dark += u32::from(shaded);
        wrong += u32::from((rgba[4 * (y * SIDE + x)] == 0) != shaded);
    }
    if sure < (SIDE * SIDE / 8) as u32 || dark < 50 { f64::NAN } else { f64::from(wrong) / f64::from(sure) }
}

/// Difference from the same shadow in a scene of 10 m, in the part of the image where the board meets the ground.
fn shadow_moved(ground: f64, scale: f64, far_box: bool) -> f64 {
    off_room(&shadow(ground, scale, far_box))
}

fn off_room(stage: &Stage) -> f64 {
    let feet = |stage: &Stage| draw(stage, [96, 96]).map(|rgba| rgba[rgba.len() / 3 * 2..].to_vec());
    let (Ok(room), Ok(moved)) = (feet(&shadow(10.0, 1.0, false)), feet(stage)) else {
        return f64::NAN;
    };
    if room.iter().filter(|v| **v == 0).count() < 200 {
        return f64::NAN;
    }
    let apart = room.iter().zip(&moved).filter(|(a, b)| a.abs_diff(**b) > 2).count();
    apart as f64 / room.len() as f64
}

fn normals(normal: Vec3) -> f64 {
    let with = |normal, light: bool| {
        let mut stage = stage(DVec3::new(0.0, 0.0, 2.0), 0.1);
        (stage.settings.ambient_up, stage.settings.ambient_down) = (Vec3::splat(0.3), Vec3::splat(0.3));
        if light {
            stage.lights.push(StageLight::sun("sun", Vec3::NEG_Z, PI));
        } else {
            // A light that is off keeps the default sun away.
            stage.lights.push(StageLight::sun("none", Vec3::NEG_Z, 0.0));
        }
        let normals = vec![normal; 4];
        add_actor(&mut stage, asset(Primitive { normals, ..quad(1.0) }, matte()), Placement::default());
        draw(&stage, SIZE)
    };
    pixel_difference(&with(normal, true), &with(normal, false))
}

/// A relief in a mirrored actor must be the mirror image of the relief, with its light mirrored too.
fn mirrored_relief() -> f64 {
    let relief = |x: u32, y: u32| {
        if (x / 4 + y / 4).is_multiple_of(2) { [180, 150, 220, 255] } else { [90, 110, 220, 255] }
    };
    let with = |mirror: f64| {
        let mut stage = stage(DVec3::new(0.0, 0.0, 3.0), 0.1);
        let direction = Vec3::new(-0.5 * mirror as f32, -0.3, -0.8).normalize();
        stage.lights.push(StageLight::sun("sun", direction, PI));
        let primitive = Primitive { tangents: vec![Vec3::X.extend(1.0); 4], ..quad(1.0) };
        let normal_texture = Some(texture());
        let mut asset = asset(primitive, Material { normal_texture, ..matte() });
        asset.images = vec![image([16, 16], relief)];
        add_actor(
            &mut stage,
            asset,
            Placement { scale: DVec3::new(mirror, 1.0, 1.0), ..Placement::default() },
        );
        draw(&stage, SIZE)
    };
    let flipped = with(-1.0).map(|rgba| {
        let rows = rgba.chunks(4 * SIZE[0] as usize);
        rows.flat_map(|row| row.as_chunks::<4>().0.iter().rev().flatten().copied()).collect::<Vec<u8>>()
    });
    pixel_difference(&with(1.0), &flipped)
}

fn broken(at: Vec3) -> f64 {
    let mut primitive = quad(1.0);
    primitive.positions[2] = at;
    let mut stage = stage(DVec3::new(0.0, 0.0, 2.0), 0.1);
    add_actor(&mut stage, asset(primitive, unlit(GREEN)), Placement::default());
    // A valid mesh beside it must still be visible.
    add_actor(&mut stage, asset(quad(0.1), unlit(Vec4::ONE)), Placement::default());
    let white = pixel_fraction(&stage, |p| p == [255; 4]);
    if white == 0.0 { f64::NAN } else { pixel_fraction(&stage, |p| p[1] == 255 && p[0] == 0) * 1024.0 }
}

fn no_area() -> f64 {
    let mut stage = stage(DVec3::new(0.0, 0.0, 2.0), 0.1);
    let mut line = quad(1.0);
    line.positions.iter_mut().for_each(|p| p.y = 0.013);
    let point = Primitive { positions: vec![Vec3::ZERO; 4], ..quad(1.0) };
    add_actor(&mut stage, asset(line, unlit(GREEN)), Placement::default());
    add_actor(&mut stage, asset(point, unlit(GREEN)), Placement::default());
    pixel_fraction(&stage, |p| p[1] != 0) * 1024.0
}

fn texture() -> TextureRef {
    TextureRef { image: 0, sampler: Sampler::default(), uv_set: 0, uv_transform: Affine2::IDENTITY }
}

fn image([width, height]: [u32; 2], texel: impl Fn(u32, u32) -> [u8; 4]) -> Arc<Image> {
    let rgba = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y));
    Arc::new(Image { name: String::new(), width, height, rgba: rgba.collect(), file: None })
}

/// Largest difference between a wall with a texture of one color and the wall without it.
fn textured(size: [u32; 2]) -> f64 {
    let with = |there: bool| {
        let mut stage = stage(DVec3::new(0.0, 0.0, 2.0), 0.1);
        let base_color_texture = there.then(texture);
        let mut asset = asset(quad(1.0), Material { base_color_texture, ..unlit(Vec4::ONE) });
        asset.images = vec![image(size, |_, _| [255; 4])];
        add_actor(&mut stage, asset, Placement::default());
        draw(&stage, SIZE)
    };
    pixel_difference(&with(true), &with(false))
}

/// Number of draws for `count` copies of a quad in one actor; NaN if not all are drawn.
fn copies(count: usize) -> f64 {
    let mut stage = stage(DVec3::new(0.0, 0.0, 40.0), 0.1);
    let mut field = asset(quad(0.03), unlit(GREEN));
    let at = |i: usize| Vec3::new((i % 400) as f32 - 200.0, (i / 400) as f32 - 125.0, 0.0) * 0.05;
    field.instances[0].copies = (0..count).map(|i| Affine3A::from_translation(at(i))).collect();
    add_actor(&mut stage, field, Placement::default());
    let Ok(snapshot) = stage.at(Time::ZERO) else { return f64::NAN };
    let resources = Arc::new(SceneResources::new(&stage));
    let plan = Plan::new(&resources, &stage, &snapshot, &PlanOptions::new(SIZE, 1));
    let seen = pixel_fraction(&stage, |p| p[1] > 0);
    if plan.instances.len() == count && seen > 0.1 { plan.draws.len() as f64 } else { f64::NAN }
}

fn facing() -> Stage {
    let mut stage = stage(DVec3::new(0.0, 0.0, 1.0), 0.1);
    add_actor(&mut stage, asset(quad(1e4), unlit(GREEN)), Placement::default());
    stage
}

fn sized(size: [u32; 2]) -> f64 {
    let count = size[0] as usize * size[1] as usize;
    pixel_difference(&draw(&facing(), size), &Ok([0, 255, 0, 255].repeat(count)))
}

/// A leaf of soft alpha, cut out by its alpha, over half the image.
pub fn leaf() -> Stage {
    let mut stage = stage(DVec3::new(0.0, 0.0, 2.0), 0.1);
    let texel = |i: u32| {
        let (x, y) = (f64::from(i % 32) - 15.5, f64::from(i / 32) - 15.5);
        [40, 160, 60, (127.5 + (11.0 - (x * x + y * y).sqrt()) * 25.0).clamp(0.0, 255.0) as u8]
    };
    let image = Image {
        name: "leaf".into(),
        width: 32,
        height: 32,
        rgba: (0..1024).flat_map(texel).collect(),
        file: None,
    };
    let texture =
        TextureRef { image: 0, sampler: Sampler::default(), uv_set: 0, uv_transform: Affine2::IDENTITY };
    let material =
        Material { base_color_texture: Some(texture), alpha_mode: AlphaMode::Mask(0.5), ..unlit(Vec4::ONE) };
    let asset = Asset { images: vec![Arc::new(image)], ..asset(quad(0.7), material) };
    add_actor(&mut stage, asset, Placement::default());
    stage
}

/// A wall lit by a sun and a lamp.
pub(crate) fn lit_wall() -> Stage {
    let mut stage = stage(DVec3::new(0.0, 0.0, 2.0), 0.1);
    stage.lights.push(sun());
    let lamp = Light { kind: LightKind::Point, color: Vec3::X, intensity: PI, range: Some(3.0) };
    stage.lights.push(StageLight { light: lamp, position: DVec3::Z, ..sun() });
    add_actor(&mut stage, asset(quad(0.7), matte()), Placement::default());
    stage
}

/// Two panes that intersect.
pub fn panes() -> Stage {
    let mut stage = stage(DVec3::new(0.0, 0.0, 2.0), 0.1);
    for (degrees, color) in [(40.0f64, Vec4::new(0.9, 0.1, 0.1, 0.6)), (-40.0, Vec4::new(0.1, 0.2, 0.9, 0.6))]
    {
        let glass = Material { alpha_mode: AlphaMode::Blend, double_sided: true, ..unlit(color) };
        let rotation = DQuat::from_rotation_y(degrees.to_radians());
        add_actor(&mut stage, asset(quad(0.6), glass), Placement { rotation, ..Placement::default() });
    }
    stage
}
