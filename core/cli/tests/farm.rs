//! Jobs for render farms: the job runs with the engine's own runner, and its film has the bytes of one machine.
#![cfg(unix)]

mod common;

use common::*;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// 60 frames.
const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 30, length: 2.0 });
let color = param("color", "#c04020");
cast("t", load("tri.gltf"));
cast("b", shape("box", #{ size: [1.0, 1.0, 1.0], color: color }))
    .key("position", [[0.0, [0, 0, 0]], [0.5, [0, 0, 0]], [1.2, [1.5, 0, 0]], [2.0, [1.5, 0, 0]]]);
camera("c").at(0.0, 1.0, 6.0).look_at([0.0, 0.0, 0.0]);
"##;

/// An MP4 has pieces of 24 frames with these.
const OPTIONS: &[&str] = &["--samples", "1", "--export", "keyframes=0.8", "--set", "color=#20c040"];

fn scene() -> tempfile::TempDir {
    let dir = folder();
    std::fs::create_dir(dir.path().join("scene")).unwrap();
    std::fs::rename(dir.path().join("tri.gltf"), dir.path().join("scene/tri.gltf")).unwrap();
    std::fs::write(dir.path().join("scene/it's.rhai"), SCRIPT).unwrap();
    dir
}

/// The job in the folder `job`, and its summary.
fn job(folder: &Path, engine: &str, film: &str, more: &[&str]) -> serde_json::Value {
    let mut args = vec!["farm", "scene/it's.rhai", "-o", film, "--for", engine, "--to", "job", "--json"];
    args.extend(OPTIONS);
    args.extend(more);
    let run = choreo(folder, &args);
    assert_eq!(run.code, 0, "{}", run.err);
    serde_json::from_str(&run.out).unwrap()
}

/// The film of one machine, from the script and its files, which are gone then.
fn one_machine(folder: &Path) -> Vec<u8> {
    let mut args = vec!["render", "scene/it's.rhai", "-o", "one.mp4", "--device", "cpu"];
    args.extend(OPTIONS);
    let run = choreo(folder, &args);
    assert_eq!(run.code, 0, "{}", run.err);
    std::fs::remove_dir_all(folder.join("scene")).unwrap();
    read(folder, "one.mp4")
}

/// `openjd` with its arguments, in an environment of its own.
fn openjd(args: &[&str]) -> Option<Run> {
    let python = python_with("openjd.cli", "openjd-cli==0.8.0")?;
    let program = python.with_file_name("openjd");
    let run = Command::new(program).args(args).output().unwrap();
    Some(finished(run))
}

#[test]
fn openjd_runs_the_whole_job() {
    let dir = scene();
    let d = dir.path();
    let film = "it's a {film}.mp4";
    let summary = job(d, "openjd", film, &["--chunk", "25"]);
    assert_eq!(summary["chunks"], serde_json::json!([[0, 24], [25, 49], [50, 59]]));
    assert_eq!(names(&d.join("job")), ["film.choreo", "output", "segments", "template.json"]);
    let whole = one_machine(d);
    let template = d.join("job/template.json").display().to_string();
    let Some(check) = openjd(&["check", &template, "--extensions", "TASK_CHUNKING"]) else { return };
    assert_eq!(check.code, 0, "{}{}", check.out, check.err);
    let choreo = format!("Choreo={}", env!("CARGO_BIN_EXE_choreo"));
    let run = ["run", &template, "--step", "Join", "--run-dependencies", "-p", &choreo];
    let run = openjd(&[&run[..], &["--extensions", "TASK_CHUNKING"]].concat()).unwrap();
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    assert!(names(&d.join("job/segments")).len() >= 3, "{:?}", names(&d.join("job/segments")));
    assert_eq!(names(&d.join("job/output")).len(), 1);
    assert!(read(d, &format!("job/output/{film}")) == whole);
}

/// A stand-in for sbatch, which runs the tasks of an array one after the other, the last first, and a dependent job only behind its
/// array. The real one runs in `cargo xtask farm`.
const SBATCH: &str = r#"#!/bin/sh
script= first= last= after=
for argument; do
    case "$argument" in
        --array=*) range=${argument#--array=}; first=${range%-*}; last=${range#*-} ;;
        --dependency=afterok:*) after=${argument#--dependency=afterok:} ;;
        -*) echo "$argument" >> options.txt ;;
        *) script=$argument ;;
    esac
done
[ -z "$after" ] || [ -f "done-$after" ] || exit 1
if [ -n "$first" ]; then
    for task in $(seq "$last" -1 "$first"); do
        SLURM_ARRAY_TASK_ID=$task sh "$script" >&2 || exit 1
    done
    touch done-41
    echo "41;cluster"
