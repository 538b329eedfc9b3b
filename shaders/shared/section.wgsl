// section: what section planes keep of a pixel, and where a line of sight came in by them.
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

const NO_ENTRY: u32 = 0xFFFFFFFFu;
// Rows of Frame.sections.
const MOST_SECTIONS: u32 = 12u;

// The section that the line of sight to a point came in by last; NO_ENTRY if it came in by none.
fn entry_before(relative: vec3<f32>) -> u32 {
    var least = NONE_ENTERS;
    var entry = NO_ENTRY;
    for (var i = 0u; i < frame.section_count; i += 1u) {
        let before = dot(frame.entries[i].xyz, relative) + frame.entries[i].w;
        entry = select(entry, i, before < least);
        least = min(least, before);
    }
    return entry;
}

// How far from a point towards the eye a section is that the line of sight came in by, in world units.
fn back_to(section: u32, relative: vec3<f32>, to_eye: vec3<f32>) -> f32 {
    let plane = frame.sections[section];
    return max((dot(plane.xyz, relative) + plane.w) / -dot(plane.xyz, to_eye), 0.0);
}

// The colour of a cut face at a pixel: lines at 45 degrees, as on a drawing.
fn hatched(colour: vec3<f32>, pixel: vec2<f32>) -> vec3<f32> {
    let across = fract((pixel.x + pixel.y) / 9.0);
    let line = 1.0 - smoothstep(0.08, 0.2, abs(across - 0.5));
    return mix(colour, colour * 0.45, 0.55 * line);
}
