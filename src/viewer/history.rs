//! Records of frames in, what plots show of the last of them out.

use std::collections::VecDeque;

use crate::stats::FrameRecord;

/// So many frames are remembered.
pub const FRAMES: usize = 600;

/// The last frames.
#[derive(Debug, Clone, Default)]
pub struct History {
    records: VecDeque<FrameRecord>,
    /// Of all frames so far.
    total: Totals,
}

/// Sums over all frames.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Totals {
    /// Frames.
    pub frames: u64,
    /// Bytes that were sent.
    pub bytes_sent: u64,
    /// Bytes that sending everything anew in every frame would have taken.
    pub bytes_whole: u64,
    /// Bytes that were read.
    pub disk_bytes: u64,
}

impl Totals {
    /// How many times less was sent.
    pub fn saving(&self) -> f64 {
        self.bytes_whole as f64 / self.bytes_sent.max(1) as f64
    }
}

impl History {
    /// Takes a record; forgets the oldest.
    pub fn add(&mut self, record: FrameRecord) {
        self.total.frames += 1;
        self.total.bytes_sent += record.bytes_sent;
        self.total.bytes_whole += record.bytes_whole;
        self.total.disk_bytes += record.disk_bytes;
        if self.records.len() == FRAMES {
            self.records.pop_front();
        }
        self.records.push_back(record);
    }

    /// Sums over all frames so far.
    pub fn total(&self) -> Totals {
        self.total
    }

    /// The last record.
    pub fn last(&self) -> Option<&FrameRecord> {
        self.records.back()
    }

    /// The remembered records, the oldest first.
    pub fn records(&self) -> impl ExactSizeIterator<Item = &FrameRecord> {
        self.records.iter()
    }

    /// A curve: the number of each frame before the last, and a value.
    pub fn curve(&self, value: impl Fn(&FrameRecord) -> f64) -> Vec<[f64; 2]> {
        let last = self.records.len() as f64 - 1.0;
        self.records.iter().enumerate().map(|(i, record)| [i as f64 - last, value(record)]).collect()
    }

    /// The middle and the longest of the frames' times, in milliseconds.
    pub fn frame_ms(&self) -> [f64; 2] {
        let mut times: Vec<f64> = self.records.iter().map(|record| record.frame_ms).collect();
        times.sort_by(f64::total_cmp);
        [times.get(times.len() / 2), times.last()].map(|time| time.copied().unwrap_or(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_is_forgotten_and_sums_are_not() {
        let mut history = History::default();
        for frame in 0..FRAMES as u64 + 10 {
            history.add(FrameRecord { frame, bytes_sent: 1, bytes_whole: 20, ..FrameRecord::default() });
        }
        assert_eq!(history.records().len(), FRAMES);
        assert_eq!(history.records().next().unwrap().frame, 10);
        assert_eq!(history.total().bytes_sent, FRAMES as u64 + 10);
        assert_eq!(history.total().saving(), 20.0);
        let curve = history.curve(|record| record.frame as f64);
        assert_eq!(curve[0], [1.0 - FRAMES as f64, 10.0]);
        assert_eq!(curve[FRAMES - 1][0], 0.0);
    }
}
