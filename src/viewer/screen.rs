//! A window in; its surface, and what egui lays out on it, out. Whatever is lost of it is made again.

use std::path::Path;
use std::sync::Arc;

use egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor};

use crate::gpu::target::{Target, read_texture, write_png};
use crate::gpu::{Gpu, GpuError, GpuOptions};

/// What is shown in a window: the interface's triangles, and the changes of its textures.
pub struct Layout {
    /// From egui.
    pub triangles: Vec<egui::ClippedPrimitive>,
    /// From egui.
    pub textures: egui::TexturesDelta,
    /// Pixels that a unit of the interface covers.
    pub pixels_per_point: f32,
}

/// The surface of a window and what draws on it.
pub struct Screen {
    gpu: Arc<Gpu>,
    window: Arc<winit::window::Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    /// Whether the surface has that configuration; it shows nothing before.
    is_configured: bool,
    renderer: Renderer,
    /// The picture that was last shown, and what egui calls it.
    picture: Option<(Arc<Target>, egui::TextureId)>,
    /// How often a surface was made again.
    pub surfaces_lost: u64,
}

impl Screen {
    /// Opens the graphics card for a window.
    ///
    /// # Errors
    /// There is no card, or it cannot show anything in this window.
    pub fn new(
        display: winit::event_loop::OwnedDisplayHandle,
        window: Arc<winit::window::Window>,
    ) -> Result<Self, GpuError> {
        let (gpu, surface) = Gpu::for_window(&GpuOptions::default(), Box::new(display), Arc::clone(&window))?;
        let config = configuration(&gpu, &surface, window.inner_size())?;
        let renderer = Renderer::new(&gpu.device, config.format, RendererOptions::default());
        gpu.check()?;
        Ok(Self {
            gpu: Arc::new(gpu),
            window,
            surface,
            config,
            is_configured: false,
            renderer,
            picture: None,
            surfaces_lost: 0,
        })
    }

    /// The graphics card.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// The window has another size; one without area shows nothing.
    pub fn resize(&mut self, size: winit::dpi::PhysicalSize<u32>) {
        let limit = self.gpu.limits.max_texture_dimension_2d;
        if size.width == 0 || size.height == 0 {
            return;
        }
        (self.config.width, self.config.height) = (size.width.min(limit), size.height.min(limit));
        self.is_configured = false;
    }

    /// Gives the surface its configuration, if it lacks it; may fail while the card is busy, and is tried again then.
    fn configure(&mut self) -> bool {
        if !self.is_configured {
            let (device, surface, config) = (&self.gpu.device, &self.surface, &self.config);
            self.is_configured = self.gpu.while_nothing_is_submitted(|| {
                let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
                surface.configure(device, config);
                let error = pollster::block_on(scope.pop());
                if let Some(error) = &error {
                    tracing::debug!(%error, "the surface could not be configured yet");
                }
                error.is_none()
            });
        }
        self.is_configured
    }

    /// Throws the surface away and makes another one.
    ///
    /// # Errors
    /// The window can have none any more.
    pub fn renew_surface(&mut self) -> Result<(), GpuError> {
        self.surfaces_lost += 1;
        let surface = self.gpu.instance.create_surface(Arc::clone(&self.window));
        self.surface = surface.map_err(|error| GpuError::Surface(error.to_string()))?;
        self.is_configured = false;
        self.gpu.check()
    }

    /// What egui calls a picture.
    pub fn texture_of(&mut self, target: &Arc<Target>) -> egui::TextureId {
        let (device, filter) = (&self.gpu.device, wgpu::FilterMode::Linear);
        match &mut self.picture {
            Some((shown, id)) if Arc::ptr_eq(shown, target) => *id,
            Some((shown, id)) => {
                *shown = Arc::clone(target);
                self.renderer.update_egui_texture_from_wgpu_texture(device, target.shown_view(), filter, *id);
                *id
            }
            None => {
                let id = self.renderer.register_native_texture(device, target.shown_view(), filter);
                self.picture = Some((Arc::clone(target), id));
                id
            }
        }
    }

    /// Forgets the picture: it belongs to another device, or to a model that was closed.
    pub fn forget_picture(&mut self) {
        if let Some((_, id)) = self.picture.take() {
            self.renderer.free_texture(&id);
        }
    }

