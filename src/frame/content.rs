//! What is on the GPU, read back: digests that say whether two flights drew the same, to the bit.

use xxhash_rust::xxh3::Xxh3;

use super::{FrameError, Renderer};
use crate::gpu::readback;

/// Digests of everything that is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ContentDigest {
    /// Of the index buffers of all batches.
    pub indices: u64,
    /// Of the active vertices of all batches, with their instance numbers.
    pub vertices: u64,
}

impl Renderer {
    /// Reads back index and vertex buffers of all batches and digests them. Costs a transfer of all that is drawn.
    ///
    /// # Errors
    /// Whatever went wrong on the device.
    pub fn content_digest(&self) -> Result<ContentDigest, FrameError> {
        let (mut indices, mut vertices) = (Xxh3::new(), Xxh3::new());
        for batch in &self.batches {
            let [vertex_total, _, triangle_total] = batch.totals.map(u64::from);
            for (digest, buffer, bytes) in [
                (&mut indices, &batch.indices, 12 * triangle_total),
                (&mut vertices, &batch.existing()[0], 16 * vertex_total),
            ] {
                digest.update(&bytes.to_le_bytes());
                if bytes > 0 {
                    digest.update(&readback::read(&self.gpu, buffer, 0..bytes)?);
                }
            }
        }
        Ok(ContentDigest { indices: indices.digest(), vertices: vertices.digest() })
    }
}
