// cut_face: the faces that sections cut through closed parts.
//
// Follows shared/surface.wgsl, shared/section.wgsl and draw.wgsl, whose vertices it shares. `COUNTS` is the texture that
// has a number for each sample.
//
// Reads   what draw reads of the batches that sections cut.
// Writes  count_fragment a number for each sample; empty_fragment depth, infinity where there is a cut face;
//         cut_face_fragment colour there, and the depth of the back that was painted; settle_fragment the depth of the plane;
//         pick_cut_face_fragment what pick.wgsl writes.
// After   draw, of the same frame.
//
// A cut face needs no geometry of its own. Behind the planes that a line of sight comes in by it leaves a closed part as
// often as it goes into it, and once more if it comes in within it: backs less fronts of closed parts, counted along the
// line as far as it goes, are the parts that the planes cut there. Where there are any, nothing that the draw pass has drawn
// is to be seen, and the nearest back is painted as the plane: it is of the part that the line is within, unless parts lie
// within each other. No gap is possible, at any level of detail, for a cut face ends where the surface does.

@group(2) @binding(0) var counts: COUNTS;

// Only closed parts have cut faces, and ghosts have none.
fn closed_corner(active_vertex: vec4<u32>) -> Corner {
    var corner = placed(active_vertex);
    if (corner.look & LOOK_CLOSED) == 0u || (corner.look & LOOK_GHOST) != 0u {
        corner.clip = NOWHERE;
    }
    return corner;
}

@vertex
fn cut_face_vertex(@location(0) active_vertex: vec4<u32>) -> Corner {
    return closed_corner(active_vertex);
}

fn is_seen_from_within(look: u32, front: bool) -> bool {
    return front == ((look & LOOK_INSIDE_OUT) != 0u);
}

fn counted(corner: Corner, front: bool) -> vec4<f32> {
    return vec4<f32>(select(-1.0, 1.0, is_seen_from_within(corner.look, front)), 0.0, 0.0, 1.0);
}

struct Counted {
    @location(0) count: vec4<f32>,
    @builtin(sample_mask) samples: u32,
}

@fragment
fn count_fragment(corner: Corner, @builtin(front_facing) front: bool) -> Counted {
    return Counted(counted(corner, front), entered_samples(corner.relative));
}

// The samples of a pixel that are within a part, a bit each.
fn samples_within(pixel: vec2<f32>) -> u32 {
    let at = vec2<i32>(pixel);
    var samples = 0u;
    for (var i = 0u; i < SAMPLES; i += 1u) {
        samples |= select(0u, 1u << i, textureLoad(counts, at, i32(i)).x > 0.5);
    }
    return samples;
}

@fragment
fn empty_fragment(backdrop: Backdrop) -> @builtin(sample_mask) u32 {
    return samples_within(backdrop.clip.xy);
}

// The section that the line of sight to a point came in by last. It came in by some, or nothing of this is drawn.
fn entry_before(relative: vec3<f32>) -> u32 {
    var least = NONE_ENTERS;
    var entry = 0u;
    for (var i = 0u; i < frame.section_count; i += 1u) {
        let before = dot(frame.entries[i].xyz, relative) + frame.entries[i].w;
        entry = select(entry, i, before < least);
        least = min(least, before);
    }
    return entry;
}

// Where the line of sight to a point came in.
fn entry_to(relative: vec3<f32>) -> vec3<f32> {
    let plane = frame.sections[entry_before(relative)];
    let to_eye = to_eye_from(relative);
    let back = (dot(plane.xyz, relative) + plane.w) / -dot(plane.xyz, to_eye);
    return relative + to_eye * max(back, 0.0);
}

// The colour of a cut face at a pixel: lines at 45 degrees, as on a drawing.
fn hatched(colour: vec3<f32>, pixel: vec2<f32>) -> vec3<f32> {
    let across = fract((pixel.x + pixel.y) / 9.0);
    let line = 1.0 - smoothstep(0.08, 0.2, abs(across - 0.5));
    return mix(colour, colour * 0.45, 0.55 * line);
}

