// effect: grid
// about: the floor's metres as lines, each tenth a thicker one
// hook: overlay
// count: 1
// of: scene
// over: over
// off: opacity = 0
// param cell = 1 m in 0.001..10000: from line to line
// param height = 0 m in -1000000..1000000: of the floor
// param fade = 60 m in 0.1..1000000: distance from the viewer at which it has faded out
// param opacity = 0.5 in 0..1: of the lines
// param color = rgb(0.02, 0.02, 0.03): of the lines
// param over = false: over the image, rather than hidden by what is nearer
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Lattice {
    let color = vec4(p.color, p.opacity);
    let x = vec3(1.0, 0.0, 0.0);
    let z = vec3(0.0, 0.0, 1.0);
    return Lattice(vec3(0.0, p.height, 0.0), x, z, p.cell, 10u, vec2(1.0, 2.0), color, p.fade);
}
