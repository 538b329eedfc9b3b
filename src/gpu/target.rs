//! The offscreen picture: colour and depth of a chosen size, read back as RGBA and written as PNG.

use std::io::Write;
use std::path::{Path, PathBuf};

use image::ImageEncoder;

use crate::whole_file::write_whole;

/// The format of the colour: written in linear light, stored as sRGB.
pub const COLOUR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// The same bytes, taken as they are.
const SHOWN_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// What a stencil starts from: counts go up and down from it.
pub const STENCIL_START: u32 = 128;

const BYTES_PER_PIXEL: u64 = 4;

/// Why there is no target, or no picture. Paths come last.
#[derive(Debug, thiserror::Error)]
pub enum TargetError {
    /// A side is zero or beyond what the adapter can do.
    #[error("a picture of {width}x{height} is not possible: each side must be from 1 to {limit} pixels here")]
    Size {
        /// The width that was asked for.
        width: u32,
        /// The height that was asked for.
        height: u32,
        /// The largest side on this adapter.
        limit: u32,
    },
    /// The picture does not fit one buffer of the adapter.
    #[error(
        "a picture of {width}x{height} cannot be read back: it needs {bytes} bytes, at most {limit} are possible here"
    )]
    ReadBackSize {
        /// The width that was asked for.
        width: u32,
        /// The height that was asked for.
        height: u32,
        /// What it needs.
        bytes: u64,
        /// The largest buffer on this adapter.
        limit: u64,
    },
    /// Neither 1 nor 4 samples.
    #[error("{0} samples a pixel are not possible: use 1 or 4")]
    Samples(u32),
    /// The graphics API refused.
    #[error("the GPU has no room for a picture of {width}x{height}; use a smaller one: {source}")]
    OutOfMemory {
        /// The width that was asked for.
        width: u32,
        /// The height that was asked for.
        height: u32,
        /// What the graphics API said.
        source: wgpu::Error,
    },
    /// The picture could not be brought to the CPU.
    #[error("the picture could not be read back from the GPU: {0}")]
    ReadBack(String),
    /// The picture file could not be written.
    #[error("cannot write the picture ({1}): {0}")]
    Write(PathBuf, String),
}

/// Textures to draw into.
#[derive(Debug)]
pub struct Target {
    width: u32,
    height: u32,
    samples: u32,
    resolved: wgpu::Texture,
    resolved_view: wgpu::TextureView,
    /// The same with its bytes as they are, for who takes them for sRGB anyway.
    shown_view: wgpu::TextureView,
    /// Present when `samples` exceeds 1; resolved into `resolved`.
    multisampled_view: Option<wgpu::TextureView>,
    /// Depth and, where the device has it, stencil.
    attached_depth_view: wgpu::TextureView,
    /// Depth alone, to be read.
    depth_view: wgpu::TextureView,
}