// The samples of a pixel whose lines of sight come in before they have left by any section, a bit each; `right` and `down`
// are how the point changes from pixel to pixel.
fn samples_come_in(relative: vec3<f32>, right: vec3<f32>, down: vec3<f32>) -> u32 {
    var samples = 0u;
    for (var i = 0u; i < SAMPLES; i += 1u) {
        let offset = select(vec3<f32>(0.0), (right * SAMPLES_X[i] + down * SAMPLES_Y[i]) / 16.0, SAMPLES == 4u);
        let entry = entry_to(relative + offset);
        var least = 3e38;
        for (var k = 0u; k < frame.section_count; k += 1u) {
            let distance = dot(frame.sections[k].xyz, entry) + frame.sections[k].w;
            least = min(least, select(distance, 3e38, frame.entries[k].w < NONE_ENTERS));
        }
        samples |= select(0u, 1u << i, least >= 0.0);
    }
    return samples;
}

// The samples of a pixel in which a back is painted as the cut face before it, a bit each, of those that are entered.
fn samples_of_cut_face(
    corner: Corner,
    front: bool,
    entered: u32,
    right: vec3<f32>,
    down: vec3<f32>,
) -> u32 {
    if !is_seen_from_within(corner.look, front) {
        return 0u;
    }
    let within = entered & samples_within(corner.clip.xy);
    if within == 0u {
        return 0u;
    }
    return within & samples_come_in(corner.relative, right, down);
}

// A back as the cut face before it.
fn painted(corner: Corner, samples: u32) -> CutPixel {
    if samples == 0u {
        return CutPixel(vec4<f32>(0.0), 0u);
    }
    let normal = -frame.sections[entry_before(corner.relative)].xyz;
    return CutPixel(lit(hatched(corner.colour, corner.clip.xy), normal, to_eye_from(corner.relative)), samples);
}

@fragment
fn cut_face_fragment(corner: Corner, @builtin(front_facing) front: bool) -> CutPixel {
    let right = dpdx(corner.relative);
    let down = dpdy(corner.relative);
    let entered = entered_samples(corner.relative);
    return painted(corner, samples_of_cut_face(corner, front, entered, right, down));
}

struct Settled {
    @builtin(frag_depth) depth: f32,
    @builtin(sample_mask) samples: u32,
}

// The depth of the plane, for what looks at depths later.
@fragment
fn settle_fragment(line: Line) -> Settled {
    let clip = frame.clip_from_relative * vec4<f32>(entry_of(line.place), 1.0);
    return Settled(clamp(clip.z / clip.w, 0.0, 1.0), samples_within(line.clip.xy));
}

struct Line {
    @builtin(position) clip: vec4<f32>,
    // In the picture: -1 to 1, to the right and upwards.
    @location(0) place: vec2<f32>,
}

@vertex
fn line_vertex(@builtin(vertex_index) index: u32) -> Line {
    let place = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0;
    return Line(vec4<f32>(place, 0.0, 1.0), place);
}

// Where the line of sight through a place of the picture comes in.
fn entry_of(place: vec2<f32>) -> vec3<f32> {
    let rows = transpose(frame.clip_from_relative);
    // A point of the line, and where it runs to.
    var start = vec3<f32>(0.0);
    var along = cross(rows[0].xyz - place.x * rows[3].xyz, rows[1].xyz - place.y * rows[3].xyz);
    along *= select(1.0, -1.0, dot(along, frame.to_viewer) > 0.0);
    if frame.parallel != 0u {
        along = -frame.to_viewer;
        start = rows[0].xyz * (place.x - rows[0].w) / dot(rows[0].xyz, rows[0].xyz)
            + rows[1].xyz * (place.y - rows[1].w) / dot(rows[1].xyz, rows[1].xyz);
    }
    let plane = frame.sections[entry_before(start + along)];
    return start - along * (dot(plane.xyz, start) + plane.w) / dot(plane.xyz, along);
}

struct PickedCutFace {
    @location(0) words: vec4<u32>,
    @builtin(sample_mask) samples: u32,
}

@fragment
fn pick_cut_face_fragment(corner: Corner, @builtin(front_facing) front: bool) -> PickedCutFace {
    let entered = entered_samples(corner.relative);
    let samples = samples_of_cut_face(corner, front, entered, vec3<f32>(0.0), vec3<f32>(0.0));
    let point = bitcast<vec3<u32>>(entry_to(corner.relative));
    return PickedCutFace(vec4<u32>(corner.number + 1u, point), samples);
}
