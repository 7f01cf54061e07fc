//! A video that is being written: the exporter's bytes and the journal, both in the folder `NAME.part`.

use crate::args::RenderArgs;
use crate::drawing::pipeline::Pixels;
use crate::failure::{Failure, output_error, write_failure};
use crate::output::journal::{self, Changes, Identity, Journal, KeptFrame, Record, Span};
use crate::output::provenance;
use crate::output::target::export_failure;
use crate::process::{interrupt, kept_frames, machine};
use choreo_files::{Destination, Folder as OpenFolder, PartFolder, WriteError};
use choreo_plugin::{Exporter, FrameSink, Mark, VideoInfo};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

pub struct Video {
    shown: String,
    sink: Box<dyn FrameSink>,
    body: MeasuredWriter,
    end: End,
}

/// Work that remains for the body at the end.
enum End {
    /// The body has already been written to its destination.
    Nothing,
    /// The body is a temporary file. Head and body are copied to a destination that is not a regular file.
    Copy { body: File, to: File },
    /// The body is in a part folder, and is renamed or copied into place.
    Folder(Box<Folder>),
}

/// Finished work of an earlier render, for the user.
#[derive(Default)]
pub struct ResumedWork {
    /// Frames that are finished, from the first on.
    pub done: usize,
    pub note: Option<String>,
}

/// The only files that a part folder contains, the lock file last.
const FILES: &[&str] = &["frames", "body", "result", "journal"];

/// Largest journal of another machine in bytes.
const MOST_JOURNAL: u64 = 1 << 30;

struct Folder {
    /// File of the frames that the encoder still holds, created for the first of them. It is closed before the folder is removed.
    frames: Option<File>,
    /// The part folder; its lock file is the journal.
    part: PartFolder,
    place: PathBuf,
    shown: String,
    frames_end: u64,
    changes: Changes,
    scratch: Vec<u8>,
    /// Finished frames in the journal.
    done: usize,
    /// Rule for the finished frames if the render ends without a result.
    policy: Policy,
}

/// The user's choice for the finished frames of an earlier render.
struct Policy {
    resume: bool,
    discard: bool,
    /// The command that resumes the render.
    resume_command: String,
}

impl Video {
    /// Begins a video on standard output.
    pub(crate) fn to_stdout(exporter: &dyn Exporter, info: &VideoInfo) -> Result<Video, Failure> {
        let shown = "standard output".to_string();
        let body = MeasuredWriter::new(Box::new(io::stdout()));
        let sink = exporter.begin(info, Box::new(body.clone())).map_err(|e| export_failure(&shown, e))?;
        Ok(Video { shown, sink, body, end: End::Nothing })
    }

    /// Begins a video in a file. With `--resume` it continues from the frames of an earlier render of the same `identity`; otherwise it
    /// starts again. Gives no video if the file is already complete and only its part folder was left, or if `is_made` is true.
    pub(crate) fn to_file(
        path: &Path,
        exporter: &dyn Exporter,
        info: &VideoInfo,
        identity: &Identity,
        args: &RenderArgs,
        is_made: impl Fn() -> bool,
    ) -> Result<(Option<Video>, ResumedWork), Failure> {
        let shown = path.display().to_string();
        let (parent, name) = match Destination::of(path).map_err(|e| write_failure(&shown, e))? {
            Destination::File { folder, name } => (folder, name),
            Destination::Direct(to) => {
                return Video::direct(shown, to, exporter, info).map(|v| (Some(v), ResumedWork::default()));
            }
        };
        let part = open_part(&parent, &name, args).map_err(|e| write_failure(&shown, e))?;
        if args.resume && is_made() {
            part.remove_other_part_folders();
            return Ok((None, ResumedWork::default()));
        }
        let mut folder = Folder::new(part, path, args);
        if args.resume {
            folder.copy_of_others(identity).map_err(|e| write_failure(&shown, e))?;
        }
        let Some(mut found) = finished_in(folder.part.lock_file()) else {
            return Ok((Some(folder.begin(exporter, info, identity)?), ResumedWork::default()));
        };
        folder.done = found.records.len();
        folder.part.keep(true);
        if !args.resume {
            let note = folder.check_discard(&found.identity, identity, args)?;
            let video = folder.begin(exporter, info, identity)?;
            return Ok((Some(video), ResumedWork { note, ..ResumedWork::default() }));
        }
        provenance::same(&shown, &folder.part.path(), &found.identity, identity)?;
        folder.part.check_lock().map_err(|e| write_failure(&shown, e))?;
        found.records.truncate(info.frames as usize);
        if found.records.len() as u64 == info.frames && folder.is_in_place(&found) {
            folder.part.keep(false);
            return Ok((None, ResumedWork { done: found.records.len(), note: None }));
        }
        let (video, done) = folder.resume(&found, exporter, info, identity)?;
        Ok((Some(video), ResumedWork { done, note: None }))
    }

