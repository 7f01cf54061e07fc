//! Files in: an importer turns bytes into an [`Asset`].

use crate::{Manifest, PluginFile, PluginPanic};
use choreo_asset::Asset;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Reads files of one format.
///
/// ```
/// use choreo_plugin::{AssetBuilder, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, MeshData, Source};
/// use std::sync::Arc;
///
/// /// Three numbers a line: a point.
/// struct Points(Manifest);
///
/// impl Importer for Points {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn import(
///         &self,
///         source: &Source,
///         _: &dyn Files,
///         _: ImportScope,
///         _: &ImportOptions,
///     ) -> Result<choreo_plugin::asset::Asset, ImportError> {
///         let error = |what: String| ImportError { file: source.name.clone(), place: String::new(), what, hint: None };
///         let text = String::from_utf8_lossy(&source.bytes);
///         let positions: Result<Vec<f32>, _> = text.split_whitespace().map(str::parse).collect();
///         let positions = positions.map_err(|e| error(e.to_string()))?;
///         let topology = choreo_plugin::asset::Topology::Points;
///         let mut builder = AssetBuilder::default();
///         builder.mesh(MeshData { positions, topology, ..MeshData::default() }).map_err(|e| error(e.to_string()))?;
///         builder.finish(&source.name).map_err(|e| error(e.to_string()))
///     }
/// }
///
/// struct NoFiles;
///
/// impl Files for NoFiles {
///     fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
///         Err(format!("{relative}: there are no further files"))
///     }
/// }
///
/// let points = Points(Manifest::new("points", "1", "points as text").extensions(["points"]));
/// let source = Source { name: "a.points".into(), bytes: Arc::new(b"0 0 0\n1 2 3".to_vec()) };
/// let asset = points.import(&source, &NoFiles, ImportScope::ALL, &ImportOptions::default())?;
/// assert_eq!(asset.meshes[0].primitives[0].positions.len(), 2);
/// # Ok::<(), ImportError>(())
/// ```
pub trait Importer: Send + Sync {
    /// Name, description, extensions and options.
    fn manifest(&self) -> &Manifest;

    /// Whether the bytes are this importer's own. Looks only at `source`, and must be fast.
    /// The default compares the magic bytes of the manifest, else its extensions.
    fn claim(&self, source: &Source) -> Claim {
        self.manifest().claim(source)
    }

    /// [`Importer::claim`], or the reason why it failed. Only importers that run in an interpreter or in WebAssembly implement this. The
    /// [`Registry`](crate::Registry) catches and reports the panics of all importers, and asks the remaining ones.
    ///
    /// ```
    /// use choreo_plugin::asset::Asset;
    /// use choreo_plugin::*;
    ///
    /// /// An importer whose code runs in an interpreter.
    /// struct Interpreted(Manifest);
    ///
    /// impl Importer for Interpreted {
    ///     fn manifest(&self) -> &Manifest {
    ///         &self.0
    ///     }
    ///     fn checked_claim(&self, source: &Source) -> Result<Claim, PluginPanic> {
    ///         let first = source.bytes.first().ok_or_else(|| PluginPanic::new(&self.0, "no first byte"))?;
    ///         Ok(if *first == b'#' { Claim::Content(60) } else { Claim::NotMine })
    ///     }
    ///     fn import(&self, _: &Source, _: &dyn Files, _: ImportScope, _: &ImportOptions) -> Result<Asset, ImportError> {
    ///         Ok(Asset::default())
    ///     }
    /// }
    ///
    /// let mut registry = Registry::default();
    /// registry.add_importer(Interpreted(Manifest::new("notes", "1", "an example")));
    /// let source = |bytes: &[u8]| Source { name: "a.notes".into(), bytes: bytes.to_vec().into() };
    /// assert_eq!(registry.claims(&source(b"# a"))[0].0, Claim::Content(60));
    /// assert_eq!(registry.failed_claims(&source(b""))[0].to_string(), "the plugin notes 1 has failed: no first byte");
    /// ```
    fn checked_claim(&self, source: &Source) -> Result<Claim, PluginPanic> {
        Ok(self.claim(source))
    }

    /// The plugin file that the importer was read from, unless the importer is part of the program. Its assets depend on that file, too.
    fn file(&self) -> Option<&PluginFile> {
        None
    }

    /// Reads a file. `needs` are the parts that the caller will use. `options` holds all options of the manifest: the caller has checked
    /// the given ones and added the defaults ([`Manifest::complete`]).
    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError>;
}

