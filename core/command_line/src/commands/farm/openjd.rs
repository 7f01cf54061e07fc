//! The job as a template of Open Job Description (2023-09) with the extension for chunks of tasks, as JSON.

use super::{FarmJob, OUTPUT, SCENE, SEGMENTS};
use crate::failure::Failure;
use choreo_test_runner::collect::quoted;
use serde_json::{Value, json};
use std::path::Path;

const TEMPLATE: &str = "template.json";

/// Frames of a chunk at most: AWS Deadline Cloud takes no more.
pub(crate) const MOST_FRAMES: u64 = 150;

pub(crate) fn files(job: &FarmJob) -> Result<Vec<(&'static str, String)>, Failure> {
    let texts = job.options.iter().chain([&job.film]);
    if let Some(text) = texts.clone().find(|text| text.contains("{{") || text.contains("}}")) {
        let what = format!("{text}: two braces are an expression of the job's template; write it without");
        return Err(Failure::Usage(what));
    }
    Ok(vec![(TEMPLATE, crate::terminal::json::pretty(&template(job)) + "\n")])
}

/// The command that runs the job on this machine.
pub(crate) fn command(folder: &Path) -> String {
    let template = folder.join(TEMPLATE).display().to_string();
    format!("openjd run {} --step Join --run-dependencies", quoted(&template))
}

fn template(job: &FarmJob) -> Value {
    let length = job.chunks.iter().map(|(first, last)| last - first + 1).max().unwrap_or(1);
    let path = |name: &str, kind: &str, flow: &str, default: &str, about: &str| json!({ "name": name, "type": "PATH", "objectType": kind, "dataFlow": flow, "default": default, "description": about });
    let frames = format!("0-{}", job.frames - 1);
    let mut render = ["render", "{{Param.Scene}}", "-o", &job.film].map(String::from).to_vec();
    render.extend(["--frames", "{{Task.Param.Frame}}", "--segment", "{{Param.Segments}}"].map(String::from));
    render.extend(["--resume", "--quiet"].map(String::from));
    render.extend(job.options.iter().cloned());
    let film = format!("{{{{Param.Output}}}}/{}", job.film);
    let action = |args: Value| {
        // A render that gets a signal to stop ends its frame and keeps what is finished.
        let cancelation = json!({ "mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": 60 });
        json!({ "actions": { "onRun": { "command": "{{Param.Choreo}}", "args": args, "cancelation": cancelation } } })
    };
    json!({
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": job.film.chars().filter(|c| !c.is_control()).take(64).collect::<String>(),
        "parameterDefinitions": [
            path("Scene", "FILE", "IN", SCENE, "The packed scene"),
            path("Segments", "DIRECTORY", "INOUT", SEGMENTS, "Where the machines put their frames; all of them see it"),
            path("Output", "DIRECTORY", "OUT", OUTPUT, "Where the film is put"),
            { "name": "Frames", "type": "STRING", "default": frames, "description": "All frames of the film" },
            { "name": "ChunkSize", "type": "INT", "default": length, "minValue": 1, "description": "Frames of a chunk" },
            { "name": "Choreo", "type": "STRING", "default": "choreo", "description": "The program choreo on the machines" },
        ],
        "steps": [
            {
                "name": "Render",
                "parameterSpace": { "taskParameterDefinitions": [{
                    "name": "Frame",
                    "type": "CHUNK[INT]",
                    "range": "{{Param.Frames}}",
                    "chunks": { "defaultTaskCount": "{{Param.ChunkSize}}", "rangeConstraint": "CONTIGUOUS" },
                }] },
                "script": action(json!(render)),
            },
            {
                "name": "Join",
                "dependencies": [{ "dependsOn": "Render" }],
                "script": action(json!(["join", "{{Param.Segments}}", "-o", film])),
            },
        ],
    })
}
