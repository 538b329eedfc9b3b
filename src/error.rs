//! Any error of the library as one type, for callers that only report it.

/// What went wrong, in any room of the library.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Reading input files.
    #[error(transparent)]
    Import(#[from] crate::import::ImportError),
    /// Baking.
    #[error(transparent)]
    Bake(#[from] crate::bake::BakeError),
    /// Comparing.
    #[error(transparent)]
    Compare(#[from] crate::compare::CompareError),
    /// The container's bytes.
    #[error(transparent)]
    Container(#[from] crate::container::ContainerError),
    /// Opening a container.
    #[error(transparent)]
    Scene(#[from] crate::scene::SceneError),
    /// The GPU.
    #[error(transparent)]
    Gpu(#[from] crate::gpu::GpuError),
    /// Drawing.
    #[error(transparent)]
    Frame(#[from] crate::frame::FrameError),
    /// The camera path.
    #[error(transparent)]
    CameraPath(#[from] crate::scene::camera_path::CameraPathError),
    /// Pictures.
    #[error(transparent)]
    Target(#[from] crate::gpu::target::TargetError),
    /// The page of flights.
    #[error(transparent)]
    Report(#[from] crate::report::ReportError),
}
