//! Jobs for render farms: a job runs with the runner of the engine, and its film has the same bytes as from one machine.
#![cfg(unix)]

use crate::common::*;
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

/// Options with which an MP4 has groups of 24 frames.
const OPTIONS: &[&str] = &["--samples", "1", "--export", "keyframes=0.8", "--set", "color=#20c040"];

fn scene() -> tempfile::TempDir {
    let dir = folder_with_triangle();
    std::fs::create_dir(dir.path().join("scene")).unwrap();
    std::fs::rename(dir.path().join("tri.gltf"), dir.path().join("scene/tri.gltf")).unwrap();
    std::fs::write(dir.path().join("scene/it's.rhai"), SCRIPT).unwrap();
    dir
}

/// Writes the job into the folder `job`, and returns its summary.
fn make_job(folder: &Path, engine: &str, film: &str, more: &[&str]) -> serde_json::Value {
    let mut args = vec!["farm", "scene/it's.rhai", "-o", film, "--for", engine, "--to", "job", "--json"];
    let of_mp4 = |option: &&&str| film.ends_with(".mp4") || !["--export", "keyframes=0.8"].contains(*option);
    args.extend(OPTIONS.iter().filter(of_mp4));
    args.extend(more);
    let run = choreo(folder, &args);
    assert_eq!(run.code, 0, "{}", run.err);
    serde_json::from_str(&run.out).unwrap()
}

/// The film rendered on one machine. Removes the script and its files, so that the job can only use its own copies.
fn render_on_one_machine(folder: &Path) -> Vec<u8> {
    let mut args = vec!["render", "scene/it's.rhai", "-o", "one.mp4", "--device", "cpu"];
    args.extend(OPTIONS);
    let run = choreo(folder, &args);
    assert_eq!(run.code, 0, "{}", run.err);
    std::fs::remove_dir_all(folder.join("scene")).unwrap();
    read_file(folder, "one.mp4")
}

/// Runs `openjd` with these arguments in its own virtual environment.
fn run_openjd(args: &[&str]) -> Option<Run> {
    let python = python_with("openjd.cli", "openjd-cli==0.8.0")?;
    let program = python.with_file_name("openjd");
    let run = Command::new(program).args(args).output().unwrap();
    Some(run_result(run))
}

#[test]
fn openjd_runs_the_whole_job() {
    let dir = scene();
    let d = dir.path();
    let film = "it's a {film}.mp4";
    let summary = make_job(d, "openjd", film, &["--chunk", "25"]);
    assert_eq!(summary["chunks"], serde_json::json!([[0, 24], [25, 49], [50, 59]]));
    assert_eq!(
        file_names(&d.join("job")),
        ["film.choreo", "job.json", "output", "segments", "template.json"]
    );
    let expected = render_on_one_machine(d);
    let template = d.join("job/template.json").display().to_string();
    let Some(check) = run_openjd(&["check", &template, "--extensions", "TASK_CHUNKING"]) else { return };
    assert_eq!(check.code, 0, "{}{}", check.out, check.err);
    let choreo = format!("Choreo={}", env!("CARGO_BIN_EXE_choreo"));
    let run = ["run", &template, "--step", "Join", "--run-dependencies", "-p", &choreo];
    let run = run_openjd(&[&run[..], &["--extensions", "TASK_CHUNKING"]].concat()).unwrap();
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    assert!(file_names(&d.join("job/segments")).len() >= 3, "{:?}", file_names(&d.join("job/segments")));
    assert_eq!(file_names(&d.join("job/output")).len(), 1);
    assert!(read_file(d, &format!("job/output/{film}")) == expected);
}

