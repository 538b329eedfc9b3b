//! The viewer: hands and eyes for the renderer. A model's path in, a window out.
//!
//! Two threads share the work, so that the window never waits for a frame: the [`painter`] owns the renderer and draws the
//! newest wish into textures; the window's thread lays out [`panels`], turns what the mouse and the keys do into wishes, and
//! shows the newest texture. A third, the [`loader`], bakes and opens.

pub mod actions;
pub mod app;
pub mod assembly;
pub mod bits;
pub mod bookmarks;
mod changes;
pub mod cuts;
pub mod document;
pub mod history;
pub mod layout;
pub mod loader;
pub mod measure;
pub mod messages;
pub mod mouse;
pub mod navigation;
pub mod pace;
pub mod painter;
pub mod panels;
pub mod reading;
pub mod screen;
pub mod search;
pub mod settings;
pub mod tree;
pub mod visibility;
pub mod window;

pub use window::{Mishaps, WindowError, WindowOptions, WindowSummary, run};
