// effect: speed
// about: an arrow at each joint, along its velocity
// version: 1
// hook: overlay
// history: 1
// count: 240
// over: true
// param ahead = 0.15 in 0..2: length of an arrow: seconds of motion
// param fps = 30 in 1..240: frames per second of the scene
//
// Three lines a joint: the shaft and two barbs; none where the joint stands still.
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line {
    let bone = index / 3u;
    if bone >= actor.joints {
        return Line();
    }
    let from_here = joint(bone);
    let velocity = (from_here - previous_joint(1u, bone)) * p.fps;
    let way = velocity * p.ahead;
    if length(way) < 0.02 {
        return Line();
    }
    let speed = clamp(length(velocity) / 3.0, 0.0, 1.0);
    let color = vec4(mix(vec3(0.05, 0.5, 0.9), vec3(1.0, 0.1, 0.05), speed), 1.0);
    let tip = from_here + way;
    if index % 3u == 0u {
        return Line(from_here, tip, 1.5, color);
    }
    let side = cross(normalize(way), vec3(0.0, 0.0, 1.0)) * select(-0.1, 0.1, index % 3u == 1u);
    return Line(tip, tip + (side - 0.2 * normalize(way)) * length(way), 1.5, color);
}
