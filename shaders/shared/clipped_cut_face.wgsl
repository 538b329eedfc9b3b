// clipped_cut_face: cut_face for devices that clip by distances, while there are at most MOST_CLIPPED sections.
//
// Follows shared/clipped.wgsl and cut_face.wgsl. What lies before the sections that lines of sight come in by is gone before
// it is made into pixels, so that to count costs no test of samples.

struct ClippedCutFaceCorner {
    @builtin(position) clip: vec4<f32>,
    @builtin(clip_distances) distances: array<f32, MOST_CLIPPED>,
    @location(0) relative: vec3<f32>,
    @location(1) colour: vec3<f32>,
    @location(2) @interpolate(flat) number: u32,
}

@vertex
fn clipped_cut_face_vertex(@location(0) active_vertex: vec4<u32>) -> ClippedCutFaceCorner {
    let corner = cut_face_corner(active_vertex);
    var distances = distances_of(corner.relative);
    for (var i = 0u; i < MOST_CLIPPED; i += 1u) {
        distances[i] = select(1.0, distances[i], frame.entries[i].w < NONE_ENTERS);
    }
    return ClippedCutFaceCorner(corner.clip, distances, corner.relative, corner.colour, corner.number);
}

struct ClippedCutFacePixel {
    @location(0) colour: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn clipped_cut_face_fragment(
    corner: CutFaceCorner,
    @builtin(front_facing) front: bool,
) -> ClippedCutFacePixel {
    return ClippedCutFacePixel(painted(corner, front), depth_of(corner, front));
}
