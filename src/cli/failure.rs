//! What a verb failed with, and the exit code that tells it.

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use collapsar::bake::BakeError;
use collapsar::compare::CompareError;
use collapsar::frame::FrameError;
use collapsar::scene::SceneError;
use collapsar::stream::ResidencyError;

/// Why a verb did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The library's reason.
    #[error(transparent)]
    Library(#[from] collapsar::Error),
    /// Something could not be written.
    #[error("cannot {doing}: {cause}: {}", path.display())]
    Output {
        /// What was being done.
        doing: &'static str,
        /// The system's words.
        cause: std::io::Error,
        /// Where.
        path: PathBuf,
    },
    /// An argument makes no sense with this file.
    #[error("{0}")]
    Argument(String),
    /// Two flights that must be identical are not.
    #[error("{0}")]
    Mismatch(String),
    /// The user asked to stop.
    #[error("interrupted; {0}")]
    Interrupted(&'static str),
}

impl Failure {
    /// Adds the path of a container to what a frame found wrong with its bytes.
    pub fn in_container(self, path: &Path) -> Self {
        match self {
            Self::Library(collapsar::Error::Frame(FrameError::Residency(ResidencyError::Container(
                cause,
            )))) => SceneError::Container { cause, path: path.to_owned() }.into(),
            other => other,
        }
    }

    /// Prints the reason and gives the exit code: 130 for an interruption, else 1.
    pub fn report(&self) -> ExitCode {
        let interrupted = matches!(
            self,
            Self::Interrupted(_)
                | Self::Library(
                    collapsar::Error::Bake(BakeError::Interrupted | BakeError::Stopped { cause: None, .. })
                        | collapsar::Error::Compare(CompareError::Interrupted)
                )
        );
        super::output::complain(&Line(self));
        ExitCode::from(if interrupted { 130 } else { 1 })
    }
}

struct Line<'a>(&'a Failure);

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error: {}", self.0)
    }
}

macro_rules! from_library {
    ($($error:ty),* $(,)?) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::Library(error.into())
            }
        })*
    };
}

from_library!(
    collapsar::bake::BakeError,
    collapsar::compare::CompareError,
    collapsar::import::ImportError,
    collapsar::container::ContainerError,
    collapsar::scene::SceneError,
    collapsar::gpu::GpuError,
    collapsar::frame::FrameError,
    collapsar::scene::camera_path::CameraPathError,
    collapsar::gpu::target::TargetError,
    collapsar::report::ReportError,
);
