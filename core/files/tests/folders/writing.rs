//! Writing into untrusted folders, in which links, hard links, pipes or old files have the names of outputs.

use choreo_files::{Destination, PartFile, PartFolder, WriteError, write_whole, write_whole_beneath};
use rustix::fs::{CWD, FileType, Mode, mknodat};
use std::fs::{self, File, hard_link, symlink_metadata};
use std::io::{Read, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const FILES: &[&str] = &["body", "journal"];

/// A folder for outputs, and a file outside of it that must not change.
struct TestFolder {
    outer: tempfile::TempDir,
    inside: PathBuf,
}

fn test_folder() -> TestFolder {
    let outer = tempfile::tempdir().unwrap();
    let inside = outer.path().join("inside");
    fs::create_dir(&inside).unwrap();
    fs::write(outer.path().join("secret"), "secret").unwrap();
    TestFolder { outer, inside }
}

impl TestFolder {
    fn secret(&self) -> PathBuf {
        self.outer.path().join("secret")
    }

    fn link(&self, name: &str) -> String {
        symlink(self.secret(), self.inside.join(name)).unwrap();
        format!(
            "{} is a symbolic link to {}; remove it",
            self.inside.join(name).display(),
            self.secret().display()
        )
    }

    fn pipe(&self, name: &str) -> PathBuf {
        let pipe = self.inside.join(name);
        // A child process would hold the locks of concurrent tests between its fork and its exec.
        mknodat(CWD, &pipe, FileType::Fifo, Mode::from_raw_mode(0o600), 0).unwrap();
        pipe
    }

    fn part_folder(&self) -> Result<PartFolder, WriteError> {
        let Destination::File { folder, name } = Destination::of(&self.inside.join("o")).unwrap() else {
            panic!()
        };
        PartFolder::open(folder, &name, FILES)
    }

    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.inside).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for TestFolder {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            assert_eq!(fs::read(self.secret()).unwrap(), b"secret", "written through a link");
        }
    }
}

fn write_and_commit(part: PartFile, bytes: &[u8]) -> Result<(), WriteError> {
    let mut out = part.writer().unwrap();
    out.write_all(bytes).unwrap();
    out.flush().unwrap();
    drop(out);
    part.commit()
}

#[test]
fn a_link_in_place_of_the_output_or_its_part_file_is_refused() {
    let p = test_folder();
    let place = p.inside.join("o");
    let expected = p.link("o");
    assert_eq!(PartFile::create(&place).unwrap_err().to_string(), expected);
    assert_eq!(write_whole(&place, b"x").unwrap_err().to_string(), expected);
    assert_eq!(write_whole_beneath(&p.inside, Path::new("o"), b"x").unwrap_err().to_string(), expected);
    fs::remove_file(&place).unwrap();
    let expected = p.link("o.part");
    assert_eq!(PartFile::create(&place).unwrap_err().to_string(), expected);
    assert_eq!(p.part_folder().unwrap_err().to_string(), expected);
    fs::remove_file(p.inside.join("o.part")).unwrap();
    // The target of a link is escaped, so that it cannot control a terminal.
    symlink("\x1b[2J", &place).unwrap();
    let text = PartFile::create(&place).unwrap_err().to_string();
    assert!(text.ends_with("is a symbolic link to \\u{1b}[2J; remove it"), "{text}");
    fs::remove_file(&place).unwrap();
    for name in ["a", "a/b"] {
        fs::create_dir_all(p.inside.join(name).parent().unwrap()).unwrap();
        symlink(p.outer.path(), p.inside.join(name)).unwrap();
        let text = write_whole_beneath(&p.inside, Path::new("a/b/secret"), b"x").unwrap_err().to_string();
        assert!(text.starts_with(&format!("{} is a symbolic link", p.inside.join(name).display())), "{text}");
        fs::remove_file(p.inside.join(name)).unwrap();
    }
}

#[test]
fn a_stale_part_file_is_replaced() {
    let p = test_folder();
    hard_link(p.secret(), p.inside.join("o.part")).unwrap();
    write_and_commit(PartFile::create(&p.inside.join("o")).unwrap(), b"result").unwrap();
    assert_eq!(fs::read(p.inside.join("o")).unwrap(), b"result");
    assert_eq!(p.names(), ["o"]);
}

