//! `plugin.toml`: the description of a plugin package, which is a folder of plugin files that can be installed. The parser is strict, so that a
//! misspelled key is found before the package is published.

use choreo_plugin::suggest::{did_you_mean, list};
use std::ops::Range;
use std::path::{Component, Path};
use thiserror::Error;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// File name extensions of plugins.
pub const FILE_ENDINGS: [&str; 5] = [
    choreo_rhai_importer::IMPORTER_ENDING,
    choreo_rhai_importer::EXPORTER_ENDING,
    choreo_wgsl_effect::FILE_ENDING,
    choreo_wasm_plugin::IMPORTER_ENDING,
    choreo_wasm_plugin::EXPORTER_ENDING,
];

/// File name of the description in the folder of a package.
pub const DESCRIPTION: &str = "plugin.toml";

/// Largest description that is read, bytes.
pub const MAX_DESCRIPTION_BYTES: u64 = 64 << 10;

/// Keys of the description. Authors and addresses are accepted, but only meant for human readers.
const PACKAGE_KEYS: [&str; 11] = [
    "name",
    "version",
    "choreo",
    "license",
    "about",
    "author",
    "authors",
    "url",
    "repository",
    "homepage",
    "plugin",
];

const PLUGIN_KEYS: [&str; 3] = ["file", "kind", "hook"];

/// SPDX identifiers of common licenses and exceptions.
const LICENSES: [&str; 45] = [
    "0BSD",
    "AGPL-3.0-only",
    "AGPL-3.0-or-later",
    "Apache-2.0",
    "Artistic-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC-BY-3.0",
    "CC-BY-4.0",
    "CC-BY-NC-4.0",
    "CC-BY-NC-SA-4.0",
    "CC-BY-ND-4.0",
    "CC-BY-SA-3.0",
    "CC-BY-SA-4.0",
    "CC0-1.0",
    "EPL-2.0",
    "EUPL-1.2",
    "GPL-2.0-only",
    "GPL-2.0-or-later",
    "GPL-3.0-only",
    "GPL-3.0-or-later",
    "ISC",
    "LGPL-2.1-only",
    "LGPL-2.1-or-later",
    "LGPL-3.0-only",
    "LGPL-3.0-or-later",
    "MIT",
    "MIT-0",
    "MPL-2.0",
    "MS-PL",
    "NCSA",
    "OFL-1.1",
    "OSL-3.0",
    "PostgreSQL",
    "Unicode-3.0",
    "Unlicense",
    "UPL-1.0",
    "WTFPL",
    "Zlib",
    "Classpath-exception-2.0",
    "GCC-exception-3.1",
    "LLVM-exception",
    "Font-exception-2.0",
    "Linux-syscall-note",
];

/// Limits: letters of a package's name, bytes of a text, plugins in a package.
const MAX_NAME_LENGTH: usize = 60;
const MAX_TEXT_BYTES: usize = 1000;
const MAX_PLUGINS: usize = 100;

/// A package as described by its `plugin.toml`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Package {
    /// Name of the package and of the folder that it is installed in.
    pub name: String,
    /// Version of the package, and of each plugin in it.
    pub version: Version,
    /// Oldest choreo that the package works with.
    pub choreo: Version,
    /// SPDX expression, or name of the license.
    pub license: String,
    /// Summary in one line; may be empty.
    pub about: String,
    /// Plugins of the package, at least one.
    pub plugins: Vec<PackagedPlugin>,
}

/// One plugin file of a package.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackagedPlugin {
    /// Path relative to the folder of the package.
    pub file: String,
    /// Kind of plugin, which must agree with the file name.
    pub kind: PackagedKind,
    /// Hook of an effect, as in the first lines of its file.
    pub hook: Option<String>,
}

/// Kinds of plugins that are files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PackagedKind {
    Importer,
    Exporter,
    Effect,
}

impl PackagedKind {
    const ALL: [PackagedKind; 3] = [PackagedKind::Importer, PackagedKind::Exporter, PackagedKind::Effect];

    /// Name of the kind in `plugin.toml`.
    pub fn word(self) -> &'static str {
        match self {
            PackagedKind::Importer => "importer",
            PackagedKind::Exporter => "exporter",
            PackagedKind::Effect => "effect",
        }
    }

    /// Kind of a plugin file by its file name.
    fn of_file(name: &str) -> Option<PackagedKind> {
        let stem =
            FILE_ENDINGS.iter().find_map(|ending| name.strip_suffix(ending).map(|stem| (stem, ending)));
        let (stem, ending) = stem?;
        match ending {
            _ if stem.is_empty() => None,
            ending if ending.starts_with(".importer.") => Some(PackagedKind::Importer),
            ending if ending.starts_with(".exporter.") => Some(PackagedKind::Exporter),
            _ => Some(PackagedKind::Effect),
        }
    }
}

