//! Every shader is parsed and validated, and what the host declares about it is compared with what it says: no GPU.

use std::collections::HashSet;

use collapsar::gpu::layout::STRUCTS;
use collapsar::gpu::shader::{Access, Shader};
use collapsar::passes::SHADERS;
use naga::valid::{Capabilities, GlobalUse, ModuleInfo, ValidationFlags, Validator};

/// Structs that live inside a shader only.
const SHADER_ONLY: &[&str] = &["Origin", "Block", "Seen"];

fn validated(shader: &Shader) -> (naga::Module, ModuleInfo) {
    let source = shader.source();
    let module = naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string_with_path(&source, shader.name)));
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string_with_path(&source, shader.name)));
    (module, info)
}

#[test]
fn every_shader_is_valid_without_any_capability() {
    for shader in SHADERS {
        validated(shader);
    }
}

#[test]
fn structs_have_the_same_layout_on_host_and_gpu() {
    let mut seen = HashSet::new();
    for shader in SHADERS {
        let (module, _) = validated(shader);
        for (_, ty) in module.types.iter() {
            let (Some(name), naga::TypeInner::Struct { members, span }) = (&ty.name, &ty.inner) else {
                continue;
            };
            if name.starts_with("__") || SHADER_ONLY.contains(&name.as_str()) {
                continue;
            }
            let host = STRUCTS.iter().find(|host| host.name == name);
            let host = host.unwrap_or_else(|| panic!("{}: struct {name} is not in gpu::layout", shader.name));
            let offsets: Vec<_> =
                members.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize)).collect();
            assert_eq!(host.members, offsets, "members of {name}");
            assert_eq!(host.size, *span as usize, "size of {name}");
            seen.insert(host.name);
        }
    }
    for host in STRUCTS {
        assert!(seen.contains(host.name), "no shader has struct {}", host.name);
    }
}

/// The bindings that an entry point uses: slot, access.
fn used_bindings(module: &naga::Module, info: &ModuleInfo, entry: usize) -> Vec<(u32, Access)> {
    let uses = info.get_entry_point(entry);
    let mut used: Vec<_> = module
        .global_variables
        .iter()
        .filter(|(handle, _)| uses[*handle] != GlobalUse::empty())
        .filter_map(|(_, variable)| {
            let binding = variable.binding?;
            assert_eq!(binding.group, 0);
            let access = match variable.space {
                naga::AddressSpace::Uniform => Access::Uniform,
                naga::AddressSpace::Storage { access } if access == naga::StorageAccess::LOAD => Access::Read,
                naga::AddressSpace::Storage { .. } => Access::Write,
                other => panic!("binding {} in {other:?}", binding.binding),
            };
            Some((binding.binding, access))
        })
        .collect();
    used.sort_by_key(|binding| binding.0);
    used
}

#[test]
fn kernels_bind_what_their_entry_points_use_and_no_more_than_eight_storage_buffers() {
    for shader in SHADERS {
        let (module, info) = validated(shader);
        let entries: Vec<_> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(entries, shader.kernels.iter().map(|kernel| kernel.name).collect::<Vec<_>>());
        for (index, kernel) in shader.kernels.iter().enumerate() {
            let declared: Vec<_> = kernel.bindings.iter().map(|b| (b.slot, b.access)).collect();
            assert_eq!(declared, used_bindings(&module, &info, index), "bindings of {}", kernel.name);
            let storage = declared.iter().filter(|b| b.1 != Access::Uniform).count();
            assert!(storage <= 8, "{} has {storage} storage buffers", kernel.name);
        }
    }
}

#[test]
fn every_kernel_file_opens_with_its_card() {
    for shader in SHADERS {
        let own = shader.pieces.last().expect("a shader has a piece");
        let card =
            [format!("// {}: ", shader.name), "// Reads:".into(), "// Writes:".into(), "// Before:".into()];
        let head = own.lines().take_while(|line| line.starts_with("//")).collect::<Vec<_>>().join("\n");
        assert!(own.starts_with(&card[0]), "{} does not open with its name", shader.name);
        assert!(card.iter().all(|line| head.contains(line)), "{} lacks a line of its card", shader.name);
    }
}
