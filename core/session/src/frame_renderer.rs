//! Renders frames on demand on a thread of its own. Only the newest request of each view is served, so that scrubbing never waits for outdated
//! frames.

use crate::viewport::ViewEvaluators;
use crate::{Scene, ViewOverrides, ViewportCamera};
use choreo_motion::Time;
use choreo_plugin::{Effect, Frame, PluginPanic};
use choreo_render::plan::Draw;
use choreo_render::plan::motion_blur::{left_out_alone, plan_alone, plan_with};
use choreo_render::renderer::CreatedCounts;
use choreo_render::{DeviceInfo, DeviceUsage, PlanOptions, RenderError, Renderer, SceneResources};
use choreo_stage::{Snapshot, StageError};
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Creates the renderer, on the renderer thread since drivers start slowly. Also returns an optional note for the user.
pub type StartRenderer = Box<dyn FnOnce() -> Result<(Box<dyn Renderer>, Option<String>), RenderError> + Send>;

/// A requested frame.
#[derive(Clone)]
pub struct FrameRequest {
    pub scene: Arc<Scene>,
    pub time: Time,
    /// Width and height, pixels.
    pub size: [u32; 2],
    pub samples: u32,
    /// Whether the view is played or scrubbed. Each image is then shown only briefly, and motion blur is left out until the view rests.
    pub moving: bool,
    /// Number of the requesting view. A new request of a view replaces its pending one, and views take turns.
    pub view: u32,
    pub camera: ViewportCamera,
    pub overrides: ViewOverrides,
    /// Number that the reply returns, to match it with the request.
    pub ticket: u64,
}

impl FrameRequest {
    /// A request for the final frame, as the command `render` draws it.
    pub fn new(scene: Arc<Scene>, time: Time, samples: u32, ticket: u64) -> FrameRequest {
        let size = scene.stage.settings.size;
        FrameRequest {
            scene,
            time,
            size,
            samples,
            moving: false,
            view: 0,
            camera: ViewportCamera::Script,
            overrides: ViewOverrides::default(),
            ticket,
        }
    }
}

/// Why a frame could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The renderer did not start.
    #[error("{0}")]
    NoRenderer(Arc<FrameError>),
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error(transparent)]
    Render(#[from] RenderError),
    /// An effect panicked.
    #[error(transparent)]
    Plugin(PluginPanic),
    /// The program itself panicked.
    #[error("the program itself failed on this frame; please report it with the files: {0}")]
    Program(String),
}

impl FrameError {
    fn of_panic(panic: &(dyn Any + Send)) -> FrameError {
        if let Some(panic) = panic.downcast_ref::<PluginPanic>() {
            return FrameError::Plugin(panic.clone());
        }
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
        FrameError::Program(text.to_string())
    }
}

/// A rendered frame, or why it could not be rendered.
pub struct FrameReply {
    pub ticket: u64,
    pub view: u32,
    pub result: Result<(Frame, FrameInfo), FrameError>,
    /// Numbers of objects that the renderer has created since its start.
    pub created_counts: CreatedCounts,
    /// Objects that the renderer currently has on its device.
    pub device_usage: DeviceUsage,
    /// Messages for the user.
    pub notes: Vec<String>,
}

/// Data of a rendered frame beside its pixels.
pub struct FrameInfo {
    /// Number of the scene's version.
    pub number: u64,
    pub time: Time,
    /// Width and height, pixels.
    pub size: [u32; 2],
    pub snapshot: Snapshot,
    /// Features that the frame leaves out, with the reason for each.
    pub left_out: Vec<(String, String)>,
    /// Parts of the frame that are not drawn while the view moves.
    pub deferred_parts: Vec<&'static str>,
    pub draw_count: usize,
    pub triangle_count: u64,
    pub device: DeviceInfo,
    pub evaluated_in: Duration,
    pub planned_in: Duration,
    pub drawn_in: Duration,
}

#[derive(Default)]
struct Requests {
    /// Pending request of each view.
    pending: BTreeMap<u32, FrameRequest>,
    /// View that was served last.
    last_served: u32,
    /// Whether shaders have changed.
    shaders_changed: bool,
    /// A frame that is no longer shown, whose memory is used again.
    spare_frame: Option<Frame>,
    is_ending: bool,
}

