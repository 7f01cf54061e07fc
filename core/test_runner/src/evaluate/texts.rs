//! Judges lists of texts: warnings, printed lines, render features that a plan leaves out, names of active effects.

use super::judge_error::JudgeError;
use super::snapshot_cache::SnapshotCache;
use super::text_format::matches_pattern;
use super::{Judgment, plan, text_format};
use choreo_motion::Time;
use choreo_render::plan::left_out_names;
use choreo_script::did_you_mean;
use choreo_script::testing::{Expectation, SectionRun, TextsQuantity, TextsTest};
use choreo_stage::Stage;
use std::sync::Arc;

/// Warnings of the script and of every asset on stage, each once.
pub(super) fn collect_warnings(stage: &Stage) -> Vec<String> {
    let mut lines = stage.warnings.clone();
    let mut seen: Vec<&Arc<choreo_asset::Asset>> = Vec::new();
    for actor in &stage.actors {
        if seen.iter().any(|a| Arc::ptr_eq(a, &actor.asset)) {
            continue;
        }
        seen.push(&actor.asset);
        lines.extend(actor.asset.warnings.iter().map(|w| match w.place.is_empty() {
            true => format!("{}: warning: {}", actor.asset.name, w.text),
            false => format!("{}: {}: warning: {}", actor.asset.name, w.place, w.text),
        }));
    }
    lines
}

pub(super) fn judge(
    run: &SectionRun,
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    texts: TextsQuantity,
    test: &TextsTest,
) -> Judgment {
    match try_judge(run, snapshots, e, texts, test) {
        Ok(judged) => judged,
        Err(why) => Judgment::impossible("lines to check", why),
    }
}

fn try_judge(
    run: &SectionRun,
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    texts: TextsQuantity,
    test: &TextsTest,
) -> Result<Judgment, JudgeError> {
    if let (TextsQuantity::LeftOut(_), TextsTest::Names(name)) = (texts, test)
        && !left_out_names().any(|known| matches_pattern(known, name))
    {
        let why = format!("nothing is called \"{name}\"{}", did_you_mean(name, left_out_names()));
        let mut judged = Judgment::impossible("the name of something that a plan can leave out", why);
        judged.hint = format!("known: {}", left_out_names().collect::<Vec<_>>().join(", "));
        return Ok(judged);
    }
    let varies_over_time = matches!(texts, TextsQuantity::LeftOut(_) | TextsQuantity::Effects);
    let times = if varies_over_time { snapshots.times_and_ends(e)? } else { vec![Time::ZERO] };
    let what = match texts {
        TextsQuantity::Warnings => "warnings",
        TextsQuantity::Printed => "printed lines",
        TextsQuantity::LeftOut(_) => "left out",
        TextsQuantity::Effects => "effects",
    };
    let expected = match test {
        TextsTest::Empty => format!("no {what}"),
        TextsTest::Contains(part) => format!("\"{part}\" among the {what}"),
        TextsTest::Names(name) => format!("{name} {what}"),
        TextsTest::Count(n) => format!("{n} {what}"),
    };
    let expected = if e.negated { format!("not: {expected}") } else { expected };
    for time in &times {
        let lines = lines_of_quantity(run, snapshots, e, texts, *time)?;
        let holds = match test {
            TextsTest::Empty => lines.is_empty(),
            TextsTest::Contains(part) => lines.iter().any(|line| line.contains(part.as_str())),
            TextsTest::Names(name) => lines
                .iter()
                .any(|line| matches_pattern(line.split_once(": ").map_or(line, |(what, _)| what), name)),
            TextsTest::Count(n) => lines.len() == *n,
        };
        if holds == e.negated {
            let when =
                if varies_over_time { format!(" at {}", text_format::time(*time)) } else { String::new() };
            let got = match lines.as_slice() {
                [] => format!("none{when}"),
                // The first line of a diagnostic is its message; its other lines show the place.
                [line] => format!("{}{when}", line.lines().next().unwrap_or_default()),
                several => format!("{}: {}{when}", several.len(), first_lines(several)),
            };
            return Ok(Judgment::new(false, expected, got));
        }
    }
    Ok(Judgment::new(true, expected.clone(), expected))
}

fn first_lines(lines: &[String]) -> String {
    const MAX_LISTED: usize = 8;
    let firsts = lines.iter().take(MAX_LISTED).map(|line| line.lines().next().unwrap_or_default());
    let mut text = firsts.collect::<Vec<_>>().join("; ");
    if lines.len() > MAX_LISTED {
        text.push_str(&format!("; and {} more", lines.len() - MAX_LISTED));
    }
    text
}

fn lines_of_quantity(
    run: &SectionRun,
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    texts: TextsQuantity,
    time: Time,
) -> Result<Vec<String>, JudgeError> {
    Ok(match texts {
        TextsQuantity::Warnings => collect_warnings(&snapshots.stage),
        TextsQuantity::Printed if e.stage == 0 => run.printed.clone(),
        TextsQuantity::Printed => Vec::new(),
        TextsQuantity::LeftOut(options) => {
            let plan = plan::make_plan(snapshots, &options, time)?;
            plan.left_out.iter().map(|l| format!("{}: {}", l.part, l.why)).collect()
        }
        TextsQuantity::Effects => {
            let on = snapshots.at(time)?.effects.clone();
            on.iter()
                .filter_map(|e| snapshots.stage.effects.get(e.effect))
                .map(|e| e.plugin.clone())
                .collect()
        }
    })
}
