//! Gizmos: arrows, rings and boxes that move, rotate and scale the selection by mouse. Computes their positions in world space and the change that
//! a drag makes. No UI toolkit is used here.

use crate::geometry::projection::ViewProjection;
use crate::geometry::round_to_pixel;
use glam::{DAffine3, DQuat, DVec2, DVec3};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    Move,
    Turn,
    Scale,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handle {
    /// Moves along, rotates about, or scales along x (0), y (1) or z (2) of the world, or of the object for scale.
    Axis(usize),
    /// Moves in the ground plane, or scales along all three axes.
    Middle,
}

pub const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];
/// Length of an arm, points of the window.
pub const ARM_LENGTH: f64 = 74.0;
const GRAB_DISTANCE: f64 = 9.0;
/// Number of segments of a ring.
pub(crate) const RING_SEGMENTS: usize = 48;
/// Step sizes while a key is held: degrees, and metres or factor.
pub const DRAG_STEPS: (f64, f64) = (15.0, 0.1);

/// The total change of a drag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    Move(DVec3),
    Turn(DQuat),
    Scale(DVec3),
}

impl Change {
    pub const fn none(tool: Tool) -> Change {
        match tool {
            Tool::Move => Change::Move(DVec3::ZERO),
            Tool::Turn => Change::Turn(DQuat::IDENTITY),
            Tool::Scale => Change::Scale(DVec3::ONE),
        }
    }
}

/// A drag in progress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drag {
    pub tool: Tool,
    pub handle: Handle,
    /// Transform of the object before the drag.
    pub world_from_model: DAffine3,
    /// Position at which the drag began, points of the window.
    pub from: DVec2,
}

/// World-space direction of an arm.
pub fn arm_direction(tool: Tool, axis: usize, world_from_model: &DAffine3) -> DVec3 {
    match tool {
        Tool::Scale => world_from_model.transform_vector3(AXES[axis]).normalize_or(AXES[axis]),
        _ => AXES[axis],
    }
}

/// Points of the ring about an axis, world space.
pub fn ring_points(center: DVec3, axis: usize, radius: f64) -> impl Iterator<Item = DVec3> {
    let (u, v) = (AXES[(axis + 1) % 3], AXES[(axis + 2) % 3]);
    (0..=RING_SEGMENTS).map(move |i| {
        let (sin, cos) = libm::sincos(i as f64 / RING_SEGMENTS as f64 * core::f64::consts::TAU);
        center + (u * cos + v * sin) * radius
    })
}

/// The handle at a position in the window.
pub(crate) fn handle_at(
    tool: Tool,
    world_from_model: &DAffine3,
    projection: &ViewProjection,
    at: DVec2,
) -> Option<Handle> {
    let center = world_from_model.translation;
    let length = ARM_LENGTH * projection.metres_per_point(center);
    let middle = projection.project_point(center)?;
    if tool != Tool::Turn && (at - middle).length() < GRAB_DISTANCE {
        return Some(Handle::Middle);
    }
    let distance = |axis: usize| -> Option<f64> {
        match tool {
            Tool::Turn => {
                let points: Vec<DVec2> =
                    ring_points(center, axis, length).filter_map(|p| projection.project_point(p)).collect();
                points.windows(2).map(|w| distance_to_segment(at, w[0], w[1])).reduce(f64::min)
            }
            _ => {
                let tip = projection
                    .project_point(center + arm_direction(tool, axis, world_from_model) * length)?;
                Some(distance_to_segment(at, middle, tip))
            }
        }
    };
    let nearest =
        (0..3).filter_map(|axis| Some((distance(axis)?, axis))).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (nearest.0 < GRAB_DISTANCE).then_some(Handle::Axis(nearest.1))
}

pub(crate) fn distance_to_segment(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = (b - a).length_squared();
    let part = if along > 0.0 { ((p - a).dot(b - a) / along).clamp(0.0, 1.0) } else { 0.0 };
    (p - a - (b - a) * part).length()
}

