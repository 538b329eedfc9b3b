// surface: the frame, what a lit corner is, and the colour of its pixels and of the background behind them.
//
// Needs from the pass: a vertex entry point that returns a `Corner`. `tests/pictures/direct.wgsl` has another one, so
// that what is drawn of a container can be compared with its input under the same light.

struct Frame {
    clip_from_relative: mat4x4<f32>,
    eye_high: vec3<f32>,
    // What to show: MODE_*.
    mode: u32,
    eye_low: vec3<f32>,
    // 1 without perspective.
    parallel: u32,
    // Unit directions in world space: to the key light, and out of the two sides of the camera.
    to_key: vec3<f32>,
    // How many of the sections are used.
    section_count: u32,
    to_rim: vec3<f32>,
    // Half the width of lines, in pixels.
    line_px: f32,
    // Backwards along the view; where everything is seen from, without perspective.
    to_viewer: vec3<f32>,
    // Which edges are drawn: EDGES_*.
    edges: u32,
    // Planes relative to the eye, in world axes, unit normals; what is kept has dot(xyz, p) + w >= 0 for all. Those that
    // are not used keep everything.
    sections: array<vec4<f32>, 12>,
    // By section: the less dot(xyz, p) + w, the later the line of sight to p came in by it. 3e38 or more if none does.
    entries: array<vec4<f32>, 12>,
}

@group(0) @binding(0) var<uniform> frame: Frame;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    // Relative to the eye, in world axes.
    @location(0) relative: vec3<f32>,
    @location(1) normal: vec3<f32>,
    // Linear light.
    @location(2) colour: vec3<f32>,
    // The number of the instance in the scene.
    @location(3) @interpolate(flat) number: u32,
    // LOOK_* in `draw.wgsl`; 0 is nothing special.
    @location(4) @interpolate(flat) look: u32,
}

// The unit direction to where a corner is seen from.
fn to_eye_from(relative: vec3<f32>) -> vec3<f32> {
    if frame.parallel != 0u {
        return frame.to_viewer;
    }
    return safe_normalize(-relative);
}

fn linear_from_srgb(srgb: vec3<f32>) -> vec3<f32> {
    let curved = pow((srgb + 0.055) / 1.055, vec3<f32>(2.4));
    return select(curved, srgb / 12.92, srgb <= vec3<f32>(0.04045));
}

fn max_abs(v: vec3<f32>) -> f32 {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}

// The vector at length 1, or zero where it has no direction. Infinities and NaNs fail the comparison, too.
fn safe_normalize(v: vec3<f32>) -> vec3<f32> {
    let largest = max_abs(v);
    if !(largest > 1e-30 && largest < 1e30) {
        return vec3<f32>(0.0);
    }
    return normalize(v / largest);
}

// Every surface has two sides: the normal is turned to the side of the facet that is seen, so that smooth normals
// keep their direction up to the silhouette. Where the facet has no direction the normal itself decides.
fn facing_normal(normal: vec3<f32>, facet: vec3<f32>, to_eye: vec3<f32>) -> vec3<f32> {
    let seen = select(facet, -facet, dot(facet, to_eye) < 0.0);
    let n = safe_normalize(normal);
    if dot(n, n) == 0.0 {
        return select(seen, to_eye, dot(seen, seen) == 0.0);
    }
    let side = select(dot(n, seen), dot(n, to_eye), dot(seen, seen) == 0.0);
    return select(n, -n, side < 0.0);
}

// A warm key from the camera's upper left, a weaker light at the camera itself, a cool one from behind the right, and a
// bright sky over a darker floor: the three sides of a box that are seen together differ clearly, whichever they are,
// and a white surface stays below white.
fn light(base: vec3<f32>, n: vec3<f32>, to_eye: vec3<f32>) -> vec3<f32> {
    let key = max(dot(n, frame.to_key), 0.0);
    let rim = max(dot(n, frame.to_rim), 0.0);
    let front = max(dot(n, to_eye), 0.0);
    let sky = mix(vec3<f32>(0.15, 0.145, 0.14), vec3<f32>(0.26, 0.28, 0.31), 0.5 + 0.5 * n.y);
    let diffuse = sky + vec3<f32>(0.66, 0.64, 0.60) * key + 0.17 * front + vec3<f32>(0.08, 0.10, 0.13) * rim;
    let half_way = normalize(frame.to_key + to_eye);
    let gloss = 0.12 * pow(max(dot(n, half_way), 0.0), 48.0);
    let grazing = pow(1.0 - clamp(dot(n, to_eye), 0.0, 1.0), 5.0);
    let reflected = vec3<f32>(0.30, 0.34, 0.40) * (0.02 + 0.5 * grazing) * (0.5 + 0.5 * n.y);
    return base * diffuse + reflected + gloss;
}

// Keeps what is below 0.7 and bends the rest towards 1, so that highlights do not clip.
fn shoulder(colour: vec3<f32>) -> vec3<f32> {
    let above = max(colour - 0.7, vec3<f32>(0.0));
    return min(colour, vec3<f32>(0.7)) + 0.3 * (above / (above + 0.3));
}

// The normal of a surface at a pixel. Only in uniform control flow.
fn seen_normal(relative: vec3<f32>, normal: vec3<f32>, to_eye: vec3<f32>) -> vec3<f32> {
    let facet = safe_normalize(cross(dpdx(relative), dpdy(relative)));
    return facing_normal(normal, facet, to_eye);
}

fn lit(colour: vec3<f32>, n: vec3<f32>, to_eye: vec3<f32>) -> vec4<f32> {
    return vec4<f32>(shoulder(light(colour, n, to_eye)), 1.0);
}

fn shaded(relative: vec3<f32>, normal: vec3<f32>, colour: vec3<f32>) -> vec4<f32> {
    let to_eye = to_eye_from(relative);
    return lit(colour, seen_normal(relative, normal, to_eye), to_eye);
}

@fragment
fn draw_fragment(corner: Corner) -> @location(0) vec4<f32> {
    return shaded(corner.relative, corner.normal, corner.colour);
}

struct Backdrop {
    @builtin(position) clip: vec4<f32>,
    // 0 at the lower edge of the picture, 1 at the upper.
    @location(0) height: f32,
}

// One triangle over the whole picture, at infinity.
@vertex
fn background_vertex(@builtin(vertex_index) index: u32) -> Backdrop {
    let corner = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return Backdrop(vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0), corner.y);
}

@fragment
fn background_fragment(backdrop: Backdrop) -> @location(0) vec4<f32> {
    let low = vec3<f32>(0.925, 0.93, 0.935);
    let high = vec3<f32>(0.66, 0.73, 0.82);
    return vec4<f32>(linear_from_srgb(mix(low, high, smoothstep(0.0, 1.0, backdrop.height))), 1.0);
}
