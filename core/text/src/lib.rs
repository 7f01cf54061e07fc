//! Fonts, lines of text, and the exact coverage of their outlines. Does not depend on stages, scripts or renderers.
//! Lengths are pixels, y down.

mod coverage;
mod fallback;
mod font;
mod layout;

pub use coverage::Coverage;
pub use fallback::{Fallback, fallbacks, needs_shaping};
pub use font::{Font, FontError};
pub use layout::{Align, Style, TextLayout, lay_out_text};
