//! The manifest of a plugin: its description of itself as data, which `choreo plugins`, `--help` and scripts read.

use crate::parameters::is_curve;
use crate::suggest::{did_you_mean, list};
use crate::{Claim, ImportOptions, OptionValue, Source};
use std::ops::RangeInclusive;

/// Manifest of a plugin. The texts are owned, because they can come from a file as well as from a crate. A crate keeps its manifest in a
/// `LazyLock`:
///
/// ```
/// # use choreo_plugin::Manifest;
/// # use std::sync::LazyLock;
/// static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
///     Manifest::new("ply", "1.0", "Stanford polygons: vertices and faces")
///         .extensions(["ply"])
///         .magic(b"ply\n")
///         .number("scale", "metres per file unit", 1.0, 1e-6..=1e6)
///         .text("up", "the file's upward axis", "y", &["y", "z"])
///         .flag("normals", "compute missing normals", true)
/// });
/// assert_eq!(MANIFEST.option("up").unwrap().allowed(), "one of y, z");
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Manifest {
    /// Name in scripts, as in `load(…, #{ importer: NAME })` or `effect(NAME)`: "gltf", "vignette", "png".
    pub name: String,
    /// Version of the plugin.
    pub version: String,
    /// Description in one line.
    pub about: String,
    /// File extensions in lower case, without the dot. Empty for effects.
    pub extensions: Vec<String>,
    /// First bytes of files that are certainly this format.
    pub magic: Vec<Vec<u8>>,
    /// Options of an importer or exporter, parameters of an effect.
    pub options: Vec<OptionSpec>,
}

/// A plugin's own file. Scripts that use the plugin compare its content to know when it has changed.
///
/// ```
/// use choreo_plugin::{BesideFile, PluginFile};
/// let ramp = BesideFile { name: "ramp.png".into(), path: "/looks/ramp.png".into(), bytes: Err("no such file".into()) };
/// let file = PluginFile { path: "/looks/toon.wgsl".into(), bytes: (*b"// effect: toon").into(), beside: vec![ramp] };
/// assert!(file.bytes.starts_with(b"// effect") && file.beside[0].bytes.is_err());
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginFile {
    /// Canonical path.
    pub path: std::path::PathBuf,
    /// Content of the file.
    pub bytes: std::sync::Arc<[u8]>,
    /// Files in the same folder that the plugin reads.
    pub beside: Vec<BesideFile>,
}

/// A further file that a plugin's own file refers to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BesideFile {
    /// The name in the plugin's file.
    pub name: String,
    /// Path of the file.
    pub path: std::path::PathBuf,
    /// The content, or why it could not be read.
    pub bytes: Result<std::sync::Arc<[u8]>, String>,
}

/// One option or effect parameter.
///
/// ```
/// use choreo_plugin::{Manifest, OptionSpec, OptionValue};
/// let manifest = Manifest::new("rain", "1", "drops")
///     .integer("drops", "how many", 100, 0..=1000)
///     .curve("fall", "speed over time", &[[0.0, 1.0], [1.0, 4.0]], 0.0..=9.0)
///     .unit("m/s");
/// let drops: &OptionSpec = manifest.option("drops")?;
/// assert!(drops.accepts(&OptionValue::Number(7.0)) && !drops.accepts(&OptionValue::Number(7.5)));
/// assert_eq!((manifest.options[1].unit.as_str(), manifest.has_extension("rain")), ("m/s", false));
/// // As numbers of an effect: one for the drops, sixteen samples of the curve.
/// assert_eq!((manifest.options[1].number_count(), manifest.first_number(1), manifest.parameter_length()), (16, 1, 20));
/// assert_eq!((manifest.options[1].number_of("fall_15"), manifest.options[0].number_of("fall")), (Some(15), None));
/// # Ok::<(), choreo_plugin::OptionError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct OptionSpec {
    /// Name in scripts and on the command line.
    pub name: String,
    /// Description in one line.
    pub about: String,
    /// Unit of the option's numbers ("m", "px", "degrees"); empty if there is none.
    pub unit: String,
    /// Type, default and allowed values.
    pub kind: OptionKind,
}

