//! The plugin's side of WebAssembly: [`crate::wasm_importer!`] and [`crate::wasm_exporter!`] export an importer or a scene exporter from a
//! crate that is compiled for `wasm32-unknown-unknown`. The program's side is `core/wasm_plugin`, where the calls are described.

use crate::transfer::{
    ExportReply, ExportRequest, ImportReply, ImportRequest, Transfer, TransferError, Written, from_bytes,
    missing_parts,
};
use crate::{ExportError, Files, ImportError, Importer, Manifest, SceneExporter, SceneFiles, Source};
use choreo_motion::Time;
use choreo_stage::Snapshot;
use std::collections::BTreeMap;
use std::io::{BufWriter, Write};
use std::sync::{Arc, Mutex, PoisonError};

/// Version of the calls and of the bytes that are handed over. The program refuses plugins of another version.
pub const ABI: u32 = 2;

/// The argument of the next call.
static ARGUMENT: Mutex<Vec<u8>> = Mutex::new(Vec::new());

/// Allocates an argument of `length` bytes and returns its address.
pub fn argument_place(length: u32) -> u32 {
    report_panics();
    let mut argument = ARGUMENT.lock().unwrap_or_else(PoisonError::into_inner);
    *argument = vec![0; length as usize];
    argument.as_mut_ptr().addr() as u32
}

fn argument<T: Transfer>() -> Result<T, TransferError> {
    let bytes = std::mem::take(&mut *ARGUMENT.lock().unwrap_or_else(PoisonError::into_inner));
    from_bytes(&bytes)
}

/// Leaks a result and returns its address in the upper 32 bits and its length in the lower 32. After the call the program reads the result
/// and the lists that it refers to. Nothing is freed, because the program makes no further call in this memory.
fn reply<T: Transfer>(value: T) -> u64 {
    let mut out = Written::by_address();
    value.write(&mut out);
    std::mem::forget(value);
    let bytes = out.into_bytes().leak();
    (bytes.as_ptr().addr() as u64) << 32 | bytes.len() as u64
}

/// A plugin's manifest.
pub fn manifest(manifest: &Manifest) -> u64 {
    reply(manifest.clone())
}

/// The importer's claim on a file.
pub fn claim(importer: &dyn Importer) -> u64 {
    let claim = argument::<ImportRequest>().map(|request| importer.claim(&source(&request)));
    reply(claim.unwrap_or(crate::Claim::NotMine))
}

/// The file of a request.
fn source(request: &ImportRequest) -> Source {
    Source { name: request.name.clone(), bytes: Arc::new(read_ready_bytes(request.length)) }
}

/// Copies the bytes that the program holds ready: the file of an import, or the result of the last `read` or `snapshot`.
fn read_ready_bytes(length: usize) -> Vec<u8> {
    host::read_ready_bytes(length)
}

/// Lets the program parse the numbers of a text: see [`read_block`](crate::text_numbers::read_block).
pub(crate) fn numbers(kind: u32, text: &[u8], values: &mut [u64], ends: &mut [u32]) -> usize {
    host::numbers(kind, text, values, ends)
}

/// Imports a file.
pub fn import(importer: &dyn Importer) -> u64 {
    let error = |file: &str, what: String| {
        let (file, place) = (file.to_string(), String::new());
        ImportReply::Error(ImportError { file, place, what, hint: None })
    };
    let request = match argument::<ImportRequest>() {
        Ok(request) => request,
        Err(fault) => return reply(error("", fault.to_string())),
    };
    let imported = importer.import(&source(&request), &HostFiles, request.needs, &request.options);
    reply(match imported {
        Ok(asset) => match missing_parts(&asset) {
            None => ImportReply::Asset(Box::new(asset)),
            Some(part) => {
                let what = format!("the asset has {part}, which a WebAssembly plugin cannot return");
                error(&request.name, what)
            }
        },
        Err(error) => ImportReply::Error(error),
    })
}

/// Exports a scene.
pub fn export(exporter: &dyn SceneExporter) -> u64 {
    let notes = argument::<ExportRequest>().map_err(|e| e.to_string()).and_then(|request| {
        let scene = request.scene.into_scene(snapshot_at).map_err(|e| e.to_string())?;
        let mut files = HostSceneFiles { main: file(0), beside: BTreeMap::new() };
        let notes = exporter.export(&scene, &mut files).map_err(|e| e.to_string())?;
        files.flush().map_err(|e| e.to_string())?;
        Ok(notes)
    });
    reply(notes.map_or_else(ExportReply::Error, ExportReply::Notes))
}

