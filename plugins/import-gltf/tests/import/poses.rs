//! Every clip of every animated sample file, imported, sampled and brought to model space, against an
//! f64 evaluation of the specification that shares no code with it (`oracle`). Run with `--nocapture`
//! for the table of worst errors.

use crate::common;
use crate::oracle::{Fault, Oracle};
use choreo_asset::Asset;
use choreo_motion::{LocalToModel, Pose, Sample, Time};
use glam::{Affine3A, DMat4, DVec3, Mat4, Vec3};
use std::path::Path;

const ANIMATED: &[&str] = &[
    "gltf/AnimatedMorphCube.glb",
    "gltf/AnimatedTriangle.gltf",
    "gltf/BoxAnimated.glb",
    "gltf/CesiumMan.glb",
    "gltf/Fox.glb",
    "gltf/InterpolationTest.glb",
    "gltf/Knight.glb",
    "gltf/RiggedSimple.glb",
    "gltf/RobotExpressive.glb",
    "gltf/SimpleMorph.gltf",
    "gltf/SimpleSkin.gltf",
    "gltf/lightCameraAnimations.gltf",
    "vrm/test.vrma",
];

/// Worst error allowed, relative to the model's size. f32 has 6e-8 a number; a dozen joints in a row,
/// each a rotation and a translation, come to a few 1e-7.
const ALLOWED: f64 = 1e-6;

#[derive(Debug, Default)]
struct LargestError {
    error: f64,
    clip: String,
    secs: f64,
    place: String,
}

impl LargestError {
    fn record(&mut self, error: f64, clip: &str, secs: f64, place: impl Fn() -> String) {
        // A NaN is the worst there is.
        if error > self.error || error.is_nan() {
            *self = LargestError {
                error: if error.is_nan() { f64::INFINITY } else { error },
                clip: clip.to_string(),
                secs,
                place: place(),
            };
        }
    }
}

struct Comparison {
    size: f64,
    joints: LargestError,
    vertices: LargestError,
    weights: LargestError,
}

/// Times to look at: a grid that falls between keys, before, after, and keys themselves, but not where STEP jumps.
fn times(oracle: &Oracle, clip: usize, duration: f64, grid: usize) -> Vec<Time> {
    let (keys, jumps) = oracle.key_times(clip);
    let every = keys.len() / 12 + 1;
    let grid = (0..=grid).map(|i| duration * (i as f64 * 1.02 / grid as f64 - 0.01));
    grid.chain(keys.into_iter().step_by(every))
        .filter(|t| jumps.iter().all(|jump| (jump - t).abs() > 1e-6))
        .map(Time::from_secs)
        .collect()
}

fn sampled(asset: &Asset, clip: Option<usize>, time: Time) -> Vec<Affine3A> {
    let mut pose = Pose::rest(&asset.skeleton);
    if let Some(clip) = clip {
        let mut job = Sample { clip: &asset.clips[clip], time, pose: &mut pose };
        job.check().unwrap();
        job.run();
    }
    let mut out = vec![Affine3A::IDENTITY; asset.skeleton.len()];
    let mut job = LocalToModel { skeleton: &asset.skeleton, pose: &pose, model_from_joint: &mut out };
    job.check().unwrap();
    job.run();
    out
}

/// Vertices of an instance in the world, the file's own first (flat normals append copies).
fn world_vertices(asset: &Asset, instance: usize, matrices: &[Affine3A], weights: &[f32]) -> Vec<Vec<Vec3>> {
    let instance = &asset.instances[instance];
    let mesh = &asset.meshes[instance.mesh as usize];
    let skin = instance.skin.map(|s| &asset.skins[s as usize]);
    let skin_matrices: Option<Vec<Mat4>> = skin.map(|s| {
        s.joints.iter().zip(&s.inverse_bind).map(|(j, b)| Mat4::from(matrices[*j as usize]) * *b).collect()
    });
    let place = |p: &choreo_asset::Primitive| -> Vec<Vec3> {
        let vertex = |v: usize| {
            let mut at = p.positions[v];
            for (morph, weight) in p.morphs.iter().zip(weights) {
                at += morph.positions.get(v).copied().unwrap_or_default() * *weight;
            }
            match &skin_matrices {
                Some(m) if p.influences > 0 => (v * p.influences..(v + 1) * p.influences)
                    .map(|k| m[p.joint_indices[k] as usize].transform_point3(at) * p.joint_weights[k])
                    .sum(),
                _ => matrices[instance.joint as usize].transform_point3(at),
            }
        };
        (0..p.positions.len()).map(vertex).collect()
    };
    mesh.primitives.iter().map(place).collect()
}

/// Diagonal of everything at rest: joints and vertices.
fn model_size(oracle: &Oracle) -> f64 {
    let world = oracle.pose(None, 0.0).0;
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut grow = |p: DVec3| (low, high) = (low.min(p), high.max(p));
    for node in &oracle.order {
        grow(world[*node].w_axis.truncate());
        if oracle.json["nodes"][*node]["mesh"].is_u64() {
            oracle.vertices(*node, &world, &[]).into_iter().flatten().for_each(&mut grow);
        }
    }
    (high - low).length()
}

/// Distance between two transforms: of the origin, and of points a tenth of the model's size along each axis.
fn difference(ours: Affine3A, truth: DMat4, size: f64) -> f64 {
    let ours = Mat4::from(ours).as_dmat4();
    let longest = (0..3).map(|c| truth.col(c).length()).fold(1e-12, f64::max);
    let axes = (0..3).map(|c| (ours.col(c) - truth.col(c)).length() / longest * 0.1 * size);
    axes.fold((ours.w_axis - truth.w_axis).length(), f64::max)
}