#[test]
fn a_part_file_is_locked_and_is_removed_unless_committed() {
    let p = test_folder();
    let place = p.inside.join("o");
    let first = PartFile::create(&place).unwrap();
    assert!(matches!(PartFile::create(&place), Err(WriteError::Busy)));
    drop(first);
    assert_eq!(p.names(), Vec::<String>::new());
    fs::create_dir(p.inside.join("o.part")).unwrap();
    assert!(
        matches!(PartFile::create(&place), Err(WriteError::InTheWay(at)) if at == p.inside.join("o.part"))
    );
}

#[test]
fn a_part_folder_refuses_links_and_hard_links() {
    let p = test_folder();
    let part = p.inside.join("o.part");
    fs::create_dir(&part).unwrap();
    let journal = p.link("o.part/journal");
    assert_eq!(p.part_folder().unwrap_err().to_string(), journal);
    fs::remove_file(part.join("journal")).unwrap();
    let body = p.link("o.part/body");
    assert_eq!(p.part_folder().unwrap_err().to_string(), body);
    fs::remove_file(part.join("body")).unwrap();
    let mut folder = p.part_folder().unwrap();
    // A link that is created after the folder was opened.
    p.link("o.part/body");
    assert_eq!(folder.reopen("body").unwrap_err().to_string(), body);
    assert_eq!(folder.create("body").unwrap_err().to_string(), body);
    fs::remove_file(part.join("body")).unwrap();
    folder.create("body").unwrap().write_all(b"result").unwrap();
    folder.finish("body").unwrap();
    drop(folder);
    assert_eq!(fs::read(p.inside.join("o")).unwrap(), b"result");
    assert_eq!(p.names(), ["o"]);

    fs::create_dir(&part).unwrap();
    for name in FILES {
        hard_link(p.secret(), part.join(name)).unwrap();
    }
    let mut folder = p.part_folder().unwrap();
    let expected = |name: &str| {
        format!("{} is a hard link to a file that has other names; remove it", part.join(name).display())
    };
    assert_eq!(folder.check_lock().unwrap_err().to_string(), expected("journal"));
    assert_eq!(folder.reopen("body").unwrap_err().to_string(), expected("body"));
    folder.renew_lock().unwrap();
    folder.check_lock().unwrap();
    folder.lock_file().write_all(b"record").unwrap();
    folder.create("body").unwrap().write_all(b"body").unwrap();
    assert!(folder.reopen("body").unwrap().is_some() && folder.is_in_place());
    assert!(matches!(p.part_folder(), Err(WriteError::Busy)));
    folder.keep(true);
    drop(folder);
    assert_eq!(fs::read(part.join("journal")).unwrap(), b"record");
    drop(p.part_folder().unwrap());
    assert!(!part.exists(), "the part folder is removed");
}

#[test]
fn a_moved_part_folder_is_detected() {
    let p = test_folder();
    let mut folder = p.part_folder().unwrap();
    fs::rename(&p.inside, p.outer.path().join("gone")).unwrap();
    assert!(!folder.is_in_place());
    folder.keep(true);
    drop(folder);
    fs::create_dir(&p.inside).unwrap();
}

#[test]
fn a_file_is_written_whole_with_its_folders_and_keeps_its_permissions() {
    let p = test_folder();
    let place = p.inside.join("a/b/c.txt");
    write_whole_beneath(&p.inside.join("a"), Path::new("b/c.txt"), b"one").unwrap();
    fs::set_permissions(&place, PermissionsExt::from_mode(0o640)).unwrap();
    write_whole_beneath(&p.inside, Path::new("a/b/c.txt"), b"two").unwrap();
    assert_eq!(fs::read(&place).unwrap(), b"two");
    assert_eq!(symlink_metadata(&place).unwrap().mode() & 0o777, 0o640);
    assert_eq!(fs::read_dir(place.parent().unwrap()).unwrap().count(), 1);
    assert!(matches!(write_whole(&place.parent().unwrap().join("../b"), b""), Err(WriteError::IsFolder)));
    assert!(matches!(write_whole(&p.inside.join("none/c.txt"), b""), Err(WriteError::Io(_))));
    fs::set_permissions(&place, PermissionsExt::from_mode(0o440)).unwrap();
    assert!(matches!(write_whole(&place, b"three"), Err(WriteError::ReadOnly)));
    // Of several concurrent writers, one wins with its whole content.
    let many: Vec<_> = (0..8u8)
        .map(|i| {
            let place = p.inside.join("many");
            std::thread::spawn(move || write_whole(&place, &[i; 100_000]).unwrap())
        })
        .collect();
    many.into_iter().for_each(|thread| thread.join().unwrap());
    let last = fs::read(p.inside.join("many")).unwrap();
    assert!(last.len() == 100_000 && last.iter().all(|b| *b == last[0]));
    assert_eq!(p.names(), ["a", "many"]);
}

