//! Bones as lines and joints as points, drawn over the image, or hidden behind nearer surfaces.

use choreo_plugin::{EffectPlugin, EffectScene, Label, Manifest, Overlay, OverlayEffect, Stroke};
use glam::Vec4;
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("skeleton", env!("CARGO_PKG_VERSION"), "bones as lines and joints as points")
        .number("width", "width of a bone", 2.0, 1.0..=32.0)
        .unit("px")
        .number("joints", "size of a joint's point; 0: none", 6.0, 0.0..=64.0)
        .unit("px")
        .color("color", "color of the bones", [1.0, 0.75, 0.1])
        .number("opacity", "opacity of bones and joints", 1.0, 0.0..=1.0)
        .flag("over", "drawn on top of everything, instead of hidden by nearer surfaces", true)
        .flag("names", "shows the names of the joints", false)
});

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Skeleton;

impl EffectPlugin for Skeleton {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }
}

impl OverlayEffect for Skeleton {
    fn overlay(&self, scene: &EffectScene, p: &[f32]) -> Overlay {
        let &[width, joints, r, g, b, opacity, over, names] = p else { return Overlay::default() };
        let (mut strokes, mut labels) = (Vec::new(), Vec::new());
        // Darker points stand out on their own bones.
        let color = Vec4::new(r, g, b, opacity);
        let dark = Vec4::new(r * 0.25, g * 0.25, b * 0.25, opacity);
        for body in scene.instances() {
            let bones = body.bones();
            let at = |joint: u32| body.joint(joint);
            for (joint, parent) in &bones {
                if let (Some(from), Some(to)) = (parent.and_then(at), at(*joint)) {
                    strokes.push(Stroke { from, to, width, color });
                }
            }
            if joints >= 1.0 {
                let points = bones.iter().filter_map(|(joint, _)| at(*joint));
                strokes.extend(points.map(|at| Stroke { from: at, to: at, width: joints, color: dark }));
            }
            if names > 0.5 {
                let skeleton = &body.asset.skeleton;
                // Mixamo's prefix of all joint names is left out.
                let name = |joint: u32| {
                    skeleton.names()[joint as usize].trim_start_matches("mixamorig:").to_string()
                };
                let label = |(joint, at)| Label {
                    at,
                    text: name(joint),
                    size: 11.0,
                    beside: 0.5 * joints + 2.0,
                    color,
                };
                let placed = bones.iter().filter_map(|(joint, _)| Some((*joint, at(*joint)?)));
                labels.extend(placed.map(label));
            }
        }
        Overlay { strokes, labels, over: over > 0.5, ..Overlay::default() }
    }
}
