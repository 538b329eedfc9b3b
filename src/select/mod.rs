//! A view in, the state of every instance out.
//!
//! [`cull`] finds the instances that a view does not cull, by groups; [`wish`] turns them into the wishes of all instances
//! (`passes::select` on the GPU or [`spend`](mod@spend) on the CPU, both the same as `reference::select`); [`states`] rounds them to states that exist and have arrived, spends what that leaves over, and picks tiers.

pub mod cull;
mod on_gpu;
pub mod spend;
mod stand_in;
pub mod states;
pub mod wish;

pub use on_gpu::{Found, GpuSelect};
pub use states::StateChooser;
pub use wish::{SelectOn, WishChange, Wishes, select_row, select_rows};
