//! Textures of effects: one buffer for all of them, and the functions that read it.

use choreo_plugin::Effect;

/// Functions with the names of an effect's textures. `effects`: all, whose textures lie one after the other.
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

/// Content of the texel buffer: 8 bytes a texel.
pub fn texture_bytes(effects: &[Effect]) -> Vec<u8> {
    let halves = effects.iter().flat_map(|e| e.textures()).flat_map(|t| t.halves.iter().flatten());
    halves.flat_map(|half| half.to_le_bytes()).collect()
}
