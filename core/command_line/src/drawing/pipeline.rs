//! The frame pipeline: frames are evaluated and planned on one thread, drawn on this thread with several in flight, and encoded on further
//! threads. Queues are short and image buffers are reused, so memory does not grow with the length of the video.
//!
//! A frame whose plan equals the previous plan is not drawn again. A frame that differs only in its 2D layers is composed again over the
//! scene that was drawn before.

use crate::failure::Failure;
use crate::process::interrupt;
use crate::process::panics::plugin_failures;
use crate::process::threads::too_few;
use crate::terminal::progress::Progress;
use choreo_motion::Time;
use choreo_plugin::{ExportError, FloatFrame, Frame, FrameSink, FrameWish};
use choreo_render::layers_2d::LayerImage;
use choreo_render::plan::frame_key::Key;
use choreo_render::{Plan, RenderError, Renderer};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

/// Plans waiting for the renderer.
const PLANS_AHEAD: usize = 2;

/// Gives the plan for a time.
pub(crate) type PlanAt<'a> = Box<dyn FnMut(Time) -> Result<Plan, Failure> + Send + 'a>;

/// Gives the key of a plan without the 2D layers in front of the scene.
pub(crate) type SceneKey<'a> = Box<dyn Fn(&Plan) -> Key + Send + 'a>;

/// Takes a finished frame with its number and time, and whether the frame before had the same pixels.
pub(crate) type Encode<'a> = Box<dyn FnMut((i64, Time), &FrameImage, bool) -> Result<(), Failure> + Send + 'a>;

/// Pixels of a frame, in the format that the exporter asked for.
#[derive(Clone)]
pub(crate) enum Pixels {
    Bytes(Frame),
    /// Floats, with the 2D layers composed where the exporter wants them.
    Floats(FloatFrame),
}

impl Pixels {
    /// Hands the pixels to an exporter. `repeated`: the exporter was given the same pixels before.
    pub fn write(&self, sink: &mut dyn FrameSink, repeated: bool) -> Result<(), ExportError> {
        match self {
            Pixels::Bytes(frame) if repeated => sink.repeat(frame),
            Pixels::Bytes(frame) => sink.frame(frame),
            Pixels::Floats(frame) => sink.float_frame(frame),
        }
    }
}

/// Pixels that one frame, or several consecutive frames, show.
pub(crate) struct FrameImage {
    pub pixels: Pixels,
    /// The encoded file, for formats with one image per file.
    pub file: Mutex<Option<Vec<u8>>>,
}

/// Numbers of frames that were drawn, and of frames reused from the previous one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub drawn: u64,
    /// Frames equal to the previous frame.
    pub repeated: u64,
    /// Frames with the scene of the previous frame and other 2D layers.
    pub recomposed: u64,
}

/// A planned frame.
enum Work {
    Draw(Box<Plan>, Layers),
    Recompose(Layers),
    Repeat,
}

type Layers = Option<Arc<LayerImage>>;

pub struct Pipeline<'a> {
    /// Frame numbers and times, in the order in which they are needed.
    pub frames: Vec<(i64, Time)>,
    pub plan: PlanAt<'a>,
    pub scene_key: SceneKey<'a>,
    pub renderer: &'a mut dyn Renderer,
    /// One encoder gets the images in order; several encoders get them in any order, in parallel.
    pub encoders: Vec<Encode<'a>>,
    pub progress: &'a Progress,
}

/// State that the threads share.
struct Shared {
    stop: AtomicBool,
    /// Failure of the smallest frame number, so that the same script always fails with the same message.
    failure: Mutex<Option<(i64, Failure)>>,
    /// Images whose buffers can be reused.
    spare: Mutex<Vec<Frame>>,
    drawn: AtomicU64,
    repeated: AtomicU64,
    recomposed: AtomicU64,
}

impl Shared {
    fn fail(&self, frame: i64, failure: Failure) {
        self.stop.store(true, Ordering::SeqCst);
        let mut slot = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        if slot.as_ref().is_none_or(|(f, _)| frame < *f) {
            *slot = Some((frame, failure));
        }
    }

    /// Takes an image whose buffer can be reused.
    fn spare(&self) -> Option<Frame> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner).pop()
    }

    fn recycle(&self, pixels: Pixels) {
        if let Pixels::Bytes(frame) = pixels {
            self.spare.lock().unwrap_or_else(PoisonError::into_inner).push(frame);
        }
    }

    /// Takes back the buffer of an image that nothing else uses.
    fn release(&self, picture: Arc<FrameImage>) {
        Arc::into_inner(picture).into_iter().for_each(|picture| self.recycle(picture.pixels));
    }

    /// Whether a frame must still be encoded. After a failure this holds for earlier frames only, since the earliest failure is the one to
    /// report.
    fn wants(&self, frame: i64) -> bool {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.as_ref().is_none_or(|(failed, _)| frame < *failed) && !interrupt::interrupted()
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::SeqCst) || interrupt::interrupted()
    }
}