    /// Begins a video whose output is a pipe or device, which is written directly.
    fn direct(shown: String, to: File, exporter: &dyn Exporter, info: &VideoInfo) -> Result<Video, Failure> {
        let failed = |e: io::Error| output_error(&shown, &e);
        let (end, out) = match exporter.head_comes_last() {
            true => {
                let body = tempfile::tempfile().map_err(failed)?;
                let out = body.try_clone().map_err(failed)?;
                (End::Copy { body, to }, out)
            }
            false => (End::Nothing, to),
        };
        let body = MeasuredWriter::new(Box::new(out));
        let sink = exporter.begin(info, Box::new(body.clone())).map_err(|e| export_failure(&shown, e))?;
        Ok(Video { shown, sink, body, end })
    }

    /// Adds a frame. `repeated`: the previous frame had the same pixels.
    pub(crate) fn frame(&mut self, pixels: &Pixels, repeated: bool) -> Result<(), Failure> {
        pixels.write(&mut *self.sink, repeated).map_err(|e| export_failure(&self.shown, e))?;
        let End::Folder(folder) = &mut self.end else { return Ok(()) };
        folder.mark(self.sink.mark(), &self.body).map_err(|e| output_error(&self.shown, &e))
    }

    /// Ends the video, and moves it to its place.
    pub fn finish(self) -> Result<(), Failure> {
        let Video { shown, sink, body, end } = self;
        let head = sink.finish().map_err(|e| export_failure(&shown, e))?;
        let ended = body.lock().out.flush().map_err(WriteError::Io).and_then(|()| match end {
            End::Nothing => Ok(()),
            End::Copy { mut body, to } => {
                body.seek(SeekFrom::Start(0))?;
                Ok(write_head_and_body(&head, &mut body, to)?)
            }
            End::Folder(folder) => folder.finish(&head),
        });
        ended.map_err(|e| write_failure(&shown, e))
    }

    /// Ends the video after a failure. Keeps the part folder for `--resume` if it has finished frames and they are wanted.
    pub fn end_after_failure(self, keep: bool) {
        let End::Folder(mut folder) = self.end else { return };
        let wanted = folder.policy.resume || keep && !folder.policy.discard;
        if folder.done == 0 || !wanted {
            folder.part.keep(false);
        }
        // If the folder was moved away, the place of the frames is unknown.
        if folder.done == 0 || !wanted || !folder.part.is_in_place() {
            kept_frames::clear();
        }
    }
}

/// Whether a process makes an output in the part folder of this name.
pub(crate) fn is_being_made(folder: &OpenFolder, part: &Path) -> bool {
    PartFolder::is_held(folder, part, FILES)
}

