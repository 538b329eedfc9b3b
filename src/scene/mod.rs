//! The model opened, and from where it is looked at.
//!
//! [`mapped`] is a file in the address space (the one room with `unsafe`), [`file`](mod@file) one that is read by ranges;
//! [`opened`] its tables as a [`Scene`];
//! [`part`] what has arrived of one part; [`names`] what the user calls things; [`bounds`], [`camera`], [`views`] and
//! [`camera_path`] say where everything is and how one flies through it.

pub mod bounds;
pub mod camera;
pub mod camera_path;
pub mod file;
pub mod mapped;
pub mod names;
pub mod opened;
pub mod part;
pub mod turntable;
pub mod views;

pub use bounds::Bounds;
pub use camera::Camera;
pub use camera_path::CameraPath;
pub use opened::{InstanceBox, Scene, SceneCounts, SceneError};
