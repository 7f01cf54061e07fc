//! Orthographic views along the axes: top, front, side.

use crate::state::orbit::{ORTHOGRAPHIC_HEIGHT_PER_METRE, Orbit};
use choreo_asset::Projection;
use core::f64::consts::{FRAC_PI_2, PI};
use glam::DVec3;

/// Side of a view. Characters face +Z, so that "front" shows their faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Right,
    Left,
    Top,
    Bottom,
    Front,
    Back,
}

impl Side {
    pub const ALL: [Side; 6] = [Side::Right, Side::Left, Side::Top, Side::Bottom, Side::Front, Side::Back];

    pub fn name(self) -> &'static str {
        match self {
            Side::Right => "Right",
            Side::Left => "Left",
            Side::Top => "Top",
            Side::Bottom => "Bottom",
            Side::Front => "Front",
            Side::Back => "Back",
        }
    }

    /// Unit vector from the center to the camera.
    pub fn direction(self) -> DVec3 {
        match self {
            Side::Right => DVec3::X,
            Side::Left => -DVec3::X,
            Side::Top => DVec3::Y,
            Side::Bottom => -DVec3::Y,
            Side::Front => DVec3::Z,
            Side::Back => -DVec3::Z,
        }
    }

    /// Azimuth and elevation of the orbit, radians.
    fn angles(self) -> [f64; 2] {
        match self {
            Side::Right => [FRAC_PI_2, 0.0],
            Side::Left => [-FRAC_PI_2, 0.0],
            Side::Top => [0.0, FRAC_PI_2],
            Side::Bottom => [0.0, -FRAC_PI_2],
            Side::Front => [0.0, 0.0],
            Side::Back => [PI, 0.0],
        }
    }

    /// The opposite side, whose axis end lies behind this one in the corner of the viewport.
    pub fn opposite(self) -> Side {
        match self {
            Side::Right => Side::Left,
            Side::Left => Side::Right,
            Side::Top => Side::Bottom,
            Side::Bottom => Side::Top,
            Side::Front => Side::Back,
            Side::Back => Side::Front,
        }
    }

    /// The side of an orbit without perspective.
    pub fn of(orbit: &Orbit) -> Option<Side> {
        let flat = matches!(orbit.projection, Projection::Orthographic { .. });
        let same = |side: &Side| side.angles() == [orbit.azimuth, orbit.elevation];
        Side::ALL.into_iter().find(|side| flat && same(side))
    }
}

impl Orbit {
    /// Looks from a side in parallel projection, at the center of the orbit.
    pub fn look_from(&mut self, side: Side) {
        [self.azimuth, self.elevation] = side.angles();
        self.roll = 0.0;
        let (Projection::Perspective { near, .. } | Projection::Orthographic { near, .. }) = self.projection;
        self.projection =
            Projection::Orthographic { height: ORTHOGRAPHIC_HEIGHT_PER_METRE, near, far: 10_000.0 };
    }

    /// Returns to perspective projection.
    pub(crate) fn look_in_perspective(&mut self) {
        if matches!(self.projection, Projection::Orthographic { .. }) {
            self.projection = Projection::default();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ground truth: the names of the directions.
    #[test]
    fn an_axis_view_looks_along_its_axis() {
        for side in Side::ALL {
            let [azimuth, elevation] = side.angles();
            let projection =
                Projection::Orthographic { height: ORTHOGRAPHIC_HEIGHT_PER_METRE, near: 0.1, far: 100.0 };
            let orbit = Orbit {
                center: DVec3::new(1.0, 2.0, 3.0),
                distance: 5.0,
                azimuth,
                elevation,
                roll: 0.0,
                projection,
            };
            let camera = orbit.camera();
            let eye = orbit.center + side.direction() * 5.0;
            assert!((camera.world_from_view.translation - eye).length() < 1e-12, "{side:?}");
            // Heads point up. From above and below, the far edge of the image is −Z and +Z.
            let up = match side {
                Side::Top => -DVec3::Z,
                Side::Bottom => DVec3::Z,
                _ => DVec3::Y,
            };
            assert!((camera.world_from_view.matrix3.y_axis - up).length() < 1e-12, "{side:?}");
            assert_eq!(Side::of(&orbit), Some(side));
        }
    }
}