/// Version of three numbers: 1.0.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version(pub [u32; 3]);

impl Version {
    /// Parses exactly three numbers without leading zeros, as in semantic versioning.
    pub fn parse(text: &str) -> Option<Version> {
        let number = |part: &str| match part {
            "0" => Some(0),
            part if part.starts_with('0') || !part.bytes().all(|b| b.is_ascii_digit()) => None,
            part => part.parse().ok(),
        };
        let mut parts = text.split('.');
        let mut next = || number(parts.next()?);
        let version = Version([next()?, next()?, next()?]);
        parts.next().is_none().then_some(version)
    }

    /// Version of this program's plugin interface, the same as choreo's version.
    pub(crate) fn of_choreo() -> Version {
        Version::parse(env!("CARGO_PKG_VERSION")).unwrap_or(Version([0; 3]))
    }
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [major, minor, patch] = self.0;
        write!(f, "{major}.{minor}.{patch}")
    }
}

/// Error in a description, with its position.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{file}:{line}:{column}: {message}{}", hint.as_ref().map(|h| format!("\n    hint: {h}")).unwrap_or_default())]
pub struct PackageError {
    /// File name of the description in messages.
    pub file: String,
    pub line: usize,
    pub column: usize,
    pub message: String,
    pub hint: Option<String>,
}

/// Whether a package may have this name, so that a folder of this name can safely be created and removed.
pub fn is_valid_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.len() <= MAX_NAME_LENGTH
        && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_' || b == b'-')
}

impl Package {
    /// Parses a description. `file`: its name in messages.
    ///
    /// # Errors
    /// The text is not TOML, a key is unknown, missing or of the wrong type, a version is not three numbers, a plugin's file has another kind, or
    /// the package requires a newer choreo.
    pub fn parse(file: &str, text: &str) -> Result<Package, PackageError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let reader = Reader { file, text };
        let table = DeTable::parse(text).map_err(|e| {
            let message = e.message().lines().collect::<Vec<_>>().join(", ");
            reader.error_at(e.span().unwrap_or(0..0), message, None)
        })?;
        let end = text.len()..text.len();
        let fields = Fields { reader: &reader, table: table.get_ref(), place: end, keys: &PACKAGE_KEYS };
        fields.check_keys()?;
        let (name, at) = fields.text("name")?;
        if !is_valid_name(&name) {
            let message = format!(
                "name \"{name}\": use lower-case letters, digits, - and _, starting with a letter, at most {MAX_NAME_LENGTH}"
            );
            return Err(reader.error_at(at, message, None));
        }
        let package = Package {
            name,
            version: fields.version("version")?.0,
            choreo: fields.minimum_version()?,
            license: fields.text("license")?.0,
            about: fields.optional_text("about")?.map(|(text, _)| text).unwrap_or_default(),
            plugins: fields.plugins()?,
        };
        Ok(package)
    }

    /// A note for the user if the license contains a word that is not a common SPDX identifier.
    pub fn license_note(&self) -> Option<String> {
        let words = self.license.split(|c: char| c.is_whitespace() || c == '(' || c == ')');
        let mut words = words.filter(|word| !word.is_empty() && !["AND", "OR", "WITH"].contains(word));
        let known =
            |word: &str| LICENSES.contains(&word.trim_end_matches('+')) || word.starts_with("LicenseRef-");
        let word = words.find(|word| !known(word))?;
        let near = LICENSES.iter().copied().find(|id| id.eq_ignore_ascii_case(word));
        let near = near.map(|id| format!("; did you mean \"{id}\"?"));
        let near = near.unwrap_or_else(|| did_you_mean(word, LICENSES));
        Some(format!(
            "license \"{word}\" is no common SPDX identifier{near}; the list: https://spdx.org/licenses"
        ))
    }

    /// List of the plugins by kind and file: "importer ply.importer.rhai, effect rim.wgsl (surface)".
    pub fn contents(&self) -> String {
        let one = |plugin: &PackagedPlugin| {
            let hook = plugin.hook.as_ref().map(|hook| format!(" ({hook})")).unwrap_or_default();
            format!("{} {}{hook}", plugin.kind.word(), plugin.file)
        };
        self.plugins.iter().map(one).collect::<Vec<_>>().join(", ")
    }
}

