//! Hot reload: builds a scene from a script or a model and, when a file that it depends on changes, builds it again on a worker
//! thread and swaps it whole. A faulty version leaves the last good one in place and reports its errors.
//!
//! ```text
//! SceneSource ─► Session::build ─► SceneVersion ─► FrameRenderer ─► frames
//!               ▲    └ Touched: the files that it depends on
//!               └── Watch ◄── the system
//! ```
//! It knows no window and no toolkit.

pub mod edit;
mod frame_renderer;
pub mod model;
pub mod package;
pub mod plugin_files;
mod remembered_manifests;
mod scene_source;
mod session;
mod session_thread;
mod viewport;
mod watch;

pub use frame_renderer::{FrameError, FrameInfo, FrameRenderer, FrameReply, FrameRequest, StartRenderer};
pub use scene_source::SceneSource;
pub use session::{Problem, Scene, SceneVersion, Session, Work};
pub use session_thread::SessionThread;
pub use viewport::{Placed, ViewOverrides, ViewportCamera};
pub use watch::{Waker, Watch, WatchError, WatchEvent, WatchedPaths};
