//! Devices that are lost, run out of memory or time out: the frame is drawn once more with reduced demands, then an error is returned.
//! The failures are injected, but the recovery is real: a new device on which everything is created and drawn again, with validation.

use crate::common::*;
use choreo_plugin::{Effect, Frame};
use choreo_render::vulkan::faults::{Fault, FaultKind, FaultPlace, Faults};
use choreo_render::*;
use glam::DVec3;
use std::sync::Arc;

const FRAMES: usize = 4;

fn options(faults: &Faults) -> GpuOptions {
    let effects: Vec<Effect> = effects::named(&["vignette"]);
    GpuOptions { validation: true, effects, faults: faults.clone(), ..GpuOptions::default() }
}

fn plans() -> (Arc<SceneResources>, Vec<Plan>) {
    let scene = |i: usize| {
        let mut scene = busy_scene(DVec3::ZERO);
        scene.snapshot.camera.world_from_view.translation.x += 0.1 * i as f64;
        scene
    };
    let resources = scene(0).resources();
    let plans = (0..FRAMES).map(|i| scene(i).plan(&PlanOptions::new([96, 54], 4)).1).collect();
    (resources, plans)
}

/// Draws all frames, with the largest number in flight.
fn draw_all_plans(renderer: &mut dyn Renderer) -> Result<Vec<Frame>, RenderError> {
    let (resources, plans) = plans();
    renderer.load(resources)?;
    let (mut frames, mut flying) = (Vec::new(), 0);
    for plan in plans {
        renderer.submit(plan)?;
        flying += 1;
        if flying == renderer.frames_in_flight() {
            frames.push(renderer.collect(None)?);
            flying -= 1;
        }
    }
    for _ in 0..flying {
        frames.push(renderer.collect(None)?);
    }
    Ok(frames)
}

fn recovering_renderer(faults: &Faults) -> Option<RecoveringRenderer> {
    match RecoveringRenderer::new(options(faults)) {
        Ok(renderer) => Some(renderer),
        Err(RenderError::NoVulkan { why }) => {
            println!("SKIP 1: {}", why.lines().next().unwrap_or_default());
            None
        }
        Err(e) => panic!("{e}"),
    }
}

/// The frames of a run without faults, and the number of calls at each place.
fn draw_without_faults() -> Option<(Vec<Frame>, Faults)> {
    let faults = Faults::new(Vec::new());
    let mut renderer = recovering_renderer(&faults)?;
    let frames = draw_all_plans(&mut renderer).unwrap();
    assert!(renderer.take_notes().is_empty());
    assert!(frames.windows(2).all(|w| w[0] != w[1]), "every frame is another one");
    Some((frames, faults))
}

#[test]
fn a_device_that_fails_once_gives_the_same_images() {
    let Some((expected, counts)) = draw_without_faults() else { return };
    for (place, kind, words) in [
        (FaultPlace::Memory, FaultKind::OutOfMemory, "out of memory"),
        (FaultPlace::Pipeline, FaultKind::OutOfMemory, "out of memory"),
        (FaultPlace::Submit, FaultKind::DeviceLost, "the device was lost"),
        (FaultPlace::Wait, FaultKind::DeviceLost, "the device was lost"),
        (FaultPlace::Wait, FaultKind::TimedOut, "not finished after 300 s"),
    ] {
        let calls = counts.calls(place);
        assert!(calls >= FRAMES, "{place:?} is passed {calls} times");
        // Creating a device takes longer than drawing the frames, so only the first, a middle and the last call fail.
        for nth in [0, calls / 2, calls - 1] {
            let faults = Faults::new(vec![Fault { place, nth, kind }]);
            let mut renderer = recovering_renderer(&faults).unwrap();
            let frames =
                draw_all_plans(&mut renderer).unwrap_or_else(|e| panic!("{kind:?} at {place:?} {nth}: {e}"));
            assert!(frames == expected, "{kind:?} at {place:?} {nth}: other images");
            let notes = renderer.take_notes();
            assert_eq!(notes.len(), 1, "{kind:?} at {place:?} {nth}: {notes:?}");
            assert!(
                notes[0].contains(words) && notes[0].ends_with("on a new device, one frame at a time"),
                "{notes:?}"
            );
            assert_eq!(faults.calls(FaultPlace::Device), 2);
        }
    }
}

#[test]
fn a_frame_that_fails_twice_is_an_error() {
    let Some((expected, counts)) = draw_without_faults() else { return };
    let last = counts.calls(FaultPlace::Submit) - 1;
    let fault = |place, nth, kind| Fault { place, nth, kind };
    let lost = |nth| fault(FaultPlace::Submit, nth, FaultKind::DeviceLost);
    for second in [
        lost(last + 1),
        fault(FaultPlace::Device, 1, FaultKind::OutOfMemory),
        fault(FaultPlace::Memory, counts.calls(FaultPlace::Memory), FaultKind::OutOfMemory),
    ] {
        let mut renderer = recovering_renderer(&Faults::new(vec![lost(last), second])).unwrap();
        match draw_all_plans(&mut renderer) {
            Err(RenderError::FailedTwice { first, .. }) => {
                assert!(matches!(*first, RenderError::DeviceLost { .. }))
            }
            other => panic!("{second:?}: {other:?}"),
        }
        // Later calls return an error again.
        let again = renderer.collect(None).unwrap_err().to_string();
        assert!(again.ends_with("failed twice and is no longer used"), "{again}");
    }
    // A failure after a successful frame counts as a first one.
    let mut renderer = recovering_renderer(&Faults::new(vec![lost(0), lost(last + 2)])).unwrap();
    assert!(draw_all_plans(&mut renderer).unwrap() == expected);
    assert_eq!(renderer.take_notes().len(), 2);
}

/// Each failure without recovery is an error of its kind, and the resources of the failed frame are freed: the
/// validation layer reports nothing, and the next frame is correct.
#[test]
fn errors_have_their_kind_and_free_all_resources() {
    let Some((expected, counts)) = draw_without_faults() else { return };
    for nth in (0..counts.calls(FaultPlace::Memory)).step_by(3) {
        let faults =
            Faults::new(vec![Fault { place: FaultPlace::Memory, nth, kind: FaultKind::OutOfMemory }]);
        let mut renderer = VulkanRenderer::new(options(&faults)).unwrap();
        let messages = renderer.validation_messages();
        match draw_all_plans(&mut renderer) {
            Err(RenderError::OutOfMemory { object }) => assert!(object.starts_with("memory of "), "{object}"),
            other => panic!("memory {nth}: {other:?}"),
        }
        while renderer.collect(None).is_ok() {}
        assert!(draw_all_plans(&mut renderer).unwrap() == expected, "after memory {nth}");
        drop(renderer);
        let messages = messages.lock().unwrap();
        assert!(messages.is_empty(), "memory {nth}: {messages:?}");
    }
}

/// A frugal renderer draws the same images with less memory, and uploads in parts.
#[test]
fn a_frugal_renderer_draws_the_same() {
    let Some((expected, _)) = draw_without_faults() else { return };
    let mut bytes = Vec::new();
    for frugal in [false, true] {
        let faults = Faults::new(Vec::new());
        let mut renderer = VulkanRenderer::new(GpuOptions { frugal, ..options(&faults) }).unwrap();
        assert!(draw_all_plans(&mut renderer).unwrap() == expected, "frugal: {frugal}");
        bytes.push((renderer.frames_in_flight(), renderer.allocated_bytes()));
    }
    assert!(bytes[0].0 > 1 && bytes[1].0 == 1);
    assert!(bytes[1].1 < bytes[0].1, "{bytes:?}");
}
