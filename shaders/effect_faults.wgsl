// Faults of effects: results that are no numbers, and loops that do not end. Both become magenta and are recorded, for a warning.
// CPU reference: core/render/src/effect_faults.rs.

@if(EFFECTS)
// Costs of the rounds of counted loops in this call of an effect.
var<private> effect_spent: u32;
// The loop in which this call took too many steps, by its number from 1.
var<private> effect_loop: u32;
// The pixel, row by row in the upper half; of vertices what is above all pixels.
var<private> effect_pixel: u32 = 0xfffffffeu;
// A lighting effect failed at this pixel.
var<private> effect_light_failed: bool;

fn effect_at(pixel: vec2<f32>) {
    let at = vec2<u32>(pixel);
    effect_pixel = at.y << 16u | at.x;
}

// Before each call of an effect.
fn effect_begin() {
    effect_spent = 0u;
    effect_loop = 0u;
}

// Stands at the beginning of a loop's body (core/wgsl_effect/src/loops.rs) and ends the loop where the call took too many steps.
fn effect_round(cost: u32, loop_number: u32) -> bool {
    effect_spent += cost;
    // MAX_EFFECT_STEPS of core/plugin/src/effect.rs.
    let over = effect_spent > 100000u;
    if (over && effect_loop == 0u) { effect_loop = loop_number; }
    return over;
}

// Whether a call failed. `first`: the effect's place among the faults.
fn effect_failed(value: vec4<f32>, first: u32) -> bool {
    // By its bits: compilers may take it that no number is NaN.
    let exponents = bitcast<vec4<u32>>(value) & vec4(0x7f800000u);
    let failed = effect_loop != 0u || any(exponents == vec4(0x7f800000u));
    @if(FAULT_RECORDS) if (failed) { atomicMin(&effect_faults[first + min(effect_loop, 15u)], effect_pixel); }
    return failed;
}

fn effect_color(value: vec4<f32>, first: u32) -> vec4<f32> {
    if (effect_failed(value, first)) { return vec4(1.0, 0.0, 1.0, 1.0); }
    return value;
}

// The reflected light of one light source; a pixel where it fails is magenta as a whole.
fn effect_light(value: vec3<f32>, first: u32) -> vec3<f32> {
    if (!effect_failed(vec4(value, 0.0), first)) { return value; }
    effect_light_failed = true;
    return vec3(1.0, 0.0, 1.0);
}

// A vertex where it fails stays in its place.
fn effect_offset(value: vec3<f32>, first: u32) -> vec3<f32> {
    if (effect_failed(vec4(value, 0.0), first)) { return vec3(0.0); }
    return value;
}
@end