#[derive(Default)]
struct RequestQueue {
    requests: Mutex<Requests>,
    changed: Condvar,
}

impl Requests {
    /// Removes the request of the next view after the one served last.
    fn take_next(&mut self) -> Option<FrameRequest> {
        let after = self.pending.range(self.last_served.saturating_add(1)..).next().map(|(view, _)| *view);
        let view = after.or_else(|| self.pending.keys().next().copied())?;
        self.last_served = view;
        self.pending.remove(&view)
    }
}

impl RequestQueue {
    fn requests(&self) -> MutexGuard<'_, Requests> {
        self.requests.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

pub struct FrameRenderer {
    queue: Arc<RequestQueue>,
    worker: Option<JoinHandle<()>>,
}

impl FrameRenderer {
    /// Starts the renderer thread. `report` is called on that thread with the reply to each request that was served.
    pub fn start(
        start: StartRenderer,
        mut report: impl FnMut(FrameReply) + Send + 'static,
    ) -> std::io::Result<FrameRenderer> {
        let queue = Arc::new(RequestQueue::default());
        let own = queue.clone();
        let work = move || {
            let mut state = RenderState::new(start);
            loop {
                let (request, shaders, spare) = {
                    let mut requests = own.requests();
                    while requests.pending.is_empty() && !requests.is_ending {
                        requests = own.changed.wait(requests).unwrap_or_else(PoisonError::into_inner);
                    }
                    if requests.is_ending {
                        return;
                    }
                    (
                        requests.take_next(),
                        std::mem::take(&mut requests.shaders_changed),
                        requests.spare_frame.take(),
                    )
                };
                if let Some(request) = request {
                    report(state.reply_to(&request, shaders, spare));
                }
            }
        };
        let worker = std::thread::Builder::new().name("renderer".into()).spawn(work)?;
        Ok(FrameRenderer { queue, worker: Some(worker) })
    }

    /// Requests a frame. Replaces the pending request of the same view, unless rendering has begun.
    pub fn request_frame(&self, request: FrameRequest) {
        self.queue.requests().pending.insert(request.view, request);
        self.queue.changed.notify_all();
    }

    /// Makes the renderer reload the shader folder before the next frame.
    pub fn shaders_changed(&self) {
        self.queue.requests().shaders_changed = true;
    }

    /// Returns a frame that is no longer needed, so that its memory can be used again.
    pub fn recycle_frame(&self, frame: Frame) {
        self.queue.requests().spare_frame = Some(frame);
    }
}

impl Drop for FrameRenderer {
    fn drop(&mut self) {
        self.queue.requests().is_ending = true;
        self.queue.changed.notify_all();
        if let Some(worker) = self.worker.take() {
            // Panics are already reported on the renderer thread.
            let _ = worker.join();
        }
    }
}

/// The renderer, and the effects and resources that it was given last.
struct RenderState {
    renderer: Result<Box<dyn Renderer>, Arc<FrameError>>,
    notes: Vec<String>,
    views: ViewEvaluators,
    resources: Option<Arc<SceneResources>>,
    effects: Vec<Effect>,
}

impl RenderState {
    fn new(start: StartRenderer) -> RenderState {
        let started = catch_unwind(AssertUnwindSafe(start));
        let started = started.map_err(|panic| FrameError::of_panic(&*panic));
        let (renderer, notes) = match started.and_then(|started| Ok(started?)) {
            Ok((renderer, note)) => (Ok(renderer), note.into_iter().collect()),
            Err(error) => (Err(Arc::new(error)), Vec::new()),
        };
        RenderState {
            renderer,
            notes,
            views: ViewEvaluators::default(),
            resources: None,
            effects: Vec::new(),
        }
    }

