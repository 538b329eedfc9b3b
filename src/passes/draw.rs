//! draw: active vertices and the reformed index buffer of every batch in, a lit picture out.
//!
//! One indirect draw per batch, or ranges of it where sections cut some of its instances only. A vertex carries the number
//! of its instance within the batch, so transforms and colours come from a table of [`InstanceRow`]s, and what the user has
//! done to an instance from one of [`LookRow`]s: to hide, ghost or colour any number of instances writes words of that table
//! and streams nothing. Depth is reversed; there is no culling by winding, because CAD data does not keep it.
//!
//! Sections clip by distances where the device can (`shaders/shared/clipped.wgsl`), else they cut sample by sample; what they
//! cut is closed first, in the same render pass ([`super::cut_face`]). Where edges are drawn the same buffers are read as storage,
//! because a corner must know its triangle.

mod pipelines;
mod row;
mod uniform;

use std::collections::HashMap;
use std::ops::Range;

use super::cut_face::{CutFacePass, Paint};
use crate::gpu::target::{COLOUR_FORMAT, Target};
use pipelines::{Drawn, Kind, Pipelines};
pub(super) use pipelines::{active_vertices, depth_state};
pub(crate) use row::is_inside_out;
pub use row::{InstanceRow, Look, LookRow};
pub use uniform::{Edges, FrameUniform, MOST_PLANES, MOST_SECTIONS, Mode, ROUNDING, Section, Style};

/// What a surface and the background look like, whoever places the corners: the first piece of [`SHADER`].
pub const SURFACE: &str = include_str!("../../shaders/shared/surface.wgsl");

/// The shader's source.
pub const SHADER: &str = concat!(
    include_str!("../../shaders/shared/surface.wgsl"),
    include_str!("../../shaders/shared/section.wgsl"),
    include_str!("../../shaders/draw.wgsl")
);

/// The source for devices that clip by distances: sections cost no test of samples there.
pub(super) const CLIPPED_SHADER: &str = concat!(
    "enable clip_distances;\n",
    include_str!("../../shaders/shared/surface.wgsl"),
    include_str!("../../shaders/shared/section.wgsl"),
    include_str!("../../shaders/draw.wgsl"),
    include_str!("../../shaders/shared/clipped.wgsl")
);

/// The most sections that a device clips by.
pub const MOST_CLIPPED: usize = 8;

/// Corners of the triangles of a box.
const BOX_CORNERS: u32 = 36;

/// Bytes of an active vertex: the three words of a vertex record, then its instance's number within the batch.
pub const ACTIVE_VERTEX_BYTES: u64 = 16;

/// What is drawn of one batch.
#[derive(Debug, Clone, Copy)]
pub struct DrawBatch<'a> {
    /// From [`DrawPass::bind_instances`].
    pub instances: &'a wgpu::BindGroup,
    /// Active vertices, [`ACTIVE_VERTEX_BYTES`] each.
    pub vertices: &'a wgpu::Buffer,
    /// Indices of 32 bits into `vertices`.
    pub indices: &'a wgpu::Buffer,
    /// Active triangles, 8 bytes each; only their flags are read, where edges are drawn.
    pub triangles: &'a wgpu::Buffer,
    /// Holds the arguments of one indexed indirect draw, of which the first four are also those of one that is not indexed.
    pub indirect: &'a wgpu::Buffer,
    /// Where in `indirect`, in bytes.
    pub indirect_offset: u64,
    /// What is drawn of it; all of it if it is not said, cut as the frame asks for.
    pub ranges: Option<&'a Ranges>,
    /// The triangles that cut faces are made of.
    pub cut_faces: Option<&'a CutFaceRanges>,
}

/// Which triangles of a batch are drawn. What is in no range is not drawn.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Ranges {
    /// Those that no section cuts: as if there were none.
    pub kept: Vec<Range<u32>>,
    /// Those that are cut as the frame asks for.
    pub cut: Vec<Range<u32>>,
}

