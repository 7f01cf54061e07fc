//! The rules of `check`, which find things in a script that are valid but probably not intended. Only `choreo check` and editors
//! report them.
//!
//! ```text
//! drafts ─► cues, unused ─┐
//!                         ├─► PlacedFinding ─► Diagnostic (`// allow:` comments, equal ones merged)
//! Stage::survey ──────────┘
//! ```

mod counted;
mod cues;
mod unused;

use crate::api_error::Place;
use crate::build::{StageDraft, UnusedVariable};
use crate::def::Defs;
use crate::diagnostic::{Diagnostic, Severity, allows};
use choreo_motion::{Clip, Time};
use choreo_stage::{Finding, Subject};
use counted::{Drafts, Lines, Source};
use rhai::AST;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A finding with its place in the script.
#[derive(Clone, Debug)]
pub(crate) struct PlacedFinding {
    pub rule: &'static str,
    pub severity: Severity,
    pub place: Place,
    pub text: String,
    pub hint: Option<String>,
    pub subject: Subject,
    /// Time on stage; zero if the finding does not belong to a time.
    pub at: Time,
}

impl PlacedFinding {
    pub(crate) fn warning(rule: &'static str, place: &Place, text: String) -> PlacedFinding {
        let (subject, at) = (Subject::Stage, Time::ZERO);
        PlacedFinding {
            rule,
            severity: Severity::Warning,
            place: place.clone(),
            text,
            hint: None,
            subject,
            at,
        }
    }

    pub(crate) fn note(rule: &'static str, place: &Place, text: String) -> PlacedFinding {
        PlacedFinding { severity: Severity::Note, ..PlacedFinding::warning(rule, place, text) }
    }

    pub(crate) fn hint(mut self, hint: impl Into<String>) -> PlacedFinding {
        self.hint = Some(hint.into());
        self
    }

    /// Sets the subject and the time on stage.
    pub(crate) fn about(mut self, subject: Subject, at: Time) -> PlacedFinding {
        (self.subject, self.at) = (subject, at);
        self
    }
}

/// The findings about the drafts, before they are resolved to a stage.
pub(crate) fn script_findings(stage_draft: &StageDraft) -> Vec<PlacedFinding> {
    let mut found = Vec::new();
    cues::check_cues(stage_draft, &mut found);
    unused::check_unused(&Drafts::new(stage_draft), &mut found);
    found
}

/// Variables of a file that nothing reads.
pub(crate) fn unused_variables(ast: &AST, file: &str, text: &str, defs: &Defs) -> Vec<UnusedVariable> {
    unused::unused_variables(&Source::new(ast, text), file, defs)
}

/// Markers of a clip that is played: names and clip times.
#[derive(Clone, Debug)]
pub struct ClipMarkers {
    pub clip: Arc<Clip>,
    pub markers: Vec<(String, Time)>,
}

/// Places of the calls that created each object of the stage, findings about the script, and the texts of the script.
#[derive(Clone, Debug, Default)]
pub struct Places {
    pub settings: Place,
    pub actors: Vec<Place>,
    /// Places of look-at constraints, by actor.
    pub look_at_constraints: Vec<Vec<Place>>,
    /// Places of the other constraints that the script states, by actor.
    pub constraints: Vec<Vec<Place>>,
    pub cameras: Vec<Place>,
    pub cuts: Vec<Place>,
    /// Places of cues, by actor, layer and cue, as in `Stage::actors`.
    pub cues: Vec<Vec<Vec<Place>>>,
    /// Markers of the clips that are played and have any.
    pub clip_markers: Vec<ClipMarkers>,
    pub lights: Vec<Place>,
    /// Place of the call of `sky(…)`, if any.
    pub sky: Option<Place>,
    /// The call of `ambient(…)`, unless an option of `stage` sets the ambient light.
    pub ambient: Option<Place>,
    pub effects: Vec<Place>,
    /// Places of the calls of `on_frame`.
    pub callbacks: Vec<Place>,
    /// Places of 2D layers, as in `Stage::layers_2d`.
    pub layers_2d: Vec<Place>,
    /// Files of which only the clips were imported, because the script uses nothing else, and the places of their `load` calls.
    pub clips_only: Vec<(String, Place)>,
    /// The script's name in messages.
    pub main: String,
    pub(crate) script_findings: Vec<PlacedFinding>,
    /// The text of the script and its modules, by their names in messages.
    pub sources: Arc<BTreeMap<String, Arc<str>>>,
}

