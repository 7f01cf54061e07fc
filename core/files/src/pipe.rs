//! Pipes and devices as outputs. Opening a pipe for writing normally blocks until it has a reader, possibly forever. Here it is
//! opened without blocking, and later writes block as usual.

use crate::Folder;
use crate::write_error::WriteError;
use std::fs::File;
use std::io;
use std::path::Path;
use std::time::{Duration, Instant};

/// How long the reader of a pipe may take to start: a shell starts both ends of a pipe at once.
const READER_TIMEOUT: Duration = Duration::from_secs(2);

/// Opens the pipe or device `name` for writing. Fails if it is a regular file.
pub(crate) fn open(folder: &Folder, name: &Path) -> Result<File, WriteError> {
    let file = retry_until_reader(|| {
        folder.open_for_writing(name).map_err(|e| WriteError::at(folder.path().join(name), e))
    })?;
    match file.metadata()?.is_file() {
        // A regular file has taken its place meanwhile.
        true => Err(WriteError::InTheWay(folder.path().join(name))),
        false => make_blocking(file),
    }
}

/// Opens the target of a link of the system (such as `/dev/stdout`) for writing; a regular file is appended to.
#[cfg(unix)]
pub(crate) fn open_through(link: &Path) -> Result<File, WriteError> {
    use std::os::unix::fs::OpenOptionsExt;
    let mut options = File::options();
    options.append(true).custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32);
    make_blocking(retry_until_reader(|| options.open(link).map_err(WriteError::Io))?)
}

fn retry_until_reader(mut open: impl FnMut() -> Result<File, WriteError>) -> Result<File, WriteError> {
    let start = Instant::now();
    loop {
        match open() {
            Err(WriteError::Io(e)) if has_no_reader(&e) => {
                if start.elapsed() > READER_TIMEOUT {
                    return Err(WriteError::NoReader);
                }
                std::thread::sleep(Duration::from_millis(20));
            }
            other => return other,
        }
    }
}

/// "No such device or address" is the system's answer for a pipe that nobody reads.
#[cfg(unix)]
fn has_no_reader(error: &io::Error) -> bool {
    error.raw_os_error() == Some(rustix::io::Errno::NXIO.raw_os_error())
}

#[cfg(not(unix))]
fn has_no_reader(_: &io::Error) -> bool {
    false
}

/// Makes writes to the file block again, so that they wait for a slow reader.
#[cfg(unix)]
fn make_blocking(file: File) -> Result<File, WriteError> {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    let flags = fcntl_getfl(&file).map_err(io::Error::from)?;
    fcntl_setfl(&file, flags - OFlags::NONBLOCK).map_err(io::Error::from)?;
    Ok(file)
}

#[cfg(not(unix))]
fn make_blocking(file: File) -> Result<File, WriteError> {
    Ok(file)
}
