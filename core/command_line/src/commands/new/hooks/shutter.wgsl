// effect: NAME
// about: motion blur of a film camera
// version: 0.1.0
// hook: shutter
// off: angle = 0
// param angle = 180 degrees in 0..720: shutter angle; 360: open for the whole frame
// param images = int(16) in 1..256: largest number of images per frame
//
// Motion blur: each frame is the mean of images at times at which the shutter is open. The function returns the largest number of images
// (fewer are drawn where nothing moves far), how long the shutter is open in degrees of the frame's duration, and the fraction of that
// time before the frame's own time, 0 to 1 (0.5: centered). It is called once per frame, without a time or a pixel.
// Put the file beside the script or into its folder plugins, or name its folder with --plugins; then:
// effect("NAME").key("angle", [[0.0, 0.0], [1.0, 360.0]])
fn effect(p: Parameters) -> Shutter {
    return Shutter(u32(p.images), p.angle, 0.5);
}
