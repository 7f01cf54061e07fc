//! Effects that displace the vertices of surfaces. CPU reference of displace.wgsl.

use super::CpuRenderer;
use crate::affine::Affine3x4;
use crate::effect_faults::EffectFaults;
use crate::lanes::unit;
use crate::plan::Plan;
use choreo_plugin::{Effect, VertexSample};
use glam::{Vec3, Vec4Swizzles};
use std::sync::Arc;

/// A displacement effect with its parameters and its largest displacement in metres.
pub(super) struct Displacement {
    pub effect: Effect,
    pub parameters: Vec<f32>,
    pub max_length: f32,
    pub faults: Arc<EffectFaults>,
}

impl CpuRenderer {
    /// Displacement effects of a draw. `effect_bits`: one bit for each effect of `Plan::scene_effects`.
    pub(super) fn displacements(&self, plan: &Plan, effect_bits: u8) -> Vec<Displacement> {
        let limits = (0..8).zip(plan.displacement_limits).filter(|(bit, _)| effect_bits >> bit & 1 == 1);
        let all = self.surface_effects(plan, effect_bits).into_iter().zip(limits);
        all.map(|((effect, parameters), (_, max_length))| {
            let faults = self.faults.clone();
            Displacement { effect, parameters, max_length, faults }
        })
        .collect()
    }
}

/// Step of the finite differences of the normal, in metres: a power of two, so that adding it rounds little.
const NORMAL_STEP_METERS: f32 = 0.003_906_25;

/// Sum of the effects' displacements of a vertex, in metres, world axes. `rows`: the transform of
/// the vertex from mesh space to camera-relative space.
pub(super) fn total_displacement(effects: &[Displacement], vertex: &VertexSample, rows: &Affine3x4) -> Vec3 {
    effects.iter().fold(Vec3::ZERO, |sum, d| {
        let Effect::Vertex(effect) = &d.effect else { return sum };
        let offset = effect.vertex(vertex, &d.parameters);
        let mut offset = d.faults.offset_or_zero(&d.effect, offset);
        if effect.in_model_space() {
            offset = rows.transform_vector(offset);
        }
        sum + offset * (d.max_length / offset.length().max(1e-20)).min(1.0)
    })
}

/// Normal of the displaced surface, by finite differences along two tangents.
pub(super) fn displaced_normal(
    effects: &[Displacement],
    vertex: &VertexSample,
    rows: &Affine3x4,
    displacement: Vec3,
) -> Vec3 {
    // Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
    let n = vertex.normal;
    let s = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    let t = Vec3::new(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    let u = Vec3::new(b, s + n.y * n.y * a, -n.y);
    let step = |direction: Vec3| {
        direction * NORMAL_STEP_METERS
            + (total_displacement(effects, &shifted_vertex(vertex, rows, direction), rows) - displacement)
    };
    // Both steps are normalized first, so that the product of two small steps does not vanish.
    unit(unit(step(t)).cross(unit(step(u))))
}

fn shifted_vertex(vertex: &VertexSample, rows: &Affine3x4, direction: Vec3) -> VertexSample {
    let mut shifted = *vertex;
    shifted.world += direction * NORMAL_STEP_METERS;
    // Inverse of the transform's linear part, by cofactors.
    let [x, y, z] = rows.0.map(|r| r.xyz());
    let cofactors = [y.cross(z), z.cross(x), x.cross(y)];
    let determinant = x.dot(cofactors[0]);
    if determinant.abs() > 1e-30 {
        let in_mesh_space =
            cofactors[0] * direction.x + cofactors[1] * direction.y + cofactors[2] * direction.z;
        shifted.model += in_mesh_space * (NORMAL_STEP_METERS / determinant);
    }
    shifted
}
