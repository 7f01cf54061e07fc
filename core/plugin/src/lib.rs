//! The interface of plugins: an [`Importer`], an [`Effect`] with the trait of its hook, an [`Exporter`] of frames or a [`SceneExporter`];
//! manifests as data; the [`Registry`]. A plugin needs no other crate of the program: `glam`, [`asset`], [`motion`] (transforms, curves,
//! clips, time) and [`stage`] are reached through this one.
//!
//! Everywhere: metres, +Y up, right-handed, counter-clockwise front faces, seconds as integer [`motion::Time`], radians, colors
//! linear unless a field states sRGB, texture v pointing down.

#![warn(missing_docs)]

mod alpha;
mod asset_check;
mod binary;
pub mod build;
mod changed_area;
pub mod color;
pub mod effect;
mod effect_data;
mod effect_hooks;
pub mod effect_texture;
pub mod excerpt;
pub mod exporter;
mod float_frame;
pub mod guest;
pub mod importer;
mod isolated;
pub mod manifest;
pub mod on_use;
pub mod overlay;
pub mod parameters;
pub mod registry;
mod scene_exporter;
mod scene_inputs;
pub mod suggest;
mod text_numbers;
pub mod transfer;
pub mod yuv;

pub use binary::{Binary, BinaryError, BinaryNumber};
pub use build::{AssetBuilder, BuildError, MeshData, MeshPart, MorphData};
pub use changed_area::changed_area;
pub use choreo_asset as asset;
pub use choreo_motion as motion;
pub use choreo_stage as stage;
pub use effect::{Effect, Hook};
pub use effect_data::{
    BACKGROUND_DISTANCE, EffectImage, EffectImages, ImagePass, InvertedHull, LightSample, MAX_EFFECT_STEPS,
    Shutter, SurfaceInputs, SurfaceSample, VertexSample, ViewOrder,
};
pub use effect_hooks::{
    EffectPlugin, EffectShader, ImageEffect, LightingEffect, OutlineEffect, OverlayEffect, PixelEffect,
    ShutterEffect, SurfaceEffect, VertexEffect,
};
pub use effect_texture::EffectTexture;
pub use exporter::{ExportError, Exporter, Frame, FrameSink, Mark, VideoInfo};
pub use float_frame::{FloatFrame, FrameWish, IdMatte, IdShare, Passes, UnknownPass};
pub use glam;
pub use importer::{
    Claim, ExportOptions, Files, ImportError, ImportOptions, ImportScope, Importer, OptionValue, Source,
};
pub use isolated::PluginPanic;
pub use manifest::{BesideFile, MAX_COLOR, Manifest, OptionError, OptionKind, OptionSpec, PluginFile};
pub use on_use::{LazyEffect, LazyPlugin, PluginError};
pub use overlay::{ActorInstance, EffectScene, Label, Lattice, Overlay, Stroke, Triangle};
pub use registry::Registry;
pub use scene_exporter::{
    ExportDeviation, ExportedScene, MemoryFiles, SceneEvaluator, SceneExporter, SceneFiles,
};
pub use scene_inputs::{EffectFrame, SceneImages, SceneInputs};
#[doc(hidden)]
pub use text_numbers::read_block;
pub use text_numbers::{TextNumber, TextNumbers};
