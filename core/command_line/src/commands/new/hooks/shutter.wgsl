// effect: NAME
// about: motion blur of a film camera
// version: 0.1.0
// hook: shutter
// off: angle = 0
// param angle = 180 degrees in 0..720: how long the shutter is open; 360: from frame to frame
// param images = int(16) in 1..256: that make up one frame, at most
//
// What moves while the shutter is open is smeared: each frame is the mean of images at times while it is open. The function gives their
// number at most (fewer are drawn where nothing moves so far), how long the shutter is open in degrees of the frame's duration, and the
// share of that before the frame's time, from 0 to 1 (0.5: around it). It is called once for each frame, without time and pixels.
// Put it beside the script, into a folder plugins there, or name its folder with --plugins; then:
// effect("NAME").key("angle", [[0.0, 0.0], [1.0, 360.0]])
fn effect(p: Parameters) -> Shutter {
    return Shutter(u32(p.images), p.angle, 0.5);
}
