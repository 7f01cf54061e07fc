//! The description of a job in its folder, `job.json`: its films with their chunks. `choreo farm --status` reads it.

use super::chunks::Chunk;
use serde_json::{Value, json};
use std::path::{Component, Path};

/// Names in the job's folder.
pub(crate) const SCENE: &str = "film.choreo";
pub(crate) const SEGMENTS: &str = "segments";
pub(crate) const OUTPUT: &str = "output";
pub(crate) const JOB: &str = "job.json";
pub(crate) const ROWS: &str = "rows.json";

/// A job, for any engine.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FarmJob {
    /// The films, in the order in which machines begin them.
    pub films: Vec<Film>,
    /// The pattern of names of a batch, whose films have a row each.
    pub pattern: Option<String>,
}

/// A film of a job.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Film {
    /// The film's path below [`OUTPUT`], with slashes.
    pub output: String,
    /// The folder of its segments below [`SEGMENTS`]; empty for that folder itself.
    pub segments: String,
    /// The row of a batch that it is made of.
    pub row: Option<usize>,
    /// Options of `choreo render` on each machine.
    pub options: Vec<String>,
    /// Frames of the whole film.
    pub frames: u64,
    pub chunks: Vec<Chunk>,
}

impl Film {
    /// The folder of its segments in the job's folder.
    pub fn folder(&self) -> String {
        match self.segments.as_str() {
            "" => SEGMENTS.to_string(),
            below => format!("{SEGMENTS}/{below}"),
        }
    }
}

impl FarmJob {
    pub fn json(&self) -> Value {
        let film = |film: &Film| {
            json!({
                "output": film.output, "segments": film.segments, "row": film.row, "options": film.options,
                "frames": film.frames, "chunks": film.chunks,
            })
        };
        json!({ "job": 1, "films": self.films.iter().map(film).collect::<Vec<_>>(), "pattern": self.pattern })
    }

    /// `None` where a field is missing, or where a path leads out of the folder.
    pub fn read(value: &Value) -> Option<FarmJob> {
        (value["job"] == 1).then_some(())?;
        let film = |value: &Value| {
            let inside =
                |path: &&str| Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
            let text = |value: &Value| value.as_str().map(str::to_string);
            let chunk = |value: &Value| {
                let chunk = (value[0].as_u64()?, value[1].as_u64()?);
                (chunk.0 <= chunk.1).then_some(chunk)
            };
            Some(Film {
                output: value["output"].as_str().filter(inside)?.to_string(),
                segments: value["segments"].as_str().filter(inside)?.to_string(),
                row: value["row"].as_u64().and_then(|row| usize::try_from(row).ok()),
                options: value["options"].as_array()?.iter().map(text).collect::<Option<_>>()?,
                frames: value["frames"].as_u64().filter(|frames| *frames > 0)?,
                chunks: value["chunks"].as_array()?.iter().map(chunk).collect::<Option<_>>()?,
            })
        };
        let films = value["films"].as_array()?.iter().map(film).collect::<Option<Vec<_>>>()?;
        Some(FarmJob { films, pattern: value["pattern"].as_str().map(str::to_string) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_comes_back_and_leads_nowhere_else() {
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
