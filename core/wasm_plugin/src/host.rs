//! The host functions that a plugin may call. The plugin runs on its own thread; meanwhile the calling thread answers its
//! requests, because `Files` and `SceneFiles` belong to that thread.

use crate::WasmError;
use crate::call::{Limits, Plugin};
use choreo_plugin::motion::Time;
use choreo_plugin::transfer::Transfer;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};
use wasmtime::{Caller, Extern, Linker, Memory};

/// A request of a plugin to the calling thread.
pub enum HostRequest {
    Read(String),
    Progress(f32),
    WantsClip(usize, String),
    Snapshot(Time),
    /// Opens the file that is named like the main one but with this ending.
    Beside(String),
    /// Appends bytes to the file with this name ending; the main file has an empty one.
    Write(String, Vec<u8>),
}

/// The answer of the calling thread.
pub enum HostAnswer {
    Bytes(Result<Arc<Vec<u8>>, String>),
    Yes(bool),
}

/// The state of one call.
#[derive(Default)]
pub struct Host {
    pub limits: wasmtime::StoreLimits,
    /// Channels to the calling thread; `None` for a manifest or a claim, which may request nothing.
    caller: Option<(Sender<HostRequest>, Receiver<HostAnswer>)>,
    /// Bytes of the last answer, which the host function `take` copies into the plugin's memory.
    ready: Arc<Vec<u8>>,
    /// Name endings of the files beside the main one; the plugin counts them from 1.
    beside: Vec<String>,
    /// Time that the calling thread has taken to answer so far.
    pub answering: Duration,
    /// Message of the plugin's panic.
    pub panic: Option<String>,
}

impl Host {
    /// The state of a call that may read `ready` and request nothing else.
    pub fn with_file(ready: Arc<Vec<u8>>) -> Host {
        Host { ready, ..Host::default() }
    }

    fn ask(&mut self, ask: HostRequest) -> Result<HostAnswer, wasmtime::Error> {
        let ended = || wasmtime::Error::msg("the program has cancelled the call");
        let Some((asks, answers)) = &self.caller else {
            return Ok(HostAnswer::Bytes(Err("there are no further files".into())));
        };
        let start = Instant::now();
        asks.send(ask).map_err(|_| ended())?;
        let answer = answers.recv().map_err(|_| ended());
        self.answering += start.elapsed();
        answer
    }

    /// Stores the bytes of an answer, or its error text, for `take`. Returns the length.
    fn receive(&mut self, answer: HostAnswer) -> Result<usize, usize> {
        let bytes = match answer {
            HostAnswer::Bytes(bytes) => bytes,
            HostAnswer::Yes(_) => Err("the program gave an answer of another type".into()),
        };
        let failed = bytes.is_err();
        self.ready = bytes.unwrap_or_else(|text| Arc::new(text.into_bytes()));
        if failed { Err(self.ready.len()) } else { Ok(self.ready.len()) }
    }
}

/// Stack size in bytes of the thread that a plugin runs on.
const STACK_BYTES: usize = 8 << 20;

/// Runs a call on a new thread and answers its requests on this thread until the call ends. An error of `answer` ends the call.
pub fn serve<T: Transfer + Send, E>(
    plugin: &Plugin,
    function: &str,
    argument: &[u8],
    file: Arc<Vec<u8>>,
    limits: Limits,
    mut answer: impl FnMut(HostRequest) -> Result<HostAnswer, E>,
) -> Result<Result<T, WasmError>, E> {
    let ((asks, asked), (answers, answered)) = (channel(), channel());
    let host = Host { caller: Some((asks, answered)), ..Host::with_file(file) };
    std::thread::scope(|scope| {
        let call = move || plugin.call(function, argument, host, limits);
        let thread = std::thread::Builder::new().name("plugin".into()).stack_size(STACK_BYTES);
        let Ok(thread) = thread.spawn_scoped(scope, call) else {
            return Ok(Err(WasmError("it cannot start a thread".into())));
        };
        let served = asked.into_iter().try_for_each(|ask| {
            // The send fails if the call has ended, which is no error.
            answer(ask).map(|answer| drop(answers.send(answer)))
        });
        drop(answers);
        let result = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        served.map(|()| result)
    })
}

/// Maximum bytes of a name or text.
const MAX_TEXT_BYTES: usize = 64 << 10;

/// Maximum number of files beside the main one of an export.
const MAX_FILES: usize = 10_000;

fn memory(caller: &mut Caller<'_, Host>) -> Result<Memory, wasmtime::Error> {
    match caller.get_export("memory") {
        Some(Extern::Memory(memory)) => Ok(memory),
        _ => Err(wasmtime::Error::msg("the plugin exports no memory")),
    }
}

fn bytes<'c>(caller: &'c mut Caller<'_, Host>, place: u32, length: u32) -> Result<&'c [u8], wasmtime::Error> {
    let memory = memory(caller)?;
    let start = place as usize;
    let bytes = memory.data(&*caller).get(start..start + length as usize);
    bytes.ok_or_else(|| wasmtime::Error::msg("bytes outside of the plugin's memory"))
}

fn text(caller: &mut Caller<'_, Host>, place: u32, length: u32) -> Result<String, wasmtime::Error> {
    match length as usize <= MAX_TEXT_BYTES {
        true => Ok(String::from_utf8_lossy(bytes(caller, place, length)?).into_owned()),
        false => Err(wasmtime::Error::msg(format!("a text of {length} bytes, {MAX_TEXT_BYTES} are allowed"))),
    }
}

