//! Colliders that tails of spring bones cannot enter. A tail moves on a sphere about its head, and its directions inside another
//! sphere form a cone: results are exact, and keep the length of the stick.

use super::ColliderShape;
use super::sphere::tangent;
use glam::{DAffine3, DVec3};

/// A [`ColliderShape`] in world space, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WorldCollider {
    Sphere {
        center: DVec3,
        radius: f64,
        inside: bool,
    },
    Capsule {
        from: DVec3,
        to: DVec3,
        radius: f64,
        inside: bool,
    },
    /// Tails stay on the side that `normal` (unit) points to.
    Plane {
        point: DVec3,
        normal: DVec3,
    },
}

/// The directions that a collider allows: outside a cone about an axis, or inside it.
struct Cone {
    axis: DVec3,
    cos: f64,
    inside: bool,
}

impl WorldCollider {
    /// Transforms a shape from a joint's space to world space. The radius grows with the longest axis. `None` if a number is not
    /// finite or the plane has no normal.
    pub(crate) fn new(shape: &ColliderShape, world_from_joint: &DAffine3) -> Option<WorldCollider> {
        let m = &world_from_joint.matrix3;
        let scale = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length());
        let at = |p: glam::Vec3| world_from_joint.transform_point3(p.as_dvec3());
        let collider = match *shape {
            ColliderShape::Sphere { offset, radius, inside } => {
                WorldCollider::Sphere { center: at(offset), radius: f64::from(radius) * scale, inside }
            }
            ColliderShape::Capsule { offset, tail, radius, inside } => WorldCollider::Capsule {
                from: at(offset),
                to: at(tail),
                radius: f64::from(radius) * scale,
                inside,
            },
            ColliderShape::Plane { offset, normal } => {
                WorldCollider::Plane { point: at(offset), normal: (*m * normal.as_dvec3()).try_normalize()? }
            }
        };
        let finite = match collider {
            WorldCollider::Sphere { center, radius, .. } => center.is_finite() && radius.is_finite(),
            WorldCollider::Capsule { from, to, radius, .. } => {
                from.is_finite() && to.is_finite() && radius.is_finite()
            }
            WorldCollider::Plane { point, .. } => point.is_finite(),
        };
        finite.then_some(collider)
    }

    /// Turns a stick as little as possible so that its tail, a ball of `hit_radius`, does not enter the collider, and removes the
    /// velocity that leads into it. If every direction enters, the one that enters least is taken. Returns whether anything
    /// changed.
    pub(crate) fn push_out(
        &self,
        head: DVec3,
        length: f64,
        hit_radius: f64,
        direction: &mut DVec3,
        velocity: &mut DVec3,
    ) -> bool {
        /// The nearest point of a capsule's axis changes as the tail moves along it.
        const MAX_ROUNDS: usize = 4;
        let mut touched = false;
        for _ in 0..MAX_ROUNDS {
            let Some(cone) = self.allowed_cone(head, length, hit_radius, *direction) else { break };
            if !cone.push_out(direction, velocity) {
                break;
            }
            touched = true;
            if !matches!(self, WorldCollider::Capsule { .. }) {
                break;
            }
        }
        touched
    }

    fn allowed_cone(&self, head: DVec3, length: f64, hit_radius: f64, direction: DVec3) -> Option<Cone> {
        let (center, radius, inside) = match *self {
            WorldCollider::Plane { point, normal } => {
                let cos = (hit_radius - normal.dot(head - point)) / length;
                return Some(Cone { axis: normal, cos, inside: true });
            }
            WorldCollider::Sphere { center, radius, inside } => (center, radius, inside),
            WorldCollider::Capsule { from, to, radius, inside } => {
                let (axis, tail) = (to - from, head + direction * length);
                let along = (tail - from).dot(axis) / axis.length_squared();
                let along = if along.is_finite() { along.clamp(0.0, 1.0) } else { 0.0 };
                (from + axis * along, radius, inside)
            }
        };
        let reach = if inside { (radius - hit_radius).max(0.0) } else { radius + hit_radius };
        let to_center = center - head;
        let axis = to_center.try_normalize()?;
        let distance = to_center.length();
        let cos = (length * length + distance * distance - reach * reach) / (2.0 * length * distance);
        Some(Cone { axis, cos, inside })
    }
}

