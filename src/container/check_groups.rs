//! The tables of groups and members, compared with each other and with the instances.
//!
//! Groups are nested ranges of rows and of members. One walk over the rows holds the ranges that are open and sees every
//! one of them filled; a second one over the members sees every instance once.

use super::ContainerError;
use super::check::{RowCheck, Tables, check_rows, ensure};
use super::format::*;

/// Checks that groups nest, that leaves have every instance once, and the cells of a placement together.
pub(super) fn check_groups(tables: &Tables<'_>) -> Result<(), ContainerError> {
    let mut open = Open { groups: Vec::new(), rows: tables.groups.len(), members: tables.members.len() };
    check_rows("group", tables.groups, |index, row| {
        check_alone(row)?;
        open.enter(index, row)
    })?;
    open.finish()?;
    let whole = tables.groups.first().map_or([0; 2], |row| [row.end as usize, row.count as usize]);
    if whole != [tables.groups.len(), tables.members.len()] {
        let problem = format!("it ends at group {} and has {} members, not all", whole[0], whole[1]);
        return Err(ContainerError::Malformed { place: "group 0".to_owned(), problem });
    }
    check_members(tables)
}

/// What a row shows alone.
fn check_alone(row: &GroupRow) -> RowCheck {
    let sound = |(low, high): (&f64, &f64)| low.is_finite() && high.is_finite() && low <= high;
    ensure(row.low.iter().zip(&row.high).all(sound), || "its box is empty or not finite".to_owned())?;
    ensure(row.radius.is_finite() && row.radius >= 0.0, || format!("its largest circle is {}", row.radius))?;
    ensure(row.count > 0, || "it has no members".to_owned())
}

/// The groups that are not at their end, each with the members that are left for what lies below it.
struct Open {
    groups: Vec<(GroupRow, u64)>,
    rows: usize,
    members: usize,
}

impl Open {
    fn enter(&mut self, index: usize, row: &GroupRow) -> RowCheck {
        while self.groups.last().is_some_and(|(above, _)| above.end as usize == index) {
            let left = self.groups.pop().map_or(0, |(_, left)| left);
            ensure(left == 0, || format!("{left} members of a group before it are in no leaf"))?;
        }
        let room = self.groups.last().map_or([0, self.rows as u64, self.members as u64], |(above, left)| {
            [above.members().end as u64 - left, u64::from(above.end), *left]
        });
        let [first, end, left] = room;
        ensure(index == 0 || !self.groups.is_empty(), || "it is in no other group".to_owned())?;
        ensure((index as u64) < u64::from(row.end) && u64::from(row.end) <= end, || {
            format!("it ends at group {}, outside the group that it is in", row.end)
        })?;
        ensure(u64::from(row.first) == first && u64::from(row.count) <= left, || {
            format!("its members are {} from {}, where {left} from {first} are left", row.count, row.first)
        })?;
        if let Some((above, left)) = self.groups.last_mut() {
            ensure(is_inside(row, above), || {
                "its box or circle is not inside the group that it is in".to_owned()
            })?;
            *left -= u64::from(row.count);
        }
        if row.is_leaf(index) {
            return Ok(());
        }
        self.groups.push((*row, row.count.into()));
        ensure(self.groups.len() < MAX_GROUP_DEPTH, || format!("it has {MAX_GROUP_DEPTH} groups above it"))
    }
}

impl Open {
    /// What is left open at the end has to be filled as well.
    fn finish(self) -> Result<(), ContainerError> {
        match self.groups.iter().find(|(_, left)| *left > 0) {
            None => Ok(()),
            Some((_, left)) => Err(ContainerError::Malformed {
                place: "group 0".to_owned(),
                problem: format!("{left} members of the last group are in no leaf"),
            }),
        }
    }
}

fn is_inside(row: &GroupRow, above: &GroupRow) -> bool {
    let reaches = |axis: usize| above.low[axis] <= row.low[axis] && row.high[axis] <= above.high[axis];
    (0..3).all(reaches) && row.radius <= above.radius
}

