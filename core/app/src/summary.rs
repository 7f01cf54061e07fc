//! What a render says when it is done.

use crate::args::RenderArgs;
use crate::draw::Drawn;
use crate::failure::{Failure, print_json};
use crate::output::Target;
use crate::render::Job;

pub fn report(args: &RenderArgs, job: &Job, drawn: &Drawn, secs: f64) -> Result<(), Failure> {
    let frames = job.frames.len();
    if args.json {
        let made: serde_json::Map<String, serde_json::Value> =
            drawn.provenance.iter().map(|(k, v)| (k.clone(), v.clone().into())).collect();
        let value = serde_json::json!({
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
        if job.target == Target::Stdout {
            eprintln!("{value}");
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
        eprintln!(
            "{frames} {plural}{there} in {secs:.1} s ({:.0} a second) on {}: {}",
            drawn.drawn as f64 / secs,
            drawn.device,
            job.target.shown()
        );
    }
    Ok(())
}
