// reform: replaces each corner of each active triangle by the vertex that it has collapsed onto, in the index buffer.
//
// Reads:   the start lists of triangles, vertices and ecol; active ecol; active triangles
// Writes:  indices, three a triangle, into the active vertices
// Before:  defragment;  after: draw
//
// Peng & Cao 2012, algorithm 4, counting from zero: a corner moves on while it is not below its instance's vertex
// count. An instance holds ecol for all vertices of its tier, of which only the first are active. Bad data, where a
// chain does not fall or leaves the tier, ends at the instance's vertex 0.

struct ReformParams {
    instance_count: u32,
    triangle_total: u32,
}

@group(0) @binding(0) var<uniform> params: ReformParams;
// Of triangles.
@group(0) @binding(1) var<storage, read> start: array<u32>;
@group(0) @binding(2) var<storage, read> vertex_start: array<u32>;
@group(0) @binding(3) var<storage, read> ecol_start: array<u32>;
@group(0) @binding(4) var<storage, read> active_ecol: array<u32>;
// Three indices of 16 bits, then flags.
@group(0) @binding(5) var<storage, read> active_triangles: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> indices: array<u32>;

struct Block {
    vertex_count: u32,
    ecol_first: u32,
    ecol_count: u32,
}

fn reform_corner(corner: u32, block: Block) -> u32 {
    var vertex = corner;
    while vertex >= block.vertex_count {
        if vertex >= block.ecol_count {
            return 0u;
        }
        let onto = active_ecol[block.ecol_first + vertex];
        if onto >= vertex {
            return 0u;
        }
        vertex = onto;
    }
    return vertex;
}

@compute @workgroup_size(64)
fn reform(
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
    let first = vertex_start[owner];
    let ecol_first = ecol_start[owner];
    let block = Block(vertex_start[owner + 1u] - first, ecol_first, ecol_start[owner + 1u] - ecol_first);
    let words = active_triangles[element];
    indices[3u * element] = first + reform_corner(words.x & 0xFFFFu, block);
    indices[3u * element + 1u] = first + reform_corner(words.x >> 16u, block);
    indices[3u * element + 2u] = first + reform_corner(words.y & 0xFFFFu, block);
}
