//! Keyframes of a walk to a point: a turn on the spot, uniform acceleration, a straight path, uniform deceleration, and
//! optionally a second turn.

use crate::api_error::ApiError;
use choreo_motion::{Interpolation, Time};
use choreo_stage::{Channel, Property};
use glam::{DQuat, DVec3};

/// Average speed of a turn on the spot in radians per second: 150° per second.
const TURN_SPEED: f64 = 2.618;
/// Shortest distance of a walk, metres.
const MIN_DISTANCE: f64 = 0.05;
/// Keyframes of a turn per second.
const TURN_KEYS_PER_SECOND: f64 = 60.0;

/// Pace of a walk.
#[derive(Clone, Copy, Debug)]
pub(crate) enum WalkPace {
    /// Metres per second between start and stop.
    Speed(f64),
    /// Time of arrival.
    Arrive(Time),
}

/// Inputs from which a walk is computed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WalkPlan {
    /// Time at which the turn begins.
    pub from: Time,
    /// Position of the actor at the start.
    pub start: DVec3,
    /// Rotation of the actor at the start.
    pub rotation: DQuat,
    /// Position at which the walk ends.
    pub point: DVec3,
    /// Direction of the model's front, model space.
    pub front: DVec3,
    /// Duration of the acceleration, and of the deceleration.
    pub fade: Time,
    pub pace: WalkPace,
    /// Point to which the actor turns on arrival.
    pub face: Option<DVec3>,
}

/// A computed walk.
#[derive(Clone, Debug)]
pub(crate) struct Walk {
    pub from: Time,
    /// Time at which the acceleration begins and the walk clip begins to fade in.
    pub accelerates_from: Time,
    /// Time at which the walk has full weight and speed.
    pub full_speed_from: Time,
    /// Time at which the deceleration begins.
    pub decelerates_from: Time,
    /// Time of arrival.
    pub until: Time,
    /// End of the turn on arrival; the time of arrival if there is no such turn.
    pub turned_until: Time,
    /// Metres per second between start and stop.
    pub speed: f64,
    start: DVec3,
    pub point: DVec3,
    rotations: Vec<(Time, DQuat)>,
}

impl Walk {
    /// Computes a walk.
    ///
    /// # Errors
    /// Returns an error if the point is nearer than 0.05 m, if the arrival is too early, or if the point to face is the point of
    /// arrival.
    pub(crate) fn new(plan: WalkPlan) -> Result<Walk, ApiError> {
        let WalkPlan { from, start, rotation, point, front, fade, pace, face } = plan;
        let path = (point - start).with_y(0.0);
        let metres = path.length();
        if metres < MIN_DISTANCE {
            return Err(ApiError::new(format!(
                "walk_to: the point is {metres:.3} m away, must be at least {MIN_DISTANCE} m"
            )));
        }
        let angle = yaw_between(rotation * front, path);
        let turn_secs = angle.abs() / TURN_SPEED;
        // The turn ends halfway through the acceleration, when the actor has hardly moved.
        let accelerates_from = from + Time::from_secs((turn_secs - 0.5 * fade.as_secs()).max(0.0));
        let full_speed_from = accelerates_from + fade;
        // Acceleration and deceleration each cover half the distance of full speed in the same time, so the walk takes
        // metres / speed from `full_speed_from` on.
        let earliest_arrival = full_speed_from + fade;
        let until = match pace {
            WalkPace::Speed(speed) => {
                (full_speed_from + Time::from_secs(metres / speed)).max(earliest_arrival)
            }
            WalkPace::Arrive(arrive) if arrive < earliest_arrival => {
                let text = format!("walk_to: the arrival at {} s is too early", arrive.as_secs());
                let (earliest, turn, fade) = (earliest_arrival.as_secs(), turn_secs, fade.as_secs());
                return Err(ApiError::new(text).hint(format!(
                    "turn ({turn:.2} s), start and stop ({fade} s each) take until {earliest:.2} s; a shorter fade starts faster"
                )));
            }
            WalkPace::Arrive(arrive) => arrive,
        };
        let speed = metres / (until - full_speed_from).as_secs();
        let mut rotations = turn_keys(from, rotation, angle);
        let mut turned_until = until;
        if let Some(face) = face {
            let direction = (face - point).with_y(0.0);
            if direction.length() < MIN_DISTANCE {
                return Err(ApiError::new("walk_to: face: the target is the point where the actor stops"));
            }
            // The second turn begins halfway through the deceleration.
            let begins = (until - Time::from_secs(0.5 * fade.as_secs())).max(full_speed_from);
            let rotation_on_path = DQuat::from_rotation_y(angle) * rotation;
            rotations.extend(turn_keys(begins, rotation_on_path, yaw_between(path, direction)));
            turned_until = until.max(rotations.last().map_or(until, |(end, _)| *end));
        }
        Ok(Walk {
            from,
            accelerates_from,
            full_speed_from,
            decelerates_from: until - fade,
            until,
            turned_until,
            speed,
            start,
            point,
            rotations,
        })
    }

    /// The rotation of the actor at the end.
    pub(crate) fn final_rotation(&self) -> DQuat {
        self.rotations.last().map_or(DQuat::IDENTITY, |(_, rotation)| *rotation)
    }

    /// Keyframes of the position with tangents in metres per second. Cubic Hermite splines reproduce uniform acceleration
    /// exactly.
    fn position_keys(&self) -> [(Time, DVec3, DVec3); 4] {
        let metres = (self.point - self.start).with_y(0.0).length();
        let velocity = (self.point - self.start) * (self.speed / metres);
        let ramp = velocity * (0.5 * (self.full_speed_from - self.accelerates_from).as_secs());
        [
            (self.accelerates_from, self.start, DVec3::ZERO),
            (self.full_speed_from, self.start + ramp, velocity),
            (self.decelerates_from, self.point - ramp, velocity),
            (self.until, self.point, DVec3::ZERO),
        ]
    }
}

