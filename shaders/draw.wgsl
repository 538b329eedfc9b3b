// draw: the active triangles of one batch, lit, and the background behind them.
//
// Reads   the frame (uniform), one row per instance of the batch, active vertices (vertex buffer) and the index
//         buffer with its indirect arguments.
// Writes  colour (linear light; the target is sRGB) and reversed depth.
// Before  reform, which wrote the index buffer. After: nothing; the picture is read back or shown.
//
// Positions are camera-relative from the first sum on: the eye and each translation come as a high and a low f32,
// and the highs cancel exactly where the camera is near.

struct Frame {
    clip_from_relative: mat4x4<f32>,
    eye_high: vec3<f32>,
    // What to show: MODE_*.
    mode: u32,
    eye_low: vec3<f32>,
    unused_0: u32,
    // Unit directions in world space: to the key light, and out of the two sides of the camera.
    to_key: vec3<f32>,
    unused_1: u32,
    to_rim: vec3<f32>,
    unused_2: u32,
}

struct InstanceRow {
    // Column i of the linear part times the grid step; w is component i of the translation's high part.
    column_0: vec4<f32>,
    column_1: vec4<f32>,
    column_2: vec4<f32>,
    // The translation's low part; the word holds sRGB in 24 bits (red lowest) and COLOURED.
    translation_low: vec3<f32>,
    colour: u32,
}

const MODE_MATERIAL: u32 = 0u;
const MODE_INSTANCE: u32 = 1u;

// Bit of InstanceRow.colour: the vertices carry colours.
const COLOURED: u32 = 1u << 24u;

@group(0) @binding(0) var<uniform> frame: Frame;
@group(1) @binding(0) var<storage, read> instances: array<InstanceRow>;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    // Relative to the eye, in world axes.
    @location(0) relative: vec3<f32>,
    @location(1) normal: vec3<f32>,
    // Linear light.
    @location(2) colour: vec3<f32>,
}

fn grid_position(low: u32, high: u32) -> vec3<f32> {
    let mask = (1u << 21u) - 1u;
    return vec3<f32>(vec3<u32>(low & mask, ((low >> 21u) | (high << 11u)) & mask, (high >> 10u) & mask));
}

// The direction (of any length) that a point of the octahedron stands for: inverse of Meyer et al. 2010.
fn unfold(folded: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - abs(folded.x) - abs(folded.y);
    let inside = max(-z, 0.0);
    return vec3<f32>(folded - select(vec2<f32>(-inside), vec2<f32>(inside), folded >= vec2<f32>(0.0)), z);
}

fn linear_from_srgb(srgb: vec3<f32>) -> vec3<f32> {
    let curved = pow((srgb + 0.055) / 1.055, vec3<f32>(2.4));
    return select(curved, srgb / 12.92, srgb <= vec3<f32>(0.04045));
}

fn colour_from_8888(word: u32) -> vec3<f32> {
    return linear_from_srgb(unpack4x8unorm(word).rgb);
}

fn colour_from_565(word: u32) -> vec3<f32> {
    let parts = vec3<f32>(vec3<u32>(word >> 27u, (word >> 21u) & 63u, (word >> 16u) & 31u));
    return linear_from_srgb(parts / vec3<f32>(31.0, 63.0, 31.0));
}

// Normals transform by the cofactors of the linear part, which exist where an inverse does not. Columns are scaled
// to about one first: products of small grid steps underflow.
fn world_normal(row: InstanceRow, normal: vec3<f32>) -> vec3<f32> {
    let largest = max(max(max_abs(row.column_0.xyz), max_abs(row.column_1.xyz)), max_abs(row.column_2.xyz));
    let scale = select(0.0, 1.0 / largest, largest > 0.0);
    let a = row.column_0.xyz * scale;
    let b = row.column_1.xyz * scale;
    let c = row.column_2.xyz * scale;
    return safe_normalize(cross(b, c) * normal.x + cross(c, a) * normal.y + cross(a, b) * normal.z);
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

// Distinct, mid-bright colours for small integers.
fn debug_colour(number: u32) -> vec3<f32> {
    let hash = (number + 1u) * 2654435769u;
    let mixed = (hash ^ (hash >> 15u)) * 2246822519u;
    return linear_from_srgb(0.35 + 0.6 * unpack4x8unorm(mixed ^ (mixed >> 13u)).rgb);
}

@vertex
fn draw_vertex(@location(0) active_vertex: vec4<u32>) -> Corner {
    let instance = active_vertex.w;
    let row = instances[instance];
    let grid = grid_position(active_vertex.x, active_vertex.y);
    let offset = row.column_0.xyz * grid.x + row.column_1.xyz * grid.y + row.column_2.xyz * grid.z;
    let translation_high = vec3<f32>(row.column_0.w, row.column_1.w, row.column_2.w);
    let origin = (translation_high - frame.eye_high) + (row.translation_low - frame.eye_low);
    let coloured = (row.colour & COLOURED) != 0u;
    let attributes = active_vertex.z;
    let folded = select(unpack2x16snorm(attributes), unpack4x8snorm(attributes).xy, coloured);

    var corner: Corner;
    corner.relative = offset + origin;
    corner.clip = frame.clip_from_relative * vec4<f32>(corner.relative, 1.0);
    corner.normal = world_normal(row, unfold(folded));
    if frame.mode == MODE_INSTANCE {
        corner.colour = debug_colour(instance);
    } else if coloured {
        corner.colour = colour_from_565(attributes);
    } else {
        corner.colour = colour_from_8888(row.colour);
    }
    return corner;
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

// A warm key over the camera's shoulder, a cool one from behind the other, and light from a bright sky over a
// light floor.
fn light(base: vec3<f32>, n: vec3<f32>, to_eye: vec3<f32>) -> vec3<f32> {
    let key = max(dot(n, frame.to_key), 0.0);
    let rim = max(dot(n, frame.to_rim), 0.0);
    let sky = mix(vec3<f32>(0.23, 0.22, 0.215), vec3<f32>(0.42, 0.46, 0.52), 0.5 + 0.5 * n.y);
    let diffuse = sky + vec3<f32>(0.78, 0.75, 0.70) * key + vec3<f32>(0.10, 0.13, 0.17) * rim;
    let half_way = normalize(frame.to_key + to_eye);
    let gloss = 0.16 * pow(max(dot(n, half_way), 0.0), 48.0);
    let grazing = pow(1.0 - clamp(dot(n, to_eye), 0.0, 1.0), 5.0);
    let reflected = vec3<f32>(0.30, 0.34, 0.40) * (0.02 + 0.5 * grazing) * (0.5 + 0.5 * n.y);
    return base * diffuse + reflected + gloss;
}

// Keeps what is below 0.7 and bends the rest towards 1, so that highlights do not clip.
fn shoulder(colour: vec3<f32>) -> vec3<f32> {
    let above = max(colour - 0.7, vec3<f32>(0.0));
    return min(colour, vec3<f32>(0.7)) + 0.3 * (above / (above + 0.3));
}

@fragment
fn draw_fragment(corner: Corner) -> @location(0) vec4<f32> {
    let facet = safe_normalize(cross(dpdx(corner.relative), dpdy(corner.relative)));
    let to_eye = safe_normalize(-corner.relative);
    let n = facing_normal(corner.normal, facet, to_eye);
    return vec4<f32>(shoulder(light(corner.colour, n, to_eye)), 1.0);
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
