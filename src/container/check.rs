//! Every number in the tables, compared with what holds it. Time follows the tables, never the payload.

use super::ContainerError;
use super::check_groups::check_groups;
use super::format::*;
use super::stored::stored_bytes;
use crate::geometry::record::{
    Attributes, GRID_BITS, MAX_PART_TRIANGLES, MAX_PART_VERTICES, MAX_SLOTS, Stall,
};

/// The rows of all sections, not yet trusted.
pub(super) struct Tables<'a> {
    pub parts: &'a [PartRow],
    pub chunks: &'a [ChunkRow],
    pub instances: &'a [InstanceRow],
    pub nodes: &'a [NodeRow],
    pub materials: &'a [MaterialRow],
    pub names: &'a str,
    pub groups: &'a [GroupRow],
    pub members: &'a [u32],
}

/// What is wrong with one row, to which the caller adds which row it is.
pub(super) type RowCheck = Result<(), String>;

pub(super) fn ensure(right: bool, problem: impl FnOnce() -> String) -> RowCheck {
    if right { Ok(()) } else { Err(problem()) }
}

/// Runs a check over the rows of one table and names the first that fails.
pub(super) fn check_rows<R>(
    word: &str,
    rows: &[R],
    mut check: impl FnMut(usize, &R) -> RowCheck,
) -> Result<(), ContainerError> {
    // Rows name each other by u32, and the greatest one means "none".
    let too_many = || ContainerError::Malformed {
        place: format!("the table of {word}s"),
        problem: format!("it has {} rows, more than 32 bits can number", rows.len()),
    };
    u32::try_from(rows.len()).ok().filter(|&count| count < u32::MAX).ok_or_else(too_many)?;
    rows.iter().enumerate().try_for_each(|(index, row)| {
        check(index, row)
            .map_err(|problem| ContainerError::Malformed { place: format!("{word} {index}"), problem })
    })
}

