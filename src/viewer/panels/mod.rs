//! What is around the picture, a file each: each panel shows a state and says what the user did to it.

pub mod bookmarks;
pub mod gizmo;
pub mod measure;
