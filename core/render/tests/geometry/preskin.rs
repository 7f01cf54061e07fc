//! Pre-skinning: the compute pass gives the image of the vertex shader for everything that deforms vertices; when it is used, and
//! when not.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_motion::Skinning;
use choreo_plugin::{Effect, Frame};
use choreo_render::commands::{Command, RecordOptions, Recording, record};
use choreo_render::plan::Features;
use choreo_render::*;
use choreo_stage::*;
use glam::{Affine3A, DAffine3, DVec3, EulerRot, Quat, Vec2, Vec3, Vec4};
use std::f32::consts::PI;
use std::sync::Arc;

/// The deformations of a tube.
#[derive(Clone, Copy, Debug)]
struct Way {
    influences: usize,
    skinning: Skinning,
    morphs: bool,
}

const WAYS: [Way; 6] = [
    Way { influences: 4, skinning: Skinning::Linear, morphs: false },
    Way { influences: 8, skinning: Skinning::Linear, morphs: true },
    Way { influences: 4, skinning: Skinning::DualQuaternion, morphs: true },
    Way { influences: 8, skinning: Skinning::DualQuaternion, morphs: false },
    Way { influences: 0, skinning: Skinning::Linear, morphs: true },
    Way { influences: 4, skinning: Skinning::Linear, morphs: true },
];

/// A closed tube about y from −1 to 1, whose weights blend from the lower joint to the upper one, with texture coordinates and tangents.
fn tube(way: Way) -> Primitive {
    let mut p = Primitive { influences: way.influences, material: Some(0), ..Primitive::default() };
    let (rings, around) = (21, 24);
    let mut target = MorphTarget::default();
    for ring in 0..rings {
        let s = ring as f32 / (rings - 1) as f32;
        for i in 0..around {
            let angle = i as f32 / around as f32 * 2.0 * PI;
            let normal = Vec3::new(angle.sin(), 0.0, angle.cos());
            let radius = if ring == 0 || ring + 1 == rings { 0.0 } else { 0.5 };
            p.positions.push(normal * radius + Vec3::Y * (2.0 * s - 1.0));
            p.normals.push(normal);
            p.tangents.push(Vec3::new(angle.cos(), 0.0, -angle.sin()).extend(1.0));
            p.uvs[0].push(Vec2::new(i as f32 / 6.0, s * 3.0));
            target.positions.push(if s > 0.5 { normal * (0.3 * s) } else { Vec3::ZERO });
            target.normals.push(Vec3::Y * (0.4 * s));
            target.tangents.push(Vec3::Y * 0.1);
            if way.influences > 0 {
                let (mut joints, mut weights) = (vec![0; way.influences], vec![0.0; way.influences]);
                (joints[0], weights[0]) = (0, 1.0 - s);
                (joints[way.influences - 1], weights[way.influences - 1]) = (1, s);
                p.joint_indices.extend(joints);
                p.joint_weights.extend(weights);
            }
            if ring + 1 < rings {
                let next = (i + 1) % around;
                let at = |r: usize, i: usize| (r * around + i) as u32;
                let quad = [at(ring, i), at(ring, next), at(ring + 1, next), at(ring + 1, i)];
                p.indices.extend([0, 1, 2, 0, 2, 3].map(|c: usize| quad[c]));
            }
        }
    }
    if way.morphs {
        p.morphs = vec![MorphTarget::default(), target];
    }
    p
}

/// Three tubes in different poses over a floor, under a sun and a lamp that cast shadows.
fn scene(way: Way) -> Scene {
    let mut scene = Scene::perspective(0.9, 6.0);
    let rough = image(8, 8, |x, y| [128 + (x * 9 % 40) as u8, 128 + (y * 7 % 30) as u8, 240, 255]);
    let skin = Material {
        normal_texture: Some(texture(0)),
        double_sided: true,
        ..matte(Vec4::new(0.8, 0.5, 0.3, 1.0))
    };
    let mut tubes = (*skinned_asset(vec![quad(1.0, 1.0)], vec![skin])).clone();
    Arc::make_mut(&mut tubes.meshes[0]).primitives = vec![tube(way)];
    tubes.images = vec![rough];
    tubes.skins[0].inverse_bind[1] = glam::Mat4::IDENTITY;
    if way.influences == 0 {
        tubes.instances[0].skin = None;
    }
    tubes.instances[0].weights = if way.morphs { vec![0.0, 0.7] } else { Vec::new() };
    let tubes = Arc::new(tubes);
    for i in 0..3 {
        let turn = DAffine3::from_rotation_z(0.3 * i as f64 - 0.3);
        let world = DAffine3::from_translation(DVec3::new(1.6 * i as f64 - 1.6, 0.0, -0.5 * i as f64)) * turn;
        let actor = scene.add(&tubes, world);
        let state = &mut scene.snapshot.actors[actor];
        let bend = Quat::from_euler(EulerRot::YXZ, 0.9 * i as f32, 0.5, 0.2);
        let upper = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.2, 0.9, 1.0),
            bend,
            Vec3::new(0.1, 0.1, 0.0),
        );
        state.model_from_joint = vec![Affine3A::IDENTITY, upper];
        state.skinning = way.skinning;
    }
    let floor = asset(vec![quad(6.0, 6.0)], vec![matte(Vec4::ONE)], vec![]);
    let down = DAffine3::from_translation(DVec3::NEG_Y * 1.5) * DAffine3::from_rotation_x(-1.5);
    scene.add(&floor, down);
    for (kind, position) in
        [(LightKind::Directional, DVec3::ZERO), (LightKind::Point, DVec3::new(1.0, 4.0, 3.0))]
    {
        let intensity = if kind == LightKind::Point { 12.0 } else { 0.7 };
        scene.snapshot.lights.push(LightState {
            light: Light { kind, color: Vec3::ONE, intensity, range: None },
            position,
            direction: Vec3::new(-0.4, -1.0, -0.5).normalize(),
            shadow: Some(Shadow::default()),
            attenuation: None,
        });
    }
    scene
}