/// Opens the part folder. Several machines may make the same segment, since a farm may start a task again while its first process still
/// runs. With `--resume` this process waits until the other one has finished the segment, or has died and left its frames.
fn open_part(parent: &Arc<OpenFolder>, name: &Path, args: &RenderArgs) -> Result<PartFolder, WriteError> {
    if args.segment.is_none() {
        return PartFolder::open(parent.clone(), name, FILES);
    }
    loop {
        match PartFolder::open_shared(parent.clone(), name, &machine::id(), FILES) {
            Err(WriteError::Busy) if args.resume && !interrupt::interrupted() => {
                std::thread::sleep(Duration::from_millis(200));
            }
            opened => return opened,
        }
    }
}

/// Reads a journal; `None` if it has no records.
fn finished_in(journal: impl Read) -> Option<Journal> {
    journal::read(BufReader::new(journal)).filter(|found| !found.records.is_empty())
}

fn write_head_and_body(head: &[u8], body: &mut File, mut to: File) -> io::Result<()> {
    to.write_all(head)?;
    io::copy(body, &mut to)?;
    to.flush()
}

impl Folder {
    fn new(part: PartFolder, place: &Path, args: &RenderArgs) -> Folder {
        Folder {
            part,
            place: place.to_path_buf(),
            shown: place.display().to_string(),
            frames: None,
            frames_end: 0,
            changes: Changes::default(),
            scratch: Vec::new(),
            done: 0,
            policy: Policy {
                resume: args.resume,
                discard: args.discard,
                resume_command: args.resume_command.clone(),
            },
        }
    }

    /// Copies the part folder of the machine with the most finished frames, if it has more than this one. The folder is not moved, since
    /// its process may be alive where locks have no effect.
    fn copy_of_others(&mut self, identity: &Identity) -> Result<(), WriteError> {
        let mut most = finished_in(self.part.lock_file()).map_or(0, |found| found.records.len());
        self.part.lock_file().rewind()?;
        let mut best = None;
        for other in self.part.other_part_folders() {
            let journal = other.read(Path::new("journal"), MOST_JOURNAL).unwrap_or_default();
            let found = finished_in(&*journal).filter(|found| found.identity == *identity);
            if let Some(found) = found.filter(|found| found.records.len() > most) {
                most = found.records.len();
                best = Some((other, journal));
            }
        }
        let Some((other, journal)) = best else { return Ok(()) };
        // The journal was read before the files that it refers to: data added to them meanwhile is ignored.
        for name in ["body", "frames"] {
            if let Ok(mut from) = other.open_file(Path::new(name)) {
                io::copy(&mut from, &mut self.part.create(name)?)?;
            }
        }
        self.part.renew_lock()?;
        let mut own = self.part.lock_file();
        own.write_all(&journal)?;
        Ok(own.rewind()?)
    }

    /// Message about finished frames that are deleted because the render starts again. Without `--resume` and `--discard` it refuses to
    /// delete frames that this very render could use. Frames of other renders are deleted: after an edit of the script the user wants to
    /// see the new result.
    fn check_discard(
        &self,
        was: &Identity,
        is: &Identity,
        args: &RenderArgs,
    ) -> Result<Option<String>, Failure> {
        let (shown, part) = (&self.shown, self.part.path());
        let frames = if self.done == 1 { "1 frame".to_string() } else { format!("{} frames", self.done) };
        let found = provenance::differences(was, is);
        if found.is_empty() && !args.discard && !args.watch {
            return Err(Failure::Output(format!(
                "{shown}: {frames} of this same render are finished in {}\n    hint: --resume goes on with \
                 them, --discard deletes them and renders everything again",
                part.display()
            )));
        }
        let why: Vec<&str> = found.iter().map(|(keyword, ..)| keyword.as_str()).collect();
        let why = match why.is_empty() {
            true => String::new(),
            false => format!(", because these differ: {}", why.join(", ")),
        };
        Ok(Some(format!("{shown}: starts anew; {frames} of a render that was stopped are deleted{why}")))
    }

    fn begin(
        mut self,
        exporter: &dyn Exporter,
        info: &VideoInfo,
        identity: &Identity,
    ) -> Result<Video, Failure> {
        let shown = self.shown.clone();
        let body = self.start_over(identity).map_err(|e| write_failure(&shown, e))?;
        let sink = exporter.begin(info, Box::new(body.clone())).map_err(|e| export_failure(&shown, e))?;
        Ok(Video { shown, sink, body, end: End::Folder(Box::new(self)) })
    }

