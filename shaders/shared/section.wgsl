// section: what section planes keep of a pixel.
//
// Follows surface.wgsl, whose frame has the planes. Whether lines of sight come in by a plane or leave by it is the same for
// all of them that have anything to show: it cuts the eye off, or it does not.

// Where the standard samples lie in their pixel, from its middle, in sixteenths of a pixel: x, and y downwards.
const SAMPLES_X = vec4<f32>(-2.0, 6.0, -6.0, 2.0);
const SAMPLES_Y = vec4<f32>(-6.0, -2.0, 2.0, 6.0);

// Samples a pixel.
override SAMPLES: u32 = 1u;

// No row of Frame.entries that lines of sight come in by is as great.
const NONE_ENTERS: f32 = 3e38;

// The samples of a pixel that all sections keep, a bit each. Only in uniform control flow.
fn kept_samples(relative: vec3<f32>) -> u32 {
    return samples_behind(relative, false);
}

// The same of the sections that lines of sight come in by.
fn entered_samples(relative: vec3<f32>) -> u32 {
    return samples_behind(relative, true);
}

// The same of all sections, or of those that lines of sight come in by.
fn samples_behind(relative: vec3<f32>, only_entered: bool) -> u32 {
    let right = dpdx(relative);
    let down = dpdy(relative);
    // By sample, the least distance to any plane.
    var least = vec4<f32>(3e38);
    for (var i = 0u; i < frame.section_count; i += 1u) {
        if only_entered && frame.entries[i].w >= NONE_ENTERS {
            continue;
        }
        let plane = frame.sections[i];
        let distance = dot(plane.xyz, relative) + plane.w;
        if SAMPLES == 4u {
            let slope = vec2<f32>(dot(plane.xyz, right), dot(plane.xyz, down)) / 16.0;
            least = min(least, vec4<f32>(distance) + slope.x * SAMPLES_X + slope.y * SAMPLES_Y);
        } else {
            least.x = min(least.x, distance);
        }
    }
    let bits = select(vec4<u32>(0u), vec4<u32>(1u, 2u, 4u, 8u), least >= vec4<f32>(0.0));
    return select(bits.x, bits.x | bits.y | bits.z | bits.w, SAMPLES == 4u);
}
