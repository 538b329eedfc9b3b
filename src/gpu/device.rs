//! An adapter is chosen, a device comes out, and whatever goes wrong on it later becomes a [`GpuError`].
//!
//! wgpu reports most errors after the call that caused them. They are collected here, and [`Gpu::check`], which every
//! submission and readback ends with, hands out the first one.

use std::sync::Arc;

use parking_lot::Mutex;

/// The environment variable with a part of the wanted adapter's name.
pub const ADAPTER_VARIABLE: &str = "COLLAPSAR_ADAPTER";

/// What went wrong on the graphics card.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// There is no adapter at all.
    #[error(
        "no graphics adapter: install a Vulkan driver (software will do: Debian package mesa-vulkan-drivers), \
         or check that VK_DRIVER_FILES names one that exists ({0})"
    )]
    NoAdapter(String),
    /// No adapter has the wanted name.
    #[error(
        "no graphics adapter is called like `{wanted}`: set {ADAPTER_VARIABLE} to a part of one of: {found}"
    )]
    NoSuchAdapter {
        /// What was asked for.
        wanted: String,
        /// The names that there are, separated by commas.
        found: String,
    },
    /// The adapter lacks what the passes need.
    #[error(
        "the graphics adapter `{adapter}` cannot be used: {reason}; choose another with {ADAPTER_VARIABLE}"
    )]
    Unsuitable {
        /// Its name.
        adapter: String,
        /// What it lacks.
        reason: String,
    },
    /// A buffer would be larger than the adapter allows.
    #[error(
        "buffer `{label}` of {size_bytes} bytes is above the adapter's limit of {limit_bytes} bytes: lower the budget"
    )]
    TooLarge {
        /// The buffer.
        label: String,
        /// Its size.
        size_bytes: u64,
        /// What is allowed.
        limit_bytes: u64,
    },
    /// The card has no memory left.
    #[error("out of GPU memory: lower the budget")]
    OutOfMemory,
    /// The device is gone.
    #[error(
        "the graphics device was lost: {0}; start again, with a lower budget if it was reset for taking too long"
    )]
    Lost(String),
    /// A window cannot show what the card draws.
    #[error("the window can have no picture: {0}; check the display and the graphics driver")]
    Surface(String),
    /// A call was wrong: a bug in this program.
    #[error("a graphics call failed, which is a bug of this program: {0}")]
    Invalid(String),
}

impl From<wgpu::Error> for GpuError {
    fn from(error: wgpu::Error) -> Self {
        match error {
            wgpu::Error::OutOfMemory { .. } => Self::OutOfMemory,
            wgpu::Error::Validation { .. } | wgpu::Error::Internal { .. } => Self::Invalid(error.to_string()),
        }
    }
}

/// Which adapter is wanted.
#[derive(Debug, Clone, Default)]
pub struct GpuOptions {
    /// A part of its name, in any case of letters. `None`: what `COLLAPSAR_ADAPTER` says, else the fastest there is.
    pub adapter: Option<String>,
    /// What is not asked of an adapter, though it may have it: clip distances, or a stencil beside depth of 32 bits.
    pub without: wgpu::Features,
}

/// A device and its queue. Cheap to share by reference; every call on it may come from any thread.
#[derive(Debug)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Where they come from: what makes surfaces.
    pub instance: wgpu::Instance,
    /// What surfaces are configured for.
    pub adapter: wgpu::Adapter,
    /// The adapter's name, driver and kind.
    pub adapter_info: wgpu::AdapterInfo,
    /// What buffers and dispatches may be.
    pub limits: wgpu::Limits,
    /// Whether [`super::timer::Timer`] can measure.
    pub timestamps: bool,
    faults: Arc<Mutex<Faults>>,
    /// Held while something is submitted.
    submitting: Mutex<()>,
}

/// What has gone wrong and was not handed out yet; a lost device stays lost.
#[derive(Debug, Default)]
struct Faults {
    first: Option<GpuError>,
    lost: Option<GpuError>,
}

/// Whether the adapter's timestamps say how long its work takes. A software adapter writes them when it takes up a
/// pass, not when its threads have done it: 840,000 triangles reformed in 8 microseconds.
fn can_time(adapter: &wgpu::Adapter, info: &wgpu::AdapterInfo) -> bool {
    adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY) && info.device_type != wgpu::DeviceType::Cpu
}

