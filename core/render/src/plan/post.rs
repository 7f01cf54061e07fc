//! Full-screen passes of effects.

/// One pass of an effect over the image.
#[derive(Clone, Debug, PartialEq)]
pub struct PostPass {
    /// Plugin name.
    pub effect: String,
    /// Numbers of the parameters, [`choreo_plugin::Manifest::parameters`], and those of the frame behind them
    /// ([`choreo_plugin::Effect::reads_frame`]); a multiple of four, at least eight.
    pub parameters: Vec<f32>,
    /// Index of the pass, of an effect with several.
    pub number: u32,
    /// Factor by which its output is smaller than the image, in each direction.
    pub shrink: u32,
    /// Name of the texture that it writes, of an effect whose passes have textures; `None`: it makes the image.
    pub texture: Option<String>,
    /// Numbers of the effect's passes whose textures it reads.
    pub reads: Vec<u32>,
}

impl PostPass {
    /// The only pass of an effect.
    pub fn only(effect: String, parameters: Vec<f32>) -> PostPass {
        PostPass { effect, parameters, number: 0, shrink: 1, texture: None, reads: Vec::new() }
    }

    /// Rows of four parameters in uniform buffers.
    pub(crate) fn rows(&self) -> usize {
        self.parameters.len().div_ceil(4)
    }

    /// Size of its output for an image of the size `whole`, pixels.
    pub(crate) fn size(&self, whole: [u32; 2]) -> [u32; 2] {
        whole.map(|s| s.div_ceil(self.shrink.max(1)))
    }
}
