//! A video that is being written: the exporter's bytes and the journal, both in the folder `NAME.part`.

use crate::args::RenderArgs;
use crate::drawing::pipeline::Pixels;
use crate::failure::{Failure, output_failure, write_failure};
use crate::output::journal::{self, FrameDelta, Identity, Journal, KeptFrame, Record, Span};
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

/// A video that is being written by an exporter.
pub(crate) struct VideoWriter {
    shown: String,
    sink: Box<dyn FrameSink>,
    body: MeasuredWriter,
    destination: BodyDestination,
}

/// Place of the body while it is written, and how it reaches its destination when the video ends.
enum BodyDestination {
    /// The body has already been written to its destination.
    InPlace,
    /// The body is a temporary file. Head and body are copied to a destination that is not a regular file.
    Copy { body: File, to: File },
    /// The body is in a part folder, and is renamed or copied into place.
    PartFolder(Box<VideoPartFolder>),
}

/// Finished frames of an earlier render, from which this one continues.
#[derive(Default)]
pub(crate) struct ResumedWork {
    /// Number of finished frames, counted from the first frame of the video.
    pub finished_frames: usize,
    pub note: Option<String>,
}

/// Names of the only files that a part folder contains, the lock file last.
const PART_FOLDER_FILES: &[&str] = &["frames", "body", "result", "journal"];

/// Size limit of the journal of another machine in bytes.
const MAX_JOURNAL_BYTES: u64 = 1 << 30;

/// The part folder of a video, with its open files and the state of its journal.
struct VideoPartFolder {
    /// File of the frames that the encoder still holds, created for the first of them. It is closed before the folder is removed.
    frames: Option<File>,
    /// The part folder; its lock file is the journal.
    part: PartFolder,
    place: PathBuf,
    shown: String,
    frames_end: u64,
    delta: FrameDelta,
    scratch: Vec<u8>,
    /// Number of finished frames in the journal.
    finished_frames: usize,
    /// Whether finished frames are kept if the render ends without a result.
    policy: KeepPolicy,
}

/// The user's choice for finished frames: those of an earlier render, and those of this render if it is stopped.
struct KeepPolicy {
    resume: bool,
    discard: bool,
    /// The command that resumes the render.
    resume_command: String,
}

impl VideoWriter {
    /// Begins a video on standard output.
    pub(crate) fn to_stdout(exporter: &dyn Exporter, info: &VideoInfo) -> Result<VideoWriter, Failure> {
        let shown = "standard output".to_string();
        let body = MeasuredWriter::new(Box::new(io::stdout()));
        let sink = exporter.begin(info, Box::new(body.clone())).map_err(|e| export_failure(&shown, e))?;
        Ok(VideoWriter { shown, sink, body, destination: BodyDestination::InPlace })
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
    ) -> Result<(Option<VideoWriter>, ResumedWork), Failure> {
        let shown = path.display().to_string();
        let (parent, name) = match Destination::of(path).map_err(|e| write_failure(&shown, e))? {
            Destination::File { folder, name } => (folder, name),
            Destination::Direct(to) => {
                return VideoWriter::to_pipe_or_device(shown, to, exporter, info)
                    .map(|v| (Some(v), ResumedWork::default()));
            }
        };
        let part = open_part_folder(&parent, &name, args).map_err(|e| write_failure(&shown, e))?;
        if args.resume && is_made() {
            part.remove_other_part_folders();
            return Ok((None, ResumedWork::default()));
        }
        let mut folder = VideoPartFolder::new(part, path, args);
        if args.resume {
            folder.copy_most_complete_folder(identity).map_err(|e| write_failure(&shown, e))?;
        }
        let Some(mut found) = read_nonempty_journal(folder.part.lock_file()) else {
            return Ok((Some(folder.begin(exporter, info, identity)?), ResumedWork::default()));
        };
        folder.finished_frames = found.records.len();
        folder.part.keep(true);
        if !args.resume {
            let note = folder.check_discard(&found.identity, identity, args)?;
            let video = folder.begin(exporter, info, identity)?;
            return Ok((Some(video), ResumedWork { note, ..ResumedWork::default() }));
        }
        provenance::check_same_settings(&shown, &folder.part.path(), &found.identity, identity)?;
        folder.part.check_lock().map_err(|e| write_failure(&shown, e))?;
        found.records.truncate(info.frames as usize);
        if found.records.len() as u64 == info.frames && folder.is_in_place(&found) {
            folder.part.keep(false);
            return Ok((None, ResumedWork { finished_frames: found.records.len(), note: None }));
        }
        let (video, done) = folder.resume(&found, exporter, info, identity)?;
        Ok((Some(video), ResumedWork { finished_frames: done, note: None }))
    }

