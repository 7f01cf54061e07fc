//! Outputs in folders that strangers have filled: links, hard links, pipes and leftovers in the way of every name.

use choreo_files::{Destination, PartFile, PartFolder, WriteError, write_whole, write_whole_beneath};
use rustix::fs::{CWD, FileType, Mode, mknodat};
use std::fs::{self, File, hard_link, symlink_metadata};
use std::io::{Read, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const FILES: &[&str] = &["body", "journal"];

/// A folder beside a file that nobody may change.
struct Planted {
    outer: tempfile::TempDir,
    inside: PathBuf,
}

fn planted() -> Planted {
    let outer = tempfile::tempdir().unwrap();
    let inside = outer.path().join("inside");
    fs::create_dir(&inside).unwrap();
    fs::write(outer.path().join("secret"), "secret").unwrap();
    Planted { outer, inside }
}

impl Planted {
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
        // Another process would hold the locks of tests beside this one between its fork and its exec.
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

impl Drop for Planted {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            assert_eq!(fs::read(self.secret()).unwrap(), b"secret", "written through a link");
        }
    }
}

fn put(part: PartFile, bytes: &[u8]) -> Result<(), WriteError> {
    let mut out = part.writer().unwrap();
    out.write_all(bytes).unwrap();
    out.flush().unwrap();
    drop(out);
    part.commit()
}

#[test]
fn a_link_under_the_name_or_its_part_is_refused_and_named() {
    let p = planted();
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
    // The text of a link cannot control a terminal.
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
fn a_stale_part_is_replaced_and_not_written_into() {
    let p = planted();
    hard_link(p.secret(), p.inside.join("o.part")).unwrap();
    put(PartFile::create(&p.inside.join("o")).unwrap(), b"result").unwrap();
    assert_eq!(fs::read(p.inside.join("o")).unwrap(), b"result");
    assert_eq!(p.names(), ["o"]);
}

#[test]
fn a_part_is_locked_and_goes_where_it_is_not_finished() {
    let p = planted();
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
fn a_part_folder_writes_through_no_link_and_no_hard_link() {
    let p = planted();
    let part = p.inside.join("o.part");
    fs::create_dir(&part).unwrap();
    let journal = p.link("o.part/journal");
    assert_eq!(p.part_folder().unwrap_err().to_string(), journal);
    fs::remove_file(part.join("journal")).unwrap();
    let body = p.link("o.part/body");
    assert_eq!(p.part_folder().unwrap_err().to_string(), body);
    fs::remove_file(part.join("body")).unwrap();
    let mut folder = p.part_folder().unwrap();
    // One that comes later.
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
    assert!(!part.exists(), "not to be kept");
}

#[test]
fn a_part_folder_that_was_moved_away_is_noticed() {
    let p = planted();
    let mut folder = p.part_folder().unwrap();
    fs::rename(&p.inside, p.outer.path().join("gone")).unwrap();
    assert!(!folder.is_in_place());
    folder.keep(true);
    drop(folder);
    fs::create_dir(&p.inside).unwrap();
}

#[test]
fn a_file_is_written_whole_with_its_folders_and_keeps_its_permissions() {
    let p = planted();
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
    // Many at once: one of them, whole.
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
fn bytes_that_are_there_are_replaced() {
    let p = planted();
    let part = PartFile::create(&p.inside.join("a")).unwrap();
    let mut writer = part.writer().unwrap();
    writer.write_all(b"head and more").unwrap();
    writer.flush().unwrap();
    part.replace(0, b"HEAD").unwrap();
    assert_eq!(part.replace(10, b"more").unwrap_err().kind(), std::io::ErrorKind::InvalidInput);
    // Writing goes on at the end.
    writer.write_all(b", and the end").unwrap();
    writer.flush().unwrap();
    drop(writer);
    part.commit().unwrap();
    assert_eq!(fs::read(p.inside.join("a")).unwrap(), b"HEAD and more, and the end");
}

#[test]
fn a_pipe_without_reader_is_an_error_and_one_with_a_reader_is_written() {
    let p = planted();
    let pipe = p.pipe("o");
    assert!(matches!(PartFile::create(&pipe), Err(WriteError::NoReader)));
    assert!(matches!(write_whole(&pipe, b"x"), Err(WriteError::NoReader)));
    // More than a pipe holds: the writer must wait for the reader, who takes his time.
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
    put(part, &bytes).unwrap();
    assert!(reader.join().unwrap() == bytes);
    // A pipe in the way of a part is no output.
    p.pipe("x.part");
    assert!(matches!(PartFile::create(&p.inside.join("x")), Err(WriteError::InTheWay(_))));
}

#[test]
fn devices_and_the_links_of_the_system_are_written() {
    let p = planted();
    // Only looked at: where root runs this, a fault would replace them for the whole machine.
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
    // A link that a user made to them is one as any other.
    symlink("/dev/null", p.inside.join("null")).unwrap();
    assert!(matches!(PartFile::create(&p.inside.join("null")), Err(WriteError::Link { .. })));
}

#[test]
fn a_claim_is_held_by_one() {
    let p = planted();
    let folder = Arc::new(choreo_files::Folder::open(&p.inside).unwrap());
    let claim = PartFile::claim(folder.clone(), PathBuf::from("0-9.part")).unwrap();
    assert!(matches!(PartFile::claim(folder.clone(), PathBuf::from("0-9.part")), Err(WriteError::Busy)));
    drop(claim);
    assert_eq!(p.names(), Vec::<String>::new());
    let expected = p.link("0-9.part");
    assert_eq!(PartFile::claim(folder, PathBuf::from("0-9.part")).unwrap_err().to_string(), expected);
}
