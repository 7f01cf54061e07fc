//! Looks: what an effect changes is named by its [`Hook`]; it does so on the GPU in WGSL and on the CPU in Rust.

use crate::{EffectTexture, Manifest, Overlay, PluginFile, Scene};
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
    /// A function of one vertex of a surface, which says how far it is moved: [`Effect::wgsl`] and [`Effect::cpu_vertex`].
    Vertex,
    /// A function of one light at one place on a surface, which says what comes of it: [`Effect::wgsl`] and
    /// [`Effect::cpu_lighting`].
    Lighting,
    /// Geometry of its own around or on surfaces: [`Effect::shell`], [`Effect::edges`].
    Shell,
    /// Triangles, lines, points and lattices of its own: [`Effect::overlay`].
    Overlay,
    /// How long the shutter is open: [`Effect::exposure`].
    Exposure,
}

impl Hook {
    /// Whether single actors can have it.
    pub fn of_actors(self) -> bool {
        matches!(self, Hook::Shell | Hook::Overlay) || self.is_in_scene()
    }

    /// Whether its function is a part of the shaders that draw the scene.
    pub fn is_in_scene(self) -> bool {
        matches!(self, Hook::Surface | Hook::Vertex | Hook::Lighting)
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

/// One vertex of a surface as a [`Hook::Vertex`] sees it. Laid out as the struct `Place` of the shaders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Where in the world as posed, metres; exact to f32 only, so fine near the origin.
    pub world: Vec3,
    /// Unit, in the world; zero of meshes without, and where [`SurfaceNeeds::normals`] asks for none and nothing is lit.
    pub normal: Vec3,
    /// With [`SurfaceNeeds::uvs`]; zero of meshes without.
    pub uv: Vec2,
    /// In the mesh's own space, morph targets counted, bones not: a pattern by it moves with the body.
    pub model: Vec3,
}

/// One light at one place on a surface as a [`Hook::Lighting`] sees it. Laid out as the struct `Falling` of the shaders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Falling {
    /// Between the normal and the way to the light, −1 to 1.
    pub cosine: f32,
    /// Of the light what shadows let through, 0 to 1.
    pub share: f32,
    /// Of the light as it arrives, by distance and cone, linear, without [`Falling::share`].
    pub color: Vec3,
    /// Of the surface, linear.
    pub base: Vec3,
    /// Unit, in the world, by the normal map where there is one.
    pub normal: Vec3,
    /// Unit, to the viewer and to the light.
    pub viewer: Vec3,
    pub light: Vec3,
    /// What the surface's own model makes of it: to be added to, or to be replaced.
    pub lit: Vec3,
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

/// What a [`Hook::Picture`] reads.
#[derive(Clone, Copy, Debug)]
pub struct Pictures<'a> {
    /// What the pass before gave.
    pub now: Pixels<'a>,
    /// What the effect's first pass got.
    pub original: Pixels<'a>,
    /// The scene a frame ago, two frames ago and so on, as it was drawn before any effect over the picture; as many as
    /// [`Effect::history`] asks for, or more.
    pub before: &'a [Pixels<'a>],
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
    /// - [`Hook::Vertex`]: `fn effect(place: Place, p: array<f32, 8>) -> vec3<f32>`, how far it is moved.
    /// - [`Hook::Lighting`]: `fn effect(falling: Falling, p: array<f32, 8>) -> vec3<f32>`, what comes to the viewer.
    /// - [`Hook::Picture`]: `fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32>`, which may call
    ///   `picture(at)`, what the pass before gave, `original(at)`, what the first pass got, and `picture_size()`, in pixels;
    ///   with a history `previous(frames, at)`, which is only ever run by its twin.
    ///
    /// Each may call `NAME(uv)` of its [`Effect::textures`].
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

    /// Of a [`Hook::Vertex`]: the same function, the specification of the WGSL. Metres in the world, or with
    /// [`Effect::along_model`] lengths along the mesh's own axes. Normals follow what it does with the place.
    fn cpu_vertex(&self, _place: &Place, _parameters: &[f32; 8]) -> Vec3 {
        Vec3::ZERO
    }

    /// Of a [`Hook::Vertex`]: how far it moves anything at most, metres; what would go farther is cut off there.
    fn reach(&self, _parameters: &[f32; 8]) -> f32 {
        0.0
    }

    /// Of a [`Hook::Vertex`]: whether it moves along the axes of the mesh, turned and stretched as the mesh is.
    fn along_model(&self) -> bool {
        false
    }

    /// Of a [`Hook::Lighting`]: the same function, the specification of the WGSL.
    fn cpu_lighting(&self, falling: &Falling, _parameters: &[f32; 8]) -> Vec3 {
        falling.lit
    }

    /// What of a surface a function of the scene reads.
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

    /// Of a [`Hook::Picture`] or a [`Hook::Overlay`]: how many frames back it looks. They are drawn, or for an overlay posed, for
    /// each frame, so that a frame is the same whether those before it were rendered or not; before the first stands the first.
    fn history(&self, _parameters: &[f32; 8]) -> u32 {
        0
    }

    /// Pictures that its functions read.
    fn textures(&self) -> &[EffectTexture] {
        &[]
    }

    /// Of a [`Hook::Picture`]: how many times smaller, each way, the picture is that a pass makes; 1 or more. The last pass makes
    /// the whole, of this size. `at` counts the pixels that a pass makes, `picture(at)` those of the pass before, `original(at)`
    /// those of the whole.
    fn shrink(&self, _pass_number: u32, _size: [u32; 2], _parameters: &[f32; 8]) -> u32 {
        1
    }

    /// Of a [`Hook::Picture`]: the same function, the specification of the WGSL.
    fn cpu_picture(&self, pictures: &Pictures, at: [i32; 2], _pass_number: u32, _p: &[f32; 8]) -> Vec4 {
        pictures.now.at(at[0], at[1])
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
