//! CPU versions of the shader functions that an effect's function may call.

use crate::overlay::{Bone, Bones};
use choreo_plugin::{ActorInstance, EffectImage, EffectImages, EffectScene, EffectTexture, SceneImages};
use glam::{DVec3, Vec2, Vec4};

/// A function that the shader supplies to the effect's function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HostFunction {
    /// Counts a round of a loop; implemented in the machine.
    CountRound,
    Picture,
    Original,
    PictureSize,
    OriginalSize,
    Shrink,
    Previous,
    /// The texture of a pass: one pixel, a bilinear sample, and the size.
    PassTexture(usize),
    PassBetween(usize),
    PassSize(usize),
    /// Pixels of [`choreo_plugin::SceneImages`].
    SceneSurface,
    SceneMotion,
    /// One of [`choreo_plugin::EffectFrame::rows`].
    SceneRow(usize),
    /// Four of [`choreo_plugin::EffectFrame::numbers`].
    FrameRow(usize),
    /// The actor around which an overlay is drawn: position of a joint, parent of a bone, and a point of model space in the world.
    Joint,
    Parent,
    InWorld,
    PreviousJoint,
    PreviousInWorld,
    /// Number of a bone that the header names.
    NamedJoint(usize),
    /// One of the effect's textures.
    Texture(usize),
}

/// The functions and images that are available to an effect's function while it runs.
pub(crate) trait Environment {
    /// The image that `host` reads by pixel; `None` for all other functions.
    fn image(&self, _host: HostFunction) -> Option<EffectImage<'_>> {
        None
    }

    /// Calls a function. Arguments and result are the bits of their components.
    fn call(&self, host: HostFunction, arguments: &[u32]) -> [u32; 4];
}

fn float_bits(v: Vec4) -> [u32; 4] {
    v.to_array().map(f32::to_bits)
}

fn int_bits(values: [i32; 2]) -> [u32; 4] {
    [values[0] as u32, values[1] as u32, 0, 0]
}

/// Placeholder for trials: returns colors made from the arguments.
pub(crate) struct Placeholder;

impl Environment for Placeholder {
    fn call(&self, host: HostFunction, arguments: &[u32]) -> [u32; 4] {
        let bits = arguments.last().copied().unwrap_or(0);
        match host {
            HostFunction::PictureSize | HostFunction::OriginalSize | HostFunction::PassSize(_) => {
                int_bits([1280, 720])
            }
            HostFunction::Shrink => int_bits([4, 0]),
            HostFunction::NamedJoint(i) => int_bits([i as i32, 0]),
            HostFunction::Parent => int_bits([arguments.first().map_or(0, |v| *v as i32) - 1, 0]),
            _ => float_bits(Vec4::new(f32::from((bits & 255) as u8) / 255.0, 0.5, 0.25, 1.0)),
        }
    }
}

/// An effect's textures.
pub(crate) struct Textures<'a>(pub &'a [EffectTexture]);

impl Environment for Textures<'_> {
    fn call(&self, host: HostFunction, arguments: &[u32]) -> [u32; 4] {
        let (HostFunction::Texture(i), [u, v]) = (host, arguments) else { return [0; 4] };
        let uv = Vec2::new(f32::from_bits(*u), f32::from_bits(*v));
        float_bits(self.0.get(i).map_or(Vec4::ZERO, |texture| texture.sample(uv)))
    }
}

/// An effect's textures, and the numbers of the frame.
pub(crate) struct FrameEnvironment<'a> {
    pub textures: &'a [EffectTexture],
    /// [`choreo_plugin::EffectFrame::numbers`].
    pub numbers: &'a [f32],
}

impl Environment for FrameEnvironment<'_> {
    fn call(&self, host: HostFunction, arguments: &[u32]) -> [u32; 4] {
        let HostFunction::FrameRow(row) = host else { return Textures(self.textures).call(host, arguments) };
        let row = self.numbers.as_chunks().0.get(row);
        row.map_or([0; 4], |row| row.map(f32::to_bits))
    }
}

/// The images of a pass, and textures.
pub(crate) struct PassImages<'a> {
    pub images: &'a EffectImages<'a>,
    pub textures: &'a [EffectTexture],
    /// Number of previous frames that the pass may request.
    pub history: u32,
    /// Downscale factor of each pass, and the number of the pass that runs.
    pub shrinks: &'a [u32],
    pub pass_number: u32,
}

impl PassImages<'_> {
    fn shrink(&self) -> u32 {
        self.shrinks.get(self.pass_number as usize).or(self.shrinks.first()).copied().unwrap_or(1)
    }

    fn pass_texture(&self, pass: usize) -> Option<EffectImage<'_>> {
        self.images.passes.get(pass).copied().flatten()
    }

    /// Bilinear sample of the texture of a pass; `uv` is 0 to 1 over the whole image.
    fn sample_bilinear(&self, pass: usize, uv: Vec2) -> Vec4 {
        let [width, height] = self.images.original.size.map(|s| s as f32);
        let shrink = self.shrinks.get(pass).copied().unwrap_or(1) as f32;
        let place = uv * (Vec2::new(width, height) / shrink);
        self.pass_texture(pass).map_or(Vec4::ZERO, |texture| texture.between(place))
    }
}