/// The calls that a plugin may make. Where the program cannot do what they ask, it ends the plugin's call.
#[cfg(target_arch = "wasm32")]
mod host {
    // SAFETY: the program defines these functions with these types, and reads and writes only the bytes that they name.
    #[allow(unsafe_code)]
    #[link(wasm_import_module = "choreo")]
    unsafe extern "C" {
        /// Reads a file by its name. Returns its length, or on failure −1 − the length of the error text.
        pub safe fn read(name: *const u8, length: usize) -> i64;
        /// Copies the bytes that are ready (the file of an import, the last `read` or `snapshot`) to an address.
        #[link_name = "take"]
        fn copy_ready_bytes(to: *mut u8);
        /// Parses the numbers of one type in a text, and writes each number and the byte behind it. Returns how many there were.
        #[link_name = "numbers"]
        safe fn numbers_of(
            kind: u32,
            text: *const u8,
            length: usize,
            values: *mut u64,
            ends: *mut u32,
            most: usize,
        ) -> usize;
        /// `Files::progress`.
        pub safe fn progress(part: f32) -> i32;
        /// `Files::wants_clip`.
        pub safe fn wants_clip(index: usize, name: *const u8, length: usize) -> i32;
        /// Makes the snapshot at a time and returns its length in bytes.
        pub safe fn snapshot(time: i64) -> usize;
        /// Opens the file beside the main one that has this ending, and returns its number. The main file is number 0.
        pub safe fn beside(ending: *const u8, length: usize) -> u32;
        /// Appends bytes to a file.
        pub safe fn write(file: u32, bytes: *const u8, length: usize);
        /// Reports the text of a panic, before the panic ends the call.
        pub safe fn panicked(text: *const u8, length: usize);
    }

    /// Copies the `length` bytes that the program holds ready.
    pub fn read_ready_bytes(length: usize) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(length);
        // SAFETY: the program writes as many bytes as it has stated, from the place on; bytes that nothing has written are never read.
        #[allow(unsafe_code)]
        unsafe {
            copy_ready_bytes(bytes.as_mut_ptr());
            bytes.set_len(length);
        }
        bytes
    }

    pub fn numbers(kind: u32, text: &[u8], values: &mut [u64], ends: &mut [u32]) -> usize {
        let most = values.len().min(ends.len());
        numbers_of(kind, text.as_ptr(), text.len(), values.as_mut_ptr(), ends.as_mut_ptr(), most)
    }
}

/// Stubs for tests of the plugin's crate, in which no program hosts the plugin.
#[cfg(not(target_arch = "wasm32"))]
mod host {
    pub(super) fn read(_: *const u8, _: usize) -> i64 {
        -1
    }
    pub(super) fn read_ready_bytes(length: usize) -> Vec<u8> {
        vec![0; length]
    }
    pub(super) use crate::text_numbers::read_block as numbers;
    pub(super) fn progress(_: f32) -> i32 {
        1
    }
    pub(super) fn wants_clip(_: usize, _: *const u8, _: usize) -> i32 {
        1
    }
    pub(super) fn snapshot(_: i64) -> usize {
        0
    }
    pub(super) fn beside(_: *const u8, _: usize) -> u32 {
        0
    }
    pub(super) fn write(_: u32, _: *const u8, _: usize) {}
    pub(super) fn panicked(_: *const u8, _: usize) {}
}

/// Files beside the source, which the program reads.
struct HostFiles;

impl Files for HostFiles {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        let length = host::read(relative.as_ptr(), relative.len());
        let bytes = read_ready_bytes(if length < 0 { -1 - length } else { length } as usize);
        match length < 0 {
            true => Err(String::from_utf8_lossy(&bytes).into_owned()),
            false => Ok(Arc::new(bytes)),
        }
    }

    fn progress(&self, part: f32) -> bool {
        host::progress(part) != 0
    }

    fn wants_clip(&self, index: usize, name: &str) -> bool {
        host::wants_clip(index, name.as_ptr(), name.len()) != 0
    }
}

/// A snapshot of the exported scene.
fn snapshot_at(time: Time) -> Snapshot {
    let bytes = read_ready_bytes(host::snapshot(time.0));
    from_bytes(&bytes).unwrap_or_else(|e| panic!("an invalid snapshot: {e}"))
}