impl Tables<'_> {
    /// Checks all tables against each other and against the payload that the header states.
    pub(super) fn check(&self, header: &Header) -> Result<(), ContainerError> {
        let mut first_chunk = 0;
        check_rows("part", self.parts, |_, row| {
            check_part(row)?;
            self.check_name(row.name_offset, row.name_bytes)?;
            self.check_tiers(row, &mut first_chunk)
        })?;
        check_cell_tree(self.parts)?;
        check_rows("chunk", self.chunks, |index, _| {
            ensure((index as u64) < first_chunk, || "it belongs to no part".to_owned())
        })?;
        check_rows("instance", self.instances, |_, row| self.check_instance(row))?;
        check_rows("instance", self.instances, |index, row| self.check_cells_together(index, row))?;
        check_rows("node", self.nodes, |index, row| self.check_node(index, row))?;
        check_rows("material", self.materials, |_, row| self.check_name(row.name_offset, row.name_bytes))?;
        check_groups(self)?;
        self.check_payload(header)
    }

    fn check_name(&self, offset: u64, bytes: u32) -> RowCheck {
        let end = offset.checked_add(u64::from(bytes));
        let range = usize::try_from(offset).ok().zip(end.and_then(|end| usize::try_from(end).ok()));
        ensure(range.and_then(|(start, end)| self.names.get(start..end)).is_some(), || {
            format!(
                "its name, {bytes} bytes at {offset}, is no text among {} bytes of names",
                self.names.len()
            )
        })
    }

    /// The chunk rows of a part: consecutive, strictly coarser, from the whole part to at least its coarsest state.
    fn check_tiers(&self, part: &PartRow, first_chunk: &mut u64) -> RowCheck {
        ensure(u64::from(part.first_chunk) == *first_chunk, || {
            format!("its first chunk row is {}, where {first_chunk} was next", part.first_chunk)
        })?;
        *first_chunk += u64::from(part.tier_count);
        let rows = part_chunks(self.chunks, part);
        let (Some(finest), Some(coarsest)) = (rows.first(), rows.last()) else {
            return Err(format!(
                "its {} tiers are not among {} chunk rows",
                part.tier_count,
                self.chunks.len()
            ));
        };
        ensure([finest.vertices, finest.triangles] == [part.vertices, part.triangles], || {
            format!("its counts, {} and {}, are not those of tier 0", part.vertices, part.triangles)
        })?;
        ensure(coarsest.vertices >= part.locked && coarsest.triangles >= part.coarsest_triangles, || {
            "its coarsest state is larger than its coarsest tier".to_owned()
        })?;
        ensure(rows.is_sorted_by(|finer, coarser| finer.vertices > coarser.vertices), || {
            "its tiers do not have fewer and fewer vertices".to_owned()
        })?;
        ensure(rows.is_sorted_by(|finer, coarser| finer.triangles >= coarser.triangles), || {
            "a tier has more triangles than the next finer one".to_owned()
        })?;
        let below = rows.iter().skip(1).map(|row| row.vertices).chain([0]);
        rows.iter().zip(below).try_for_each(|(row, below)| check_chunk(row, row.vertices - below))
    }

    fn check_instance(&self, row: &InstanceRow) -> RowCheck {
        let below = |word, index: u32, count: usize| {
            ensure((index as usize) < count, || format!("it names {word} {index}, but there are {count}"))
        };
        below("part", row.part, self.parts.len())?;
        below("node", row.node, self.nodes.len())?;
        below("material", row.material, self.materials.len())?;
        let slots = u64::from(self.parts[row.part as usize].slots);
        ensure(u64::from(row.material) + slots <= self.materials.len() as u64, || {
            format!(
                "it names {slots} materials from {} on, but there are {}",
                row.material,
                self.materials.len()
            )
        })?;
        ensure(row.flags == 0, || format!("its flags are {:#x}, none of which is known", row.flags))?;
        ensure(row.world_from_part.iter().all(|c| c.is_finite()), || "its transform is not finite".to_owned())
    }

    /// The cells of a part with parent cells are placed one after another, all of them: whoever draws one in the place of
    /// others finds these by their distance.
    fn check_cells_together(&self, index: usize, row: &InstanceRow) -> RowCheck {
        let part = row.part as usize;
        let neighbour = |part: Option<usize>, instance: Option<usize>| {
            let Some(part) = part.filter(|&p| same_tree(self.parts, row.part as usize, p)) else {
                return true;
            };
            instance.and_then(|instance| self.instances.get(instance)).is_some_and(|other| {
                other.part as usize == part
                    && other.node == row.node
                    && other.world_from_part == row.world_from_part
            })
        };
        let both = neighbour(part.checked_sub(1), index.checked_sub(1))
            && neighbour(Some(part + 1), Some(index + 1));
        ensure(both, || format!("part {part} is placed without the other cells of its part beside it"))
    }

    fn check_node(&self, index: usize, row: &NodeRow) -> RowCheck {
        self.check_name(row.name_offset, row.name_bytes)?;
        ensure(row.parent == NO_PARENT || (row.parent as usize) < index, || {
            format!("its parent is node {}, which does not come before it", row.parent)
        })
    }

    /// Chunks fill the payload without gaps, in [`payload_order`].
    fn check_payload(&self, header: &Header) -> Result<(), ContainerError> {
        let tier_counts: Vec<u32> = self.parts.iter().map(|part| part.tier_count).collect();
        let mut next = header.payload_offset;
        for (part, tier) in payload_order(&tier_counts) {
            let row = part_chunks(self.chunks, &self.parts[part as usize])[tier as usize];
            let end = next.checked_add(u64::from(row.bytes)).and_then(aligned);
            let Some(end) = end.filter(|&end| row.offset == next && end <= header.file_bytes) else {
                let problem = format!(
                    "its chunk is {} bytes at {}, where {next} of {} was next",
                    row.bytes, row.offset, header.file_bytes
                );
                return Err(ContainerError::Malformed {
                    place: format!("part {part}, tier {tier}"),
                    problem,
                });
            };
            next = end;
        }
        if next == header.file_bytes {
            return Ok(());
        }
        let problem = format!("its chunks end at byte {next} of {}", header.file_bytes);
        Err(ContainerError::Malformed { place: "the payload".to_owned(), problem })
    }
}

/// The chunk rows of a part, finest first; empty if they are not all there.
pub(super) fn part_chunks<'a>(chunks: &'a [ChunkRow], part: &PartRow) -> &'a [ChunkRow] {
    let first = part.first_chunk as usize;
    first.checked_add(part.tier_count as usize).and_then(|end| chunks.get(first..end)).unwrap_or(&[])
}

/// Whether two parts are cells of one part that has parent cells.
fn same_tree(parts: &[PartRow], part: usize, other: usize) -> bool {
    let in_tree = |row: &PartRow| row.is_parent() || !row.is_root();
    let rows = parts.get(part).zip(parts.get(other));
    rows.is_some_and(|(row, other)| row.source == other.source && in_tree(row) && in_tree(other))
}

