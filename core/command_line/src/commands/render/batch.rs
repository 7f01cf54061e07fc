//! `choreo render --set-from`: renders a film for each row of a table in one process, so that assets are imported and pipelines are created
//! once. A row that fails is reported, and the others continue.

use crate::args::RenderArgs;
use crate::args::values;
use crate::commands::render::draw::{self, DrawResult};
use crate::drawing::device;
use crate::drawing::frame_cache::CachingRenderer;
use crate::drawing::pipeline::render_failure;
use crate::failure::{Failure, output_failure, print_json, print_message};
use crate::output::target::Target;
use crate::process::panics::catch_plugin_panics;
use crate::scene;
use crate::scene::opening::ReopenState;
use crate::scene::rows::{self, ParameterRow};
use crate::terminal::counted;
use choreo_plugin::Registry;
use serde_json::json;
use std::path::Path;
use std::time::Instant;

pub(super) fn run(args: &RenderArgs, table: &Path, plugins: &Registry) -> Result<(), Failure> {
    let rows = rows::read_table(table)?;
    let outputs = rows::output_paths(&rows, &args.output)?;
    let renders = || rows.iter().zip(&outputs).map(|(row, output)| row_args(args, row, output));
    if let Some(number) = args.row {
        let render = number.checked_sub(1).and_then(|index| renders().nth(index));
        let count = rows.len();
        let render = render.ok_or_else(|| {
            Failure::Usage(format!("--row {number}: {} has rows 1 to {count}", table.display()))
        })?;
        return super::run(render, plugins);
    }
    if args.segment.is_some() {
        return Err(Failure::Usage("--segment is for one film; choose its row with --row".into()));
    }
    if Target::parse(&args.output)? == Target::Stdout {
        return Err(Failure::Usage(
            "--set-from writes a file for each row; -o is a pattern, as {name}.mp4".into(),
        ));
    }
    let jobs = args.jobs.as_deref().map(values::parse_jobs).transpose()?;
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    Target::parse(&outputs[0])?.exporter(&registry)?;
    let started = device::start_renderer(super::device_request(args), registry.effects()).wait()?;
    let mut batch = Batch {
        registry,
        reopen_state: ReopenState::default(),
        renderer: CachingRenderer::without_cache(started.renderer),
        note: started.note,
        reason: started.reason,
        jobs,
        creates_folders: Path::new(&args.output)
            .parent()
            .is_some_and(|folder| folder.to_string_lossy().contains('{')),
    };
    let mut results = Vec::new();
    for (row, render) in rows.iter().zip(renders()) {
        let start = Instant::now();
        let drawn = catch_plugin_panics(|| batch.render_row(&render));
        if let Err(failure @ (Failure::Interrupted | Failure::Internal(_))) = drawn {
            return Err(failure);
        }
        let result = RowResult {
            row: row.number,
            output: render.output,
            drawn,
            seconds: start.elapsed().as_secs_f64(),
        };
        result.print(args);
        results.push(result);
    }
    report_rows(args, &results)
}

/// Arguments for the render of one row.
fn row_args(args: &RenderArgs, row: &ParameterRow, output: &str) -> RenderArgs {
    let scene = row.scene_args(&args.scene);
    RenderArgs { scene, output: output.to_string(), set_from: None, row: None, ..args.clone() }
}

/// State shared by all rows.
struct Batch {
    registry: Registry,
    reopen_state: ReopenState,
    renderer: CachingRenderer,
    /// Note about the device, printed with the first row.
    note: Option<String>,
    reason: Option<String>,
    jobs: Option<usize>,
    /// Whether folders of outputs are created, since rows determine their names.
    creates_folders: bool,
}

impl Batch {
    fn render_row(&mut self, args: &RenderArgs) -> Result<(u64, DrawResult), Failure> {
        let target = Target::parse(&args.output)?;
        let job = super::prepare_job(args, target, &self.registry, Some(&self.reopen_state))?;
        if self.creates_folders {
            create_folder(&job.target)?;
        }
        self.renderer.begin_render().map_err(render_failure)?;
        let started = device::StartedRenderer {
            renderer: Box::new(self.renderer.clone()),
            time: None,
            stages: None,
            note: self.note.take(),
            reason: self.reason.clone(),
        };
        let drawn = draw::draw_job(args, &job, started, self.jobs);
        self.reopen_state.release_unused_assets(job.scene.limits.memory);
        Ok((job.frames.len() as u64, drawn?))
    }
}

/// Creates the folder of a single output file.
fn create_folder(target: &Target) -> Result<(), Failure> {
    let Target::File(path) = target else { return Ok(()) };
    let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) else { return Ok(()) };
    std::fs::create_dir_all(folder).map_err(|e| output_failure(&folder.display().to_string(), &e))
}

struct RowResult {
    row: usize,
    output: String,
    /// Number of the film's frames, and how they were drawn.
    drawn: Result<(u64, DrawResult), Failure>,
    seconds: f64,
}

impl RowResult {
    fn print(&self, args: &RenderArgs) {
        let RowResult { row, output, seconds, .. } = self;
        match &self.drawn {
            Err(failure) => failure
                .message_lines()
                .iter()
                .for_each(|line| print_message(format_args!("row {row}: {line}"))),
            Ok((frames, _)) if !args.quiet && !args.json => {
                let frames = counted(*frames, "frame");
                print_message(format_args!("row {row}: {frames} in {seconds:.2} s: {output}"));
            }
            Ok(_) => {}
        }
    }

    fn json(&self) -> serde_json::Value {
        let (mut errors, mut frames, mut drawn) = (json!(null), json!(null), json!(null));
        match &self.drawn {
            Err(failure) => errors = failure.json()["errors"].take(),
            Ok((all, own)) => (frames, drawn) = (json!(all), json!(own.counts.drawn)),
        }
        json!({
            "row": self.row, "output": self.output, "ok": self.drawn.is_ok(), "frames": frames, "drawn": drawn,
            "seconds": self.seconds, "errors": errors,
        })
    }
}

/// Prints the report of all rows, and fails if a row failed.
fn report_rows(args: &RenderArgs, results: &[RowResult]) -> Result<(), Failure> {
    if args.json {
        let rows: Vec<serde_json::Value> = results.iter().map(RowResult::json).collect();
        let all = results.iter().all(|result| result.drawn.is_ok());
        print_json(&json!({ "ok": all, "rows": rows }))?;
    }
    rows::check_no_row_failed(
        results.len(),
        results.iter().filter_map(|result| Some((result.row, result.drawn.as_ref().err()?))),
    )
}
