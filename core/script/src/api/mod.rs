//! Tables of the functions and methods that a script can call.

pub mod actor;
pub mod asset;
pub mod camera;
pub mod clip;
pub(crate) mod clip_edit;
pub mod compare;
pub mod constraints;
pub mod cue;
pub mod cuts;
pub mod easing;
pub mod effect;
pub mod expect;
pub(crate) mod expected_values;
pub mod expression;
mod fade;
pub mod joint;
mod joint_names;
mod key_spline;
pub mod keys;
pub mod layers_2d;
pub mod light;
pub mod look_at;
mod markers;
pub mod maths;
pub mod procedural;
pub mod root_motion;
pub mod sequences;
pub mod sky;
mod spring_bones;
pub mod stage;
pub mod surfaces;
pub mod test;
pub mod values;
mod visibility;
pub mod walk_to;

use crate::call::Function;
use crate::def::Defs;
use std::sync::LazyLock;

/// All functions and methods, by heading, in the order of the reference.
pub const TABLES: &[(&str, &[&[Function]])] = &[
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

pub fn functions() -> impl Iterator<Item = &'static Function> {
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
