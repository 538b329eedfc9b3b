//! cut_face: the closed parts that sections cut in; the faces of the cut, out, nearer than all that is drawn after.
//!
//! The first draws of the draw pass (`shaders/cut_face.wgsl`): one walk over what is cut paints the nearest backs as the
//! plane, while the stencil counts backs against fronts; then depth is emptied, and shut where there is a cut face, so that
//! nothing is drawn over it, and what lies behind it is rejected (before it is shaded, where distances clip). Only closed
//! parts that lines of sight come into by a section take part: a frame whose sections cut a few instances of a large model
//! pays for those alone.

use super::draw::{
    CLIPPED_SHADER, Cut, DrawList, SHADER as DRAW_SHADER, active_vertices, depth_state, draw_ranges, module,
};
use crate::gpu::target::{STENCIL_START, depth_format};

/// What follows the shader of the draw pass.
const CUT_FACE: &str = include_str!("../../shaders/cut_face.wgsl");

/// The shader's source.
fn shader() -> String {
    [DRAW_SHADER, CUT_FACE].concat()
}

/// The same for devices that clip by distances.
fn clipped_shader() -> String {
    [CLIPPED_SHADER, CUT_FACE, include_str!("../../shaders/shared/clipped_cut_face.wgsl")].concat()
}

/// What cut faces are painted with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Paint {
    /// The fragment entry point.
    pub entry: &'static str,
    /// The same where distances clip, if that is to be used.
    pub clipped_entry: Option<&'static str>,
    /// That which takes away what was painted where there is no cut face; nothing does where all pixels are drawn over.
    pub empty_entry: Option<&'static str>,
    /// What they write to.
    pub format: wgpu::TextureFormat,
}

/// Whether a device has what the pass needs: a stencil beside its depth.
pub fn is_possible(device: &wgpu::Device) -> bool {
    depth_format(device).has_stencil_aspect()
}

/// The pipelines.
#[derive(Debug)]
pub(super) struct CutFacePass {
    /// Of what is placed as it is, and inside out; sample by sample.
    sampled: Option<[wgpu::RenderPipeline; 2]>,
    /// The same by distances.
    clipped: Option<[wgpu::RenderPipeline; 2]>,
    empty: wgpu::RenderPipeline,
    shut: wgpu::RenderPipeline,
    settle: wgpu::RenderPipeline,
    paint: Paint,
    samples: u32,
}

/// What tells one pipeline of the pass from another.
#[derive(Clone)]
struct Draws<'a> {
    module: &'a wgpu::ShaderModule,
    label: &'a str,
    groups: &'a [Option<&'a wgpu::BindGroupLayout>],
    entries: [&'a str; 2],
    /// Whether active vertices are drawn, and if so which: those of what is placed inside out, or as it is.
    inside_out: Option<bool>,
    /// Whether the fragment entry point asks for the number of samples.
    has_samples: bool,
    depth: wgpu::CompareFunction,
    stencil: wgpu::StencilState,
    target: wgpu::ColorTargetState,
}

impl CutFacePass {
    /// Makes the pass for targets of that many samples a pixel, with the layout of the frame.
    pub fn new(device: &wgpu::Device, samples: u32, paint: Paint, frame: &wgpu::BindGroupLayout) -> Self {
        use wgpu::CompareFunction as Compare;
        let module = module(device, "cut_face", &shader());
        let groups = [Some(frame)];
        let whole = Draws {
            module: &module,
            label: "cut_face empty",
            groups: &groups,
            entries: ["background_vertex", "empty_fragment"],
            inside_out: None,
            has_samples: false,
            depth: Compare::Always,
            stencil: wgpu::StencilState::default(),
            target: wgpu::ColorTargetState { write_mask: wgpu::ColorWrites::empty(), ..paint.format.into() },
        };
        let within = Draws { stencil: where_count_is(Compare::Less), ..whole.clone() };
        let shut = Draws {
            label: "cut_face shut",
            entries: ["line_vertex", "shut_fragment"],
            has_samples: true,
            ..within.clone()
        };
        let settle = Draws {
            label: "cut_face settle",
            entries: ["line_vertex", "settle_fragment"],
            depth: Compare::Less,
            ..within
        };
        let empty = match paint.empty_entry {
            Some(entry) => Draws {
                entries: ["background_vertex", entry],
                stencil: where_count_is(Compare::GreaterEqual),
                target: paint.format.into(),
                ..whole
            },
            None => whole,
        };
        let [empty, shut, settle] = [&empty, &shut, &settle].map(|draws| pipeline(device, samples, draws));
        Self { sampled: None, clipped: None, empty, shut, settle, paint, samples }
    }

