//! What a flight counts, and how it is told: one record per frame in, CSV, a summary and the table of the paper out.

pub mod adapter;
pub mod counters;
pub mod floor;
pub mod machine;
pub mod memory;
pub mod report;

pub use counters::FrameRecord;
pub use report::Summary;
