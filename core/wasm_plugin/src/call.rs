//! One call of a plugin function, in a fresh instance with its own memory and limits.

use crate::WasmError;
use crate::host::{self, Host};
use choreo_plugin::guest::ABI;
use choreo_plugin::transfer::{Transfer, from_memory};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};
use thiserror::Error;
use wasmtime::{
    Config, Engine, Instance, Linker, Memory, Module, OptLevel, Store, StoreLimitsBuilder, Trap, TypedFunc,
    UpdateDeadline, WasmParams, WasmResults,
};

type Result<T> = std::result::Result<T, WasmError>;

/// Limits of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Maximum bytes of the plugin's memory.
    pub memory: usize,
    /// Wall-clock time, without the time that the host takes to answer.
    pub time: Duration,
}

impl Limits {
    /// Limits for a file of `bytes` bytes: memory of 256 MiB plus 32 times the file, at most 4 GiB; one minute.
    pub fn for_file(bytes: usize) -> Limits {
        let memory = bytes.saturating_mul(32).saturating_add(256 << 20).min(4 << 30);
        Limits { memory, time: Duration::from_secs(60) }
    }

    /// Limits for the manifest.
    pub const FOR_MANIFEST: Limits = Limits { memory: 64 << 20, time: Duration::from_secs(2) };
}

/// Interval at which a running plugin is interrupted to check the clock.
const EPOCH_INTERVAL: Duration = Duration::from_millis(20);

/// A compiled plugin.
#[derive(Clone)]
pub struct Plugin {
    engine: Engine,
    module: Module,
}

impl Plugin {
    /// Compiles a plugin. Its exports are not checked.
    pub fn compile(bytes: &[u8]) -> Result<Plugin> {
        let mut config = Config::new();
        // Relaxed SIMD and the bits of NaN depend on the machine, so the first is off and the second are made canonical.
        config.wasm_relaxed_simd(false).cranelift_nan_canonicalization(true);
        config.epoch_interruption(true).cranelift_opt_level(OptLevel::Speed);
        let wrong =
            |e: wasmtime::Error| WasmError(format!("it is not a WebAssembly plugin: {}", first_line(&e)));
        let engine = Engine::new(&config).map_err(wrong)?;
        let module = Module::from_binary(&engine, bytes).map_err(wrong)?;
        Ok(Plugin { engine, module })
    }

    /// Whether the plugin exports a function of this name.
    pub fn exports(&self, function: &str) -> bool {
        self.module.get_export(function).is_some()
    }

    /// Calls an exported function of the plugin with an argument and decodes the result.
    pub fn call<T: Transfer>(
        &self,
        function: &str,
        argument: &[u8],
        mut host: Host,
        limits: Limits,
    ) -> Result<T> {
        host.limits = StoreLimitsBuilder::new().memory_size(limits.memory).instances(1).memories(1).build();
        let mut store = Store::new(&self.engine, host);
        store.limiter(|host| &mut host.limits);
        let start = Instant::now();
        store.epoch_deadline_callback(move |context| {
            match start.elapsed() < limits.time + context.data().answering {
                true => Ok(UpdateDeadline::Continue(1)),
                false => Err(wasmtime::Error::from(OutOfTime)),
            }
        });
        store.set_epoch_deadline(1);
        let _clock = EpochClock::start(&self.engine);
        let mut linker = Linker::new(&self.engine);
        host::link(&mut linker)?;
        let instance = linker.instantiate(&mut store, &self.module);
        let result = instance
            .map_err(CallError::Trap)
            .and_then(|instance| run(&mut store, &instance, function, argument));
        let (memory, place, length) = result.map_err(|stop| stop.into_error(&store, limits))?;
        let memory = memory.data(&store);
        let Some(bytes) = memory.get(place..place.saturating_add(length)) else {
            let what = format!("its result, {length} bytes at {place}, lies outside of its memory");
            return Err(WasmError(what));
        };
        from_memory(bytes, memory).map_err(|e| WasmError(format!("its result cannot be read: {e}")))
    }
}

