//! Frames on demand, on a thread of its own: only the newest wish counts, so that whoever scrubs never waits for frames that
//! have been passed over.

use crate::eye::Views;
use crate::{Eye, Marks, Scene};
use choreo_motion::Time;
use choreo_plugin::{Effect, Frame};
use choreo_render::plan::Draw;
use choreo_render::plan::motion_blur::{plan_alone, plan_with};
use choreo_render::renderer::CreatedCounts;
use choreo_render::{DeviceInfo, DeviceUsage, PlanOptions, Renderer, SceneResources};
use choreo_stage::Snapshot;
use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Makes the renderer, on the painter's thread: drivers take their time to start. Gives it with a note for the user.
pub type StartRenderer = Box<dyn FnOnce() -> Result<(Box<dyn Renderer>, Option<String>), String> + Send>;

/// A frame wished for.
#[derive(Clone)]
pub struct Asked {
    pub scene: Arc<Scene>,
    pub time: Time,
    /// Pixels.
    pub size: [u32; 2],
    pub samples: u32,
    /// It will be gone at once: played or scrubbed. Effects that take many pictures for one wait for a still.
    pub moving: bool,
    /// For whom: a new wish of a view takes the place of its last one, and views take turns.
    pub view: u32,
    pub eye: Eye,
    pub marks: Marks,
    /// Given back with the frame.
    pub ticket: u64,
}

impl Asked {
    /// As `render` draws it.
    pub fn new(scene: Arc<Scene>, time: Time, samples: u32, ticket: u64) -> Asked {
        let size = scene.stage.settings.size;
        Asked {
            scene,
            time,
            size,
            samples,
            moving: false,
            view: 0,
            eye: Eye::Script,
            marks: Marks::default(),
            ticket,
        }
    }
}

/// A frame that was drawn, or why it could not be.
pub struct Painted {
    pub ticket: u64,
    pub view: u32,
    pub result: Result<(Frame, Shown), String>,
    /// What the renderer has made so far.
    pub work: CreatedCounts,
    /// What it has on its device now.
    pub held: DeviceUsage,
    /// For the user.
    pub notes: Vec<String>,
}

/// What is known of a frame beside its pixels.
pub struct Shown {
    /// Of the scene's version.
    pub number: u64,
    pub time: Time,
    /// Pixels.
    pub size: [u32; 2],
    pub snapshot: Snapshot,
    /// What it did without, and why.
    pub left_out: Vec<(String, String)>,
    pub draws: usize,
    pub triangles: u64,
    pub device: DeviceInfo,
    pub evaluated_in: Duration,
    pub planned_in: Duration,
    pub drawn_in: Duration,
}

#[derive(Default)]
struct Wishes {
    /// By view.
    next: BTreeMap<u32, Asked>,
    /// Whose turn it was last.
    last: u32,
    /// Shaders have changed.
    shaders: bool,
    /// Of a frame that was shown: drawn into again.
    spare: Option<Frame>,
    end: bool,
}

#[derive(Default)]
struct Desk {
    wishes: Mutex<Wishes>,
    changed: Condvar,
}

impl Wishes {
    /// The next view's wish after the last one's.
    fn take(&mut self) -> Option<Asked> {
        let after = self.next.range(self.last.saturating_add(1)..).next().map(|(view, _)| *view);
        let view = after.or_else(|| self.next.keys().next().copied())?;
        self.last = view;
        self.next.remove(&view)
    }
}

impl Desk {
    fn wishes(&self) -> MutexGuard<'_, Wishes> {
        self.wishes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

pub struct Painter {
    desk: Arc<Desk>,
    worker: Option<JoinHandle<()>>,
}

impl Painter {
    /// `told` is called on the painter's thread with every frame that was drawn.
    pub fn start(
        start: StartRenderer,
        mut told: impl FnMut(Painted) + Send + 'static,
    ) -> std::io::Result<Painter> {
        let desk = Arc::new(Desk::default());
        let own = desk.clone();
        let work = move || {
            let mut easel = Easel::new(start);
            loop {
                let (asked, shaders, spare) = {
                    let mut wishes = own.wishes();
                    while wishes.next.is_empty() && !wishes.end {
                        wishes = own.changed.wait(wishes).unwrap_or_else(PoisonError::into_inner);
                    }
                    if wishes.end {
                        return;
                    }
                    (wishes.take(), std::mem::take(&mut wishes.shaders), wishes.spare.take())
                };
                if let Some(asked) = asked {
                    told(easel.paint(&asked, shaders, spare));
                }
            }
        };
        let worker = std::thread::Builder::new().name("painter".into()).spawn(work)?;
        Ok(Painter { desk, worker: Some(worker) })
    }

