//! Full-screen passes of effects.

/// One pass of an effect over the image.
#[derive(Clone, Debug, PartialEq)]
pub struct PostPass {
    /// Plugin name.
    pub effect: String,
    /// Numeric parameters, [`choreo_plugin::Manifest::parameters`], followed by the frame's numbers if the effect reads them
    /// ([`choreo_plugin::Effect::reads_frame`]). The length is a multiple of four, at least eight.
    pub parameters: Vec<f32>,
    /// Index of the pass among those of its effect.
    pub number: u32,
    /// Factor by which the output is smaller than the image, in each direction.
    pub shrink: u32,
    /// Name of the texture that the pass writes, if the effect's passes have textures; `None`: the pass writes the image.
    pub texture: Option<String>,
    /// Indices of the effect's passes whose textures this one reads.
    pub reads: Vec<u32>,
}

impl PostPass {
    /// The only pass of an effect.
    pub fn only(effect: String, parameters: Vec<f32>) -> PostPass {
        PostPass { effect, parameters, number: 0, shrink: 1, texture: None, reads: Vec::new() }
    }

    /// Number of rows of four parameters in the uniform buffer.
    pub(crate) fn rows(&self) -> usize {
        self.parameters.len().div_ceil(4)
    }

    /// Size of the output in pixels, for an image of the size `whole`.
    pub(crate) fn size(&self, whole: [u32; 2]) -> [u32; 2] {
        whole.map(|s| s.div_ceil(self.shrink.max(1)))
    }
}
