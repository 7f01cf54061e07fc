//! Content hashes: equal for equal content, different after any change.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::Time;
use choreo_stage::*;
use glam::{Affine2, DVec3, Vec3};
use std::collections::BTreeSet;
use std::sync::Arc;

fn scene() -> Stage {
    let f = figure();
    let mut stage = Stage::default();
    stage.cast("anna", f.clone());
    stage.play(0, Cue::new(f.clips[RAISE].clone()));
    stage.actors[0].look_at.push(LookAt::new(HEAD, Target::Point(DVec3::ZERO)));
    stage.shoot(Camera::new("c", Rig::Frame { azimuth: 0.0, elevation: 0.0 }));
    stage.lights.push(StageLight::sun("sun", Vec3::NEG_Y, 1.0));
    stage
}

fn parenting_with(change: fn(&mut Parenting)) -> Parenting {
    let mut parent = Parenting::always(Attachment { actor: 0, joint: None });
    change(&mut parent);
    parent
}

#[derive(Debug)]
struct NamedCallback(#[allow(dead_code)] &'static str);
impl FrameCallback for NamedCallback {
    fn run(&self, _: Time, _: &mut FrameEdits) -> Result<(), StageError> {
        Ok(())
    }
}

#[test]
fn content_hash_of_a_stage_changes_with_every_field() {
    let first = scene().content_hash();
    assert_eq!(first, scene().content_hash());
    let mut warned = scene();
    warned.warnings.push("clip longer than its slot".into());
    assert_eq!(first, warned.content_hash(), "warnings are no content");
    let changes: [fn(&mut Stage); 30] = [
        |s| s.settings.length = secs(5.0),
        |s| s.settings.background = Background::default(),
        |s| s.actors[0].name = "boris".into(),
        |s| s.actors[0].transform.translation.x = -0.0,
        |s| s.actors[0].parents = vec![Parenting::always(Attachment { actor: 0, joint: None })],
        |s| s.actors[0].parents = vec![Parenting::always(Attachment { actor: 0, joint: Some(0) })],
        |s| s.actors[0].parents = vec![parenting_with(|p| p.scale = ParentScale::Inherit)],
        |s| s.actors[0].parents = vec![parenting_with(|p| p.start = Time(1))],
        |s| s.actors[0].parents = vec![parenting_with(|p| p.blend = Time(1))],
        |s| s.actors[0].parents = vec![parenting_with(|p| p.keep = true)],
        |s| s.actors[0].parents = vec![parenting_with(|p| p.placement = Some(Placement::default()))],
        |s| s.actors[0].face = Some(0),
        |s| s.actors[0].shadow.cast = false,
        |s| s.actors[0].shadow.receive = false,
        |s| s.actors[0].tint.w = 0.5,
        |s| s.actors[0].layers.push(Layer::default()),
        |s| s.actors[0].layers[0].mask = Some(Arc::new(vec![1.0; 5])),
        |s| s.actors[0].layers[0].cues[0].start = Time(1),
        |s| s.actors[0].layers[0].cues[0].fade_in = Time(1),
        |s| s.actors[0].layers[0].cues[0].clip = figure().clips[NOD].clone(),
        |s| s.actors[0].look_at[0].target = Target::Actor(0),
        |s| s.cameras[0].rig = Rig::Frame { azimuth: 0.0, elevation: 0.1 },
        |s| s.cuts.push(Cut::new(Time::ZERO, 0)),
        |s| s.cameras[0].near_is_set = true,
        |s| s.cameras[0].lens_is_set = true,
        |s| s.lights[0].light.kind = LightKind::Point,
        |s| s.lights[0].shadow = Some(Shadow::default()),
        |s| s.actors[0].asset = stick(),
        |s| s.frame_callbacks.push(Arc::new(NamedCallback("a"))),
        |s| s.frame_callbacks.push(Arc::new(NamedCallback("b"))),
    ];
    let mut seen = BTreeSet::from([first]);
    for (index, change) in changes.iter().enumerate() {
        let mut stage = scene();
        change(&mut stage);
        assert!(seen.insert(stage.content_hash()), "change {index} is not in the hash");
    }
}

#[test]
fn content_hash_of_a_primitive_ignores_its_material() {
    let a = box_primitive(Vec3::ZERO, Vec3::ONE);
    let painted = Primitive { material: Some(3), ..a.clone() };
    assert_eq!(a.content_hash(), painted.content_hash());
    let mut moved = a.clone();
    moved.positions[7].z = f32::from_bits(moved.positions[7].z.to_bits() + 1);
    assert_ne!(a.content_hash(), moved.content_hash());
    // The same numbers in another array give another hash.
    let normals_only = Primitive { normals: a.positions.clone(), positions: a.normals.clone(), ..a.clone() };
    assert_ne!(a.content_hash(), normals_only.content_hash());
    let mesh = |name: &str, p: &Primitive| {
        Mesh { name: name.into(), primitives: vec![p.clone()], ..Mesh::default() }.content_hash()
    };
    assert_eq!(mesh("a", &a), mesh("b", &a));
    assert_ne!(mesh("a", &a), mesh("a", &painted));
}

#[test]
fn content_hash_of_materials_covers_image_content_and_texture_slots() {
    let image =
        |v: u8| Arc::new(Image { name: format!("{v}"), width: 1, height: 1, rgba: vec![v; 4], file: None });
    let textured = |image: u32| {
        let texture =
            TextureRef { image, sampler: Sampler::default(), uv_set: 0, uv_transform: Affine2::IDENTITY };
        Material { base_color_texture: Some(texture), ..Material::default() }
    };
    let hash = |material: Material, second: u8| {
        let images = vec![image(1), image(second)];
        Asset { materials: vec![material], images, ..Asset::default() }.content_hash()
    };
    let one = hash(textured(0), 1);
    assert_eq!(one, hash(textured(1), 1), "an image counts by its content, not by its index");
    assert_ne!(hash(textured(0), 2), hash(textured(1), 2));
    let mut other_slot = textured(0);
    other_slot.emissive_texture = other_slot.base_color_texture.take();
    assert_ne!(one, hash(other_slot.clone(), 1));
    let bare = |material: Material| material.hash_without_textures();
    assert_eq!(bare(textured(0)), bare(Material { name: "brass".into(), ..textured(1) }));
    assert_ne!(bare(textured(0)), bare(other_slot));
    assert_ne!(bare(textured(0)), bare(Material { relief: 0.1, ..textured(0) }));
    let layer_2d = |image: &Image| image.content_hash();
    assert_ne!(
        layer_2d(&Image { width: 2, height: 1, rgba: vec![0; 8], ..Image::default() }),
        layer_2d(&Image { width: 1, height: 2, rgba: vec![0; 8], ..Image::default() })
    );
}

#[test]
fn copy_of_an_asset_recomputes_hash_and_bounds_after_a_change() {
    let mut asset = figure();
    let (hash, bounds) = (asset.content_hash(), asset.rest_bounds());
    assert_eq!(hash, figure().content_hash());
    let kept = asset.clone();
    Arc::make_mut(&mut asset).instances.pop();
    assert_ne!(asset.content_hash(), hash);
    assert_ne!(asset.rest_bounds(), bounds);
    assert_eq!(kept.content_hash(), hash);
}