    /// The view's next frame to draw, in place of one that was wished for and not begun.
    pub fn ask(&self, asked: Asked) {
        self.desk.wishes().next.insert(asked.view, asked);
        self.desk.changed.notify_all();
    }

    /// Before the next frame the shader folder is read again.
    pub fn shaders_changed(&self) {
        self.desk.wishes().shaders = true;
    }

    /// A frame that is no longer needed: its memory is used again.
    pub fn give_back(&self, frame: Frame) {
        self.desk.wishes().spare = Some(frame);
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        self.desk.wishes().end = true;
        self.desk.changed.notify_all();
        if let Some(worker) = self.worker.take() {
            // A panic was told on its thread.
            let _ = worker.join();
        }
    }
}

/// The renderer and what it was given last.
struct Easel {
    renderer: Result<Box<dyn Renderer>, String>,
    notes: Vec<String>,
    views: Views,
    resources: Option<Arc<SceneResources>>,
    effects: Vec<Arc<dyn Effect>>,
}

impl Easel {
    fn new(start: StartRenderer) -> Easel {
        let (renderer, notes) = match start() {
            Ok((renderer, note)) => (Ok(renderer), note.into_iter().collect()),
            Err(why) => (Err(why), Vec::new()),
        };
        Easel { renderer, notes, views: Views::default(), resources: None, effects: Vec::new() }
    }

    fn paint(&mut self, asked: &Asked, shaders: bool, spare: Option<Frame>) -> Painted {
        let mut notes = std::mem::take(&mut self.notes);
        let result = self.picture(asked, shaders, spare, &mut notes);
        let (mut work, mut held) = (CreatedCounts::default(), DeviceUsage::default());
        if let Ok(renderer) = &mut self.renderer {
            notes.extend(renderer.take_notes());
            (work, held) = (renderer.created(), renderer.usage());
        }
        let Asked { ticket, view, .. } = *asked;
        Painted { ticket, view, result, work, held, notes }
    }

    fn picture(
        &mut self,
        asked: &Asked,
        shaders: bool,
        spare: Option<Frame>,
        notes: &mut Vec<String>,
    ) -> Result<(Frame, Shown), String> {
        let renderer = self.renderer.as_mut().map_err(|why| why.clone())?;
        let failed = |e: choreo_render::RenderError| e.to_string();
        if shaders && let Err(error) = renderer.reload_shaders() {
            // The last good ones draw on.
            notes.push(error.to_string());
        }
        let scene = &asked.scene;
        let effects = scene.registry.effects();
        let same = |a: &[Arc<dyn Effect>], b: &[Arc<dyn Effect>]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b))
        };
        if !same(&self.effects, effects) {
            renderer.set_effects(effects).map_err(failed)?;
            self.effects = effects.to_vec();
        }
        if self.resources.as_ref().is_none_or(|c| !Arc::ptr_eq(c, &scene.resources)) {
            renderer.load(scene.resources.clone()).map_err(failed)?;
            self.resources = Some(scene.resources.clone());
        }
        let start = Instant::now();
        let options = PlanOptions { effects, ..PlanOptions::new(asked.size, asked.samples) };
        let stage = self.views.stage(asked);
        let (snapshot, plan, evaluated_in) = if asked.moving {
            // What moves past is not worth many pictures a frame.
            let snapshot = self.views.at(asked, asked.time)?;
            let evaluated_in = start.elapsed();
            let at = |time| self.views.at(asked, time);
            let plan = plan_alone(&scene.resources, &stage, &snapshot, &options, at)?;
            (snapshot, plan, evaluated_in)
        } else {
            let at = |time| self.views.at(asked, time);
            let (snapshot, plan) = plan_with(&scene.resources, &stage, asked.time, &options, at)?;
            (snapshot, plan, start.elapsed())
        };
        let left_out = plan.left_out.iter().map(|l| (l.what.to_string(), l.why.to_string())).collect();
        let draws = plan.draws.len();
        let triangles = plan.draws.iter().map(|d| triangles(&scene.resources, d)).sum();
        let planned_in = start.elapsed() - evaluated_in;
        renderer.submit(plan).map_err(failed)?;
        let frame = renderer.collect(spare).map_err(failed)?;
        let drawn_in = start.elapsed() - evaluated_in - planned_in;
        let device = renderer.device().clone();
        let shown = Shown {
            number: scene.number,
            time: asked.time,
            size: [frame.width, frame.height],
            snapshot,
            left_out,
            draws,
            triangles,
            device,
            evaluated_in,
            planned_in,
            drawn_in,
        };
        Ok((frame, shown))
    }
}

fn triangles(resources: &SceneResources, draw: &Draw) -> u64 {
    let of_one =
        resources.primitives.get(draw.primitive as usize).map_or(0, |p| p.primitive().indices.len() / 3);
    of_one as u64 * u64::from(draw.instance_count)
}
