//! Killed renders that are resumed give the same bytes as an uninterrupted render, and draw no finished frame again.
#![cfg(unix)]

use crate::common::*;
use serde_json::Value;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// 40 frames in two segments of an MP4, drawn on the CPU, slow enough for a kill between frames.
const SMALL: &[&str] = &["--device", "cpu", "--size", "64x36", "--samples", "1", "--export", "keyframes=0.8"];
const FRAMES: usize = 40;

fn args<'a>(output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let mut args = vec!["render", "s.rhai", "-o", output, "--jobs", "1", "--json"];
    args.extend(&SMALL[..if output.ends_with(".mp4") { SMALL.len() } else { 6 }]);
    args.extend(more);
    args
}

/// A moving scene with a callback, which takes a while to render.
fn scene() -> tempfile::TempDir {
    let dir = folder_with_triangle();
    let script = "stage(#{ fps: 30, length: 4.0 / 3.0 });\n\
                  let m = load(\"choreo:mannequin\");\n\
                  let a = cast(\"a\", m);\n\
                  a.play(m.clip(\"Dance_Groove\"));\n\
                  cast(\"b\", load(\"tri.gltf\")).at(1, 0, 0);\n\
                  camera(\"c\").at(0.0, 1.2, 4.0).look_at([0.0, 1.0, 0.0]);\n\
                  on_frame(|t| { a.at(t * 0.1, 0, 0); });";
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    dir
}

/// A pseudorandom generator with a fixed seed (Marsaglia's xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n as u64) as usize
    }
}

fn start(folder: &Path, output: &str, more: &[&str]) -> Child {
    command(folder, &args(output, more)).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Kills a render after at least `enough` frames are finished, with a random delay. The render may have ended before.
fn kill_after(folder: &Path, output: &str, more: &[&str], enough: usize, random: &mut Random) {
    let mut child = start(folder, output, more);
    let begun = Instant::now();
    while finished_frames(folder, output) < enough && child.try_wait().unwrap().is_none() {
        assert!(begun.elapsed() < Duration::from_secs(600), "{output}: no {enough} frames after ten minutes");
        std::thread::sleep(Duration::from_micros(200));
    }
    std::thread::sleep(Duration::from_micros(random.below(8000) as u64));
    // This sends SIGKILL, so that the program cannot clean up.
    child.kill().unwrap();
    child.wait().unwrap();
}

/// The number of finished frames of a render, counted without the program: complete images, or records of the journal.
fn finished_frames(folder: &Path, output: &str) -> usize {
    if let Some((folder_name, _)) = output.split_once('/') {
        let Ok(entries) = std::fs::read_dir(folder.join(folder_name)) else { return 0 };
        return entries.flatten().filter(|e| e.path().extension().is_some_and(|x| x == "png")).count();
    }
    let bytes = std::fs::read(folder.join(format!("{output}.part/journal"))).unwrap_or_default();
    let mut rest = bytes.strip_prefix(b"choreo journal 1\n").unwrap_or_default();
    let mut records = 0;
    while let Some((length, more)) = rest.split_first_chunk::<4>() {
        let Some(more) = more.get(4 + u32::from_le_bytes(*length) as usize..) else { break };
        rest = more;
        records += 1;
    }
    // The first record describes the render.
    usize::saturating_sub(records, 1)
}

/// Resumes a killed render, and returns the numbers of frames drawn and reused.
fn resume(folder: &Path, output: &str) -> (usize, usize) {
    let run = choreo(folder, &args(output, &["--resume"]));
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    let value: Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(value["frames"], FRAMES);
    let number = |name: &str| value[name].as_u64().unwrap() as usize;
    (number("drawn"), number("reused"))
}

/// All files of the output folder, by name.
fn all_bytes(folder: &Path, output: &str) -> Vec<(String, Vec<u8>)> {
    match output.split_once('/') {
        None => vec![(output.to_string(), read_file(folder, output))],
        Some((inner, _)) => {
            let inner = folder.join(inner);
            file_names(&inner).into_iter().map(|name| (name.clone(), read_file(&inner, &name))).collect()
        }
    }
}

fn clear(folder: &Path, output: &str) {
    let _ = std::fs::remove_dir_all(folder.join(output.split('/').next().unwrap()));
    let _ = std::fs::remove_file(folder.join(output));
}

/// Kills each render `kills` times, and resumes it after each kill: no finished frame is drawn again, and the result is that of an
/// uninterrupted render. On a busy machine a render may end before it is killed. Renders are then added until most of the
/// `renders * kills` kills were between frames.
fn assert_resumes_after_kills(output: &str, renders: usize, kills: usize, seed: u64) {
    let dir = scene();
    let d = dir.path();
    let mut random = Random(seed);
    let run = choreo(d, &args(output, &[]));
    assert_eq!(run.code, 0, "{}", run.err);
    let uninterrupted = all_bytes(d, output);
    let mut kills_between_frames = 0;
    for render in 0.. {
        if render >= renders && kills_between_frames * 2 > renders * kills {
            break;
        }
        assert!(
            render < renders * 20,
            "only {kills_between_frames} kills of {render} renders were between frames"
        );
        clear(d, output);
        let mut frame_counts: Vec<usize> = (0..kills).map(|_| random.below(FRAMES - 2)).collect();
        frame_counts.sort_unstable();
        let mut seen = 0;
        for (kill, enough) in frame_counts.iter().enumerate() {
            let more: &[&str] = if kill == 0 { &[] } else { &["--resume"] };
            kill_after(d, output, more, *enough, &mut random);
            if !output.contains('/') && d.join(output).exists() {
                // The render ended before the kill.
                break;
            }
            let finished = finished_frames(d, output);
            assert!(finished >= seen, "{output}: {finished} frames after {seen}, render {render}");
            kills_between_frames += usize::from(finished < FRAMES);
            seen = finished;
        }
        let ended = !output.contains('/') && d.join(output).exists();
        if !ended || d.join(format!("{output}.part")).exists() {
            let finished = if ended { FRAMES } else { seen };
            let (drawn, reused) = resume(d, output);
            assert_eq!((drawn, reused), (FRAMES - finished, finished), "{output}: render {render}");
        }
        let now = all_bytes(d, output);
        assert_eq!(
            now.iter().map(|(n, _)| n).collect::<Vec<_>>(),
            uninterrupted.iter().map(|(n, _)| n).collect::<Vec<_>>()
        );
        assert!(
            now == uninterrupted,
            "{output}: other bytes, render {render}, killed after {frame_counts:?} frames"
        );
        assert_eq!(part_files(d), Vec::<String>::new());
    }
}

#[test]
fn a_killed_image_sequence_resumes() {
    assert_resumes_after_kills("f/%04d.png", 5, 4, 11);
}

#[test]
fn a_killed_mp4_resumes() {
    assert_resumes_after_kills("o.mp4", 5, 4, 12);
}

#[test]
fn killed_gifs_and_y4m_streams_resume() {
    assert_resumes_after_kills("o.gif", 2, 3, 13);
    assert_resumes_after_kills("o.y4m", 2, 3, 14);
}

/// Kills a render between its frames, so that its part folder remains. Returns the number of finished frames.
fn kill_render_midway(d: &Path, output: &str) -> usize {
    for _ in 0..200 {
        clear(d, output);
        let mut child = start(d, output, &[]);
        while finished_frames(d, output) < 30 && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_micros(200));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        if !d.join(output).exists() {
            return finished_frames(d, output);
        }
    }
    panic!("{output}: every render ended before it could be killed");
}

