//! Names and reasons of the parts that a frame leaves out.

use crate::plan::shader_features::FEATURES;

/// Every `LeftOut::part`, except effects that are left out, which are reported by their names. Scripts use these words in tests.
pub fn left_out_names() -> impl Iterator<Item = &'static str> {
    FEATURES.iter().filter_map(|f| Some(f.absence?.what)).chain(NAMES_OF_OTHER_PARTS.iter().copied())
}

/// Names of parts other than shader features that can be left out.
const NAMES_OF_OTHER_PARTS: &[&str] = &[
    "hidden actors",
    "actors outside the view",
    "primitives outside the view",
    "triangles too small to see",
    "back faces of watertight meshes",
    "pre-skinning",
    "normals, lights and ambient light",
    "lights",
    "dark lights",
    "distance and cone attenuation",
    "clustered lighting",
    "2D layers",
    "texture coordinates",
    "effects on surfaces",
    "alpha to coverage",
    "blending and sorting back to front",
    "order-independent transparency",
    "deferred shading",
    "instancing",
    "multisampling",
    "full-screen passes and float target",
    "shadow maps",
    "shadows beyond the limit",
    "overlays of effects",
    "depth and normals for effects",
    "motion vectors for effects",
    "sub-frames",
];

/// A part that a frame leaves out, and why: "shadow maps: no light casts shadows".
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    pub part: String,
    pub why: String,
}

impl LeftOut {
    /// `Some` with the reason if the part was not needed.
    pub(crate) fn unless<T>(part: &str, needed: &Result<T, NotNeeded>) -> Option<LeftOut> {
        needed.as_ref().err().map(|why| LeftOut { part: part.into(), why: why.0.clone() })
    }
}

/// The reason why a frame does not need something.
pub(crate) struct NotNeeded(pub String);

impl From<&str> for NotNeeded {
    fn from(why: &str) -> NotNeeded {
        NotNeeded(why.into())
    }
}

impl From<String> for NotNeeded {
    fn from(why: String) -> NotNeeded {
        NotNeeded(why)
    }
}