/// Writes a substitute for sbatch, which runs the tasks of an array one after the other, the last one first, and a dependent job after its
/// array. `cargo xtask farm` runs the real one.
const SBATCH: &str = r#"#!/bin/sh
script= first= last= after=
for argument; do
    case "$argument" in
        --array=*) range=${argument#--array=}; first=${range%-*}; last=${range#*-} ;;
        --dependency=after*) after=${argument##*:} ;;
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

fn submit_to_slurm(folder: &Path, sbatch: &str) -> std::process::Output {
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
    let summary = make_job(d, "slurm", film, &["--chunk", "14"]);
    assert_eq!(summary["chunks"].as_array().unwrap().len(), 5);
    assert_eq!(
        file_names(&d.join("job")),
        ["chunks.txt", "film.choreo", "job.json", "join.sh", "output", "render.sh", "segments", "submit.sh"]
    );
    assert_eq!(read_file(d, "job/chunks.txt"), b"0-13\n14-27\n28-41\n42-55\n56-59\n");
    let expected = render_on_one_machine(d);
    let run = run_result(submit_to_slurm(d, SBATCH));
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(run.out, "render: job 41, 5 tasks; join: job 42\n");
    assert!(read_file(d, &format!("job/output/{film}")) == expected);
    let options = String::from_utf8(read_file(d, "job/options.txt")).unwrap();
    assert!(options.contains("--partition=long") && options.contains("--parsable"), "{options}");
    // A task that runs again renders nothing again, and a job in a folder with segments is not overwritten.
    let run = run_result(submit_to_slurm(d, SBATCH));
    assert_eq!(run.code, 0, "{}", run.err);
    std::fs::create_dir(d.join("scene")).unwrap();
    std::fs::write(d.join("scene/s.rhai"), "stage(#{ length: 0.1 });").unwrap();
    let run = choreo(d, &["farm", "scene/s.rhai", "-o", "a.mp4", "--for", "slurm", "--to", "job"]);
    assert_eq!(run.code, 3);
    assert!(
        run.err.starts_with("--to job: a job has already run there: job/segments is not empty"),
        "{}",
        run.err
    );
}

/// Chunks whose length is measured cover the film, and the job states the measured values.
#[test]
fn measured_chunks_cover_the_film() {
    let dir = scene();
    let d = dir.path();
    for engine in ["openjd", "slurm"] {
        let summary = make_job(d, engine, "film.mp4", &["--size", "160x90"]);
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
    // 360 frames: no chunk is longer than AWS Deadline Cloud accepts.
    let summary = make_job(d, "openjd", "film.mp4", &["--fps", "240", "--chunk", "400"]);
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
        ("{{Param.Choreo}}.mp4", "two braces mark an expression in the job's template"),
        ("film.xyz", "the file extension selects the format"),
        ("film.png", "holds one image and the scene has 60 frames"),
    ] {
        let run = choreo(d, &["farm", "scene/it's.rhai", "-o", film, "--for", "openjd", "--to", "job"]);
        assert!(run.code == 2 && run.err.contains(what), "{film}: {}", run.err);
    }
    let run = choreo(d, &["farm", "none.rhai", "-o", "a.mp4", "--for", "slurm", "--to", "job"]);
    assert_eq!((run.code, run.err.as_str()), (1, "none.rhai: no such file\n"));
}

/// The preview has every eighth frame of the film, drawn at half the size.
#[test]
fn a_preview_has_every_eighth_frame_at_half_the_size() {
    let dir = scene();
    let d = dir.path();
    let render = |size: &str, more: &[&str]| {
        let args = ["render", "scene/it's.rhai", "--device", "cpu", "--samples", "1", "--size", size];
        let run = choreo(d, &[&args[..], &["--set", "color=#20c040"], more].concat());
        assert_eq!(run.code, 0, "{}", run.err);
    };
    render("32x18", &["--frames", "0..60:8", "-o", "every/%04d.png"]);
    render("64x36", &["--frames", "0..60:8", "-o", "large/%04d.png"]);
    let summary = make_job(d, "slurm", "film/%02d.png", &["--chunk", "14", "--preview", "1/8"]);
    assert_eq!(summary["films"][0]["output"], "preview/film/%02d.png");
    let run = run_result(submit_to_slurm(d, SBATCH));
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(
        run.out.starts_with("preview render: job 41, 1 task; preview join: job 42\nrender: "),
        "{}",
        run.out
    );
    let pixels = |name: String| image::open(d.join(name)).unwrap().to_rgba8();
    let preview = file_names(&d.join("job/output/preview/film"));
    assert_eq!(preview.len(), 8);
    for (k, name) in preview.iter().enumerate() {
        let small = pixels(format!("job/output/preview/film/{name}"));
        assert!(small == pixels(format!("every/{:04}.png", 8 * k)), "{name}");
        assert!(
            pixels(format!("job/output/film/{:02}.png", 8 * k)) == pixels(format!("large/{:04}.png", 8 * k))
        );
    }
    // The frames differ, so that a wrong one would be found.
    assert!(pixels("every/0000.png".into()) != pixels("every/0032.png".into()));
    std::fs::remove_dir_all(d.join("job")).unwrap();
    make_job(d, "openjd", "film.mp4", &["--chunk", "24", "--preview", "1/8"]);
    let expected = render_on_one_machine(d);
    let template = d.join("job/template.json").display().to_string();
    let choreo = format!("Choreo={}", env!("CARGO_BIN_EXE_choreo"));
    let run = ["run", &template, "--step", "Join", "--run-dependencies", "-p", &choreo];
    let Some(run) = run_openjd(&[&run[..], &["--extensions", "TASK_CHUNKING"]].concat()) else { return };
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    assert!(read_file(d, "job/output/film.mp4") == expected);
    assert!(d.join("job/output/preview/film.mp4").is_file());
}

/// One film per row, with a row that fails: the other films have the same bytes as from one machine, on both engines.
#[test]
fn a_batch_is_one_job() {
    let dir = scene();
    let d = dir.path();
    let table = "_name,color\nred one,#c04020\nbad,\"no such color\"\nblue,#2040c0\n";
    std::fs::write(d.join("rows.csv"), table).unwrap();
    for (name, color) in [("red one", "#c04020"), ("blue", "#2040c0")] {
        let (output, color) = (format!("{name}.mp4"), format!("color={color}"));
        let mut args = vec!["render", "scene/it's.rhai", "-o", &output, "--device", "cpu", "--set", &color];
        args.extend(&OPTIONS[..4]);
        assert_eq!(choreo(d, &args).code, 0);
    }
    for engine in ["slurm", "openjd"] {
        let _ = std::fs::remove_dir_all(d.join("job"));
        let mut args = vec![
            "farm",
            "scene/it's.rhai",
            "-o",
            "{_dir}/{_name}.mp4",
            "--for",
            engine,
            "--to",
            "job",
            "--chunk",
            "25",
        ];
        args.extend(&OPTIONS[..4]);
        args.extend(["--set-from", "rows.csv", "--json"]);
        let run = choreo(d, &args);
        assert!(run.code == 1 && run.err.contains("row 1 has no value for {_dir}"), "{}", run.err);
        args[3] = "films/{row} {_name}.mp4";
        let run = choreo(d, &args);
        assert_eq!((run.code, run.err.lines().last()), (1, Some("1 of 3 rows failed: 2")), "{}", run.err);
        let summary: serde_json::Value = serde_json::from_str(&run.out).unwrap();
        assert_eq!(summary["films"].as_array().unwrap().len(), 2);
        assert_eq!(summary["films"][1]["output"], "films/3 blue.mp4");
        assert_eq!(summary["failed_rows"][0]["row"], 2);
        let run = match engine {
            "slurm" => run_result(submit_to_slurm(d, SBATCH)),
            _ => {
                let template = d.join("job/template.json").display().to_string();
                let choreo = format!("Choreo={}", env!("CARGO_BIN_EXE_choreo"));
                match run_openjd(&["run", &template, "--step", "Join", "--run-dependencies", "-p", &choreo]) {
                    Some(run) => run,
                    None => return,
                }
            }
        };
        assert_eq!(run.code, 0, "{engine}: {}{}", run.out, run.err);
        assert_eq!(file_names(&d.join("job/output/films")), ["1 red one.mp4", "3 blue.mp4"]);
        assert!(read_file(d, "job/output/films/1 red one.mp4") == read_file(d, "red one.mp4"), "{engine}");
        assert!(read_file(d, "job/output/films/3 blue.mp4") == read_file(d, "blue.mp4"), "{engine}");
    }
}

/// The lines of the guide for machines without a scheduler, with an `ssh` that runs each command on this machine and a machine that fails
/// the first time.
#[test]
fn the_guide_commands_for_machines_without_a_scheduler_render_the_film() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/guide/src/recipes/render_farm.md");
    let page = std::fs::read_to_string(page).unwrap();
    let section = page.split("## Machines without a scheduler").nth(1).unwrap();
    let lines = section.split("```sh\n").nth(1).unwrap().split("```").next().unwrap();
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::write(d.join("film.rhai"), SCRIPT).unwrap();
    std::fs::write(d.join("hosts.txt"), "ann\nben\ncleo\n").unwrap();
    std::fs::write(d.join("choreo.toml"), "[render]\nsamples = 1\n").unwrap();
    let bin = d.join("bin");
    std::fs::create_dir(&bin).unwrap();
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_choreo"), bin.join("choreo")).unwrap();
    let ssh = "#!/bin/sh\n[ \"$1\" = -n ] || exit 9\necho \"$2\" >> \"$HOSTS\"\n[ \"$2\" = \"$DEAD\" ] && exit 255\ncd / && exec sh -c \"$3\"\n";
    std::fs::write(bin.join("ssh"), ssh).unwrap();
    std::fs::set_permissions(bin.join("ssh"), std::fs::Permissions::from_mode(0o755)).unwrap();
    // Chunks of a known length instead of a measured one.
    let lines = lines.replace("--to job", "--to job --chunk 7 --samples 1");
    // The missing segments will not appear.
    let lines = lines.replace("sh job/join.sh", "sed -i 's/--wait 60//' job/join.sh && sh job/join.sh");
    let run = |lines: &str, dead: &str| {
        let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap_or_default());
        let mut shell = Command::new("sh");
        shell.args(["-c", lines]).current_dir(d).env("PATH", path).env("CHOREO_PLUGINS", "");
        shell.env_remove("SLURM_JOB_ID");
        run_result(shell.env("HOSTS", d.join("used.txt")).env("DEAD", dead).output().unwrap())
    };
    let first = run(&lines, "ben");
    assert!(
        first.code == 1 && first.err.contains("these are missing: 7..=13, 28..=34, 49..=55"),
        "{}",
        first.err
    );
    let again = run(lines.split_once('\n').unwrap().1, "nobody");
    assert_eq!(again.code, 0, "{}", again.err);
    let mut used: Vec<String> =
        String::from_utf8(read_file(d, "used.txt")).unwrap().lines().map(str::to_string).collect();
    used.sort();
    assert_eq!(used, ["ann", "ann", "ben", "ben", "cleo", "cleo"]);
    let one = ["render", "film.rhai", "-o", "one.mp4", "--device", "cpu", "--samples", "1"];
    assert_eq!(choreo(d, &one).code, 0);
    assert!(read_file(d, "one.mp4") == read_file(d, "job/output/film.mp4"));
}
