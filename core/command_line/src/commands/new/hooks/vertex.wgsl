// effect: NAME
// about: surfaces that ripple
// version: 0.1.0
// hook: vertex
// reach: height
// param height = 0.03 m in 0..1: how far they move at most
// param length = 0.4 m in 0.01..100: from crest to crest
// param phase = 0 in -1000..1000: how many waves have gone by; key it over time
//
// How far a vertex moves, metres in the world, of at most // reach: METRES or a parameter. place: world, normal, uv, model (in
// the body's own space, before bones). With // space: model what it gives is along the body's own axes. Shadows and normals follow.
// Put it beside the script, into a folder plugins there, or name its folder with --plugins; then:
// effect("NAME").on(anna).key("phase", [[0.0, 0.0], [10.0, 20.0]])
fn effect(place: Place, p: Parameters) -> vec3<f32> {
    let wave = sin(6.2831853 * (place.world.y / p.length - p.phase));
    return p.height * wave * place.normal;
}
