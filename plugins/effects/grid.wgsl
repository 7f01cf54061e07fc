// effect: grid
// about: lines on the floor at every metre, every tenth one thicker
// hook: overlay
// count: 1
// of: scene
// over: over
// off: opacity = 0
// param cell = 1 m in 0.001..10000: distance between lines
// param height = 0 m in -1000000..1000000: height of the floor
// param fade = 60 m in 0.1..1000000: distance from the viewer at which the grid has faded out
// param opacity = 0.5 in 0..1: opacity of the lines
// param color = rgb(0.02, 0.02, 0.03): color of the lines
// param over = false: drawn on top of everything, instead of hidden by nearer surfaces
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Lattice {
    let color = vec4(p.color, p.opacity);
    let x = vec3(1.0, 0.0, 0.0);
    let z = vec3(0.0, 0.0, 1.0);
    return Lattice(vec3(0.0, p.height, 0.0), x, z, p.cell, 10u, vec2(1.0, 2.0), color, p.fade);
}
