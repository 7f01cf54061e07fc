//! The frame pipeline: frames are evaluated and planned on one thread, drawn on this thread with several in flight, and encoded on further
//! threads. Queues are short and image buffers are reused, so memory does not grow with the length of the video.
//!
//! A frame whose plan equals the previous plan is not drawn again. A frame that differs only in its 2D layers is composed again over the
//! scene that was drawn before.

use crate::failure::Failure;
use crate::process::interrupt;
use crate::process::panics::catch_plugin_panics;
use crate::process::threads::too_few_threads;
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

/// Function that returns the plan for a time.
pub(crate) type PlanAt<'a> = Box<dyn FnMut(Time) -> Result<Plan, Failure> + Send + 'a>;

/// Function that returns the key of a plan without the 2D layers in front of the scene.
pub(crate) type SceneKey<'a> = Box<dyn Fn(&Plan) -> Key + Send + 'a>;

/// Function that encodes a finished frame, given its number and time, its image, and whether the previous frame had the same pixels.
pub(crate) type Encode<'a> =
    Box<dyn FnMut((i64, Time), &FrameImage, bool) -> Result<(), Failure> + Send + 'a>;

/// Pixels of a frame, in the format that the exporter asked for.
#[derive(Clone)]
pub(crate) enum Pixels {
    Bytes(Frame),
    /// Floats, with the 2D layers composed where the exporter wants them.
    Floats(FloatFrame),
}

impl Pixels {
    /// Hands the pixels to an exporter. `repeated`: the exporter was given the same pixels before.
    pub(crate) fn write(&self, sink: &mut dyn FrameSink, repeated: bool) -> Result<(), ExportError> {
        match self {
            Pixels::Bytes(frame) if repeated => sink.repeat(frame),
            Pixels::Bytes(frame) => sink.frame(frame),
            Pixels::Floats(frame) => sink.float_frame(frame),
        }
    }
}

/// Image of one frame, or of several consecutive frames with the same pixels.
pub(crate) struct FrameImage {
    pub pixels: Pixels,
    /// The encoded file, for formats with one image per file.
    pub file: Mutex<Option<Vec<u8>>>,
}

/// Numbers of frames that were drawn, and of frames that reuse the previous one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct FrameCounts {
    pub drawn: u64,
    /// Frames equal to the previous frame.
    pub repeated: u64,
    /// Frames with the scene of the previous frame and other 2D layers.
    pub recomposed: u64,
}

/// Task of the renderer for a planned frame.
enum PlannedFrame {
    Draw(Box<Plan>, FrontLayers),
    Recompose(FrontLayers),
    Repeat,
}

type FrontLayers = Option<Arc<LayerImage>>;

/// Plans, draws and encodes frames on several threads.
pub(crate) struct Pipeline<'a> {
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
struct PipelineState {
    stop: AtomicBool,
    /// Failure of the smallest frame number, so that the same script always fails with the same message.
    failure: Mutex<Option<(i64, Failure)>>,
    /// Images whose buffers can be reused.
    spare: Mutex<Vec<Frame>>,
    drawn: AtomicU64,
    repeated: AtomicU64,
    recomposed: AtomicU64,
}

impl PipelineState {
    fn record_failure(&self, frame: i64, failure: Failure) {
        self.stop.store(true, Ordering::SeqCst);
        let mut slot = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        if slot.as_ref().is_none_or(|(f, _)| frame < *f) {
            *slot = Some((frame, failure));
        }
    }

    /// Takes an image whose buffer can be reused.
    fn take_spare_frame(&self) -> Option<Frame> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner).pop()
    }

    fn recycle(&self, pixels: Pixels) {
        if let Pixels::Bytes(frame) = pixels {
            self.spare.lock().unwrap_or_else(PoisonError::into_inner).push(frame);
        }
    }

    /// Takes back the buffer of an image that nothing else uses.
    fn recycle_unshared(&self, image: Arc<FrameImage>) {
        Arc::into_inner(image).into_iter().for_each(|image| self.recycle(image.pixels));
    }

    /// Whether a frame must still be encoded. After a failure this holds for earlier frames only, since the earliest failure is the one to
    /// report.
    fn must_encode(&self, frame: i64) -> bool {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.as_ref().is_none_or(|(failed, _)| frame < *failed) && !interrupt::is_interrupted()
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::SeqCst) || interrupt::is_interrupted()
    }
}

