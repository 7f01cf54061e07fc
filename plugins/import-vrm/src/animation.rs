//! VRM animations: `VRMC_vrm_animation` 1.0. Human bones as in `VRMC_vrm`, expressions and gaze as nodes that move.

use crate::json::At;
use crate::{about, human};
use choreo_import::{Problem, Result};
use choreo_motion::{Clip, ExpressionCurve, Path};
use choreo_stage::asset::Asset;
use import_gltf::profile::Document;
use std::collections::BTreeMap;
use std::sync::Arc;

pub fn read(document: &Document<'_>, vrma: &At<'_>, asset: &mut Asset) -> Result<()> {
    crate::version(document, vrma, "1.0");
    about::read_animation(document, asset);
    human::read(document, vrma, asset)?;
    let names = expression_nodes(document, vrma)?;
    for (index, clip) in asset.clips.iter_mut().enumerate() {
        *clip = Arc::new(with_expressions(clip, &names, index)?);
    }
    if let Some(gaze) = vrma.get("lookAt") {
        let node = gaze.needed_index("node")?;
        if let Some(joint) = document.joint(node, &|| gaze.place_of("node"))? {
            let name = &asset.skeleton.names()[joint as usize];
            let name: String = name.chars().filter(|c| !c.is_control()).take(80).collect();
            let what = "says what is looked at by a node that moves; it is a joint of the clip, and no eyes follow it";
            document.warn(gaze.place(), what);
            asset.origin.about.push(("gaze".into(), format!("what is looked at is the joint \"{name}\"")));
        }
    }
    Ok(())
}

/// Name of the expression that each joint stands for.
fn expression_nodes(document: &Document<'_>, vrma: &At<'_>) -> Result<BTreeMap<u32, String>> {
    let mut names = BTreeMap::new();
    let Some(expressions) = vrma.get("expressions") else { return Ok(names) };
    for list in ["preset", "custom"] {
        for (name, at) in expressions.members(list)? {
            let node = at.needed_index("node")?;
            let Some(joint) = document.joint(node, &|| at.place_of("node"))? else {
                document.warn(at.place(), format!("nodes[{node}] is not in the scene; it is left out"));
                continue;
            };
            if names.values().any(|n| n == name) || names.contains_key(&joint) {
                document.warn(at.place(), "stands for an expression already; it is left out");
                continue;
            }
            names.insert(joint, name.to_string());
        }
    }
    Ok(names)
}

/// The x of such a node's place is the expression's weight.
fn with_expressions(clip: &Clip, names: &BTreeMap<u32, String>, index: usize) -> Result<Clip> {
    let (faces, moves): (Vec<_>, Vec<_>) =
        clip.curves().iter().cloned().partition(|c| names.contains_key(&c.joint));
    let faces = faces.into_iter().filter(|c| c.path == Path::Translation);
    let faces: Vec<ExpressionCurve> = faces
        .map(|c| ExpressionCurve {
            name: names[&c.joint].clone(),
            interpolation: c.interpolation,
            values: c.values.iter().step_by(3).copied().collect(),
            times: c.times,
        })
        .collect();
    let place = || format!("animations[{index}]");
    Clip::new(clip.name.clone(), clip.joint_count(), moves)
        .map_err(|e| Problem::new(place(), e.to_string()))?
        .with_expressions(faces)
        .map_err(|e| Problem::new(place(), e.to_string()))
}
