//! One record per frame: the same fields in the viewer, the CSV, the JSON and the report.

use serde::{Deserialize, Serialize};

/// Declares [`FrameRecord`] and the list of its columns in one place, so that they cannot differ.
macro_rules! frame_record {
    ($($(#[$doc:meta])* $name:ident: $kind:ty,)*) => {
        /// What one frame did. Units are in the names; `existing` elements were held from the last frame, `streamed`
        /// ones were sent in this one, and `active` is both together, what is drawn.
        ///
        /// A field that is not in a file, because it was written before the field was added, is read as 0.
        #[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
        #[serde(default)]
        pub struct FrameRecord {
            $($(#[$doc])* pub $name: $kind,)*
        }

        impl FrameRecord {
            /// The names of the fields in order: the header of the CSV.
            pub const COLUMNS: &'static [&'static str] = &[$(stringify!($name)),*];

            /// The fields as CSV values in the order of [`FrameRecord::COLUMNS`].
            pub fn values(&self) -> Vec<String> {
                vec![$(Value::text(&self.$name)),*]
            }
        }
    };
}

/// A field as a CSV value.
trait Value {
    fn text(&self) -> String;
}

impl Value for u64 {
    fn text(&self) -> String {
        self.to_string()
    }
}

impl Value for f64 {
    /// Milliseconds to the microsecond.
    fn text(&self) -> String {
        format!("{self:.3}")
    }
}

frame_record! {
    /// The frame's index.
    frame: u64,
    /// Instances in the frustum and large enough.
    instances_visible: u64,
    /// Instances that are not drawn.
    instances_culled: u64,
    /// Vertices drawn.
    active_vertices: u64,
    /// Vertices held from the last frame.
    existing_vertices: u64,
    /// Vertices sent in this frame.
    streamed_vertices: u64,
    /// Triangles drawn.
    active_triangles: u64,
    /// Triangles held from the last frame.
    existing_triangles: u64,
    /// Triangles sent in this frame.
    streamed_triangles: u64,
    /// `ecol` entries in use.
    active_ecol: u64,
    /// `ecol` entries held from the last frame.
    existing_ecol: u64,
    /// `ecol` entries sent in this frame.
    streamed_ecol: u64,
    /// Bytes sent for vertices.
    bytes_vertices: u64,
    /// Bytes sent for `ecol`.
    bytes_ecol: u64,
    /// Bytes sent for triangles.
    bytes_triangles: u64,
    /// Bytes sent for tables: grants, the arguments of the draws, the camera.
    bytes_tables: u64,
    /// All bytes sent.
    bytes_sent: u64,
    /// What strategy `whole` would have sent.
    bytes_whole: u64,
    /// What strategy `per-part` would have sent.
    bytes_per_part: u64,
    /// Instances of which less had arrived than was wished for.
    misses: u64,
    /// Instances that are drawn as boxes, because nothing of them has arrived.
    boxes: u64,
    /// Vertices that were wished for.
    wished_vertices: u64,
    /// The projected area of all visible instances of which something is drawn, in thousandths.
    drawn_area_permille: u64,
    /// Bytes read from disk.
    disk_bytes: u64,
    /// Bytes given back to keep the cap on memory.
    evicted_bytes: u64,
    /// Pages that the thread of the frame had to wait for; 0 where the system does not tell.
    major_faults: u64,
    /// Stage 1: budgets.
    select_ms: f64,
    /// Stage 2: what has arrived.
    residency_ms: f64,
    /// Stage 3: what the GPU lacks.
    delta_ms: f64,
    /// Stage 4: gathering it into the staging ring.
    gather_ms: f64,
    /// Stage 4: the transfer.
    upload_ms: f64,
    /// Stage 5.
    defragment_ms: f64,
    /// Stage 6.
    reform_ms: f64,
    /// Stage 7.
    draw_ms: f64,
    /// Of stage 5, the grants; 0 where they are not timed.
    grant_ms: f64,
    /// Of stage 5, the prefix sums; 0 where they are not timed.
    prefix_sum_ms: f64,
    /// The whole frame.
    frame_ms: f64,
    /// When the frame was done, since the model began to be opened.
    elapsed_ms: f64,
    /// GPU memory in use.
    gpu_bytes: u64,
    /// Payload held in memory.
    resident_bytes: u64,
    /// All that `--memory` counts: the payload, the tables, and what belongs to instances and parts.
    memory_bytes: u64,
    /// How many compute passes ran.
    compute_passes: u64,
    /// Bytes that the grants must move (`stats::floor`).
    grant_floor_bytes: u64,
    /// Bytes that the prefix sums must move.
    prefix_sum_floor_bytes: u64,
    /// Bytes that the defragmentation must move.
    defragment_floor_bytes: u64,
    /// Bytes that the reformation must move.
    reform_floor_bytes: u64,
    /// Bytes that drawing must move.
    draw_floor_bytes: u64,
}

impl FrameRecord {
    /// Milliseconds by stage, in the order of the frame.
    pub fn stages_ms(&self) -> [(&'static str, f64); 8] {
        [
            ("select", self.select_ms),
            ("residency", self.residency_ms),
            ("delta", self.delta_ms),
            ("gather", self.gather_ms),
            ("upload", self.upload_ms),
            ("defragment", self.defragment_ms),
            ("reform", self.reform_ms),
            ("draw", self.draw_ms),
        ]
    }

    /// Milliseconds, and bytes that must be moved, by pass of the GPU, in the order of the frame.
    pub fn passes(&self) -> [(&'static str, f64, u64); 5] {
        let copies_ms = (self.defragment_ms - self.grant_ms - self.prefix_sum_ms).max(0.0);
        [
            ("grant", self.grant_ms, self.grant_floor_bytes),
            ("prefix_sum", self.prefix_sum_ms, self.prefix_sum_floor_bytes),
            ("defragment", copies_ms, self.defragment_floor_bytes),
            ("reform", self.reform_ms, self.reform_floor_bytes),
            ("draw", self.draw_ms, self.draw_floor_bytes),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_values_and_json_have_the_same_fields() {
        let record = FrameRecord { frame: 3, frame_ms: 1.5, ..Default::default() };
        let json = serde_json::to_value(record).unwrap();
        assert_eq!(json.as_object().unwrap().len(), FrameRecord::COLUMNS.len());
        assert_eq!(record.values().len(), FrameRecord::COLUMNS.len());
        for (column, value) in FrameRecord::COLUMNS.iter().zip(record.values()) {
            let number = json[column].as_f64().unwrap();
            assert_eq!(value.parse::<f64>().unwrap(), number, "{column}");
        }
    }
}
