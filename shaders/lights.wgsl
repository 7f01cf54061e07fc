// The lights of a frame, and what one of them gives to a point. CPU reference: core/render/src/plan/lights.rs.

// `LightType` of the plan.
const LIGHT_DIRECTIONAL: u32 = 0u;
const LIGHT_POINT: u32 = 1u;
const LIGHT_SPOT: u32 = 2u;

struct Light {
    // Point and spot lights.
    position: vec3<f32>,
    // LIGHT_DIRECTIONAL, LIGHT_POINT or LIGHT_SPOT
    kind: u32,
    // Unit, in which it shines.
    direction: vec3<f32>,
    // Its first shadow view in the low 16 bits, how many in the high ones.
    shadow_views: u32,
    // Times the intensity, over π.
    color: vec3<f32>,
    // 0: without end
    inverse_range_squared: f32,
    // Spot lights: scale and offset of the cosine (KHR_lights_punctual, "Inner and Outer Cone Angles").
    cone: vec2<f32>,
    // Falloff by a polynomial of the distance: the linear and the quadratic term's share, the rest is constant; below 0: inverse square.
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
