//! Frames on demand, on a thread of its own: only the newest wish counts, so that whoever scrubs never waits for frames that
//! have been passed over.

use crate::Scene;
use choreo_motion::Time;
use choreo_plugin::{Effect, Frame};
use choreo_render::exposure::plan_at;
use choreo_render::renderer::Work;
use choreo_render::{Catalog, DeviceInfo, Plan, PlanOptions, Renderer};
use choreo_stage::{CameraState, Evaluator, Snapshot};
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
    /// In place of the scene's.
    pub camera: Option<CameraState>,
    /// It will be gone at once: played or scrubbed. Effects that take many pictures for one wait for a still.
    pub moving: bool,
    /// Given back with the frame.
    pub ticket: u64,
}

/// A frame that was drawn, or why it could not be.
pub struct Painted {
    pub ticket: u64,
    /// Of the scene's version.
    pub number: u64,
    pub time: Time,
    pub result: Result<Picture, String>,
    /// What the renderer has made so far.
    pub work: Work,
    /// For the user.
    pub notes: Vec<String>,
}

pub struct Picture {
    pub frame: Frame,
    pub snapshot: Snapshot,
    pub left_out: Vec<(String, String)>,
    pub draws: usize,
    pub device: DeviceInfo,
    pub evaluated_in: Duration,
    pub planned_in: Duration,
    pub drawn_in: Duration,
}

#[derive(Default)]
struct Wishes {
    next: Option<Asked>,
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
                    while wishes.next.is_none() && !wishes.end {
                        wishes = own.changed.wait(wishes).unwrap_or_else(PoisonError::into_inner);
                    }
                    if wishes.end {
                        return;
                    }
                    (wishes.next.take(), std::mem::take(&mut wishes.shaders), wishes.spare.take())
                };
                if let Some(asked) = asked {
                    told(easel.paint(&asked, shaders, spare));
                }
            }
        };
        let worker = std::thread::Builder::new().name("painter".into()).spawn(work)?;
        Ok(Painter { desk, worker: Some(worker) })
    }

    /// The next frame to draw, in place of one that was wished for and not begun.
    pub fn ask(&self, asked: Asked) {
        self.desk.wishes().next = Some(asked);
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
    evaluator: Option<Evaluator>,
    catalog: Option<Arc<Catalog>>,
    effects: Vec<Arc<dyn Effect>>,
}

impl Easel {
    fn new(start: StartRenderer) -> Easel {
        let (renderer, notes) = match start() {
            Ok((renderer, note)) => (Ok(renderer), note.into_iter().collect()),
            Err(why) => (Err(why), Vec::new()),
        };
        Easel { renderer, notes, evaluator: None, catalog: None, effects: Vec::new() }
    }

    fn paint(&mut self, asked: &Asked, shaders: bool, spare: Option<Frame>) -> Painted {
        let mut notes = std::mem::take(&mut self.notes);
        let result = self.picture(asked, shaders, spare, &mut notes);
        let mut work = Work::default();
        if let Ok(renderer) = &mut self.renderer {
            notes.extend(renderer.take_notes());
            work = renderer.work();
        }
        Painted { ticket: asked.ticket, number: asked.scene.number, time: asked.time, result, work, notes }
    }

    fn picture(
        &mut self,
        asked: &Asked,
        shaders: bool,
        spare: Option<Frame>,
        notes: &mut Vec<String>,
    ) -> Result<Picture, String> {
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
        if self.catalog.as_ref().is_none_or(|c| !Arc::ptr_eq(c, &scene.catalog)) {
            renderer.load(scene.catalog.clone()).map_err(failed)?;
            self.catalog = Some(scene.catalog.clone());
        }
        let start = Instant::now();
        if self.evaluator.as_ref().is_none_or(|e| !Arc::ptr_eq(e.stage(), &scene.stage)) {
            self.evaluator = Some(scene.evaluator.clone());
        }
        let evaluator = self.evaluator.get_or_insert_with(|| scene.evaluator.clone());
        let options = PlanOptions { effects, ..PlanOptions::new(asked.size, asked.samples) };
        let (snapshot, plan, evaluated_in) = if asked.moving {
            // What moves past is not worth many pictures a frame.
            let mut snapshot = evaluator.at(asked.time).map_err(|e| e.to_string())?;
            snapshot.camera = asked.camera.unwrap_or(snapshot.camera);
            let evaluated_in = start.elapsed();
            let plan = Plan::new(&scene.catalog, &scene.stage, &snapshot, &options);
            (snapshot, plan, evaluated_in)
        } else {
            let planned = plan_at(&scene.catalog, evaluator, asked.time, &options, asked.camera);
            let (snapshot, plan) = planned.map_err(|e| e.to_string())?;
            (snapshot, plan, start.elapsed())
        };
        let left_out = plan.left_out.iter().map(|l| (l.what.to_string(), l.why.to_string())).collect();
        let draws = plan.draws.len();
        let planned_in = start.elapsed() - evaluated_in;
        renderer.submit(plan).map_err(failed)?;
        let frame = renderer.collect(spare).map_err(failed)?;
        let drawn_in = start.elapsed() - evaluated_in - planned_in;
        let device = renderer.device().clone();
        Ok(Picture { frame, snapshot, left_out, draws, device, evaluated_in, planned_in, drawn_in })
    }
}