    /// Begins a video whose output is a pipe or device. It has no part folder, so the render cannot be resumed.
    fn to_pipe_or_device(
        shown: String,
        to: File,
        exporter: &dyn Exporter,
        info: &VideoInfo,
    ) -> Result<VideoWriter, Failure> {
        let failed = |e: io::Error| output_failure(&shown, &e);
        let (destination, out) = match exporter.head_comes_last() {
            true => {
                let body = tempfile::tempfile().map_err(failed)?;
                let out = body.try_clone().map_err(failed)?;
                (BodyDestination::Copy { body, to }, out)
            }
            false => (BodyDestination::InPlace, to),
        };
        let body = MeasuredWriter::new(Box::new(out));
        let sink = exporter.begin(info, Box::new(body.clone())).map_err(|e| export_failure(&shown, e))?;
        Ok(VideoWriter { shown, sink, body, destination })
    }

    /// Adds a frame. `repeated`: the previous frame had the same pixels.
    pub(crate) fn add_frame(&mut self, pixels: &Pixels, repeated: bool) -> Result<(), Failure> {
        pixels.write(&mut *self.sink, repeated).map_err(|e| export_failure(&self.shown, e))?;
        let BodyDestination::PartFolder(folder) = &mut self.destination else { return Ok(()) };
        folder.append_mark(self.sink.mark(), &self.body).map_err(|e| output_failure(&self.shown, &e))
    }

    /// Ends the video, and moves it to its place.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        let VideoWriter { shown, sink, body, destination } = self;
        let head = sink.finish().map_err(|e| export_failure(&shown, e))?;
        let ended = body.lock().out.flush().map_err(WriteError::Io).and_then(|()| match destination {
            BodyDestination::InPlace => Ok(()),
            BodyDestination::Copy { mut body, to } => {
                body.seek(SeekFrom::Start(0))?;
                Ok(write_head_and_body(&head, &mut body, to)?)
            }
            BodyDestination::PartFolder(folder) => folder.finish(&head),
        });
        ended.map_err(|e| write_failure(&shown, e))
    }

    /// Ends the video after a failure. Keeps the part folder for `--resume` if it has finished frames and they are wanted.
    pub(crate) fn end_after_failure(self, keep: bool) {
        let BodyDestination::PartFolder(mut folder) = self.destination else { return };
        let wanted = folder.policy.resume || keep && !folder.policy.discard;
        if folder.finished_frames == 0 || !wanted {
            folder.part.keep(false);
        }
        // If the folder was moved away, the place of the frames is unknown.
        if folder.finished_frames == 0 || !wanted || !folder.part.is_in_place() {
            kept_frames::clear();
        }
    }
}

/// Whether a process makes an output in the part folder of this name.
pub(crate) fn is_being_made(folder: &OpenFolder, part: &Path) -> bool {
    PartFolder::is_held(folder, part, PART_FOLDER_FILES)
}

/// Opens the part folder. Several machines may make the same segment, since a farm may start a task again while its first process still
/// runs. With `--resume` this process waits until the other one has finished the segment, or has died and left its frames.
fn open_part_folder(
    parent: &Arc<OpenFolder>,
    name: &Path,
    args: &RenderArgs,
) -> Result<PartFolder, WriteError> {
    if args.segment.is_none() {
        return PartFolder::open(parent.clone(), name, PART_FOLDER_FILES);
    }
    loop {
        match PartFolder::open_shared(parent.clone(), name, &machine::id(), PART_FOLDER_FILES) {
            Err(WriteError::Busy) if args.resume && !interrupt::is_interrupted() => {
                std::thread::sleep(Duration::from_millis(200));
            }
            opened => return opened,
        }
    }
}

/// Reads a journal; `None` if it has no records.
fn read_nonempty_journal(journal: impl Read) -> Option<Journal> {
    journal::read(BufReader::new(journal)).filter(|found| !found.records.is_empty())
}

fn write_head_and_body(head: &[u8], body: &mut File, mut to: File) -> io::Result<()> {
    to.write_all(head)?;
    io::copy(body, &mut to)?;
    to.flush()
}

