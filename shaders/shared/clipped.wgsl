// clipped: the vertices of the draw pass with their distances to the sections, for devices that clip by them.
//
// Follows draw.wgsl. What a section takes away is gone before it is made into pixels: it costs a few products a vertex,
// and pixels are tested for depth before they are shaded, which those that choose their samples cannot be.

// The most sections that are clipped by.
const MOST_CLIPPED: u32 = 8u;

struct ClippedCorner {
    @builtin(position) clip: vec4<f32>,
    @builtin(clip_distances) distances: array<f32, MOST_CLIPPED>,
    @location(0) relative: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) colour: vec3<f32>,
    @location(3) @interpolate(flat) number: u32,
    @location(4) @interpolate(flat) look: u32,
}

struct ClippedEdgedCorner {
    @builtin(position) clip: vec4<f32>,
    @builtin(clip_distances) distances: array<f32, MOST_CLIPPED>,
    @location(0) relative: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) colour: vec3<f32>,
    @location(3) @interpolate(flat) number: u32,
    @location(4) @interpolate(flat) look: u32,
    @location(5) place: vec3<f32>,
    @location(6) @interpolate(flat) lines: u32,
}

// Below 0 where a section takes a point away. All of them, for a bound that is a constant is unrolled: distances stored by a
// number that is no constant cost processors that draw four times as much.
fn distances_of(relative: vec3<f32>) -> array<f32, MOST_CLIPPED> {
    var distances: array<f32, MOST_CLIPPED>;
    for (var i = 0u; i < MOST_CLIPPED; i += 1u) {
        distances[i] = dot(frame.sections[i].xyz, relative) + frame.sections[i].w;
    }
    return distances;
}

fn clipped(corner: Corner) -> ClippedCorner {
    return ClippedCorner(
        corner.clip, distances_of(corner.relative), corner.relative, corner.normal, corner.colour, corner.number,
        corner.look,
    );
}

@vertex
fn clipped_draw_vertex(@location(0) active_vertex: vec4<u32>) -> ClippedCorner {
    return clipped(placed(active_vertex));
}

@vertex
fn clipped_box_vertex(
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) number: u32,
) -> ClippedCorner {
    return clipped(box_corner(index, number));
}

@vertex
fn clipped_edged_vertex(@builtin(vertex_index) index: u32) -> ClippedEdgedCorner {
    let edged = edged_corner(index);
    return ClippedEdgedCorner(
        edged.clip, distances_of(edged.relative), edged.relative, edged.normal, edged.colour, edged.number,
        edged.look, edged.place, edged.lines,
    );
}
