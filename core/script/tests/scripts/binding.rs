//! Raw binding: a clip of another file on a character whose joints have the same names and another bind pose.

use choreo_asset::Asset;
use choreo_motion::{Curve, Interpolation, Path, Pose, Sample, Time, Transform};
use choreo_plugin::{
    AssetBuilder, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Registry, Source,
};
use choreo_script::{Script, ScriptOptions, run_text};
use glam::{DQuat, DVec3, Quat, Vec3};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> =
    LazyLock::new(|| Manifest::new("rig", "1", "an arm, or its motion").extensions(["rig"]));

/// `character.rig`: root, arm, hand, tail. `moves.rig`: the same joints in another order with another bind pose, one more, no tail,
/// and a clip.
struct Rig;

fn turned(z: f32, x: f32) -> Transform {
    Transform { translation: Vec3::X * x, rotation: Quat::from_rotation_z(z), scale: Vec3::ONE }
}

fn curve(joint: u32, path: Path, values: &[f32]) -> Curve {
    let times = [Time::ZERO, Time::from_secs(1.0)].into();
    Curve { joint, path, interpolation: Interpolation::Linear, times, values: values.into() }
}

impl Importer for Rig {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn import(
        &self,
        source: &Source,
        _: &dyn Files,
        _: ImportScope,
        _: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let mut b = AssetBuilder::default();
        let root = b.joint("root", None, Transform::IDENTITY).unwrap();
        if source.name.ends_with("character.rig") {
            let arm = b.joint("arm", Some(root), turned(0.3, 1.0)).unwrap();
            let hand = b.joint("hand", Some(arm), turned(-0.2, 0.5)).unwrap();
            b.joint("tail", Some(hand), turned(0.7, 0.25)).unwrap();
        } else {
            let prop = b.joint("prop", Some(root), turned(0.0, 9.0)).unwrap();
            // A unit ten times as large, which retargeting would scale.
            let arm = b.joint("arm", Some(root), turned(1.1, 10.0)).unwrap();
            let hand = b.joint("hand", Some(arm), turned(0.9, 5.0)).unwrap();
            let [a, c] = [Quat::from_rotation_y(0.4), Quat::from_rotation_x(1.3)].map(|q| q.to_array());
            let curves = vec![
                curve(arm, Path::Rotation, &[a, c].concat()),
                curve(arm, Path::Translation, &[1.5, 0.1, 0.0, 2.5, 0.2, 0.3]),
                curve(hand, Path::Rotation, &[c, a].concat()),
                curve(prop, Path::Translation, &[0.0; 6]),
            ];
            b.clip("move", curves);
        }
        Ok(b.finish(&source.name).unwrap())
    }
}

fn run(text: &str) -> Script {
    let mut registry = Registry::default();
    registry.add_importer(Rig);
    let folder = tempfile::tempdir().unwrap();
    ["character.rig", "moves.rig", "other.rig"]
        .iter()
        .for_each(|name| std::fs::write(folder.path().join(name), "").unwrap());
    run_text("t.rhai", text, folder.path(), &registry, &ScriptOptions::default()).unwrap()
}

const BOUND: &str = "stage(#{ length: 1.0 });
let character = load(\"character.rig\");
let moves = load(\"moves.rig\");
cast(\"ada\", character).play(moves.clip(\"move\").bind(character));
cast(\"own\", moves).play(moves.clip(\"move\"));\n";

/// The local pose of an actor's first cue.
fn pose(script: &Script, actor: usize, time: Time) -> Pose {
    let actor = &script.stage.actors[actor];
    let mut pose = Pose::rest(&actor.asset.skeleton);
    Sample { clip: &actor.layers[0].cues[0].clip, time, pose: &mut pose }.run();
    pose
}

#[test]
fn local_transforms_are_bit_for_bit_those_of_the_clip() {
    let script = run(BOUND);
    let [character, moves] = [0, 1].map(|i| script.stage.actors[i].asset.skeleton.clone());
    for secs in [0.0, 0.125, 0.3, 0.77, 1.0] {
        let time = Time::from_secs(secs);
        let [bound, own] = [0, 1].map(|actor| pose(&script, actor, time));
        let local = |pose: &Pose, of: &choreo_motion::Skeleton, name: &str| {
            pose.get(of.names().iter().position(|n| n == name).unwrap())
        };
        let bits = |t: Transform| {
            (t.translation.to_array().map(f32::to_bits), t.rotation.to_array().map(f32::to_bits))
        };
        let [ada, source] = [local(&bound, &character, "arm"), local(&own, &moves, "arm")];
        assert_eq!(bits(ada), bits(source), "{secs} s");
        let [ada, source] = [local(&bound, &character, "hand"), local(&own, &moves, "hand")];
        assert_eq!(bits(ada).1, bits(source).1, "{secs} s");
        // Without keys the character's own bind pose stays: the hand's place, and the tail.
        assert_eq!(ada.translation, Vec3::X * 0.5);
        assert_eq!(local(&bound, &character, "tail"), turned(0.7, 0.25));
    }
}

/// The tail's place in the world, from the keys and the bind pose in f64.
#[test]
fn the_character_stands_where_the_keys_put_it() {
    let script = run(BOUND);
    let state = script.stage.at(Time::ZERO).unwrap().actors[0].clone();
    let (a, c) = (DQuat::from_rotation_y(0.4), DQuat::from_rotation_x(1.3));
    let expected = DVec3::new(1.5, 0.1, 0.0) + a * (DVec3::X * 0.5 + c * (DVec3::X * 0.25));
    let tail = state.world_from_joint(3).unwrap().translation;
    assert!(tail.abs_diff_eq(expected, 1e-6), "{tail} {expected}");
    // Retargeted by the bind poses, it stands elsewhere.
    let played = run(&BOUND.replace(".bind(character)", ".retarget(character, #{})"));
    let tail = played.stage.at(Time::ZERO).unwrap().actors[0].world_from_joint(3).unwrap().translation;
    assert!(!tail.abs_diff_eq(expected, 1e-2), "{tail}");
}

#[test]
fn joints_that_the_character_lacks_are_reported_once() {
    let script = run(BOUND);
    let texts: Vec<String> = script.warnings.iter().map(ToString::to_string).collect();
    let about: Vec<&String> = texts.iter().filter(|text| text.contains("prop")).collect();
    assert_eq!(about.len(), 1, "{texts:?}");
    assert!(
        about[0].contains(
            "clip \"move\" of \"moves.rig\" on \"character.rig\": the skeleton lacks 1 of 3 animated joints: prop"
        ),
        "{texts:?}"
    );
}
