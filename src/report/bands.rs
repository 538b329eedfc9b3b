//! One value a frame in; at most [`MOST_BANDS`] bands out, so that a page of a long flight is no larger than one of a
//! short one and hides no peak.
//!
//! A band keeps the least, the greatest and the mean of some consecutive frames. Short flights have a band a frame.

/// More would fall on the same pixels.
pub const MOST_BANDS: usize = 240;

/// What some consecutive frames have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// The middle of these frames.
    pub frame: f64,
    /// The least value.
    pub low: f64,
    /// The greatest.
    pub high: f64,
    /// The mean.
    pub mean: f64,
}

/// How many frames fall into one band.
pub fn frames_per_band(frames: usize) -> usize {
    frames.div_ceil(MOST_BANDS).max(1)
}

/// The bands of some values, one a frame.
pub fn bands(values: impl ExactSizeIterator<Item = f64>) -> Vec<Band> {
    let width = frames_per_band(values.len());
    let mut bands: Vec<Band> = Vec::with_capacity(values.len().min(MOST_BANDS));
    let mut count = 0;
    for (frame, value) in values.enumerate() {
        if frame.is_multiple_of(width) {
            bands.push(Band { frame: frame as f64, low: value, high: value, mean: value });
            count = 1;
        } else if let Some(band) = bands.last_mut() {
            count += 1;
            band.frame += 0.5;
            band.low = band.low.min(value);
            band.high = band.high.max(value);
            band.mean += (value - band.mean) / f64::from(count);
        }
    }
    bands
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_flights_have_a_band_a_frame() {
        let bands = bands([3.0, 1.0].into_iter());
        assert_eq!(
            bands.iter().map(|band| (band.frame, band.low, band.mean)).collect::<Vec<_>>(),
            [(0.0, 3.0, 3.0), (1.0, 1.0, 1.0)]
        );
    }

    #[test]
    fn long_flights_lose_no_peak_and_keep_their_mean() {
        for frames in [241, 1000, 100_003] {
            let values =
                (0..frames).map(|frame| if frame == 777 % frames { 9.0 } else { (frame % 2) as f64 });
            let bands = bands(values.collect::<Vec<_>>().into_iter());
            assert!(bands.len() <= MOST_BANDS && bands.len() > MOST_BANDS / 2, "{}", bands.len());
            assert_eq!(bands.iter().map(|band| band.high).fold(0.0, f64::max), 9.0);
            assert!(
                bands.iter().all(|band| band.low <= 1.0 && band.low <= band.mean && band.mean <= band.high)
            );
            assert!(
                bands.is_sorted_by(|a, b| a.frame < b.frame) && bands.last().unwrap().frame < frames as f64
            );
        }
        assert_eq!(bands([].into_iter()), []);
    }
}
