// draw: the active triangles of one batch, lit, boxes for what is not there, and the background behind them.
//
// Reads   the frame (uniform), one row and one look per instance of the batch, active vertices (vertex buffer) and the
//         index buffer with its indirect arguments. Where edges are drawn, vertices and indices are storage, and so are
//         the triangles' flags.
// Writes  colour (linear light; the target is sRGB) and reversed depth.
// Before  reform, which wrote the index buffer. After: nothing; the picture is read back or shown.
//
// shared/surface.wgsl has the frame, the light and the background; shared/section.wgsl what sections keep.
//
// Positions are camera-relative from the first sum on: the eye and each translation come as a high and a low f32,
// and the highs cancel exactly where the camera is near.

const MODE_MATERIAL: u32 = 0u;
const MODE_INSTANCE: u32 = 1u;

struct InstanceRow {
    // Column i of the linear part times the grid step; w is component i of the translation's high part.
    column_0: vec4<f32>,
    column_1: vec4<f32>,
    column_2: vec4<f32>,
    // The translation's low part; the word holds sRGB in 24 bits (red lowest) and COLOURED.
    translation_low: vec3<f32>,
    colour: u32,
}

// Bit of InstanceRow.colour: the vertices carry colours.
const COLOURED: u32 = 1u << 24u;
// Bit of InstanceRow.colour: the vertices carry slots; the low 24 bits are the number of the row with slot 0's colour.
// Its vertices have normals of 2 x 12 bits and slots of 8.
const SLOTTED: u32 = 1u << 25u;

// Bits of InstanceRow.colour: the surface is closed; it is placed inside out, by a mirror or as it is.
const CLOSED: u32 = 1u << 26u;
const INSIDE_OUT: u32 = 1u << 27u;

// Bits of a look. The low 24 are sRGB instead of the material's, if LOOK_COLOURED.
const LOOK_COLOURED: u32 = 1u << 24u;
const LOOK_HIDDEN: u32 = 1u << 25u;
const LOOK_GHOST: u32 = 1u << 26u;
const LOOK_SELECTED: u32 = 1u << 27u;
const LOOK_HOVERED: u32 = 1u << 28u;
// Only between the stages: CLOSED and INSIDE_OUT of the row.
const LOOK_CLOSED: u32 = 1u << 29u;
const LOOK_INSIDE_OUT: u32 = 1u << 30u;

// Bits of Frame.edges.
const EDGES_FEATURES: u32 = 1u;
const EDGES_ALL: u32 = 2u;

@group(1) @binding(0) var<storage, read> instances: array<InstanceRow>;
// By row: the number of the instance in the scene, and its look. Rows that are only colours have none.
@group(1) @binding(1) var<storage, read> looks: array<vec2<u32>>;

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

fn colour_from_8888(word: u32) -> vec3<f32> {
    return linear_from_srgb(unpack4x8unorm(word).rgb);
}

fn colour_from_565(word: u32) -> vec3<f32> {
    let parts = vec3<f32>(vec3<u32>(word >> 27u, (word >> 21u) & 63u, (word >> 16u) & 31u));
    return linear_from_srgb(parts / vec3<f32>(31.0, 63.0, 31.0));
}

