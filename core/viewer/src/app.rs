//! What the window shows and knows, apart from how it is drawn: fed with versions, frames and the clock, asked for the next
//! frame to draw. No toolkit here.

use crate::editing::History;
use crate::orbit::Orbit;
use crate::playhead::Playhead;
use crate::selection::{self, Selected};
use crate::span::Span;
use crate::timeline::Timeline;
use choreo_live::{Asked, Painted, Problem, Scene, Version, Work};
use choreo_motion::Time;
use choreo_plugin::Frame;
use choreo_render::{DeviceInfo, renderer};
use choreo_stage::{CameraState, Snapshot};
use glam::DVec3;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Larger pictures are for `render`.
const LARGEST: u32 = 4096;

/// From where it is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ViewCamera {
    /// As the script has it.
    Script,
    Free(Orbit),
}

/// How large the picture is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// As many pixels as there is room for on the screen.
    Fitted,
    /// As many as `render` gives it.
    Full,
}

/// What is known of the picture on the screen.
pub struct Shown {
    pub time: Time,
    pub size: [u32; 2],
    pub snapshot: Snapshot,
    pub left_out: Vec<(String, String)>,
    pub draws: usize,
    pub device: DeviceInfo,
    pub evaluated_in: Duration,
    pub planned_in: Duration,
    pub drawn_in: Duration,
}

/// What a wish is for: an equal one has been drawn or is being drawn.
#[derive(Clone, Debug, PartialEq)]
struct Wish {
    number: u64,
    reloads: u64,
    time: Time,
    size: [u32; 2],
    samples: u32,
    camera: Option<CameraState>,
    moving: bool,
}

pub struct Viewer {
    /// The script's or model's name.
    pub name: String,
    /// The script's file, where it is one.
    pub path: Option<PathBuf>,
    pub history: History,
    /// The window is to be closed.
    pub quit: bool,
    /// Why the last change was not made.
    pub said: Option<String>,
    /// The last good one.
    pub scene: Option<Arc<Scene>>,
    pub timeline: Timeline,
    /// Of the newest version, good or not.
    pub problems: Vec<Problem>,
    /// The newest version could not be used: what is shown is the one before.
    pub faulty: bool,
    /// Of the renderer: drivers that failed, shaders that do not compile, callbacks that fail at this time.
    pub trouble: Vec<String>,
    pub playhead: Playhead,
    pub camera: ViewCamera,
    pub resolution: Resolution,
    pub selection: Option<Selected>,
    pub span: Span,
    /// Times as seconds, not as frames.
    pub in_seconds: bool,
    pub shown: Option<Shown>,
    pub work: Work,
    pub drawn: renderer::Work,
    pub build_took: Duration,
    /// Pixels that there is room for, as the viewport panel had it last.
    pub room: [u32; 2],
    samples: Option<u32>,
    reloads: u64,
    asked: Option<Wish>,
    waiting: bool,
    ticket: u64,
}

impl Viewer {
    pub fn new(name: impl Into<String>) -> Viewer {
        Viewer {
            name: name.into(),
            path: None,
            history: History::default(),
            said: None,
            quit: false,
            scene: None,
            timeline: Timeline::default(),
            problems: Vec::new(),
            faulty: false,
            trouble: Vec::new(),
            playhead: Playhead::default(),
            camera: ViewCamera::Script,
            resolution: Resolution::Fitted,
            selection: None,
            span: Span::whole(1.0),
            in_seconds: true,
            shown: None,
            work: Work::default(),
            drawn: renderer::Work::default(),
            build_took: Duration::ZERO,
            room: [1280, 720],
            samples: None,
            reloads: 0,
            asked: None,
            waiting: false,
            ticket: 0,
        }
    }

    /// The next version: swapped in whole where it is good; playhead, selection, camera and whether it plays stay.
    pub fn take_version(&mut self, version: Version) {
        self.problems = version.problems;
        self.work = version.work;
        self.build_took = version.took;
        self.faulty = version.scene.is_none();
        if version.shaders {
            self.reloads += 1;
        }
        let Some(scene) = version.scene else { return };
        let settings = &scene.stage.settings;
        let length = settings.length.as_secs();
        // What was shown as a whole still is.
        if self.scene.is_none() || self.span == Span::whole(self.playhead.length().as_secs()) {
            self.span = Span::whole(length);
        }
        self.playhead.set_scene(settings.fps, settings.length);
        self.timeline = Timeline::new(&scene);
        self.selection = self.selection.take().filter(|s| s.is_on(&scene.stage));
        self.scene = Some(scene);
    }

