//! The job as scripts for Slurm. Each film, the preview first, is an array of renders with one chunk per task, and a join that depends on
//! all of them. The films of a batch share one array.

use super::job::{FarmJob, Film, OUTPUT_FOLDER, ROWS_FILE, SCENE_FILE};
use crate::failure::Failure;
use crate::terminal::counted;
use choreo_test_runner::collect::shell_quote;
use std::path::Path;

/// Largest number of tasks in an array: the default of Slurm's MaxArraySize is 1001.
pub(crate) const MAX_ARRAY_TASKS: u64 = 1000;

const SUBMIT_FILE: &str = "submit.sh";

/// The command that submits the job.
pub(crate) fn submit_command(folder: &Path) -> String {
    format!("sh {}", shell_quote(&folder.join(SUBMIT_FILE).display().to_string()))
}

/// An array of renders, and the join that follows it.
struct ArrayJob {
    /// Names of the files.
    chunks: &'static str,
    render: &'static str,
    join: &'static str,
    /// Name of the array in messages.
    name: &'static str,
}

const FILM_ARRAY: ArrayJob =
    ArrayJob { chunks: "chunks.txt", render: "render.sh", join: "join.sh", name: "" };
const PREVIEW_ARRAY: ArrayJob = ArrayJob {
    chunks: "preview_chunks.txt",
    render: "preview_render.sh",
    join: "preview_join.sh",
    name: "preview ",
};

/// File with the films of a batch: row and path.
const FILMS_FILE: &str = "films.txt";

pub(crate) fn job_files(job: &FarmJob) -> Result<Vec<(&'static str, String)>, Failure> {
    let tasks: usize = job.films.iter().map(|film| film.chunks.len()).sum();
    if tasks as u64 > MAX_ARRAY_TASKS && job.pattern.is_some() {
        return Err(Failure::Usage(format!(
            "--set-from: {tasks} chunks are more than the {MAX_ARRAY_TASKS} of an array; make longer ones with --chunk, or a job for each \
             part of the table"
        )));
    }
    let mut files = Vec::new();
    let mut submit = format!(
        "#!/bin/sh
# Submits the job. All nodes see this folder. Options for sbatch are passed on: sh {SUBMIT_FILE} --partition=long
# CHOREO names the program on the nodes, where it is not on their PATH.
set -e
cd \"$(dirname \"$0\")\"
mkdir -p logs
"
    );
    if let Some(pattern) = &job.pattern {
        let chunks = job.films.iter().flat_map(|film| film.chunks.iter().map(move |chunk| (film, chunk)));
        let line =
            |(film, (first, last)): (&Film, &(u64, u64))| format!("{} {first}-{last}\n", film.segments);
        let films = job.films.iter().map(|film| format!("{} {}\n", film.segments, film.output));
        files.push((FILM_ARRAY.chunks, chunks.map(line).collect()));
        files.push((FILMS_FILE, films.collect()));
        let options = job.films.first().map_or(&[][..], |film| &film.options);
        files.push((FILM_ARRAY.render, row_render_script(pattern, options)));
        files.push((FILM_ARRAY.join, rows_join_script()));
        submit += &submit_lines(&FILM_ARRAY, tasks, "afterany");
    } else {
        for film in &job.films {
            let array = if film.segments.is_empty() { &FILM_ARRAY } else { &PREVIEW_ARRAY };
            let chunks = film.chunks.iter().map(|(first, last)| format!("{first}-{last}\n")).collect();
            files.push((array.chunks, chunks));
            files.push((array.render, film_render_script(array, film)));
            files.push((array.join, film_join_script(film)));
            submit += &submit_lines(array, film.chunks.len(), "afterok");
        }
    }
    files.push((SUBMIT_FILE, submit));
    Ok(files)
}

/// Shell lines that submit a Slurm job array and the job that joins its segments. In a batch, outputs whose segments exist are joined even if other
/// rows failed.
fn submit_lines(array: &ArrayJob, tasks: usize, dependency: &str) -> String {
    let ArrayJob { render, join, name, .. } = array;
    let last = tasks - 1;
    format!(
        "render=$(sbatch --parsable --array=0-{last} \"$@\" {render})
# The name of the cluster may stand behind the number.
render=${{render%%;*}}
join=$(sbatch --parsable --dependency={dependency}:\"$render\" --kill-on-invalid-dep=yes \"$@\" {join})
echo \"{name}render: job $render, {}; {name}join: job ${{join%%;*}}\"
",
        counted(tasks as u64, "task")
    )
}

/// Head of a script. `more`: further options of the script.
fn script_head(job: &str, log: &str, more: &str) -> String {
    format!(
        "#!/bin/sh
#SBATCH --job-name=choreo-{job}
#SBATCH --output=logs/{log}.txt
#SBATCH --open-mode=append
{more}# Slurm starts a copy of it in the job's folder.
[ -n \"$SLURM_JOB_ID\" ] || cd \"$(dirname \"$0\")\" || exit 1
"
    )
}

/// Head of a script that renders, up to the variable `line`: the line of the list of chunks for this task.
fn render_head(array: &ArrayJob) -> String {
    let stem = array.render.trim_end_matches(".sh");
    let more = "#SBATCH --requeue
# A render that gets a signal to stop ends its frame and keeps what is finished; a task that runs again goes on with it.
#SBATCH --signal=B:TERM@60
";
    let head = script_head("render", &format!("{stem}-%a"), more);
    let chunks = array.chunks;
    format!(
        "{head}# One chunk: the line of {chunks} with the number of the task.
line=$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" {chunks})
"
    )
}

fn quoted_words(options: &[String]) -> String {
    options.iter().map(|option| format!(" {}", shell_quote(option))).collect()
}

fn film_render_script(array: &ArrayJob, film: &Film) -> String {
    let (head, output, segments) = (render_head(array), shell_quote(&film.output), film.folder());
    let options = quoted_words(&film.options);
    format!(
        "{head}exec \"${{CHOREO:-choreo}}\" render {SCENE_FILE} -o {output} --frames \"$line\" --segment {segments} --resume --quiet{options}\n"
    )
}

fn row_render_script(pattern: &str, options: &[String]) -> String {
    let (head, pattern, options) = (render_head(&FILM_ARRAY), shell_quote(pattern), quoted_words(options));
    format!(
        "{head}row=${{line%% *}}
exec \"${{CHOREO:-choreo}}\" render {SCENE_FILE} --set-from {ROWS_FILE} --row \"$row\" -o {pattern} --frames \"${{line#* }}\" \
         --segment \"segments/$row\" --resume --quiet{options}
"
    )
}

/// Option of the join: segments may become visible only after the task that wrote them has ended.
const WAIT_OPTION: &str = "--wait 60";

fn film_join_script(film: &Film) -> String {
    let stem = if film.segments.is_empty() { "join" } else { "preview_join" };
    let (head, segments, output) = (
        script_head("join", stem, ""),
        film.folder(),
        shell_quote(&format!("{OUTPUT_FOLDER}/{}", film.output)),
    );
    format!("{head}exec \"${{CHOREO:-choreo}}\" join {segments} -o {output} {WAIT_OPTION}\n")
}

fn rows_join_script() -> String {
    let head = script_head("join", "join", "");
    format!(
        "{head}# A film that lacks frames is named; the others are joined.
failed=0
while IFS= read -r line; do
    \"${{CHOREO:-choreo}}\" join \"segments/${{line%% *}}\" -o \"{OUTPUT_FOLDER}/${{line#* }}\" {WAIT_OPTION} < /dev/null || failed=1
done < {FILMS_FILE}
exit $failed
"
    )
}
