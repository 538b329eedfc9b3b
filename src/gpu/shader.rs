//! WGSL in, kernels out: what a pass declares as data becomes pipelines and dispatches.
//!
//! A [`Shader`] names its pieces, the shared files first, and its kernels with their bindings. There is no
//! preprocessor: the source is the concatenation. `tests/shaders.rs` compares every declaration here with what naga
//! reads from the source.

use super::Gpu;

/// A WGSL module as data.
#[derive(Debug, Clone, Copy)]
pub struct Shader {
    /// The word of its pass.
    pub name: &'static str,
    /// The files that it is made of, in order.
    pub pieces: &'static [&'static str],
    /// Its compute entry points.
    pub kernels: &'static [KernelLayout],
}

/// A compute entry point as data.
#[derive(Debug, Clone, Copy)]
pub struct KernelLayout {
    /// Entry point, label, and everything else that is a name.
    pub name: &'static str,
    /// What it binds, all in group 0, in the order in which [`Kernel::dispatch`] takes the buffers.
    pub bindings: &'static [Binding],
}

/// One bound buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Binding {
    /// `@binding` in the source.
    pub slot: u32,
    /// How it is used.
    pub access: Access,
}

/// How a buffer is bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// `var<uniform>`.
    Uniform,
    /// `var<storage, read>`.
    Read,
    /// `var<storage, read_write>`.
    Write,
}

/// `@binding(slot) var<uniform>`.
pub const fn uniform(slot: u32) -> Binding {
    Binding { slot, access: Access::Uniform }
}

/// `@binding(slot) var<storage, read>`.
pub const fn read(slot: u32) -> Binding {
    Binding { slot, access: Access::Read }
}

/// `@binding(slot) var<storage, read_write>`.
pub const fn write(slot: u32) -> Binding {
    Binding { slot, access: Access::Write }
}

impl Shader {
    /// The whole source.
    pub fn source(&self) -> String {
        self.pieces.concat()
    }

    /// Compiles the source once, and makes a pipeline of each kernel, in the order of [`Shader::kernels`].
    ///
    /// A source that does not compile is a bug that shows at the next [`Gpu::check`].
    pub fn kernels(&self, gpu: &Gpu) -> Vec<Kernel> {
        let module = self.module(gpu);
        self.kernels.iter().map(|layout| Kernel::new(gpu, &module, layout)).collect()
    }

    /// Compiles the source.
    pub fn module(&self, gpu: &Gpu) -> wgpu::ShaderModule {
        gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(self.name),
            source: wgpu::ShaderSource::Wgsl(self.source().into()),
        })
    }
}

/// A compute pipeline that knows its bindings.
#[derive(Debug)]
pub struct Kernel {
    layout: KernelLayout,
    bind_group_layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl Kernel {
    fn new(gpu: &Gpu, module: &wgpu::ShaderModule, layout: &KernelLayout) -> Self {
        let entries: Vec<_> = layout.bindings.iter().map(layout_entry).collect();
        let bind_group_layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(layout.name),
            entries: &entries,
        });
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(layout.name),
            bind_group_layouts: &[Some(&bind_group_layout)],
            immediate_size: 0,
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(layout.name),
            layout: Some(&pipeline_layout),
            module,
            entry_point: Some(layout.name),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Self { layout: *layout, bind_group_layout, pipeline }
    }

    /// Records `groups` workgroups over these buffers, one for each binding in the order of the layout.
    ///
    /// More workgroups than fit one dimension are laid out in two (`shaders/shared/index.wgsl`): the kernel may then
    /// run for some groups beyond, and must guard by its counts. No groups: nothing is recorded.
    pub fn dispatch(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        buffers: &[&wgpu::Buffer],
        groups: u32,
    ) {
        assert_eq!(buffers.len(), self.layout.bindings.len(), "buffers for kernel {}", self.layout.name);
        if groups == 0 {
            return;
        }
        let (x, y) = spread(groups, gpu.limits.max_compute_workgroups_per_dimension);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bind(gpu, buffers), &[]);
        pass.dispatch_workgroups(x, y, 1);
    }

    fn bind(&self, gpu: &Gpu, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
        let bound = self.layout.bindings.iter().zip(buffers);
        let entries: Vec<_> = bound
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding: binding.slot,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.layout.name),
            layout: &self.bind_group_layout,
            entries: &entries,
        })
    }
}

/// The array of a known number of kernels.
pub(crate) fn kernels<const N: usize>(gpu: &Gpu, shader: &Shader) -> [Kernel; N] {
    let kernels = shader.kernels(gpu);
    let count = kernels.len();
    // A pass and its own declaration disagree: the first test that makes the pass finds it.
    kernels.try_into().unwrap_or_else(|_| panic!("shader {} has {count} kernels, not {N}", shader.name))
}

fn layout_entry(binding: &Binding) -> wgpu::BindGroupLayoutEntry {
    let ty = match binding.access {
        Access::Uniform => wgpu::BufferBindingType::Uniform,
        Access::Read => wgpu::BufferBindingType::Storage { read_only: true },
        Access::Write => wgpu::BufferBindingType::Storage { read_only: false },
    };
    wgpu::BindGroupLayoutEntry {
        binding: binding.slot,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}

/// At least `groups` workgroups in two dimensions of at most `limit` each.
fn spread(groups: u32, limit: u32) -> (u32, u32) {
    let rows = groups.div_ceil(limit.max(1));
    (groups.div_ceil(rows), rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn spread_covers_and_fits(groups in 1u32..=65_535 * 4_096) {
            let (x, y) = spread(groups, 65_535);
            prop_assert!(x <= 65_535 && y <= 65_535);
            prop_assert!(u64::from(x) * u64::from(y) >= u64::from(groups));
            prop_assert!(u64::from(x) * u64::from(y) < u64::from(groups) + u64::from(y));
        }
    }
}
