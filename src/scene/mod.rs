//! The file opened: [`mapped`] holds the one piece of `unsafe` code of the project.

pub mod mapped;