/// Which triangles of a batch cut faces are made of: those of closed parts that lines of sight come into by a section. Open
/// parts, and closed ones that are whole, may be among them.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CutFaceRanges {
    /// Of parts that are placed as they are.
    pub as_is: Vec<Range<u32>>,
    /// Of parts that are placed inside out.
    pub inside_out: Vec<Range<u32>>,
}

impl DrawBatch<'_> {
    /// The triangles that cut faces are made of.
    pub(super) fn cut_faces_of(&self, inside_out: bool) -> &[Range<u32>] {
        match self.cut_faces {
            Some(ranges) if inside_out => &ranges.inside_out,
            Some(ranges) => &ranges.as_is,
            None => &[],
        }
    }

    /// What of it is drawn in that way; `None` is all of it, by the indirect draw.
    pub(super) fn ranges_of(&self, is_cut: bool) -> Option<&[Range<u32>]> {
        self.ranges.map(|ranges| if is_cut { ranges.cut.as_slice() } else { ranges.kept.as_slice() })
    }
}

/// How surfaces are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Cut {
    /// Not at all.
    #[default]
    No,
    /// By at most [`MOST_CLIPPED`] sections and nothing else: by distances where the device can.
    Clipped,
    /// Sample by sample: there are more sections, or ghosts.
    Sampled,
}

/// What a frame asks of the pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Asked {
    /// Whether any edges are drawn.
    pub edges: bool,
    /// How surfaces are cut.
    pub cut: Cut,
    /// Whether the depth is kept for what comes after.
    pub depth: bool,
    /// Whether what sections cut is closed: lines of sight come in by one.
    pub cut_faces: bool,
}

/// What is drawn in one go.
#[derive(Debug, Clone, Copy)]
pub struct DrawList<'a> {
    /// What [`DrawPass::prepare`] has been asked for.
    pub asked: Asked,
    /// The batches.
    pub batches: &'a [DrawBatch<'a>],
    /// The tables of boxes, from [`DrawPass::bind_instances`], and their number: each row places the unit cube.
    pub boxes: Option<(&'a wgpu::BindGroup, u32)>,
}

/// Pipelines and the frame's uniform.
#[derive(Debug)]
pub struct DrawPass {
    pipelines: Pipelines,
    made: HashMap<Kind, wgpu::RenderPipeline>,
    frame: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    /// Made when there is something to close.
    cut_face: Option<CutFacePass>,
}

impl DrawPass {
    /// Makes the pass for targets of that many samples a pixel (1 or 4).
    pub fn new(device: &wgpu::Device, samples: u32) -> Self {
        use wgpu::ShaderStages as Stages;
        let uniform = (wgpu::BufferBindingType::Uniform, size_of::<FrameUniform>());
        let table = |bytes: usize| (wgpu::BufferBindingType::Storage { read_only: true }, bytes);
        let [rows, looks] = [table(size_of::<InstanceRow>()), table(size_of::<LookRow>())];
        let pipelines = Pipelines {
            module: module(device, "draw", SHADER),
            clipped: device
                .features()
                .contains(wgpu::Features::CLIP_DISTANCES)
                .then(|| module(device, "draw clipped", CLIPPED_SHADER)),
            samples,
            frame: layout(device, "draw frame", Stages::VERTEX_FRAGMENT, &[uniform]),
            instances: layout(device, "draw instances", Stages::VERTEX, &[rows, looks]),
            edged: layout(device, "draw edges", Stages::VERTEX, &[table(16), table(4), table(8)]),
        };
        let frame = frame_buffer(device, "draw frame");
        let frame_group = bind(device, "draw frame", &pipelines.frame, &[&frame]);
        let mut this = Self { pipelines, made: HashMap::new(), frame, frame_group, cut_face: None };
        this.make_pipelines(device, Asked::default());
        this
    }

