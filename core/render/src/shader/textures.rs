//! Textures of effects: one buffer for all of them, and WGSL functions that read it; and functions that read the textures of
//! passes.

use choreo_plugin::{Effect, ImagePass};

/// First binding of the textures of passes in the descriptor set of a full-screen pass.
pub(crate) const POST_TEXTURES: u32 = 7;

/// WGSL functions named after an effect's textures. `effects`: all effects, whose textures follow each other in the buffer.
pub fn texture_functions(effects: &[Effect], effect: &Effect) -> String {
    let name = &effect.manifest().name;
    let before = effects.iter().take_while(|e| e.manifest().name != *name);
    let mut first: usize = before.flat_map(|e| e.textures()).map(|t| t.halves.len()).sum();
    let mut text = String::new();
    for texture in effect.textures() {
        let [width, height] = texture.size;
        text += &format!(
            "fn {}(uv: vec2<f32>) -> vec4<f32> {{ return effect_texture({first}u, vec2({width}u, {height}u), uv); }}\n",
            texture.name
        );
        first += texture.halves.len();
    }
    text
}

/// WGSL functions named after the textures of passes, and the bindings of those that the pass reads. The others are not bound.
pub fn pass_functions(passes: &[ImagePass], number: u32) -> String {
    let reads = passes.get(number as usize).map_or(&[][..], |pass| &pass.reads);
    let mut text = String::new();
    for (pass, read) in passes.iter().zip(0u32..).take(passes.len().saturating_sub(1)) {
        let name = &pass.name;
        let slot = reads.iter().take(ImagePass::MOST_READ).position(|number| *number == read);
        text += &match slot {
            Some(slot) => {
                let (binding, row, component) = (POST_TEXTURES as usize + slot, slot / 4, slot % 4);
                format!(
                    "@group(0) @binding({binding}) var post_texture_{slot}: texture_2d<f32>;\n\
                     fn {name}_size() -> vec2<i32> {{ return vec2<i32>(textureDimensions(post_texture_{slot})); }}\n\
                     fn {name}_at(at: vec2<i32>) -> vec4<f32> {{\n    \
                     return textureLoad(post_texture_{slot}, clamp(at, vec2(0), {name}_size() - 1), 0);\n}}\n\
                     fn {name}_uv(uv: vec2<f32>) -> vec4<f32> {{\n    \
                     let place = post_place(uv, post.textures[{row}][{component}], {name}_size());\n    \
                     let c = vec2<i32>(floor(place));\n    let f = place - floor(place);\n    \
                     let above = mix({name}_at(c), {name}_at(c + vec2(1, 0)), f.x);\n    \
                     return mix(above, mix({name}_at(c + vec2(0, 1)), {name}_at(c + vec2(1, 1)), f.x), f.y);\n}}\n"
                )
            }
            // A pass may ask for the size of the texture that it writes.
            None => format!(
                "fn {name}_size() -> vec2<i32> {{ return vec2<i32>(post.size); }}\n\
                 fn {name}_at(at: vec2<i32>) -> vec4<f32> {{ return vec4(0.0); }}\n\
                 fn {name}_uv(uv: vec2<f32>) -> vec4<f32> {{ return vec4(0.0); }}\n"
            ),
        };
    }
    text
}

/// Content of the texel buffer, 8 bytes for each texel.
pub fn texture_bytes(effects: &[Effect]) -> Vec<u8> {
    let halves = effects.iter().flat_map(|e| e.textures()).flat_map(|t| t.halves.iter().flatten());
    halves.flat_map(|half| half.to_le_bytes()).collect()
}