impl Gpu {
    /// Opens an adapter without a window.
    ///
    /// The device gets the adapter's own limits for buffers and bindings, WebGPU's defaults for the rest, and timestamp
    /// queries where the adapter has them.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`], [`GpuError::NoSuchAdapter`] or [`GpuError::Unsuitable`].
    pub fn new(options: &GpuOptions) -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        pollster::block_on(Self::open(instance, options, None))
    }

    /// Opens an adapter that can show pictures in a window of a display; gives its surface, which is not configured yet.
    ///
    /// # Errors
    /// As [`Gpu::new`], or the window can have no surface.
    pub fn for_window(
        options: &GpuOptions,
        display: Box<dyn wgpu::wgt::WgpuHasDisplayHandle>,
        window: impl Into<wgpu::SurfaceTarget<'static>>,
    ) -> Result<(Self, wgpu::Surface<'static>), GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle(display));
        let surface =
            instance.create_surface(window).map_err(|error| GpuError::Surface(error.to_string()))?;
        let gpu = pollster::block_on(Self::open(instance, options, Some(&surface)))?;
        Ok((gpu, surface))
    }

    async fn open(
        instance: wgpu::Instance,
        options: &GpuOptions,
        shows: Option<&wgpu::Surface<'static>>,
    ) -> Result<Self, GpuError> {
        let adapter = choose_adapter(&instance, options, shows).await?;
        let adapter_info = adapter.get_info();
        let timestamps = can_time(&adapter, &adapter_info);
        let (device, queue) = adapter
            .request_device(&describe_device(&adapter, timestamps, options.without))
            .await
            .map_err(|error| GpuError::Unsuitable {
                adapter: adapter_info.name.clone(),
                reason: error.to_string(),
            })?;
        let faults = collect_faults(&device);
        let limits = device.limits();
        tracing::debug!(adapter = adapter_info.name, driver = adapter_info.driver_info, timestamps, "opened");
        Ok(Self {
            device,
            queue,
            instance,
            adapter,
            adapter_info,
            limits,
            timestamps,
            faults,
            submitting: Mutex::default(),
        })
    }

    /// The most bytes that one storage buffer may have and still be bound as a whole.
    pub fn storage_limit_bytes(&self) -> u64 {
        self.limits.max_storage_buffer_binding_size.min(self.limits.max_buffer_size)
    }

    /// Creates a buffer of at least `size_bytes`: rounded up to whole words, and never empty, so that it can be bound.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if the adapter allows no such buffer. That the memory is not there shows at the next
    /// [`Gpu::check`].
    pub fn buffer(
        &self,
        label: &str,
        size_bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, GpuError> {
        let storage = usage.contains(wgpu::BufferUsages::STORAGE);
        let limit_bytes = if storage { self.storage_limit_bytes() } else { self.limits.max_buffer_size };
        let size = size_bytes.max(16).next_multiple_of(4);
        if size > limit_bytes {
            return Err(GpuError::TooLarge { label: label.to_owned(), size_bytes, limit_bytes });
        }
        Ok(self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        }))
    }

    /// Creates a storage buffer that can be copied from and to.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn storage(&self, label: &str, size_bytes: u64) -> Result<wgpu::Buffer, GpuError> {
        use wgpu::BufferUsages as Usage;
        self.buffer(label, size_bytes, Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST)
    }

    /// A uniform buffer with this content. That it could not be made shows at the next [`Gpu::check`].
    pub fn uniform<T: bytemuck::Pod>(&self, label: &str, value: &T) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: (size_of::<T>() as u64).next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT),
            usage: wgpu::BufferUsages::UNIFORM,
            mapped_at_creation: true,
        });
        // No range: there was no memory, or the device is lost, and that has been reported.
        if let Ok(mut view) = buffer.get_mapped_range_mut(0..size_of::<T>() as u64) {
            view.copy_from_slice(bytemuck::bytes_of(value));
        }
        buffer.unmap();
        buffer
    }

    /// An encoder for commands.
    pub fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) })
    }

    /// Submits what was recorded and does not wait.
    ///
    /// # Errors
    /// The first error since the last check.
    pub fn submit(&self, encoder: wgpu::CommandEncoder) -> Result<wgpu::SubmissionIndex, GpuError> {
        let commands = encoder.finish();
        let index = {
            let _submitting = self.submitting.lock();
            self.queue.submit([commands])
        };
        self.check()?;
        Ok(index)
    }

    /// Does something while no other thread submits: to configure a surface fails otherwise.
    pub fn while_nothing_is_submitted<T>(&self, act: impl FnOnce() -> T) -> T {
        let _submitting = self.submitting.lock();
        act()
    }

    /// Waits until all that was submitted is done.
    ///
    /// # Errors
    /// The first error since the last check.
    pub fn wait(&self) -> Result<(), GpuError> {
        let polled = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        polled.map(drop).map_err(|error| GpuError::Lost(error.to_string()))
    }

    /// Makes it as if the device had been lost, for tests and for who wants to see what happens.
    pub fn lose(&self, why: &str) {
        self.faults.lock().lost = Some(GpuError::Lost(why.to_owned()));
    }

    /// Makes it as if memory had run out once.
    pub fn exhaust(&self) {
        self.faults.lock().first = Some(GpuError::OutOfMemory);
    }

    /// Hands out the first error since the last check, or that the device is lost.
    ///
    /// # Errors
    /// That error.
    pub fn check(&self) -> Result<(), GpuError> {
        let mut faults = self.faults.lock();
        let first = faults.first.take();
        faults.lost.clone().or(first).map_or(Ok(()), Err)
    }
}

