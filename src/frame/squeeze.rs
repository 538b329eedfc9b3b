//! Caps that the last choice was above in, a smaller share of the budget and a larger least size out.
//!
//! A cap on GPU memory, and the budget itself where the coarsest states of all that is visible are more than it, are kept
//! by choosing again: first with a smaller budget, which raises the error evenly over the view, then with only what
//! covers more pixels. What is left out is drawn as its box.

/// Each try aims a little below the cap.
const AIM: f64 = 0.97;
/// While less than this share of the caps is used, they are loosened again, step by step.
const LOOSE: f64 = 0.8;
const STEP: f32 = 1.1;
/// Below this share of the budget only a larger least size helps.
const LEAST_SHARE: f32 = 1e-6;
/// Floors of more than this share of the caps leave too little to the budget.
const FLOORS: f64 = 0.9;
/// After so many tries a frame is drawn as it is.
const MOST_TRIES: u32 = 60;

/// How much of the budget is spent, and on what.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Squeeze {
    /// The share of the budget.
    share: f32,
    /// What covers fewer pixels is not drawn.
    least_area_px: f32,
    /// A least size that was too small.
    too_small_px: f32,
    tries: u32,
}

/// The least size without a squeeze: a pixel.
const PIXEL: f32 = 1.0;

impl Default for Squeeze {
    fn default() -> Self {
        Self { share: 1.0, least_area_px: PIXEL, too_small_px: PIXEL, tries: 0 }
    }
}

impl Squeeze {
    /// The budget that is left.
    pub fn budget(&self, budget: u32) -> u32 {
        (f64::from(budget) * f64::from(self.share)) as u32
    }

    /// The least size, in pixels.
    pub fn least_area_px(&self) -> f32 {
        self.least_area_px
    }

    /// Before the first choice of a frame: loosens, if the last frame was `used` of what may be and may change.
    pub fn begin(&mut self, used: f64, may_loosen: bool) {
        self.tries = 0;
        if may_loosen && used < LOOSE {
            if self.least_area_px > PIXEL {
                self.least_area_px = (self.least_area_px / STEP).max(PIXEL);
            } else {
                self.share = (self.share * STEP).min(1.0);
            }
        }
    }

    /// After a choice: whether to choose again, with other shares. Where something is visible, a choice of nothing is one of
    /// which nothing has arrived, and no least size brings it.
    pub fn again(&mut self, used: f64, floors: f64, sees_nothing: bool) -> bool {
        match used {
            0.0 => sees_nothing && self.back_off(),
            used => used > 1.0 && self.tighten(used, floors),
        }
    }

    /// After a choice that was above the caps, `used` times what may be, of which the coarsest states of all that is
    /// visible are `floors`: tightens for another. `false` if all has been tried.
    fn tighten(&mut self, used: f64, floors: f64) -> bool {
        self.tries += 1;
        // Floors do not shrink with the budget.
        if floors * used < FLOORS && self.share > LEAST_SHARE {
            self.share = (self.share * (AIM / used) as f32).max(LEAST_SHARE);
        } else {
            self.too_small_px = self.least_area_px;
            self.least_area_px *= (used as f32).clamp(1.1, 1.6);
        }
        self.tries < MOST_TRIES
    }

    /// After a choice of nothing at all: goes half the way back to the last least size that was too small. `false` if
    /// there is no way back, or all has been tried.
    fn back_off(&mut self) -> bool {
        self.tries += 1;
        if self.least_area_px <= 1.001 * self.too_small_px {
            return false;
        }
        self.least_area_px = (self.least_area_px * self.too_small_px).sqrt();
        self.tries < MOST_TRIES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A view whose cost is a floor for everything that covers enough pixels, and in proportion to the budget.
    fn settled(floors: f64, cap: f64) -> (Squeeze, f64) {
        let mut squeeze = Squeeze::default();
        let floor = |s: &Squeeze| floors / f64::from(s.least_area_px());
        let used = |s: &Squeeze| floor(s).max(1000.0 * f64::from(s.budget(1_000_000)) / 1e6) / cap;
        squeeze.begin(0.0, true);
        while used(&squeeze) > 1.0 && squeeze.tighten(used(&squeeze), floor(&squeeze) / used(&squeeze) / cap)
        {
        }
        (squeeze, used(&squeeze))
    }

    #[test]
    fn caps_are_kept_with_floors_and_without() {
        for floors in [0.0, 10.0, 5e3, 1e6] {
            for cap in [1.0, 50.0, 900.0, 1e7] {
                let (squeeze, used) = settled(floors, cap);
                assert!(used <= 1.0, "{used} of {cap} with {floors}: {squeeze:?}");
            }
        }
        assert_eq!(settled(10.0, 1e7).0, Squeeze::default());
    }

    #[test]
    fn it_loosens_while_little_is_used_and_it_may() {
        let (mut squeeze, _) = settled(1e5, 100.0);
        let tight = squeeze;
        squeeze.begin(0.9, true);
        squeeze.begin(0.1, false);
        assert_eq!((squeeze.share, squeeze.least_area_px), (tight.share, tight.least_area_px));
        (0..500).for_each(|_| squeeze.begin(0.1, true));
        assert_eq!((squeeze.share, squeeze.least_area_px), (1.0, PIXEL));
    }

    #[test]
    fn what_has_not_arrived_is_no_reason_for_another_least_size() {
        let (tight, _) = settled(1e6, 50.0);
        assert!(tight.least_area_px > tight.too_small_px);
        let mut squeeze = Squeeze { tries: 0, ..tight };
        assert!(!squeeze.again(0.0, 0.0, false));
        assert_eq!(squeeze, Squeeze { tries: 0, ..tight });
        // Where there is nothing to be seen, the least size may be what hides it.
        assert!(squeeze.again(0.0, 0.0, true) && squeeze.least_area_px < tight.least_area_px);
    }
}
