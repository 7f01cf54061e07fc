//! Full-screen passes of effects.

/// One pass of an effect over the image.
#[derive(Clone, Debug, PartialEq)]
pub struct PostPass {
    /// Plugin name.
    pub effect: String,
    /// Parameters in manifest order.
    pub parameters: [f32; 8],
    /// Index of the pass, of an effect with several.
    pub number: u32,
    /// Factor by which its output is smaller than the image, in each direction.
    pub shrink: u32,
}

impl PostPass {
    /// Size of its output for an image of the size `whole`, pixels.
    pub(crate) fn size(&self, whole: [u32; 2]) -> [u32; 2] {
        whole.map(|s| s.div_ceil(self.shrink.max(1)))
    }
}
