//! State of one viewport: its camera, its overlays, and the displayed and the requested frame.

use crate::state::orbit::Orbit;
use choreo_motion::Time;
use choreo_session::{FrameInfo, ViewOverrides, ViewportCamera};
use choreo_stage::{CameraState, Snapshot, Stage};
use glam::DVec3;

/// Largest number of viewports.
pub(crate) const MAX_VIEWS: usize = 4;

#[derive(Clone, Debug, PartialEq)]
pub enum ViewCamera {
    /// The camera that the script has active.
    Script,
    /// A camera of the script by name, active or not.
    Named(String),
    Free(Orbit),
    /// A camera that moves with an actor; the orbit is relative to the actor's position.
    Follow {
        actor: String,
        orbit: Orbit,
    },
}

/// Resolution of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// Fills the panel, with fewer pixels while the view moves, to keep the scene's frame rate.
    Fitted,
    /// The size that `render` uses.
    Full,
}

/// Overlays of a viewport.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlays {
    /// Grid on the ground. The renderer draws it, so that nearer surfaces hide it.
    pub grid: bool,
    /// Icons of lights and cameras.
    pub icons: bool,
    /// Directions of the axes, in a corner of the image.
    pub axes: bool,
    /// Motion trail of the selected joint, else of the selected actor.
    pub trail: bool,
    /// Onion skins: skeletons of the selected actor before and after the playhead.
    pub onion_skins: bool,
    pub skeletons: bool,
    pub bounds: bool,
    /// Action and title safe areas, and the center.
    pub safe_areas: bool,
}

impl Default for Overlays {
    fn default() -> Overlays {
        Overlays {
            grid: true,
            icons: true,
            axes: true,
            trail: false,
            onion_skins: false,
            skeletons: false,
            bounds: false,
            safe_areas: false,
        }
    }
}

impl Overlays {
    /// All overlays with their names in the settings and their labels.
    pub fn all(&mut self) -> [(&'static str, &'static str, &mut bool); 8] {
        [
            ("grid", "Grid", &mut self.grid),
            ("axes", "Axes", &mut self.axes),
            ("icons", "Lights and cameras", &mut self.icons),
            ("skeletons", "Skeletons", &mut self.skeletons),
            ("trail", "Motion trail", &mut self.trail),
            ("onion", "Onion skin", &mut self.onion_skins),
            ("bounds", "Bounds", &mut self.bounds),
            ("safe", "Safe areas", &mut self.safe_areas),
        ]
    }
}

/// Everything that a frame depends on. A frame is only requested again if this has changed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FrameKey {
    /// Number of the scene version.
    pub scene_version: u64,
    pub reloads: u64,
    pub time: Time,
    pub size: [u32; 2],
    pub samples: u32,
    pub viewport_camera: ViewportCamera,
    pub moving: bool,
    pub overrides: ViewOverrides,
}

pub struct View {
    pub camera: ViewCamera,
    pub resolution: Resolution,
    pub overlays: Overlays,
    /// The frame on the screen.
    pub shown: Option<FrameInfo>,
    /// Size of the panel, pixels, as drawn last.
    pub panel_size: [u32; 2],
    /// Left, top, right and bottom of the image in the window, points.
    pub image_rect: [f32; 4],
    /// Whether the panel of the view was drawn in the last window frame; other views request no frames.
    pub is_visible: bool,
    pub(crate) requested: Option<FrameKey>,
    pub is_waiting: bool,
    pub ticket: u64,
}

impl Default for View {
    fn default() -> View {
        View {
            camera: ViewCamera::Script,
            resolution: Resolution::Fitted,
            overlays: Overlays::default(),
            shown: None,
            panel_size: [1280, 720],
            image_rect: [0.0; 4],
            is_visible: true,
            requested: None,
            is_waiting: false,
            ticket: 0,
        }
    }
}

impl View {
    /// Whether the last requested image has neither grid nor outline, like one that is saved.
    pub(crate) fn is_plain(&self) -> bool {
        self.requested.as_ref().is_some_and(|key| !key.overrides.grid && key.overrides.outlined.is_none())
    }

