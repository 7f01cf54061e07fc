// The lights of a frame, and the light that a point receives from one of them. CPU reference: core/render/src/plan/lights.rs.

// `LightType` of the plan.
const LIGHT_DIRECTIONAL: u32 = 0u;
const LIGHT_POINT: u32 = 1u;
const LIGHT_SPOT: u32 = 2u;

struct Light {
    // Camera-relative position of point and spot lights.
    position: vec3<f32>,
    // LIGHT_DIRECTIONAL, LIGHT_POINT or LIGHT_SPOT
    kind: u32,
    // Unit direction in which the light shines.
    direction: vec3<f32>,
    // First shadow view in the low 16 bits, number of views in the high 16 bits.
    shadow_views: u32,
    // Color times intensity, over π.
    color: vec3<f32>,
    // 0: no range
    inverse_range_squared: f32,
    // Spot lights: scale and offset of the cosine (KHR_lights_punctual, "Inner and Outer Cone Angles").
    cone: vec2<f32>,
    // Polynomial falloff over distance: weights of the linear and the quadratic term, the constant has the rest; below 0: inverse
    // square.
    polynomial: vec2<f32>,
}

@if(LOCAL_LIGHTS)
struct Incoming {
    // Unit direction to the light.
    direction: vec3<f32>,
    color: vec3<f32>,
}

// KHR_lights_punctual: inverse square, window at the range, cone.
fn incoming(light: Light, relative: vec3<f32>) -> Incoming {
    if (light.kind == LIGHT_DIRECTIONAL) {
        return Incoming(-light.direction, light.color);
    }
    let offset = light.position - relative;
    let d2 = max(dot(offset, offset), 1e-8);
    let to_light = offset * inverseSqrt(d2);
    let x = d2 * light.inverse_range_squared;
    var strength = clamp(1.0 - x * x, 0.0, 1.0) / d2;
    @if(POLYNOMIAL_FALLOFF)
    if (light.polynomial.y >= 0.0) {
        let linear = light.polynomial.x;
        let quadratic = light.polynomial.y;
        strength = 1.0 / ((1.0 - linear - quadratic) + linear * sqrt(d2) + quadratic * d2);
    }
    @end
    if (light.kind == LIGHT_SPOT) {
        let cone = clamp(dot(-light.direction, to_light) * light.cone.x + light.cone.y, 0.0, 1.0);
        strength *= cone * cone;
    }
    return Incoming(to_light, light.color * strength);
}
@end
