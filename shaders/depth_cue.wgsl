// depth_cue: darkens what lies behind an edge in depth, after eye-dome lighting (Boucheny 2009).
//
// Reads   the depth of the picture, and of its samples where it has several.
// Writes  a factor that the picture is multiplied by.
// After   draw.

struct DepthCue {
    // 1 without perspective: depth is linear then.
    parallel: u32,
    // How far around a pixel is looked, in pixels.
    radius_px: f32,
    strength: f32,
    // Without perspective: what a difference in depth counts.
    depth_scale: f32,
}

@group(0) @binding(0) var<uniform> cue: DepthCue;
@group(0) @binding(1) var depth: DEPTH_TEXTURE;

// log2 of the distance, up to a constant; far away for the background.
fn log2_distance(at: vec2<i32>, sample: i32) -> f32 {
    let size = vec2<i32>(textureDimensions(depth));
    let stored = textureLoad(depth, clamp(at, vec2<i32>(0), size - 1), sample);
    if stored <= 0.0 {
        return 1e4;
    }
    return select(-log2(stored), -stored * cue.depth_scale, cue.parallel != 0u);
}

@vertex
fn depth_cue_vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
}

// By how much the neighbours of a sample in four directions stand before it.
fn obscured(at: vec2<i32>, sample: i32, turn: f32) -> f32 {
    let here = log2_distance(at, sample);
    if here >= 1e4 {
        return 0.0;
    }
    var sum = 0.0;
    for (var ring = 1; ring <= 2; ring += 1) {
        let radius = cue.radius_px * f32(ring * ring) * 0.5;
        for (var i = 0; i < 4; i += 1) {
            let angle = turn + f32(i) * 1.5707963 + f32(ring) * 0.7853982;
            let there = log2_distance(at + vec2<i32>(round(radius * vec2<f32>(cos(angle), sin(angle)))), sample);
            // What stands far before hides, but does not darken more than what stands a little before.
            sum += min(max(here - there, 0.0), 0.08);
        }
    }
    return sum;
}

@fragment
fn depth_cue_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    var sum = 0.0;
    for (var sample = 0; sample < SAMPLE_COUNT; sample += 1) {
        sum += obscured(at, sample, f32(sample) * 0.3926991);
    }
    let factor = exp(-cue.strength * sum / f32(SAMPLE_COUNT));
    return vec4<f32>(vec3<f32>(factor), 1.0);
}
