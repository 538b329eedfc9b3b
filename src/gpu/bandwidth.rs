//! A device in; how many bytes a second its memory moves, and how many reach it from the host, out.
//!
//! Each rate is that of a submission of many copies of one large buffer, as many as take `LEAST_SECONDS`, by the
//! clock of the CPU around a wait: what it costs to submit and to wait is then a thousandth of it, and no timestamps are
//! needed, which not every adapter has between copies. The buffers have content: memory that was never written may
//! not exist yet. Best and median are of `RUNS` submissions.

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;
use wgpu::WriteOnly;

use super::{Gpu, GpuError};

/// The buffers, if the adapter allows them; above what caches hold.
const WANTED_BYTES: u64 = 256 << 20;
/// Less than this would measure caches and calls.
const LEAST_BYTES: u64 = 1 << 20;
/// What one measured submission takes at least.
const LEAST_SECONDS: f64 = 0.05;
/// No submission has more copies.
const MOST_COPIES: u32 = 4096;
/// Measured submissions of a kind, after the one that found out how many copies they need.
const RUNS: usize = 7;
/// What one thread writes at a time.
const BLOCK: usize = 1 << 16;

/// What was measured, in bytes per second.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Bandwidth {
    /// Bytes of each buffer.
    pub buffer_bytes: u64,
    /// Measured submissions of each kind.
    pub runs: u64,
    /// From one buffer of the GPU to another; bytes read and bytes written are both counted.
    pub copy_best: f64,
    /// The same, the median.
    pub copy_median: f64,
    /// From a mapped buffer to one of the GPU; each byte is counted once.
    pub upload_best: f64,
    /// The same, the median.
    pub upload_median: f64,
    /// Written into a mapped buffer by all threads; each byte is counted once.
    pub write_best: f64,
    /// The same, the median.
    pub write_median: f64,
}

/// Measures for about two seconds on a graphics card, and up to half a minute on a slow one.
///
/// # Errors
/// There is no room for three buffers of 1 MiB, or whatever else went wrong on the device.
pub fn measure(gpu: &Gpu) -> Result<Bandwidth, GpuError> {
    let Buffers { mapped, from, to } = Buffers::new(gpu)?;
    let bytes = mapped.size();
    let [write_best, write_median] = written(&mapped, bytes)?;
    mapped.unmap();
    let [upload_best, upload_median] = copied(gpu, &mapped, &from)?;
    // The source has content now. What is read and what is written counts.
    let [copy_best, copy_median] = copied(gpu, &from, &to)?.map(|rate| 2.0 * rate);
    Ok(Bandwidth {
        buffer_bytes: bytes,
        runs: RUNS as u64,
        copy_best,
        copy_median,
        upload_best,
        upload_median,
        write_best,
        write_median,
    })
}

struct Buffers {
    /// Mapped for writing.
    mapped: wgpu::Buffer,
    from: wgpu::Buffer,
    to: wgpu::Buffer,
}

impl Buffers {
    /// As large as wanted and possible.
    fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let mut bytes = WANTED_BYTES.min(gpu.limits.max_buffer_size);
        loop {
            match Self::of(gpu, bytes) {
                Err(GpuError::OutOfMemory) if bytes > LEAST_BYTES => bytes /= 2,
                made => return made,
            }
        }
    }

    fn of(gpu: &Gpu, size: u64) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let mapped = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("bandwidth staging"),
            size,
            usage: Usage::MAP_WRITE | Usage::COPY_SRC,
            mapped_at_creation: true,
        });
        gpu.check()?;
        let usage = Usage::COPY_SRC | Usage::COPY_DST;
        let made = Self {
            mapped,
            from: gpu.buffer("bandwidth source", size, usage)?,
            to: gpu.buffer("bandwidth target", size, usage)?,
        };
        gpu.check()?;
        Ok(made)
    }
}

/// Fills a mapped buffer on all threads, several times.
fn written(mapped: &wgpu::Buffer, bytes: u64) -> Result<[f64; 2], GpuError> {
    let content: Vec<u8> = (0..BLOCK).map(|i| (i * 31 + i / 256) as u8).collect();
    let mut rates = Vec::new();
    for run in 0..=RUNS {
        let mut view =
            mapped.get_mapped_range_mut(..).map_err(|error| GpuError::Invalid(error.to_string()))?;
        let started = Instant::now();
        let (blocks, mut rest) = view.slice(..).into_chunks::<BLOCK>();
        let blocks: Vec<_> = blocks.into_iter().collect();
        blocks.into_par_iter().for_each(|block| WriteOnly::from(block).copy_from_slice(&content));
        let length = rest.len();
        rest.copy_from_slice(&content[..length]);
        // The first run is where the pages come from.
        if run > 0 {
            rates.push(bytes as f64 / started.elapsed().as_secs_f64());
        }
    }
    Ok(best_and_median(rates))
}

/// Copies one buffer into another of the same size, as often as it takes, several times: bytes per second.
fn copied(gpu: &Gpu, from: &wgpu::Buffer, to: &wgpu::Buffer) -> Result<[f64; 2], GpuError> {
    let seconds = |copies: u32| -> Result<f64, GpuError> {
        let mut encoder = gpu.encoder("bandwidth");
        for _ in 0..copies {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
        }
        let started = Instant::now();
        gpu.submit(encoder)?;
        gpu.wait()?;
        Ok(started.elapsed().as_secs_f64())
    };
    // The first fills the target's pages.
    seconds(1)?;
    let mut copies = 1;
    while seconds(copies)? < LEAST_SECONDS && copies < MOST_COPIES {
        copies *= 2;
    }
    let bytes = from.size() as f64 * f64::from(copies);
    let rates = (0..RUNS).map(|_| Ok(bytes / seconds(copies)?)).collect::<Result<_, GpuError>>()?;
    Ok(best_and_median(rates))
}

fn best_and_median(mut rates: Vec<f64>) -> [f64; 2] {
    rates.sort_by(f64::total_cmp);
    [rates.last().copied().unwrap_or(0.0), rates.get(rates.len() / 2).copied().unwrap_or(0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_is_the_fastest() {
        assert_eq!(best_and_median(vec![3.0, 1.0, 2.0]), [3.0, 2.0]);
        assert_eq!(best_and_median(Vec::new()), [0.0, 0.0]);
    }
}
