//! cut_face: what sections cut of batches in; the faces of the cut through closed parts over what the draw pass drew, out.
//!
//! Four draws (`shaders/cut_face.wgsl`): what is cut is counted, fronts against backs, into a number for each sample; where
//! there is a cut face the depth is emptied; the nearest backs are painted there as the plane; and get its depth. Only what sections cut
//! takes part, so that a frame whose sections cut a few instances of a large model pays for those alone.

use super::draw::{
    CLIPPED_SHADER, Cut, DrawList, SHADER as DRAW_SHADER, active_vertices, depth_state, draw_batch, module,
};
use crate::gpu::target::{TargetError, check_memory};

/// What follows the shader of the draw pass.
const CUT_FACE: &str = include_str!("../../shaders/cut_face.wgsl");

/// The format of the counts: whole numbers up to 2,048 are exact, and blending adds them.
const COUNT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R16Float;

/// The shader's source for targets of that many samples, without what comes before it.
fn own_source(samples: u32) -> String {
    let texture = if samples > 1 { "texture_multisampled_2d<f32>" } else { "texture_2d<f32>" };
    format!("alias COUNTS = {texture};\n{CUT_FACE}")
}

/// The shader's source for targets of that many samples.
pub fn shader(samples: u32) -> String {
    [DRAW_SHADER, own_source(samples).as_str()].concat()
}

/// The same for devices that clip by distances.
fn clipped_shader(samples: u32) -> String {
    let clipped = include_str!("../../shaders/shared/clipped_cut_face.wgsl");
    [CLIPPED_SHADER, own_source(samples).as_str(), clipped].concat()
}

/// What cut faces are painted with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Paint {
    /// The fragment entry point.
    pub entry: &'static str,
    /// The same where distances clip, if that is to be used.
    pub clipped_entry: Option<&'static str>,
    /// What it writes to.
    pub format: wgpu::TextureFormat,
}

/// The pipelines, and the counts of the last target.
#[derive(Debug)]
pub(super) struct CutFacePass {
    /// Sample by sample.
    sampled: Painting,
    /// By distances, where the device can.
    clipped: Option<Painting>,
    empty: wgpu::RenderPipeline,
    settle: wgpu::RenderPipeline,
    counts_layout: wgpu::BindGroupLayout,
    samples: u32,
    counts: Option<Counts>,
}

/// The pipelines for what sections cut.
#[derive(Debug)]
struct Painting {
    count: wgpu::RenderPipeline,
    paint: wgpu::RenderPipeline,
}

/// A number for each sample of a target.
#[derive(Debug)]
struct Counts {
    size: [u32; 2],
    view: wgpu::TextureView,
    group: wgpu::BindGroup,
}

/// Which depth a pipeline takes part in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Depth {
    Not,
    Written,
    Tested,
}

/// What tells one pipeline of the pass from another.
struct Draws<'a> {
    module: &'a wgpu::ShaderModule,
    label: &'a str,
    entries: [&'a str; 2],
    has_vertices: bool,
    depth: Depth,
    target: wgpu::ColorTargetState,
}

impl CutFacePass {
    /// Makes the pass for targets of that many samples a pixel, with the layouts of the frame and of instances.
    pub fn new(
        device: &wgpu::Device,
        samples: u32,
        paint: Paint,
        [frame, instances]: [&wgpu::BindGroupLayout; 2],
    ) -> Self {
        let counts_layout = counts_layout(device, samples > 1);
        let make = |draws: &Draws<'_>| {
            let groups = [Some(frame), Some(instances), Some(&counts_layout)];
            let groups = if draws.depth == Depth::Not { &groups[..2] } else { &groups[..] };
            pipeline(device, samples, groups, draws)
        };
        let painting = |module: &wgpu::ShaderModule, vertex, count, entry| Painting {
            count: make(&Draws {
                module,
                label: "cut_face count",
                entries: [vertex, count],
                has_vertices: true,
                depth: Depth::Not,
                target: added_counts(),
            }),
            paint: make(&Draws {
                module,
                label: "cut_face",
                entries: [vertex, entry],
                has_vertices: true,
                depth: Depth::Tested,
                target: paint.format.into(),
            }),
        };
        let plain = module(device, "cut_face", &shader(samples));
        let can_clip = device.features().contains(wgpu::Features::CLIP_DISTANCES);
        let clipped = paint.clipped_entry.filter(|_| can_clip).map(|entry| {
            let module = module(device, "cut_face clipped", &clipped_shader(samples));
            painting(&module, "clipped_cut_face_vertex", "clipped_count_fragment", entry)
        });
        // Over the whole picture, to depth alone.
        let whole = |label, entries| {
            let unwritten =
                wgpu::ColorTargetState { write_mask: wgpu::ColorWrites::empty(), ..paint.format.into() };
            make(&Draws {
                module: &plain,
                label,
                entries,
                has_vertices: false,
                depth: Depth::Written,
                target: unwritten,
            })
        };
        Self {
            sampled: painting(&plain, "cut_face_vertex", "count_fragment", paint.entry),
            clipped,
            empty: whole("cut_face empty", ["background_vertex", "empty_fragment"]),
            settle: whole("cut_face settle", ["line_vertex", "settle_fragment"]),
            counts_layout,
            samples,
            counts: None,
        }
    }

    /// Makes room for the counts of a target.
    ///
    /// # Errors
    /// The memory of the device is exhausted.
    pub fn prepare(&mut self, device: &wgpu::Device, size: [u32; 2]) -> Result<(), TargetError> {
        if self.counts.as_ref().is_some_and(|counts| counts.size == size) {
            return Ok(());
        }
        self.counts = None;
        let [width, height] = size;
        let texture = check_memory(device, size, || {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some("cut_face counts"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: self.samples,
                dimension: wgpu::TextureDimension::D2,
                format: COUNT_FORMAT,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            })
        })?;
        let view = texture.create_view(&Default::default());
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("cut_face counts"),
            layout: &self.counts_layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(&view),
            }],
        });
        self.counts = Some(Counts { size, view, group });
        Ok(())
    }

    /// Bytes of GPU memory that the counts take.
    pub fn gpu_bytes(&self) -> u64 {
        let pixels = |counts: &Counts| u64::from(counts.size[0]) * u64::from(counts.size[1]);
        2 * u64::from(self.samples) * self.counts.as_ref().map_or(0, pixels)
    }

    /// Records the pass, after what draws into the same attachments, which keeps what it draws; `frame` is the frame's group.
    /// The time ends with it.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::BindGroup,
        list: &DrawList<'_>,
        (colour, depth): (wgpu::RenderPassColorAttachment<'_>, wgpu::RenderPassDepthStencilAttachment<'_>),
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        let Some(counts) = &self.counts else { return };
        let clipped = self.clipped.as_ref().filter(|_| list.asked.cut == Cut::Clipped);
        let painting = clipped.unwrap_or(&self.sampled);
        count(encoder, frame, list, (&painting.count, &counts.view));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("cut_face"),
            color_attachments: &[Some(colour)],
            depth_stencil_attachment: Some(depth),
            timestamp_writes,
            ..Default::default()
        });
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(2, &counts.group, &[]);
        // What is drawn over the whole picture has the layout of what is drawn of batches.
        let Some(first) = list.batches.first() else { return };
        pass.set_bind_group(1, first.instances, &[]);
        pass.set_pipeline(&self.empty);
        pass.draw(0..3, 0..1);
        pass.set_pipeline(&painting.paint);
        draw_cut(&mut pass, list);
        if list.asked.depth {
            pass.set_pipeline(&self.settle);
            pass.draw(0..3, 0..1);
        }
    }
}

