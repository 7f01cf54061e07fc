//! Cross dissolves between cameras (Blender's sequencer: Cross): the finished display images of two plans are mixed, below the 2D
//! layers over the frame.

use crate::plan::Plan;
use choreo_plugin::Frame;

/// The image of the camera before a cut, which dissolves into the image of the frame's plan.
#[derive(Clone, Debug)]
pub struct PlanDissolve {
    /// Plan with its own sub-frames and full-screen passes, without 2D layers over the frame.
    pub plan: Plan,
    /// Share of the earlier camera in the mix, above 0, at most 1.
    pub share: f32,
}

/// Draws a plan; if it dissolves, mixes in the image of the camera before, and then draws the 2D layers over both.
pub(crate) fn dissolved<E>(
    mut plan: Plan,
    reuse: Option<Frame>,
    mut draw: impl FnMut(Plan, Option<Frame>) -> Result<Frame, E>,
) -> Result<Frame, E> {
    let Some(dissolve) = plan.dissolve.take() else { return draw(plan, reuse) };
    let layers = plan.layers_in_front.take();
    let PlanDissolve { plan: before, share } = *dissolve;
    let mut frame = draw(plan, reuse)?;
    mix(&mut frame.rgba, &draw(before, None)?.rgba, share);
    if let Some(layers) = layers {
        layers.blend_over(&mut frame);
    }
    Ok(frame)
}

/// Mixes in a share of another image. Colors are weighted by their alpha.
fn mix(image: &mut [u8], other: &[u8], share: f32) {
    for (pixel, other) in image.as_chunks_mut::<4>().0.iter_mut().zip(other.as_chunks::<4>().0) {
        let weights = [f32::from(pixel[3]) * (1.0 - share), f32::from(other[3]) * share];
        let alpha = weights[0] + weights[1];
        if alpha > 0.0 {
            for (channel, other) in pixel[..3].iter_mut().zip(other) {
                let sum = f32::from(*channel) * weights[0] + f32::from(*other) * weights[1];
                *channel = (sum / alpha).round() as u8;
            }
        }
        pixel[3] = alpha.round() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opaque_images_are_mixed_channel_by_channel_and_transparent_ones_by_opacity() {
        let mixed = |a: [u8; 4], b: [u8; 4], share| {
            let mut image = a;
            mix(&mut image, &b, share);
            image
        };
        assert_eq!(mixed([0, 100, 255, 255], [255, 200, 55, 255], 0.25), [64, 125, 205, 255]);
        assert_eq!(mixed([9, 8, 7, 255], [1, 2, 3, 255], 0.0), [9, 8, 7, 255]);
        assert_eq!(mixed([9, 8, 7, 255], [1, 2, 3, 255], 1.0), [1, 2, 3, 255]);
        // Half of an opaque red and half of a transparent image give a red with half the alpha.
        assert_eq!(mixed([255, 0, 0, 255], [0, 0, 0, 0], 0.5), [255, 0, 0, 128]);
    }
}
