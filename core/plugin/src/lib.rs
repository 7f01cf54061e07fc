//! The three things a plugin can be: [`Importer`], [`Effect`], [`Exporter`]; their manifests as data; the [`Registry`].

pub mod build;
pub mod effect;
pub mod effect_texture;
pub mod exporter;
pub mod importer;
pub mod manifest;
pub mod on_use;
pub mod overlay;
pub mod registry;
pub mod suggest;
pub mod yuv;

pub use build::{AssetBuilder, BuildError, MeshData};
pub use effect::{
    BACKGROUND_DISTANCE, Effect, Exposure, Falling, Hook, Pictures, Pixels, Place, Seen, Shell, SurfaceNeeds,
};
pub use effect_texture::EffectTexture;
pub use exporter::{ExportError, Exporter, Frame, FrameSink, Mark, VideoInfo};
pub use importer::{
    Claim, ExportOptions, Files, ImportError, ImportOptions, Importer, Needs, OptionValue, Source,
};
pub use manifest::{BesideFile, Manifest, OptionError, OptionKind, OptionSpec, PluginFile};
pub use on_use::{EffectOnUse, MadeOnce, PluginFault};
pub use overlay::{Body, Label, Lattice, Overlay, Scene, Stroke, Triangle};
pub use registry::Registry;
