//! The job as a template of Open Job Description (2023-09) with the extension for chunks of tasks, as JSON.

use super::job::{FarmJob, Film, OUTPUT_FOLDER, ROWS_FILE, SCENE_FILE, SEGMENTS_FOLDER};
use super::preview;
use crate::failure::Failure;
use choreo_test_runner::collect::shell_quote;
use serde_json::{Value, json};
use std::path::Path;

const TEMPLATE_FILE: &str = "template.json";

/// Largest number of frames in a chunk, a limit of AWS Deadline Cloud.
pub(crate) const MAX_CHUNK_FRAMES: u64 = 150;

/// Largest number of values of a task parameter, a limit of the specification.
const MAX_PARAMETER_VALUES: usize = 1024;

pub(crate) fn job_files(job: &FarmJob) -> Result<Vec<(&'static str, String)>, Failure> {
    let texts = job.films.iter().flat_map(|film| film.options.iter().chain([&film.output]));
    if let Some(text) = texts.clone().find(|text| text.contains("{{") || text.contains("}}")) {
        let what =
            format!("{text}: two braces mark an expression in the job's template; write it without them");
        return Err(Failure::Usage(what));
    }
    let tasks: usize = job.films.iter().map(|film| film.chunks.len()).sum();
    if job.pattern.is_some() && tasks > MAX_PARAMETER_VALUES {
        return Err(Failure::Usage(format!(
            "--set-from: {tasks} chunks are more than the {MAX_PARAMETER_VALUES} of a job; make longer ones with --chunk, or a job for each \
             part of the table"
        )));
    }
    Ok(vec![(TEMPLATE_FILE, crate::terminal::json::pretty(&template(job)) + "\n")])
}

/// Command that runs the job on this machine.
pub(crate) fn run_command(folder: &Path, job: &FarmJob) -> String {
    let template = folder.join(TEMPLATE_FILE).display().to_string();
    let extensions = if job.pattern.is_some() { "" } else { " --extensions TASK_CHUNKING" };
    format!("openjd run {} --step Join --run-dependencies{extensions}", shell_quote(&template))
}

fn template(job: &FarmJob) -> Value {
    let path = |name: &str, kind: &str, flow: &str, default: &str, about: &str| json!({ "name": name, "type": "PATH", "objectType": kind, "dataFlow": flow, "default": default, "description": about });
    let mut parameters = vec![
        path("Scene", "FILE", "IN", SCENE_FILE, "The packed scene"),
        path(
            "Segments",
            "DIRECTORY",
            "INOUT",
            SEGMENTS_FOLDER,
            "Folder for the frames; all machines must be able to write to it",
        ),
        path("Output", "DIRECTORY", "OUT", OUTPUT_FOLDER, "Folder for the film"),
        json!({ "name": "Choreo", "type": "STRING", "default": "choreo", "description": "Program choreo on the machines: name or path" }),
    ];
    let name = job.films.last().map_or("", |film| film.output.as_str());
    let name: String =
        job.pattern.as_deref().unwrap_or(name).chars().filter(|c| !c.is_control()).take(64).collect();
    let steps = match &job.pattern {
        Some(pattern) => {
            parameters.push(path("Rows", "FILE", "IN", ROWS_FILE, "The parameters of each film"));
            steps_of_rows(job, pattern)
        }
        None => {
            let last = job.films.last();
            let length = last.map_or(1, longest_chunk_frames);
            parameters.push(json!({ "name": "ChunkSize", "type": "INT", "default": length, "minValue": 1, "description": "Number of frames in a chunk" }));
            parameters.push(json!({ "name": "Frames", "type": "STRING", "default": frame_range(last), "description": "All frames of the film" }));
            steps_of_film(&job.films)
        }
    };
    let mut template = json!({
        "specificationVersion": "jobtemplate-2023-09",
        "name": name,
        "parameterDefinitions": parameters,
        "steps": steps,
    });
    if job.pattern.is_none() {
        template["extensions"] = json!(["TASK_CHUNKING"]);
    }
    template
}

fn frame_range(film: Option<&Film>) -> String {
    format!("0-{}", film.map_or(0, |film| film.frames - 1))
}

/// Number of frames in the longest chunk.
fn longest_chunk_frames(film: &Film) -> u64 {
    film.chunks.iter().map(|(first, last)| last - first + 1).max().unwrap_or(1)
}