impl Drag {
    /// The change when the pointer is at `to`, rounded to the digits that a pixel resolves. `in_steps`: rounded to whole steps.
    pub fn change(&self, projection: &ViewProjection, to: DVec2, in_steps: bool) -> Change {
        let center = self.world_from_model.translation;
        let metres = projection.metres_per_point(center);
        let round = |value: f64, step: f64, pixel: f64| match in_steps {
            true => (value / step).round() * step,
            false => round_to_pixel(value, pixel),
        };
        match (self.tool, self.handle) {
            (Tool::Move, Handle::Axis(axis)) => {
                let along = |at| distance_along_axis(projection.ray_through(at), center, AXES[axis]);
                let by = along(to).zip(along(self.from)).map_or(0.0, |(to, from)| to - from);
                Change::Move(AXES[axis] * round(by, DRAG_STEPS.1, metres))
            }
            (Tool::Move, Handle::Middle) => {
                let on_ground = |at| ray_plane_intersection(projection.ray_through(at), center, DVec3::Y);
                let by = on_ground(to).zip(on_ground(self.from)).map_or(DVec3::ZERO, |(to, from)| to - from);
                let round = |by| round(by, DRAG_STEPS.1, metres);
                Change::Move(DVec3::new(round(by.x), 0.0, round(by.z)))
            }
            (Tool::Turn, Handle::Axis(axis)) => {
                // Angles are measured on the screen, so that a ring seen edge-on works as well as one seen along its axis.
                let middle = projection.project_point(center).unwrap_or(self.from);
                let angle = |at: DVec2| libm::atan2(middle.y - at.y, at.x - middle.x);
                let towards =
                    if projection.direction_to_camera(center).dot(AXES[axis]) < 0.0 { -1.0 } else { 1.0 };
                let degrees = ((angle(to) - angle(self.from)) * towards).to_degrees();
                let pixel = (1.0 / (to - middle).length().max(1.0)).to_degrees();
                let degrees = round((degrees + 540.0).rem_euclid(360.0) - 180.0, DRAG_STEPS.0, pixel);
                let (sin, cos) = libm::sincos(degrees.to_radians() / 2.0);
                let v = AXES[axis] * sin;
                Change::Turn(DQuat::from_xyzw(v.x, v.y, v.z, cos))
            }
            (Tool::Scale, handle) => {
                let (factor, pixel) = match handle {
                    Handle::Axis(axis) => {
                        let arm = arm_direction(Tool::Scale, axis, &self.world_from_model);
                        let along = |at| distance_along_axis(projection.ray_through(at), center, arm);
                        let (from, to) = (along(self.from).unwrap_or(1.0), along(to).unwrap_or(1.0));
                        let factor = if from.abs() < 1e-9 { 1.0 } else { to / from };
                        (factor, metres / from.abs().max(1e-9))
                    }
                    // Dragging up enlarges, down reduces.
                    Handle::Middle => {
                        let factor = libm::pow(2.0, (self.from.y - to.y) / ARM_LENGTH);
                        (factor, factor * core::f64::consts::LN_2 / ARM_LENGTH)
                    }
                };
                let factor = round(factor, DRAG_STEPS.1, pixel).clamp(0.01, 100.0);
                Change::Scale(match handle {
                    Handle::Axis(axis) => DVec3::ONE + AXES[axis] * (factor - 1.0),
                    Handle::Middle => DVec3::splat(factor),
                })
            }
            (tool, _) => Change::none(tool),
        }
    }
}

/// Distance in metres along an axis through `center` to its point nearest to a ray. `None` if the ray is parallel to the axis.
fn distance_along_axis((origin, direction): (DVec3, DVec3), center: DVec3, axis: DVec3) -> Option<f64> {
    let across = axis.dot(direction);
    let determinant = 1.0 - across * across;
    if determinant < 1e-6 {
        return None;
    }
    let from = origin - center;
    Some((axis.dot(from) - across * direction.dot(from)) / determinant)
}