/// The files of an export, which the program writes.
struct HostSceneFiles {
    main: BufWriter<HostFile>,
    beside: BTreeMap<String, BufWriter<HostFile>>,
}

impl HostSceneFiles {
    fn flush(&mut self) -> std::io::Result<()> {
        self.main.flush()?;
        self.beside.values_mut().try_for_each(Write::flush)
    }
}

impl SceneFiles for HostSceneFiles {
    fn main(&mut self) -> &mut dyn Write {
        &mut self.main
    }

    fn beside(&mut self, ending: &str) -> Result<&mut dyn Write, ExportError> {
        let open = || file(host::beside(ending.as_ptr(), ending.len()));
        Ok(self.beside.entry(ending.to_string()).or_insert_with(open))
    }
}

struct HostFile(u32);

fn file(number: u32) -> BufWriter<HostFile> {
    BufWriter::with_capacity(64 << 10, HostFile(number))
}

impl Write for HostFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        host::write(self.0, bytes.as_ptr(), bytes.len());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Reports panics to the program before they end in a trap, which has no text.
fn report_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let text = panic.to_string();
        host::panicked(text.as_ptr(), text.len());
    }));
}

/// Exports an importer from a crate that is compiled for `wasm32-unknown-unknown`; for any other target it does nothing, so that the
/// crate's tests run as those of every crate.
///
/// ```
/// # use choreo_plugin::{Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source};
/// # use choreo_plugin::asset::Asset;
/// # struct Ply(Manifest);
/// # impl Importer for Ply {
/// #     fn manifest(&self) -> &Manifest { &self.0 }
/// #     fn import(&self, _: &Source, _: &dyn Files, _: ImportScope, _: &ImportOptions) -> Result<Asset, ImportError> {
/// #         Ok(Asset::default())
/// #     }
/// # }
/// static PLY: std::sync::LazyLock<Ply> = std::sync::LazyLock::new(|| Ply(Manifest::new("ply", "1.0.0", "polygons")));
/// choreo_plugin::wasm_importer!(*PLY);
/// ```
#[macro_export]
macro_rules! wasm_importer {
    ($importer:expr) => {
        #[cfg(target_arch = "wasm32")]
        const _: () = {
            $crate::wasm_plugin!($crate::Importer::manifest(&$importer));
            #[unsafe(no_mangle)]
            extern "C" fn choreo_claim() -> u64 {
                $crate::guest::claim(&$importer)
            }
            #[unsafe(no_mangle)]
            extern "C" fn choreo_import() -> u64 {
                $crate::guest::import(&$importer)
            }
        };
    };
}

/// Exports a scene exporter from a crate, as [`wasm_importer!`](crate::wasm_importer) does an importer. The stage of its scene has the
/// actors with their assets, the names of the cameras, size, frame rate and length; its snapshots have actors, camera and lights.
///
/// ```
/// # use choreo_plugin::{ExportError, ExportedScene, Manifest, SceneExporter, SceneFiles};
/// # struct Cast(Manifest);
/// # impl SceneExporter for Cast {
/// #     fn manifest(&self) -> &Manifest { &self.0 }
/// #     fn export(&self, _: &ExportedScene, _: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> { Ok(Vec::new()) }
/// # }
/// static CAST: std::sync::LazyLock<Cast> = std::sync::LazyLock::new(|| Cast(Manifest::new("cast", "1.0.0", "names")));
/// choreo_plugin::wasm_exporter!(*CAST);
/// ```
#[macro_export]
macro_rules! wasm_exporter {
    ($exporter:expr) => {
        #[cfg(target_arch = "wasm32")]
        const _: () = {
            $crate::wasm_plugin!($crate::SceneExporter::manifest(&$exporter));
            #[unsafe(no_mangle)]
            extern "C" fn choreo_export() -> u64 {
                $crate::guest::export(&$exporter)
            }
        };
    };
}

/// The functions that plugins of all kinds export.
#[doc(hidden)]
#[macro_export]
macro_rules! wasm_plugin {
    ($manifest:expr) => {
        #[unsafe(no_mangle)]
        extern "C" fn choreo_abi() -> u32 {
            $crate::guest::ABI
        }
        #[unsafe(no_mangle)]
        extern "C" fn choreo_argument(length: u32) -> u32 {
            $crate::guest::argument_place(length)
        }
        #[unsafe(no_mangle)]
        extern "C" fn choreo_manifest() -> u64 {
            $crate::guest::manifest($manifest)
        }
    };
}
