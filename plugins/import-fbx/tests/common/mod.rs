//! Shared by the tests: the folder of sample files, and importing from it.
#![allow(dead_code, unused_imports)]

use choreo_asset::Asset;
pub(crate) use choreo_importer_kit_testing::{assets, source};
use choreo_motion::{Clip, LocalToModel, Pose, Sample, Time};
use glam::{Affine3A, DAffine3, DVec3};
use import_fbx::FbxImporter;
use std::path::{Path, PathBuf};

/// Every FBX of the folder, in order.
pub(crate) fn all_files(folder: &Path) -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("fbx")) {
                out.push(path);
            }
        }
    }
    out.sort();
    out
}

/// The project's own sample, for where no others are.
pub(crate) fn own() -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/flag.fbx")).unwrap()
}

pub(crate) fn import_path(path: &Path) -> Asset {
    choreo_importer_kit_testing::import_path(&FbxImporter, path).unwrap_or_else(|e| panic!("{e}"))
}

/// Joints in model space and morph weights at a time of a clip.
pub(crate) fn pose(asset: &Asset, clip: Option<(&Clip, f64)>) -> (Vec<Affine3A>, Vec<Vec<f32>>) {
    let mut pose = Pose::rest(&asset.skeleton);
    let mut weights: Vec<Vec<f32>> = asset.instances.iter().map(|i| i.weights.clone()).collect();
    if let Some((clip, secs)) = clip {
        let time = Time::from_secs(secs);
        Sample { clip, time, pose: &mut pose }.run();
        for (instance, weights) in asset.instances.iter().zip(&mut weights) {
            clip.sample_weights(instance.joint, time, weights);
        }
    }
    let mut model = vec![Affine3A::IDENTITY; asset.skeleton.len()];
    LocalToModel { skeleton: &asset.skeleton, pose: &pose, model_from_joint: &mut model }.run();
    (model, weights)
}

/// All vertices of an asset, posed, in metres.
pub(crate) fn posed_vertices(asset: &Asset, clip: Option<(&Clip, f64)>) -> Vec<DVec3> {
    let (model, weights) = pose(asset, clip);
    let posed = choreo_asset::posed_meshes_in(asset, &model, &weights, DAffine3::IDENTITY);
    posed.iter().flat_map(|i| &i.primitives).flat_map(|p| p.positions.iter().copied()).collect()
}

pub(crate) fn rest_box(asset: &Asset) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    posed_vertices(asset, None).iter().fold(none, |(a, b), p| (a.min(*p), b.max(*p)))
}

pub(crate) fn triangles(asset: &Asset) -> usize {
    let meshes = asset.instances.iter().map(|i| &asset.meshes[i.mesh as usize]);
    meshes.flat_map(|m| &m.primitives).map(|p| p.indices.len() / 3).sum()
}
