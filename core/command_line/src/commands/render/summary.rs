//! The summary of a finished render.

use crate::args::RenderArgs;
use crate::commands::render::Job;
use crate::commands::render::draw::DrawResult;
use crate::drawing::pipeline::FrameCounts;
use crate::failure::{Failure, print_json, print_json_message, print_message};
use crate::output::target::Target;
use crate::terminal::counted;

pub(super) fn report(args: &RenderArgs, job: &Job, drawn: &DrawResult, secs: f64) -> Result<(), Failure> {
    let frames = job.frames.len() as u64;
    let FrameCounts { drawn: own, repeated, recomposed } = drawn.counts;
    if args.json {
        let made: serde_json::Map<String, serde_json::Value> =
            drawn.provenance.iter().map(|(k, v)| (k.clone(), v.clone().into())).collect();
        let mut value = serde_json::json!({
            "ok": true,
            "output": job.target.display_name(),
            "frames": frames,
            "drawn": own,
            "reused": frames - own.min(frames),
            "repeated": repeated,
            "recomposed": recomposed,
            "size": job.settings.size,
            "fps": job.settings.fps.as_fps(),
            "samples": drawn.samples,
            "device": drawn.device,
            "device_reason": drawn.reason,
            "seconds": secs,
            "warnings": job.scene.warnings,
            "provenance": made,
        });
        if let Some((frames, secs)) = drawn.device_time {
            value["device_frames"] = frames.into();
            value["device_seconds"] = secs.into();
        }
        if let Some((frames, stages)) = &drawn.stage_times {
            value["stage_frames"] = (*frames).into();
            let secs = stages.iter().map(|(name, secs)| (name.to_string(), (*secs).into()));
            value["stage_seconds"] = secs.collect::<serde_json::Map<_, _>>().into();
        }
        if job.target == Target::Stdout {
            print_json_message(&value);
            return Ok(());
        }
        return print_json(&value);
    }
    if !args.quiet {
        let frames_text = counted(frames, "frame");
        let because = drawn.reason.iter().map(|why| format!(" ({why})")).collect::<String>();
        print_message(format_args!(
            "{frames_text}{} in {secs:.1} s ({:.0} a second) on {}{because}: {}",
            not_drawn_text(frames, drawn.counts, args.watch),
            (own + repeated + recomposed) as f64 / secs,
            drawn.device,
            job.target.display_name()
        ));
        match drawn.device_time {
            Some((frames, secs)) => print_message(format_args!(
                "the device was busy for {:.3} ms a frame, measured by its clock",
                secs * 1e3 / frames as f64
            )),
            None if args.timings && drawn.stage_times.is_none() => {
                print_message("no device time: the device has no clock, or no frame was drawn");
            }
            None => {}
        }
        if let Some((frames, stages)) = &drawn.stage_times {
            let of = |(name, secs): &(&str, f64)| format!("{name} {:.2}", secs * 1e3 / *frames as f64);
            let stages: Vec<String> = stages.iter().map(of).collect();
            print_message(format_args!("device time of a drawn frame in ms: {}", stages.join(", ")));
        }
    }
    Ok(())
}

/// Number of frames that were not drawn, and the reason.
fn not_drawn_text(frames: u64, counts: FrameCounts, watch: bool) -> String {
    let FrameCounts { drawn, repeated, recomposed } = counts;
    let reused = frames - drawn.min(frames);
    let parts = match watch {
        true => vec![(reused, "drawn before")],
        false => vec![
            (reused - (repeated + recomposed).min(reused), "finished before"),
            (repeated, "equal to the one before"),
            (recomposed, "with other 2D layers over the same scene"),
        ],
    };
    let parts = parts.into_iter().filter(|(count, _)| *count > 0);
    let words: Vec<String> = parts.map(|(count, what)| format!("{count} of them {what}")).collect();
    if words.is_empty() { String::new() } else { format!(", {},", words.join(", ")) }
}
