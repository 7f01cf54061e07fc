//! The three things a plugin can be: [`Importer`], [`Effect`], [`Exporter`]; their manifests as data; the [`Registry`].

#![warn(missing_docs)]

pub mod build;
pub mod effect;
pub mod effect_texture;
pub mod exporter;
pub mod importer;
mod isolated;
pub mod manifest;
pub mod on_use;
pub mod overlay;
pub mod registry;
pub mod suggest;
pub mod yuv;

pub use build::{AssetBuilder, BuildError, MeshData};
pub use effect::{
    BACKGROUND_DISTANCE, Effect, EffectFunction, EffectImage, EffectImages, Hook, InvertedHull, LightSample,
    Shutter, SurfaceInputs, SurfaceSample, VertexSample, ViewOrder,
};
pub use effect_texture::EffectTexture;
pub use exporter::{ExportError, Exporter, Frame, FrameSink, Mark, VideoInfo};
pub use importer::{
    Claim, ExportOptions, Files, ImportError, ImportOptions, ImportScope, Importer, OptionValue, Source,
};
pub use isolated::PluginPanic;
pub use manifest::{BesideFile, Manifest, OptionError, OptionKind, OptionSpec, PluginFile};
pub use on_use::{LazyEffect, LazyPlugin, PluginError};
pub use overlay::{ActorInstance, EffectScene, Label, Lattice, Overlay, Stroke, Triangle};
pub use registry::Registry;
