//! Importers in one file: a zero byte and then what a fixed script reads by every function there is; or the text of an importer
//! and, behind a zero byte, what it reads (itself, where nothing follows).
#![no_main]

use choreo_fuzz::{SingleFile, import};
use choreo_rhai_importer::RhaiImporter;
use libfuzzer_sys::{Corpus, fuzz_target};
use std::sync::LazyLock;

/// A tenth of a second.
const STEPS: u64 = 50_000;

static EVERYTHING: LazyLock<RhaiImporter> = LazyLock::new(|| {
    let text = include_str!("everything.importer.rhai");
    RhaiImporter::from_text("everything.importer.rhai", text).expect("our own").with_steps(STEPS)
});

fuzz_target!(|bytes: &[u8]| -> Corpus {
    if let [0, file @ ..] = bytes {
        import(&*EVERYTHING, "fuzz.dat", file, &SingleFile(file));
        return Corpus::Keep;
    }
    let mut parts = bytes.splitn(2, |b| *b == 0);
    let text = parts.next().unwrap_or_default();
    let Ok(words) = std::str::from_utf8(text) else { return Corpus::Reject };
    let file = parts.next().unwrap_or(text);
    match RhaiImporter::from_text("fuzz.importer.rhai", words) {
        Ok(importer) => import(&importer.with_steps(STEPS), "fuzz.dat", file, &SingleFile(file)),
        Err(error) => assert!(error.line >= 1 && error.column >= 1 && !error.message.is_empty()),
    }
    Corpus::Keep
});
