//! Cameras: one for each shot, with the times of the shot.

use crate::actors::{Parts, node_with_transform};
use crate::document::{Index, Node};
use choreo_exporter_kit::bake::Baked;
use choreo_plugin::asset::Projection;
use choreo_plugin::glam::{Quat, Vec3};
use choreo_plugin::motion::{Time, Transform};
use choreo_plugin::stage::Stage;
use serde_json::{Map, Value, json};

/// Camera and node of a shot in the document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShotNode {
    pub node: Index,
    pub camera: Index,
}

/// Adds the cameras of all shots.
pub(crate) fn of_stage(parts: &mut Parts<'_>, stage: &Stage, baked: &Baked<'_>) -> Vec<ShotNode> {
    let [width, height] = stage.settings.size.map(|n| n.max(1) as f32);
    let mut out = Vec::new();
    for (number, shot) in baked.shots.iter().enumerate() {
        let [position, rotation, _] = &shot.parts;
        let name = match baked.shots.len() {
            1 => shot.name.clone(),
            _ => format!("shot {} {}", number + 1, shot.name),
        };
        let secs = |time: Time| (time - baked.start).as_secs();
        let mut extras = Map::new();
        extras.insert("camera".into(), shot.name.clone().into());
        extras.insert("start".into(), secs(shot.from).into());
        extras.insert("end".into(), secs(shot.to).into());
        if shot.fading > Time::ZERO {
            extras.insert("dissolve".into(), shot.fading.as_secs().into());
        }
        let camera = camera(&name, &shot.projection, width / height);
        parts.document.cameras.push(camera);
        let camera = parts.document.cameras.len() as Index - 1;
        let at = Transform {
            translation: Vec3::from_slice(position.first()),
            rotation: Quat::from_slice(rotation.first()),
            scale: Vec3::ONE,
        };
        let extras = Some(Box::new(Value::from(extras)));
        let node = parts.push(Node { name, camera: Some(camera), extras, ..node_with_transform(&at) });
        parts.at_root(node);
        out.push(ShotNode { node, camera });
    }
    out
}

fn camera(name: &str, projection: &Projection, aspect: f32) -> Value {
    match *projection {
        Projection::Perspective { yfov, near, far } => {
            let mut lens = Map::new();
            lens.insert("aspectRatio".into(), aspect.into());
            lens.insert("yfov".into(), yfov.into());
            lens.insert("znear".into(), near.into());
            if let Some(far) = far {
                lens.insert("zfar".into(), far.into());
            }
            json!({ "name": name, "type": "perspective", "perspective": lens })
        }
        Projection::Orthographic { height, near, far } => {
            let (xmag, ymag) = (0.5 * height * aspect, 0.5 * height);
            // glTF requires a near plane of at least 0: no depths behind the camera.
            let lens = json!({ "xmag": xmag, "ymag": ymag, "znear": near.max(0.0), "zfar": far });
            json!({ "name": name, "type": "orthographic", "orthographic": lens })
        }
    }
}
