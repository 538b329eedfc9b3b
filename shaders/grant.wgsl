// grant: takes the new budgets of the instances that changed, and finds how much of each is streamed.
//
// Reads:   grants (at most one an instance)
// Writes:  the budgets, and the streamed counts, of the granted instances only
// Before:  nothing (the host clears the streamed counts);  after: prefix_sum over all six lists
//
// Peng & Cao 2012, algorithm 3, where the counts are collected on the host: here only the changes travel.

struct Grant {
    instance: u32,
    // A new count each; FRESH set means that nothing of the existing block is kept.
    vertices: u32,
    ecol: u32,
    triangles: u32,
}

struct GrantParams {
    grant_count: u32,
    instance_count: u32,
}

const FRESH: u32 = 0x80000000u;

@group(0) @binding(0) var<uniform> params: GrantParams;
@group(0) @binding(1) var<storage, read> grants: array<Grant>;
@group(0) @binding(2) var<storage, read_write> vertex_budget: array<u32>;
@group(0) @binding(3) var<storage, read_write> ecol_budget: array<u32>;
@group(0) @binding(4) var<storage, read_write> triangle_budget: array<u32>;
@group(0) @binding(5) var<storage, read_write> streamed_vertices: array<u32>;
@group(0) @binding(6) var<storage, read_write> streamed_ecol: array<u32>;
@group(0) @binding(7) var<storage, read_write> streamed_triangles: array<u32>;

fn streamed_count(granted: u32, existing: u32) -> u32 {
    let count = granted & ~FRESH;
    return select(saturating_sub(count, existing), count, (granted & FRESH) != 0u);
}

@compute @workgroup_size(64)
fn grant(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group_number(group_id, groups) * 64u + lane;
    if index >= params.grant_count {
        return;
    }
    let granted = grants[index];
    let i = granted.instance;
    if i >= params.instance_count {
        return;
    }
    streamed_vertices[i] = streamed_count(granted.vertices, vertex_budget[i]);
    streamed_ecol[i] = streamed_count(granted.ecol, ecol_budget[i]);
    streamed_triangles[i] = streamed_count(granted.triangles, triangle_budget[i]);
    vertex_budget[i] = granted.vertices & ~FRESH;
    ecol_budget[i] = granted.ecol & ~FRESH;
    triangle_budget[i] = granted.triangles & ~FRESH;
}