    /// Binds a batch's tables (storage buffers): an [`InstanceRow`] and a [`LookRow`] for each instance, at least one.
    pub fn bind_instances(
        &self,
        device: &wgpu::Device,
        rows: &wgpu::Buffer,
        looks: &wgpu::Buffer,
    ) -> wgpu::BindGroup {
        bind(device, "draw instances", &self.pipelines.instances, &[rows, looks])
    }

    /// Sets what the next submission sees as the frame; returns the bytes that are sent.
    pub fn write_frame(&self, queue: &wgpu::Queue, frame: &FrameUniform) -> u64 {
        let bytes = frame.bytes_used();
        queue.write_buffer(&self.frame, 0, bytes);
        bytes.len() as u64
    }

    /// Makes what a frame needs, if it is not there.
    pub fn prepare(&mut self, device: &wgpu::Device, asked: Asked) {
        self.make_pipelines(device, asked);
        if asked.cut_faces {
            let Pipelines { frame, instances, samples, .. } = &self.pipelines;
            self.cut_face
                .get_or_insert_with(|| CutFacePass::new(device, *samples, CUT_FACES, frame))
                .prepare(device, asked.cut, [frame, instances]);
        }
    }

    fn make_pipelines(&mut self, device: &wgpu::Device, asked: Asked) {
        for kind in kinds(asked) {
            self.made.entry(kind).or_insert_with(|| self.pipelines.make(device, kind));
        }
    }

    /// Records the pass: the faces of cuts, all batches, boxes, and the background where nothing was drawn.
    pub fn record(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        list: &DrawList<'_>,
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("draw"),
            color_attachments: &[Some(target.colour_attachment())],
            depth_stencil_attachment: Some(target.depth_attachment(list.asked.depth)),
            timestamp_writes,
            ..Default::default()
        });
        pass.set_bind_group(0, &self.frame_group, &[]);
        let cut_face = self.cut_face.as_ref().filter(|_| list.has_cut_faces());
        if let Some(cut_face) = cut_face {
            cut_face.record(&mut pass, list);
        }
        self.draw_scene(device, &mut pass, list);
        let [_, _, of_boxes, background] = kinds(list.asked).map(|kind| self.made.get(&kind));
        if let Some(pipeline) = of_boxes {
            pass.set_pipeline(pipeline);
            draw_boxes(&mut pass, list);
        }
        if let Some(pipeline) = background {
            pass.set_pipeline(pipeline);
            pass.draw(0..3, 0..1);
        }
        if let Some(cut_face) = cut_face.filter(|_| list.asked.depth) {
            cut_face.settle(&mut pass);
        }
    }

    /// Draws all batches: what sections keep wholly, then the rest.
    fn draw_scene(&self, device: &wgpu::Device, pass: &mut wgpu::RenderPass<'_>, list: &DrawList<'_>) {
        let [kept, cut, ..] = kinds(list.asked).map(|kind| self.made.get(&kind));
        for (pipeline, is_cut) in [(kept, false), (cut, true)] {
            let Some(pipeline) = pipeline else { continue };
            pass.set_pipeline(pipeline);
            for batch in list.batches {
                let ranges = batch.ranges_of(is_cut);
                let is_drawn = ranges.map_or(is_cut, |ranges| !ranges.is_empty());
                if is_drawn && list.asked.edges {
                    self.draw_edged(device, pass, batch, ranges);
                } else if is_drawn {
                    draw_batch(pass, batch, ranges);
                }
            }
        }
    }

    fn draw_edged(
        &self,
        device: &wgpu::Device,
        pass: &mut wgpu::RenderPass<'_>,
        batch: &DrawBatch<'_>,
        ranges: Option<&[Range<u32>]>,
    ) {
        let buffers = [batch.vertices, batch.indices, batch.triangles];
        let group = bind(device, "draw edges", &self.pipelines.edged, &buffers);
        pass.set_bind_group(1, batch.instances, &[]);
        pass.set_bind_group(2, &group, &[]);
        match ranges {
            None => pass.draw_indirect(batch.indirect, batch.indirect_offset),
            Some(ranges) => ranges.iter().for_each(|range| pass.draw(corners_of(range), 0..1)),
        }
    }
}