/// A description that is being parsed.
struct Reader<'t> {
    file: &'t str,
    text: &'t str,
}

impl Reader<'_> {
    fn error_at(&self, span: Range<usize>, message: impl Into<String>, hint: Option<String>) -> PackageError {
        let mut start = span.start.min(self.text.len());
        while !self.text.is_char_boundary(start) {
            start -= 1;
        }
        let before = &self.text[..start];
        PackageError {
            file: self.file.to_string(),
            line: before.matches('\n').count() + 1,
            column: before.rsplit('\n').next().unwrap_or_default().chars().count() + 1,
            message: message.into(),
            hint,
        }
    }
}

/// A table of a description.
struct Fields<'t> {
    reader: &'t Reader<'t>,
    table: &'t DeTable<'t>,
    /// Bytes of the table, for errors about missing keys.
    place: Range<usize>,
    keys: &'static [&'static str],
}

type Value<'t> = &'t Spanned<DeValue<'t>>;

impl<'t> Fields<'t> {
    fn check_keys(&self) -> Result<(), PackageError> {
        let unknown = self.table.iter().find(|(key, _)| !self.keys.contains(&key.get_ref().as_ref()));
        let Some((key, _)) = unknown else { return Ok(()) };
        let name = key.get_ref().as_ref();
        let message = format!("unknown key \"{name}\"{}", did_you_mean(name, self.keys.iter().copied()));
        let hint = format!("keys: {}", list(self.keys.iter().copied(), 30));
        Err(self.reader.error_at(key.span(), message, Some(hint)))
    }