    /// Shows a layout; with a path, also writes it as a PNG file.
    ///
    /// # Errors
    /// The device is lost, or the surface is and cannot be made again. A picture that cannot be written is the other result.
    pub fn show(
        &mut self,
        mut layout: Layout,
        save_as: Option<&Path>,
    ) -> Result<Option<Result<(), String>>, GpuError> {
        self.take_new_textures(&mut layout);
        let size = ScreenDescriptor {
            size_in_pixels: [self.config.width, self.config.height],
            pixels_per_point: layout.pixels_per_point,
        };
        let saved = match save_as {
            Some(path) => Some(self.save(&layout.triangles, &size, path)?),
            None => None,
        };
        if let Some(frame) = self.next_frame()? {
            self.draw(&layout.triangles, &size, &frame.texture)?;
            self.window.pre_present_notify();
            self.gpu.queue.present(frame);
        }
        layout.textures.free.drain().for_each(|id| self.renderer.free_texture(&id));
        self.gpu.check().map(|()| saved)
    }

    /// Takes the changes of textures of a layout that is not shown.
    ///
    /// # Errors
    /// The device is lost.
    pub fn take_textures(&mut self, mut layout: Layout) -> Result<(), GpuError> {
        self.take_new_textures(&mut layout);
        layout.textures.free.drain().for_each(|id| self.renderer.free_texture(&id));
        self.gpu.check()
    }

    fn take_new_textures(&mut self, layout: &mut Layout) {
        for (id, deltas) in layout.textures.set.drain() {
            for delta in deltas {
                self.renderer.update_texture(&self.gpu.device, &self.gpu.queue, id, &delta);
            }
        }
    }

    /// The texture that the window shows next, if it shows any.
    fn next_frame(&mut self) -> Result<Option<wgpu::SurfaceTexture>, GpuError> {
        use wgpu::CurrentSurfaceTexture as Next;
        for _ in 0..3 {
            if !self.configure() {
                self.window.request_redraw();
                return Ok(None);
            }
            match self.surface.get_current_texture() {
                Next::Success(frame) | Next::Suboptimal(frame) => return Ok(Some(frame)),
                Next::Timeout | Next::Occluded => return Ok(None),
                Next::Outdated => self.is_configured = false,
                Next::Lost => self.renew_surface()?,
                Next::Validation => self.gpu.check()?,
            }
        }
        Ok(None)
    }

    fn draw(
        &mut self,
        triangles: &[egui::ClippedPrimitive],
        size: &ScreenDescriptor,
        texture: &wgpu::Texture,
    ) -> Result<(), GpuError> {
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        let mut encoder = self.gpu.encoder("interface");
        let mut commands = self.renderer.update_buffers(device, queue, &mut encoder, triangles, size);
        let view = texture.create_view(&Default::default());
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("interface"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        self.renderer.render(&mut pass.forget_lifetime(), triangles, size);
        commands.push(encoder.finish());
        queue.submit(commands);
        self.gpu.check()
    }

    /// Draws a layout a second time and writes it.
    fn save(
        &mut self,
        triangles: &[egui::ClippedPrimitive],
        size: &ScreenDescriptor,
        path: &Path,
    ) -> Result<Result<(), String>, GpuError> {
        let [width, height] = size.size_in_pixels;
        let texture = self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("screenshot"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: self.config.format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        self.draw(triangles, size, &texture)?;
        let read = read_texture(&self.gpu.device, &self.gpu.queue, &texture);
        let mut rgba = match read {
            Ok(rgba) => rgba,
            Err(error) => return self.gpu.check().map(|()| Err(error.to_string())),
        };
        if is_bgra(self.config.format) {
            rgba.chunks_exact_mut(4).for_each(|pixel| pixel.swap(0, 2));
        }
        rgba.chunks_exact_mut(4).for_each(|pixel| pixel[3] = 255);
        Ok(write_png(path, width, height, &rgba).map_err(|error| error.to_string()))
    }
}

fn is_bgra(format: wgpu::TextureFormat) -> bool {
    matches!(format, wgpu::TextureFormat::Bgra8Unorm | wgpu::TextureFormat::Bgra8UnormSrgb)
}

/// A configuration in the format that egui wants: bytes that are taken as they are.
fn configuration(
    gpu: &Gpu,
    surface: &wgpu::Surface<'_>,
    size: winit::dpi::PhysicalSize<u32>,
) -> Result<wgpu::SurfaceConfiguration, GpuError> {
    let limit = gpu.limits.max_texture_dimension_2d;
    let (width, height) = (size.width.clamp(1, limit), size.height.clamp(1, limit));
    let none = || GpuError::Surface("the card shares no format with it".to_owned());
    let mut config = surface.get_default_config(&gpu.adapter, width, height).ok_or_else(none)?;
    let formats = surface.get_capabilities(&gpu.adapter).formats;
    config.format = egui_wgpu::preferred_framebuffer_format(&formats).map_err(|_| none())?;
    config.view_formats = Vec::new();
    config.present_mode = wgpu::PresentMode::AutoVsync;
    config.desired_maximum_frame_latency = 1;
    Ok(config)
}
