//! The content of a file as importers return it: meshes, materials, images, cameras, lights, clips. Independent of timelines.
//!
//! Everything is in choreo's convention: metres, +Y up, right-handed, counter-clockwise front faces,
//! texture v pointing down (glTF). Colors are linear unless a field states sRGB.

#![warn(missing_docs)]

mod animated_materials;
mod asset;
mod asset_bounds;
mod asset_hash;
mod bounds;
mod camera;
mod derived;
pub mod expression;
pub mod eyes;
pub mod hash;
mod image_sequence;
mod instancing;
mod light;
mod material;
mod material_layers;
mod mesh;
mod panorama;
mod posed_mesh;
mod reflection;
mod skinning;
mod srgb;
mod texture;
mod toon;

pub use asset::{Asset, MeshInstance, Origin, Skin, Warning};
pub use asset_hash::clip_hash;
pub use bounds::{Aabb, BoundsPart, DAabb, InstanceBounds};
pub use camera::{AssetCamera, Projection};
pub use derived::Derived;
pub use expression::{ColorBind, Expression, ExpressionGroup, MaterialColor, MorphBind, Override, UvBind};
pub use eyes::{Eyes, EyesMovedBy, GAZE, RangeMap};
pub use hash::ContentHash;
pub use image_sequence::{ImageSequence, ImageSource, ImageSourceError, ImageStream, TextureSlot};
pub use light::{AssetLight, Light, LightKind};
pub use material::{AlphaMode, FrameStrip, LineStyle, Material, Shading, Triplanar};
pub use material_layers::MaterialLayers;
pub use mesh::{Mesh, MorphTarget, Primitive, Topology};
pub use panorama::{Panorama, PanoramaError};
pub use posed_mesh::{PlacementSelection, PosedInstance, PosedPrimitive, posed_meshes_by, posed_meshes_in};
pub use reflection::Reflection;
pub use skinning::{VertexTransforms, widen};
pub use srgb::{linear_from_srgb, linear_from_srgb_f32, srgb_from_linear};
pub use texture::{Image, ImageFile, ImageFileFormat, Sampler, TextureRef, Wrap};
pub use toon::{Outline, Toon, UvMotion};