    /// Camera of the view for the renderer.
    pub fn viewport_camera(&self, stage: &Stage) -> ViewportCamera {
        let actor = |name: &str| stage.actors.iter().position(|a| a.name == name);
        match &self.camera {
            ViewCamera::Script => ViewportCamera::Script,
            ViewCamera::Named(name) => stage
                .cameras
                .iter()
                .position(|c| c.name == *name)
                .map_or(ViewportCamera::Script, ViewportCamera::Camera),
            ViewCamera::Free(orbit) => ViewportCamera::Free(orbit.camera()),
            ViewCamera::Follow { actor: name, orbit } => match actor(name) {
                Some(actor) => ViewportCamera::Following { actor, camera: orbit.camera() },
                None => ViewportCamera::Free(orbit.camera()),
            },
        }
    }

    /// Camera of the displayed image, with movements by the mouse already applied.
    pub fn displayed_camera(&self, stage: &Stage) -> Option<CameraState> {
        let shown = self.shown.as_ref()?;
        Some(match self.viewport_camera(stage) {
            ViewportCamera::Free(camera) => camera,
            ViewportCamera::Following { actor, mut camera } => {
                camera.world_from_view.translation += actor_position(&shown.snapshot, actor);
                camera
            }
            ViewportCamera::Script | ViewportCamera::Camera(_) => shown.snapshot.camera,
        })
    }

    /// Follows an actor from the present camera position. `None`: stops following. `near`: world position that a new orbit is centered near.
    pub fn follow(&mut self, actor: Option<(String, usize)>, near: DVec3) {
        let Some(shown) = &self.shown else { return };
        let mut orbit = match &self.camera {
            ViewCamera::Free(orbit) => *orbit,
            ViewCamera::Follow { actor: name, orbit } => {
                let mut orbit = *orbit;
                // Converts the center to world space. If the followed actor no longer exists, it counted as standing at the origin.
                if let Some((_, index)) = actor.as_ref().filter(|(n, _)| n == name) {
                    orbit.center += actor_position(&shown.snapshot, *index);
                }
                orbit
            }
            _ => Orbit::from_camera(&shown.snapshot.camera, near),
        };
        self.camera = match actor {
            Some((name, index)) => {
                orbit.center -= actor_position(&shown.snapshot, index);
                ViewCamera::Follow { actor: name, orbit }
            }
            None => ViewCamera::Free(orbit),
        };
    }
}

fn actor_position(snapshot: &Snapshot, actor: usize) -> DVec3 {
    snapshot.actors.get(actor).map_or(DVec3::ZERO, |a| a.world_from_model.translation)
}

/// The largest size with the same aspect ratio that fits into `room`, divided by `divisor`, pixels; at least one pixel.
pub fn fit_image_size(size: [u32; 2], room: [u32; 2], divisor: u32, largest: u32) -> [u32; 2] {
    let [width, height] = size.map(|s| f64::from(s.max(1)));
    let scale = (f64::from(room[0]) / width).min(f64::from(room[1]) / height);
    let scale = scale.min(f64::from(largest) / width.max(height)) / f64::from(divisor.max(1));
    [width, height].map(|s| ((s * scale).round() as u32).clamp(1, largest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_fits_the_available_area_and_keeps_its_aspect_ratio() {
        assert_eq!(fit_image_size([1280, 720], [640, 640], 1, 4096), [640, 360]);
        assert_eq!(fit_image_size([1280, 720], [3840, 5000], 1, 4096), [3840, 2160]);
        assert_eq!(fit_image_size([1280, 720], [3840, 5000], 2, 4096), [1920, 1080]);
        assert_eq!(fit_image_size([1280, 720], [9000, 9000], 1, 4096), [4096, 2304]);
        assert_eq!(fit_image_size([1280, 720], [0, 0], 4, 4096), [1, 1]);
        assert_eq!(fit_image_size([720, 1280], [1000, 640], 1, 4096), [360, 640]);
    }
}