/// Why a call has ended without a result.
enum CallError {
    Text(String),
    Trap(wasmtime::Error),
}

impl CallError {
    fn into_error(self, store: &Store<Host>, limits: Limits) -> WasmError {
        let error = match self {
            CallError::Text(text) => return WasmError(text),
            CallError::Trap(error) => error,
        };
        if error.downcast_ref::<OutOfTime>().is_some() {
            let secs = limits.time.as_secs_f64();
            return WasmError(format!("it takes more than {secs} s, which is the limit"));
        }
        if let Some(panic) = &store.data().panic {
            return WasmError(panic.lines().collect::<Vec<_>>().join(" "));
        }
        match error.downcast_ref::<Trap>() {
            Some(Trap::StackOverflow) => {
                WasmError("its calls are nested too deeply; does a function call itself without end?".into())
            }
            Some(trap) => {
                let memory = limits.memory >> 20;
                WasmError(format!("it was stopped: {trap}; its memory may be {memory} MiB at most"))
            }
            None => WasmError(first_line(&error)),
        }
    }
}

#[derive(Debug, Error)]
#[error("out of time")]
struct OutOfTime;

fn first_line(error: &wasmtime::Error) -> String {
    let root = error.root_cause().to_string();
    root.lines().next().unwrap_or_default().to_string()
}

type CallResult<T> = std::result::Result<T, CallError>;

fn function<P: WasmParams, R: WasmResults>(
    store: &mut Store<Host>,
    instance: &Instance,
    name: &str,
) -> CallResult<TypedFunc<P, R>> {
    let missing =
        |_| CallError::Text(format!("it exports no function {name} with the signature that choreo calls"));
    instance.get_typed_func(store, name).map_err(missing)
}

/// Calls function `name`. Returns the plugin's memory, and place and length of the result in it.
fn run(
    store: &mut Store<Host>,
    instance: &Instance,
    name: &str,
    argument: &[u8],
) -> CallResult<(Memory, usize, usize)> {
    let text = |text: String| CallError::Text(text);
    let abi = function::<(), u32>(store, instance, "choreo_abi")?;
    let abi = abi.call(&mut *store, ()).map_err(CallError::Trap)?;
    if abi != ABI {
        let older = if abi < ABI { "build it again with this choreo" } else { "update choreo" };
        return Err(text(format!(
            "it was built for version {abi} of the plugin interface, choreo has version {ABI}; {older}"
        )));
    }
    let memory = instance.get_memory(&mut *store, "memory");
    let memory = memory.ok_or_else(|| text("it exports no memory".into()))?;
    let argument_place = function::<u32, u32>(store, instance, "choreo_argument")?;
    let call = function::<(), u64>(store, instance, name)?;
    let length = u32::try_from(argument.len()).map_err(|_| text("a request of more than 4 GiB".into()))?;
    let place = argument_place.call(&mut *store, length).map_err(CallError::Trap)?;
    let written = memory.write(&mut *store, place as usize, argument);
    written.map_err(|_| text(format!("its argument at {place} lies outside of its memory")))?;
    let result = call.call(&mut *store, ()).map_err(CallError::Trap)?;
    Ok((memory, (result >> 32) as usize, result as u32 as usize))
}

/// Thread that advances the engine's epoch every [`EPOCH_INTERVAL`], so that running calls check their time limit. Ends when dropped.
struct EpochClock(Option<(Sender<()>, std::thread::JoinHandle<()>)>);

impl EpochClock {
    fn start(engine: &Engine) -> EpochClock {
        let (end, ended) = channel::<()>();
        let engine = engine.clone();
        let tick = move || {
            while ended.recv_timeout(EPOCH_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                engine.increment_epoch();
            }
        };
        let thread = std::thread::Builder::new().name("plugin clock".into()).spawn(tick);
        EpochClock(thread.ok().map(|thread| (end, thread)))
    }
}

impl Drop for EpochClock {
    fn drop(&mut self) {
        if let Some((end, thread)) = self.0.take() {
            drop(end);
            let _ = thread.join();
        }
    }
}