impl Environment for PassImages<'_> {
    fn image(&self, host: HostFunction) -> Option<EffectImage<'_>> {
        match host {
            HostFunction::Picture => Some(self.images.now),
            HostFunction::Original => Some(self.images.original),
            HostFunction::PassTexture(pass) => self.pass_texture(pass),
            HostFunction::SceneSurface => self.images.scene.and_then(|scene| scene.surface),
            HostFunction::SceneMotion => self.images.scene.and_then(|scene| scene.motion),
            _ => None,
        }
    }

    fn call(&self, host: HostFunction, arguments: &[u32]) -> [u32; 4] {
        match (host, arguments) {
            (HostFunction::Texture(_), _) => Textures(self.textures).call(host, arguments),
            (HostFunction::PictureSize, _) => int_bits(self.images.now.size.map(|s| s as i32)),
            (HostFunction::OriginalSize, _) => int_bits(self.images.original.size.map(|s| s as i32)),
            (HostFunction::Shrink, _) => int_bits([self.shrink() as i32, 0]),
            (HostFunction::PassBetween(pass), [u, v]) => {
                float_bits(self.sample_bilinear(pass, Vec2::new(f32::from_bits(*u), f32::from_bits(*v))))
            }
            (HostFunction::PassSize(pass), _) => {
                let shrink = self.shrinks.get(pass).copied().unwrap_or(1);
                int_bits(self.images.original.size.map(|s| s.div_ceil(shrink) as i32))
            }
            (HostFunction::SceneRow(i), _) => {
                self.images.scene.map_or([0; 4], |scene| float_bits(scene.rows[i]))
            }
            // This branch runs only if the scene's image is unknown.
            (HostFunction::SceneSurface, _) => float_bits(SceneImages::NO_SURFACE),
            (HostFunction::Previous, [frames, x, y]) => {
                // Frames farther back than the header allows read the farthest frame. A plan of a single time has no previous frames: the
                // original image is read instead.
                let frames = (*frames).clamp(1, self.history.max(1));
                let before = self.images.before;
                let image =
                    before.get(frames as usize - 1).or(before.last()).unwrap_or(&self.images.original);
                float_bits(image.at(*x as i32, *y as i32))
            }
            _ => [0; 4],
        }
    }
}

/// The actor around which an overlay is drawn, and textures.
pub(crate) struct Surroundings<'a> {
    pub scene: &'a EffectScene<'a>,
    /// The actor; `None` for an overlay of the scene.
    pub actor: Option<&'a ActorInstance<'a>>,
    pub bones: &'a Bones,
    pub textures: &'a [EffectTexture],
}

impl Environment for Surroundings<'_> {
    fn call(&self, host: HostFunction, arguments: &[u32]) -> [u32; 4] {
        let bone = self.bones.all.get(arguments.last().map_or(0, |v| *v as usize));
        let earlier = || {
            let frames = arguments.first().map_or(0, |v| *v as usize);
            self.actor.map(|actor| self.scene.earlier(actor, frames).unwrap_or(*actor))
        };
        let at = match host {
            HostFunction::Texture(_) => return Textures(self.textures).call(host, arguments),
            HostFunction::Parent => {
                let parent = bone.and_then(|(_, parent)| *parent);
                return int_bits([parent.map_or(-1, |parent| parent as i32), 0]);
            }
            HostFunction::NamedJoint(i) => {
                return [self.bones.named.get(i).copied().unwrap_or(u32::MAX), 0, 0, 0];
            }
            HostFunction::Joint => joint(self.actor, bone),
            HostFunction::PreviousJoint => joint(earlier().as_ref(), bone),
            HostFunction::InWorld => in_world(self.actor, arguments),
            HostFunction::PreviousInWorld => in_world(earlier().as_ref(), arguments),
            _ => DVec3::ZERO,
        };
        float_bits(at.as_vec3().extend(0.0))
    }
}

/// World position of a bone; the actor's position for a bone that does not exist.
fn joint(actor: Option<&ActorInstance>, bone: Option<&Bone>) -> DVec3 {
    let Some(actor) = actor else { return DVec3::ZERO };
    bone.and_then(|(joint, _)| actor.joint(*joint)).unwrap_or(actor.world_from_model.translation)
}

/// World position of a point in model space, which is the last three arguments.
fn in_world(actor: Option<&ActorInstance>, arguments: &[u32]) -> DVec3 {
    let Some(point) = arguments.last_chunk::<3>() else { return DVec3::ZERO };
    let at = DVec3::from(point.map(|bits| f64::from(f32::from_bits(bits))));
    actor.map_or(at, |actor| actor.world_from_model.transform_point3(at))
}
