//! Frames on their way: evaluated and planned on one thread, drawn several in flight on this one, encoded on others.
//! Queues are short and pictures are reused, so memory does not grow with the length of the video.

use crate::failure::Failure;
use crate::process::interrupt;
use crate::process::threads::too_few;
use crate::terminal::progress::Progress;
use choreo_motion::Time;
use choreo_plugin::Frame;
use choreo_render::{Plan, RenderError, Renderer};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::sync::{Mutex, PoisonError};

/// Plans waiting for the renderer.
const PLANS_AHEAD: usize = 2;

/// Gives the plan for a time.
pub type PlanAt<'a> = Box<dyn FnMut(Time) -> Result<Plan, Failure> + Send + 'a>;

/// Takes a finished frame with its number and time.
pub type Encode<'a> = Box<dyn FnMut((i64, Time), &Frame) -> Result<(), Failure> + Send + 'a>;

pub struct Pipeline<'a> {
    /// Frame number and time, in the order wanted.
    pub frames: Vec<(i64, Time)>,
    pub plan: PlanAt<'a>,
    pub renderer: &'a mut dyn Renderer,
    /// One: pictures arrive in order. Several: in any order, in parallel.
    pub encoders: Vec<Encode<'a>>,
    pub progress: &'a Progress,
}

/// What the threads share.
struct Shared {
    stop: AtomicBool,
    /// The failure of the smallest frame number, so that the same script always fails with the same words.
    failure: Mutex<Option<(i64, Failure)>>,
    /// Pictures whose buffers can be drawn into again.
    spare: Mutex<Vec<Frame>>,
    /// Frames that came from the renderer.
    drawn: AtomicU64,
}

impl Shared {
    fn fail(&self, frame: i64, failure: Failure) {
        self.stop.store(true, Ordering::SeqCst);
        let mut slot = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        if slot.as_ref().is_none_or(|(f, _)| frame < *f) {
            *slot = Some((frame, failure));
        }
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::SeqCst) || interrupt::interrupted()
    }
}

impl Pipeline<'_> {
    /// Gives how many frames were drawn.
    pub fn run(self) -> Result<u64, Failure> {
        let shared = Shared {
            stop: AtomicBool::new(false),
            failure: Mutex::new(None),
            spare: Mutex::new(Vec::new()),
            drawn: AtomicU64::new(0),
        };
        let Pipeline { frames, plan, renderer, encoders, progress } = self;
        let (plan_to, plans) = sync_channel(PLANS_AHEAD);
        // From hand to hand: while the encoders work, one picture waits here and others are in flight.
        let (frame_to, pictures) = sync_channel(0);
        let pictures = Mutex::new(pictures);
        std::thread::scope(|scope| {
            let thread = |name: &str| std::thread::Builder::new().name(name.into());
            let planner = thread("plan").spawn_scoped(scope, || make_plans(&shared, frames, plan, plan_to));
            // One that encodes is enough.
            let started = encoders.into_iter().map(|encode| {
                thread("encode").spawn_scoped(scope, || encode_pictures(&shared, &pictures, encode, progress))
            });
            let encoding = started.filter(Result::is_ok).count();
            match planner {
                Ok(_) if encoding > 0 => draw(&shared, renderer, plans, frame_to),
                _ => shared.fail(0, too_few("none can be started to plan and encode frames")),
            }
        });
        if interrupt::interrupted() {
            return Err(Failure::Interrupted);
        }
        let failure = shared.failure.into_inner().unwrap_or_else(PoisonError::into_inner);
        failure.map_or(Ok(shared.drawn.into_inner()), |(_, failure)| Err(failure))
    }
}

fn make_plans(
    shared: &Shared,
    frames: Vec<(i64, Time)>,
    mut plan: PlanAt<'_>,
    to: SyncSender<((i64, Time), Plan)>,
) {
    for (frame, time) in frames {
        if shared.stopped() {
            return;
        }
        match plan(time) {
            Ok(plan) => {
                if to.send(((frame, time), plan)).is_err() {
                    return;
                }
            }
            Err(failure) => return shared.fail(frame, failure),
        }
    }
}

fn draw(
    shared: &Shared,
    renderer: &mut dyn Renderer,
    plans: Receiver<((i64, Time), Plan)>,
    to: SyncSender<((i64, Time), Frame)>,
) {
    let depth = renderer.frames_in_flight().max(1);
    let mut flying = VecDeque::with_capacity(depth);
    let mut more = true;
    while !shared.stopped() && (more || !flying.is_empty()) {
        while more && flying.len() < depth {
            // With nothing in flight there is nothing better to do than to wait for a plan.
            let next = match flying.is_empty() {
                true => plans.recv().map_err(|_| TryRecvError::Disconnected),
                false => plans.try_recv(),
            };
            match next {
                Ok((frame, plan)) => match renderer.submit(plan) {
                    Ok(()) => flying.push_back(frame),
                    Err(error) => return shared.fail(frame.0, render_failure(error)),
                },
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => more = false,
            }
        }
        if let Some(frame) = flying.pop_front() {
            let reuse = shared.spare.lock().unwrap_or_else(PoisonError::into_inner).pop();
            match renderer.collect(reuse) {
                Ok(picture) => {
                    shared.drawn.fetch_add(1, Ordering::Relaxed);
                    if to.send((frame, picture)).is_err() {
                        return;
                    }
                }
                Err(error) => return shared.fail(frame.0, render_failure(error)),
            }
        }
    }
}

fn encode_pictures(
    shared: &Shared,
    pictures: &Mutex<Receiver<((i64, Time), Frame)>>,
    mut encode: Encode<'_>,
    progress: &Progress,
) {
    loop {
        let next = pictures.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((frame, picture)) = next else { return };
        // After a failure the queue is emptied, so that the renderer does not wait for a place in it.
        if !shared.stopped() {
            match encode(frame, &picture) {
                Ok(()) => progress.step(),
                Err(failure) => shared.fail(frame.0, failure),
            }
        }
        shared.spare.lock().unwrap_or_else(PoisonError::into_inner).push(picture);
    }
}

/// The failure with a hint at what to lower if the device could not do it.
pub fn render_failure(error: RenderError) -> Failure {
    let cause = match &error {
        RenderError::Twice { second, .. } => second,
        error => error,
    };
    let hint = match cause {
        RenderError::OutOfMemory { .. } => {
            "\n    hint: smaller pictures (--size), one sample (--samples 1) or smaller textures need less memory; \
             --device cpu uses the machine's own"
        }
        RenderError::DeviceLost { .. } | RenderError::TimedOut { .. } => {
            "\n    hint: smaller pictures (--size) or one sample (--samples 1) are less work at once; \
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
        let text = |error| render_failure(error).lines().concat();
        assert_eq!(
            text(RenderError::Twice { first: lost(), second: full() }),
            "Vulkan: memory of depth: out of memory; tried twice, before that: Vulkan: frame 7: the device was lost; the \
             kernel log may say why the driver gave it up\n    hint: smaller pictures (--size), one sample (--samples 1) or \
             smaller textures need less memory; --device cpu uses the machine's own"
        );
        let timed_out = RenderError::TimedOut { object: "frame 7".into(), secs: 300 };
        assert!(
            text(timed_out)
                .starts_with("Vulkan: frame 7: not finished after 300 s\n    hint: smaller pictures")
        );
        assert_eq!(text(RenderError::Usage("no".into())), "no");
    }
}