    fn start_over(&mut self, identity: &Identity) -> Result<MeasuredWriter, WriteError> {
        self.done = 0;
        self.part.keep(false);
        self.frames = None;
        self.part.renew_lock()?;
        self.part.lock_file().write_all(&journal::head(identity))?;
        Ok(MeasuredWriter::new(Box::new(self.part.create("body")?)))
    }

    /// Whether the result was already renamed into place: the body is gone, and the file in place has its bytes.
    fn is_in_place(&self, found: &Journal) -> bool {
        let Some((last, _)) = found.records.last() else { return false };
        let settled = matches!(last.kept, KeptFrame::Settled(_));
        settled
            && matches!(self.part.reopen("body"), Ok(None))
            && choreo_files::open_file(&self.place)
                .is_ok_and(|mut f| found.settled(&mut f) == found.records.len())
    }

    /// Takes over the intact part of the journal, the body and the kept frames; returns the number of these frames.
    fn resume(
        mut self,
        found: &Journal,
        exporter: &dyn Exporter,
        info: &VideoInfo,
        identity: &Identity,
    ) -> Result<(Video, usize), Failure> {
        let shown = self.shown.clone();
        let failed = |e: io::Error| output_error(&shown, &e);
        let export_failed = |e| export_failure(&shown, e);
        let not_written = |e| write_failure(&shown, e);
        let mut file = match self.part.reopen("body").map_err(not_written)? {
            Some(file) => file,
            None => self.part.create("body").map_err(not_written)?,
        };
        self.frames = self.part.reopen("frames").map_err(not_written)?;
        let settled = found.settled(&mut file);
        let states = found.records[..settled].iter().filter_map(|(record, _)| match &record.kept {
            KeptFrame::Settled(state) => Some(state.clone()),
            KeptFrame::Open(_) => None,
        });
        let states: Vec<Vec<u8>> = states.collect();
        let length = settled.checked_sub(1).map_or(0, |i| found.records[i].0.body);
        file.set_len(length).map_err(failed)?;
        file.rewind().map_err(failed)?;
        // Both handles share one file position; it is moved to the end before anything is written.
        let out = MeasuredWriter::new(Box::new(file.try_clone().map_err(failed)?));
        let mut sink = if states.is_empty() {
            exporter.begin(info, Box::new(out.clone())).map_err(export_failed)?
        } else {
            let mut so_far = BufReader::new(&mut file).take(length);
            exporter.resume(info, &states, &mut so_far, Box::new(out.clone())).map_err(export_failed)?
        };
        file.seek(SeekFrom::Start(length)).map_err(failed)?;
        out.lock().length = length;
        let mut done = settled;
        while let Some((Record { kept: KeptFrame::Open(span), .. }, _)) = found.records.get(done) {
            let Some(kept) = self.kept_frame(span, info) else { break };
            sink.again(kept).map_err(export_failed)?;
            self.frames_end = span.at + u64::from(span.length);
            done += 1;
        }
        if done == 0 {
            drop((sink, out));
            return Ok((self.begin(exporter, info, identity)?, 0));
        }
        let mut journal = self.part.lock_file();
        journal.set_len(found.records[done - 1].1).map_err(failed)?;
        journal.seek(SeekFrom::End(0)).map_err(failed)?;
        out.measured().map_err(failed)?;
        self.finished(done);
        Ok((Video { shown, sink, body: out, end: End::Folder(Box::new(self)) }, done))
    }

