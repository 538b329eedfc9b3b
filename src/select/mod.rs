//! A view in, the state of every instance out.
//!
//! [`wish`] turns a view into the wishes of all instances (`passes::select` on the GPU or `reference::select` on the
//! CPU); [`states`] rounds them to states that exist and have arrived, spends what that leaves over, and picks tiers.

mod stand_in;
pub mod states;
pub mod wish;

pub use states::StateChooser;
pub use wish::{SelectOn, Wishes, select_rows};