    fn reply_to(
        &mut self,
        request: &FrameRequest,
        shaders_changed: bool,
        spare_frame: Option<Frame>,
    ) -> FrameReply {
        let mut notes = std::mem::take(&mut self.notes);
        let drawn = catch_unwind(AssertUnwindSafe(|| {
            self.render_frame(request, shaders_changed, spare_frame, &mut notes)
        }));
        let result = drawn.unwrap_or_else(|panic| {
            self.reset_after_panic();
            Err(FrameError::of_panic(&*panic))
        });
        let (mut created_counts, mut device_usage) = (CreatedCounts::default(), DeviceUsage::default());
        if let Ok(renderer) = &mut self.renderer {
            notes.extend(renderer.take_notes());
            (created_counts, device_usage) = (renderer.created_counts(), renderer.usage());
        }
        let FrameRequest { ticket, view, .. } = *request;
        FrameReply { ticket, view, result, created_counts, device_usage, notes }
    }

    /// Resets the state after a panic, which may have interrupted anything: unfinished frames are dropped; evaluators, effects and resources are
    /// created and loaded again with the next frame.
    fn reset_after_panic(&mut self) {
        (self.views, self.effects, self.resources) = (ViewEvaluators::default(), Vec::new(), None);
        if let Ok(renderer) = &mut self.renderer {
            // The loop ends when the queue is empty or the renderer fails again.
            while catch_unwind(AssertUnwindSafe(|| renderer.collect(None).is_ok())).unwrap_or(false) {}
        }
    }

    fn render_frame(
        &mut self,
        request: &FrameRequest,
        shaders_changed: bool,
        spare_frame: Option<Frame>,
        notes: &mut Vec<String>,
    ) -> Result<(Frame, FrameInfo), FrameError> {
        let renderer = self.renderer.as_mut().map_err(|why| FrameError::NoRenderer(why.clone()))?;
        if shaders_changed && let Err(error) = renderer.reload_shaders() {
            // The last good shaders stay in use.
            notes.push(error.to_string());
        }
        let scene = &request.scene;
        let effects = scene.registry.effects();
        let are_same =
            |a: &[Effect], b: &[Effect]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.is_same(b));
        if !are_same(&self.effects, effects) {
            renderer.set_effects(effects)?;
            self.effects = effects.to_vec();
        }
        if self.resources.as_ref().is_none_or(|c| !Arc::ptr_eq(c, &scene.resources)) {
            renderer.load(scene.resources.clone())?;
            self.resources = Some(scene.resources.clone());
        }
        let start = Instant::now();
        let stage = self.views.stage(request);
        let preview_of = Some(stage.settings.size);
        let options = PlanOptions { effects, preview_of, ..PlanOptions::new(request.size, request.samples) };
        let mut deferred_parts = Vec::new();
        let (snapshot, plan, evaluated_in) = if request.moving {
            // A moving view is drawn once per frame, without the sub-frames of motion blur.
            let snapshot = self.views.at(request, request.time)?;
            let evaluated_in = start.elapsed();
            let at = |time| self.views.at(request, time);
            let plan = plan_alone(&scene.resources, &stage, &snapshot, &options, at)?;
            deferred_parts = left_out_alone(&stage, &snapshot, &options);
            (snapshot, plan, evaluated_in)
        } else {
            let at = |time| self.views.at(request, time);
            let (snapshot, plan) = plan_with(&scene.resources, &stage, request.time, &options, at)?;
            (snapshot, plan, start.elapsed())
        };
        let left_out = plan.left_out.iter().map(|l| (l.part.to_string(), l.why.to_string())).collect();
        let draw_count = plan.draws.len();
        let triangle_count = plan.draws.iter().map(|d| count_triangles(&scene.resources, d)).sum();
        let planned_in = start.elapsed() - evaluated_in;
        renderer.submit(plan)?;
        let frame = renderer.collect(spare_frame)?;
        let drawn_in = start.elapsed() - evaluated_in - planned_in;
        let device = renderer.device().clone();
        let info = FrameInfo {
            number: scene.number,
            time: request.time,
            size: [frame.width, frame.height],
            snapshot,
            left_out,
            deferred_parts,
            draw_count,
            triangle_count,
            device,
            evaluated_in,
            planned_in,
            drawn_in,
        };
        Ok((frame, info))
    }
}

fn count_triangles(resources: &SceneResources, draw: &Draw) -> u64 {
    let of_one =
        resources.primitives.get(draw.primitive as usize).map_or(0, |p| p.primitive().indices.len() / 3);
    of_one as u64 * u64::from(draw.instance_count)
}
