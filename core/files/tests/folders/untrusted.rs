//! Access to untrusted folders with links that lead out of them, links inside them, pipes and subfolders.

use choreo_files::{FileError, Folder, open_file, read};
use std::fs::{self, symlink_metadata};
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

/// Creates a file `secret` and beside it a folder `inside` with a file, links of each kind, and a pipe without a writer.
fn folder_with_traps() -> (tempfile::TempDir, PathBuf) {
    let outer = tempfile::tempdir().unwrap();
    let inside = outer.path().join("inside");
    fs::create_dir_all(inside.join("below")).unwrap();
    fs::write(outer.path().join("secret"), "secret").unwrap();
    fs::write(inside.join("below/file"), "text").unwrap();
    symlink("../secret", inside.join("out")).unwrap();
    symlink("below/file", inside.join("within")).unwrap();
    symlink("..", inside.join("up")).unwrap();
    symlink("nowhere", inside.join("dangling")).unwrap();
    let made = std::process::Command::new("mkfifo").arg(inside.join("pipe")).status().unwrap();
    assert!(made.success());
    (outer, inside)
}

#[test]
fn reading_stays_beneath_the_folder_and_never_blocks() {
    let (_outer, inside) = folder_with_traps();
    let folder = Folder::open(&inside).unwrap();
    let read_text = |name: &str| folder.read(Path::new(name), 100).map_err(|e| e.to_string());
    assert_eq!(read_text("below/file").unwrap(), b"text");
    assert_eq!(read_text("within").unwrap(), b"text");
    for name in ["out", "up/secret", "../secret"] {
        assert_eq!(read_text(name).unwrap_err(), "it leads out of the folder", "{name}");
    }
    assert_eq!(read_text("pipe").unwrap_err(), "it is a pipe or device, not a regular file");
    assert_eq!(read_text("below").unwrap_err(), "it is a folder, not a regular file");
    assert!(folder.read(Path::new("none"), 100).unwrap_err().is_missing());
    assert!(matches!(folder.read(Path::new("within"), 3), Err(FileError::TooLarge(3))));
    // A path that the user chose may be a link, but not a pipe.
    assert_eq!(read(&inside.join("out"), 100).unwrap(), b"secret");
    assert!(matches!(open_file(&inside.join("pipe")), Err(FileError::NotRegular(_))));
}

#[test]
fn subfolders_are_opened_under_the_same_rules_as_files() {
    let (_outer, inside) = folder_with_traps();
    let folder = Folder::open(&inside).unwrap();
    symlink("below", inside.join("door")).unwrap();
    let below = folder.folder(Path::new("door")).unwrap();
    assert_eq!(below.read(Path::new("file"), 100).unwrap(), b"text");
    assert!(matches!(below.read(Path::new("../out"), 100), Err(FileError::Outside)));
    assert!(matches!(folder.folder(Path::new("up")), Err(FileError::Outside)));
    assert_eq!(folder.resolve(Path::new("door/file")).unwrap(), Path::new("below/file"));
    assert_eq!(folder.resolve(Path::new("within")).unwrap(), Path::new("below/file"));
    assert!(matches!(folder.resolve(Path::new("up/secret")), Err(FileError::Outside)));
    assert_eq!(folder.names(100).unwrap(), ["below", "dangling", "door", "out", "pipe", "up", "within"]);
    assert_eq!(folder.names(2).unwrap().len(), 2);
}

#[test]
fn writing_refuses_links() {
    let (outer, inside) = folder_with_traps();
    let folder = Folder::open(&inside).unwrap();
    for name in ["out", "within", "dangling"] {
        let target = fs::read_link(inside.join(name)).unwrap();
        let expected = format!("it is a symbolic link to {}", target.display());
        let name = Path::new(name);
        assert_eq!(folder.create_new(name).unwrap_err().to_string(), expected);
        assert_eq!(folder.open_existing(name).unwrap_err().to_string(), expected);
        assert_eq!(folder.create_subfolder(name).unwrap_err().to_string(), expected);
    }
    assert!(matches!(folder.create_subfolder(Path::new("up")), Err(FileError::Link(_))));
    assert!(matches!(folder.open_existing(Path::new("pipe")), Err(FileError::NotRegular(_))));
    assert!(!inside.join("nowhere").exists());
    assert_eq!(fs::read(outer.path().join("secret")).unwrap(), b"secret");
}

#[test]
fn a_renamed_file_replaces_a_link_and_not_its_target() {
    let (outer, inside) = folder_with_traps();
    let folder = Folder::open(&inside).unwrap();
    let mut file = folder.create_new(Path::new("new")).unwrap();
    file.write_all(b"result").unwrap();
    assert!(folder.contains(Path::new("new"), &file));
    assert!(folder.create_new(Path::new("new")).is_err());
    folder.rename(Path::new("new"), &folder, Path::new("out")).unwrap();
    assert!(folder.contains(Path::new("out"), &file) && !folder.contains(Path::new("new"), &file));
    assert!(symlink_metadata(inside.join("out")).unwrap().is_file());
    assert_eq!(fs::read(outer.path().join("secret")).unwrap(), b"secret");
}

#[test]
fn an_open_folder_is_unaffected_by_replacing_its_path() {
    let (outer, inside) = folder_with_traps();
    let folder = Folder::open(&inside).unwrap();
    fs::rename(&inside, outer.path().join("elsewhere")).unwrap();
    symlink(outer.path(), &inside).unwrap();
    folder.create_new(Path::new("new")).unwrap();
    assert!(outer.path().join("elsewhere/new").exists() && !outer.path().join("new").exists());
}
