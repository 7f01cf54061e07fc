//! Looks: what an effect changes is named by its [`Hook`]; it does so on the GPU in WGSL and on the CPU in Rust.

use crate::{Manifest, Overlay, PluginFile, Scene};
use glam::{Vec2, Vec3, Vec4};

/// Where an effect takes hold of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Hook {
    /// A function of one pixel of the finished picture: [`Effect::wgsl`] and [`Effect::cpu`].
    #[default]
    Pixel,
    /// A function of one pixel of the finished picture and those around it: [`Effect::wgsl`] and [`Effect::cpu_picture`].
    Picture,
    /// A function of one place on a surface, after light has fallen on it: [`Effect::wgsl`] and [`Effect::cpu_surface`].
    Surface,
    /// Geometry of its own around or on surfaces: [`Effect::shell`], [`Effect::edges`].
    Shell,
    /// Lines, points and lattices of its own: [`Effect::overlay`].
    Overlay,
    /// How long the shutter is open: [`Effect::exposure`].
    Exposure,
}

impl Hook {
    /// Whether single actors can have it.
    pub fn of_actors(self) -> bool {
        matches!(self, Hook::Shell | Hook::Surface | Hook::Overlay)
    }
}

/// A picture as the mean of several, at times while the shutter is open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// How many times; 1 or more.
    pub samples: u32,
    /// How long the shutter is open, as a share of the time from frame to frame.
    pub open: f64,
    /// How much of that lies before the frame's own time, 0 to 1.
    pub before: f64,
}

/// A hull around a surface, of which the inside is seen: an outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell {
    /// Pixels of the picture, whatever the distance.
    pub width: f32,
    /// Linear.
    pub color: Vec3,
    /// 0: the colour as it is, 1: times what the surface shows.
    pub lighting_mix: f32,
}

/// One place on a surface as a [`Hook::Surface`] sees it. Laid out as the struct `Seen` of the shaders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Where in the world, metres; exact to f32 only, so fine near the origin.
    pub world: Vec3,
    /// Metres from the camera; of orthographic ones, along their view.
    pub distance: f32,
    /// Unit, towards the viewer's side; zero without [`SurfaceNeeds::normals`] and of meshes without.
    pub normal: Vec3,
    /// Cosine between the normal and the way to the viewer.
    pub facing: f32,
    /// Of the stage, at this pixel, linear.
    pub background: Vec3,
    /// Colours of the joints that move the place, by their weights; with [`SurfaceNeeds::joints`].
    pub joints: Vec3,
    /// With [`SurfaceNeeds::uvs`]; zero of meshes without.
    pub uv: Vec2,
    /// With [`SurfaceNeeds::shadow`]: share of the light that a white matte surface would give back here and that shadows
    /// take, by luminance. Zero of unlit materials.
    pub shadow: f32,
    /// Where the viewer stands, as `world`; of orthographic cameras, where the way to the place begins.
    pub viewer: Vec3,
}

/// Metres to the background: as good as without end, and finite.
pub const BACKGROUND_DISTANCE: f32 = 1e9;

/// What a [`Hook::Surface`] reads of a surface; the rest is not made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceNeeds {
    pub normals: bool,
    pub uvs: bool,
    pub joints: bool,
    pub shadow: bool,
    /// It makes alpha: the surface is mixed with what is behind it.
    pub see_through: bool,
}

/// A picture that a [`Hook::Picture`] reads: linear RGBA, rows from the top.
#[derive(Clone, Copy, Debug)]
pub struct Pixels<'a> {
    pub size: [u32; 2],
    pub rgba: &'a [Vec4],
}

impl Pixels<'_> {
    /// Beyond the border the nearest pixel counts.
    pub fn at(&self, x: i32, y: i32) -> Vec4 {
        let [w, h] = self.size.map(|s| s as i32);
        let (x, y) = (x.clamp(0, w - 1), y.clamp(0, h - 1));
        self.rgba[y as usize * w as usize + x as usize]
    }
}

pub trait Effect: Send + Sync {
    fn manifest(&self) -> &Manifest;

    /// The file that it was read from, where it is no part of the program.
    fn file(&self) -> Option<&PluginFile> {
        None
    }

    fn hook(&self) -> Hook {
        Hook::Pixel
    }

    /// Whether single actors can have it.
    fn of_actors(&self) -> bool {
        self.hook().of_actors()
    }

    /// WGSL source of a function `effect`; `p` holds the parameters in manifest order, colours are linear.
    /// - [`Hook::Pixel`]: `fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32>`, `uv` 0..1 from the top left.
    /// - [`Hook::Surface`]: `fn effect(color: vec4<f32>, seen: Seen, p: array<f32, 8>) -> vec4<f32>`.
    /// - [`Hook::Picture`]: `fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32>`, which may call
    ///   `picture(at)`, what the pass before gave, and `original(at)`, what the first pass got.
    fn wgsl(&self) -> &str {
        ""
    }

    /// Of a [`Hook::Pixel`]: the same function, the specification of the WGSL.
    fn cpu(&self, color: Vec4, _uv: Vec2, _parameters: &[f32; 8]) -> Vec4 {
        color
    }

    /// Of a [`Hook::Surface`]: the same function, the specification of the WGSL.
    fn cpu_surface(&self, color: Vec4, _seen: &Seen, _parameters: &[f32; 8]) -> Vec4 {
        color
    }

    fn surface_needs(&self, _parameters: &[f32; 8]) -> SurfaceNeeds {
        SurfaceNeeds::default()
    }

    /// Of a [`Hook::Surface`] on everything: whether it changes the background too, as a surface without a normal at
    /// [`BACKGROUND_DISTANCE`].
    fn of_background(&self, _parameters: &[f32; 8]) -> bool {
        false
    }

    /// Of a [`Hook::Picture`]: how often its function runs over the picture, each time over what it gave before.
    fn passes(&self) -> u32 {
        1
    }

    /// Of a [`Hook::Picture`]: the same function, the specification of the WGSL.
    fn cpu_picture(
        &self,
        picture: &Pixels,
        _original: &Pixels,
        at: [i32; 2],
        _pass_number: u32,
        _parameters: &[f32; 8],
    ) -> Vec4 {
        picture.at(at[0], at[1])
    }

    /// Of a [`Hook::Shell`]: the colour of lines along the edges of triangles, linear.
    fn edges(&self, _parameters: &[f32; 8]) -> Option<Vec3> {
        None
    }

    /// Of a [`Hook::Overlay`].
    fn overlay(&self, _scene: &Scene, _parameters: &[f32; 8]) -> Overlay {
        Overlay::default()
    }

    /// Of a [`Hook::Exposure`].
    fn exposure(&self, _parameters: &[f32; 8]) -> Option<Exposure> {
        None
    }

    /// Of a [`Hook::Shell`]. `None` draws nothing.
    fn shell(&self, _parameters: &[f32; 8]) -> Option<Shell> {
        None
    }
}
