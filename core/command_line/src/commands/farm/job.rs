//! Description of a job in its folder, `job.json`: the films with their chunks. `choreo farm --status` reads it.

use super::chunks::Chunk;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::{Component, Path};

/// Names of files and folders in the job's folder.
pub(crate) const SCENE_FILE: &str = "film.choreo";
pub(crate) const SEGMENTS_FOLDER: &str = "segments";
pub(crate) const OUTPUT_FOLDER: &str = "output";
pub(crate) const JOB_FILE: &str = "job.json";
pub(crate) const ROWS_FILE: &str = "rows.json";

/// A render job, independent of the engine.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(crate) struct FarmJob {
    /// Films, in the order in which machines begin them.
    pub films: Vec<Film>,
    /// Pattern of output names of a batch, in which each film has a row of parameters.
    pub pattern: Option<String>,
}

/// A film of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Film {
    /// Path of the film below [`OUTPUT_FOLDER`], with slashes.
    pub output: String,
    /// Folder of the film's segments below [`SEGMENTS_FOLDER`]; empty if it is [`SEGMENTS_FOLDER`] itself.
    pub segments: String,
    /// Row of the batch that gives the film its parameters.
    pub row: Option<usize>,
    /// Options of `choreo render` on each machine.
    pub options: Vec<String>,
    /// Frames of the whole film.
    pub frames: u64,
    pub chunks: Vec<Chunk>,
}

impl Film {
    /// Folder of the film's segments, in the job's folder.
    pub(super) fn folder(&self) -> String {
        match self.segments.as_str() {
            "" => SEGMENTS_FOLDER.to_string(),
            below => format!("{SEGMENTS_FOLDER}/{below}"),
        }
    }
}

impl FarmJob {
    pub(super) fn json(&self) -> Value {
        json!({ "job": 1, "films": self.films, "pattern": self.pattern })
    }

    /// Parses a job; `None` if a field is missing, or if a path leads out of the folder.
    pub(super) fn read(value: &Value) -> Option<FarmJob> {
        (value["job"] == 1).then_some(())?;
        let job = FarmJob::deserialize(value).ok()?;
        let is_inside =
            |path: &str| Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
        let is_valid = |film: &Film| {
            let in_order = film.chunks.iter().all(|(first, last)| first <= last);
            is_inside(&film.output) && is_inside(&film.segments) && film.frames > 0 && in_order
        };
        job.films.iter().all(is_valid).then_some(job)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_is_read_back_equal_and_refused_with_paths_outside_its_folder() {
        let film = |segments: &str| Film {
            output: "a/film.mp4".into(),
            segments: segments.into(),
            row: Some(3),
            options: vec!["--size=4x4".into()],
            frames: 30,
            chunks: vec![(0, 23), (24, 29)],
        };
        let job = FarmJob { films: vec![film("3"), film("")], pattern: Some("{name}.mp4".into()) };
        assert_eq!(FarmJob::read(&job.json()), Some(job.clone()));
        assert_eq!([film("3").folder(), film("").folder()], ["segments/3", "segments"]);
        for (key, path) in [("segments", "../x"), ("segments", "/x"), ("output", "../../x")] {
            let mut value = job.json();
            value["films"][0][key] = path.into();
            assert_eq!(FarmJob::read(&value), None, "{path}");
        }
    }
}