    fn value(&self, name: &str) -> Option<Value<'t>> {
        self.table.iter().find(|(key, _)| key.get_ref().as_ref() == name).map(|(_, value)| value)
    }

    fn missing(&self, name: &str) -> PackageError {
        let example = match name {
            "name" => "name = \"halftone\"",
            "version" => "version = \"1.0.0\"",
            "choreo" => "choreo = \"0.1.0\", the oldest choreo that it works with",
            "license" => "license = \"MIT\"",
            "kind" => "kind = \"importer\", \"exporter\" or \"effect\"",
            "file" => "file = \"halftone.wgsl\"",
            "hook" => "hook = \"pixel\", as in the header of the effect's file",
            _ => "[[plugin]] with a file and a kind for each plugin of the package",
        };
        self.reader.error_at(
            self.place.clone(),
            format!("{name} is missing"),
            Some(format!("write {example}")),
        )
    }

    /// An optional text of one line, with its bytes.
    fn optional_text(&self, name: &str) -> Result<Option<(String, Range<usize>)>, PackageError> {
        let Some(value) = self.value(name) else { return Ok(None) };
        let DeValue::String(text) = value.get_ref() else {
            return Err(self.reader.error_at(value.span(), format!("{name} must be a text"), None));
        };
        if text.len() > MAX_TEXT_BYTES || text.contains(char::is_control) {
            let message = format!("{name} must be one line of at most {MAX_TEXT_BYTES} bytes");
            return Err(self.reader.error_at(value.span(), message, None));
        }
        Ok(Some((text.trim().to_string(), value.span())))
    }

    fn text(&self, name: &str) -> Result<(String, Range<usize>), PackageError> {
        let (text, at) = self.optional_text(name)?.ok_or_else(|| self.missing(name))?;
        match text.is_empty() {
            true => Err(self.reader.error_at(at, format!("{name} is empty"), None)),
            false => Ok((text, at)),
        }
    }

    fn version(&self, name: &str) -> Result<(Version, Range<usize>), PackageError> {
        let (text, at) = self.text(name)?;
        let message = || format!("{name} \"{text}\": a version is three numbers, as 1.0.2");
        Ok((Version::parse(&text).ok_or_else(|| self.reader.error_at(at.clone(), message(), None))?, at))
    }

    /// The oldest choreo that the package works with. Fails if this choreo is older.
    fn minimum_version(&self) -> Result<Version, PackageError> {
        let (minimum, at) = self.version("choreo")?;
        let own = Version::of_choreo();
        match minimum <= own {
            true => Ok(minimum),
            false => {
                let message = format!("the package needs choreo {minimum}, this is choreo {own}");
                let hint = "update choreo, or take an older version of the package".to_string();
                Err(self.reader.error_at(at, message, Some(hint)))
            }
        }
    }

    fn plugins(&self) -> Result<Vec<PackagedPlugin>, PackageError> {
        let value = self.value("plugin").ok_or_else(|| self.missing("plugin"))?;
        let must = "plugin must be tables: [[plugin]] with a file and a kind each";
        let DeValue::Array(all) = value.get_ref() else {
            let hint = matches!(value.get_ref(), DeValue::Table(_));
            let hint =
                hint.then(|| "write [[plugin]] in place of [plugin]: a package can have several".to_string());
            return Err(self.reader.error_at(value.span(), must, hint));
        };
        if all.is_empty() || all.len() > MAX_PLUGINS {
            let message = format!("a package has 1 to {MAX_PLUGINS} plugins, this one {}", all.len());
            return Err(self.reader.error_at(value.span(), message, None));
        }
        let mut plugins: Vec<PackagedPlugin> = Vec::new();
        for value in all.iter() {
            let DeValue::Table(table) = value.get_ref() else {
                return Err(self.reader.error_at(value.span(), must, None));
            };
            let fields = Fields { reader: self.reader, table, place: value.span(), keys: &PLUGIN_KEYS };
            let plugin = fields.plugin()?;
            if plugins.iter().any(|other| other.file == plugin.file) {
                let message = format!("\"{}\" is named twice", plugin.file);
                return Err(self.reader.error_at(value.span(), message, None));
            }
            plugins.push(plugin);
        }
        Ok(plugins)
    }

    fn plugin(&self) -> Result<PackagedPlugin, PackageError> {
        self.check_keys()?;
        let (file, at) = self.text("file")?;
        let mut components = Path::new(&file).components();
        let plain = matches!((components.next(), components.next()), (Some(Component::Normal(_)), None));
        if !plain || file.contains(['/', '\\']) || file.starts_with('.') {
            let message = format!("file \"{file}\": a plugin file lies in the package's own folder");
            return Err(self.reader.error_at(at, message, None));
        }
        let Some(stated) = PackagedKind::of_file(&file) else {
            let endings = FILE_ENDINGS.map(|ending| format!("NAME{ending}"));
            let message = format!("file \"{file}\" is not named like a plugin file");
            let hint = format!("plugin files are called {}", list(endings.iter().map(String::as_str), 30));
            return Err(self.reader.error_at(at, message, Some(hint)));
        };
        let (word, at) = self.text("kind")?;
        let words = PackagedKind::ALL.map(PackagedKind::word);
        let Some(kind) = PackagedKind::ALL.into_iter().find(|kind| kind.word() == word) else {
            let message = format!("unknown kind \"{word}\"{}", did_you_mean(&word, words));
            return Err(self.reader.error_at(at, message, Some(format!("kinds: {}", list(words, 30)))));
        };
        if kind != stated {
            let message = format!("\"{file}\" is named like an {}, not an {word}", stated.word());
            return Err(self.reader.error_at(at, message, None));
        }
        let hook = match kind {
            PackagedKind::Effect => Some(self.text("hook")?.0),
            _ => None,
        };
        if let (None, Some(value)) = (&hook, self.value("hook")) {
            return Err(self.reader.error_at(value.span(), format!("an {word} has no hook"), None));
        }
        Ok(PackagedPlugin { file, kind, hook })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALID_DESCRIPTION: &str = "name = \"prints\"\nversion = \"1.2.0\"\nchoreo = \"0.1.0\"\nlicense = \"MIT\"\nabout = \"old prints\"\n\n\
        [[plugin]]\nfile = \"dots.importer.rhai\"\nkind = \"importer\"\n\n\
        [[plugin]]\nfile = \"halftone.wgsl\"\nkind = \"effect\"\nhook = \"pixel\"\n";

    #[test]
    fn a_description_is_read() {
        let package = Package::parse("plugin.toml", VALID_DESCRIPTION).unwrap();
        assert_eq!((package.name.as_str(), package.version), ("prints", Version([1, 2, 0])));
        assert_eq!((package.license.as_str(), package.about.as_str()), ("MIT", "old prints"));
        assert_eq!(package.contents(), "importer dots.importer.rhai, effect halftone.wgsl (pixel)");
        assert_eq!(Package::parse("plugin.toml", &format!("\u{feff}{VALID_DESCRIPTION}")), Ok(package));
    }

    /// Error message after one text of a valid description is replaced with another.
    fn error(from: &str, to: &str) -> String {
        assert!(VALID_DESCRIPTION.contains(from), "{from}");
        Package::parse("plugin.toml", &VALID_DESCRIPTION.replacen(from, to, 1)).unwrap_err().to_string()
    }

    #[test]
    fn authors_are_accepted_and_unusual_licenses_get_a_note() {
        let with = |license: &str| {
            let text = VALID_DESCRIPTION
                .replace("\"MIT\"", &format!("\"{license}\"\nauthors = [\"Ann\"]\nurl = \"https://x.org\""));
            Package::parse("plugin.toml", &text).unwrap().license_note()
        };
        for good in [
            "MIT",
            "MIT OR Apache-2.0",
            "(GPL-2.0-or-later WITH Classpath-exception-2.0) AND Zlib",
            "LicenseRef-own",
        ] {
            assert_eq!(with(good), None, "{good}");
        }
        let note = |word: &str, near: &str| {
            Some(format!(
                "license \"{word}\" is no common SPDX identifier{near}; the list: https://spdx.org/licenses"
            ))
        };
        assert_eq!(with("mit"), note("mit", "; did you mean \"MIT\"?"));
        assert_eq!(with("MIT OR Apache2.0"), note("Apache2.0", "; did you mean \"Apache-2.0\"?"));
        assert_eq!(with("Freeware"), note("Freeware", ""));
    }

    #[test]
    fn errors_have_a_position_and_a_hint() {
        assert_eq!(
            error("license", "licence"),
            "plugin.toml:4:1: unknown key \"licence\"; did you mean \"license\"?\n    \
             hint: keys: name, version, choreo, license, about, author, authors, url, repository, homepage, plugin"
        );
        assert_eq!(
            error("license = \"MIT\"\n", ""),
            "plugin.toml:14:1: license is missing\n    hint: write license = \"MIT\""
        );
        assert_eq!(
            error("\"1.2.0\"", "\"1.2\""),
            "plugin.toml:2:11: version \"1.2\": a version is three numbers, as 1.0.2"
        );
        assert_eq!(error("\"1.2.0\"", "1.2"), "plugin.toml:2:11: version must be a text");
        let own = Version::of_choreo();
        assert_eq!(
            error("\"0.1.0\"", "\"99.0.0\""),
            format!(
                "plugin.toml:3:10: the package needs choreo 99.0.0, this is choreo {own}\n    \
                 hint: update choreo, or take an older version of the package"
            )
        );
        assert!(
            error("prints", "../prints").starts_with("plugin.toml:1:8: name \"../prints\": use lower-case")
        );
        assert_eq!(
            error("\"halftone.wgsl\"", "\"../halftone.wgsl\""),
            "plugin.toml:12:8: file \"../halftone.wgsl\": a plugin file lies in the package's own folder"
        );
        assert!(
            error("halftone.wgsl", "halftone.glsl")
                .contains(":12:8: file \"halftone.glsl\" is not named like a plugin file")
        );
        assert_eq!(
            error("kind = \"effect\"", "kind = \"exporter\""),
            "plugin.toml:13:8: \"halftone.wgsl\" is named like an effect, not an exporter"
        );
        assert!(
            error("\"importer\"", "\"imprter\"")
                .contains(":9:8: unknown kind \"imprter\"; did you mean \"importer\"?")
        );
        assert!(error("hook = \"pixel\"\n", "").contains(":11:1: hook is missing"));
        assert_eq!(
            error("kind = \"importer\"", "kind = \"importer\"\nhook = \"pixel\""),
            "plugin.toml:10:8: an importer has no hook"
        );
        assert!(error("halftone.wgsl", "dots.importer.rhai").contains("an importer, not an effect"));
        assert!(
            error("[[plugin]]\nfile = \"dots", "[[plugins]]\nfile = \"dots")
                .contains("did you mean \"plugin\"?")
        );
        assert!(error("name =", "name").starts_with("plugin.toml:1:"));
        let one = VALID_DESCRIPTION.split("[[plugin]]").next().unwrap().to_string()
            + "[plugin]\nfile = \"a.wgsl\"\n";
        let one = Package::parse("plugin.toml", &one).unwrap_err().to_string();
        assert!(
            one.contains("plugin must be tables") && one.contains("write [[plugin]] in place of [plugin]"),
            "{one}"
        );
    }

    #[test]
    fn versions_are_compared_by_number() {
        let version = |text| Version::parse(text).unwrap();
        assert!(version("0.10.0") > version("0.9.9") && version("1.0.0") > version("0.99.99"));
        for bad in
            ["", "1", "1.2", "1.2.3.4", "1.02.3", "1.2.x", "-1.2.3", "+1.2.3", "1.2.99999999999", "1..2"]
        {
            assert_eq!(Version::parse(bad), None, "{bad}");
        }
    }
}
