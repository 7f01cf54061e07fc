//! The files that remain after a signal ends the program. This test has a process of its own, because nothing can be written afterwards.
#![cfg(unix)]

use choreo_files::{Folder, PartFile, PartFolder, remove_unfinished};
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

#[test]
fn remove_unfinished_deletes_part_files_and_keeps_resumable_part_folders() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let folder = Arc::new(Folder::open(d).unwrap());
    let half = PartFile::create(&d.join("half.png")).unwrap();
    half.writer().unwrap().write_all(b"half").unwrap();
    let claim = PartFile::claim(folder.clone(), "%d.png.0-9.part".into()).unwrap();
    let open = |name: &str| PartFolder::open(folder.clone(), Path::new(name), &["body", "journal"]).unwrap();
    let (mut kept, dropped) = (open("kept.mp4"), open("dropped.mp4"));
    for part in [&kept, &dropped] {
        part.create("body").unwrap().write_all(b"frames").unwrap();
    }
    // An unknown file in a part folder stays, and so does the folder.
    let other = open("other.mp4");
    std::fs::write(d.join("other.mp4.part/mine"), "mine").unwrap();
    kept.keep(true);
    remove_unfinished();
    // Dropping these would block forever, because the lock of the unfinished files is never released.
    [half, claim].into_iter().for_each(std::mem::forget);
    [kept, dropped, other].into_iter().for_each(std::mem::forget);
    let mut left: Vec<_> =
        std::fs::read_dir(d).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    left.sort();
    assert_eq!(left, ["kept.mp4.part", "other.mp4.part"]);
    assert_eq!(std::fs::read(d.join("kept.mp4.part/body")).unwrap(), b"frames");
    assert_eq!(std::fs::read_dir(d.join("other.mp4.part")).unwrap().count(), 1);
}
