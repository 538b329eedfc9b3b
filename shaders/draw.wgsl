// draw: the active triangles of one batch, lit, boxes for what is not there, and the background behind them.
//
// Reads   the frame (uniform), one row per instance of the batch, active vertices (vertex buffer) and the index
//         buffer with its indirect arguments.
// Writes  colour (linear light; the target is sRGB) and reversed depth.
// Before  reform, which wrote the index buffer. After: nothing; the picture is read back or shown.
//
// shared/surface.wgsl has the frame, the light and the background.
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

@group(1) @binding(0) var<storage, read> instances: array<InstanceRow>;

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
    return corner;
}

// A box: corner `index` of the 36 of the unit cube's triangles, two a face, placed by a row.
@vertex
fn box_vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) number: u32) -> Corner {
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
    return corner;
}
