//! Counts holes of meshes whose back faces are not drawn, in images with a magenta background.

use choreo_plugin::Frame;

/// Numbers of pixels that the model covers, that are empty without its back faces, and that differ.
pub(crate) fn count_holes(front: &Frame, both: &Frame) -> [usize; 3] {
    let background = |p: &&[u8]| *p == [255, 0, 255, 255];
    let mut counts = [0; 3];
    for (front, both) in front.rgba.chunks_exact(4).zip(both.rgba.chunks_exact(4)) {
        counts[0] += usize::from(!background(&both));
        counts[1] += usize::from(background(&front) && !background(&both));
        counts[2] += usize::from(front.iter().zip(both).any(|(a, b)| a.abs_diff(*b) > 2));
    }
    counts
}
