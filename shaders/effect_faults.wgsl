// Faults of effects: results that are not finite, and loops that do not end. Both become magenta and are recorded, for a warning.
// CPU reference: core/render/src/effect_faults.rs.

@if(EFFECTS)
// Cost of all loop iterations so far in this call of an effect.
var<private> effect_spent: u32;
// Number, from 1, of the loop in which this call took too many steps.
var<private> effect_loop: u32;
// Position of the pixel: row in the upper 16 bits, column in the lower. Vertices have a value above all pixels.
var<private> effect_pixel: u32 = 0xfffffffeu;
// Whether a lighting effect failed at this pixel.
var<private> effect_light_failed: bool;

fn effect_at(pixel: vec2<f32>) {
    let at = vec2<u32>(pixel);
    effect_pixel = at.y << 16u | at.x;
}

// Resets the counters before a call of an effect.
fn effect_begin() {
    effect_spent = 0u;
    effect_loop = 0u;
}

// Called at the beginning of a loop's body (inserted by core/wgsl_effect/src/loops.rs): ends the loop if the call took too many
// steps.
fn effect_round(cost: u32, loop_number: u32) -> bool {
    effect_spent += cost;
    // MAX_EFFECT_STEPS of core/plugin/src/effect_data.rs.
    let over = effect_spent > 100000u;
    if (over && effect_loop == 0u) { effect_loop = loop_number; }
    return over;
}

// Whether a call failed; records the fault if it did. `first`: index of the effect's first record.
fn effect_failed(value: vec4<f32>, first: u32) -> bool {
    // Tests the bits, because compilers may assume that no number is NaN.
    let exponents = bitcast<vec4<u32>>(value) & vec4(0x7f800000u);
    let failed = effect_loop != 0u || any(exponents == vec4(0x7f800000u));
    @if(FAULT_RECORDS) if (failed) { atomicMin(&effect_faults[first + min(effect_loop, 15u)], effect_pixel); }
    return failed;
}

fn effect_color(value: vec4<f32>, first: u32) -> vec4<f32> {
    if (effect_failed(value, first)) { return vec4(1.0, 0.0, 1.0, 1.0); }
    return value;
}

// Checks the reflected light of one light source. The whole pixel becomes magenta if an effect failed.
fn effect_light(value: vec3<f32>, first: u32) -> vec3<f32> {
    if (!effect_failed(vec4(value, 0.0), first)) { return value; }
    effect_light_failed = true;
    return vec3(1.0, 0.0, 1.0);
}

// Checks a displacement. A vertex stays in its place if the effect failed.
fn effect_offset(value: vec3<f32>, first: u32) -> vec3<f32> {
    if (effect_failed(vec4(value, 0.0), first)) { return vec3(0.0); }
    return value;
}
@end