fn copy_folder(from: &Path, to: &Path) {
    let _ = std::fs::remove_dir_all(to);
    std::fs::create_dir(to).unwrap();
    for name in file_names(from) {
        std::fs::copy(from.join(&name), to.join(&name)).unwrap();
    }
}

/// If files of the part are truncated or changed anywhere, intact frames are used, the others are drawn again, and the bytes are the same.
#[test]
fn undamaged_frames_of_a_damaged_part_are_reused() {
    let dir = scene();
    let d = dir.path();
    let mut random = Random(16);
    for output in ["o.mp4", "o.gif"] {
        assert_eq!(choreo(d, &args(output, &[])).code, 0);
        let uninterrupted = read_file(d, output);
        let finished = kill_render_midway(d, output);
        let (part, saved) = (d.join(format!("{output}.part")), d.join("saved"));
        copy_folder(&part, &saved);
        let mut damaged = 0;
        for name in file_names(&saved) {
            for flip_bit in [false, true, true] {
                copy_folder(&saved, &part);
                let mut bytes = read_file(&saved, &name);
                let at = random.below(bytes.len());
                if flip_bit {
                    bytes[at] ^= 1 << random.below(8);
                } else {
                    bytes.truncate(at);
                }
                std::fs::write(part.join(&name), bytes).unwrap();
                let (drawn, reused) = resume(d, output);
                assert!(drawn + reused == FRAMES && reused <= finished, "{name} {drawn} {reused}");
                damaged += usize::from(reused < finished);
                assert!(read_file(d, output) == uninterrupted, "{output}: {name} damaged at {at}");
            }
        }
        assert!(damaged > 0, "{output}: the damage affected no frame");
    }
}