fn effects() -> Vec<Effect> {
    effects::named(&["outline"])
}

fn with_pre_skinning(mut scene: Scene, pre_skinning: PreSkinning) -> Scene {
    scene.stage.settings.pre_skinning = pre_skinning;
    scene
}

fn record_of(
    scene: &Scene,
    options: &PlanOptions,
    device: RecordOptions,
) -> (Arc<SceneResources>, Plan, Recording) {
    let (resources, plan) = scene.plan(options);
    let triangles = |p: u32| resources.primitives[p as usize].primitive().indices.len() / 3;
    let recording = record(&plan, device, triangles);
    (resources, plan, recording)
}

/// Both use the same f32 formulas on the same 16-bit normals and weights, which the device fetches in one and a shader unpacks in the
/// other, so the last bit may differ, and with it a pixel on an edge.
fn assert_same(a: &Frame, b: &Frame, what: &str) {
    let c = compare(a, b, 2).unwrap();
    assert!(c.mean < 0.01 && c.share_beyond < 5e-4, "{what}: {c}");
}

#[test]
fn pre_skinning_and_vertex_shader_skinning_draw_the_same() {
    let Some(mut device) = vulkan(GpuOptions { effects: effects(), ..GpuOptions::default() }) else { return };
    let effects = effects();
    for way in WAYS {
        for (samples, outlined) in [(1, false), (4, true)] {
            let options = PlanOptions { effects: &effects, ..PlanOptions::new([200, 150], samples) };
            let scene = |once| {
                let mut scene = with_pre_skinning(scene(way), once);
                if outlined {
                    use_effect(&mut scene, "outline", &[], &[0]);
                }
                scene
            };
            let what = format!("{way:?} {samples}");
            let by_each = draw_with(&mut device, &scene(PreSkinning::Never), &options);
            assert_eq!(device.last_recording().unwrap().counts().preskinned, 0, "{what}");
            let once = draw_with(&mut device, &scene(PreSkinning::Always), &options);
            // Outline hulls have their own normals.
            let bodies = if outlined { 4 } else { 3 };
            assert_eq!(device.last_recording().unwrap().counts().preskinned, bodies, "{what}");
            assert_same(&by_each, &once, &what);
            // The comparison finds a slightly different pose.
            let mut moved = scene(PreSkinning::Always);
            let state = &mut moved.snapshot.actors[1];
            state.world_from_model.translation.x += 0.02;
            let moved = draw_with(&mut device, &moved, &options);
            let c = compare(&by_each, &moved, 2).unwrap();
            assert!(c.mean > 0.05, "{what}: a moved body is not told: {c}");
            // The CPU reference gives the same bits with and without pre-skinning.
            let cpu = draw(&scene(PreSkinning::Auto), &options);
            assert!(cpu == draw(&scene(PreSkinning::Never), &options), "{what}");
            let c = compare(&cpu, &once, 3).unwrap();
            assert!(c.mean < 0.2 && c.share_beyond < 0.02, "{what}: {c}");
        }
    }
}

/// Each frame in flight has its own pre-skinned vertices; buffers grow and are reused.
#[test]
fn frames_in_flight_have_their_own_pre_skinned_vertices() {
    let Some(mut device) = vulkan(GpuOptions::default()) else { return };
    let options = PlanOptions::new([120, 90], 1);
    let at = |i: usize| {
        let mut scene = with_pre_skinning(scene(WAYS[0]), PreSkinning::Always);
        let keep = if i.is_multiple_of(3) { 3 } else { 1 };
        for (a, state) in scene.snapshot.actors.iter_mut().take(3).enumerate() {
            state.visible = a < keep;
            state.model_from_joint[1] = Affine3A::from_rotation_y(0.4 * i as f32);
        }
        scene
    };
    let alone: Vec<Frame> = (0..6).map(|i| draw_with(&mut device, &at(i), &options)).collect();
    device.load(at(0).resources()).unwrap();
    let mut frames = Vec::new();
    for i in 0..6 {
        if i >= device.frames_in_flight() {
            frames.push(device.collect(None).unwrap());
        }
        device.submit(at(i).plan(&options).1).unwrap();
    }
    while frames.len() < 6 {
        frames.push(device.collect(None).unwrap());
    }
    assert!(frames == alone);
    assert!(frames[1] != frames[2]);
}

