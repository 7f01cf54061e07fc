//! Paths: smooth curves through points, parameterized by arc length.

use crate::stage::actor::Placement;
use choreo_motion::{Front, Time};
use glam::{DQuat, DVec3};

/// Pieces of a segment for the integration of arc length (Gauss–Legendre, 3 points): an error of 1e-9 of the length of a curved segment.
const PIECES_PER_SEGMENT: usize = 32;

/// A centripetal Catmull–Rom spline (C. Yuksel, S. Schaefer, J. Keyser, "Parameterization and applications of Catmull–Rom
/// curves", 2011): through all points, without loops or cusps between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Points that the path goes through, metres.
    pub points: Vec<DVec3>,
    /// Whether the path leads from its last point back to the first.
    pub closed: bool,
    /// Cubic Hermite segments: start, end, and the tangents there.
    segments: Vec<[DVec3; 4]>,
    /// Arc length from the start of the path to the end of each piece, metres.
    lengths: Vec<f64>,
}

/// Reason why no path goes through some points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathError {
    /// The number of points, fewer than two.
    TooFew(usize),
    /// The point with this index is not finite.
    NotFinite(usize),
    /// Two neighboring points, by index, are in the same place.
    SamePlace(usize, usize),
}

choreo_motion::error_texts! { PathError:
    Self::TooFew(count) => "a path needs at least 2 points; the number of points is {count}";
    Self::NotFinite(index) => "point {index} is not finite";
    Self::SamePlace(first, second) => "points {first} and {second} are in the same place";
}

/// Motion of an actor along a path.
#[derive(Clone, Debug, PartialEq)]
pub struct PathFollowing {
    /// The path, relative to the position and rotation at which the actor is placed.
    pub path: Path,
    /// Stage time at which the actor sets out.
    pub start: Time,
    /// Speed along the path.
    pub pace: Pace,
    /// Whether the actor turns along the path; else it keeps its own direction.
    pub turns: bool,
}

/// Speed along a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Metres a second.
    Constant(f64),
    /// The speed of the root motion of its clips.
    FromRootMotion,
}

impl Path {
    /// A path through at least two points. Neighbors must not be in the same place.
    pub fn new(points: Vec<DVec3>, closed: bool) -> Result<Path, PathError> {
        if points.len() < 2 {
            return Err(PathError::TooFew(points.len()));
        }
        if let Some(i) = points.iter().position(|p| !p.is_finite()) {
            return Err(PathError::NotFinite(i));
        }
        let count = points.len();
        let segments = if closed { count } else { count - 1 };
        for i in 0..segments {
            if points[i].distance(points[(i + 1) % count]) < 1e-9 {
                return Err(PathError::SamePlace(i, (i + 1) % count));
            }
        }
        let at = |i: i64| -> DVec3 {
            let last = count as i64 - 1;
            if closed {
                points[i.rem_euclid(count as i64) as usize]
            } else if i < 0 {
                points[0] * 2.0 - points[1]
            } else if i > last {
                points[count - 1] * 2.0 - points[count - 2]
            } else {
                points[i as usize]
            }
        };
        let segment = |i: i64| {
            let [a, b, c, d] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
            let knot = |p: DVec3, q: DVec3| p.distance(q).sqrt();
            let (u, v, w) = (knot(a, b), knot(b, c), knot(c, d));
            let tangent = |p: DVec3, q: DVec3, r: DVec3, before: f64, after: f64| {
                (q - p) / before - (r - p) / (before + after) + (r - q) / after
            };
            [b, c, tangent(a, b, c, u, v) * v, tangent(b, c, d, v, w) * v]
        };
        let segments: Vec<[DVec3; 4]> = (0..segments as i64).map(segment).collect();
        let mut path = Path { points, closed, segments, lengths: Vec::new() };
        let mut sum = 0.0;
        for segment in 0..path.segments.len() {
            for piece in 0..PIECES_PER_SEGMENT {
                let from = piece as f64 / PIECES_PER_SEGMENT as f64;
                sum += path.piece_length(segment, from, from + 1.0 / PIECES_PER_SEGMENT as f64);
                path.lengths.push(sum);
            }
        }
        Ok(path)
    }

    /// Length of the path, metres.
    pub fn length(&self) -> f64 {
        self.lengths.last().copied().unwrap_or(0.0)
    }

    fn segment_position(&self, segment: usize, u: f64) -> DVec3 {
        let [a, b, ma, mb] = self.segments[segment];
        let (u2, u3) = (u * u, u * u * u);
        a * (2.0 * u3 - 3.0 * u2 + 1.0)
            + ma * (u3 - 2.0 * u2 + u)
            + b * (3.0 * u2 - 2.0 * u3)
            + mb * (u3 - u2)
    }

    fn segment_derivative(&self, segment: usize, u: f64) -> DVec3 {
        let [a, b, ma, mb] = self.segments[segment];
        let u2 = u * u;
        (a - b) * (6.0 * u2 - 6.0 * u) + ma * (3.0 * u2 - 4.0 * u + 1.0) + mb * (3.0 * u2 - 2.0 * u)
    }

