//! How long turns of the window's loop take, with the time for drawing apart.

use std::time::Duration;

/// Milliseconds of the longest, and of all, turns.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Pace {
    /// Turns.
    pub turns: u64,
    /// The longest that news and layout took in one.
    pub longest_layout_ms: f64,
    /// What they took on average.
    pub mean_layout_ms: f64,
    /// The longest that it took to draw and show the interface, which waits for the graphics card.
    pub longest_present_ms: f64,
}

impl Pace {
    /// Takes a turn: until it was laid out, and all of it.
    pub fn add(&mut self, laid_out: Duration, all: Duration) {
        let [laid_out, all] = [laid_out, all].map(|time| 1e3 * time.as_secs_f64());
        self.turns += 1;
        self.longest_layout_ms = self.longest_layout_ms.max(laid_out);
        self.mean_layout_ms += (laid_out - self.mean_layout_ms) / self.turns as f64;
        self.longest_present_ms = self.longest_present_ms.max(all - laid_out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_and_the_mean_are_kept_apart_from_presenting() {
        let mut pace = Pace::default();
        for (laid_out, all) in [(2, 30), (4, 5)] {
            pace.add(Duration::from_millis(laid_out), Duration::from_millis(all));
        }
        assert_eq!((pace.turns, pace.longest_layout_ms), (2, 4.0));
        assert!((pace.mean_layout_ms - 3.0).abs() < 1e-9 && (pace.longest_present_ms - 28.0).abs() < 1e-9);
    }
}
