//! Tables of the functions and methods that a script can call.

pub(crate) mod actor;
pub(crate) mod asset;
pub(crate) mod camera;
pub(crate) mod clip;
pub(crate) mod clip_edit;
pub(crate) mod compare;
pub(crate) mod constraints;
pub(crate) mod cue;
pub(crate) mod cuts;
pub(crate) mod easing;
pub(crate) mod effect;
pub(crate) mod expect;
pub(crate) mod expected_values;
pub(crate) mod expression;
mod fade;
pub(crate) mod joint;
mod joint_names;
mod key_spline;
pub(crate) mod keys;
pub(crate) mod layers_2d;
pub(crate) mod light;
pub(crate) mod look_at;
mod markers;
pub(crate) mod maths;
pub(crate) mod procedural;
pub(crate) mod root_motion;
pub(crate) mod sequences;
pub(crate) mod sky;
mod spring_bones;
pub(crate) mod stage;
pub(crate) mod surfaces;
pub(crate) mod test;
pub(crate) mod values;
mod visibility;
pub(crate) mod walk_to;

use crate::call::Function;
use crate::def::Defs;
use std::sync::LazyLock;

/// All functions and methods, by heading, in the order of the reference.
pub(crate) const TABLES: &[(&str, &[&[Function]])] = &[
    ("Stage, parameters and callbacks", &[stage::DEFS]),
    ("Assets and clips", &[asset::DEFS]),
    ("Shapes, meshes, materials, textures and instancing", &[procedural::DEFS]),
    ("Retargeting and mirroring", &[clip::DEFS]),
    ("Clips: keyframes, editing, compression and additive clips", &[clip_edit::DEFS]),
    (
        "Actors: transforms, keyframes, morph targets and joints",
        &[actor::DEFS, surfaces::DEFS, visibility::DEFS, joint::DEFS],
    ),
    ("Constraints, inverse kinematics (IK) and spring bones", &[look_at::DEFS, constraints::DEFS]),
    ("Cues: clips on the timeline, crossfades, layers and masks", &[cue::OPTION_DEFS, cue::DEFS]),
    ("Root motion, in place, path following and walks", &[walk_to::DEFS, root_motion::DEFS]),
    ("Markers, footsteps and sequences", &[sequences::DEFS]),
    ("Cameras: field of view, orbit, follow and cuts", &[camera::DEFS, cuts::DEFS]),
    ("Lights, shadows and image-based lighting (HDRI)", &[light::DEFS, sky::DEFS]),
    ("2D layers: titles, images and letterbox", &[layers_2d::DEFS, fade::DEFS]),
    ("Effects and post-processing", &[effect::DEFS]),
    ("Tests: declaration and golden images", &[test::DEFS]),
    ("Tests: measured properties", &[expect::DEFS]),
    ("Tests: comparisons", &[compare::DEFS]),
];

pub(crate) fn functions() -> impl Iterator<Item = &'static Function> {
    TABLES.iter().flat_map(|(_, tables)| tables.iter().copied().flatten())
}

/// The descriptions of all functions and methods of scripts.
pub(crate) fn defs() -> &'static Defs {
    static DEFS: LazyLock<Defs> = LazyLock::new(|| {
        let of_heading = |(heading, tables): &(&'static str, &'static [&'static [Function]])| {
            let heading = *heading;
            tables.iter().copied().flatten().map(move |function| (heading, &function.def))
        };
        Defs { all: TABLES.iter().flat_map(of_heading).collect(), maths: maths::FUNCTIONS }
    });
    &DEFS
}
