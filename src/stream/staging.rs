//! A ring of mapped buffers: bytes are written straight into memory that the GPU copies from.
//!
//! A slot is written, unmapped, copied from by a submission, and mapped again when that is done; with several slots
//! the CPU can write while the GPU still copies.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use wgpu::WriteOnly;

use crate::gpu::{Gpu, GpuError};

/// How many slots there are.
pub const SLOTS: usize = 3;
/// The least size of a slot, in bytes.
pub const LEAST_SLOT_BYTES: u64 = 1 << 16;

/// The ring.
#[derive(Debug, Default)]
pub struct Staging {
    slots: [Option<Slot>; SLOTS],
    next: usize,
}

#[derive(Debug)]
struct Slot {
    buffer: wgpu::Buffer,
    /// Whether the buffer is mapped; cleared when it is handed to the GPU.
    mapped: Arc<AtomicBool>,
    /// Whether mapping it again was refused.
    failed: Arc<AtomicBool>,
}

impl Staging {
    /// Writes `bytes` bytes into the next slot and returns its buffer, ready to be copied from. After the submission,
    /// [`Staging::recycle`] must be called.
    ///
    /// # Errors
    /// The device is lost or out of memory.
    pub fn fill(
        &mut self,
        gpu: &Gpu,
        bytes: u64,
        write: impl FnOnce(WriteOnly<'_, [u8]>),
    ) -> Result<wgpu::Buffer, GpuError> {
        let slot = self.slot_of(gpu, bytes)?;
        while !slot.mapped.load(Ordering::Acquire) {
            gpu.wait()?;
            if slot.failed.load(Ordering::Acquire) {
                return Err(GpuError::Lost("a staging buffer could not be mapped".to_owned()));
            }
        }
        {
            let mut view = slot
                .buffer
                .get_mapped_range_mut(..bytes)
                .map_err(|error| GpuError::Invalid(error.to_string()))?;
            write(view.slice(..));
        }
        slot.buffer.unmap();
        slot.mapped.store(false, Ordering::Release);
        Ok(slot.buffer.clone())
    }

    fn slot_of(&mut self, gpu: &Gpu, bytes: u64) -> Result<&Slot, GpuError> {
        let slot = &mut self.slots[self.next];
        let fits = slot.as_ref().is_some_and(|slot| slot.buffer.size() >= bytes);
        if !fits {
            *slot = None;
        }
        let size = bytes.max(LEAST_SLOT_BYTES).checked_next_power_of_two().unwrap_or(bytes);
        let size = size.min(gpu.limits.max_buffer_size).max(bytes);
        if slot.is_none() {
            *slot = Some(new_slot(gpu, size)?);
        }
        slot.as_ref().ok_or_else(|| GpuError::Invalid("a staging slot is missing".to_owned()))
    }

    /// Asks for the slot that was filled last to be mapped again once the GPU is done with it, and moves on.
    pub fn recycle(&mut self) {
        if let Some(slot) = &self.slots[self.next] {
            let (mapped, failed) = (Arc::clone(&slot.mapped), Arc::clone(&slot.failed));
            slot.buffer.map_async(wgpu::MapMode::Write, .., move |result| {
                mapped.store(result.is_ok(), Ordering::Release);
                failed.store(result.is_err(), Ordering::Release);
            });
        }
        self.next = (self.next + 1) % SLOTS;
    }

    /// Bytes of all slots.
    pub fn size_bytes(&self) -> u64 {
        self.slots.iter().flatten().map(|slot| slot.buffer.size()).sum()
    }
}

fn new_slot(gpu: &Gpu, size: u64) -> Result<Slot, GpuError> {
    let limit_bytes = gpu.limits.max_buffer_size;
    if size > limit_bytes {
        return Err(GpuError::TooLarge { label: "staging".to_owned(), size_bytes: size, limit_bytes });
    }
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("staging"),
        size,
        usage: wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: true,
    });
    gpu.check()?;
    Ok(Slot { buffer, mapped: Arc::new(AtomicBool::new(true)), failed: Arc::default() })
}
