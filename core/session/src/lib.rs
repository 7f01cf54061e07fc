//! Hot reload as an engine: a script, or a model, and what it was made of; when a file that was used changes, it is made anew on
//! a worker thread and swapped whole. A faulty version leaves the last good one in place, with what is wrong with it.
//!
//! ```text
//! Recipe ─► Session::build ─► Version ─► Painter ─► frames
//!               ▲    └ Touched: the files that it depends on
//!               └── Watch ◄── the system
//! ```
//! No window and no toolkit: what shows it is the caller's.

pub mod edit;
mod eye;
mod live;
pub mod model;
mod painter;
pub mod plugin_files;
mod recipe;
mod session;
mod watch;

pub use eye::{Eye, Marks};
pub use live::Live;
pub use painter::{Asked, Painted, Painter, Shown, StartRenderer};
pub use recipe::Recipe;
pub use session::{Problem, Scene, Session, Version, Work};
pub use watch::{Interest, Waited, Waker, Watch, WatchError};