/// An importer's claim on a file: the importer with the greatest claim reads it. Claims by content are greater than claims by name.
///
/// ```
/// use choreo_plugin::Claim;
/// assert!(Claim::Content(50) > Claim::Extension && Claim::Extension > Claim::NotMine);
/// assert_eq!(Claim::Content(90).to_string(), "by content, 90 of 100");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Claim {
    /// The file has another format.
    NotMine,
    /// The file name has an extension of the format, and the content does not contradict it.
    Extension,
    /// The content shows the format: 100 = there is no doubt, 50 = other formats could begin like this, too.
    Content(u8),
}

impl std::fmt::Display for Claim {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Claim::NotMine => f.write_str("not mine"),
            Claim::Extension => f.write_str("by extension"),
            Claim::Content(score) => write!(f, "by content, {score} of 100"),
        }
    }
}

/// A file handed to an importer.
#[derive(Clone, Debug)]
pub struct Source {
    /// The path as the user wrote it, for messages. Do not open it.
    pub name: String,
    /// The contents of the file.
    pub bytes: Arc<Vec<u8>>,
}

impl Source {
    /// The extension of the name in lower case, without the dot; empty without one.
    ///
    /// ```
    /// use choreo_plugin::Source;
    /// let source = Source { name: "models.old/Knight.MD5mesh".into(), bytes: Default::default() };
    /// assert_eq!(source.extension(), "md5mesh");
    /// ```
    pub fn extension(&self) -> String {
        match self.name.rsplit_once('.') {
            Some((_, e)) if !e.contains(['/', '\\']) => e.to_ascii_lowercase(),
            _ => String::new(),
        }
    }
}

/// The only way for an importer to reach further files (buffers, textures): relative to the source, confined to
/// the folders that the user gave. Refusals and failures are texts that name the file and why.
///
/// ```
/// use choreo_plugin::Files;
/// use std::sync::Arc;
///
/// /// The files of a test.
/// struct Palette;
///
/// impl Files for Palette {
///     fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
///         match relative {
///             "a.pal" => Ok(Arc::new(vec![255, 0, 0])),
///             other => Err(format!("cannot read \"{other}\": no such file")),
///         }
///     }
///     fn progress(&self, part: f32) -> bool {
///         part < 1.0
///     }
///     fn wants_clip(&self, index: usize, name: &str) -> bool {
///         index == 0 || name == "Walk"
///     }
/// }
///
/// assert_eq!(Palette.read("a.pal"), Ok(Arc::new(vec![255, 0, 0])));
/// assert!(Palette.read("b.pal").is_err() && Palette.progress(0.5) && !Palette.wants_clip(1, "Run"));
/// ```
pub trait Files {
    /// Reads a file; the error names it and gives the reason.
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String>;

    /// Reports the progress of a long import, from 0 to 1. False: the import was cancelled, so that it may stop with any error.
    fn progress(&self, part: f32) -> bool {
        let _ = part;
        true
    }

    /// Whether the caller will play a clip of the file; only asked with `ImportScope::clips`. `index` is the number of clips that the asset
    /// has so far. If the answer is false, an importer may add the name alone ([`Clip::new`](crate::motion::Clip::new) without curves).
    fn wants_clip(&self, index: usize, name: &str) -> bool {
        let _ = (index, name);
        true
    }
}

/// The parts of a file that the caller will use; the others are not decoded.
///
/// ```
/// use choreo_plugin::ImportScope;
/// let needs = ImportScope::ALL.both(ImportScope::CLIPS);
/// assert!(needs.clips && !needs.geometry && ImportScope::NO_PIXELS.geometry);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImportScope {
    /// Meshes, skins and materials.
    pub geometry: bool,
    /// Animation clips.
    pub clips: bool,
    /// The images of the materials, with name and size.
    pub textures: bool,
    /// The pixels of these images. Otherwise their `rgba` is empty and nothing is decoded; their headers are read all the same.
    pub pixels: bool,
    /// The original files of these images ([`Image::file`](crate::asset::Image::file)), for an export that writes them unchanged.
    pub image_files: bool,
}

impl ImportScope {
    /// Everything that is drawn.
    pub const ALL: ImportScope =
        ImportScope { geometry: true, clips: true, textures: true, pixels: true, image_files: false };
    /// Everything that is drawn, and the files of its images.
    pub const WITH_IMAGE_FILES: ImportScope = ImportScope { image_files: true, ..ImportScope::ALL };
    /// Clips alone.
    pub const CLIPS: ImportScope =
        ImportScope { geometry: false, clips: true, textures: false, pixels: false, image_files: false };
    /// Everything but pixels, to describe a scene without drawing it.
    pub const NO_PIXELS: ImportScope = ImportScope { pixels: false, ..ImportScope::ALL };