/// Script of a step.
fn step_script(args: Value) -> Value {
    // A render that is asked to stop completes its frame and keeps its finished frames.
    let cancelation = json!({ "mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": 60 });
    json!({ "actions": { "onRun": { "command": "{{Param.Choreo}}", "args": args, "cancelation": cancelation } } })
}

/// Command line of a render. `from`: arguments between the scene and `-o`.
fn render_script(film: &str, options: &[String], from: &[&str], frames: &str, segments: &str) -> Value {
    let mut words = vec!["render", "{{Param.Scene}}"];
    words.extend(from);
    words.extend(["-o", film, "--frames", frames, "--segment", segments, "--resume", "--quiet"]);
    words.extend(options.iter().map(String::as_str));
    step_script(json!(words))
}

fn join_script(segments: &str, film: &str) -> Value {
    step_script(json!(["join", segments, "-o", format!("{{{{Param.Output}}}}/{film}"), "--wait", "60"]))
}

/// Steps that render the frames of each film and join them; the preview comes before the film.
fn steps_of_film(films: &[Film]) -> Vec<Value> {
    let mut steps: Vec<Value> = Vec::new();
    for film in films {
        let is_preview = film.segments == preview::PREVIEW_FOLDER;
        let (suffix, frames, length) = match is_preview {
            true => ("Preview", json!(frame_range(Some(film))), json!(longest_chunk_frames(film))),
            false => ("", json!("{{Param.Frames}}"), json!("{{Param.ChunkSize}}")),
        };
        let segments = match film.segments.as_str() {
            "" => "{{Param.Segments}}".to_string(),
            below => format!("{{{{Param.Segments}}}}/{below}"),
        };
        let name = format!("Render{suffix}");
        let mut step = json!({
            "name": name,
            "parameterSpace": { "taskParameterDefinitions": [{
                "name": "Frame",
                "type": "CHUNK[INT]",
                "range": frames,
                "chunks": { "defaultTaskCount": length, "rangeConstraint": "CONTIGUOUS" },
            }] },
            "script": render_script(&film.output, &film.options, &[], "{{Task.Param.Frame}}", &segments),
        });
        if let Some(before) = steps.last() {
            step["dependencies"] = json!([{ "dependsOn": before["name"] }]);
        }
        steps.push(step);
        steps.push(json!({
            "name": format!("Join{suffix}"),
            "dependencies": [{ "dependsOn": name }],
            "script": join_script(&segments, &film.output),
        }));
    }
    steps
}

/// A task for each chunk of each row, as two lists of equal length, and a task that joins each film.
fn steps_of_rows(job: &FarmJob, pattern: &str) -> Vec<Value> {
    let chunks = || job.films.iter().flat_map(|film| film.chunks.iter().map(move |chunk| (film, chunk)));
    let rows: Vec<_> = chunks().map(|(film, _)| film.row).collect();
    let frames: Vec<String> = chunks().map(|(_, (first, last))| format!("{first}-{last}")).collect();
    let list = |name: &str, kind: &str, range: Value| json!({ "name": name, "type": kind, "range": range });
    let options = job.films.first().map_or(&[][..], |film| &film.options);
    let from = ["--set-from", "{{Param.Rows}}", "--row", "{{Task.Param.Row}}"];
    let segments = "{{Param.Segments}}/{{Task.Param.Row}}";
    let films: Vec<_> = job.films.iter().map(|film| film.row).collect();
    let outputs: Vec<_> = job.films.iter().map(|film| &film.output).collect();
    vec![
        json!({
            "name": "Render",
            "parameterSpace": {
                "taskParameterDefinitions": [list("Row", "INT", json!(rows)), list("Frames", "STRING", json!(frames))],
                "combination": "(Row, Frames)",
            },
            "script": render_script(pattern, options, &from, "{{Task.Param.Frames}}", segments),
        }),
        json!({
            "name": "Join",
            "dependencies": [{ "dependsOn": "Render" }],
            "parameterSpace": {
                "taskParameterDefinitions": [list("Row", "INT", json!(films)), list("Film", "STRING", json!(outputs))],
                "combination": "(Row, Film)",
            },
            "script": join_script(segments, "{{Task.Param.Film}}"),
        }),
    ]
}