#[test]
fn only_meshes_drawn_several_times_are_pre_skinned() {
    let options = PlanOptions::new([200, 150], 1);
    let of = |once, lights: usize, device| {
        let mut scene = with_pre_skinning(scene(WAYS[0]), once);
        scene.snapshot.lights.truncate(1);
        let sun = scene.snapshot.lights[0];
        scene.snapshot.lights.resize(lights, sun);
        record_of(&scene, &options, device)
    };
    let gpu = RecordOptions::default();
    // Without shadows there is one pass.
    let (_, plan, recording) = of(PreSkinning::Auto, 0, gpu);
    assert_eq!((recording.counts().preskinned, recording.preskinned.len()), (0, 0));
    assert!(recording.preskinning_left_out(&plan).unwrap().why.starts_with("no mesh is drawn often enough"));
    // A sun adds passes, but too few for pre-skinning to pay.
    let (_, plan, recording) = of(PreSkinning::Auto, 1, gpu);
    assert_eq!(recording.counts().preskinned, 0);
    assert!(recording.preskinning_left_out(&plan).is_some());
    // Six suns with shadow maps.
    assert_eq!(of(PreSkinning::Auto, 6, gpu).2.counts().preskinned, 3);
    let (resources, plan, recording) = of(PreSkinning::Always, 1, gpu);
    assert_eq!(recording.counts().preskinned, 3);
    assert_eq!(recording.preskinning_left_out(&plan), None);
    let vertices = resources.primitives[0].primitive().positions.len() as u64;
    assert_eq!(recording.preskinned_vertices(&resources), (3, 3 * vertices));
    // Position, normal, tangent.
    assert_eq!(recording.preskinned_bytes(&resources), 3 * vertices * 4 * (3 + 3 + 4));
    for command in &recording.commands {
        let Command::BindPipeline(variant) = command else { continue };
        assert!(!variant.key.features.has(Features::SKIN));
    }
    // Neither a device nor a stage that excludes pre-skinning gets it.
    for (once, device) in
        [(PreSkinning::Never, gpu), (PreSkinning::Always, RecordOptions { no_compute: true, ..gpu })]
    {
        let (_, plan, recording) = of(once, 1, device);
        assert_eq!(recording.counts().preskinned, 0);
        assert!(recording.preskinning_left_out(&plan).is_some());
        assert!(recording.reads().joints);
    }
}

/// A device without compute draws the same.
#[test]
fn devices_without_compute_skin_in_the_vertex_shader() {
    let without = vec![vulkan::Ability::Compute];
    let Some(mut device) = vulkan(GpuOptions { without, ..GpuOptions::default() }) else { return };
    let Some(mut whole) = vulkan(GpuOptions::default()) else { return };
    let (scene, options) =
        (with_pre_skinning(scene(WAYS[2]), PreSkinning::Always), PlanOptions::new([120, 90], 1));
    let by_each = draw_with(&mut device, &scene, &options);
    assert_eq!(device.last_recording().unwrap().counts().preskinned, 0);
    let once = draw_with(&mut whole, &scene, &options);
    assert_eq!(whole.last_recording().unwrap().counts().preskinned, 3);
    assert_same(&by_each, &once, "without compute");
}

/// The output vertices or the source mesh exceed the device's limit of a bound buffer.
#[test]
fn meshes_beyond_the_buffer_limit_are_skinned_in_the_vertex_shader() {
    let Some(mut whole) = vulkan(GpuOptions::default()) else { return };
    let (scene, options) =
        (with_pre_skinning(scene(WAYS[0]), PreSkinning::Always), PlanOptions::new([120, 90], 1));
    let once = draw_with(&mut whole, &scene, &options);
    let (resources, plan) = scene.plan(&options);
    let bytes = whole.last_recording().unwrap().preskinned_bytes(&resources) as u32;
    let mesh = bytes / 3;
    let draw = |most: u32| {
        let masked = GpuOptions { storage_range: Some(most), ..GpuOptions::default() };
        let mut device = vulkan(masked).unwrap();
        device.load(resources.clone()).unwrap();
        device.submit(plan.clone()).and_then(|()| device.collect(None)).map(|frame| {
            assert_same(&frame, &once, &format!("{most} bytes"));
            device.last_recording().unwrap().counts().preskinned
        })
    };
    assert_eq!(draw(bytes).unwrap(), 3);
    assert_eq!(draw(bytes - 1).unwrap(), 0);
    assert_eq!(draw(mesh / 2).unwrap(), 0);
    let said = draw(64).unwrap_err().to_string();
    assert!(
        said.starts_with("size in bytes of all instances is ") && said.ends_with("device is 64"),
        "{said}"
    );
}
