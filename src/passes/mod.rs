//! The GPU passes, one word each: the shader, the adapter here, the reference, the label, the timer and the test.

pub mod draw;
