//! Fonts, lines of text, and how much of each pixel their outlines cover. Knows nothing of stages, scripts or renderers.
//! Lengths are pixels, y down.

mod coverage;
mod font;
mod layout;

pub use coverage::Coverage;
pub use font::{Font, FontError};
pub use layout::{Align, Laid, Style, lay_out};
