//! Imports the figure and poses it.
#![allow(dead_code)]

use choreo_asset::{Asset, posed_meshes_in};
use choreo_motion::{Clip, LocalToModel, Pose, Sample, Time};
use choreo_plugin::importer::OptionValue;
use choreo_plugin::{Files, ImportError, ImportOptions, ImportScope, Importer, Source};
use glam::{Affine3A, DAffine3, DVec3};
use import_mannequin::{Mannequin, SOURCE_NAME};
use std::sync::Arc;

struct NoFiles;
impl Files for NoFiles {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("no file {relative} here"))
    }
}

pub(crate) fn source() -> Source {
    Source { name: SOURCE_NAME.into(), bytes: Arc::default() }
}

pub(crate) fn import_with(options: &[(&str, OptionValue)], needs: ImportScope) -> Result<Asset, ImportError> {
    let options = ImportOptions(options.iter().map(|(k, v)| (k.to_string(), v.clone())).collect());
    let options = Mannequin.manifest().complete(&options).map_err(|e| ImportError {
        file: SOURCE_NAME.into(),
        place: String::new(),
        what: e.message,
        hint: e.hint,
    })?;
    Mannequin.import(&source(), &NoFiles, needs, &options)
}

pub(crate) fn import() -> Asset {
    import_with(&[], ImportScope::ALL).expect("the figure is made without options")
}

pub(crate) fn pose_at(asset: &Asset, clip: &Clip, secs: f64) -> Pose {
    let mut pose = Pose::rest(&asset.skeleton);
    Sample { clip, time: Time::from_secs(secs), pose: &mut pose }.run();
    pose
}

pub(crate) fn joints_at(asset: &Asset, clip: &Clip, secs: f64) -> Vec<Affine3A> {
    let pose = pose_at(asset, clip, secs);
    let mut model_from_joint = vec![Affine3A::IDENTITY; asset.skeleton.len()];
    LocalToModel { skeleton: &asset.skeleton, pose: &pose, model_from_joint: &mut model_from_joint }.run();
    model_from_joint
}

/// Every vertex in model space.
pub(crate) fn vertices_at(asset: &Asset, clip: &Clip, secs: f64) -> Vec<DVec3> {
    let posed = posed_meshes_in(asset, &joints_at(asset, clip, secs), &[], DAffine3::IDENTITY);
    posed.into_iter().flat_map(|i| i.primitives).flat_map(|p| p.positions).collect()
}
