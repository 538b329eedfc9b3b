//! The viewer: hands and eyes for the renderer. A model's path in, a window out.
//!
//! Two threads share the work, so that the window never waits for a frame: the *painter* owns the renderer and draws the
//! newest wish into textures; the window's thread lays out panels, turns what the mouse and the keys do into wishes, and
//! shows the newest texture.

pub mod bookmarks;
pub mod measure;
pub mod mouse;
pub mod navigation;
pub mod panels;
