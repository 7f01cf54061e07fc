//! Hot reload as an engine: a script, or a model, and what it was made of; when a file that was used changes, it is made anew on
//! a worker thread and swapped whole. A faulty version leaves the last good one in place, with what is wrong with it.
//!
//! ```text
//! SceneSource ─► Session::build ─► SceneVersion ─► FrameRenderer ─► frames
//!               ▲    └ Touched: the files that it depends on
//!               └── Watch ◄── the system
//! ```
//! No window and no toolkit: what shows it is the caller's.

pub mod edit;
mod frame_renderer;
pub mod model;
pub mod plugin_files;
mod scene_source;
mod session;
mod session_thread;
mod viewport;
mod watch;

pub use frame_renderer::{FrameInfo, FrameRenderer, FrameReply, FrameRequest, StartRenderer};
pub use scene_source::SceneSource;
pub use session::{Problem, Scene, SceneVersion, Session, Work};
pub use session_thread::SessionThread;
pub use viewport::{ViewOverrides, ViewportCamera};
pub use watch::{Waker, Watch, WatchError, WatchEvent, WatchedPaths};
