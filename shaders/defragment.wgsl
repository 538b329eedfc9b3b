// defragment: builds contiguous active blocks from what exists on the GPU and what was streamed this frame.
//
// Reads:   the three start lists of one stream, its existing buffer, the streamed words
// Writes:  its active buffer
// Before:  prefix_sum;  after: reform (ecol, triangles), draw (vertices)
//
// Peng & Cao 2012, algorithm 3 and figure 6: of an instance's `a` active elements, of which `s` were streamed, the
// first a - s are kept from its existing block, the rest come from its streamed block.
//
// Streamed words: vertices of 3 words, then ecol of 16 bits packed two a word (low half first), then triangles of 2
// words, each part at its base.

struct DefragmentParams {
    instance_count: u32,
    // Active elements in all.
    vertex_total: u32,
    ecol_total: u32,
    triangle_total: u32,
    // Where each part of the streamed words begins.
    vertex_base: u32,
    ecol_base: u32,
    triangle_base: u32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> params: DefragmentParams;
@group(0) @binding(1) var<storage, read> start: array<u32>;
@group(0) @binding(2) var<storage, read> existing_start: array<u32>;
@group(0) @binding(3) var<storage, read> streamed_start: array<u32>;
@group(0) @binding(4) var<storage, read> streamed: array<u32>;
// An active vertex: the three words of its record, then the number of its instance.
@group(0) @binding(5) var<storage, read> existing_vertices: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read_write> active_vertices: array<vec4<u32>>;
@group(0) @binding(7) var<storage, read> existing_ecol: array<u32>;
@group(0) @binding(8) var<storage, read_write> active_ecol: array<u32>;
@group(0) @binding(9) var<storage, read> existing_triangles: array<vec2<u32>>;
@group(0) @binding(10) var<storage, read_write> active_triangles: array<vec2<u32>>;

// Where an active element comes from.
struct Origin {
    existing: bool,
    // In the existing buffer, or among the streamed elements of this stream.
    index: u32,
}

fn find_origin(element: u32, owner: u32) -> Origin {
    let offset = element - start[owner];
    let active_count = start[owner + 1u] - start[owner];
    let streamed_count = streamed_start[owner + 1u] - streamed_start[owner];
    let kept = saturating_sub(active_count, streamed_count);
    if offset < kept {
        return Origin(true, existing_start[owner] + offset);
    }
    return Origin(false, streamed_start[owner] + offset - kept);
}

@compute @workgroup_size(64)
fn defragment_vertices(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let group = group_number(group_id, groups);
    let owner = find_owner(group, lane, params.vertex_total, params.instance_count);
    let element = group * OWNER_GROUP + lane;
    if element >= params.vertex_total {
        return;
    }
    let origin = find_origin(element, owner);
    if origin.existing {
        active_vertices[element] = vec4<u32>(existing_vertices[origin.index].xyz, owner);
    } else {
        let word = params.vertex_base + 3u * origin.index;
        active_vertices[element] = vec4<u32>(streamed[word], streamed[word + 1u], streamed[word + 2u], owner);
    }
}

@compute @workgroup_size(64)
fn defragment_ecol(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let group = group_number(group_id, groups);
    let owner = find_owner(group, lane, params.ecol_total, params.instance_count);
    let element = group * OWNER_GROUP + lane;
    if element >= params.ecol_total {
        return;
    }
    let origin = find_origin(element, owner);
    if origin.existing {
        active_ecol[element] = existing_ecol[origin.index];
    } else {
        let word = streamed[params.ecol_base + origin.index / 2u];
        active_ecol[element] = (word >> (16u * (origin.index & 1u))) & 0xFFFFu;
    }
}

@compute @workgroup_size(64)
fn defragment_triangles(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let group = group_number(group_id, groups);
    let owner = find_owner(group, lane, params.triangle_total, params.instance_count);
    let element = group * OWNER_GROUP + lane;
    if element >= params.triangle_total {
        return;
    }
    let origin = find_origin(element, owner);
    if origin.existing {
        active_triangles[element] = existing_triangles[origin.index];
    } else {
        let word = params.triangle_base + 2u * origin.index;
        active_triangles[element] = vec2<u32>(streamed[word], streamed[word + 1u]);
    }
}