fn ray_plane_intersection(
    (origin, direction): (DVec3, DVec3),
    center: DVec3,
    normal: DVec3,
) -> Option<DVec3> {
    let towards = direction.dot(normal);
    if towards.abs() < 1e-3 {
        return None;
    }
    let t = (center - origin).dot(normal) / towards;
    (t > 0.0).then(|| origin + direction * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_asset::Projection;
    use choreo_stage::CameraState;

    fn projection() -> ViewProjection {
        let world_from_view = DAffine3::from_rotation_translation(
            DQuat::from_rotation_y(0.4) * DQuat::from_rotation_x(-0.3),
            DVec3::new(2.5, 2.2, 5.5),
        );
        let camera = CameraState { camera: None, world_from_view, projection: Projection::default() };
        ViewProjection::new(&camera, DVec2::ZERO, DVec2::new(800.0, 600.0))
    }

    fn placed() -> DAffine3 {
        DAffine3::from_translation(DVec3::new(0.3, 0.4, 0.2))
    }

    fn drag(tool: Tool, handle: Handle, from: DVec2) -> Drag {
        Drag { tool, handle, world_from_model: placed(), from }
    }

    #[test]
    fn an_arrow_follows_the_mouse_along_its_axis() {
        let projection = projection();
        let center = placed().translation;
        for (axis, along) in AXES.into_iter().enumerate() {
            let from = projection.project_point(center + along * 0.2).unwrap();
            assert_eq!(handle_at(Tool::Move, &placed(), &projection, from), Some(Handle::Axis(axis)));
            let to = projection.project_point(center + along * 1.2).unwrap();
            let Change::Move(by) = drag(Tool::Move, Handle::Axis(axis), from).change(&projection, to, false)
            else {
                panic!()
            };
            assert!((by - along).length() < 1e-6, "{by}");
        }
        let from = projection.project_point(center).unwrap();
        let to = projection.project_point(center + DVec3::new(0.52, 0.0, -0.31)).unwrap();
        let ground = drag(Tool::Move, Handle::Middle, from);
        assert_eq!(handle_at(Tool::Move, &placed(), &projection, from), Some(Handle::Middle));
        let Change::Move(by) = ground.change(&projection, to, true) else { panic!() };
        assert!((by - DVec3::new(0.5, 0.0, -0.3)).length() < 1e-9, "{by}");
    }

    /// The camera is about 7 m away: a point of the window covers 0.01 m, 0.8° of a ring and a hundredth of a scale.
    #[test]
    fn drag_changes_are_rounded_to_the_screen_resolution() {
        let (projection, center) = (projection(), placed().translation);
        let from = projection.project_point(center + DVec3::X * 0.5).unwrap();
        let to = from + DVec2::new(31.3, 4.7);
        let whole = |value: f64, parts: f64| (value * parts - (value * parts).round()).abs() < 1e-6;
        let change = |tool, handle| drag(tool, handle, from).change(&projection, to, false);
        let Change::Move(by) = change(Tool::Move, Handle::Axis(0)) else { panic!() };
        assert!(by.x > 0.1 && whole(by.x, 100.0), "{by}");
        let Change::Turn(by) = change(Tool::Turn, Handle::Axis(1)) else { panic!() };
        assert!(whole(2.0 * libm::atan2(by.y, by.w).to_degrees(), 10.0), "{by}");
        let Change::Scale(by) = change(Tool::Scale, Handle::Middle) else { panic!() };
        assert!(by.x < 1.0 && whole(by.x, 100.0), "{by}");
    }

    #[test]
    fn a_ring_turns_with_the_mouse() {
        // The camera looks straight down: counter-clockwise on the screen is counter-clockwise about y.
        let world_from_view = DAffine3::from_rotation_translation(
            DQuat::from_rotation_x(-core::f64::consts::FRAC_PI_2),
            DVec3::new(0.3, 8.0, 0.2),
        );
        let camera = CameraState { camera: None, world_from_view, projection: Projection::default() };
        let projection = ViewProjection::new(&camera, DVec2::ZERO, DVec2::new(800.0, 600.0));
        let middle = projection.project_point(placed().translation).unwrap();
        let from = middle + DVec2::new(ARM_LENGTH, 0.0);
        assert_eq!(handle_at(Tool::Turn, &placed(), &projection, from), Some(Handle::Axis(1)));
        let turn = drag(Tool::Turn, Handle::Axis(1), from);
        let change = turn.change(&projection, middle + DVec2::new(0.0, -50.0), false);
        let Change::Turn(by) = change else { panic!() };
        assert!(by.dot(DQuat::from_rotation_y(core::f64::consts::FRAC_PI_2)).abs() > 1.0 - 1e-9, "{by}");
    }

    #[test]
    fn scale_is_a_factor_and_never_becomes_negative() {
        let projection = projection();
        let center = placed().translation;
        let at = |metres: f64| projection.project_point(center + DVec3::X * metres).unwrap();
        let scale = drag(Tool::Scale, Handle::Axis(0), at(0.4));
        assert_eq!(scale.change(&projection, at(0.8), true), Change::Scale(DVec3::new(2.0, 1.0, 1.0)));
        let Change::Scale(by) = scale.change(&projection, at(-3.0), false) else { panic!() };
        assert!((by - DVec3::new(0.01, 1.0, 1.0)).length() < 1e-12, "{by}");
        assert_eq!(scale.change(&projection, at(0.4), false), Change::none(Tool::Scale));
    }
}
