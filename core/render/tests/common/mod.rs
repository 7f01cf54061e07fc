//! Scenes built in code, for the tests of plans and renderers.
#![allow(dead_code)]

pub(crate) mod layered;

use choreo_asset::*;
use choreo_motion::{Skeleton, Time, Transform};
use choreo_render::{Plan, PlanOptions, SceneResources};
use choreo_stage::*;
use glam::{Affine3A, DAffine3, DVec3, Mat4, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// A stage with its snapshot, built actor by actor.
pub(crate) struct Scene {
    pub stage: Stage,
    pub snapshot: Snapshot,
}

impl Scene {
    /// An orthographic camera at z = 10 looking along −Z on a view `height` metres high; black background, no light.
    pub(crate) fn ortho(height: f32) -> Scene {
        let camera = CameraState {
            camera: None,
            world_from_view: DAffine3::from_translation(DVec3::new(0.0, 0.0, 10.0)),
            projection: Projection::Orthographic { height, near: 0.1, far: 100.0 },
        };
        Scene::with_camera(camera)
    }

    /// A perspective camera at z = `distance`.
    pub(crate) fn perspective(yfov: f32, distance: f64) -> Scene {
        let camera = CameraState {
            camera: None,
            world_from_view: DAffine3::from_translation(DVec3::new(0.0, 0.0, distance)),
            projection: Projection::Perspective { yfov, near: 0.1, far: None },
        };
        Scene::with_camera(camera)
    }

    pub(crate) fn with_camera(camera: CameraState) -> Scene {
        // No view transform, so that closed forms hold.
        let settings = Settings { view_transform: ViewTransform::None, ..Settings::default() };
        Scene {
            stage: Stage { settings, ..Stage::default() },
            snapshot: Snapshot {
                time: Time::ZERO,
                actors: Vec::new(),
                camera,
                dissolve: None,
                lights: Vec::new(),
                sky: None,
                layers_2d: Vec::new(),
                background: Background::Color(Vec4::new(0.0, 0.0, 0.0, 1.0)),
                ambient_up: Vec3::ZERO,
                ambient_down: Vec3::ZERO,
                effects: Vec::new(),
            },
        }
    }

    pub(crate) fn add(&mut self, asset: &Arc<Asset>, world_from_model: DAffine3) -> usize {
        let name = format!("actor{}", self.stage.actors.len());
        self.stage.actors.push(Actor::new(&name, asset.clone()));
        let mut model_from_joint: Vec<Affine3A> = Vec::new();
        for (parent, rest) in asset.skeleton.parents().iter().zip(asset.skeleton.rest()) {
            let local = rest.to_affine();
            model_from_joint.push(parent.map_or(local, |p| model_from_joint[p as usize] * local));
        }
        self.snapshot.actors.push(ActorState {
            visible: true,
            world_from_parent: Default::default(),
            world_from_model,
            model_from_joint,
            morph_weights: asset.instances.iter().map(|i| i.weights.clone()).collect(),
            tint: Vec4::ONE,
            line_width: None,
            copies: None,
            base_colors: Vec::new(),
            skinning: Default::default(),
            materials: Vec::new(),
            culled: false,
        });
        self.stage.actors.len() - 1
    }

    pub(crate) fn at(&mut self, asset: &Arc<Asset>, x: f64, y: f64, z: f64) -> usize {
        self.add(asset, DAffine3::from_translation(DVec3::new(x, y, z)))
    }

    pub(crate) fn sun(&mut self, direction: Vec3, color: Vec3, intensity: f32) {
        let light = Light { kind: LightKind::Directional, color, intensity, range: None };
        self.snapshot.lights.push(LightState {
            light,
            position: DVec3::ZERO,
            direction: direction.normalize(),
            shadow: None,
            attenuation: None,
        });
    }

    pub(crate) fn resources(&self) -> Arc<SceneResources> {
        Arc::new(SceneResources::new(&self.stage))
    }

    /// Intensities of lights in the snapshot are multiples of π lux or candela: a white surface under 1 is 1.
    pub(crate) fn plan(&self, options: &PlanOptions) -> (Arc<SceneResources>, Plan) {
        let resources = self.resources();
        let mut snapshot = self.snapshot.clone();
        snapshot.lights.iter_mut().for_each(|l| l.light.intensity *= std::f32::consts::PI);
        let plan = Plan::new(&resources, &self.stage, &snapshot, options);
        (resources, plan)
    }
}

/// A quad in the z = 0 plane facing +Z, uv (0,0) at its top left.
pub(crate) fn quad(half_width: f32, half_height: f32) -> Primitive {
    let (w, h) = (half_width, half_height);
    Primitive {
        indices: vec![0, 1, 2, 0, 2, 3],
        positions: vec![
            Vec3::new(-w, -h, 0.0),
            Vec3::new(w, -h, 0.0),
            Vec3::new(w, h, 0.0),
            Vec3::new(-w, h, 0.0),
        ],
        normals: vec![Vec3::Z; 4],
        uvs: [vec![Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0), Vec2::ZERO], vec![]],
        material: Some(0),
        ..Primitive::default()
    }
}