/// Parents come before their children, are cells of the same part on the same grid, and stand for the leaves below
/// them.
fn check_cell_tree(parts: &[PartRow]) -> Result<(), ContainerError> {
    let mut depth = vec![0; parts.len()];
    check_rows("part", parts, |index, row| {
        let distance = row.parent_distance as usize;
        if distance == 0 {
            return Ok(());
        }
        let Some(parent) = index.checked_sub(distance) else {
            return Err(format!("its parent cell is {distance} parts before it"));
        };
        depth[index] = depth[parent] + 1;
        let alike = |a: &PartRow, b: &PartRow| (a.source, a.step_exponent) == (b.source, b.step_exponent);
        let sound = parts[parent].is_parent() && alike(row, &parts[parent]) && row.is_cell();
        ensure(sound && depth[index] < MAX_CELL_DEPTH, || {
            format!("its parent cell, part {parent}, is none, or is one of another part or grid")
        })
    })?;
    let mut leaves = vec![0u64; parts.len()];
    for (index, row) in parts.iter().enumerate().rev() {
        let own = if row.is_parent() { leaves[index] } else { 1 };
        if row.is_parent() && own != u64::from(row.leaf_cells) {
            let problem = format!("it stands for {} leaf cells and has {own}", row.leaf_cells);
            return Err(ContainerError::Malformed { place: format!("part {index}"), problem });
        }
        if !row.is_root() {
            leaves[index - row.parent_distance as usize] += own;
        }
    }
    Ok(())
}

/// What a part's row shows alone.
fn check_part(row: &PartRow) -> RowCheck {
    ensure((1..=MAX_PART_VERTICES as u32).contains(&row.vertices), || {
        format!("it has {} vertices, not 1 to {MAX_PART_VERTICES}", row.vertices)
    })?;
    ensure(row.triangles <= MAX_PART_TRIANGLES as u32, || {
        format!("it has {} triangles, more than {MAX_PART_TRIANGLES}", row.triangles)
    })?;
    ensure(row.locked >= 1, || "its coarsest state has no vertex".to_owned())?;
    const KNOWN: u32 =
        PartRow::COLOURED | PartRow::CELL | PartRow::SLOTTED | PartRow::CLOSED | PartRow::INSIDE_OUT;
    ensure(row.flags & !KNOWN == 0, || {
        format!("its flags are {:#x}, not all of which are known", row.flags)
    })?;
    ensure(row.flags & (PartRow::CLOSED | PartRow::INSIDE_OUT) != PartRow::INSIDE_OUT, || {
        format!("its flags are {:#x}, inside out but not closed", row.flags)
    })?;
    let slotted = row.attributes() == Attributes::Slot;
    let slots = if slotted { 1..=MAX_SLOTS as u32 } else { 0..=0 };
    ensure(slots.contains(&row.slots) && !(slotted && row.flags & PartRow::COLOURED != 0), || {
        format!("it has {} material slots and the flags {:#x}", row.slots, row.flags)
    })?;
    ensure(Stall::from_byte(row.stall).is_some(), || {
        format!("its cause of stall is {}, unknown", row.stall)
    })?;
    ensure(row.reserved == [0; 3], || "its reserved bytes are not zero".to_owned())?;
    check_grid(row)
}

fn check_grid(row: &PartRow) -> RowCheck {
    ensure((-1022..=1000).contains(&row.step_exponent), || {
        format!("its grid's step is 2 to the {}, not -1022 to 1000", row.step_exponent)
    })?;
    ensure(row.grid_high.iter().all(|&c| c < 1 << GRID_BITS), || {
        format!("its box ends at grid point {:?}, outside 21 bits", row.grid_high)
    })?;
    ensure(row.grid_low.iter().zip(row.grid_high).all(|(&low, high)| low <= high), || {
        format!("its box is empty, from {:?} to {:?}", row.grid_low, row.grid_high)
    })?;
    ensure(row.bounds().as_flattened().iter().chain(&row.origin).all(|c| c.is_finite()), || {
        "its box is not finite".to_owned()
    })
}

/// What a chunk's row shows about a tier that adds `added` vertices.
fn check_chunk(row: &ChunkRow, added: u32) -> RowCheck {
    ensure(u32::from(row.overflow) <= added, || {
        format!("a tier that adds {added} vertices has {} overflow entries", row.overflow)
    })?;
    let form =
        row.form().ok_or_else(|| format!("a tier's chunk has the form {}, which is unknown", row.form))?;
    let called_for = stored_bytes(form, row, added);
    ensure(called_for.contains(&row.bytes.into()), || {
        let (least, most) = (called_for.start(), called_for.end());
        let range = if least == most { least.to_string() } else { format!("{least} to {most}") };
        format!("a tier's chunk has {} bytes, and its counts call for {range}", row.bytes)
    })
}