    /// The parts that both include.
    pub fn both(self, other: ImportScope) -> ImportScope {
        ImportScope {
            geometry: self.geometry && other.geometry,
            clips: self.clips && other.clips,
            textures: self.textures && other.textures,
            pixels: self.pixels && other.pixels,
            image_files: self.image_files && other.image_files,
        }
    }
}

/// Option values by name.
///
/// ```
/// use choreo_plugin::{ImportOptions, OptionValue};
/// let options = ImportOptions([("scale".to_string(), OptionValue::Number(0.01))].into());
/// assert_eq!((options.number("scale"), options.text("scale")), (Some(0.01), None));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions(pub BTreeMap<String, OptionValue>);

/// Option values of exporters, by name.
///
/// ```
/// use choreo_plugin::{ExportOptions, ImportOptions, OptionValue};
/// let options: ExportOptions = ImportOptions([("digits".to_string(), OptionValue::Number(3.0))].into());
/// assert_eq!(options.number("digits"), Some(3.0));
/// ```
pub type ExportOptions = ImportOptions;

/// The value of an option.
///
/// ```
/// use choreo_plugin::OptionValue;
/// let [up, tint] = [OptionValue::Text("y".into()), OptionValue::Numbers(vec![1.0, 0.5, 0.0])];
/// assert_eq!((up.to_string(), tint.to_string()), ("\"y\"".into(), "[1.0, 0.5, 0.0]".into()));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum OptionValue {
    /// A number.
    Number(f64),
    /// True or false.
    Bool(bool),
    /// A text.
    Text(String),
    /// Several numbers: a color, a vector, or x and y of each key of a curve.
    Numbers(Vec<f64>),
}

impl std::fmt::Display for OptionValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            OptionValue::Number(v) => write!(f, "{v}"),
            OptionValue::Bool(v) => write!(f, "{v}"),
            OptionValue::Text(v) => write!(f, "\"{v}\""),
            OptionValue::Numbers(v) => write!(f, "{v:?}"),
        }
    }
}

impl ImportOptions {
    /// The number of that name; `None` if there is none or it is of another type.
    pub fn number(&self, name: &str) -> Option<f64> {
        match self.0.get(name) {
            Some(OptionValue::Number(v)) => Some(*v),
            _ => None,
        }
    }
    /// The text of that name; `None` if there is none or it is of another type.
    pub fn text(&self, name: &str) -> Option<&str> {
        match self.0.get(name) {
            Some(OptionValue::Text(v)) => Some(v),
            _ => None,
        }
    }
    /// The numbers of that name: a color, a vector, or x and y of each key of a curve; `None` if there are none or it is of another
    /// type.
    pub fn numbers(&self, name: &str) -> Option<&[f64]> {
        match self.0.get(name) {
            Some(OptionValue::Numbers(v)) => Some(v),
            _ => None,
        }
    }
    /// The flag of that name; `None` if there is none or it is of another type.
    pub fn bool(&self, name: &str) -> Option<bool> {
        match self.0.get(name) {
            Some(OptionValue::Bool(v)) => Some(*v),
            _ => None,
        }
    }
}

/// Error of an import, shown as `FILE: PLACE: WHAT`; the hint says what to do.
///
/// ```
/// use choreo_plugin::ImportError;
/// let (file, place, what) = ("a.iqm".into(), "vertex array 3".into(), "its offset 900 is beyond the file".into());
/// let error = ImportError { file, place, what, hint: None };
/// assert_eq!(error.to_string(), "a.iqm: vertex array 3: its offset 900 is beyond the file");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImportError {
    /// Name of the file, as the user wrote it.
    pub file: String,
    /// Element path (`accessors[3]`) or byte offset ("byte 1024"); may be empty.
    pub place: String,
    /// The problem.
    pub what: String,
    /// How to resolve it.
    pub hint: Option<String>,
}

impl std::fmt::Display for ImportError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ImportError { file, place, what, .. } = self;
        match place.is_empty() {
            true => write!(f, "{file}: {what}"),
            false => write!(f, "{file}: {place}: {what}"),
        }
    }
}

impl std::error::Error for ImportError {}