impl Pipeline<'_> {
    pub(crate) fn run(self) -> Result<FrameCounts, Failure> {
        let shared = PipelineState {
            stop: AtomicBool::new(false),
            failure: Mutex::new(None),
            spare: Mutex::new(Vec::new()),
            drawn: AtomicU64::new(0),
            repeated: AtomicU64::new(0),
            recomposed: AtomicU64::new(0),
        };
        let Pipeline { frames, plan, scene_key, renderer, encoders, progress } = self;
        let (plan_sender, plans) = sync_channel(PLANS_AHEAD);
        // The channel has no buffer: while the encoders work, one image waits here and others are in flight.
        let (frame_sender, frame_receiver) = sync_channel(0);
        // Only the encoders hold the receiver: once all of them have ended, the renderer stops waiting.
        let frame_receiver = Arc::new(Mutex::new(frame_receiver));
        std::thread::scope(|scope| {
            let thread = |name: &str| std::thread::Builder::new().name(name.into());
            let planner = thread("plan")
                .spawn_scoped(scope, || make_plans(&shared, frames, plan, scene_key, plan_sender));
            // Encoders that cannot be started are left out; one is enough.
            let started = encoders.into_iter().map(|encode| {
                let (shared, frame_receiver) = (&shared, frame_receiver.clone());
                thread("encode")
                    .spawn_scoped(scope, move || encode_frames(shared, &frame_receiver, encode, progress))
            });
            let encoding = started.filter(Result::is_ok).count();
            drop(frame_receiver);
            match planner {
                Ok(_) if encoding > 0 => draw_frames(&shared, renderer, plans, frame_sender),
                _ => shared
                    .record_failure(0, too_few_threads("no thread can be started to plan and encode frames")),
            }
        });
        if interrupt::is_interrupted() {
            return Err(Failure::Interrupted);
        }
        let failure = shared.failure.into_inner().unwrap_or_else(PoisonError::into_inner);
        let counts = FrameCounts {
            drawn: shared.drawn.into_inner(),
            repeated: shared.repeated.into_inner(),
            recomposed: shared.recomposed.into_inner(),
        };
        failure.map_or(Ok(counts), |(_, failure)| Err(failure))
    }
}

fn make_plans(
    shared: &PipelineState,
    frames: Vec<(i64, Time)>,
    mut plan: PlanAt<'_>,
    scene_key: SceneKey<'_>,
    to: SyncSender<((i64, Time), PlannedFrame)>,
) {
    // Keys of the scene and of the layers of the previous frame.
    let mut previous_keys: Option<(Key, Option<Key>)> = None;
    for (frame, time) in frames {
        if shared.is_stopped() {
            return;
        }
        // An effect may fail while it describes what it draws.
        let mut plan = match catch_plugin_panics(|| plan(time)) {
            Ok(plan) => plan,
            Err(failure) => return shared.record_failure(frame, failure),
        };
        // 2D layers of a float frame are drawn together with the frame.
        let bytes = plan.wish == FrameWish::Bytes;
        let layers = bytes.then(|| plan.layers_in_front.take()).flatten();
        let keys = (scene_key(&plan), layers.as_ref().map(|layers| layers.hash));
        let work = match previous_keys {
            Some(previous) if previous == keys => PlannedFrame::Repeat,
            Some((scene, _)) if scene == keys.0 => PlannedFrame::Recompose(layers),
            _ => PlannedFrame::Draw(Box::new(plan), layers),
        };
        previous_keys = Some(keys);
        if to.send(((frame, time), work)).is_err() {
            return;
        }
    }
}

/// Composes frames from drawn scenes and the 2D layers in front of them.
#[derive(Default)]
struct FrameComposer {
    /// The scene drawn last, if layers lie over it in `last`.
    scene: Option<Pixels>,
    last: Option<Arc<FrameImage>>,
}

impl FrameComposer {
    /// Returns the next frame. `drawn`: the image of the renderer, if it drew one. Without `layers`, the frame repeats the previous one.
    fn compose_next(
        &mut self,
        shared: &PipelineState,
        drawn: Option<Pixels>,
        layers: Option<FrontLayers>,
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
        last.into_iter().for_each(|last| shared.recycle_unshared(last));
        let pixels = match &layers {
            None => self.scene.take()?,
            Some(layers) => {
                let Some(Pixels::Bytes(scene)) = &self.scene else { return None };
                let mut frame =
                    shared.take_spare_frame().unwrap_or(Frame { width: 0, height: 0, rgba: Vec::new() });
                (frame.width, frame.height) = (scene.width, scene.height);
                frame.rgba.clear();
                frame.rgba.extend_from_slice(&scene.rgba);
                layers.blend_over(&mut frame);
                Pixels::Bytes(frame)
            }
        };
        self.last = Some(Arc::new(FrameImage { pixels, file: Mutex::default() }));
        self.last.clone()
    }
}