fn compare(asset: &Asset, oracle: &Oracle, grid: usize) -> Comparison {
    let size = model_size(oracle);
    let mut out = Comparison {
        size,
        joints: LargestError::default(),
        vertices: LargestError::default(),
        weights: LargestError::default(),
    };
    assert_eq!(asset.skeleton.len(), oracle.order.len());
    assert_eq!(asset.clips.len(), oracle.clips());
    for (number, clip) in asset.clips.iter().enumerate() {
        let times = times(oracle, number, clip.duration.as_secs(), grid);
        assert!(times.len() >= grid / 2, "{}: nothing to compare", clip.name);
        for (count, time) in times.iter().enumerate() {
            let secs = time.as_secs();
            let ours = sampled(asset, Some(number), *time);
            let (world, weights) = oracle.pose(Some(number), secs);
            for (joint, node) in oracle.order.iter().enumerate() {
                let error = difference(ours[joint], world[*node], size) / size;
                out.joints.record(error, &clip.name, secs, || asset.skeleton.names()[joint].clone());
            }
            for (instance, i) in asset.instances.iter().enumerate() {
                let node = oracle.order[i.joint as usize];
                let mut own = i.weights.clone();
                let driven = clip.sample_weights(i.joint, *time, &mut own);
                let truth = weights.iter().find(|(n, _)| *n == node);
                assert_eq!(driven, truth.is_some());
                let truth = match truth {
                    Some((_, w)) => w.clone(),
                    None => own.iter().map(|w| f64::from(*w)).collect(),
                };
                for (a, b) in own.iter().zip(&truth) {
                    out.weights
                        .record((f64::from(*a) - b).abs(), &clip.name, secs, || format!("nodes[{node}]"));
                }
                // Vertices cost more: at one time of each clip, which differs from clip to clip.
                if count == (number * 7 + 23) % times.len() {
                    let ours = world_vertices(asset, instance, &ours, &own);
                    for (p, truth) in oracle.vertices(node, &world, &truth).iter().enumerate() {
                        assert!(ours[p].len() >= truth.len());
                        for (v, (a, b)) in ours[p].iter().zip(truth).enumerate() {
                            let error = (a.as_dvec3() - *b).length() / size;
                            let place = || format!("nodes[{node}], primitive {p}, vertex {v}");
                            out.vertices.record(error, &clip.name, secs, place);
                        }
                    }
                }
            }
        }
    }
    out
}

fn import_with_oracle(folder: &Path, name: &str) -> (Asset, Oracle) {
    let path = folder.join(name);
    (common::import_path_without_bones(&path).unwrap_or_else(|e| panic!("{e}")), Oracle::open(&path))
}

#[test]
fn poses_of_every_animated_file_equal_the_reference() {
    let Some(folder) = common::assets(ANIMATED.len()) else { return };
    println!("file | size m | worst joint, mm | relative | clip, s, joint | worst vertex, relative | weight");
    for name in ANIMATED {
        let (asset, oracle) = import_with_oracle(&folder, name);
        let c = compare(&asset, &oracle, 60);
        println!(
            "{name} | {:.3} | {:.2e} | {:.1e} | {}, {:.3}, {} | {:.1e} {} | {:.1e}",
            c.size,
            c.joints.error * c.size * 1000.0,
            c.joints.error,
            c.joints.clip,
            c.joints.secs,
            c.joints.place,
            c.vertices.error,
            c.vertices.place,
            c.weights.error
        );
        assert!(c.joints.error <= ALLOWED, "{name}: {:?}", c.joints);
        assert!(c.vertices.error <= ALLOWED, "{name}: {:?}", c.vertices);
        assert!(c.weights.error <= ALLOWED, "{name}: {:?}", c.weights);
    }
}

/// The order of joints is that of the scene, depth first, with the file's names and parents.
#[test]
fn names_and_parents() {
    let Some(folder) = common::assets(ANIMATED.len()) else { return };
    for name in ANIMATED {
        let (asset, oracle) = import_with_oracle(&folder, name);
        for (joint, node) in oracle.order.iter().enumerate() {
            let named = oracle.json["nodes"][*node]["name"].as_str();
            let expected = named.map_or(format!("node {node}"), str::to_string);
            assert_eq!(asset.skeleton.names()[joint], expected, "{name}");
            let parent = asset.skeleton.parents()[joint].map(|p| oracle.order[p as usize]);
            assert_eq!(parent, oracle.parent[*node], "{name}");
        }
    }
}

/// The comparison sees mistakes: one joint's rotation mirrored, one joint a thousandth of the model off, 1 ms late.
#[test]
fn the_comparison_detects_planted_faults() {
    let Some(folder) = common::assets(3) else { return };
    let (asset, mut oracle) = import_with_oracle(&folder, "gltf/Fox.glb");
    let node = *oracle.order.iter().find(|n| oracle.json["nodes"][**n]["name"] == "b_Head_05").unwrap();
    let by = model_size(&oracle) * 1e-3;
    for fault in [Fault::Sign { node }, Fault::Offset { node, by }, Fault::Late { secs: 1e-3 }] {
        oracle.fault = Some(fault);
        let c = compare(&asset, &oracle, 10);
        assert!(c.joints.error > ALLOWED * 100.0, "{:?}", c.joints);
        assert!(c.vertices.error > ALLOWED * 100.0, "{:?}", c.vertices);
    }
    oracle.fault = None;
    assert!(compare(&asset, &oracle, 10).joints.error <= ALLOWED);
}
