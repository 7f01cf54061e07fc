//! Skin weights of a part's vertices.

use crate::figure::Skinning;
use crate::rig::{self, Side};
use glam::{Vec3, vec3};

/// Four influences. Unused ones have weight 0; the weights sum to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Influences {
    pub joints: [u16; 4],
    pub weights: [f32; 4],
}

/// Smoothstep from 0 at −1 to 1 at 1.
fn ramp(x: f32) -> f32 {
    let t = (0.5 + 0.5 * x).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

impl Influences {
    fn push(&mut self, joint: usize, weight: f32) {
        if weight <= 0.0 {
            return;
        }
        if let Some(slot) = self.weights.iter().position(|w| *w == 0.0) {
            self.joints[slot] = joint as u16;
            self.weights[slot] = weight;
        }
    }
}

/// Influences of a vertex at `p` in the T-pose, on the side of the part.
pub(crate) fn influences(skinning: &Skinning, side: Side, p: Vec3) -> Influences {
    let mut out = Influences::default();
    match *skinning {
        Skinning::Rigid(joint) => out.push(joint(side), 1.0),
        Skinning::Chain { axis, joints, blend } => {
            let along = axis.dot(vec3(p.x * side.sign(), p.y, p.z));
            let mut left = 1.0;
            let joints = joints(side);
            for (i, (joint, _)) in joints.iter().enumerate() {
                let next = joints.get(i + 1).map_or(0.0, |(_, at)| ramp((along - at) / blend));
                out.push(*joint, left * (1.0 - next));
                left *= next;
            }
        }
        Skinning::Chest => {
            let collar = 0.75 * ramp((p.x.abs() - 0.105) / 0.05) * ramp((p.y - 1.36) / 0.06);
            let lower = ramp((1.185 - p.y) / 0.05) * 0.5;
            let side = if p.x > 0.0 { Side::Left } else { Side::Right };
            out.push(rig::SPINE1, lower);
            out.push(side.shoulder(), collar * (1.0 - lower));
            out.push(rig::SPINE2, (1.0 - collar) * (1.0 - lower));
        }
    }
    // The largest weight absorbs the rounding error of the products.
    let rest = 1.0 - out.weights.iter().sum::<f32>();
    if let Some(most) = out.weights.iter_mut().max_by(|a, b| a.total_cmp(b)) {
        *most += rest;
    }
    out
}