    /// A frame that was drawn; gives its pixels, to be shown. What could not be drawn leaves the last picture.
    pub fn take_painted(&mut self, painted: Painted) -> Option<Frame> {
        if painted.ticket == self.ticket {
            self.waiting = false;
        }
        self.drawn = painted.work;
        self.trouble = painted.notes;
        match painted.result {
            Ok(picture) => {
                let size = [picture.frame.width, picture.frame.height];
                self.shown = Some(Shown {
                    time: painted.time,
                    size,
                    snapshot: picture.snapshot,
                    left_out: picture.left_out,
                    draws: picture.draws,
                    device: picture.device,
                    evaluated_in: picture.evaluated_in,
                    planned_in: picture.planned_in,
                    drawn_in: picture.drawn_in,
                });
                Some(picture.frame)
            }
            Err(text) => {
                self.trouble.push(text);
                None
            }
        }
    }

    /// The next frame to draw, where it is another than the one drawn or asked for last, and none is being drawn.
    pub fn wish(&mut self) -> Option<Asked> {
        let scene = self.scene.clone()?;
        if self.waiting {
            return None;
        }
        let camera = match self.camera {
            ViewCamera::Script => None,
            ViewCamera::Free(orbit) => Some(orbit.camera()),
        };
        // Four, as `render` has it.
        let samples = self.samples.or(scene.stage.settings.samples).unwrap_or(4);
        let wish = Wish {
            number: scene.number,
            reloads: self.reloads,
            time: self.playhead.time(),
            size: self.size(&scene),
            samples,
            camera,
            moving: self.playhead.is_playing(),
        };
        if self.asked.as_ref() == Some(&wish) {
            return None;
        }
        self.ticket += 1;
        self.waiting = true;
        let asked = Asked {
            scene,
            time: wish.time,
            size: wish.size,
            samples,
            camera,
            moving: wish.moving,
            ticket: self.ticket,
        };
        self.asked = Some(wish);
        Some(asked)
    }

    /// How often shaders have changed so far.
    pub fn reloads(&self) -> u64 {
        self.reloads
    }

    /// Whether a frame is being drawn.
    pub fn is_waiting(&self) -> bool {
        self.waiting
    }

    fn size(&self, scene: &Scene) -> [u32; 2] {
        let [width, height] = scene.stage.settings.size;
        match self.resolution {
            Resolution::Full => [width.min(LARGEST), height.min(LARGEST)],
            Resolution::Fitted => fitted([width, height], self.room),
        }
    }

    /// The mouse takes the camera over where it stands.
    pub fn free_camera(&mut self) -> Option<&mut Orbit> {
        if self.camera == ViewCamera::Script {
            let shown = self.shown.as_ref()?;
            let near = self.point_of_interest().unwrap_or(DVec3::ZERO);
            self.camera = ViewCamera::Free(Orbit::from_camera(&shown.snapshot.camera, near));
        }
        match &mut self.camera {
            ViewCamera::Free(orbit) => Some(orbit),
            ViewCamera::Script => None,
        }
    }

    /// The selected actor's place, else the middle of all.
    pub fn point_of_interest(&self) -> Option<DVec3> {
        let (scene, shown) = (self.scene.as_ref()?, self.shown.as_ref()?);
        let selected = self.selection.as_ref().and_then(Selected::actor);
        let selected = selected.and_then(|name| selection::actor(&scene.stage, name));
        let places = || shown.snapshot.actors.iter().filter(|a| a.visible);
        let at = |a: &choreo_stage::ActorState| a.world_from_model.translation + DVec3::Y * 0.9;
        if let Some(actor) = selected.and_then(|a| shown.snapshot.actors.get(a)) {
            return Some(at(actor));
        }
        let count = places().count();
        (count > 0).then(|| places().map(at).sum::<DVec3>() / count as f64)
    }

    /// A time as the user wants to read it.
    pub fn shown_time(&self, time: Time) -> String {
        match self.in_seconds {
            true => format!("{:.3} s", time.as_secs()),
            false => format!("frame {}", self.playhead.fps().frames_in(time)),
        }
    }
}

/// The largest size of the same shape with room for it; no larger than itself, no smaller than a pixel.
fn fitted(size: [u32; 2], room: [u32; 2]) -> [u32; 2] {
    let [width, height] = size.map(|s| f64::from(s.max(1)));
    let scale = (f64::from(room[0]) / width).min(f64::from(room[1]) / height).min(1.0);
    [width, height].map(|s| ((s * scale).round() as u32).clamp(1, LARGEST))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_fitted_and_never_blown_up() {
        assert_eq!(fitted([1280, 720], [640, 640]), [640, 360]);
        assert_eq!(fitted([1280, 720], [5000, 5000]), [1280, 720]);
        assert_eq!(fitted([1280, 720], [0, 0]), [1, 1]);
        assert_eq!(fitted([720, 1280], [1000, 640]), [360, 640]);
    }
}