/// Type, default and allowed values of an option.
///
/// ```
/// use choreo_plugin::{Manifest, OptionKind};
/// let manifest = Manifest::new("rain", "1", "").vector("wind", "where drops go", &[0.0, 1.0], -9.0..=9.0).unit("m/s");
/// assert_eq!(manifest.options[0].kind, OptionKind::Vector { default: vec![0.0, 1.0], min: -9.0, max: 9.0 });
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum OptionKind {
    /// A number from `min` to `max`, both included.
    Number {
        /// Value where none is given.
        default: f64,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// A whole number from `min` to `max`, both included.
    Integer {
        /// Value where none is given.
        default: i64,
        /// Smallest value.
        min: i64,
        /// Largest value.
        max: i64,
    },
    /// True or false.
    Bool {
        /// Value where none is given.
        default: bool,
    },
    /// A text: one of `one_of`, or any text if that list is empty.
    Text {
        /// Value where none is given.
        default: String,
        /// Allowed texts.
        one_of: Vec<String>,
    },
    /// A color: linear red, green and blue, each from 0 to [`MAX_COLOR`].
    Color {
        /// Value where none is given.
        default: [f64; 3],
    },
    /// Two to four numbers, each from `min` to `max`, both included.
    Vector {
        /// Value where none is given; as many numbers as the vector has.
        default: Vec<f64>,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// A curve of keys `[x, y]`: x from 0 to 1 and growing, y from `min` to `max`; straight between keys.
    Curve {
        /// Value where none is given.
        default: Vec<[f64; 2]>,
        /// Smallest y.
        min: f64,
        /// Largest y.
        max: f64,
    },
    /// An image that the function of an effect reads by the option's name, as one of its [`EffectTexture`](crate::EffectTexture)s. It takes
    /// none of the parameter numbers.
    Texture {
        /// The file beside the effect that is used if none is given; empty: white.
        default: String,
        /// Whether red, green and blue of the image are encoded as sRGB, rather than data.
        srgb: bool,
    },
}

/// Largest component of a color: 1 is the white of a display, greater values are brighter light.
pub const MAX_COLOR: f64 = 100.0;

/// Error of an option: an unknown name, or a value that is not allowed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OptionError {
    /// The problem, and the allowed values.
    pub message: String,
    /// How to resolve it.
    pub hint: Option<String>,
}

choreo_motion::error_texts! { OptionError:
    Self { message, .. } => "{message}";
}

/// Name and version, as provenance has them: "gltf 0.1.0".
impl std::fmt::Display for Manifest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.name, self.version)
    }
}

impl Manifest {
    /// A manifest without extensions and options. `about` is one line.
    pub fn new(name: &str, version: &str, about: &str) -> Manifest {
        Manifest { name: name.into(), version: version.into(), about: about.into(), ..Manifest::default() }
    }

