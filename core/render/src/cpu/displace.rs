//! Effects that displace the vertices of surfaces. CPU reference of displace.wgsl.

use super::CpuRenderer;
use crate::affine::Affine3x4;
use crate::effect_faults::EffectFaults;
use crate::plan::Plan;
use choreo_plugin::{Effect, VertexSample};
use glam::{Vec3, Vec4Swizzles};
use std::sync::Arc;

/// A displacement effect with its parameters and its largest displacement in metres.
pub struct Displacement {
    pub effect: Effect,
    pub parameters: Vec<f32>,
    pub reach: f32,
    pub faults: Arc<EffectFaults>,
}

impl CpuRenderer {
    /// The effects of a draw that displace surfaces.
    pub(super) fn displaced(&self, plan: &Plan, bits: u8) -> Vec<Displacement> {
        let reaches = (0..8).zip(plan.displacement_limits).filter(|(bit, _)| bits >> bit & 1 == 1);
        let all = self.surface(plan, bits).into_iter().zip(reaches);
        all.map(|((effect, parameters), (_, reach))| {
            let faults = self.faults.clone();
            Displacement { effect, parameters, reach, faults }
        })
        .collect()
    }
}

/// Step of the finite differences of the normal, in metres: a power of two, so that adding it rounds little.
const STEP: f32 = 0.003_906_25;

/// Sum of the effects' displacements of a vertex, in metres, world axes. `rows`: the vertex's camera-relative transform from mesh
/// space.
pub fn offset(effects: &[Displacement], place: &VertexSample, rows: &Affine3x4) -> Vec3 {
    effects.iter().fold(Vec3::ZERO, |sum, d| {
        let Effect::Vertex(effect) = &d.effect else { return sum };
        let offset = effect.vertex(place, &d.parameters);
        let mut offset = d.faults.checked_offset(&d.effect, offset);
        if effect.in_model_space() {
            offset = rows.transform_vector(offset);
        }
        sum + offset * (d.reach / offset.length().max(1e-20)).min(1.0)
    })
}

/// Normal of the displaced surface, by finite differences along two tangents.
pub fn normal(effects: &[Displacement], place: &VertexSample, rows: &Affine3x4, moved: Vec3) -> Vec3 {
    // Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
    let n = place.normal;
    let s = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    let t = Vec3::new(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    let u = Vec3::new(b, s + n.y * n.y * a, -n.y);
    let step = |way: Vec3| way * STEP + (offset(effects, &shifted(place, rows, way), rows) - moved);
    // Both steps are normalized first, so that the product of two small steps does not vanish.
    unit(unit(step(t)).cross(unit(step(u))))
}

fn shifted(place: &VertexSample, rows: &Affine3x4, way: Vec3) -> VertexSample {
    let mut there = *place;
    there.world += way * STEP;
    // Inverse of the transform's linear part, by cofactors.
    let [x, y, z] = rows.0.map(|r| r.xyz());
    let cofactors = [y.cross(z), z.cross(x), x.cross(y)];
    let determinant = x.dot(cofactors[0]);
    if determinant.abs() > 1e-30 {
        let back = cofactors[0] * way.x + cofactors[1] * way.y + cofactors[2] * way.z;
        there.model += back * (STEP / determinant);
    }
    there
}

fn unit(v: Vec3) -> Vec3 {
    v * (1.0 / v.dot(v).max(1e-20).sqrt())
}
