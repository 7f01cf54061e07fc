//! Results of earlier runs, for `--changed`: a section that passed is not run again while everything that it depends on is unchanged.
//!
//! An outcome depends on the program, the options of the run, the text of the section and the text outside all sections of its file. It
//! also depends on the content of every file that was read and of every golden image, and on the absence of files in folders that would
//! have been searched first. Failures, skipped sections, and sections that expect an error are not stored, since the name of a file that
//! would end the error is unknown.

use crate::collect::Case;
use crate::outcome::{Outcome, Status};
use choreo_files::write_whole_beneath;
use choreo_script::{add_to_hash, content_of, hex};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Version of the entries, raised when their meaning changes.
const FORMAT: u32 = 1;
/// Largest entry in bytes; normal entries have a few kilobytes.
const MAX_ENTRY_BYTES: u64 = 4 << 20;
/// Largest script in bytes.
const MAX_SCRIPT_BYTES: u64 = 64 << 20;

type Hash = [u8; 32];

pub struct Results {
    folder: PathBuf,
    /// Hash of the program and its options.
    program_hash: Hash,
    /// Content hashes of the files that were read in this run; `None` if a file cannot be read.
    content_hashes: Mutex<HashMap<PathBuf, Option<Hash>>>,
    /// Hash of the whole text, and of the lines outside sections, for each test file.
    outside_hashes: Mutex<HashMap<PathBuf, (Hash, Hash)>>,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    format: u32,
    /// Hash of the program, the options and the section's text, in hexadecimal digits.
    base: String,
    files: Vec<(PathBuf, String)>,
    pictures: Vec<(PathBuf, String)>,
    /// Other paths at which a file of the same relative name could be found, and whether it existed.
    elsewhere: Vec<(PathBuf, bool)>,
    outcome: Outcome,
}

/// An earlier outcome, and the files that it depends on.
pub struct StoredOutcome {
    pub outcome: Outcome,
    pub files: Vec<PathBuf>,
    pub pictures: Vec<PathBuf>,
}

impl Results {
    /// Opens the results in a folder. `identity`: texts that identify this program and its options.
    pub fn new(folder: PathBuf, identity: &[&str]) -> Results {
        let mut hasher = blake3::Hasher::new();
        for text in identity {
            add_to_hash(&mut hasher, text.as_bytes());
        }
        Results {
            folder,
            program_hash: *hasher.finalize().as_bytes(),
            content_hashes: Mutex::default(),
            outside_hashes: Mutex::default(),
        }
    }

    /// Earlier outcome of a section, if everything is unchanged. Damaged and old entries are ignored, and so are those of another user.
    pub fn find(&self, case: &Case) -> Option<StoredOutcome> {
        let bytes = choreo_files::read(&self.entry_path(case)?, MAX_ENTRY_BYTES).ok()?;
        let entry: Entry = serde_json::from_slice(&bytes).ok()?;
        let is_unchanged =
            |(path, hash): &(PathBuf, String)| self.content_hash(path).is_some_and(|h| hex(&h) == *hash);
        let is_current = entry.format == FORMAT
            && entry.outcome.status == Status::Passed
            && entry.base
                == hex(&self.base_hash(case, &choreo_files::read(&case.path, MAX_SCRIPT_BYTES).ok()?)?)
            && entry.elsewhere.iter().all(|(path, there)| path.exists() == *there)
            && entry.files.iter().chain(&entry.pictures).all(is_unchanged);
        if !is_current {
            return None;
        }
        let info = case.section.as_ref().ok()?;
        let mut outcome = entry.outcome;
        // The path of the file may be given differently now, and lines above the section may have been added or removed.
        outcome.file = case.file.clone();
        outcome.place.file = case.file.clone();
        outcome.place.line = info.line;
        outcome.reused = true;
        let names = |list: Vec<(PathBuf, String)>| list.into_iter().map(|(path, _)| path).collect();
        Some(StoredOutcome { outcome, files: names(entry.files), pictures: names(entry.pictures) })
    }

    /// Stores a passed outcome and sets its key. If the folder cannot be written, the section is simply run again next time. `files` and
    /// `pictures` carry hashes of the content that was read: the files may have changed since.
    pub fn store(
        &self,
        case: &Case,
        outcome: &mut Outcome,
        files: &[(PathBuf, Hash)],
        pictures: &[(PathBuf, Option<Hash>)],
        roots: &[PathBuf],
    ) {
        let Ok(text) = choreo_files::read(&case.path, MAX_SCRIPT_BYTES) else { return };
        let (Some(base), Some(entry_path)) = (self.base_hash(case, &text), self.entry_path(case)) else {
            return;
        };
        let own = case.path.canonicalize().ok();
        // If the script was saved during the run, the text that passed is not the current one.
        let read = files.iter().find(|(path, _)| Some(path) == own.as_ref());
        if read.is_some_and(|(_, hash)| blake3::hash(&text) != *hash) {
            return;
        }
        let files: Vec<(PathBuf, String)> = files
            .iter()
            .filter(|(path, _)| Some(path) != own.as_ref())
            .map(|(path, hash)| (path.clone(), hex(hash)))
            .collect();
        let mut picture_hashes = Vec::new();
        for (path, hash) in pictures {
            let Some(hash) = hash else { return };
            picture_hashes.push((path.clone(), hex(hash)));
        }
        let mut key = blake3::Hasher::new();
        add_to_hash(&mut key, &base);
        for (_, hash) in files.iter().chain(&picture_hashes) {
            add_to_hash(&mut key, hash.as_bytes());
        }
        outcome.key = hex(key.finalize().as_bytes());
        let elsewhere = alternative_places(&files, roots);
        let entry = Entry {
            format: FORMAT,
            base: hex(&base),
            files,
            pictures: picture_hashes,
            elsewhere,
            outcome: outcome.clone(),
        };
        if let Ok(text) = serde_json::to_vec(&entry) {
            let name = entry_path.file_name().unwrap_or_default();
            let _ = write_whole_beneath(&self.folder, name.as_ref(), &text);
        }
    }

