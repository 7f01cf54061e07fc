//! Pipes and devices as outputs. Opening a pipe for writing waits for its reader, for ever if none comes: here it is opened
//! without waiting, and after that written to as any other.

use crate::Folder;
use crate::write_error::WriteError;
use std::fs::File;
use std::io;
use std::path::Path;
use std::time::{Duration, Instant};

/// How long the reader of a pipe may take to start: a shell starts both ends of a pipe at once.
const PATIENCE: Duration = Duration::from_secs(2);

/// Opens what has this name in the folder and is no regular file.
pub fn open(folder: &Folder, name: &Path) -> Result<File, WriteError> {
    let file =
        patiently(|| folder.open_for_writing(name).map_err(|e| WriteError::at(folder.path().join(name), e)))?;
    match file.metadata()?.is_file() {
        // Exchanged meanwhile.
        true => Err(WriteError::InTheWay(folder.path().join(name))),
        false => waiting(file),
    }
}

/// Opens what a link of the system leads to, at its end where it is a regular file.
#[cfg(unix)]
pub(crate) fn open_through(link: &Path) -> Result<File, WriteError> {
    use std::os::unix::fs::OpenOptionsExt;
    let mut options = File::options();
    options.append(true).custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32);
    waiting(patiently(|| options.open(link).map_err(WriteError::Io))?)
}

fn patiently(mut open: impl FnMut() -> Result<File, WriteError>) -> Result<File, WriteError> {
    let start = Instant::now();
    loop {
        match open() {
            Err(WriteError::Io(e)) if has_no_reader(&e) => {
                if start.elapsed() > PATIENCE {
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

/// The file, waiting from now on where its reader is slow.
#[cfg(unix)]
fn waiting(file: File) -> Result<File, WriteError> {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    let flags = fcntl_getfl(&file).map_err(io::Error::from)?;
    fcntl_setfl(&file, flags - OFlags::NONBLOCK).map_err(io::Error::from)?;
    Ok(file)
}

#[cfg(not(unix))]
fn waiting(file: File) -> Result<File, WriteError> {
    Ok(file)
}