    /// Adds extensions: lower case, without the dot.
    pub fn extensions<'a>(mut self, extensions: impl IntoIterator<Item = &'a str>) -> Manifest {
        self.extensions.extend(extensions.into_iter().map(str::to_string));
        self
    }

    /// Adds magic bytes, with which files of the format begin. Formats with several beginnings call this once for each.
    pub fn magic(mut self, first_bytes: impl Into<Vec<u8>>) -> Manifest {
        self.magic.push(first_bytes.into());
        self
    }

    /// Adds an option that is a number.
    pub fn number(self, name: &str, about: &str, default: f64, range: RangeInclusive<f64>) -> Manifest {
        self.with_option(name, about, OptionKind::Number { default, min: *range.start(), max: *range.end() })
    }

    /// Adds an option that is a whole number.
    pub fn integer(self, name: &str, about: &str, default: i64, range: RangeInclusive<i64>) -> Manifest {
        self.with_option(name, about, OptionKind::Integer { default, min: *range.start(), max: *range.end() })
    }

    /// Adds a color: linear red, green and blue.
    pub fn color(self, name: &str, about: &str, default: [f64; 3]) -> Manifest {
        self.with_option(name, about, OptionKind::Color { default })
    }

    /// Adds an option of as many numbers as the default has: 2 to 4.
    pub fn vector(self, name: &str, about: &str, default: &[f64], range: RangeInclusive<f64>) -> Manifest {
        let (min, max) = range.into_inner();
        self.with_option(name, about, OptionKind::Vector { default: default.to_vec(), min, max })
    }

    /// Adds a curve of keys `[x, y]`: x from 0 to 1 and growing, y within the range.
    pub fn curve(self, name: &str, about: &str, keys: &[[f64; 2]], range: RangeInclusive<f64>) -> Manifest {
        let (min, max) = range.into_inner();
        self.with_option(name, about, OptionKind::Curve { default: keys.to_vec(), min, max })
    }

    /// Adds an image, by default a file beside the effect, or white where that is empty. `srgb`: its red, green and blue are encoded as
    /// sRGB, rather than data.
    pub fn texture(self, name: &str, about: &str, default: &str, srgb: bool) -> Manifest {
        self.with_option(name, about, OptionKind::Texture { default: default.into(), srgb })
    }

    /// Sets the unit of the option that was added last: "m", "px", "degrees".
    pub fn unit(mut self, unit: &str) -> Manifest {
        if let Some(last) = self.options.last_mut() {
            last.unit = unit.into();
        }
        self
    }

    /// Adds an option that is true or false.
    pub fn flag(self, name: &str, about: &str, default: bool) -> Manifest {
        self.with_option(name, about, OptionKind::Bool { default })
    }

    /// Adds an option that is a text: one of `one_of`, or any text if that list is empty.
    pub fn text(self, name: &str, about: &str, default: &str, one_of: &[&str]) -> Manifest {
        let one_of = one_of.iter().map(ToString::to_string).collect();
        self.with_option(name, about, OptionKind::Text { default: default.into(), one_of })
    }

    fn with_option(mut self, name: &str, about: &str, kind: OptionKind) -> Manifest {
        self.options.push(OptionSpec { name: name.into(), about: about.into(), unit: String::new(), kind });
        self
    }

    /// Whether files of this format have the extension.
    pub fn has_extension(&self, extension: &str) -> bool {
        self.extensions.iter().any(|e| e == extension)
    }

    /// Whether an output file of this name is of this format.
    ///
    /// ```
    /// let png = choreo_plugin::Manifest::new("png", "1", "").extensions(["png"]);
    /// assert!(png.writes("out/frame.PNG") && !png.writes("png"));
    /// ```
    pub fn writes(&self, file_name: &str) -> bool {
        let extension = file_name.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase());
        extension.is_some_and(|extension| self.has_extension(&extension))
    }

    /// Whether a file is of this format by its first bytes, else by its name.
    ///
    /// ```
    /// use choreo_plugin::{Claim, Manifest, Source};
    /// let manifest = Manifest::new("ply", "1", "").extensions(["ply"]).magic(b"ply\n");
    /// let named = |name: &str, bytes: &[u8]| Source { name: name.into(), bytes: bytes.to_vec().into() };
    /// assert_eq!(manifest.claim(&named("a.dat", b"ply\nformat ascii 1.0")), Claim::Content(90));
    /// assert_eq!(manifest.claim(&named("a.PLY", b"")), Claim::Extension);
    /// ```
    pub fn claim(&self, source: &Source) -> Claim {
        if self.magic.iter().any(|magic| source.bytes.starts_with(magic)) {
            Claim::Content(90)
        } else if self.has_extension(&source.extension()) {
            Claim::Extension
        } else {
            Claim::NotMine
        }
    }

    /// The option `name`; the error lists all options.
    ///
    /// # Errors
    /// No such option.
    ///
    /// ```
    /// use choreo_plugin::Manifest;
    /// let manifest = Manifest::new("ply", "1", "").flag("normals", "compute missing normals", true);
    /// let error = manifest.option("normal").unwrap_err();
    /// assert_eq!(error.message, "ply has no option \"normal\"; did you mean \"normals\"?");
    /// ```
    pub fn option(&self, name: &str) -> Result<&OptionSpec, OptionError> {
        let names = || self.options.iter().map(|o| o.name.as_str());
        self.options.iter().find(|o| o.name == name).ok_or_else(|| OptionError {
            message: format!("{} has no option \"{name}\"{}", self.name, did_you_mean(name, names())),
            hint: Some(match self.options.is_empty() {
                true => format!("{} has no options", self.name),
                false => format!("options: {}", list(names(), 30)),
            }),
        })
    }

    /// Reads `text` as a value of the option `name`; the error says what is allowed.
    ///
    /// # Errors
    /// No such option, or a value that it does not allow.
    ///
    /// ```
    /// use choreo_plugin::{Manifest, OptionValue};
    /// let manifest = Manifest::new("ply", "1", "").number("scale", "metres a unit", 1.0, 0.0..=100.0).unit("m");
    /// assert_eq!(manifest.parse_option("scale", "0.5"), Ok(OptionValue::Number(0.5)));
    /// let error = manifest.parse_option("scale", "-1").unwrap_err();
    /// assert!(error.message.contains("a number from 0 to 100 m"), "{error}");
    /// let manifest = manifest.color("tint", "its color", [0.0; 3]);
    /// assert_eq!(manifest.parse_option("tint", "lime"), Ok(OptionValue::Numbers(vec![0.0, 1.0, 0.0])));
    /// ```
    pub fn parse_option(&self, name: &str, text: &str) -> Result<OptionValue, OptionError> {
        let spec = self.option(name)?;
        let value = match &spec.kind {
            OptionKind::Number { .. } | OptionKind::Integer { .. } => {
                text.parse().ok().map(OptionValue::Number)
            }
            OptionKind::Bool { .. } => text.parse().ok().map(OptionValue::Bool),
            OptionKind::Text { .. } | OptionKind::Texture { .. } => Some(OptionValue::Text(text.to_string())),
            OptionKind::Color { .. } if !text.starts_with(|c: char| c.is_ascii_digit() || c == '.') => {
                Some(spec.linear(&self.name, text)?)
            }
            OptionKind::Color { .. } | OptionKind::Vector { .. } | OptionKind::Curve { .. } => {
                let parts = text.split([',', ' ']).filter(|part| !part.is_empty());
                parts.map(|part| part.parse().ok()).collect::<Option<Vec<f64>>>().map(OptionValue::Numbers)
            }
        };
        match value {
            Some(value) if spec.accepts(&value) => Ok(value),
            _ => Err(spec.refuse(&self.name, &format!("\"{text}\""))),
        }
    }

    /// Checks the given options for name, kind and range, and adds the defaults of the others. Names of colors become numbers.
    ///
    /// # Errors
    /// An option that does not exist, or a value that it does not allow.
    ///
    /// ```
    /// use choreo_plugin::{ImportOptions, Manifest};
    /// let manifest = Manifest::new("ply", "1", "").text("up", "the file's upward axis", "y", &["y", "z"]);
    /// assert_eq!(manifest.complete(&ImportOptions::default())?.text("up"), Some("y"));
    /// # Ok::<(), choreo_plugin::OptionError>(())
    /// ```
    pub fn complete(&self, given: &ImportOptions) -> Result<ImportOptions, OptionError> {
        let mut all = ImportOptions::default();
        for spec in &self.options {
            all.0.insert(spec.name.clone(), spec.default());
        }
        for (name, value) in &given.0 {
            let spec = self.option(name)?;
            let value = match (&spec.kind, value) {
                (OptionKind::Color { .. }, OptionValue::Text(text)) => spec.linear(&self.name, text)?,
                _ => value.clone(),
            };
            if !spec.accepts(&value) {
                return Err(spec.refuse(&self.name, &value.to_string()));
            }
            all.0.insert(name.clone(), value);
        }
        Ok(all)
    }
}