/// Every instance is in one leaf, where members ascend, and next to the other cells of its placement.
fn check_members(tables: &Tables<'_>) -> Result<(), ContainerError> {
    let (members, instances) = (tables.members, tables.instances);
    let mut seen = vec![false; instances.len()];
    check_rows("member", members, |_, &number| {
        let first_time = seen.get_mut(number as usize).is_some_and(|seen| !std::mem::replace(seen, true));
        ensure(first_time, || format!("it is instance {number}, again or of {}", instances.len()))
    })?;
    if members.len() != instances.len() {
        let problem = format!("it has {} of {} instances", members.len(), instances.len());
        return Err(ContainerError::Malformed { place: "the table of members".to_owned(), problem });
    }
    check_rows("group", tables.groups, |index, row| {
        if !row.is_leaf(index) {
            return Ok(());
        }
        // In range: the groups have been checked.
        let own = &members[row.members()];
        ensure(own.is_sorted(), || "its members do not ascend".to_owned())?;
        ensure((0..own.len()).all(|at| has_parent_before(tables, own, at)), || {
            "it has a cell without the parent cell that is placed with it".to_owned()
        })
    })
}

fn has_parent_before(tables: &Tables<'_>, own: &[u32], at: usize) -> bool {
    let part = &tables.parts[tables.instances[own[at] as usize].part as usize];
    // An instance without its parent so many before it has been refused.
    let parent = own[at].wrapping_sub(part.parent_distance);
    part.is_root()
        || at.checked_sub(part.parent_distance as usize).is_some_and(|before| own[before] == parent)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(first: u32, count: u32, end: u32) -> GroupRow {
        GroupRow { high: [1.0; 3], first, count, end, ..GroupRow::default() }
    }

    fn said(groups: &[GroupRow], members: &[u32]) -> String {
        let parts = [PartRow::default()];
        let instances = vec![InstanceRow::default(); 6];
        let tables = Tables {
            parts: &parts,
            chunks: &[],
            instances: &instances,
            nodes: &[],
            materials: &[],
            names: "",
            groups,
            members,
        };
        check_groups(&tables).map_or_else(|error| error.to_string(), |()| "sound".to_owned())
    }

    /// A group of a leaf of two and a group of two leaves of two.
    fn sound() -> Vec<GroupRow> {
        vec![row(0, 6, 5), row(0, 2, 2), row(2, 4, 5), row(2, 2, 4), row(4, 2, 5)]
    }

    #[test]
    fn every_contradiction_between_groups_is_named() {
        let members = [4, 5, 0, 1, 2, 3];
        assert_eq!(said(&sound(), &members), "sound");
        type Change = fn(&mut GroupRow);
        let changed: [(usize, Change, &str); 12] = [
            (0, |row| row.end = 4, "group 2: it ends at group 5, outside"),
            (1, |row| row.end = 1, "group 1: it ends at group 1, outside"),
            (1, |row| row.end = 6, "group 1: it ends at group 6, outside"),
            (1, |row| row.count = 1, "group 2: its members are 4 from 2, where 5 from 1 are left"),
            (2, |row| row.end = 4, "group 4: 2 members of a group before it are in no leaf"),
            (3, |row| row.first = 0, "group 3: its members are 2 from 0"),
            (3, |row| row.count = 5, "group 3: its members are 5 from 2, where 4 from 2 are left"),
            (3, |row| row.end = 5, "group 4: its members are 2 from 4, where 2 from 2 are left"),
            (4, |row| row.count = 1, "group 0: 1 members of the last group are in no leaf"),
            (4, |row| row.high[2] = 1.5, "group 4: its box or circle is not inside"),
            (4, |row| row.radius = 0.5, "group 4: its box or circle is not inside"),
            (4, |row| row.low[0] = f64::NAN, "group 4: its box is empty or not finite"),
        ];
        for (index, change, message) in changed {
            let mut groups = sound();
            change(&mut groups[index]);
            let said = said(&groups, &members);
            assert!(said.starts_with(message), "group {index}, {message}: {said}");
        }
    }

    #[test]
    fn every_instance_is_in_one_leaf() {
        assert!(said(&sound(), &[4, 5, 0, 1, 3, 2]).starts_with("group 4: its members do not ascend"));
        assert!(said(&sound(), &[4, 5, 0, 1, 2, 2]).starts_with("member 5: it is instance 2, again"));
        assert!(said(&sound(), &[4, 5, 0, 1, 2, 6]).starts_with("member 5: it is instance 6, again or of 6"));
        assert!(said(&[row(0, 5, 1)], &[0, 1, 2, 3, 4]).contains("it has 5 of 6 instances"));
        assert!(said(&[], &[]).contains("it has 0 of 6 instances"));
    }

    #[test]
    fn the_depth_is_bounded() {
        let chain = |depth: u32| (0..depth).map(|_| row(0, 6, depth)).collect::<Vec<_>>();
        let members = [0, 1, 2, 3, 4, 5];
        assert_eq!(said(&chain(64), &members), "sound");
        assert!(said(&chain(65), &members).contains("groups above it"));
    }
}
