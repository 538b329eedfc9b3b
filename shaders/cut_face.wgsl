// cut_face: the faces that sections cut through closed parts.
//
// Follows shared/surface.wgsl, shared/section.wgsl and draw.wgsl, whose tables it shares.
//
// Reads   what draw reads of the closed parts that sections cut.
// Writes  cut_face_fragment colour and depth of the nearest back, and by the stencil how many more backs than fronts there
//         are; empty_fragment depth, infinity; shut_fragment depth, the nearest there is, where there is a cut face;
//         settle_fragment the depth of the plane there. pick_cut_face_fragment writes what pick.wgsl does.
// Before  draw, in the same render pass; settle_fragment after it.
//
// A cut face needs no geometry of its own. Behind the planes that a line of sight comes in by it leaves a closed part as
// often as it goes into it, and once more if it comes in within it: backs less fronts of closed parts, counted along the
// line as far as it goes, are the parts that the planes cut there. Where there are any, nothing that the draw pass draws
// is to be seen, and the nearest back is painted as the plane: it is of the part that the line is within, unless parts lie
// within each other. No gap is possible, at any level of detail, for a cut face ends where the surface does.
//
// The stencil counts whether a back is the nearest or not, so that one walk over the triangles counts and paints.

// 1 where what is placed inside out is drawn, of which front and back are the other way round.
override TURNED: u32 = 0u;

struct CutFaceCorner {
    @builtin(position) clip: vec4<f32>,
    // As of `Corner`.
    @location(0) relative: vec3<f32>,
    @location(1) colour: vec3<f32>,
    @location(2) @interpolate(flat) number: u32,
}

// Only closed parts have cut faces, and ghosts have none.
fn cut_face_corner(active_vertex: vec4<u32>) -> CutFaceCorner {
    let corner = placed(active_vertex);
    let is_drawn = (corner.look & (LOOK_CLOSED | LOOK_GHOST)) == LOOK_CLOSED
        && ((corner.look & LOOK_INSIDE_OUT) != 0u) == (TURNED != 0u);
    return CutFaceCorner(select(NOWHERE, corner.clip, is_drawn), corner.relative, corner.colour, corner.number);
}

@vertex
fn cut_face_vertex(@location(0) active_vertex: vec4<u32>) -> CutFaceCorner {
    return cut_face_corner(active_vertex);
}

fn is_back(front: bool) -> bool {
    return front == (TURNED != 0u);
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

// The colour of a cut face at a pixel: lines at 45 degrees, as on a drawing.
fn hatched(colour: vec3<f32>, pixel: vec2<f32>) -> vec3<f32> {
    let across = fract((pixel.x + pixel.y) / 9.0);
    let line = 1.0 - smoothstep(0.08, 0.2, abs(across - 0.5));
    return mix(colour, colour * 0.45, 0.55 * line);
}

// A back as the cut face before it; a front has no colour.
fn painted(corner: CutFaceCorner, front: bool) -> vec4<f32> {
    if !is_back(front) {
        return vec4<f32>(0.0);
    }
    let normal = -frame.sections[entry_before(corner.relative)].xyz;
    return lit(hatched(corner.colour, corner.clip.xy), normal, to_eye_from(corner.relative));
}

// Fronts are counted and never the nearest; backs are in front of the background, wherever the middle of the pixel lies.
fn depth_of(corner: CutFaceCorner, front: bool) -> f32 {
    return select(0.0, max(corner.clip.z, 1e-30), is_back(front));
}

struct CutFacePixel {
    @location(0) colour: vec4<f32>,
    @builtin(frag_depth) depth: f32,
    @builtin(sample_mask) samples: u32,
}

@fragment
fn cut_face_fragment(corner: CutFaceCorner, @builtin(front_facing) front: bool) -> CutFacePixel {
    let entered = entered_samples(corner.relative);
    return CutFacePixel(painted(corner, front), depth_of(corner, front), entered);
}

@fragment
fn empty_fragment(backdrop: Backdrop) {
}

struct Line {
    @builtin(position) clip: vec4<f32>,
    // In the picture: -1 to 1, to the right and upwards.
    @location(0) place: vec2<f32>,
}

// One triangle over the whole picture, as near as can be.
@vertex
fn line_vertex(@builtin(vertex_index) index: u32) -> Line {
    let place = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0;
    return Line(vec4<f32>(place, 1.0, 1.0), place);
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

// Whether a line of sight that comes in there has not left by any section before.
fn comes_in_at(entry: vec3<f32>) -> bool {
    var least = 3e38;
    for (var i = 0u; i < frame.section_count; i += 1u) {
        let distance = dot(frame.sections[i].xyz, entry) + frame.sections[i].w;
        least = min(least, select(distance, 3e38, frame.entries[i].w < NONE_ENTERS));
    }
    return least >= 0.0;
}

fn is_any_left_by() -> bool {
    var any = false;
    for (var i = 0u; i < frame.section_count; i += 1u) {
        any = any || frame.entries[i].w >= NONE_ENTERS;
    }
    return any;
}

// The samples of a pixel whose lines of sight come in before they have left by any section, a bit each.
fn samples_come_in(place: vec2<f32>, right: vec2<f32>, down: vec2<f32>) -> u32 {
    if !is_any_left_by() {
        return 15u;
    }
    var samples = 0u;
    for (var i = 0u; i < SAMPLES; i += 1u) {
        let offset = select(vec2<f32>(0.0), (right * SAMPLES_X[i] + down * SAMPLES_Y[i]) / 16.0, SAMPLES == 4u);
        samples |= select(0u, 1u << i, comes_in_at(entry_of(place + offset)));
    }
    return samples;
}

@fragment
fn shut_fragment(line: Line) -> @builtin(sample_mask) u32 {
    let right = dpdx(line.place);
    let down = dpdy(line.place);
    return samples_come_in(line.place, right, down);
}

// The depth of the plane, for what looks at depths later. It is less than the nearest there is, which tells where it goes.
@fragment
fn settle_fragment(line: Line) -> @builtin(frag_depth) f32 {
    let clip = frame.clip_from_relative * vec4<f32>(entry_of(line.place), 1.0);
    return clamp(clip.z / clip.w, 0.0, 1.0);
}

struct PickedCutFace {
    @location(0) words: vec4<u32>,
    @builtin(frag_depth) depth: f32,
    @builtin(sample_mask) samples: u32,
}

// Where the line of sight to a point came in.
fn entry_to(relative: vec3<f32>) -> vec3<f32> {
    let plane = frame.sections[entry_before(relative)];
    let to_eye = to_eye_from(relative);
    let back = (dot(plane.xyz, relative) + plane.w) / -dot(plane.xyz, to_eye);
    return relative + to_eye * max(back, 0.0);
}

@fragment
fn pick_cut_face_fragment(corner: CutFaceCorner, @builtin(front_facing) front: bool) -> PickedCutFace {
    let entered = entered_samples(corner.relative);
    let entry = entry_to(corner.relative);
    let word = select(0u, corner.number + 1u, comes_in_at(entry));
    return PickedCutFace(vec4<u32>(word, bitcast<vec3<u32>>(entry)), depth_of(corner, front), entered);
}

@fragment
fn pick_empty_fragment(backdrop: Backdrop) -> @location(0) vec4<u32> {
    return vec4<u32>(0u);
}
