//! The functions of the shader around an effect's, on the CPU.

use crate::forms::Host;
use crate::overlay::{Bone, Bones};
use crate::program::Around;
use crate::shape::Value;
use choreo_plugin::{Body, EffectTexture, Pictures, Scene};
use glam::{DVec3, Vec2, Vec4};

/// Colours from the arguments: for trials, before there is anything to see.
pub struct Plain;

impl Around for Plain {
    fn call(&self, host: Host, arguments: &[Value]) -> Value {
        match host {
            Host::PictureSize => Value::ints([1280, 720]),
            Host::Named(i) => Value::uint(i as u32),
            Host::Parent => Value::ints([arguments.first().map_or(0, |v| v.0[0]) as i32 - 1, 0]),
            _ => {
                let bits = arguments.last().map_or(0, |v| v.0[0]);
                Value::floats(&[f32::from((bits & 255) as u8) / 255.0, 0.5, 0.25, 1.0])
            }
        }
    }
}

/// An effect's textures.
pub struct Textured<'a>(pub &'a [EffectTexture]);

impl Around for Textured<'_> {
    fn call(&self, host: Host, arguments: &[Value]) -> Value {
        let (Host::Texture(i), [uv]) = (host, arguments) else { return Value::default() };
        let texel = self.0.get(i).map_or(Vec4::ZERO, |t| t.sample(Vec2::new(uv.f(0), uv.f(1))));
        Value::floats(&texel.to_array())
    }
}

/// The body that an overlay is drawn around, and textures.
pub struct Beside<'a> {
    pub scene: &'a Scene<'a>,
    /// `None`: the scene.
    pub body: Option<&'a Body<'a>>,
    pub bones: &'a Bones,
    pub textures: &'a [EffectTexture],
}

impl Around for Beside<'_> {
    fn call(&self, host: Host, arguments: &[Value]) -> Value {
        let last = arguments.last().copied().unwrap_or_default();
        let bone = self.bones.all.get(last.0[0] as usize);
        let ago = || {
            let frames = arguments.first().map_or(0, |v| v.0[0]) as usize;
            self.body.map(|body| self.scene.earlier(body, frames).unwrap_or(*body))
        };
        let at = match host {
            Host::Texture(_) => return Textured(self.textures).call(host, arguments),
            Host::Parent => {
                let above = bone.and_then(|(_, above)| *above);
                return Value::ints([above.map_or(-1, |above| above as i32), 0]);
            }
            Host::Named(i) => return Value::uint(self.bones.named.get(i).copied().unwrap_or(u32::MAX)),
            Host::Joint => joint(self.body, bone),
            Host::PreviousJoint => joint(ago().as_ref(), bone),
            Host::InWorld => in_world(self.body, &last),
            Host::PreviousInWorld => in_world(ago().as_ref(), &last),
            _ => DVec3::ZERO,
        };
        Value::floats(&at.as_vec3().to_array())
    }
}

/// A bone that is not there stands where the body does.
fn joint(body: Option<&Body>, bone: Option<&Bone>) -> DVec3 {
    let Some(body) = body else { return DVec3::ZERO };
    bone.and_then(|(joint, _)| body.joint(*joint)).unwrap_or(body.world_from_model.translation)
}

fn in_world(body: Option<&Body>, place: &Value) -> DVec3 {
    let at = DVec3::from([0, 1, 2].map(|i| f64::from(place.f(i))));
    body.map_or(at, |body| body.world_from_model.transform_point3(at))
}

/// The pictures of a pass, and textures.
pub struct Seeing<'a> {
    pub pictures: &'a Pictures<'a>,
    pub textures: &'a [EffectTexture],
    /// Frames back that it may ask for.
    pub history: u32,
}

impl Around for Seeing<'_> {
    fn call(&self, host: Host, arguments: &[Value]) -> Value {
        let at = arguments.last().map_or([0, 0], |v| [v.0[0] as i32, v.0[1] as i32]);
        let pixel = match host {
            Host::Texture(_) => return Textured(self.textures).call(host, arguments),
            Host::PictureSize => return Value::ints(self.pictures.now.size.map(|s| s as i32)),
            Host::Picture => self.pictures.now.at(at[0], at[1]),
            Host::Original => self.pictures.original.at(at[0], at[1]),
            Host::Previous => {
                // Farther back than the head says stands the farthest.
                let frames = arguments.first().map_or(1, |v| v.0[0]).clamp(1, self.history.max(1));
                let before = self.pictures.before;
                let picture = before.get(frames as usize - 1).or(before.last());
                // A plan of one time alone has none: the picture stands for them.
                picture.unwrap_or(&self.pictures.original).at(at[0], at[1])
            }
            _ => return Value::default(),
        };
        Value::floats(&pixel.to_array())
    }
}
