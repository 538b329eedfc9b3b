// pick: which instance is in one pixel, and where its surface is.
//
// Follows shared/surface.wgsl, shared/section.wgsl and draw.wgsl, whose vertices it shares; the frame's matrix makes the
// pixel the whole picture, so that the cost is that of the vertices and of one pixel, however large the model is.
//
// Writes  the number of the instance in the scene plus one, and the point relative to the eye, in world axes, as the bits
//         of three f32. What is hidden or cut away is not there.
// After   draw, of the same frame.

@fragment
fn pick_fragment(corner: Corner) -> @location(0) vec4<u32> {
    for (var i = 0u; i < frame.section_count; i += 1u) {
        if dot(frame.sections[i].xyz, corner.relative) + frame.sections[i].w < 0.0 {
            discard;
        }
    }
    return vec4<u32>(corner.number + 1u, bitcast<vec3<u32>>(corner.relative));
}