    /// Makes what a frame that is cut in that way needs, with the layouts of the frame and of instances.
    pub fn prepare(&mut self, device: &wgpu::Device, cut: Cut, layouts: [&wgpu::BindGroupLayout; 2]) {
        let clipped_entry = self.clipped_entry(device, cut);
        let made = if clipped_entry.is_some() { &mut self.clipped } else { &mut self.sampled };
        if made.is_some() {
            return;
        }
        let (source, entries) = match clipped_entry {
            Some(entry) => (clipped_shader(), ["clipped_cut_face_vertex", entry]),
            None => (shader(), ["cut_face_vertex", self.paint.entry]),
        };
        let module = module(device, "cut_face", &source);
        *made = Some([false, true].map(|inside_out| {
            let draws = Draws {
                module: &module,
                label: "cut_face",
                groups: &layouts.map(Some),
                entries,
                inside_out: Some(inside_out),
                has_samples: clipped_entry.is_none(),
                depth: wgpu::CompareFunction::Greater,
                stencil: counted(inside_out),
                target: self.paint.format.into(),
            };
            pipeline(device, self.samples, &draws)
        }));
    }

    /// The entry point by distances, where a frame that is cut in that way is to use it.
    fn clipped_entry(&self, device: &wgpu::Device, cut: Cut) -> Option<&'static str> {
        let clips = cut == Cut::Clipped && device.features().contains(wgpu::Features::CLIP_DISTANCES);
        self.paint.clipped_entry.filter(|_| clips)
    }

    /// Records the cut faces, before all else in a render pass, of which the frame's group is set.
    pub fn record(&self, pass: &mut wgpu::RenderPass<'_>, list: &DrawList<'_>) {
        let clipped = self.clipped.as_ref().filter(|_| list.asked.cut == Cut::Clipped);
        let Some(pipelines) = clipped.or(self.sampled.as_ref()) else { return };
        pass.set_stencil_reference(STENCIL_START);
        for (inside_out, pipeline) in [false, true].into_iter().zip(pipelines) {
            pass.set_pipeline(pipeline);
            for batch in list.batches {
                draw_ranges(pass, batch, batch.cut_faces_of(inside_out));
            }
        }
        for pipeline in [&self.empty, &self.shut] {
            pass.set_pipeline(pipeline);
            pass.draw(0..3, 0..1);
        }
    }

    /// Records the depths of the cut faces, after all else in the same pass.
    pub fn settle(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_pipeline(&self.settle);
        pass.draw(0..3, 0..1);
    }
}

/// Draws where the count has that relation to its start, seen from there, and leaves it.
fn where_count_is(compare: wgpu::CompareFunction) -> wgpu::StencilState {
    stencil(compare, [wgpu::StencilOperation::Keep; 2])
}

/// Counts backs up and fronts down.
fn counted(inside_out: bool) -> wgpu::StencilState {
    use wgpu::StencilOperation as Operation;
    let [front, back] = [Operation::DecrementWrap, Operation::IncrementWrap];
    stencil(wgpu::CompareFunction::Always, if inside_out { [back, front] } else { [front, back] })
}

/// What is done for fronts and for backs, whether they are the nearest or not.
fn stencil(compare: wgpu::CompareFunction, ops: [wgpu::StencilOperation; 2]) -> wgpu::StencilState {
    let [front, back] = ops.map(|op| wgpu::StencilFaceState {
        compare,
        fail_op: wgpu::StencilOperation::Keep,
        depth_fail_op: op,
        pass_op: op,
    });
    wgpu::StencilState { front, back, read_mask: 0xFF, write_mask: 0xFF }
}

fn pipeline(device: &wgpu::Device, samples: u32, draws: &Draws<'_>) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(draws.label),
        bind_group_layouts: draws.groups,
        immediate_size: 0,
    });
    let [vertex, fragment] = draws.entries;
    let vertices = [Some(active_vertices())];
    // Constants that an entry point does not use may not be given.
    let turned = [("TURNED", f64::from(u32::from(draws.inside_out == Some(true))))];
    let turned: &[_] = if draws.inside_out.is_some() { &turned } else { &[] };
    let sampled = [("SAMPLES", f64::from(samples))];
    let sampled: &[_] = if draws.has_samples { &sampled } else { &[] };
    let options = |constants| wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(draws.label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: draws.module,
            entry_point: Some(vertex),
            compilation_options: options(turned),
            buffers: if draws.inside_out.is_some() { &vertices } else { &[] },
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            depth_compare: Some(draws.depth),
            stencil: draws.stencil.clone(),
            ..depth_state(device, true)
        }),
        multisample: wgpu::MultisampleState { count: samples, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module: draws.module,
            entry_point: Some(fragment),
            compilation_options: options(&[turned, sampled].concat()),
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
    fn the_shader_is_valid() {
        let clips = naga::valid::Capabilities::CLIP_DISTANCES;
        for (source, capabilities) in
            [(shader(), naga::valid::Capabilities::empty()), (clipped_shader(), clips)]
        {
            let module = naga::front::wgsl::parse_str(&source)
                .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
            let flags = naga::valid::ValidationFlags::all();
            naga::valid::Validator::new(flags, capabilities)
                .validate(&module)
                .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
        }
    }
}
