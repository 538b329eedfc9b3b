//! A range of a buffer in, its bytes on the host out.

use std::ops::Range;
use std::sync::mpsc;
use std::time::Duration;

use super::{Gpu, GpuError};

/// How long another thread, which polled the device first, may take to hand over a mapping that is complete.
const HAND_OVER: Duration = Duration::from_secs(30);

/// Waits for all that was submitted, and reads `range` (bytes) of a buffer with the usage `COPY_SRC`.
///
/// # Errors
/// [`GpuError::Invalid`] if the range is not inside the buffer or not of whole words; otherwise whatever went wrong
/// on the device before.
pub fn read(gpu: &Gpu, buffer: &wgpu::Buffer, range: Range<u64>) -> Result<Vec<u8>, GpuError> {
    check_range(buffer, &range)?;
    if range.is_empty() {
        return gpu.check().map(|()| Vec::new());
    }
    let size = range.end - range.start;
    let staging =
        gpu.buffer("readback", size, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)?;
    let mut encoder = gpu.encoder("readback");
    encoder.copy_buffer_to_buffer(buffer, range.start, &staging, 0, size);
    gpu.submit(encoder)?;
    read_mapped(gpu, &staging, size)
}

/// As [`read`], the whole buffer's first `count` values of type `T`.
///
/// # Errors
/// As [`read`].
pub fn read_values<T: bytemuck::Pod>(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    count: usize,
) -> Result<Vec<T>, GpuError> {
    let bytes = read(gpu, buffer, 0..(count * size_of::<T>()) as u64)?;
    Ok(bytemuck::pod_collect_to_vec(&bytes))
}

/// Maps a buffer with the usage `MAP_READ`, waits, and copies its first `size` bytes.
pub(super) fn read_mapped(gpu: &Gpu, staging: &wgpu::Buffer, size: u64) -> Result<Vec<u8>, GpuError> {
    let (sender, receiver) = mpsc::channel();
    // The receiver outlives the wait below, and if not, nobody wants to know.
    staging.map_async(wgpu::MapMode::Read, 0..size, move |result| drop(sender.send(result)));
    gpu.wait()?;
    // The mapping is complete, but whichever thread polled first calls back, and that may be a moment later.
    let mapped = receiver.recv_timeout(HAND_OVER).map_err(|error| GpuError::Lost(error.to_string()))?;
    mapped.map_err(|error| GpuError::Invalid(error.to_string()))?;
    let view = staging.get_mapped_range(0..size).map_err(|error| GpuError::Invalid(error.to_string()))?;
    let bytes = view.to_vec();
    drop(view);
    staging.unmap();
    Ok(bytes)
}

fn check_range(buffer: &wgpu::Buffer, range: &Range<u64>) -> Result<(), GpuError> {
    let whole_words = range.start.is_multiple_of(4) && range.end.is_multiple_of(4);
    if whole_words && range.start <= range.end && range.end <= buffer.size() {
        return Ok(());
    }
    Err(GpuError::Invalid(format!("readback of bytes {range:?} from a buffer of {} bytes", buffer.size())))
}
