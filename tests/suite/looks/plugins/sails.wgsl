// effect: sails
// about: sails from each bone of a body to a mast beside it
// hook: overlay
// count: 100
// over: true
// param opacity = 0.6 in 0..1: of a triangle
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Triangle {
    let above = parent(index);
    if index >= actor.joints || above < 0 {
        return Triangle();
    }
    let t = f32(index) / f32(actor.joints);
    let mast = in_world(vec3(-0.6, 1.0, 0.0));
    return Triangle(joint(index), joint(u32(above)), mast, vec4(t, 0.2, 1.0 - t, p.opacity));
}
