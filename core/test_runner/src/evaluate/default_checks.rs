//! Default checks of a script without sections: no errors or warnings, every frame is finite, and running it again gives the same result.

use super::snapshot_cache::SnapshotCache;
use super::{failed_check, text_format, texts};
use crate::outcome::{Check, SourceLocation};
use choreo_motion::Time;
use choreo_script::testing::SectionRun;
use choreo_stage::{ActorState, Evaluator, Snapshot};

/// Largest number of frames that are tested. In a longer script, this number of frames is spread over its length.
const MAX_FRAMES: i64 = 2000;
/// Number of frames evaluated once more, in reverse order.
const REPEATED_FRAMES: usize = 16;

pub(super) fn judge(run: &SectionRun, snapshots: &mut [SnapshotCache]) -> Vec<Check> {
    let Some(own) = snapshots.first_mut() else { return Vec::new() };
    let place = || SourceLocation { file: run.info.file.clone(), line: 0, column: 0 };
    let passed =
        |title: &str, got: String| Check { passed: true, ..failed_check(place(), title, got.clone(), got) };
    let mut checks = Vec::new();
    let expected = run.expected.len();
    if expected == 0 {
        let warnings = texts::collect_warnings(&own.stage);
        checks.push(match warnings.first() {
            None => passed("runs without errors and warnings", "none".into()),
            Some(first) => {
                let got = first.lines().next().unwrap_or_default();
                failed_check(place(), "runs without errors and warnings", "none", got)
            }
        });
    }
    let settings = &own.stage.settings;
    let frames = settings.fps.frames_in(settings.length).max(1);
    let count = frames.min(MAX_FRAMES);
    let times: Vec<Time> = (0..count).map(|k| settings.fps.time_of(k * frames / count)).collect();
    let title = "every frame is finite";
    let mut first_problem = None;
    for time in &times {
        let problem = match own.at(*time) {
            Err(why) => Some(why.to_string()),
            Ok(snapshot) => describe_non_finite(own, &snapshot),
        };
        if let Some(problem) = problem {
            first_problem = Some(format!("{problem} at {}", text_format::time(*time)));
            break;
        }
    }
    checks.push(match first_problem {
        Some(problem) => failed_check(place(), title, "finite positions and poses", problem),
        None => passed(title, format!("{count} frames")),
    });
    let title = "deterministic";
    checks.push(match difference_of_second_run(run, own, &times) {
        Some(how) => failed_check(place(), title, "the same bits on a second run and in any order", how),
        None => passed(title, "the same bits".into()),
    });
    checks
}

fn describe_non_finite(snapshots: &SnapshotCache, snapshot: &Snapshot) -> Option<String> {
    let finite = |state: &ActorState| {
        state.world_from_model.is_finite() && state.model_from_joint.iter().all(|m| m.is_finite())
    };
    if let Some(actor) = snapshot.actors.iter().position(|state| !finite(state)) {
        let name = snapshots.stage.actors.get(actor).map_or("", |a| a.name.as_str());
        return Some(format!("actor \"{name}\" is not finite"));
    }
    (!snapshot.camera.world_from_view.is_finite()).then(|| "the camera is not finite".to_string())
}

fn difference_of_second_run(
    run: &SectionRun,
    snapshots: &mut SnapshotCache,
    times: &[Time],
) -> Option<String> {
    if let Some(second) = run.second_run_hash
        && second != snapshots.stage.content_hash()
    {
        return Some("running the script twice gives different stages".into());
    }
    let step = times.len().div_ceil(REPEATED_FRAMES).max(1);
    let mut fresh = Evaluator::new(snapshots.stage.clone());
    for time in times.iter().step_by(step).rev() {
        let (Ok(first), Ok(second)) = (snapshots.at(*time), fresh.at(*time)) else { continue };
        if first.content_hash() != second.content_hash() {
            return Some(format!(
                "{} differs when frames are evaluated in another order",
                text_format::time(*time)
            ));
        }
    }
    None
}
