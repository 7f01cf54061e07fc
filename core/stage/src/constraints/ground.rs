//! Ground height under a point, from the triangles of an actor seen from above.

use crate::actors::{ActorScratch, evaluate_actors};
use crate::pose::posed_mesh::posed_meshes;
use crate::snapshot::Snapshot;
use crate::stage::{Stage, StageError};
use choreo_motion::Time;
use glam::{DVec2, DVec3};

/// World-space triangles of an actor at time 0.
#[derive(Debug, Default)]
pub(crate) struct Ground {
    triangles: Vec<[DVec3; 3]>,
}

impl Ground {
    pub(crate) fn of(stage: &Stage, actor: usize) -> Result<Ground, StageError> {
        let mut snapshot = Snapshot::default();
        let mut scratch = ActorScratch::for_actors(vec![actor]);
        evaluate_actors(stage, &mut scratch, Time::ZERO, None, &mut snapshot)?;
        let mut triangles = Vec::new();
        let (Some(a), Some(state)) = (stage.actors.get(actor), snapshot.actors.get(actor)) else {
            return Ok(Ground::default());
        };
        for posed in posed_meshes(&a.asset, state) {
            let Some(instance) = a.asset.instances.get(posed.instance) else { continue };
            let Some(mesh) = a.asset.meshes.get(instance.mesh as usize) else { continue };
            for (primitive, posed) in mesh.primitives.iter().zip(&posed.primitives) {
                let at = |i: u32| posed.positions.get(i as usize).copied();
                let vertices = primitive.indices.chunks_exact(3);
                triangles.extend(vertices.filter_map(|c| Some([at(c[0])?, at(c[1])?, at(c[2])?])));
            }
        }
        Ok(Ground { triangles })
    }

    /// World height of the highest surface at a point's x and z that is not above `ceiling`.
    pub(crate) fn height(&self, at: DVec3, ceiling: f64) -> Option<f64> {
        let level = |p: DVec3| DVec2::new(p.x, p.z);
        let p = level(at);
        let mut highest: Option<f64> = None;
        for [a, b, c] in &self.triangles {
            let (u, v) = (level(*b) - level(*a), level(*c) - level(*a));
            let area = u.perp_dot(v);
            let way = p - level(*a);
            let (s, t) = (way.perp_dot(v) / area, u.perp_dot(way) / area);
            // The test also rejects walls: their area seen from above is zero, so s and t are not finite.
            if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
                let y = a.y + (b.y - a.y) * s + (c.y - a.y) * t;
                if y <= ceiling && highest.is_none_or(|h| y > h) {
                    highest = Some(y);
                }
            }
        }
        highest
    }
}
