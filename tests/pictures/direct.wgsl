// direct: corners that the host has placed, for the comparison with what is drawn of a container.
//
// Follows shaders/shared/surface.wgsl, whose pixels it shares.

struct Placed {
    // Relative to the eye, in world axes.
    @location(0) relative: vec3<f32>,
    // In world axes, of length 1 or 0.
    @location(1) normal: vec3<f32>,
    @location(2) srgb: vec3<f32>,
}

@vertex
fn direct_vertex(placed: Placed) -> Corner {
    var corner: Corner;
    corner.relative = placed.relative;
    corner.clip = frame.clip_from_relative * vec4<f32>(placed.relative, 1.0);
    corner.normal = placed.normal;
    corner.colour = linear_from_srgb(placed.srgb);
    corner.number = 0u;
    corner.look = 0u;
    return corner;
}
