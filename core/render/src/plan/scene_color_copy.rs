//! Scene color copy: the image so far as refracting surfaces sample it (screen-space refraction).

/// The copy for refraction, made before the first refracting surface is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneColorCopy {
    /// Mipmap levels: as many as the roughest refracting surface in view blurs with.
    pub levels: u32,
}

/// How much of a surface's roughness blurs what is refracted: nothing at an index of refraction of 1, all from 1.5 on
/// (glTF-Sample-Viewer, `applyIorToRoughness`). Times log₂ of the image's height it is the mipmap level.
pub(crate) fn blur(roughness: f32, ior: f32) -> f32 {
    roughness * (2.0 * ior - 2.0).clamp(0.0, 1.0)
}
