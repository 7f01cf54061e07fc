//! The job as scripts for Slurm: an array of renders, a chunk a task, and a join that depends on all of them.

use super::{FarmJob, OUTPUT, SCENE, SEGMENTS};
use choreo_test_runner::collect::quoted;
use std::path::Path;

/// Tasks of an array at most: the default of Slurm's MaxArraySize is 1001.
pub(crate) const MOST_TASKS: u64 = 1000;

const SUBMIT: &str = "submit.sh";

/// The command that submits the job.
pub(crate) fn command(folder: &Path) -> String {
    format!("sh {}", quoted(&folder.join(SUBMIT).display().to_string()))
}

pub(crate) fn files(job: &FarmJob) -> Vec<(&'static str, String)> {
    let chunks: String = job.chunks.iter().map(|(first, last)| format!("{first}-{last}\n")).collect();
    let film = quoted(&job.film);
    let options: String = job.options.iter().map(|option| format!(" {}", quoted(option))).collect();
    let last = job.chunks.len() - 1;
    let render = format!(
        "#!/bin/sh
#SBATCH --job-name=choreo-render
#SBATCH --output=logs/render-%a.txt
#SBATCH --open-mode=append
#SBATCH --requeue
# A render that gets a signal to stop ends its frame and keeps what is finished; a task that runs again goes on with it.
#SBATCH --signal=B:TERM@60
# One chunk: the line of chunks.txt with the number of the task.
frames=$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" chunks.txt)
exec \"${{CHOREO:-choreo}}\" render {SCENE} -o {film} --frames \"$frames\" --segment {SEGMENTS} --resume --quiet{options}
"
    );
    let join = format!(
        "#!/bin/sh
#SBATCH --job-name=choreo-join
#SBATCH --output=logs/join.txt
#SBATCH --open-mode=append
exec \"${{CHOREO:-choreo}}\" join {SEGMENTS} -o {OUTPUT}/{film}
"
    );
    let submit = format!(
        "#!/bin/sh
# Submits the job. All nodes see this folder. Options for sbatch are passed on: sh {SUBMIT} --partition=long
# CHOREO names the program on the nodes, where it is not on their PATH.
set -e
cd \"$(dirname \"$0\")\"
mkdir -p logs
render=$(sbatch --parsable --array=0-{last} \"$@\" render.sh)
# The name of the cluster may stand behind the number.
render=${{render%%;*}}
join=$(sbatch --parsable --dependency=afterok:\"$render\" --kill-on-invalid-dep=yes \"$@\" join.sh)
echo \"render: job $render, {tasks} tasks; join: job ${{join%%;*}}\"
",
        tasks = last + 1
    );
    vec![("chunks.txt", chunks), ("render.sh", render), ("join.sh", join), (SUBMIT, submit)]
}
