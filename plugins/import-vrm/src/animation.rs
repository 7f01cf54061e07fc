//! VRM animations: `VRMC_vrm_animation` 1.0. Humanoid bones are stored as in `VRMC_vrm`, expressions and gaze as animated nodes.

use crate::json::At;
use crate::{about, gaze, human};
use choreo_asset::Asset;
use choreo_importer_kit::{Problem, Result};
use choreo_motion::{Clip, Curve, ExpressionCurve, Path};
use import_gltf::profile::Document;
use std::collections::BTreeMap;
use std::sync::Arc;

pub(crate) fn read(document: &Document<'_>, vrma: &At<'_>, asset: &mut Asset) -> Result<()> {
    crate::version(document, vrma, "1.0");
    about::read_animation(document, asset);
    human::read(document, vrma, asset)?;
    let names = expression_nodes(document, vrma)?;
    let gaze = gaze_joint(document, vrma)?;
    for (index, clip) in asset.clips.iter_mut().enumerate() {
        let looks = match gaze {
            Some(joint) => {
                gaze::curves(clip, joint).map_err(|e| Problem::new(place(index), e.to_string()))?
            }
            None => Vec::new(),
        };
        *clip = Arc::new(with_expressions(clip, &names, gaze, looks, index)?);
    }
    if gaze.is_some() {
        asset.origin.about.push(("gaze".into(), "the eyes look where the clip says".into()));
    }
    Ok(())
}

/// The joint whose rotation is the gaze; `None` where there is none.
fn gaze_joint(document: &Document<'_>, vrma: &At<'_>) -> Result<Option<u32>> {
    let Some(look) = vrma.get("lookAt") else { return Ok(None) };
    let Some(node) = look.index("node")? else { return Ok(None) };
    let joint = document.joint(node, &|| look.place_of("node"))?;
    if joint.is_none() {
        document.warn(look.place(), format!("nodes[{node}] is not in the scene; the gaze is left out"));
    }
    Ok(joint)
}

fn place(index: usize) -> String {
    format!("animations[{index}]")
}

/// Name of the expression that each joint represents.
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
                document.warn(at.place(), "repeats an earlier expression or node; it is left out");
                continue;
            }
            names.insert(joint, name.to_string());
        }
    }
    Ok(names)
}

/// Moves the curves of expression nodes to expressions: the x of the node's translation is the weight.
fn with_expressions(
    clip: &Clip,
    names: &BTreeMap<u32, String>,
    gaze: Option<u32>,
    looks: Vec<ExpressionCurve>,
    index: usize,
) -> Result<Clip> {
    let of_the_face = |c: &Curve| names.contains_key(&c.joint) || Some(c.joint) == gaze;
    let (faces, moves): (Vec<_>, Vec<_>) = clip.curves().iter().cloned().partition(of_the_face);
    let faces = faces.into_iter().filter(|c| c.path == Path::Translation && names.contains_key(&c.joint));
    let mut faces: Vec<ExpressionCurve> = faces
        .map(|c| ExpressionCurve {
            name: names[&c.joint].clone(),
            interpolation: c.interpolation,
            values: c.values.iter().step_by(3).copied().collect(),
            times: c.times,
        })
        .collect();
    // Expressions of the file with these names take precedence.
    let own: Vec<String> = faces.iter().map(|f| f.name.clone()).collect();
    faces.extend(looks.into_iter().filter(|look| !own.contains(&look.name)));
    Clip::new(clip.name.clone(), clip.joint_count(), moves)
        .map_err(|e| Problem::new(place(index), e.to_string()))?
        .with_expressions(faces)
        .map_err(|e| Problem::new(place(index), e.to_string()))
}
