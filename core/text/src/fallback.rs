//! Fonts for characters that a text's own font lacks: built-in ones, which are the same on every machine, then those of the system.

use crate::font::Font;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

/// A font that has a character.
#[derive(Clone, Debug, PartialEq)]
pub struct Fallback {
    pub font: Font,
    /// File of a system font; `None` for a built-in font. Another machine may have another font, or none.
    pub file: Option<PathBuf>,
}

/// Fallback font of each character, built-in or of the system. `None` if no font has the character.
pub fn fallbacks(chars: &[char]) -> Vec<Option<Fallback>> {
    static KNOWN: Mutex<BTreeMap<char, Option<Fallback>>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let mut unknown_chars: Vec<char> = chars.iter().copied().filter(|c| !known.contains_key(c)).collect();
    let mut assign_fallback = |fallback: &Fallback, unknown_chars: &mut Vec<char>| {
        let missing = fallback.font.missing(&unknown_chars.iter().collect::<String>());
        unknown_chars.retain(|c| {
            let has = !missing.contains(c);
            if has {
                known.insert(*c, Some(fallback.clone()));
            }
            !has
        });
    };
    for font in built_in() {
        assign_fallback(&Fallback { font: font.clone(), file: None }, &mut unknown_chars);
    }
    for path in system_files() {
        if unknown_chars.is_empty() {
            break;
        }
        if let Some(font) = read_font(path) {
            assign_fallback(&Fallback { font, file: Some(path.clone()) }, &mut unknown_chars);
        }
    }
    known.extend(unknown_chars.into_iter().map(|c| (c, None)));
    chars.iter().map(|c| known.get(c).cloned().flatten()).collect()
}

fn built_in() -> &'static [Font] {
    static FONTS: OnceLock<Vec<Font>> = OnceLock::new();
    FONTS.get_or_init(|| {
        let fonts = [
            ("Noto Emoji", epaint_default_fonts::NOTO_EMOJI_REGULAR),
            ("Hack", epaint_default_fonts::HACK_REGULAR),
        ];
        let others = fonts.into_iter().filter_map(|(name, bytes)| Font::new(name, bytes).ok());
        std::iter::once(Font::built_in()).chain(others).collect()
    })
}

/// Size of the largest font file that is read, bytes: fonts with all Chinese characters take 20 MB.
const MAX_FONT_FILE_BYTES: u64 = 64 << 20;
/// Largest number of files and folders that the search for fonts looks at.
const MAX_FOLDER_ENTRIES: usize = 5000;

fn read_font(path: &Path) -> Option<Font> {
    let length = std::fs::metadata(path).ok()?.len();
    let bytes = (length <= MAX_FONT_FILE_BYTES).then(|| std::fs::read(path).ok()).flatten()?;
    Font::new(&path.file_stem()?.to_string_lossy(), bytes).ok()
}

/// Font files of the system, upright ones of normal weight first. `CHOREO_FONTS` names other folders, or none.
fn system_files() -> &'static [PathBuf] {
    static FILES: OnceLock<Vec<PathBuf>> = OnceLock::new();
    FILES.get_or_init(|| {
        let mut folders: Vec<PathBuf> = match std::env::var_os("CHOREO_FONTS") {
            Some(folders) => std::env::split_paths(&folders).filter(|f| f.is_absolute()).collect(),
            None => system_folders(),
        };
        let mut files = Vec::new();
        let mut seen = 0;
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
                seen += 1;
                if seen > MAX_FOLDER_ENTRIES {
                    break;
                }
                let path = entry.path();
                match entry.file_type() {
                    Ok(kind) if kind.is_dir() => folders.push(path),
                    Ok(kind) if kind.is_file() && is_font(&path) => files.push(path),
                    _ => {}
                }
            }
        }
        files.sort_by_cached_key(|path| (is_styled_variant(path), path.file_name().map(ToOwned::to_owned)));
        files
    })
}

fn system_folders() -> Vec<PathBuf> {
    let home = std::env::var_os("HOME").map(PathBuf::from);
    let of_user = home.iter().flat_map(|home| [home.join(".local/share/fonts"), home.join("Library/Fonts")]);
    let windows = std::env::var_os("WINDIR").map(|folder| PathBuf::from(folder).join("Fonts"));
    let all = ["/usr/share/fonts", "/usr/local/share/fonts", "/System/Library/Fonts", "/Library/Fonts"];
    all.into_iter().map(PathBuf::from).chain(of_user).chain(windows).collect()
}

fn is_font(path: &Path) -> bool {
    path.extension().is_some_and(|e| ["ttf", "otf", "ttc"].iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// Whether a file name indicates a bold, slanted, narrow, monospaced or other special font; these come after regular ones.
fn is_styled_variant(path: &Path) -> bool {
    let name = path.file_stem().map(|stem| stem.to_string_lossy().to_lowercase()).unwrap_or_default();
    ["bold", "italic", "oblique", "mono", "condensed", "light", "black", "thin", "serif", "math"]
        .iter()
        .any(|word| name.contains(word))
}

/// Whether a character belongs to a script whose letters are joined, reordered or written from right to left.
pub fn needs_shaping(c: char) -> bool {
    // Hebrew, Arabic, Syriac, Thaana, NKo, Samaritan, Mandaic; Devanagari to Sinhala; Tibetan, Myanmar; Khmer, Mongolian;
    // Arabic presentation forms are joined already, but run from right to left.
    matches!(c as u32, 0x0590..=0x08ff | 0x0900..=0x0dff | 0x0f00..=0x109f | 0x1780..=0x18af | 0xfb1d..=0xfdff | 0xfe70..=0xfefc)
}