impl Cone {
    fn push_out(&self, direction: &mut DVec3, velocity: &mut DVec3) -> bool {
        /// Rounding error of a tail that rests on a surface.
        const MAX_ROUNDING_ERROR: f64 = 1e-12;
        let now = direction.dot(self.axis);
        let entered = if self.inside {
            now < self.cos - MAX_ROUNDING_ERROR
        } else {
            now > self.cos + MAX_ROUNDING_ERROR
        };
        if !entered {
            return false;
        }
        let across = tangent(self.axis, *direction).try_normalize();
        let across = across.unwrap_or_else(|| self.axis.any_orthonormal_vector());
        let cos = self.cos.clamp(-1.0, 1.0);
        let before = *direction;
        *direction = (self.axis * cos + across * (1.0 - cos * cos).max(0.0).sqrt()).normalize();
        // Outwards is away from the axis, or towards it if the collider keeps tails inside.
        let out = tangent(*direction, self.axis).normalize_or_zero() * if self.inside { 1.0 } else { -1.0 };
        *velocity = tangent(*direction, *velocity);
        *velocity -= out * velocity.dot(out).min(0.0);
        *direction != before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: DVec3 = DVec3::new(0.1, 2.0, -0.3);

    fn pushed_out(collider: WorldCollider, direction: DVec3, velocity: DVec3) -> (DVec3, DVec3, bool) {
        let (mut d, mut v) = (direction, velocity);
        let touched = collider.push_out(HEAD, 0.5, 0.02, &mut d, &mut v);
        assert!((d.length() - 1.0).abs() < 1e-12 && v.dot(d).abs() < 1e-9);
        (HEAD + d * 0.5, v, touched)
    }

    #[test]
    fn a_tail_is_pushed_to_the_surface_and_loses_its_inward_velocity() {
        let center = HEAD + DVec3::new(0.1, -0.5, 0.0);
        let ball = WorldCollider::Sphere { center, radius: 0.2, inside: false };
        let (tail, velocity, touched) = pushed_out(ball, DVec3::NEG_Y, DVec3::X * 3.0);
        assert!(touched && ((tail - center).length() - 0.22).abs() < 1e-12, "{tail}");
        // The tail moved towards +x, into the ball.
        assert!(velocity.length() < 1e-9, "{velocity}");
        // A velocity out of the ball stays.
        let (_, velocity, _) = pushed_out(ball, DVec3::NEG_Y, DVec3::X * -3.0);
        assert!(velocity.length() > 2.5);
        // A tail outside the ball is unchanged.
        assert!(!pushed_out(ball, DVec3::Y, DVec3::X).2);
        // A stick inside a large ball points outwards as far as possible.
        let all = WorldCollider::Sphere { center: HEAD + DVec3::X * 0.1, radius: 5.0, inside: false };
        assert!((pushed_out(all, DVec3::X, DVec3::ZERO).0 - (HEAD + DVec3::NEG_X * 0.5)).length() < 1e-9);
    }

    #[test]
    fn inside_colliders_and_planes_keep_tails_on_the_allowed_side() {
        let center = HEAD + DVec3::NEG_Y * 0.5;
        let bowl = WorldCollider::Sphere { center, radius: 0.2, inside: true };
        let (tail, ..) = pushed_out(bowl, DVec3::X, DVec3::ZERO);
        assert!(((tail - center).length() - 0.18).abs() < 1e-12);
        let floor = WorldCollider::Plane { point: DVec3::Y * 1.7, normal: DVec3::Y };
        let (tail, velocity, _) = pushed_out(floor, DVec3::new(0.6, -0.8, 0.0), DVec3::new(-0.8, -0.6, 0.0));
        assert!((tail.y - 1.72).abs() < 1e-12 && velocity.length() < 1e-9, "{tail} {velocity}");
        // If the whole stick is below the plane, it points straight up.
        let flood = WorldCollider::Plane { point: DVec3::Y * 9.0, normal: DVec3::Y };
        assert!((pushed_out(flood, DVec3::X, DVec3::ZERO).0 - HEAD - DVec3::Y * 0.5).length() < 1e-9);
    }

    #[test]
    fn capsules_keep_tails_out_along_their_whole_length() {
        let (from, to) = (HEAD + DVec3::new(-1.0, -0.4, 0.0), HEAD + DVec3::new(1.0, -0.4, 0.0));
        let rod = WorldCollider::Capsule { from, to, radius: 0.1, inside: false };
        for x in [-0.5, 0.0, 0.7] {
            let (tail, _, touched) = pushed_out(rod, DVec3::new(x, -1.0, 0.01).normalize(), DVec3::ZERO);
            let off = (tail - HEAD).with_x(0.0) - DVec3::NEG_Y * 0.4;
            assert!(touched || off.length() > 0.12);
            assert!(off.length() > 0.12 - 1e-3, "{x}: {}", off.length());
        }
        // A capsule of no length is a ball.
        let dot = WorldCollider::Capsule { from, to: from, radius: 0.1, inside: false };
        let ball = WorldCollider::Sphere { center: from, radius: 0.1, inside: false };
        let d = (from - HEAD).normalize();
        assert_eq!(pushed_out(dot, d, DVec3::ZERO), pushed_out(ball, d, DVec3::ZERO));
    }
}
