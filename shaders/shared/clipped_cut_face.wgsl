// clipped_cut_face: cut_face for devices that clip by distances, while there are at most MOST_CLIPPED sections.
//
// Follows shared/clipped.wgsl and cut_face.wgsl. What lies before the sections that lines of sight come in by is gone before
// it is made into pixels, so that to count costs no test of samples.

@vertex
fn clipped_cut_face_vertex(@location(0) active_vertex: vec4<u32>) -> ClippedCorner {
    var corner = clipped(closed_corner(active_vertex));
    for (var i = 0u; i < MOST_CLIPPED; i += 1u) {
        corner.distances[i] = select(1.0, corner.distances[i], frame.entries[i].w < NONE_ENTERS);
    }
    return corner;
}

@fragment
fn clipped_count_fragment(corner: Corner, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    return counted(corner, front);
}

@fragment
fn clipped_cut_face_fragment(corner: Corner, @builtin(front_facing) front: bool) -> CutPixel {
    let right = dpdx(corner.relative);
    let down = dpdy(corner.relative);
    return painted(corner, samples_of_cut_face(corner, front, 15u, right, down));
}