impl Pipeline<'_> {
    pub fn run(self) -> Result<Counts, Failure> {
        let shared = Shared {
            stop: AtomicBool::new(false),
            failure: Mutex::new(None),
            spare: Mutex::new(Vec::new()),
            drawn: AtomicU64::new(0),
            repeated: AtomicU64::new(0),
            recomposed: AtomicU64::new(0),
        };
        let Pipeline { frames, plan, scene_key, renderer, encoders, progress } = self;
        let (plan_to, plans) = sync_channel(PLANS_AHEAD);
        // The channel has no buffer: while the encoders work, one image waits here and others are in flight.
        let (frame_to, pictures) = sync_channel(0);
        // Only the encoders hold the receiver: once all of them have ended, the renderer stops waiting.
        let pictures = Arc::new(Mutex::new(pictures));
        std::thread::scope(|scope| {
            let thread = |name: &str| std::thread::Builder::new().name(name.into());
            let planner =
                thread("plan").spawn_scoped(scope, || make_plans(&shared, frames, plan, scene_key, plan_to));
            // Encoders that cannot be started are left out; one is enough.
            let started = encoders.into_iter().map(|encode| {
                let (shared, pictures) = (&shared, pictures.clone());
                thread("encode")
                    .spawn_scoped(scope, move || encode_pictures(shared, &pictures, encode, progress))
            });
            let encoding = started.filter(Result::is_ok).count();
            drop(pictures);
            match planner {
                Ok(_) if encoding > 0 => draw(&shared, renderer, plans, frame_to),
                _ => shared.fail(0, too_few("none can be started to plan and encode frames")),
            }
        });
        if interrupt::interrupted() {
            return Err(Failure::Interrupted);
        }
        let failure = shared.failure.into_inner().unwrap_or_else(PoisonError::into_inner);
        let counts = Counts {
            drawn: shared.drawn.into_inner(),
            repeated: shared.repeated.into_inner(),
            recomposed: shared.recomposed.into_inner(),
        };
        failure.map_or(Ok(counts), |(_, failure)| Err(failure))
    }
}

fn make_plans(
    shared: &Shared,
    frames: Vec<(i64, Time)>,
    mut plan: PlanAt<'_>,
    scene_key: SceneKey<'_>,
    to: SyncSender<((i64, Time), Work)>,
) {
    // Keys of the scene and of the layers of the previous frame.
    let mut before: Option<(Key, Option<Key>)> = None;
    for (frame, time) in frames {
        if shared.stopped() {
            return;
        }
        // An effect may fail while it describes what it draws.
        let mut plan = match plugin_failures(|| plan(time)) {
            Ok(plan) => plan,
            Err(failure) => return shared.fail(frame, failure),
        };
        // 2D layers of a float frame are drawn together with the frame.
        let bytes = plan.wish == FrameWish::Bytes;
        let layers = bytes.then(|| plan.layers_in_front.take()).flatten();
        let keys = (scene_key(&plan), layers.as_ref().map(|layers| layers.hash));
        let work = match before {
            Some(before) if before == keys => Work::Repeat,
            Some((scene, _)) if scene == keys.0 => Work::Recompose(layers),
            _ => Work::Draw(Box::new(plan), layers),
        };
        before = Some(keys);
        if to.send(((frame, time), work)).is_err() {
            return;
        }
    }
}

/// Composes finished frames from drawn scenes and 2D layers.
#[derive(Default)]
struct Finished {
    /// The scene drawn last, if layers lie over it in `last`.
    scene: Option<Pixels>,
    last: Option<Arc<FrameImage>>,
}

impl Finished {
    /// Gives the next frame. `drawn`: the image of the renderer, if it drew one.
    fn next(
        &mut self,
        shared: &Shared,
        drawn: Option<Pixels>,
        layers: Option<Layers>,
    ) -> Option<Arc<FrameImage>> {
        let Some(layers) = layers else {
            shared.repeated.fetch_add(1, Ordering::Relaxed);
            return self.last.clone();
        };
        let counter = if drawn.is_some() { &shared.drawn } else { &shared.recomposed };
        counter.fetch_add(1, Ordering::Relaxed);
        let last = self.last.take();
        if let Some(frame) = drawn {
            self.scene.take().into_iter().for_each(|scene| shared.recycle(scene));
            self.scene = Some(frame);
        } else if self.scene.is_none() {
            // The previous frame had no layers: it is the scene itself.
            self.scene = last.as_ref().map(|last| last.pixels.clone());
        }
        last.into_iter().for_each(|last| shared.release(last));
        let pixels = match &layers {
            None => self.scene.take()?,
            Some(layers) => {
                let Some(Pixels::Bytes(scene)) = &self.scene else { return None };
                let mut frame = shared.spare().unwrap_or(Frame { width: 0, height: 0, rgba: Vec::new() });
                (frame.width, frame.height) = (scene.width, scene.height);
                frame.rgba.clear();
                frame.rgba.extend_from_slice(&scene.rgba);
                layers.over(&mut frame);
                Pixels::Bytes(frame)
            }
        };
        self.last = Some(Arc::new(FrameImage { pixels, file: Mutex::default() }));
        self.last.clone()
    }
}