    fn piece_length(&self, segment: usize, from: f64, to: f64) -> f64 {
        const GAUSS_NODE: f64 = 0.774_596_669_241_483_4;
        let (middle, half) = ((from + to) / 2.0, (to - from) / 2.0);
        let speed = |x: f64| self.segment_derivative(segment, middle + half * x).length();
        half * (5.0 * speed(-GAUSS_NODE) + 8.0 * speed(0.0) + 5.0 * speed(GAUSS_NODE)) / 9.0
    }

    /// Position and tangent (not normalized) after this many metres. An open path ends at its last point, a closed one goes round again.
    pub fn at(&self, metres: f64) -> (DVec3, DVec3) {
        let length = self.length();
        let s = if self.closed {
            metres - libm::floor(metres / length) * length
        } else {
            metres.clamp(0.0, length)
        };
        let piece = self.lengths.partition_point(|end| *end < s).min(self.lengths.len() - 1);
        let (segment, from) =
            (piece / PIECES_PER_SEGMENT, (piece % PIECES_PER_SEGMENT) as f64 / PIECES_PER_SEGMENT as f64);
        let metres_in_piece = s - if piece == 0 { 0.0 } else { self.lengths[piece - 1] };
        // The length of a piece is nearly linear in u: Newton's method is at the last bit after three steps.
        let mut u = from;
        for _ in 0..4 {
            let speed = self.segment_derivative(segment, u).length();
            if speed > 0.0 {
                u += (metres_in_piece - self.piece_length(segment, from, u)) / speed;
            }
            u = u.clamp(from, from + 1.0 / PIECES_PER_SEGMENT as f64);
        }
        (self.segment_position(segment, u), self.segment_derivative(segment, u))
    }
}

impl PathFollowing {
    /// The placement at a distance in metres along the path, with `front` ahead. `anchor`: the point in model space that stays on the path,
    /// where the root stands.
    pub fn placed(&self, from: Placement, metres: f64, anchor: DVec3, front: Front) -> Placement {
        let (place, way) = self.path.at(metres);
        let yaw = if self.turns && (way.x != 0.0 || way.z != 0.0) {
            libm::atan2(way.x, way.z) - front.yaw_rad()
        } else {
            0.0
        };
        let turned = from.rotation * DQuat::from_rotation_y(yaw);
        let root = from.translation + from.rotation * place;
        Placement {
            translation: root - turned * (from.scale * anchor),
            rotation: turned.normalize(),
            scale: from.scale,
        }
    }

    /// Metres along the path at a time. `forward`: distance that the clips' root motion has covered at a time, metres.
    pub fn metres(&self, time: Time, mut forward: impl FnMut(Time) -> f64) -> f64 {
        let time = time.max(self.start);
        match self.pace {
            Pace::Constant(speed) => speed * (time - self.start).as_secs(),
            Pace::FromRootMotion => forward(time) - forward(self.start),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn path_passes_its_points_at_constant_speed() {
        let points: Vec<DVec3> = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.5], [3.0, 1.0, 3.0], [0.0, 0.0, 4.0]]
            .map(DVec3::from_array)
            .into();
        for closed in [false, true] {
            let path = Path::new(points.clone(), closed).unwrap();
            let steps = 4000;
            let step = path.length() / f64::from(steps);
            let (mut before, mut nearest) = (path.at(0.0).0, vec![f64::INFINITY; points.len()]);
            for i in 1..=steps {
                let now = path.at(step * f64::from(i)).0;
                assert!(
                    (now.distance(before) / step - 1.0).abs() < 1e-4,
                    "{i}: {}",
                    now.distance(before) / step
                );
                for (near, point) in nearest.iter_mut().zip(&points) {
                    *near = near.min(point.distance(now));
                }
                before = now;
            }
            assert!(nearest.iter().all(|d| *d < step), "{nearest:?}");
            if closed {
                assert!(path.at(path.length() * 3.5).0.distance(path.at(path.length() * 0.5).0) < 1e-9);
            } else {
                assert!(path.at(1e9).0.distance(points[3]) < 1e-12);
            }
        }
    }

    #[test]
    fn path_is_straight_through_collinear_points_and_round_through_a_circle() {
        let line = Path::new(vec![DVec3::ZERO, DVec3::X * 2.0, DVec3::X * 5.0], false).unwrap();
        assert!((line.length() - 5.0).abs() < 1e-12);
        assert!(line.at(3.3).0.abs_diff_eq(DVec3::X * 3.3, 1e-9));
        let round: Vec<DVec3> = (0..32)
            .map(|i| f64::from(i) / 32.0 * std::f64::consts::TAU)
            .map(|a| DVec3::new(libm::sin(a), 0.0, libm::cos(a)))
            .collect();
        let circle = Path::new(round, true).unwrap();
        assert!((circle.length() - std::f64::consts::TAU).abs() < 1e-3);
        assert!(Path::new(vec![DVec3::ZERO], false).is_err());
        assert!(Path::new(vec![DVec3::X, DVec3::X, DVec3::ZERO], false).is_err());
    }
}