impl VideoPartFolder {
    fn new(part: PartFolder, place: &Path, args: &RenderArgs) -> VideoPartFolder {
        VideoPartFolder {
            part,
            place: place.to_path_buf(),
            shown: place.display().to_string(),
            frames: None,
            frames_end: 0,
            delta: FrameDelta::default(),
            scratch: Vec::new(),
            finished_frames: 0,
            policy: KeepPolicy {
                resume: args.resume,
                discard: args.discard,
                resume_command: args.resume_command.clone(),
            },
        }
    }

    /// Copies the part folder of the machine with the most finished frames, if it has more than this one. The folder is not moved, since
    /// its process may be alive where locks have no effect.
    fn copy_most_complete_folder(&mut self, identity: &Identity) -> Result<(), WriteError> {
        let mut most = read_nonempty_journal(self.part.lock_file()).map_or(0, |found| found.records.len());
        self.part.lock_file().rewind()?;
        let mut best = None;
        for other in self.part.other_part_folders() {
            let journal = other.read(Path::new("journal"), MAX_JOURNAL_BYTES).unwrap_or_default();
            let found = read_nonempty_journal(&*journal).filter(|found| found.identity == *identity);
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

    /// Message about finished frames that are deleted because the render starts again. Fails without `--resume` and `--discard` if this very
    /// render could use these frames. Frames of other renders are deleted: after an edit of the script the user wants to
    /// see the new result.
    fn check_discard(
        &self,
        before: &Identity,
        now: &Identity,
        args: &RenderArgs,
    ) -> Result<Option<String>, Failure> {
        let (shown, part) = (&self.shown, self.part.path());
        let (frames, are) = match self.finished_frames {
            1 => ("1 frame".to_string(), "is"),
            n => (format!("{n} frames"), "are"),
        };
        let found = provenance::differences(before, now);
        if found.is_empty() && !args.discard && !args.watch {
            return Err(Failure::Output(format!(
                "{shown}: {frames} of this same render {are} finished in {}\n    hint: --resume goes on with \
                 them, --discard deletes them and renders everything again",
                part.display()
            )));
        }
        let why: Vec<&str> = found.iter().map(|(keyword, ..)| keyword.as_str()).collect();
        let why = match why.is_empty() {
            true => String::new(),
            false => format!(", because these settings differ: {}", why.join(", ")),
        };
        Ok(Some(format!(
            "{shown}: starts again from the first frame; {frames} of a stopped render {are} deleted{why}"
        )))
    }

    fn begin(
        mut self,
        exporter: &dyn Exporter,
        info: &VideoInfo,
        identity: &Identity,
    ) -> Result<VideoWriter, Failure> {
        let shown = self.shown.clone();
        let body = self.start_over(identity).map_err(|e| write_failure(&shown, e))?;
        let sink = exporter.begin(info, Box::new(body.clone())).map_err(|e| export_failure(&shown, e))?;
        Ok(VideoWriter { shown, sink, body, destination: BodyDestination::PartFolder(Box::new(self)) })
    }

    fn start_over(&mut self, identity: &Identity) -> Result<MeasuredWriter, WriteError> {
        self.finished_frames = 0;
        self.part.keep(false);
        self.frames = None;
        self.part.renew_lock()?;
        self.part.lock_file().write_all(&journal::encode_head(identity))?;
        Ok(MeasuredWriter::new(Box::new(self.part.create("body")?)))
    }

    /// Whether the result was already renamed into place: the body is gone, and the file in place has its bytes.
    fn is_in_place(&self, found: &Journal) -> bool {
        let Some((last, _)) = found.records.last() else { return false };
        let settled = matches!(last.kept, KeptFrame::Settled(_));
        settled
            && matches!(self.part.reopen("body"), Ok(None))
            && choreo_files::open_file(&self.place)
                .is_ok_and(|mut f| found.settled_count(&mut f) == found.records.len())
    }

    /// Continues from the frames of an earlier render: takes over the intact part of the journal, the body and the kept frames. Returns the number
    /// of frames taken over.
    fn resume(
        mut self,
        found: &Journal,
        exporter: &dyn Exporter,
        info: &VideoInfo,
        identity: &Identity,
    ) -> Result<(VideoWriter, usize), Failure> {
        let shown = self.shown.clone();
        let failed = |e: io::Error| output_failure(&shown, &e);
        let export_failed = |e| export_failure(&shown, e);
        let not_written = |e| write_failure(&shown, e);
        let mut file = match self.part.reopen("body").map_err(not_written)? {
            Some(file) => file,
            None => self.part.create("body").map_err(not_written)?,
        };
        self.frames = self.part.reopen("frames").map_err(not_written)?;
        let settled = found.settled_count(&mut file);
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
            let Some(kept) = self.read_kept_frame(span, info) else { break };
            sink.again(kept).map_err(export_failed)?;
            self.frames_end = span.offset + u64::from(span.length);
            done += 1;
        }
        if done == 0 {
            drop((sink, out));
            return Ok((self.begin(exporter, info, identity)?, 0));
        }
        let mut journal = self.part.lock_file();
        journal.set_len(found.records[done - 1].1).map_err(failed)?;
        journal.seek(SeekFrom::End(0)).map_err(failed)?;
        out.flush_and_measure().map_err(failed)?;
        self.set_finished_frames(done);
        Ok((
            VideoWriter { shown, sink, body: out, destination: BodyDestination::PartFolder(Box::new(self)) },
            done,
        ))
    }

    /// Reads and decodes a frame that the encoder of the earlier render still held; `None` if its bytes are missing or damaged.
    fn read_kept_frame(&mut self, span: &Span, info: &VideoInfo) -> Option<&[u8]> {
        let frames = self.frames.as_mut()?;
        frames.seek(SeekFrom::Start(span.offset)).ok()?;
        self.scratch.clear();
        frames.take(u64::from(span.length)).read_to_end(&mut self.scratch).ok()?;
        if self.scratch.len() != span.length as usize || crc32fast::hash(&self.scratch) != span.crc {
            return None;
        }
        // No encoder keeps more of a frame than its pixels, and some add a row and a column.
        let most = 4 * (u64::from(info.width) + 1) * (u64::from(info.height) + 1);
        self.delta.decode(&self.scratch, &span.part_lengths, most)
    }

    /// Appends the frame that the sink has just taken to the journal, in the form that its mark states.
    fn append_mark(&mut self, mark: Mark<'_>, body: &MeasuredWriter) -> io::Result<()> {
        // This check stops a render that would otherwise write to deleted files for hours.
        if !self.part.is_in_place() {
            return Err(io::ErrorKind::NotFound.into());
        }
        let kept = match mark {
            Mark::Nothing => return Ok(()),
            Mark::Settled(state) => {
                self.delta.restart();
                self.frames_end = 0;
                KeptFrame::Settled(state)
            }
            Mark::Open(parts) => KeptFrame::Open(self.store_frame(&parts)?),
        };
        let (body, crc) = body.flush_and_measure()?;
        journal::append(&mut self.part.lock_file(), &Record { body, crc, kept })?;
        self.set_finished_frames(self.finished_frames + 1);
        Ok(())
    }

    /// Records the number of finished frames; they are kept even if a signal ends the program.
    fn set_finished_frames(&mut self, frames: usize) {
        self.finished_frames = frames;
        if !self.policy.discard {
            self.part.keep(true);
            kept_frames::set(frames, self.part.path(), self.policy.resume_command.clone());
        }
    }

    /// Appends a frame that the encoder still holds to the file `frames`, delta-encoded.
    fn store_frame(&mut self, parts: &[&[u8]; 3]) -> io::Result<Span> {
        self.delta.encode(parts, &mut self.scratch);
        if self.frames.is_none() {
            self.frames = Some(self.part.create("frames").map_err(io::Error::other)?);
        }
        let span = Span {
            offset: self.frames_end,
            length: self.scratch.len() as u32,
            crc: crc32fast::hash(&self.scratch),
            part_lengths: parts.map(|p| p.len() as u32),
        };
        if let Some(frames) = &mut self.frames {
            // Frames overwrite those before the last settled mark: the file does not grow, and its pages are reused.
            frames.seek(SeekFrom::Start(span.offset))?;
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

/// A writer that counts its bytes and updates their checksum; clones share one output.
#[derive(Clone)]
struct MeasuredWriter(Arc<Mutex<MeasuredOutput>>);

struct MeasuredOutput {
    out: BufWriter<Box<dyn Write + Send>>,
    length: u64,
    crc: crc32fast::Hasher,
}

impl MeasuredWriter {
    fn new(out: Box<dyn Write + Send>) -> MeasuredWriter {
        let out = BufWriter::with_capacity(1 << 16, out);
        MeasuredWriter(Arc::new(Mutex::new(MeasuredOutput { out, length: 0, crc: crc32fast::Hasher::new() })))
    }

    fn lock(&self) -> MutexGuard<'_, MeasuredOutput> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Flushes the written bytes to the system. Returns the length, and the checksum of the bytes since the last call.
    fn flush_and_measure(&self) -> io::Result<(u64, u32)> {
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
