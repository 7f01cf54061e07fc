//! Changes of files that count, however they come about.

use choreo_session::{Watch, WatchEvent, WatchedPaths};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Ends at once where something has changed.
const SOON: Option<Duration> = Some(Duration::from_secs(300));
const NOTHING: Option<Duration> = Some(Duration::from_millis(300));

fn hash(bytes: &[u8]) -> Option<[u8; 32]> {
    Some(*blake3::hash(bytes).as_bytes())
}

fn files(files: &[(&Path, Option<[u8; 32]>)]) -> WatchedPaths {
    let files = files.iter().map(|(path, hash)| (path.to_path_buf(), *hash)).collect();
    WatchedPaths { files, ..WatchedPaths::default() }
}

/// A file with "0" in it that is waited for.
fn watching(file: &Path) -> Watch {
    fs::write(file, "0").unwrap();
    let mut watch = Watch::new().unwrap();
    watch.set(files(&[(file, hash(b"0"))]));
    watch
}

fn changed(paths: &[&Path]) -> WatchEvent {
    WatchEvent::Changed(paths.iter().map(|p| p.to_path_buf()).collect())
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().canonicalize().unwrap().join(name)
    }
}

#[test]
fn each_way_to_save_a_file_is_one_change() {
    let folder = Folder::new();
    let (file, other) = (folder.at("a.rhai"), folder.at("elsewhere/a.rhai"));
    fs::create_dir(folder.at("elsewhere")).unwrap();
    let mut watch = watching(&file);
    let ways: [(&str, &dyn Fn()); 4] = [
        ("in place", &|| fs::write(&file, "1").unwrap()),
        ("renamed over", &|| {
            fs::write(folder.at(".a.swp"), "2").unwrap();
            fs::rename(folder.at(".a.swp"), &file).unwrap();
        }),
        ("moved in from elsewhere", &|| {
            fs::write(&other, "3").unwrap();
            fs::rename(&other, &file).unwrap();
        }),
        ("the old one moved away first", &|| {
            fs::rename(&file, folder.at("a.rhai~")).unwrap();
            fs::write(&file, "4").unwrap();
        }),
    ];
    for (how, save) in ways {
        save();
        assert_eq!(watch.wait(SOON).unwrap(), changed(&[&file]), "{how}");
        assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut, "{how}: told once");
    }
}

#[test]
fn the_same_bytes_and_other_files_are_no_change() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    let mut watch = watching(&file);
    fs::write(&file, "0").unwrap();
    fs::write(folder.at("b.rhai"), "1").unwrap();
    fs::read(&file).unwrap();
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut);
    // A real change is still seen after that.
    fs::write(&file, "1").unwrap();
    assert_eq!(watch.wait(SOON).unwrap(), changed(&[&file]));
}

#[test]
fn what_changed_before_it_was_waited_for_is_told() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    fs::write(&file, "1").unwrap();
    let mut watch = Watch::new().unwrap();
    // Read as "0", written since.
    watch.set(files(&[(&file, hash(b"0"))]));
    assert_eq!(watch.wait(SOON).unwrap(), changed(&[&file]));
}

#[test]
fn what_changed_in_a_watched_folder_before_it_was_of_interest_is_told() {
    let folder = Folder::new();
    let (file, other) = (folder.at("a.rhai"), folder.at("b.glb"));
    let mut watch = watching(&file);
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut);
    // The version that loads it has read "1"; by the time it is waited for, it is "2".
    fs::write(&other, "2").unwrap();
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut);
    watch.set(files(&[(&file, hash(b"0")), (&other, hash(b"1"))]));
    assert_eq!(watch.wait(SOON).unwrap(), changed(&[&other]));
    watch.set(files(&[(&file, hash(b"0")), (&other, hash(b"2"))]));
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut);
}