/// The adapter that was asked for, or the fastest one.
async fn choose_adapter(
    instance: &wgpu::Instance,
    options: &GpuOptions,
    shows: Option<&wgpu::Surface<'static>>,
) -> Result<wgpu::Adapter, GpuError> {
    let wanted = options.adapter.clone().or_else(|| std::env::var(ADAPTER_VARIABLE).ok());
    if let Some(wanted) = wanted.filter(|name| !name.is_empty()) {
        return adapter_called(instance, wanted).await;
    }
    let request = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        compatible_surface: shows,
        ..Default::default()
    };
    instance.request_adapter(&request).await.map_err(|error| GpuError::NoAdapter(error.to_string()))
}

/// The first adapter with `wanted` in its name.
async fn adapter_called(instance: &wgpu::Instance, wanted: String) -> Result<wgpu::Adapter, GpuError> {
    let adapters = instance.enumerate_adapters(wgpu::Backends::all()).await;
    if adapters.is_empty() {
        return Err(GpuError::NoAdapter(format!("while looking for `{wanted}`")));
    }
    let name = |adapter: &wgpu::Adapter| adapter.get_info().name;
    let found = adapters.iter().map(name).collect::<Vec<_>>().join(", ");
    let fits = |adapter: &wgpu::Adapter| name(adapter).to_lowercase().contains(&wanted.to_lowercase());
    adapters.into_iter().find(fits).ok_or(GpuError::NoSuchAdapter { wanted, found })
}

fn describe_device(
    adapter: &wgpu::Adapter,
    timestamps: bool,
    without: wgpu::Features,
) -> wgpu::DeviceDescriptor<'static> {
    let own = adapter.limits();
    let timing = if timestamps { wgpu::Features::TIMESTAMP_QUERY } else { wgpu::Features::empty() };
    let wanted = wgpu::Features::CLIP_DISTANCES | wgpu::Features::DEPTH32FLOAT_STENCIL8;
    let wanted = (wanted - without) & adapter.features();
    wgpu::DeviceDescriptor {
        label: Some("collapsar"),
        required_features: timing | wanted,
        required_limits: wgpu::Limits {
            max_buffer_size: own.max_buffer_size,
            max_storage_buffer_binding_size: own.max_storage_buffer_binding_size,
            max_storage_buffers_per_shader_stage: own.max_storage_buffers_per_shader_stage,
            max_texture_dimension_2d: own.max_texture_dimension_2d,
            ..wgpu::Limits::default()
        },
        ..Default::default()
    }
}

/// Has the device keep its first error, and its loss, instead of panicking.
fn collect_faults(device: &wgpu::Device) -> Arc<Mutex<Faults>> {
    let faults = Arc::new(Mutex::new(Faults::default()));
    let kept = Arc::clone(&faults);
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        tracing::error!(%error, "graphics error");
        kept.lock().first.get_or_insert_with(|| error.into());
    }));
    let kept = Arc::clone(&faults);
    device.set_device_lost_callback(move |reason, message| {
        if reason != wgpu::DeviceLostReason::Destroyed {
            kept.lock().lost = Some(GpuError::Lost(message));
        }
    });
    faults
}
