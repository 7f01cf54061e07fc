// effect: motion_blur
// about: blurs what moves while the shutter is open
// hook: shutter
// off: shutter = 0
// param samples = int(16) in 1..256: sub-frames per frame, at most
// param shutter = 180 degrees in 0..720: how long the shutter is open; 360: from frame to frame
// param around = middle of middle|start|end: the shutter is open before and after the frame's time (middle), after it (start) or before it (end)
fn effect(p: Parameters) -> Shutter {
    let before = select(select(1.0, 0.0, p.around == AROUND_START), 0.5, p.around == AROUND_MIDDLE);
    // Whole images: a number that is keyed steps.
    return Shutter(u32(p.samples), p.shutter, before);
}