/// Signed angle about the vertical axis from one direction to another, −π to π.
fn yaw_between(from: DVec3, to: DVec3) -> f64 {
    libm::remainder(libm::atan2(to.x, to.z) - libm::atan2(from.x, from.z), std::f64::consts::TAU)
}

/// Rotation keyframes of a turn by an angle in radians, with smooth start and end.
fn turn_keys(from: Time, rotation: DQuat, angle: f64) -> Vec<(Time, DQuat)> {
    let secs = angle.abs() / TURN_SPEED;
    let count = libm::ceil(secs * TURN_KEYS_PER_SECOND).max(1.0) as i32;
    let key = |i: i32| {
        let s = f64::from(i) / f64::from(count);
        let turned = DQuat::from_rotation_y(angle * s * s * (3.0 - 2.0 * s)) * rotation;
        (from + Time::from_secs(secs * s), turned.normalize())
    };
    (0..=count).map(key).collect()
}

/// Position and rotation channels of consecutive walks.
pub(crate) fn channels(walks: &[Walk]) -> [Channel; 2] {
    let mut position = Channel {
        property: Property::Translation,
        interpolation: Interpolation::CubicSpline,
        times: Vec::new(),
        values: Vec::new(),
    };
    let mut rotation = Channel {
        property: Property::Rotation,
        interpolation: Interpolation::Linear,
        times: Vec::new(),
        values: Vec::new(),
    };
    for walk in walks {
        for (time, at, tangent) in walk.position_keys() {
            // A key at this time exists already if the walk begins when the previous walk ends, or if it has no phase at full
            // speed.
            if position.times.last().is_none_or(|last| *last < time) {
                position.times.push(time);
                position.values.extend([tangent, at, tangent].iter().flat_map(|v| v.to_array()));
            }
        }
        for (time, turned) in &walk.rotations {
            if rotation.times.last().is_none_or(|last| last < time) {
                rotation.times.push(*time);
                rotation.values.extend(turned.to_array());
            }
        }
    }
    [position, rotation]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(point: DVec3, pace: WalkPace) -> WalkPlan {
        WalkPlan {
            from: Time::from_secs(1.0),
            start: DVec3::new(1.0, 0.2, 2.0),
            rotation: DQuat::from_rotation_y(0.5),
            point,
            front: DVec3::NEG_Z,
            fade: Time::from_secs(0.5),
            pace,
            face: None,
        }
    }

    #[test]
    fn a_walk_arrives_at_its_point_in_time_and_faces_along_its_path() {
        let point = DVec3::new(-3.0, 0.5, 4.0);
        for pace in [WalkPace::Speed(1.3), WalkPace::Speed(30.0), WalkPace::Arrive(Time::from_secs(7.25))] {
            let walk = Walk::new(plan(point, pace)).unwrap();
            match pace {
                WalkPace::Arrive(arrive) => assert_eq!(walk.until, arrive),
                WalkPace::Speed(speed) => assert!(walk.speed < speed + 1e-6, "{}", walk.speed),
            }
            let [position, rotation] = channels(std::slice::from_ref(&walk));
            let at = |time: Time| DVec3::from_slice(&position.at(time).unwrap()[..3]);
            assert!(
                (at(walk.from) - walk.start).length() < 1e-12 && (at(walk.until) - point).length() < 1e-12
            );
            // Reference: uniform acceleration, constant speed and uniform deceleration, integrated numerically.
            let (mut metres, steps) = (0.0, 20_000);
            for i in 0..steps {
                let secs =
                    (f64::from(i) + 0.5) / f64::from(steps) * (walk.until - walk.accelerates_from).as_secs();
                let time = walk.accelerates_from + Time::from_secs(secs);
                let left = (walk.until - time).as_secs();
                metres += walk.speed
                    * (secs / 0.5).min(left / 0.5).min(1.0)
                    * (walk.until - walk.accelerates_from).as_secs()
                    / f64::from(steps);
                let level = (at(time) - walk.start).with_y(0.0).length();
                assert!((level - metres).abs() < 1e-3, "{secs} s: {level} m, {metres} m");
            }
            let q = rotation.at(walk.full_speed_from).unwrap();
            let looks = DQuat::from_array(q) * DVec3::NEG_Z;
            let way = (point - walk.start).with_y(0.0).normalize();
            assert!((looks - way).length() < 1e-9, "{looks} {way}");
        }
        assert!(Walk::new(plan(point, WalkPace::Arrive(Time::from_secs(2.0)))).is_err());
        let faced =
            |face: DVec3| Walk::new(WalkPlan { face: Some(face), ..plan(point, WalkPace::Speed(1.3)) });
        let walk = faced(DVec3::new(-3.0, 1.0, 9.0)).unwrap();
        let looks = |time: Time| {
            let [_, rotation] = channels(std::slice::from_ref(&walk));
            DQuat::from_array(rotation.at(time).unwrap()) * DVec3::NEG_Z
        };
        assert!((looks(walk.turned_until) - DVec3::Z).length() < 1e-9 && walk.turned_until >= walk.until);
        assert!(
            (looks(walk.decelerates_from) - (point - walk.start).with_y(0.0).normalize()).length() < 1e-9
        );
        assert!(faced(point + DVec3::Y).is_err());
        assert!(Walk::new(plan(DVec3::new(1.0, 3.0, 2.01), WalkPace::Speed(1.0))).is_err());
    }
}