/// A frame in flight: number and time, the pixel format that the renderer draws, and its layers. Without layers it repeats the previous
/// frame.
type QueuedFrame = ((i64, Time), Option<FrameWish>, Option<FrontLayers>);

fn draw_frames(
    shared: &PipelineState,
    renderer: &mut dyn Renderer,
    plans: Receiver<((i64, Time), PlannedFrame)>,
    to: SyncSender<DrawnFrame>,
) {
    let depth = renderer.frames_in_flight().max(1);
    let mut in_flight: VecDeque<QueuedFrame> = VecDeque::with_capacity(depth);
    let mut composer = FrameComposer::default();
    let mut more = true;
    while !shared.is_stopped() && (more || !in_flight.is_empty()) {
        while more && in_flight.len() < depth {
            // If nothing is in flight, the thread waits for a plan.
            let next = match in_flight.is_empty() {
                true => plans.recv().map_err(|_| TryRecvError::Disconnected),
                false => plans.try_recv(),
            };
            match next {
                Ok((frame, PlannedFrame::Draw(plan, layers))) => {
                    let wish = plan.wish;
                    match renderer.submit(*plan) {
                        Ok(()) => in_flight.push_back((frame, Some(wish), Some(layers))),
                        Err(error) => return shared.record_failure(frame.0, render_failure(error)),
                    }
                }
                Ok((frame, PlannedFrame::Recompose(layers))) => {
                    in_flight.push_back((frame, None, Some(layers)))
                }
                Ok((frame, PlannedFrame::Repeat)) => in_flight.push_back((frame, None, None)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => more = false,
            }
        }
        let Some((frame, drawn, layers)) = in_flight.pop_front() else { continue };
        let collect = |wish| match wish {
            FrameWish::Bytes => renderer.collect(shared.take_spare_frame()).map(Pixels::Bytes),
            _ => renderer.collect_floats().map(Pixels::Floats),
        };
        let drawn = match drawn.map(collect).transpose() {
            Ok(drawn) => drawn,
            Err(error) => return shared.record_failure(frame.0, render_failure(error)),
        };
        let repeated = layers.is_none();
        let Some(image) = composer.compose_next(shared, drawn, layers) else { return };
        if to.send((frame, image, repeated)).is_err() {
            return;
        }
    }
}

/// Number and time of a frame, its image, and whether it repeats the previous image.
type DrawnFrame = ((i64, Time), Arc<FrameImage>, bool);

fn encode_frames(
    shared: &PipelineState,
    frame_receiver: &Mutex<Receiver<DrawnFrame>>,
    mut encode: Encode<'_>,
    progress: &Progress,
) {
    loop {
        let next = frame_receiver.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((frame, image, repeated)) = next else { return };
        // The queue is still emptied after a failure, so that the renderer does not wait for a free place in it.
        if shared.must_encode(frame.0) {
            match encode(frame, &image, repeated) {
                Ok(()) => progress.step(),
                Err(failure) => shared.record_failure(frame.0, failure),
            }
        }
        shared.recycle_unshared(image);
    }
}

/// Turns an error of the renderer into a failure. Where the device ran out of memory, was lost or timed out, a hint names what to lower.
pub(crate) fn render_failure(error: RenderError) -> Failure {
    let cause = match &error {
        RenderError::FailedTwice { second, .. } => second,
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
    fn hint_after_a_device_failure_names_settings_to_lower() {
        let lost = || Box::new(RenderError::DeviceLost { object: "frame 7".into() });
        let full = || Box::new(RenderError::OutOfMemory { object: "memory of depth".into() });
        let text = |error| render_failure(error).message_lines().concat();
        assert_eq!(
            text(RenderError::FailedTwice { first: lost(), second: full() }),
            "Vulkan: memory of depth: out of memory; this was the second attempt, the first failed with: \
             Vulkan: frame 7: the device was lost; the kernel log may name the reason\n    hint: smaller images \
             (--size), one sample (--samples 1) or smaller textures need less memory; --device cpu uses the machine's own"
        );
        let timed_out = RenderError::TimedOut { object: "frame 7".into(), secs: 300 };
        assert!(
            text(timed_out)
                .starts_with("Vulkan: frame 7: not finished after 300 s\n    hint: smaller images")
        );
        assert_eq!(text(RenderError::Usage("no".into())), "no");
    }
}
