//! The file opened: [`mapped`] holds the one piece of `unsafe` code of the project.

pub mod mapped;
//! What is looked at, and from where: the bounds, the camera, and the paths along which it flies.

pub mod bounds;
pub mod camera;
pub mod camera_path;

pub use bounds::Bounds;
pub use camera::Camera;
pub use camera_path::CameraPath;