/// A cube of half a side, its normals split at the edges.
pub(crate) fn cube(half: f32) -> Primitive {
    let mut cube = Primitive { material: Some(0), ..Primitive::default() };
    for (n, u) in [
        (Vec3::X, Vec3::Y),
        (Vec3::NEG_X, Vec3::Y),
        (Vec3::Y, Vec3::Z),
        (Vec3::NEG_Y, Vec3::Z),
        (Vec3::Z, Vec3::X),
        (Vec3::NEG_Z, Vec3::X),
    ] {
        let v = n.cross(u);
        let first = cube.positions.len() as u32;
        for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            cube.positions.push((n + u * a + v * b) * half);
            cube.normals.push(n);
        }
        cube.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }
    cube
}

pub(crate) fn triangle(a: Vec3, b: Vec3, c: Vec3) -> Primitive {
    Primitive {
        indices: vec![0, 1, 2],
        positions: vec![a, b, c],
        normals: vec![Vec3::Z; 3],
        material: Some(0),
        ..Primitive::default()
    }
}

pub(crate) fn unlit(color: Vec4) -> Material {
    Material { shading: Shading::Unlit, base_color: color, ..Material::default() }
}

/// A rough dielectric: Lambertian, with a small specular part.
pub(crate) fn matte(color: Vec4) -> Material {
    Material { base_color: color, metallic: 0.0, ..Material::default() }
}

/// An asset with one mesh on one joint.
pub(crate) fn asset(
    primitives: Vec<Primitive>,
    materials: Vec<Material>,
    images: Vec<Arc<Image>>,
) -> Arc<Asset> {
    let morph_targets = primitives.iter().map(|p| p.morphs.len()).max().unwrap_or(0);
    let skeleton = Skeleton::new(vec!["root".into()], vec![None], vec![Transform::IDENTITY]).unwrap();
    Arc::new(Asset {
        name: "test".into(),
        skeleton: Arc::new(skeleton),
        meshes: vec![Arc::new(Mesh { primitives, morph_targets, ..Mesh::default() })],
        instances: vec![MeshInstance {
            joint: 0,
            mesh: 0,
            skin: None,
            weights: vec![0.0; morph_targets],
            ..Default::default()
        }],
        materials,
        images,
        ..Asset::default()
    })
}

/// An asset whose mesh has a skin of two joints: the root, and one a metre above it.
pub(crate) fn skinned_asset(mut primitives: Vec<Primitive>, materials: Vec<Material>) -> Arc<Asset> {
    for p in &mut primitives {
        p.influences = 4;
        for position in &p.positions {
            p.joint_indices.extend([0, 1, 0, 0]);
            let upper = if position.y > 0.0 { 1.0 } else { 0.0 };
            p.joint_weights.extend([1.0 - upper, upper, 0.0, 0.0]);
        }
    }
    let up = Transform { translation: Vec3::Y, ..Transform::IDENTITY };
    let skeleton =
        Skeleton::new(vec!["root".into(), "top".into()], vec![None, Some(0)], vec![Transform::IDENTITY, up])
            .unwrap();
    let mut a = (*asset(primitives, materials, vec![])).clone();
    a.skeleton = Arc::new(skeleton);
    a.skins = vec![Skin {
        joints: vec![0, 1],
        inverse_bind: vec![Mat4::IDENTITY, Mat4::from_translation(-Vec3::Y)],
    }];
    a.instances[0].skin = Some(0);
    Arc::new(a)
}

pub(crate) fn texture(image: u32) -> TextureRef {
    TextureRef { image, sampler: Sampler::default(), uv_set: 0, uv_transform: glam::Affine2::IDENTITY }
}

pub(crate) fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Arc<Image> {
    let rgba = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y));
    Arc::new(Image { name: String::new(), width, height, rgba: rgba.collect(), file: None })
}

use choreo_plugin::Frame;
use choreo_render::{CpuRenderer, GpuOptions, RenderError, Renderer, VulkanRenderer};

/// A Vulkan renderer with the validation layer; prints a message and returns `None` without Vulkan.
pub(crate) fn vulkan(options: GpuOptions) -> Option<VulkanRenderer> {
    match VulkanRenderer::new(GpuOptions { validation: true, ..options }) {
        Ok(renderer) => Some(renderer),
        Err(RenderError::NoVulkan { why }) => {
            println!("SKIP 1: {}", why.lines().next().unwrap_or_default());
            None
        }
        Err(e) => panic!("{e}"),
    }
}

pub(crate) fn draw_with(renderer: &mut dyn Renderer, scene: &Scene, options: &PlanOptions) -> Frame {
    let (resources, plan) = scene.plan(options);
    renderer.load(resources).unwrap();
    renderer.submit(plan).unwrap();
    renderer.collect(None).unwrap()
}