impl OptionSpec {
    /// A CSS name or hexadecimal color as linear red, green and blue.
    fn linear(&self, plugin: &str, text: &str) -> Result<OptionValue, OptionError> {
        let name = &self.name;
        let color = crate::color::parse(text)
            .map_err(|e| OptionError { message: format!("{plugin}: option {name}: {}", e.message), ..e })?;
        Ok(OptionValue::Numbers(color.truncate().to_array().map(f64::from).to_vec()))
    }

    /// The default value.
    pub fn default(&self) -> OptionValue {
        match &self.kind {
            OptionKind::Number { default, .. } => OptionValue::Number(*default),
            OptionKind::Bool { default } => OptionValue::Bool(*default),
            OptionKind::Text { default, .. } | OptionKind::Texture { default, .. } => {
                OptionValue::Text(default.clone())
            }
            OptionKind::Integer { default, .. } => OptionValue::Number(*default as f64),
            OptionKind::Color { default } => OptionValue::Numbers(default.to_vec()),
            OptionKind::Vector { default, .. } => OptionValue::Numbers(default.clone()),
            OptionKind::Curve { default, .. } => OptionValue::Numbers(default.as_flattened().to_vec()),
        }
    }

    /// Whether the type fits, and the value is allowed.
    pub fn accepts(&self, value: &OptionValue) -> bool {
        match (&self.kind, value) {
            (OptionKind::Number { min, max, .. }, OptionValue::Number(v)) => (*min..=*max).contains(v),
            (OptionKind::Bool { .. }, OptionValue::Bool(_))
            | (OptionKind::Texture { .. }, OptionValue::Text(_)) => true,
            (OptionKind::Text { one_of, .. }, OptionValue::Text(v)) => {
                one_of.is_empty() || one_of.contains(v)
            }
            (OptionKind::Integer { min, max, .. }, OptionValue::Number(v)) => {
                v.fract() == 0.0 && (*min as f64..=*max as f64).contains(v)
            }
            (OptionKind::Color { .. }, OptionValue::Numbers(v)) => {
                v.len() == 3 && v.iter().all(|v| (0.0..=MAX_COLOR).contains(v))
            }
            (OptionKind::Vector { default, min, max }, OptionValue::Numbers(v)) => {
                v.len() == default.len() && v.iter().all(|v| (*min..=*max).contains(v))
            }
            (OptionKind::Curve { min, max, .. }, OptionValue::Numbers(v)) => {
                let (keys, rest) = v.as_chunks::<2>();
                rest.is_empty() && is_curve(keys) && keys.iter().all(|key| (*min..=*max).contains(&key[1]))
            }
            _ => false,
        }
    }