/// The message names the difference, and no file is changed.
#[test]
fn resuming_a_render_with_other_settings_is_refused() {
    let dir = scene();
    let d = dir.path();
    kill_render_midway(d, "o.mp4");
    let before = read_file(&d.join("o.mp4.part"), "journal");
    let script = std::fs::read_to_string(d.join("s.rhai")).unwrap();
    let refused = |more: &[&str], expected: &[&str]| {
        let run = choreo(d, &args("o.mp4", &[&["--resume"], more].concat()));
        assert_eq!(run.code, 3, "{}", run.err);
        let head = "o.mp4: --resume cannot go on with ";
        assert!(
            run.err.contains(head) && run.err.contains("o.mp4.part: it was made with other settings"),
            "{}",
            run.err
        );
        for words in expected {
            assert!(run.err.contains(words), "no \"{words}\" in {}", run.err);
        }
        assert!(run.err.contains("leave --resume out to render everything again"), "{}", run.err);
        assert!(read_file(&d.join("o.mp4.part"), "journal") == before);
    };
    refused(&["--frames", "1..30"], &["frames: 0..=39, now 1..=29"]);
    refused(&["--export", "quality=9"], &["arguments: --size 64x36", "quality=9"]);
    std::fs::write(d.join("s.rhai"), script.replace("1.2", "1.3")).unwrap();
    refused(&[], &["script: ", "stage: "]);
    std::fs::write(d.join("s.rhai"), format!("{script} // edited")).unwrap();
    refused(&[], &["script: "]);
    std::fs::write(d.join("s.rhai"), &script).unwrap();
    // With numbered images, an image of a different frame is not reused.
    assert_eq!(choreo(d, &args("f/%d.png", &["--frames", "0..4"])).code, 0);
    std::fs::copy(d.join("f/1.png"), d.join("f/2.png")).unwrap();
    let run = choreo(d, &args("f/%d.png", &["--frames", "0..4", "--resume"]));
    assert_eq!(run.code, 3);
    assert!(run.err.contains("f/2.png: it was made with other settings\n    time: 0.0333"), "{}", run.err);
    // A truncated image and a missing image are drawn again.
    std::fs::write(d.join("f/2.png"), &read_file(d, "f/1.png")[..200]).unwrap();
    std::fs::remove_file(d.join("f/3.png")).unwrap();
    let run = choreo(d, &args("f/%d.png", &["--frames", "0..4", "--resume"]));
    let value: Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!((&value["drawn"], &value["reused"]), (&2.into(), &2.into()));
}

/// Ends a render with a signal after five frames are finished, and returns its output. `None` if the render ended before the signal.
fn interrupt_render(d: &Path, name: &str, more: &[&str]) -> Option<Run> {
    let loud: Vec<&str> = args("o.mp4", more).into_iter().filter(|a| *a != "--json").collect();
    let mut child = command(d, &loud).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    while finished_frames(d, "o.mp4") < 5 && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_micros(200));
    }
    let sent = std::process::Command::new("kill").args([name, &child.id().to_string()]).status();
    assert!(sent.unwrap().success());
    let run = run_result(child.wait_with_output().unwrap());
    if run.code == 0 {
        std::fs::remove_file(d.join("o.mp4")).unwrap();
        return None;
    }
    assert_eq!((run.code, run.err.lines().last()), (130, Some("interrupted")), "{}", run.err);
    assert!(!d.join("o.mp4").exists());
    Some(run)
}

/// Runs the command line at the end of a message in a shell.
fn run_in_shell(d: &Path, command: &str) -> Run {
    let mut shell = std::process::Command::new("sh");
    run_result(shell.args(["-c", command]).current_dir(d).stdin(Stdio::null()).output().unwrap())
}