fn unpack2x12snorm(word: u32) -> vec2<f32> {
    let bits = vec2<i32>(extractBits(bitcast<i32>(word), 0u, 12u), extractBits(bitcast<i32>(word), 12u, 12u));
    return max(vec2<f32>(bits) / 2047.0, vec2<f32>(-1.0));
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

// Distinct, mid-bright colours for small integers.
fn debug_colour(number: u32) -> vec3<f32> {
    let hash = (number + 1u) * 2654435769u;
    let mixed = (hash ^ (hash >> 15u)) * 2246822519u;
    return linear_from_srgb(0.35 + 0.6 * unpack4x8unorm(mixed ^ (mixed >> 13u)).rgb);
}

// Outside of every picture.
const NOWHERE = vec4<f32>(2.0, 2.0, 2.0, 1.0);

// What a look makes of a corner that is placed and coloured.
fn with_look(placed: Corner, row: InstanceRow, at: u32) -> Corner {
    var corner = placed;
    let look = looks[min(at, arrayLength(&looks) - 1u)];
    corner.number = look.x;
    corner.look = look.y | ((row.colour & (CLOSED | INSIDE_OUT)) << 3u);
    if (look.y & LOOK_COLOURED) != 0u {
        corner.colour = colour_from_8888(look.y);
    }
    if (look.y & LOOK_SELECTED) != 0u {
        corner.colour = mix(corner.colour, vec3<f32>(1.0, 0.36, 0.02), 0.75);
    }
    if (look.y & LOOK_HOVERED) != 0u {
        corner.colour = mix(corner.colour, vec3<f32>(1.0, 0.85, 0.45), 0.45);
    }
    if (look.y & LOOK_HIDDEN) != 0u {
        corner.clip = NOWHERE;
    }
    return corner;
}

@vertex
fn draw_vertex(@location(0) active_vertex: vec4<u32>) -> Corner {
    return placed(active_vertex);
}

fn placed(active_vertex: vec4<u32>) -> Corner {
    let instance = active_vertex.w;
    let row = instances[instance];
    let grid = grid_position(active_vertex.x, active_vertex.y);
    let offset = row.column_0.xyz * grid.x + row.column_1.xyz * grid.y + row.column_2.xyz * grid.z;
    let translation_high = vec3<f32>(row.column_0.w, row.column_1.w, row.column_2.w);
    let origin = (translation_high - frame.eye_high) + (row.translation_low - frame.eye_low);
    let coloured = (row.colour & COLOURED) != 0u;
    let attributes = active_vertex.z;
    let slotted = (row.colour & SLOTTED) != 0u;
    var folded = select(unpack2x16snorm(attributes), unpack4x8snorm(attributes).xy, coloured);
    if slotted {
        folded = unpack2x12snorm(attributes);
    }

    var corner: Corner;
    corner.relative = offset + origin;
    corner.clip = frame.clip_from_relative * vec4<f32>(corner.relative, 1.0);
    corner.normal = world_normal(row, unfold(folded));
    if frame.mode == MODE_INSTANCE {
        corner.colour = debug_colour(instance);
    } else if slotted {
        let slot = (row.colour & 0xFFFFFFu) + (attributes >> 24u);
        corner.colour = colour_from_8888(instances[min(slot, arrayLength(&instances) - 1u)].colour);
    } else if coloured {
        corner.colour = colour_from_565(attributes);
    } else {
        corner.colour = colour_from_8888(row.colour);
    }
    return with_look(corner, row, instance);
}

// A corner of a triangle whose edges are drawn.
struct EdgedCorner {
    @builtin(position) clip: vec4<f32>,
    @location(0) relative: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) colour: vec3<f32>,
    @location(3) @interpolate(flat) number: u32,
    @location(4) @interpolate(flat) look: u32,
    // Barycentric.
    @location(5) place: vec3<f32>,
    // Which edges are lines: bit k for that from corner k to the next.
    @location(6) @interpolate(flat) lines: u32,
}

@group(2) @binding(0) var<storage, read> active_vertices: array<vec4<u32>>;
@group(2) @binding(1) var<storage, read> corner_vertices: array<u32>;
// Three indices of 16 bits, then 16 of flags: creases in bits 0 to 2, boundaries in bits 3 to 5.
@group(2) @binding(2) var<storage, read> triangles: array<vec2<u32>>;

@vertex
fn edged_vertex(@builtin(vertex_index) index: u32) -> EdgedCorner {
    return edged_corner(index);
}

fn edged_corner(index: u32) -> EdgedCorner {
    let corner = placed(active_vertices[corner_vertices[index]]);
    let flags = triangles[index / 3u].y >> 16u;
    let k = index % 3u;
    let lines = select((flags | (flags >> 3u)) & 7u, 7u, (frame.edges & EDGES_ALL) != 0u);
    let place = vec3<f32>(f32(k == 0u), f32(k == 1u), f32(k == 2u));
    return EdgedCorner(
        corner.clip, corner.relative, corner.normal, corner.colour, corner.number, corner.look, place, lines,
    );
}

