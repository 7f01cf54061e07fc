//! Humanoid bones: `humanoid.humanBones` of VRM 1.0, VRM animations and VRM 0.x.

use crate::json::At;
use crate::set_humanoid;
use choreo_asset::Asset;
use choreo_importer_kit::Result;
use choreo_motion::{HumanBone, Humanoid};
use import_gltf::profile::Document;
use std::collections::BTreeMap;

/// Reads an object: `{ "hips": { "node": 0 }, … }`.
pub(crate) fn read(document: &Document<'_>, vrm: &At<'_>, asset: &mut Asset) -> Result<()> {
    bones(document, vrm, asset, |humanoid, bones| {
        for (name, at) in humanoid.members("humanBones")? {
            bones.add(HumanBone::from_name(name), name, &at)?;
        }
        Ok(())
    })
}

/// Reads an array: `[{ "bone": "hips", "node": 0 }, …]`.
pub(crate) fn read_v0(document: &Document<'_>, vrm: &At<'_>, asset: &mut Asset) -> Result<()> {
    bones(document, vrm, asset, |humanoid, bones| {
        for at in humanoid.list("humanBones")? {
            let name = at.text("bone").unwrap_or_default();
            bones.add(bone_v0(name), name, &at)?;
        }
        Ok(())
    })
}

fn bones(
    document: &Document<'_>,
    vrm: &At<'_>,
    asset: &mut Asset,
    read: impl FnOnce(&At<'_>, &mut HumanBones<'_, '_>) -> Result<()>,
) -> Result<()> {
    let Some(humanoid) = vrm.get("humanoid") else {
        document.warn(vrm.place(), "has no humanoid; its joints are matched by their names");
        return Ok(());
    };
    let mut bones = HumanBones { document, joints: BTreeMap::new() };
    read(&humanoid, &mut bones)?;
    bones.finish(humanoid.place_of("humanBones"), asset)
}

/// The bone of a VRM 0.x name. Names equal those of 1.0, except that 0.x calls the thumb's metacarpal proximal, and its proximal
/// bone intermediate.
fn bone_v0(name: &str) -> Option<HumanBone> {
    Some(match name {
        "leftThumbProximal" => HumanBone::LeftThumbMetacarpal,
        "leftThumbIntermediate" => HumanBone::LeftThumbProximal,
        "rightThumbProximal" => HumanBone::RightThumbMetacarpal,
        "rightThumbIntermediate" => HumanBone::RightThumbProximal,
        "leftThumbMetacarpal" | "rightThumbMetacarpal" => return None,
        _ => return HumanBone::from_name(name),
    })
}

struct HumanBones<'a, 'd> {
    document: &'a Document<'d>,
    joints: BTreeMap<u32, HumanBone>,
}

impl HumanBones<'_, '_> {
    fn add(&mut self, bone: Option<HumanBone>, name: &str, at: &At<'_>) -> Result<()> {
        let Some(bone) = bone else {
            let name: String = name.chars().take(40).collect();
            self.document.warn(at.place(), format!("\"{name}\" is not a human bone; it is left out"));
            return Ok(());
        };
        // Missing bones are written as −1, or left out.
        let Some(node) = at.index("node")? else { return Ok(()) };
        let Some(joint) = self.document.joint(node, &|| at.place_of("node"))? else {
            self.document
                .warn(at.place(), format!("nodes[{node}] is not in the scene; the bone is left out"));
            return Ok(());
        };
        if let Some(first) = self.joints.get(&joint) {
            let what = format!("nodes[{node}] is the bone {} already; this bone is left out", first.name());
            self.document.warn(at.place(), what);
        } else if self.joints.values().any(|b| *b == bone) {
            self.document
                .warn(at.place(), format!("{} is assigned already; this one is left out", bone.name()));
        } else {
            self.joints.insert(joint, bone);
        }
        Ok(())
    }

    fn finish(self, place: String, asset: &mut Asset) -> Result<()> {
        let required = [HumanBone::Hips, HumanBone::Spine, HumanBone::Head];
        for bone in required.into_iter().filter(|b| !self.joints.values().any(|j| j == b)) {
            self.document.warn(place.clone(), format!("has no {}, which every VRM must have", bone.name()));
        }
        // Bones and joints are unique here, so this cannot fail.
        match Humanoid::new(self.joints.into_iter().map(|(joint, bone)| (bone, joint))) {
            Ok(humanoid) => set_humanoid(asset, humanoid, place),
            Err(e) => Err(choreo_importer_kit::Problem::new(place, e.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thumb_bones_of_vrm_0_shift_by_one_joint() {
        assert_eq!(bone_v0("leftThumbProximal"), Some(HumanBone::LeftThumbMetacarpal));
        assert_eq!(bone_v0("rightThumbIntermediate"), Some(HumanBone::RightThumbProximal));
        assert_eq!(bone_v0("leftThumbDistal"), Some(HumanBone::LeftThumbDistal));
        assert_eq!(bone_v0("leftIndexProximal"), Some(HumanBone::LeftIndexProximal));
        assert_eq!((bone_v0("leftThumbMetacarpal"), bone_v0("tail")), (None, None));
    }
}
