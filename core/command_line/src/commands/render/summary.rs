//! What a render says when it is done.

use crate::args::RenderArgs;
use crate::commands::render::Job;
use crate::commands::render::draw::Drawn;
use crate::failure::{Failure, print_json, print_json_message, print_message};
use crate::output::target::Target;

pub fn report(args: &RenderArgs, job: &Job, drawn: &Drawn, secs: f64) -> Result<(), Failure> {
    let frames = job.frames.len();
    if args.json {
        let made: serde_json::Map<String, serde_json::Value> =
            drawn.provenance.iter().map(|(k, v)| (k.clone(), v.clone().into())).collect();
        let mut value = serde_json::json!({
            "ok": true,
            "output": job.target.shown(),
            "frames": frames,
            "drawn": drawn.drawn,
            "reused": frames as u64 - drawn.drawn.min(frames as u64),
            "size": job.settings.size,
            "fps": job.settings.fps.as_fps(),
            "samples": drawn.samples,
            "device": drawn.device,
            "seconds": secs,
            "warnings": job.scene.warnings,
            "provenance": made,
        });
        if let Some((frames, secs)) = drawn.device_time {
            value["device_frames"] = frames.into();
            value["device_seconds"] = secs.into();
        }
        if job.target == Target::Stdout {
            print_json_message(&value);
            return Ok(());
        }
        return print_json(&value);
    }
    if !args.quiet {
        let plural = if frames == 1 { "frame" } else { "frames" };
        let there = match frames as u64 - drawn.drawn.min(frames as u64) {
            0 => String::new(),
            reused if args.watch => format!(", {reused} of them drawn before,"),
            reused => format!(", {reused} of them there before,"),
        };
        print_message(format_args!(
            "{frames} {plural}{there} in {secs:.1} s ({:.0} a second) on {}: {}",
            drawn.drawn as f64 / secs,
            drawn.device,
            job.target.shown()
        ));
        match drawn.device_time {
            Some((frames, secs)) => print_message(format_args!(
                "the device was busy for {:.3} ms a frame, measured by its clock",
                secs * 1e3 / frames as f64
            )),
            None if args.timings => print_message("no time of the device: it has no clock, or the CPU drew"),
            None => {}
        }
    }
    Ok(())
}
