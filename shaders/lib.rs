//! The renderer's WGSL, as text: modules that `choreo-render` puts together, preprocesses and compiles. A crate of its own, so that the
//! files lie in one folder and come with a package.

macro_rules! modules {
    ($($name:literal)*) => {
        &[$(($name, include_str!($name))),*]
    };
}

/// File name and text of each module.
pub const MODULES: &[(&str, &str)] = modules!(
    "frame.wgsl"
    "lights.wgsl"
    "layers_behind.wgsl"
    "peel.wgsl"
    "inputs.wgsl"
    "deferred.wgsl"
    "view.wgsl"
    "sky.wgsl"
    "brdf.wgsl"
    "reflection.wgsl"
    "toon.wgsl"
    "layers.wgsl"
    "refraction.wgsl"
    "shadow.wgsl"
    "displace.wgsl"
    "thick_lines.wgsl"
    "triplanar.wgsl"
    "pose.wgsl"
    "preskin.wgsl"
    "vertex.wgsl"
    "scene.wgsl"
    "effect_faults.wgsl"
    "surface.wgsl"
    "dither.wgsl"
    "background.wgsl"
    "overlay.wgsl"
    "textures.wgsl"
    "post.wgsl"
);
