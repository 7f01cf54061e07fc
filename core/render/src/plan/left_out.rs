//! What a frame does without, by name.

use crate::shader::features::FEATURES;

/// Every `LeftOut::what`, but for effects without a plugin, which are reported by their names.
pub fn left_out_names() -> impl Iterator<Item = &'static str> {
    FEATURES.iter().filter_map(|f| Some(f.absence?.what)).chain(OTHERS.iter().copied())
}

/// Those that are no shader feature.
const OTHERS: &[&str] = &[
    "hidden actors",
    "actors outside the view",
    "primitives outside the view",
    "triangles too small to see",
    "back faces of closed surfaces",
    "skinning once for all passes",
    "normals, lights and ambient light",
    "lights",
    "dark lights",
    "distance and cone attenuation",
    "lists of lights",
    "flat layers",
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
    "lines, points and triangles of effects",
];

/// "shadow map: out, no light casts".
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    pub what: String,
    pub why: String,
}

impl LeftOut {
    /// `None` where it is in.
    pub(crate) fn unless<T>(what: &str, made: &Result<T, String>) -> Option<LeftOut> {
        made.as_ref().err().map(|why| LeftOut { what: what.into(), why: why.clone() })
    }
}
