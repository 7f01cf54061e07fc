//! What one run of an effect makes of a picture.

#[derive(Clone, Debug, PartialEq)]
pub struct PostPass {
    /// Plugin name.
    pub effect: String,
    /// In manifest order.
    pub parameters: [f32; 8],
    /// Number of earlier runs of an effect that runs more than once.
    pub number: u32,
    /// How many times smaller, each way, the picture is that it makes.
    pub shrink: u32,
}

impl PostPass {
    /// Pixels of what it makes of a picture.
    pub fn size(&self, whole: [u32; 2]) -> [u32; 2] {
        whole.map(|s| s.div_ceil(self.shrink.max(1)))
    }
}
