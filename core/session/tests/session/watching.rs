//! Detection of file changes, for every method of saving.

use choreo_session::{Watch, WatchEvent, WatchedPaths};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Timeout where a change is expected: the wait ends as soon as it is reported.
const CHANGE_TIMEOUT: Option<Duration> = Some(Duration::from_secs(300));
/// Time to wait where no change is expected.
const QUIET_TIME: Option<Duration> = Some(Duration::from_millis(300));

fn hash(bytes: &[u8]) -> Option<[u8; 32]> {
    Some(*blake3::hash(bytes).as_bytes())
}

fn files(files: &[(&Path, Option<[u8; 32]>)]) -> WatchedPaths {
    let files = files.iter().map(|(path, hash)| (path.to_path_buf(), *hash)).collect();
    WatchedPaths { files, ..WatchedPaths::default() }
}

/// Writes "0" to a file and returns a watch on it.
fn watch_new_file(file: &Path) -> Watch {
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
fn each_method_of_saving_a_file_is_reported_once() {
    let folder = Folder::new();
    let (file, other) = (folder.at("a.rhai"), folder.at("elsewhere/a.rhai"));
    fs::create_dir(folder.at("elsewhere")).unwrap();
    let mut watch = watch_new_file(&file);
    let save_methods: [(&str, &dyn Fn()); 4] = [
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
    for (how, save) in save_methods {
        save();
        assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&file]), "{how}");
        assert_eq!(
            watch.wait(QUIET_TIME).unwrap(),
            WatchEvent::TimedOut,
            "{how}: the change is reported once"
        );
    }
}

#[test]
fn rewritten_equal_bytes_and_other_files_are_not_reported() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    let mut watch = watch_new_file(&file);
    fs::write(&file, "0").unwrap();
    fs::write(folder.at("b.rhai"), "1").unwrap();
    fs::read(&file).unwrap();
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut);
    // A change of the content is still reported after that.
    fs::write(&file, "1").unwrap();
    assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&file]));
}

#[test]
fn a_change_before_the_watch_began_is_reported() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    fs::write(&file, "1").unwrap();
    let mut watch = Watch::new().unwrap();
    // The file was read as "0" and has been written since.
    watch.set(files(&[(&file, hash(b"0"))]));
    assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&file]));
}

#[test]
fn a_change_before_a_file_was_added_to_the_watch_is_reported() {
    let folder = Folder::new();
    let (file, other) = (folder.at("a.rhai"), folder.at("b.glb"));
    let mut watch = watch_new_file(&file);
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut);
    // A build has read "1" from the file, which is "2" before the watch on it begins.
    fs::write(&other, "2").unwrap();
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut);
    watch.set(files(&[(&file, hash(b"0")), (&other, hash(b"1"))]));
    assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&other]));
    watch.set(files(&[(&file, hash(b"0")), (&other, hash(b"2"))]));
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut);
}

#[test]
fn a_new_file_in_a_new_or_replaced_folder_is_reported() {
    let folder = Folder::new();
    let file = folder.at("assets/deep/hero.obj");
    let mut watch = Watch::new().unwrap();
    watch.set(files(&[(&file, None)]));
    fs::create_dir_all(folder.at("assets/deep")).unwrap();
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut, "the file does not exist yet");
    fs::write(&file, "v 0 0 0").unwrap();
    assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&file]));
    // The watch also follows a folder that takes the place of the watched one.
    fs::create_dir_all(folder.at("new/deep")).unwrap();
    fs::write(folder.at("new/deep/hero.obj"), "v 1 1 1").unwrap();
    fs::rename(folder.at("assets"), folder.at("old")).unwrap();
    fs::rename(folder.at("new"), folder.at("assets")).unwrap();
    assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&file]));
    fs::write(&file, "v 2 2 2").unwrap();
    assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&file]), "the new folder is watched");
}

#[test]
fn removing_and_restoring_a_file_are_reported() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    let mut watch = watch_new_file(&file);
    fs::remove_file(&file).unwrap();
    assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&file]));
    fs::write(&file, "0").unwrap();
    assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&file]));
}

#[test]
fn new_files_of_a_watched_folder_are_filtered_by_ending() {
    let folder = Folder::new();
    let mut watch = Watch::new().unwrap();
    let folders = BTreeSet::from([(folder.at("plugins"), ".wgsl".to_string())]);
    watch.set(WatchedPaths { folders, ..WatchedPaths::default() });
    fs::create_dir(folder.at("plugins")).unwrap();
    fs::write(folder.at("plugins/readme.md"), "x").unwrap();
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut);
    fs::write(folder.at("plugins/glow.wgsl"), "x").unwrap();
    assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&folder.at("plugins/glow.wgsl")]));
}

#[test]
fn a_waker_ends_the_wait_without_losing_changes() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    let mut watch = watch_new_file(&file);
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut);
    fs::write(&file, "1").unwrap();
    watch.waker().wake();
    let mut seen = Vec::new();
    while seen.len() < 2 {
        seen.push(watch.wait(CHANGE_TIMEOUT).unwrap());
    }
    assert!(seen.contains(&WatchEvent::Woken) && seen.contains(&changed(&[&file])), "{seen:?}");
}

/// Each wait ends before the quiet time after the write has passed.
#[test]
fn timeouts_of_a_millisecond_lose_no_change() {
    let folder = Folder::new();
    let file = folder.at("a.rhai");
    let mut watch = watch_new_file(&file);
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut);
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
fn new_folders_of_a_tree_are_watched_except_hidden_ones_and_target() {
    let folder = Folder::new();
    fs::create_dir_all(folder.at("suite/a")).unwrap();
    fs::write(folder.at("suite/a/old.rhai"), "0").unwrap();
    let mut watch = Watch::new().unwrap();
    let trees = BTreeSet::from([(folder.at("suite"), ".rhai".to_string())]);
    watch.set(WatchedPaths { trees, ..WatchedPaths::default() });
    assert_eq!(watch.existing_files(), BTreeSet::from([folder.at("suite/a/old.rhai")]));
    watch.set_known_content(folder.at("suite/a/old.rhai"), hash(b"0"));
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut);
    // New nested folders; the file is written immediately or after a pause.
    for (name, pause) in [("suite/b/c", 0), ("suite/d/e", 150)] {
        fs::create_dir_all(folder.at(name)).unwrap();
        std::thread::sleep(Duration::from_millis(pause));
        let file = folder.at(name).join("new.rhai");
        fs::write(&file, "1").unwrap();
        assert_eq!(watch.wait(CHANGE_TIMEOUT).unwrap(), changed(&[&file]));
    }
    for name in ["suite/target", "suite/.hidden"] {
        fs::create_dir_all(folder.at(name)).unwrap();
        fs::write(folder.at(name).join("new.rhai"), "1").unwrap();
    }
    fs::write(folder.at("suite/a/new.txt"), "1").unwrap();
    assert_eq!(watch.wait(QUIET_TIME).unwrap(), WatchEvent::TimedOut);
}