/// Draws on the CPU.
pub(crate) fn draw(scene: &Scene, options: &PlanOptions) -> Frame {
    draw_with(&mut CpuRenderer::new(options.effects), scene, options)
}

pub(crate) fn draw_at(scene: &Scene, size: [u32; 2], samples: u32) -> Frame {
    draw(scene, &PlanOptions::new(size, samples))
}

pub(crate) fn pixel(f: &Frame, x: u32, y: u32) -> [u8; 4] {
    let at = ((y * f.width + x) * 4) as usize;
    f.rgba[at..at + 4].try_into().unwrap()
}

/// The sRGB code of linear light in f64, not rounded (IEC 61966-2-1).
pub(crate) fn encode(linear: f64) -> f64 {
    let v = linear.clamp(0.0, 1.0);
    255.0 * if v <= 0.0031308 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

pub(crate) fn decode(code: u8) -> f64 {
    let v = f64::from(code) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

#[track_caller]
pub(crate) fn assert_color(got: [u8; 4], linear: [f64; 3], what: &str) {
    assert_within(0.75, got, linear, what);
}

/// A dithered color is one of the two codes beside the exact one.
pub(crate) fn assert_dithered_color(got: [u8; 4], linear: [f64; 3], what: &str) {
    assert_within(1.0, got, linear, what);
}

fn assert_within(codes: f64, got: [u8; 4], linear: [f64; 3], what: &str) {
    for c in 0..3 {
        let e = encode(linear[c]);
        assert!(
            (f64::from(got[c]) - e).abs() <= codes,
            "{what}: channel {c} is {} instead of {e:.2}",
            got[c]
        );
    }
}

/// A scene of lit, unlit, textured, skinned, alpha-tested and blended quads under a sun and a lamp.
pub(crate) fn busy_scene(offset: DVec3) -> Scene {
    let mut scene = Scene::perspective(0.9, 6.0);
    scene.snapshot.camera.world_from_view.translation += offset;
    scene.snapshot.ambient_up = Vec3::splat(0.3);
    scene.snapshot.ambient_down = Vec3::splat(0.1);
    scene.sun(Vec3::new(-0.3, -0.7, -0.6), Vec3::new(1.0, 0.9, 0.8), 0.9);
    scene.snapshot.lights.push(LightState {
        light: Light { kind: LightKind::Point, color: Vec3::X, intensity: 2.0, range: Some(9.0) },
        position: DVec3::new(1.0, 1.0, 2.0) + offset,
        direction: Vec3::NEG_Y,
        shadow: None,
        attenuation: None,
    });
    let picture = image(16, 16, |x, y| [(x * 16) as u8, (y * 16) as u8, 128, ((x + y) * 8) as u8]);
    for i in 0..12 {
        let material = Material {
            base_color_texture: (i % 2 == 0).then(|| texture(0)),
            alpha_mode: [AlphaMode::Opaque, AlphaMode::Mask(0.4), AlphaMode::Blend][i % 3],
            shading: [
                Shading::MetallicRoughness,
                Shading::BlinnPhong,
                Shading::Unlit,
                Shading::MetallicRoughness,
            ][i % 4],
            roughness: 0.4,
            emissive: Vec3::splat(if i == 5 { 0.2 } else { 0.0 }),
            double_sided: i % 5 == 0,
            ..matte(Vec4::new(0.9, 0.8, 0.7, 0.6))
        };
        let mut a = (*asset(vec![quad(0.8, 0.6)], vec![material], vec![picture.clone()])).clone();
        if i % 4 == 3 {
            a = (*skinned_asset(a.meshes[0].primitives.clone(), a.materials)).clone();
            a.images = vec![picture.clone()];
        }
        let turn = glam::DQuat::from_euler(glam::EulerRot::YXZ, i as f64 * 0.37, i as f64 * 0.21, 0.1);
        let place = DVec3::new((i % 4) as f64 - 1.5, (i / 4) as f64 - 1.0, (i % 5) as f64 * 0.5) + offset;
        scene.add(&Arc::new(a), DAffine3::from_rotation_translation(turn, place));
    }
    scene
}

/// Adds an effect that is always on; on these actors only, or on everything if `actors` is empty.
pub(crate) fn use_effect(scene: &mut Scene, plugin: &str, parameters: &[(&str, f64)], actors: &[usize]) {
    let parameters: Vec<(String, f64)> = parameters.iter().map(|(n, v)| (n.to_string(), *v)).collect();
    let effect = scene.stage.effects.len();
    scene.snapshot.effects.push(EffectState { effect, parameters: parameters.clone() });
    let on = actors.iter().map(|actor| EffectTarget { actor: *actor, material: None }).collect();
    scene.stage.effects.push(EffectUse { plugin: plugin.into(), parameters, on, ..EffectUse::default() });
}
