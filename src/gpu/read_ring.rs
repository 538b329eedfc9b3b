//! A buffer's content copied in one frame, on the host in that frame or in a later one: whoever asks never has to wait.
//!
//! The copies go to a ring of mapped buffers. [`ReadRing::copy`] records one, [`ReadRing::submitted`] asks for its mapping,
//! [`ReadRing::newest`] gives the newest that is there, and drops older ones.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Duration;

use super::{Gpu, GpuError};

/// Copies that may be under way.
const SLOTS: usize = 3;
/// How long another thread, which polled the device first, may take to hand over a mapping that is complete.
const HAND_OVER: Duration = Duration::from_secs(30);

type Mapping = Result<(), wgpu::BufferAsyncError>;

/// A copy under way, with what the caller wants to know of it when it is there.
#[derive(Debug)]
struct Copy<T> {
    about: T,
    size: u64,
    buffer: wgpu::Buffer,
    mapped: Receiver<Mapping>,
}

/// The ring.
#[derive(Debug)]
pub struct ReadRing<T> {
    under_way: VecDeque<Copy<T>>,
    free: Vec<wgpu::Buffer>,
    recorded: Option<(wgpu::Buffer, u64)>,
}

impl<T> Default for ReadRing<T> {
    fn default() -> Self {
        Self { under_way: VecDeque::new(), free: Vec::new(), recorded: None }
    }
}

impl<T> ReadRing<T> {
    /// Whether another copy may be recorded.
    pub fn has_room(&self) -> bool {
        self.under_way.len() < SLOTS
    }

    /// Whether nothing is under way.
    pub fn is_empty(&self) -> bool {
        self.under_way.is_empty()
    }

    /// Records the copy of the first `size` bytes of a buffer, a multiple of 4 above 0.
    ///
    /// # Errors
    /// The adapter allows no buffer of that size.
    pub fn copy(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        buffer: &wgpu::Buffer,
        size: u64,
    ) -> Result<(), GpuError> {
        self.free.retain(|free| free.size() >= size);
        let staging = match self.free.pop() {
            Some(free) => free,
            None => gpu.buffer(
                "read_ring",
                size.next_power_of_two().min(gpu.limits.max_buffer_size).max(size),
                wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            )?,
        };
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size);
        self.recorded = Some((staging, size));
        Ok(())
    }

    /// To be called after the submission of what [`ReadRing::copy`] recorded.
    pub fn submitted(&mut self, about: T) {
        let Some((buffer, size)) = self.recorded.take() else { return };
        let (sender, mapped) = channel();
        // A ring that is gone does not want to know.
        buffer.map_async(wgpu::MapMode::Read, 0..size, move |result| drop(sender.send(result)));
        self.under_way.push_back(Copy { about, size, buffer, mapped });
    }

    /// The newest copy that is there, which is the newest of all with `wait`; `None` if there is none.
    ///
    /// # Errors
    /// Whatever went wrong on the device.
    pub fn newest(&mut self, gpu: &Gpu, wait: bool) -> Result<Option<(T, Vec<u8>)>, GpuError> {
        if self.under_way.is_empty() {
            return Ok(None);
        }
        if wait {
            gpu.wait()?;
        } else {
            // That it times out is the usual case.
            let _ = gpu.device.poll(wgpu::PollType::Poll);
            gpu.check()?;
        }
        let mut newest = None;
        while let Some(first) = self.under_way.front() {
            if !is_there(&first.mapped, wait)? {
                break;
            }
            let Some(copy) = self.under_way.pop_front() else { break };
            newest = Some((copy.about, self.take(copy.buffer, copy.size)?));
        }
        Ok(newest)
    }

    fn take(&mut self, buffer: wgpu::Buffer, size: u64) -> Result<Vec<u8>, GpuError> {
        let view = buffer.get_mapped_range(0..size).map_err(|error| GpuError::Invalid(error.to_string()))?;
        let bytes = view.to_vec();
        drop(view);
        buffer.unmap();
        self.free.push(buffer);
        Ok(bytes)
    }

    /// Bytes of its buffers.
    pub fn size_bytes(&self) -> u64 {
        let under_way = self.under_way.iter().map(|copy| copy.buffer.size()).sum::<u64>();
        under_way + self.free.iter().map(wgpu::Buffer::size).sum::<u64>()
    }
}

fn is_there(mapped: &Receiver<Mapping>, wait: bool) -> Result<bool, GpuError> {
    let answer = if wait {
        mapped.recv_timeout(HAND_OVER).map_err(|error| GpuError::Lost(error.to_string()))?
    } else {
        match mapped.try_recv() {
            Ok(answer) => answer,
            Err(TryRecvError::Empty) => return Ok(false),
            Err(error @ TryRecvError::Disconnected) => return Err(GpuError::Lost(error.to_string())),
        }
    };
    answer.map(|()| true).map_err(|error| GpuError::Invalid(error.to_string()))
}
