//! What is around the picture, a file each: each panel shows a state and says what the user did to it.

pub mod bookmarks;
pub mod cuts;
pub mod gizmo;
pub mod look;
pub mod measure;
pub mod palette;
pub mod paths;
pub mod picture;
pub mod properties;
pub mod start;
pub mod streaming;
pub mod tree;

/// Shows tenths of a slider's value; with a fixed number of decimals the slider would round the value itself, untouched.
fn tenths(value: f64, _decimals: std::ops::RangeInclusive<usize>) -> String {
    format!("{value:.1}")
}