// How much of a pixel the lines along a triangle's edges cover. Only in uniform control flow.
fn line_cover(place: vec3<f32>, lines: u32) -> f32 {
    let slope = sqrt(dpdx(place) * dpdx(place) + dpdy(place) * dpdy(place));
    // The edge from corner k to the next is where the third corner has no share.
    let distance = place.zxy / max(slope.zxy, vec3<f32>(1e-12));
    let is_line = (vec3<u32>(lines) & vec3<u32>(1u, 2u, 4u)) != vec3<u32>(0u);
    let nearest = select(vec3<f32>(1e6), distance, is_line);
    let least = min(min(nearest.x, nearest.y), nearest.z);
    return 1.0 - smoothstep(frame.line_px - 0.5, frame.line_px + 0.5, least);
}

fn lined(shaded: vec4<f32>, cover: f32) -> vec4<f32> {
    return vec4<f32>(mix(shaded.rgb, shaded.rgb * 0.12, cover * 0.85), shaded.a);
}

@fragment
fn edged_fragment(corner: EdgedCorner) -> @location(0) vec4<f32> {
    let cover = line_cover(corner.place, corner.lines);
    return lined(shaded(corner.relative, corner.normal, corner.colour), cover);
}

struct CutPixel {
    @location(0) colour: vec4<f32>,
    @builtin(sample_mask) samples: u32,
}

// The samples that a ghost covers: one in four, or a pixel in four.
fn ghost_samples(pixel: vec2<f32>) -> u32 {
    let at = vec2<u32>(pixel);
    if SAMPLES == 4u {
        return 1u << ((at.x + 2u * at.y) & 3u);
    }
    return select(0u, 1u, ((at.x | at.y) & 1u) == 0u);
}

// What is cut, or a ghost.
fn cut(shaded: vec4<f32>, kept: u32, look: u32, pixel: vec2<f32>) -> CutPixel {
    return CutPixel(shaded, select(kept, kept & ghost_samples(pixel), (look & LOOK_GHOST) != 0u));
}

@fragment
fn cut_fragment(corner: Corner) -> CutPixel {
    let kept = kept_samples(corner.relative);
    return cut(shaded(corner.relative, corner.normal, corner.colour), kept, corner.look, corner.clip.xy);
}

@fragment
fn edged_cut_fragment(corner: EdgedCorner) -> CutPixel {
    let kept = kept_samples(corner.relative);
    let cover = line_cover(corner.place, corner.lines);
    let surface = lined(shaded(corner.relative, corner.normal, corner.colour), cover);
    return cut(surface, kept, corner.look, corner.clip.xy);
}

// A box: corner `index` of the 36 of the unit cube's triangles, two a face, placed by a row.
@vertex
fn box_vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) number: u32) -> Corner {
    return box_corner(index, number);
}

fn box_corner(index: u32, number: u32) -> Corner {
    let row = instances[number];
    let face = index / 6u;
    let axis = face >> 1u;
    let side = f32(face & 1u);
    // Of the two triangles 0 1 2 and 0 2 3 of a square.
    let along = vec2<f32>(f32((0x16u >> (index % 6u)) & 1u), f32((0x34u >> (index % 6u)) & 1u));
    var place = vec3<f32>(side, along.x, along.y);
    var normal = vec3<f32>(2.0 * side - 1.0, 0.0, 0.0);
    if axis == 1u {
        place = place.yxz;
        normal = normal.yxz;
    } else if axis == 2u {
        place = place.yzx;
        normal = normal.yzx;
    }
    let translation_high = vec3<f32>(row.column_0.w, row.column_1.w, row.column_2.w);
    let origin = (translation_high - frame.eye_high) + (row.translation_low - frame.eye_low);
    var corner: Corner;
    corner.relative = row.column_0.xyz * place.x + row.column_1.xyz * place.y + row.column_2.xyz * place.z + origin;
    corner.clip = frame.clip_from_relative * vec4<f32>(corner.relative, 1.0);
    corner.normal = world_normal(row, normal);
    corner.colour = colour_from_8888(row.colour);
    return with_look(corner, row, number);
}
