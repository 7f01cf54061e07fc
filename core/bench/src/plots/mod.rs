//! Reports of all commands in one style: a table for the terminal and for Markdown, JSON for programs, an image as SVG. This module knows
//! nothing of scenes.
//!
//! ```
//! use choreo_bench::plots::{Choice, Row};
//! let mut choice = Choice::new("rotation", "How is a rotation between two keys found?");
//! choice.error_unit = "°";
//! choice.rows.push(Row::new("slerp").error(2e-5, 1e-6).at("90° apart, t = 0.21").nanos(2.1));
//! choice.rows.push(Row::new("nlerp").error(0.9, 0.3).at("90° apart, t = 0.22").nanos(1.2));
//! choice.choose("slerp", "the exact one costs a nanosecond more");
//! assert_eq!(choice.front(), [0, 1]);
//! println!("{}", choice.table().text());
//! ```

mod bars;
mod choice;
mod lines;
mod number;
mod plot;
mod svg;
mod table;
mod timeline;

pub use bars::byte_bars;
pub use choice::{Choice, Row, difference, ratio, time};
pub use lines::Lines;
pub use number::{bytes, duration, quantity};
pub use plot::{plot, stacked};
pub use table::{Cell, Column, Table};
pub use timeline::{Bar, Mark, Timeline, Track};