impl Target {
    /// Makes a target of `width` x `height` pixels with 1 or 4 `samples` a pixel.
    ///
    /// # Errors
    /// When the size or the samples are not possible on this device, or its memory is exhausted.
    pub fn new(device: &wgpu::Device, width: u32, height: u32, samples: u32) -> Result<Self, TargetError> {
        check(device, width, height, samples)?;
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let bound = wgpu::TextureUsages::TEXTURE_BINDING;
        let texture = |label, format, samples, usage| {
            device.create_texture(&describe(label, [width, height], format, samples, usage, &[]))
        };
        let (resolved, multisampled, depth) = check_memory(device, [width, height], || {
            (
                resolved_texture(device, [width, height]),
                (samples > 1).then(|| texture("target samples", COLOUR_FORMAT, samples, attachment)),
                texture("target depth", depth_format(device), samples, attachment | bound),
            )
        })?;
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self {
            width,
            height,
            samples,
            resolved_view: view(&resolved),
            shown_view: shown(&resolved),
            multisampled_view: multisampled.as_ref().map(view),
            attached_depth_view: view(&depth),
            depth_view: depth.create_view(&wgpu::TextureViewDescriptor {
                aspect: wgpu::TextureAspect::DepthOnly,
                ..Default::default()
            }),
            resolved,
        })
    }

    /// Another target of the same size, of which only the picture is its own: samples and depth are shared, so that the two
    /// may not be drawn to at the same time.
    ///
    /// # Errors
    /// The memory of the device is exhausted.
    pub fn sibling(&self, device: &wgpu::Device) -> Result<Self, TargetError> {
        let (width, height) = (self.width, self.height);
        let resolved = check_memory(device, [width, height], || resolved_texture(device, [width, height]))?;
        Ok(Self {
            width,
            height,
            samples: self.samples,
            resolved_view: resolved.create_view(&Default::default()),
            shown_view: shown(&resolved),
            multisampled_view: self.multisampled_view.clone(),
            attached_depth_view: self.attached_depth_view.clone(),
            depth_view: self.depth_view.clone(),
            resolved,
        })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Samples a pixel: 1 or 4.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Width over height.
    pub fn aspect(&self) -> f32 {
        self.width as f32 / self.height as f32
    }

    /// Bytes of GPU memory that the textures take, without padding.
    pub fn gpu_bytes(&self) -> u64 {
        let samples = u64::from(self.samples);
        let colour = if samples > 1 { 1 + samples } else { 1 };
        let stencil = if has_stencil(&self.attached_depth_view) { samples } else { 0 };
        u64::from(self.width) * u64::from(self.height) * (BYTES_PER_PIXEL * (colour + samples) + stencil)
    }

    /// The colour attachment, resolved if multisampled. Nothing is cleared to: the background covers everything.
    pub fn colour_attachment(&self) -> wgpu::RenderPassColorAttachment<'_> {
        let (view, resolve_target, store) = match &self.multisampled_view {
            Some(samples) => (samples, Some(&self.resolved_view), wgpu::StoreOp::Discard),
            None => (&self.resolved_view, None, wgpu::StoreOp::Store),
        };
        wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store },
        }
    }

    /// The picture, resolved if multisampled, with what it shows kept.
    pub fn resolved_attachment(&self) -> wgpu::RenderPassColorAttachment<'_> {
        wgpu::RenderPassColorAttachment {
            view: &self.resolved_view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
        }
    }

    /// The picture as a texture of sRGB bytes that are taken as they are.
    pub fn shown_view(&self) -> &wgpu::TextureView {
        &self.shown_view
    }

    /// The depth of every sample.
    pub fn depth_view(&self) -> &wgpu::TextureView {
        &self.depth_view
    }

    /// The depth attachment, cleared to infinity, and the stencil, cleared to [`STENCIL_START`]; with `keep` the depth is
    /// there after the pass.
    pub fn depth_attachment(&self, keep: bool) -> wgpu::RenderPassDepthStencilAttachment<'_> {
        attached_depth(&self.attached_depth_view, keep)
    }

    /// The picture as rows of RGBA from the top, 8 bits a channel, sRGB. Waits for the GPU.
    ///
    /// # Errors
    /// As [`read_texture`].
    pub fn read_rgba(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Vec<u8>, TargetError> {
        read_texture(device, queue, &self.resolved)
    }

    /// Reads the picture back and writes it as a PNG file.
    ///
    /// # Errors
    /// As [`Target::read_rgba`] and [`write_png`].
    pub fn save_png(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        path: &Path,
    ) -> Result<(), TargetError> {
        write_png(path, self.width, self.height, &self.read_rgba(device, queue)?)
    }
}

fn describe<'a>(
    label: &'a str,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    sample_count: u32,
    usage: wgpu::TextureUsages,
    view_formats: &'a [wgpu::TextureFormat],
) -> wgpu::TextureDescriptor<'a> {
    wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats,
    }
}

/// The format of the depth: reversed, 1 near and 0 at infinity; with a stencil where the device has one beside such depth.
pub fn depth_format(device: &wgpu::Device) -> wgpu::TextureFormat {
    if device.features().contains(wgpu::Features::DEPTH32FLOAT_STENCIL8) {
        wgpu::TextureFormat::Depth32FloatStencil8
    } else {
        wgpu::TextureFormat::Depth32Float
    }
}

fn has_stencil(view: &wgpu::TextureView) -> bool {
    view.texture().format().has_stencil_aspect()
}

/// A depth attachment, cleared to infinity, and its stencil, if it has one; with `keep` the depth is there after the pass.
pub(crate) fn attached_depth(
    view: &wgpu::TextureView,
    keep: bool,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    use wgpu::{LoadOp, Operations, StoreOp};
    let store = if keep { StoreOp::Store } else { StoreOp::Discard };
    let start = Operations { load: LoadOp::Clear(STENCIL_START), store: StoreOp::Discard };
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store }),
        stencil_ops: has_stencil(view).then_some(start),
    }
}

/// Makes something for a picture of that size.
///
/// # Errors
/// The memory of the device is exhausted.
pub(crate) fn check_memory<T>(
    device: &wgpu::Device,
    [width, height]: [u32; 2],
    make: impl FnOnce() -> T,
) -> Result<T, TargetError> {
    let scope = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let made = make();
    match pollster::block_on(scope.pop()) {
        Some(source) => Err(TargetError::OutOfMemory { width, height, source }),
        None => Ok(made),
    }
}