/// A frame in flight: number and time, the pixel format that the renderer draws, and its layers. Without layers it repeats the previous
/// frame.
type QueuedFrame = ((i64, Time), Option<FrameWish>, Option<Layers>);

fn draw(
    shared: &Shared,
    renderer: &mut dyn Renderer,
    plans: Receiver<((i64, Time), Work)>,
    to: SyncSender<DrawnFrame>,
) {
    let depth = renderer.frames_in_flight().max(1);
    let mut flying: VecDeque<QueuedFrame> = VecDeque::with_capacity(depth);
    let mut finished = Finished::default();
    let mut more = true;
    while !shared.stopped() && (more || !flying.is_empty()) {
        while more && flying.len() < depth {
            // If nothing is in flight, the thread waits for a plan.
            let next = match flying.is_empty() {
                true => plans.recv().map_err(|_| TryRecvError::Disconnected),
                false => plans.try_recv(),
            };
            match next {
                Ok((frame, Work::Draw(plan, layers))) => {
                    let wish = plan.wish;
                    match renderer.submit(*plan) {
                        Ok(()) => flying.push_back((frame, Some(wish), Some(layers))),
                        Err(error) => return shared.fail(frame.0, render_failure(error)),
                    }
                }
                Ok((frame, Work::Recompose(layers))) => flying.push_back((frame, None, Some(layers))),
                Ok((frame, Work::Repeat)) => flying.push_back((frame, None, None)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => more = false,
            }
        }
        let Some((frame, drawn, layers)) = flying.pop_front() else { continue };
        let collect = |wish| match wish {
            FrameWish::Bytes => renderer.collect(shared.spare()).map(Pixels::Bytes),
            _ => renderer.collect_floats().map(Pixels::Floats),
        };
        let drawn = match drawn.map(collect).transpose() {
            Ok(drawn) => drawn,
            Err(error) => return shared.fail(frame.0, render_failure(error)),
        };
        let repeated = layers.is_none();
        let Some(picture) = finished.next(shared, drawn, layers) else { return };
        if to.send((frame, picture, repeated)).is_err() {
            return;
        }
    }
}

/// Number and time of a frame, its image, and whether it repeats the previous image.
type DrawnFrame = ((i64, Time), Arc<FrameImage>, bool);

fn encode_pictures(
    shared: &Shared,
    pictures: &Mutex<Receiver<DrawnFrame>>,
    mut encode: Encode<'_>,
    progress: &Progress,
) {
    loop {
        let next = pictures.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((frame, picture, repeated)) = next else { return };
        // The queue is still emptied after a failure, so that the renderer does not wait for a free place in it.
        if shared.wants(frame.0) {
            match encode(frame, &picture, repeated) {
                Ok(()) => progress.step(),
                Err(failure) => shared.fail(frame.0, failure),
            }
        }
        shared.release(picture);
    }
}

/// Turns an error of the renderer into a failure. Where the device ran out of memory, was lost or timed out, a hint names what to lower.
pub(crate) fn render_failure(error: RenderError) -> Failure {
    let cause = match &error {
        RenderError::Twice { second, .. } => second,
        error => error,
    };
    let hint = match cause {
        RenderError::OutOfMemory { .. } => {
            "\n    hint: smaller images (--size), one sample (--samples 1) or smaller textures need less memory; \
             --device cpu uses the machine's own"
        }
        RenderError::DeviceLost { .. } | RenderError::TimedOut { .. } => {
            "\n    hint: smaller images (--size) or one sample (--samples 1) are less work at once; \
             --device cpu draws without the driver"
        }
        _ => "",
    };
    Failure::Device(format!("{error}{hint}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_that_failed_twice_says_what_to_lower() {
        let lost = || Box::new(RenderError::DeviceLost { object: "frame 7".into() });
        let full = || Box::new(RenderError::OutOfMemory { object: "memory of depth".into() });
        let text = |error| render_failure(error).message_lines().concat();
        assert_eq!(
            text(RenderError::Twice { first: lost(), second: full() }),
            "Vulkan: memory of depth: out of memory; tried twice, before that: Vulkan: frame 7: the device was lost; the \
             kernel log may name the reason\n    hint: smaller images (--size), one sample (--samples 1) or \
             smaller textures need less memory; --device cpu uses the machine's own"
        );
        let timed_out = RenderError::TimedOut { object: "frame 7".into(), secs: 300 };
        assert!(
            text(timed_out)
                .starts_with("Vulkan: frame 7: not finished after 300 s\n    hint: smaller images")
        );
        assert_eq!(text(RenderError::Usage("no".into())), "no");
    }
}
