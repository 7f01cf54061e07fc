//! Requests to plugins in WebAssembly, and their replies.

use super::scene::TransferredScene;
use super::{Bytes, Result, Transfer, Written, fields, variants};
use crate::{Claim, ImportError, ImportOptions, ImportScope, Manifest, OptionKind, OptionSpec, OptionValue};
use choreo_asset::Asset;

/// The arguments of an import. The plugin fetches the bytes of the file separately, so that they are copied only once.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportRequest {
    /// Name of the file.
    pub name: String,
    /// The parts that are needed.
    pub needs: ImportScope,
    /// All options of the manifest.
    pub options: ImportOptions,
    /// Bytes of the file.
    pub length: usize,
}

/// The result of an import.
#[derive(Debug)]
pub enum ImportReply {
    /// The file's content.
    Asset(Box<Asset>),
    /// The import has ended with an error.
    Error(ImportError),
}

/// The arguments of an export of a scene.
#[derive(Debug)]
pub struct ExportRequest {
    /// Everything but the poses, which are asked for time by time.
    pub scene: TransferredScene,
}

/// The result of an export, whose files are written while it runs.
#[derive(Clone, Debug, PartialEq)]
pub enum ExportReply {
    /// Notes for the user.
    Notes(Vec<String>),
    /// The format cannot hold the scene.
    Error(String),
}

fields! {
    ImportRequest { name, needs, options, length }
    ExportRequest { scene }
    ImportScope { geometry, clips, textures, pixels, image_files }
    ImportError { file, place, what, hint }
    Manifest { name, version, about, extensions, magic, options }
    OptionSpec { name, about, unit, kind }
}

variants! {
    ImportReply { 0 Asset(asset), 1 Error(error) }
    ExportReply { 0 Notes(notes), 1 Error(error) }
    OptionKind {
        0 Number { default, min, max }, 1 Bool { default }, 2 Text { default, one_of }, 3 Integer { default, min, max },
        4 Color { default }, 5 Vector { default, min, max }, 6 Curve { default, min, max },
        7 Texture { default, srgb },
    }
    OptionValue { 0 Number(value), 1 Bool(value), 2 Text(value), 3 Numbers(value) }
    Claim { 0 NotMine, 1 Extension, 2 Content(score) }
}

impl Transfer for ImportOptions {
    fn write(&self, out: &mut Written) {
        self.0.write(out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<ImportOptions> {
        Ok(ImportOptions(Transfer::read(from)?))
    }
}