fn resolved_texture(device: &wgpu::Device, size: [u32; 2]) -> wgpu::Texture {
    use wgpu::TextureUsages as Usage;
    let usage = Usage::RENDER_ATTACHMENT | Usage::COPY_SRC | Usage::TEXTURE_BINDING;
    device.create_texture(&describe("target colour", size, COLOUR_FORMAT, 1, usage, &[SHOWN_FORMAT]))
}

fn shown(resolved: &wgpu::Texture) -> wgpu::TextureView {
    resolved.create_view(&wgpu::TextureViewDescriptor {
        format: Some(SHOWN_FORMAT),
        usage: Some(wgpu::TextureUsages::TEXTURE_BINDING),
        ..Default::default()
    })
}

/// The pixels of a texture of one level with 4 bytes each, in rows from the top. Waits for the GPU.
///
/// # Errors
/// When the device is lost or has no room for the copy.
pub fn read_texture(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
) -> Result<Vec<u8>, TargetError> {
    let row = padded_row_bytes(texture.width());
    let buffer = copy_to_buffer(device, queue, texture, row)?;
    let (sender, receiver) = crossbeam_channel::bounded(1);
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver only goes away with this function, and then nobody is interested.
        let _ = sender.send(result);
    });
    let read_back = |error: &dyn std::fmt::Display| TargetError::ReadBack(error.to_string());
    device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| read_back(&error))?;
    receiver.recv().map_err(|error| read_back(&error))?.map_err(|error| read_back(&error))?;
    let mapped = buffer.get_mapped_range(..).map_err(|error| read_back(&error))?;
    let used = (u64::from(texture.width()) * BYTES_PER_PIXEL) as usize;
    Ok(mapped.chunks_exact(row as usize).flat_map(|padded| &padded[..used]).copied().collect())
}

fn copy_to_buffer(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
    row: u32,
) -> Result<wgpu::Buffer, TargetError> {
    let (width, height) = (texture.width(), texture.height());
    let scope = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("target read-back"),
        size: u64::from(row) * u64::from(height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    if let Some(source) = pollster::block_on(scope.pop()) {
        return Err(TargetError::OutOfMemory { width, height, source });
    }
    let mut encoder = device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
        },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    Ok(buffer)
}

/// Writes rows of RGBA as a PNG file, under a temporary name until it is complete.
///
/// # Errors
/// When the folder is missing or not writable, or the disk is full; no file is left behind then.
pub fn write_png(path: &Path, width: u32, height: u32, rgba: &[u8]) -> Result<(), TargetError> {
    let encode = |file: &mut std::fs::File| {
        let mut encoded = std::io::BufWriter::new(file);
        image::codecs::png::PngEncoder::new(&mut encoded)
            .write_image(rgba, width, height, image::ExtendedColorType::Rgba8)
            .map_err(std::io::Error::other)?;
        encoded.flush()
    };
    write_whole(path, encode).map_err(|error| TargetError::Write(path.into(), error.to_string()))
}

fn check(device: &wgpu::Device, width: u32, height: u32, samples: u32) -> Result<(), TargetError> {
    let limits = device.limits();
    let limit = limits.max_texture_dimension_2d;
    if !(1..=limit).contains(&width) || !(1..=limit).contains(&height) {
        return Err(TargetError::Size { width, height, limit });
    }
    let bytes = u64::from(padded_row_bytes(width)) * u64::from(height);
    if bytes > limits.max_buffer_size {
        return Err(TargetError::ReadBackSize { width, height, bytes, limit: limits.max_buffer_size });
    }
    if samples == 1 || samples == 4 { Ok(()) } else { Err(TargetError::Samples(samples)) }
}

/// Rows of a copy start at multiples of 256 bytes. `width` is within the limits of a texture, so nothing overflows.
fn padded_row_bytes(width: u32) -> u32 {
    (width * BYTES_PER_PIXEL as u32).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_padded_to_copies() {
        assert_eq!([1, 64, 65].map(padded_row_bytes), [256, 256, 512]);
    }

    #[test]
    fn pictures_are_written_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        write_png(&path, 1, 2, &[255, 0, 0, 255, 0, 255, 0, 255]).unwrap();
        let read = image::open(&path).unwrap().into_rgba8();
        assert_eq!(read.get_pixel(0, 1).0, [0, 255, 0, 255]);
        let missing = folder.path().join("no folder").join("picture.png");
        let message = write_png(&missing, 1, 1, &[0; 4]).unwrap_err().to_string();
        assert!(message.ends_with("picture.png"), "{message}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
