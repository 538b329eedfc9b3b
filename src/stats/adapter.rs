//! A device and its measured rates in, what `collapsar bandwidth` says of the machine out.

use serde::Serialize;

use super::machine::Machine;
use crate::gpu::Gpu;
use crate::gpu::bandwidth::Bandwidth;

/// The graphics adapter with its limits and rates, and the machine around it.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct AdapterReport {
    /// The version of this program.
    pub version: String,
    /// The adapter's name.
    pub adapter: String,
    /// Its driver.
    pub driver: String,
    /// The graphics API.
    pub backend: String,
    /// `DiscreteGpu`, `IntegratedGpu`, `VirtualGpu`, `Cpu` or `Other`.
    pub kind: String,
    /// Whether it draws on the processor: its times are then no times of a graphics card.
    pub is_software: bool,
    /// Whether passes are timed on the GPU.
    pub gpu_timestamps: bool,
    /// Bytes of the largest buffer.
    pub largest_buffer_bytes: u64,
    /// Bytes of the largest buffer that a pass can use.
    pub largest_binding_bytes: u64,
    /// What its memory moves.
    pub bytes_per_second: Bandwidth,
    /// The processor's name, where the system tells.
    pub cpu: Option<String>,
    /// How many threads may run at once.
    pub cores: Option<u64>,
    /// Main memory in bytes.
    pub memory_bytes: Option<u64>,
}

impl AdapterReport {
    /// Puts together what is known of a device and this machine.
    pub fn new(gpu: &Gpu, bytes_per_second: Bandwidth) -> Self {
        let info = &gpu.adapter_info;
        let Machine { cpu, cores, memory_bytes } = Machine::this();
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            adapter: info.name.clone(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            backend: info.backend.to_string(),
            kind: format!("{:?}", info.device_type),
            is_software: info.device_type == wgpu::DeviceType::Cpu,
            gpu_timestamps: gpu.timestamps,
            largest_buffer_bytes: gpu.limits.max_buffer_size,
            largest_binding_bytes: gpu.storage_limit_bytes(),
            bytes_per_second,
            cpu,
            cores,
            memory_bytes,
        }
    }
}