#[test]
fn a_file_in_a_folder_that_is_not_there_is_waited_for() {
    let folder = Folder::new();
    let file = folder.at("assets/deep/hero.obj");
    let mut watch = Watch::new().unwrap();
    watch.set(files(&[(&file, None)]));
    fs::create_dir_all(folder.at("assets/deep")).unwrap();
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut, "the file is not there yet");
    fs::write(&file, "v 0 0 0").unwrap();
    assert_eq!(watch.wait(SOON).unwrap(), changed(&[&file]));
    // And again after the whole folder was put in another's place.
    fs::create_dir_all(folder.at("new/deep")).unwrap();
    fs::write(folder.at("new/deep/hero.obj"), "v 1 1 1").unwrap();
    fs::rename(folder.at("assets"), folder.at("old")).unwrap();
    fs::rename(folder.at("new"), folder.at("assets")).unwrap();
    assert_eq!(watch.wait(SOON).unwrap(), changed(&[&file]));
    fs::write(&file, "v 2 2 2").unwrap();
    assert_eq!(watch.wait(SOON).unwrap(), changed(&[&file]), "the new folder is watched");
}

#[test]
fn a_file_taken_away_is_a_change_and_so_is_its_return() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    let mut watch = watching(&file);
    fs::remove_file(&file).unwrap();
    assert_eq!(watch.wait(SOON).unwrap(), changed(&[&file]));
    fs::write(&file, "0").unwrap();
    assert_eq!(watch.wait(SOON).unwrap(), changed(&[&file]));
}

#[test]
fn a_new_file_in_a_folder_of_interest_counts_by_its_ending() {
    let folder = Folder::new();
    let mut watch = Watch::new().unwrap();
    let folders = BTreeSet::from([(folder.at("plugins"), ".wgsl".to_string())]);
    watch.set(WatchedPaths { folders, ..WatchedPaths::default() });
    fs::create_dir(folder.at("plugins")).unwrap();
    fs::write(folder.at("plugins/readme.md"), "x").unwrap();
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut);
    fs::write(folder.at("plugins/glow.wgsl"), "x").unwrap();
    assert_eq!(watch.wait(SOON).unwrap(), changed(&[&folder.at("plugins/glow.wgsl")]));
}

#[test]
fn a_waker_ends_the_wait_and_loses_no_change() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    let mut watch = watching(&file);
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut);
    fs::write(&file, "1").unwrap();
    watch.waker().wake();
    let mut seen = Vec::new();
    while seen.len() < 2 {
        seen.push(watch.wait(SOON).unwrap());
    }
    assert!(seen.contains(&WatchEvent::Woken) && seen.contains(&changed(&[&file])), "{seen:?}");
}

/// Each wait is over before whoever writes can be known to be done.
#[test]
fn waits_that_are_too_short_lose_no_change() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    let mut watch = watching(&file);
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut);
    for round in 1..6 {
        fs::write(&file, round.to_string()).unwrap();
        let end = Instant::now() + Duration::from_secs(300);
        let report = loop {
            match watch.wait(Some(Duration::from_millis(1))).unwrap() {
                WatchEvent::TimedOut if Instant::now() < end => {}
                report => break report,
            }
        };
        assert_eq!(report, changed(&[&file]), "{round}");
    }
}

#[test]
fn a_tree_s_new_folders_are_watched_and_what_is_passed_over_is_not() {
    let folder = Folder::new();
    fs::create_dir_all(folder.at("suite/a")).unwrap();
    fs::write(folder.at("suite/a/old.rhai"), "0").unwrap();
    let mut watch = Watch::new().unwrap();
    let trees = BTreeSet::from([(folder.at("suite"), ".rhai".to_string())]);
    watch.set(WatchedPaths { trees, ..WatchedPaths::default() });
    assert_eq!(watch.existing_files(), BTreeSet::from([folder.at("suite/a/old.rhai")]));
    watch.set_known_content(folder.at("suite/a/old.rhai"), hash(b"0"));
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut);
    // A folder in a new folder, with its file at once or later.
    for (name, pause) in [("suite/b/c", 0), ("suite/d/e", 150)] {
        fs::create_dir_all(folder.at(name)).unwrap();
        std::thread::sleep(Duration::from_millis(pause));
        let file = folder.at(name).join("new.rhai");
        fs::write(&file, "1").unwrap();
        assert_eq!(watch.wait(SOON).unwrap(), changed(&[&file]));
    }
    for name in ["suite/target", "suite/.hidden"] {
        fs::create_dir_all(folder.at(name)).unwrap();
        fs::write(folder.at(name).join("new.rhai"), "1").unwrap();
    }
    fs::write(folder.at("suite/a/new.txt"), "1").unwrap();
    assert_eq!(watch.wait(NOTHING).unwrap(), WatchEvent::TimedOut);
}