/// Records the counting.
fn count(
    encoder: &mut wgpu::CommandEncoder,
    frame: &wgpu::BindGroup,
    list: &DrawList<'_>,
    (pipeline, counts): (&wgpu::RenderPipeline, &wgpu::TextureView),
) {
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("cut_face count"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: counts,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            },
        })],
        ..Default::default()
    });
    pass.set_bind_group(0, frame, &[]);
    pass.set_pipeline(pipeline);
    draw_cut(&mut pass, list);
}

/// Counts, each added to what is there.
fn added_counts() -> wgpu::ColorTargetState {
    let added = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::ColorTargetState {
        format: COUNT_FORMAT,
        blend: Some(wgpu::BlendState { color: added, alpha: added }),
        write_mask: wgpu::ColorWrites::ALL,
    }
}

/// Draws what sections cut.
fn draw_cut(pass: &mut wgpu::RenderPass<'_>, list: &DrawList<'_>) {
    for batch in list.batches.iter().filter(|batch| batch.is_cut()) {
        draw_batch(pass, batch, batch.ranges_of(true));
    }
}

fn counts_layout(device: &wgpu::Device, multisampled: bool) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("cut_face counts"),
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: false },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled,
            },
            count: None,
        }],
    })
}

fn depth_of(depth: Depth) -> Option<wgpu::DepthStencilState> {
    match depth {
        Depth::Not => None,
        Depth::Written => Some(wgpu::DepthStencilState {
            depth_compare: Some(wgpu::CompareFunction::Always),
            ..depth_state(true)
        }),
        Depth::Tested => Some(depth_state(true)),
    }
}

fn pipeline(
    device: &wgpu::Device,
    samples: u32,
    groups: &[Option<&wgpu::BindGroupLayout>],
    draws: &Draws<'_>,
) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(draws.label),
        bind_group_layouts: groups,
        immediate_size: 0,
    });
    let [vertex, fragment] = draws.entries;
    let vertices = [Some(active_vertices())];
    let module = draws.module;
    // Constants that an entry point does not use may not be given.
    let constants = [("SAMPLES", f64::from(samples))];
    let has_samples = fragment != "clipped_count_fragment";
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(draws.label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: Default::default(),
            buffers: if draws.has_vertices { &vertices } else { &[] },
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: depth_of(draws.depth),
        multisample: wgpu::MultisampleState { count: samples, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: if has_samples { &constants } else { &[] },
                ..Default::default()
            },
            targets: &[Some(draws.target.clone())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shader_is_valid_for_any_number_of_samples() {
        let clips = naga::valid::Capabilities::CLIP_DISTANCES;
        let plain = [1, 4].map(|samples| (shader(samples), naga::valid::Capabilities::empty()));
        let clipped = [1, 4].map(|samples| (clipped_shader(samples), clips));
        for (source, capabilities) in plain.into_iter().chain(clipped) {
            let module = naga::front::wgsl::parse_str(&source)
                .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
            let flags = naga::valid::ValidationFlags::all();
            naga::valid::Validator::new(flags, capabilities)
                .validate(&module)
                .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
        }
    }
}