    /// The allowed values in words: "a number from 0 to 1", "a number from 0 to 2 m", "true or false", "text", "one of auto, bt601", "a
    /// color", "[x, y] with numbers from 0 to 1", "keys [x, y] with x from 0 to 1 and y from 0 to 1".
    pub fn allowed(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        match &self.kind {
            OptionKind::Number { min, max, .. } => format!("a number from {min} to {max}{unit}"),
            OptionKind::Integer { min, max, .. } => format!("a whole number from {min} to {max}{unit}"),
            OptionKind::Bool { .. } => "true or false".to_string(),
            OptionKind::Text { one_of, .. } if one_of.is_empty() => "text".to_string(),
            OptionKind::Text { one_of, .. } => {
                format!("one of {}", list(one_of.iter().map(String::as_str), 30))
            }
            OptionKind::Color { .. } => "a color".to_string(),
            OptionKind::Texture { .. } => "the name of an image file, or image(…)".to_string(),
            OptionKind::Vector { default, min, max } => {
                let axes = ["x", "y", "z", "w"];
                let axes = axes[..default.len().min(4)].join(", ");
                format!("[{axes}] with numbers from {min} to {max}{unit}")
            }
            OptionKind::Curve { min, max, .. } => {
                format!("keys [x, y] with growing x from 0 to 1 and y from {min} to {max}{unit}")
            }
        }
    }