/// How cut faces are painted in a picture.
const CUT_FACES: Paint = Paint {
    entry: "cut_face_fragment",
    clipped_entry: Some("clipped_cut_face_fragment"),
    empty_entry: None,
    format: COLOUR_FORMAT,
};

impl DrawList<'_> {
    /// Whether there may be cut faces.
    pub(super) fn has_cut_faces(&self) -> bool {
        let has =
            |batch: &DrawBatch<'_>| [false, true].iter().any(|&out| !batch.cut_faces_of(out).is_empty());
        self.asked.cut_faces && self.batches.iter().any(has)
    }
}

pub(super) fn module(device: &wgpu::Device, label: &str, source: &str) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(source.into());
    device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source })
}

/// The pipelines of what is kept of batches, of what is cut of them, of boxes and of the background.
fn kinds(asked: Asked) -> [Kind; 4] {
    let scene = if asked.edges { Drawn::Edged } else { Drawn::Scene };
    let cut = asked.cut;
    [
        Kind { drawn: scene, cut: Cut::No },
        Kind { drawn: scene, cut },
        Kind { drawn: Drawn::Boxes, cut },
        Kind { drawn: Drawn::Background, cut: Cut::No },
    ]
}

/// Draws the boxes of a list, with the pipeline and the frame set.
pub(super) fn draw_boxes(pass: &mut wgpu::RenderPass<'_>, list: &DrawList<'_>) {
    if let Some((rows, count)) = list.boxes {
        pass.set_bind_group(1, rows, &[]);
        pass.draw(0..BOX_CORNERS, 0..count);
    }
}

/// The corners of a range of triangles.
fn corners_of(triangles: &Range<u32>) -> Range<u32> {
    3 * triangles.start..3 * triangles.end
}

/// Draws ranges of a batch, or all of it, by its index buffer, with the pipeline and the frame set.
pub(super) fn draw_batch(
    pass: &mut wgpu::RenderPass<'_>,
    batch: &DrawBatch<'_>,
    ranges: Option<&[Range<u32>]>,
) {
    match ranges {
        None => {
            set_batch(pass, batch);
            pass.draw_indexed_indirect(batch.indirect, batch.indirect_offset);
        }
        Some(ranges) => draw_ranges(pass, batch, ranges),
    }
}

/// Draws ranges of a batch by its index buffer, with the pipeline and the frame set.
pub(super) fn draw_ranges(pass: &mut wgpu::RenderPass<'_>, batch: &DrawBatch<'_>, ranges: &[Range<u32>]) {
    if !ranges.is_empty() {
        set_batch(pass, batch);
        ranges.iter().for_each(|range| pass.draw_indexed(corners_of(range), 0, 0..1));
    }
}

fn set_batch(pass: &mut wgpu::RenderPass<'_>, batch: &DrawBatch<'_>) {
    pass.set_bind_group(1, batch.instances, &[]);
    pass.set_vertex_buffer(0, batch.vertices.slice(..));
    pass.set_index_buffer(batch.indices.slice(..), wgpu::IndexFormat::Uint32);
}

pub(super) fn frame_buffer(device: &wgpu::Device, label: &str) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: size_of::<FrameUniform>() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// A layout of buffers, each with its kind and its least size in bytes, in the order of their bindings.
pub(super) fn layout(
    device: &wgpu::Device,
    label: &str,
    visibility: wgpu::ShaderStages,
    buffers: &[(wgpu::BufferBindingType, usize)],
) -> wgpu::BindGroupLayout {
    let entry = |(binding, &(ty, least_bytes)): (u32, &(wgpu::BufferBindingType, usize))| {
        let min_binding_size = wgpu::BufferSize::new(least_bytes as u64);
        wgpu::BindGroupLayoutEntry {
            binding,
            visibility,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size },
            count: None,
        }
    };
    let entries: Vec<_> = (0..).zip(buffers).map(entry).collect();
    device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// Binds buffers in the order of their bindings.
