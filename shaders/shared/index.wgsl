// index: the number of a workgroup when the groups are laid out in two dimensions (Kernel::dispatch on the host).

fn group_number(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.y * groups.x + group.x;
}

