// effect: motion_blur
// about: what moves while the shutter is open is smeared
// hook: shutter
// off: shutter = 0
// param samples = 16 in 1..256: images that make up one
// param shutter = 180 in 0..720: how long it is open, degrees; 360: from frame to frame
// param around = middle of middle|start|end: the shutter is open before and after the frame's time (middle), after it (start) or before it (end)
fn effect(p: array<f32, 8>) -> Shutter {
    let before = select(select(1.0, 0.0, p[around] == 1.0), 0.5, p[around] == 0.0);
    // Whole images: a number that is keyed steps.
    return Shutter(u32(p[samples] + 0.5), p[shutter], before);
}