#[test]
fn written_bytes_can_be_replaced() {
    let p = test_folder();
    let part = PartFile::create(&p.inside.join("a")).unwrap();
    let mut writer = part.writer().unwrap();
    writer.write_all(b"head and more").unwrap();
    writer.flush().unwrap();
    part.replace(0, b"HEAD").unwrap();
    assert_eq!(part.replace(10, b"more").unwrap_err().kind(), std::io::ErrorKind::InvalidInput);
    // Writing continues at the end.
    writer.write_all(b", and the end").unwrap();
    writer.flush().unwrap();
    drop(writer);
    part.commit().unwrap();
    assert_eq!(fs::read(p.inside.join("a")).unwrap(), b"HEAD and more, and the end");
}

#[test]
fn a_pipe_without_reader_is_an_error_and_one_with_a_reader_is_written() {
    let p = test_folder();
    let pipe = p.pipe("o");
    assert!(matches!(PartFile::create(&pipe), Err(WriteError::NoReader)));
    assert!(matches!(write_whole(&pipe, b"x"), Err(WriteError::NoReader)));
    // These are more bytes than a pipe holds, so that the writer must wait for the slow reader.
    let bytes: Vec<u8> = (0..1_000_000u32).map(|i| i as u8).collect();
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || {
            let mut pipe = File::open(pipe).unwrap();
            std::thread::sleep(std::time::Duration::from_millis(100));
            let mut read = Vec::new();
            pipe.read_to_end(&mut read).unwrap();
            read
        }
    });
    let part = PartFile::create(&pipe).unwrap();
    assert_eq!(part.replace(0, &[]).unwrap_err().kind(), std::io::ErrorKind::NotSeekable);
    write_and_commit(part, &bytes).unwrap();
    assert!(reader.join().unwrap() == bytes);
    // A pipe with the name of the part file is refused.
    p.pipe("x.part");
    assert!(matches!(PartFile::create(&p.inside.join("x")), Err(WriteError::InTheWay(_))));
}

#[test]
fn devices_and_links_of_the_system_can_be_written() {
    let p = test_folder();
    // The devices are only inspected: for root, a fault would replace them on the whole machine.
    for place in ["/dev/null", "/dev/stdout", "/dev/stderr"] {
        assert!(matches!(Destination::of(Path::new(place)), Ok(Destination::Direct(_))), "{place}");
    }
    let file = File::options().append(true).create(true).open(p.inside.join("open")).unwrap();
    (&file).write_all(b"before ").unwrap();
    let fd = std::os::fd::AsRawFd::as_raw_fd(&file);
    for place in [format!("/proc/self/fd/{fd}"), format!("/dev/fd/{fd}")] {
        write_whole(Path::new(&place), b"more ").unwrap();
    }
    assert_eq!(fs::read(p.inside.join("open")).unwrap(), b"before more more ");
    // A user's own link to a device is refused like any other link.
    symlink("/dev/null", p.inside.join("null")).unwrap();
    assert!(matches!(PartFile::create(&p.inside.join("null")), Err(WriteError::Link { .. })));
}

#[test]
fn a_claim_is_exclusive() {
    let p = test_folder();
    let folder = Arc::new(choreo_files::Folder::open(&p.inside).unwrap());
    let claim = PartFile::claim(folder.clone(), PathBuf::from("0-9.part")).unwrap();
    assert!(matches!(PartFile::claim(folder.clone(), PathBuf::from("0-9.part")), Err(WriteError::Busy)));
    drop(claim);
    assert_eq!(p.names(), Vec::<String>::new());
    let expected = p.link("0-9.part");
    assert_eq!(PartFile::claim(folder, PathBuf::from("0-9.part")).unwrap_err().to_string(), expected);
}