pub(super) fn bind(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Grid;
    use crate::geometry::record::Attributes;
    use glam::{DAffine3, DVec3};
    use std::mem::offset_of;

    fn module() -> naga::Module {
        let module =
            naga::front::wgsl::parse_str(SHADER).unwrap_or_else(|e| panic!("{}", e.emit_to_string(SHADER)));
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(SHADER)));
        module
    }

    /// The offsets of a struct's members by name, and its size.
    fn shader_struct(module: &naga::Module, name: &str) -> (Vec<(String, u32)>, u32) {
        let (_, found) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).unwrap();
        let naga::TypeInner::Struct { members, span } = &found.inner else { panic!("{name} is no struct") };
        (members.iter().map(|m| (m.name.clone().unwrap(), m.offset)).collect(), *span)
    }

    fn assert_layout(name: &str, host: &[(&str, usize)], host_size: usize) {
        let (members, span) = shader_struct(&module(), name);
        let host: Vec<_> = host.iter().map(|&(name, offset)| (name.to_owned(), offset as u32)).collect();
        assert_eq!(members, host);
        assert_eq!(span as usize, host_size);
    }

    #[test]
    fn the_clipped_shader_is_valid_where_distances_clip() {
        let module = naga::front::wgsl::parse_str(CLIPPED_SHADER)
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(CLIPPED_SHADER)));
        let capabilities = naga::valid::Capabilities::CLIP_DISTANCES;
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
            .validate(&module)
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(CLIPPED_SHADER)));
    }

    #[test]
    fn frame_has_the_shaders_layout() {
        let host = [
            ("clip_from_relative", offset_of!(FrameUniform, clip_from_relative)),
            ("eye_high", offset_of!(FrameUniform, eye_high)),
            ("mode", offset_of!(FrameUniform, mode)),
            ("eye_low", offset_of!(FrameUniform, eye_low)),
            ("parallel", offset_of!(FrameUniform, parallel)),
            ("to_key", offset_of!(FrameUniform, to_key)),
            ("section_count", offset_of!(FrameUniform, section_count)),
            ("to_rim", offset_of!(FrameUniform, to_rim)),
            ("line_px", offset_of!(FrameUniform, line_px)),
            ("to_viewer", offset_of!(FrameUniform, to_viewer)),
            ("edges", offset_of!(FrameUniform, edges)),
            ("sections", offset_of!(FrameUniform, sections)),
            ("entries", offset_of!(FrameUniform, entries)),
        ];
        assert_layout("Frame", &host, size_of::<FrameUniform>());
    }

    #[test]
    fn instance_rows_have_the_shaders_layout() {
        let columns = offset_of!(InstanceRow, columns);
        let host = [
            ("column_0", columns),
            ("column_1", columns + 16),
            ("column_2", columns + 32),
            ("translation_low", offset_of!(InstanceRow, translation_low)),
            ("colour", offset_of!(InstanceRow, colour)),
        ];
        assert_layout("InstanceRow", &host, size_of::<InstanceRow>());
    }

    #[test]
    fn instance_rows_hold_transform_step_and_colour() {
        let grid = Grid { origin: [1.0, 0.0, 0.0], step_exponent: -2 };
        let placed = DAffine3::from_scale_rotation_translation(
            DVec3::splat(2.0),
            glam::DQuat::IDENTITY,
            DVec3::new(1e7, 0.1, -3.0),
        );
        let row = InstanceRow::new(placed, grid, [1, 2, 3, 255], Attributes::Colour);
        assert_eq!(row.columns[0], [0.5, 0.0, 0.0, 10_000_002.0]);
        assert_eq!(
            row.columns[1][3] as f64 + row.translation_low[1] as f64,
            0.1f32 as f64 + (0.1 - 0.1f32 as f64) as f32 as f64
        );
        assert_eq!(row.colour, 0x0103_0201);
    }
}