impl Places {
    /// The place of the call that made a subject; empty if the script did not make it.
    pub fn of(&self, subject: Subject) -> Place {
        let place = match subject {
            Subject::Stage => Some(&self.settings),
            Subject::Actor(i) => self.actors.get(i),
            Subject::Look { actor, look } => self.look_at_constraints.get(actor).and_then(|l| l.get(look)),
            Subject::Constraint { actor, constraint } => {
                self.constraints.get(actor).and_then(|c| c.get(constraint))
            }
            Subject::Camera(i) => self.cameras.get(i),
            Subject::Cut(i) => self.cuts.get(i),
            Subject::Light(i) => self.lights.get(i),
            Subject::Effect(i) => self.effects.get(i),
        };
        place.cloned().unwrap_or_default()
    }

    /// Findings about the script and, given as `on_stage`, about its stage, as diagnostics sorted by place. Findings of one rule
    /// at one place are merged. Findings whose rule a comment `// allow: RULE` on the line or the line above allows are left out.
    pub fn findings(&self, on_stage: &[Finding]) -> Vec<Diagnostic> {
        let lines = Lines::of(&self.sources);
        let all = self.unallowed_findings(on_stage, &lines);
        let mut found: Vec<Diagnostic> = Vec::new();
        let mut last: Option<(Place, &str, usize)> = None;
        for finding in all {
            if let Some((place, rule, more)) = &mut last
                && *place == finding.place
                && *rule == finding.rule
                && place.line > 0
            {
                *more += 1;
                continue;
            }
            append_merged_count(&mut found, last.take());
            found.push(diagnostic(&finding, &lines));
            last = Some((finding.place, finding.rule, 0));
        }
        append_merged_count(&mut found, last);
        found
    }

    /// Whether a file is the script itself, not a module.
    pub fn is_main(&self, file: &str) -> bool {
        self.main == file
    }

    /// Subject, time and rule of each warning, to mark them in a plot.
    pub fn marks(&self, on_stage: &[Finding]) -> Vec<(Subject, Time, &'static str)> {
        let warnings = self
            .unallowed_findings(on_stage, &Lines::of(&self.sources))
            .into_iter()
            .filter(|r| r.severity == Severity::Warning);
        warnings.map(|r| (r.subject, r.at, r.rule)).collect()
    }

    /// All findings except those that a comment allows, sorted by place.
    fn unallowed_findings(&self, on_stage: &[Finding], lines: &Lines) -> Vec<PlacedFinding> {
        let from_stage = on_stage.iter().map(|f| PlacedFinding {
            rule: f.rule,
            severity: if f.note { Severity::Note } else { Severity::Warning },
            place: self.of(f.subject),
            text: f.text.clone(),
            hint: f.hint.clone(),
            subject: f.subject,
            at: Time::ZERO,
        });
        let mut all: Vec<PlacedFinding> = self.script_findings.iter().cloned().chain(from_stage).collect();
        all.retain(|finding| !is_allowed(finding, lines));
        all.sort_by(|a, b| a.place.cmp(&b.place).then(a.rule.cmp(b.rule)));
        all
    }
}

fn diagnostic(finding: &PlacedFinding, lines: &Lines) -> Diagnostic {
    let place = &finding.place;
    Diagnostic {
        severity: finding.severity,
        rule: finding.rule,
        file: place.file.clone(),
        line: place.line,
        column: place.column,
        source_line: lines.get(&place.file, place.line).unwrap_or("").to_string(),
        message: finding.text.clone(),
        hint: finding.hint.clone(),
    }
}

/// Whether a comment on the line of the finding or on the line above allows the rule.
fn is_allowed(finding: &PlacedFinding, lines: &Lines) -> bool {
    let Place { file, line, .. } = &finding.place;
    let numbers = [*line, line.saturating_sub(1)];
    numbers.into_iter().filter_map(|n| lines.get(file, n)).any(|line| allows(line, finding.rule))
}

/// Appends the number of findings merged into the last diagnostic to its message, if any.
fn append_merged_count(found: &mut [Diagnostic], last: Option<(Place, &str, usize)>) {
    if let (Some((.., more)), Some(diagnostic)) = (last, found.last_mut())
        && more > 0
    {
        diagnostic.message += &format!(" (and {more} more from this line)");
    }
}