    fn kept_frame(&mut self, span: &Span, info: &VideoInfo) -> Option<&[u8]> {
        let frames = self.frames.as_mut()?;
        frames.seek(SeekFrom::Start(span.at)).ok()?;
        self.scratch.clear();
        frames.take(u64::from(span.length)).read_to_end(&mut self.scratch).ok()?;
        if self.scratch.len() != span.length as usize || crc32fast::hash(&self.scratch) != span.crc {
            return None;
        }
        // No encoder keeps more of a frame than its pixels, and some add a row and a column.
        let most = 4 * (u64::from(info.width) + 1) * (u64::from(info.height) + 1);
        self.changes.decode(&self.scratch, &span.parts, most)
    }

    /// Appends the frame that the sink has just taken to the journal.
    fn mark(&mut self, mark: Mark<'_>, body: &MeasuredWriter) -> io::Result<()> {
        // This check stops a render that would otherwise write to deleted files for hours.
        if !self.part.is_in_place() {
            return Err(io::ErrorKind::NotFound.into());
        }
        let kept = match mark {
            Mark::Nothing => return Ok(()),
            Mark::Settled(state) => {
                self.changes.restart();
                self.frames_end = 0;
                KeptFrame::Settled(state)
            }
            Mark::Open(parts) => KeptFrame::Open(self.keep_frame(&parts)?),
        };
        let (body, crc) = body.measured()?;
        journal::append(&mut self.part.lock_file(), &Record { body, crc, kept })?;
        self.finished(self.done + 1);
        Ok(())
    }

    /// Records the number of finished frames; they are kept even if a signal ends the program.
    fn finished(&mut self, frames: usize) {
        self.done = frames;
        if !self.policy.discard {
            self.part.keep(true);
            kept_frames::set(frames, self.part.path(), self.policy.resume_command.clone());
        }
    }

    fn keep_frame(&mut self, parts: &[&[u8]; 3]) -> io::Result<Span> {
        self.changes.encode(parts, &mut self.scratch);
        if self.frames.is_none() {
            self.frames = Some(self.part.create("frames").map_err(io::Error::other)?);
        }
        let span = Span {
            at: self.frames_end,
            length: self.scratch.len() as u32,
            crc: crc32fast::hash(&self.scratch),
            parts: parts.map(|p| p.len() as u32),
        };
        if let Some(frames) = &mut self.frames {
            // Frames overwrite those before the last settled mark: the file does not grow, and its pages are reused.
            frames.seek(SeekFrom::Start(span.at))?;
            frames.write_all(&self.scratch)?;
        }
        self.frames_end += u64::from(span.length);
        Ok(span)
    }

    fn finish(mut self, head: &[u8]) -> Result<(), WriteError> {
        if head.is_empty() {
            self.part.finish("body")?;
        } else {
            let mut body = self.part.reopen("body")?.ok_or(io::Error::from(io::ErrorKind::NotFound))?;
            write_head_and_body(head, &mut body, self.part.create("result")?)?;
            self.part.finish("result")?;
        }
        self.part.remove_other_part_folders();
        kept_frames::clear();
        Ok(())
    }
}

/// The exporter's writer, measured as it writes.
#[derive(Clone)]
struct MeasuredWriter(Arc<Mutex<Measured>>);

struct Measured {
    out: BufWriter<Box<dyn Write + Send>>,
    length: u64,
    crc: crc32fast::Hasher,
}

impl MeasuredWriter {
    fn new(out: Box<dyn Write + Send>) -> MeasuredWriter {
        let out = BufWriter::with_capacity(1 << 16, out);
        MeasuredWriter(Arc::new(Mutex::new(Measured { out, length: 0, crc: crc32fast::Hasher::new() })))
    }

    fn lock(&self) -> MutexGuard<'_, Measured> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Flushes the written bytes to the system. Returns the length, and the checksum of the bytes since the last call.
    fn measured(&self) -> io::Result<(u64, u32)> {
        let mut body = self.lock();
        body.out.flush()?;
        Ok((body.length, std::mem::take(&mut body.crc).finalize()))
    }
}

impl Write for MeasuredWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut body = self.lock();
        let n = body.out.write(bytes)?;
        body.crc.update(&bytes[..n]);
        body.length += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.lock().out.flush()
    }
}