#[test]
fn an_interrupted_render_prints_the_command_that_resumes_it() {
    let dir = scene();
    let d = dir.path();
    assert_eq!(resume(d, "o.mp4"), (FRAMES, 0), "with nothing there it renders");
    let uninterrupted = read_file(d, "o.mp4");
    std::fs::remove_file(d.join("o.mp4")).unwrap();
    let mut ended = 0;
    for (name, more) in [("-INT", &[][..]), ("-TERM", &["--quiet"]), ("-HUP", &[]), ("-INT", &["--resume"])] {
        let Some(run) = interrupt_render(d, name, more) else { continue };
        ended += 1;
        let finished = finished_frames(d, "o.mp4");
        let prefix = format!("{finished} frames are kept in o.mp4.part; to resume the render: ");
        let line = run.err.lines().find_map(|line| line.strip_prefix(&prefix));
        let command = line.unwrap_or_else(|| panic!("{name}: no \"{prefix}\" in {}", run.err));
        assert!(command.contains("choreo render --resume s.rhai -o o.mp4 --jobs 1"), "{command}");
        assert_eq!(command.matches("--resume").count(), 1, "{command}");
        let run = run_in_shell(d, command);
        assert_eq!(run.code, 0, "{command}: {}", run.err);
        assert!(
            more.contains(&"--quiet") || run.err.contains(&format!("{finished} of them finished before")),
            "{}",
            run.err
        );
        assert!(read_file(d, "o.mp4") == uninterrupted && part_files(d).is_empty());
        std::fs::remove_file(d.join("o.mp4")).unwrap();
    }
    assert!(ended > 0, "every render ended before the signal");
    // With --discard nothing is kept.
    if let Some(run) = interrupt_render(d, "-INT", &["--discard"]) {
        assert!(!run.err.contains("kept") && part_files(d).is_empty(), "{}", run.err);
    }
    let run = choreo(d, &["render", "s.rhai", "-o", "-", "--resume"]);
    assert!(run.code == 2 && run.err.contains("standard output cannot be resumed"), "{}", run.err);
}

/// Finished frames of the same render are deleted only with --discard; those of a different render are deleted without it.
#[test]
fn a_resumable_render_is_discarded_only_with_the_option() {
    let dir = scene();
    let d = dir.path();
    let plain: Vec<&str> = args("o.mp4", &[]).into_iter().filter(|a| *a != "--json").collect();
    let finished = kill_render_midway(d, "o.mp4");
    let journal = read_file(&d.join("o.mp4.part"), "journal");
    let run = choreo(d, &plain);
    let expected = format!(
        "o.mp4: {finished} frames of this same render are finished in o.mp4.part\n    hint: --resume goes \
         on with them, --discard deletes them and renders everything again\n"
    );
    assert_eq!((run.code, run.err.as_str()), (3, expected.as_str()));
    assert!(read_file(&d.join("o.mp4.part"), "journal") == journal && !d.join("o.mp4").exists());
    // The script is edited after the kill.
    let script = std::fs::read_to_string(d.join("s.rhai")).unwrap();
    std::fs::write(d.join("s.rhai"), format!("{script}\n// edited")).unwrap();
    let run = choreo(d, &plain);
    let expected = format!(
        "o.mp4: starts again from the first frame; {finished} frames of a stopped render are deleted, because these \
         settings differ: script"
    );
    assert!(run.code == 0 && run.err.contains(&expected), "{}", run.err);
    assert!(d.join("o.mp4").exists() && part_files(d).is_empty());
    // With --discard they are deleted.
    let finished = kill_render_midway(d, "o.mp4");
    let run = choreo(d, &[&plain[..], &["--discard"]].concat());
    let expected = format!(
        "o.mp4: starts again from the first frame; {finished} frames of a stopped render are deleted\n"
    );
    assert!(run.code == 0 && run.err.contains(&expected), "{}", run.err);
    assert!(d.join("o.mp4").exists() && part_files(d).is_empty());
    let run = choreo(d, &[&plain[..], &["--discard", "--resume"]].concat());
    assert_eq!(run.code, 2, "{}", run.err);
}

/// A render can be killed after the result was renamed and before its folder is removed.
#[test]
fn a_result_that_was_already_renamed_is_recognized_by_resume() {
    let dir = scene();
    let d = dir.path();
    kill_render_midway(d, "o.y4m");
    // An open journal can be read after its folder is removed.
    let part = d.join("o.y4m.part");
    let mut journal = std::fs::File::open(part.join("journal")).unwrap();
    resume(d, "o.y4m");
    let mut records = Vec::new();
    journal.read_to_end(&mut records).unwrap();
    std::fs::write(d.join("journal"), records).unwrap();
    let uninterrupted = read_file(d, "o.y4m");
    let folder_again = || {
        std::fs::create_dir(&part).unwrap();
        std::fs::copy(d.join("journal"), part.join("journal")).unwrap();
    };
    folder_again();
    assert_eq!(finished_frames(d, "o.y4m"), FRAMES);
    assert_eq!(resume(d, "o.y4m"), (0, FRAMES));
    assert!(read_file(d, "o.y4m") == uninterrupted && !part.exists());
    // A different file with the name of the result is not accepted as the result.
    folder_again();
    std::fs::write(d.join("o.y4m"), &uninterrupted[..uninterrupted.len() - 1]).unwrap();
    assert_eq!(resume(d, "o.y4m"), (FRAMES, 0));
    assert!(read_file(d, "o.y4m") == uninterrupted && !part.exists());
}