/// Registers the host functions.
pub fn link(linker: &mut Linker<Host>) -> Result<(), WasmError> {
    let wrong = |e: wasmtime::Error| WasmError(e.to_string());
    linker.func_wrap("choreo", "read", read).map_err(wrong)?;
    linker.func_wrap("choreo", "take", take).map_err(wrong)?;
    linker.func_wrap("choreo", "numbers", numbers).map_err(wrong)?;
    linker.func_wrap("choreo", "progress", progress).map_err(wrong)?;
    linker.func_wrap("choreo", "wants_clip", wants_clip).map_err(wrong)?;
    linker.func_wrap("choreo", "snapshot", snapshot).map_err(wrong)?;
    linker.func_wrap("choreo", "beside", beside).map_err(wrong)?;
    linker.func_wrap("choreo", "write", write).map_err(wrong)?;
    linker.func_wrap("choreo", "panicked", panicked).map_err(wrong)?;
    Ok(())
}

fn read(mut caller: Caller<'_, Host>, name: u32, length: u32) -> Result<i64, wasmtime::Error> {
    let name = text(&mut caller, name, length)?;
    let host = caller.data_mut();
    let answer = host.ask(HostRequest::Read(name))?;
    Ok(host.receive(answer).map_or_else(|text| -1 - text as i64, |length| length as i64))
}

fn take(mut caller: Caller<'_, Host>, place: u32) -> Result<(), wasmtime::Error> {
    let bytes = std::mem::take(&mut caller.data_mut().ready);
    let memory = memory(&mut caller)?;
    let written = memory.write(&mut caller, place as usize, &bytes);
    written.map_err(|_| wasmtime::Error::msg("a place outside of the plugin's memory"))
}

/// Maximum count of numbers that one call reads.
const MAX_NUMBERS: usize = 1024;

/// Host function that parses numbers of a text, for `choreo_plugin::TextNumbers`.
fn numbers(
    mut caller: Caller<'_, Host>,
    kind: u32,
    text: u32,
    length: u32,
    values: u32,
    ends: u32,
    most: u32,
) -> Result<u32, wasmtime::Error> {
    let (mut read, mut at) = ([0; MAX_NUMBERS], [0; MAX_NUMBERS]);
    let most = MAX_NUMBERS.min(most as usize);
    let text = bytes(&mut caller, text, length)?;
    let count = choreo_plugin::read_block(kind, text, &mut read[..most], &mut at[..most]);
    let outside = |_| wasmtime::Error::msg("a place outside of the plugin's memory");
    let memory = memory(&mut caller)?;
    let (read, at) = (bytemuck::cast_slice(&read[..count]), bytemuck::cast_slice(&at[..count]));
    memory.write(&mut caller, values as usize, read).map_err(outside)?;
    memory.write(&mut caller, ends as usize, at).map_err(outside)?;
    Ok(count as u32)
}

fn progress(mut caller: Caller<'_, Host>, part: f32) -> Result<i32, wasmtime::Error> {
    let answer = caller.data_mut().ask(HostRequest::Progress(part))?;
    Ok(i32::from(!matches!(answer, HostAnswer::Yes(false))))
}

fn wants_clip(
    mut caller: Caller<'_, Host>,
    index: u32,
    name: u32,
    length: u32,
) -> Result<i32, wasmtime::Error> {
    let name = text(&mut caller, name, length)?;
    let answer = caller.data_mut().ask(HostRequest::WantsClip(index as usize, name))?;
    Ok(i32::from(!matches!(answer, HostAnswer::Yes(false))))
}

fn snapshot(mut caller: Caller<'_, Host>, time: i64) -> Result<u32, wasmtime::Error> {
    let host = caller.data_mut();
    let answer = host.ask(HostRequest::Snapshot(Time(time)))?;
    match host.receive(answer) {
        Ok(length) => {
            u32::try_from(length).map_err(|_| wasmtime::Error::msg("a snapshot of more than 4 GiB"))
        }
        Err(_) => Err(wasmtime::Error::msg("there is no scene to ask for poses")),
    }
}

/// Ends the call with an error unless the answer is yes.
fn check_answer(answer: HostAnswer) -> Result<(), wasmtime::Error> {
    match answer {
        HostAnswer::Yes(true) => Ok(()),
        HostAnswer::Bytes(Err(text)) => Err(wasmtime::Error::msg(text)),
        _ => Err(wasmtime::Error::msg("the program has refused")),
    }
}

fn beside(mut caller: Caller<'_, Host>, ending: u32, length: u32) -> Result<u32, wasmtime::Error> {
    let ending = text(&mut caller, ending, length)?;
    let host = caller.data_mut();
    if host.beside.len() >= MAX_FILES {
        return Err(wasmtime::Error::msg(format!("more than {MAX_FILES} files")));
    }
    let answer = host.ask(HostRequest::Beside(ending.clone()))?;
    check_answer(answer)?;
    host.beside.push(ending);
    Ok(host.beside.len() as u32)
}

fn write(mut caller: Caller<'_, Host>, file: u32, place: u32, length: u32) -> Result<(), wasmtime::Error> {
    let bytes = bytes(&mut caller, place, length)?.to_vec();
    let host = caller.data_mut();
    let ending = match file {
        0 => Some(String::new()),
        file => host.beside.get(file as usize - 1).cloned(),
    };
    let ending = ending.ok_or_else(|| wasmtime::Error::msg(format!("there is no file {file}")))?;
    let answer = host.ask(HostRequest::Write(ending, bytes))?;
    check_answer(answer)
}

fn panicked(mut caller: Caller<'_, Host>, place: u32, length: u32) {
    let said = text(&mut caller, place, length).unwrap_or_default();
    caller.data_mut().panic = Some(said);
}