    /// Removes the stored result of a section that must be run again.
    pub fn remove(&self, case: &Case) {
        if let Some(place) = self.entry_path(case) {
            let _ = std::fs::remove_file(place);
        }
    }

    /// Path of the stored entry of a section.
    fn entry_path(&self, case: &Case) -> Option<PathBuf> {
        let mut hasher = blake3::Hasher::new();
        add_to_hash(&mut hasher, case.path.canonicalize().ok()?.to_string_lossy().as_bytes());
        add_to_hash(&mut hasher, case.section.as_ref().ok()?.name.as_bytes());
        Some(self.folder.join(format!("{}.json", &hex(hasher.finalize().as_bytes())[..32])))
    }

    /// Hash of the program, the options, and the file's text without the lines of its other sections.
    fn base_hash(&self, case: &Case, text: &[u8]) -> Option<Hash> {
        let info = case.section.as_ref().ok()?;
        let text = String::from_utf8_lossy(text);
        let mut hasher = blake3::Hasher::new();
        add_to_hash(&mut hasher, &self.program_hash);
        add_to_hash(&mut hasher, info.name.as_bytes());
        add_to_hash(&mut hasher, format!("{:?} {:?}", info.skip, info.fails).as_bytes());
        add_to_hash(&mut hasher, case.root.as_deref().unwrap_or(Path::new("")).to_string_lossy().as_bytes());
        add_to_hash(&mut hasher, &self.hash_outside_sections(case, &text));
        let own = text.lines().skip(info.line.saturating_sub(1)).take(info.end_line + 1 - info.line);
        own.for_each(|line| add_to_hash(&mut hasher, line.as_bytes()));
        Some(*hasher.finalize().as_bytes())
    }

    /// Hash of the lines that belong to no section, computed once per file.
    fn hash_outside_sections(&self, case: &Case, text: &str) -> Hash {
        let whole = *blake3::hash(text.as_bytes()).as_bytes();
        let mut known = self.outside_hashes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, outside_hash)) = known.get(&case.path).filter(|(of, _)| *of == whole) {
            return *outside_hash;
        }
        let lines: Vec<&str> = text.lines().collect();
        let mut in_section = vec![false; lines.len() + 1];
        for (from, to) in case.section_lines.iter().filter(|(from, _)| *from <= lines.len()) {
            in_section[*from..=(*to).clamp(*from, lines.len())].fill(true);
        }
        let mut hasher = blake3::Hasher::new();
        for (line, _) in lines.iter().zip(&in_section[1..]).filter(|(_, inside)| !**inside) {
            add_to_hash(&mut hasher, line.as_bytes());
        }
        let outside_hash = *hasher.finalize().as_bytes();
        known.insert(case.path.clone(), (whole, outside_hash));
        outside_hash
    }

    fn content_hash(&self, path: &Path) -> Option<Hash> {
        if let Some(known) = self.content_hashes.lock().unwrap_or_else(PoisonError::into_inner).get(path) {
            return *known;
        }
        let hash = content_of(path);
        self.content_hashes.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_path_buf(), hash);
        hash
    }
}

/// Other paths at which the files could be found, and whether a file is there. A script uses the first folder that contains the file, so a file
/// that appears in another folder may replace it.
fn alternative_places(files: &[(PathBuf, String)], roots: &[PathBuf]) -> Vec<(PathBuf, bool)> {
    let mut out = Vec::new();
    for (path, _) in files {
        for below in roots.iter().filter_map(|root| path.strip_prefix(root).ok()) {
            for place in roots.iter().map(|root| root.join(below)).filter(|p| p != path) {
                out.push((place.clone(), place.exists()));
            }
        }
    }
    out.sort();
    out.dedup();
    out
}

/// Identifies this build of the program: version and content hash of its file; `None` if the file cannot be read.
pub fn program_identity() -> Option<String> {
    let hash = content_of(&std::env::current_exe().ok()?)?;
    Some(format!("choreo {} {}", env!("CARGO_PKG_VERSION"), hex(&hash)))
}

/// Short hash that distinguishes folders in a file name.
pub fn short_hash(path: &Path) -> String {
    hex(&blake3::hash(path.to_string_lossy().as_bytes()).as_bytes()[..8])
}