else
    sh "$script" >&2 || exit 1
    echo 42
fi
"#;

fn slurm(folder: &Path, sbatch: &str) -> std::process::Output {
    let bin: PathBuf = folder.join("bin");
    std::fs::create_dir_all(&bin).unwrap();
    std::fs::write(bin.join("sbatch"), sbatch).unwrap();
    std::fs::set_permissions(bin.join("sbatch"), std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap_or_default());
    Command::new("sh")
        .args(["job/submit.sh", "--partition=long"])
        .current_dir(folder)
        .env("PATH", path)
        .env("CHOREO", env!("CARGO_BIN_EXE_choreo"))
        .env("CHOREO_PLUGINS", "")
        .output()
        .unwrap()
}

#[test]
fn slurm_scripts_make_the_film() {
    let dir = scene();
    let d = dir.path();
    let film = "it's a film.mp4";
    let summary = job(d, "slurm", film, &["--chunk", "14"]);
    assert_eq!(summary["chunks"].as_array().unwrap().len(), 5);
    assert_eq!(
        names(&d.join("job")),
        ["chunks.txt", "film.choreo", "join.sh", "output", "render.sh", "segments", "submit.sh"]
    );
    assert_eq!(read(d, "job/chunks.txt"), b"0-13\n14-27\n28-41\n42-55\n56-59\n");
    let whole = one_machine(d);
    let run = finished(slurm(d, SBATCH));
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(run.out, "render: job 41, 5 tasks; join: job 42\n");
    assert!(read(d, &format!("job/output/{film}")) == whole);
    let options = String::from_utf8(read(d, "job/options.txt")).unwrap();
    assert!(options.contains("--partition=long") && options.contains("--parsable"), "{options}");
    // A task that runs again makes nothing anew, and a job in a folder with segments is not written over.
    let run = finished(slurm(d, SBATCH));
    assert_eq!(run.code, 0, "{}", run.err);
    std::fs::create_dir(d.join("scene")).unwrap();
    std::fs::write(d.join("scene/s.rhai"), "stage(#{ length: 0.1 });").unwrap();
    let again = choreo(d, &["farm", "scene/s.rhai", "-o", "a.mp4", "--for", "slurm", "--to", "job"]);
    assert_eq!(again.code, 3);
    assert!(
        again.err.starts_with("--to job: a job has run there: job/segments is not empty"),
        "{}",
        again.err
    );
}

/// Chunks that are measured cover the film, and state what was measured.
#[test]
fn measured_chunks_cover_the_film() {
    let dir = scene();
    let d = dir.path();
    for engine in ["openjd", "slurm"] {
        let summary = job(d, engine, "film.mp4", &["--size", "160x90"]);
        let chunks: Vec<[u64; 2]> = serde_json::from_value(summary["chunks"].clone()).unwrap();
        let mut next = 0;
        for [first, last] in &chunks {
            assert!(*first == next && last >= first, "{chunks:?}");
            next = last + 1;
        }
        assert_eq!(next, 60, "{chunks:?}");
        assert!(summary["start_seconds"].as_f64().unwrap() > 0.0);
        assert!(summary["frame_seconds"].as_f64().unwrap() > 0.0);
        std::fs::remove_dir_all(d.join("job")).unwrap();
    }
    // 360 frames: no chunk is longer than AWS Deadline Cloud takes.
    let summary = job(d, "openjd", "film.mp4", &["--fps", "240", "--chunk", "400"]);
    assert_eq!(summary["chunks"].as_array().unwrap().len(), 4);
}

#[test]
fn jobs_that_cannot_run_are_refused() {
    let dir = scene();
    let d = dir.path();
    for (film, what) in [
        ("../film.mp4", "the film is written to the folder output of the job"),
        ("/film.mp4", "the film is written to the folder output of the job"),
        ("-", "the film is written to the folder output of the job"),
        ("{{Param.Choreo}}.mp4", "two braces are an expression of the job's template"),
        ("film.xyz", "the name's extension says the format"),
        ("film.png", "holds one image and the scene has 60 frames"),
    ] {
        let run = choreo(d, &["farm", "scene/it's.rhai", "-o", film, "--for", "openjd", "--to", "job"]);
        assert!(run.code == 2 && run.err.contains(what), "{film}: {}", run.err);
    }
    let run = choreo(d, &["farm", "none.rhai", "-o", "a.mp4", "--for", "slurm", "--to", "job"]);
    assert_eq!((run.code, run.err.as_str()), (1, "none.rhai: no such file\n"));
}
