// find_owner: which instance an element of a contiguous buffer belongs to (Peng & Cao 2012, algorithm 3).
//
// Needs from the pass: `start`, an exclusive prefix sum with one entry more than there are instances. Two lanes find
// the owners of the group's first and last element; each lane then searches only between these, usually nowhere.

const OWNER_GROUP: u32 = 64u;

var<workgroup> group_owners: array<u32, 2>;

// The last instance in low..=high whose block starts at or before the element. Empty blocks start where the next
// one does, so this is the block that holds the element.
fn owner_between(element: u32, first: u32, last: u32) -> u32 {
    var low = first;
    var high = last;
    while low < high {
        let middle = low + (high - low + 1u) / 2u;
        if start[middle] <= element {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    return low;
}

// Owner of element `group * 64 + lane`. All lanes of a workgroup call this together; `total` and `instance_count`
// are not zero. Lanes beyond `total` get the owner of the last element.
fn find_owner(group: u32, lane: u32, total: u32, instance_count: u32) -> u32 {
    let first = group * OWNER_GROUP;
    if lane < 2u {
        let end = min(first + lane * (OWNER_GROUP - 1u), total - 1u);
        group_owners[lane] = owner_between(end, 0u, instance_count - 1u);
    }
    workgroupBarrier();
    return owner_between(min(first + lane, total - 1u), group_owners[0], group_owners[1]);
}