    fn refuse(&self, plugin: &str, got: &str) -> OptionError {
        OptionError {
            message: format!("{plugin}: option {} must be {}, got {got}", self.name, self.allowed()),
            hint: Some(self.about.clone()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest() -> Manifest {
        Manifest::new("toy", "1", "for tests")
            .number("scale", "metres a unit", 1.0, 0.001..=1000.0)
            .flag("smooth", "round edges", false)
            .text("up", "upward axis", "y", &["x", "y", "z"])
            .text("title", "any words", "", &[])
    }

    fn given(name: &str, value: OptionValue) -> ImportOptions {
        ImportOptions([(name.to_string(), value)].into())
    }

    #[test]
    fn missing_options_get_their_defaults() {
        let all = manifest().complete(&given("up", OptionValue::Text("z".into()))).unwrap();
        assert_eq!(all.number("scale"), Some(1.0));
        assert_eq!(all.bool("smooth"), Some(false));
        assert_eq!((all.text("up"), all.text("title")), (Some("z"), Some("")));
    }

    #[test]
    fn errors_of_options_state_the_allowed_values() {
        let refused = |name: &str, value| manifest().complete(&given(name, value)).unwrap_err();
        let e = refused("scal", OptionValue::Number(1.0));
        assert_eq!(e.message, "toy has no option \"scal\"; did you mean \"scale\"?");
        assert_eq!(e.hint.unwrap(), "options: scale, smooth, up, title");
        let e = refused("scale", OptionValue::Number(0.0));
        assert_eq!(e.message, "toy: option scale must be a number from 0.001 to 1000, got 0");
        assert_eq!(e.hint.unwrap(), "metres a unit");
        assert!(!manifest().option("scale").unwrap().accepts(&OptionValue::Number(f64::NAN)));
        let e = refused("scale", OptionValue::Text("1".into()));
        assert_eq!(e.message, "toy: option scale must be a number from 0.001 to 1000, got \"1\"");
        let e = refused("up", OptionValue::Text("w".into()));
        assert_eq!(e.message, "toy: option up must be one of x, y, z, got \"w\"");
        let more = Manifest::new("more", "1", "")
            .integer("count", "", 3, 1..=9)
            .vector("axis", "", &[0.0, 1.0], -1.0..=1.0)
            .unit("m")
            .curve("fall", "", &[[0.0, 1.0]], 0.0..=1.0);
        let refused_text = |name: &str, text: &str| more.parse_option(name, text).unwrap_err().message;
        let must = "more: option count must be a whole number from 1 to 9, got \"2.5\"";
        assert_eq!(refused_text("count", "2.5"), must);
        let must = "more: option axis must be [x, y] with numbers from -1 to 1 m, got \"0\"";
        assert_eq!(refused_text("axis", "0"), must);
        let must = "more: option fall must be keys [x, y] with growing x from 0 to 1 and y from 0 to 1, got \"0 0, 0 1\"";
        assert_eq!(refused_text("fall", "0 0, 0 1"), must);
        let keys = OptionValue::Numbers(vec![0.0, 0.5, 1.0, 1.0]);
        assert_eq!(more.parse_option("fall", "0 0.5, 1 1"), Ok(keys));
        let e = refused("smooth", OptionValue::Number(1.0));
        assert_eq!(e.message, "toy: option smooth must be true or false, got 1");
    }

    #[test]
    fn texts_of_the_command_line_are_parsed() {
        let parse = |name: &str, text: &str| manifest().parse_option(name, text);
        assert_eq!(parse("scale", "0.01"), Ok(OptionValue::Number(0.01)));
        assert_eq!(parse("smooth", "true"), Ok(OptionValue::Bool(true)));
        assert_eq!(parse("title", "17"), Ok(OptionValue::Text("17".into())));
        for (name, text) in [("scale", "inf"), ("scale", "NaN"), ("scale", "1m"), ("smooth", "yes")] {
            assert!(parse(name, text).unwrap_err().message.ends_with(&format!(", got \"{text}\"")));
        }
        let none = Manifest::new("bare", "1", "").parse_option("x", "1").unwrap_err();
        assert_eq!(
            (none.message.as_str(), none.hint.as_deref()),
            ("bare has no option \"x\"", Some("bare has no options"))
        );
    }
}
