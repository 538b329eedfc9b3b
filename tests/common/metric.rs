//! Two pictures in, three numbers out, and the thresholds by which they are one picture.
//!
//! The perceptual score is the hybrid of `image-compare`: structural similarity of the luma in windows of 8 x 8 pixels,
//! and the difference of the chroma. It is a mean over the picture, and a small part that is missing drowns in a
//! large background; so the worst tile of 16 x 16 pixels is looked at too.

use image::{Rgb, RgbImage};

const TILE: u32 = 16;

/// How much two pictures differ.
#[derive(Debug, Clone, Copy)]
pub struct Difference {
    /// Perceptual similarity: 1 for the same picture.
    pub score: f64,
    /// Mean difference of a channel, in steps of 1/255 of sRGB.
    pub mean: f64,
    /// The same over the tile of 16 x 16 pixels where it is largest.
    pub worst_tile: f64,
}

/// What two pictures may differ by and still be called the same.
#[derive(Debug, Clone, Copy)]
pub struct Tolerance {
    /// The least score.
    pub score: f64,
    /// The largest mean.
    pub mean: f64,
    /// The largest mean of a tile.
    pub worst_tile: f64,
}

/// At full budget the picture is that of the input. The worst that was measured (software Vulkan, seven models):
/// score 0.9996, mean 0.044, worst tile 1.6, all three where vertex colours are rounded to 16 bits.
pub const SAME: Tolerance = Tolerance { score: 0.998, mean: 0.15, worst_tile: 4.0 };

impl Difference {
    /// Compares two pictures of the same size.
    pub fn between(a: &RgbImage, b: &RgbImage) -> Self {
        let score = image_compare::rgb_hybrid_compare(a, b).unwrap().score;
        let tiles = tile_means(a, b);
        let (sum, pixels) = tiles.iter().fold((0.0, 0.0), |(s, p), (sum, pixels)| (s + sum, p + pixels));
        let worst_tile = tiles.iter().map(|(sum, pixels)| sum / pixels).fold(0.0, f64::max);
        Self { score, mean: sum / pixels, worst_tile }
    }

    /// Whether all three numbers are within the tolerance.
    pub fn is_within(&self, tolerance: &Tolerance) -> bool {
        self.score >= tolerance.score
            && self.mean <= tolerance.mean
            && self.worst_tile <= tolerance.worst_tile
    }
}

/// For every tile the sum over its pixels of the mean difference of a channel, and the number of pixels.
fn tile_means(a: &RgbImage, b: &RgbImage) -> Vec<(f64, f64)> {
    let columns = a.width().div_ceil(TILE);
    let mut tiles = vec![(0.0, 0.0); (columns * a.height().div_ceil(TILE)) as usize];
    for ((x, y, p), q) in a.enumerate_pixels().zip(b.pixels()) {
        let (sum, pixels) = &mut tiles[(y / TILE * columns + x / TILE) as usize];
        *sum += channel_mean(p, q);
        *pixels += 1.0;
    }
    tiles
}

fn channel_mean(p: &Rgb<u8>, q: &Rgb<u8>) -> f64 {
    p.0.iter().zip(q.0).map(|(&p, q)| f64::from(p.abs_diff(q))).sum::<f64>() / 3.0
}

/// How many pixels differ by more than `steps` in a channel.
pub fn pixels_beyond(a: &RgbImage, b: &RgbImage, steps: u8) -> usize {
    let beyond = |(p, q): &(&Rgb<u8>, &Rgb<u8>)| p.0.iter().zip(q.0).any(|(&p, q)| p.abs_diff(q) > steps);
    a.pixels().zip(b.pixels()).filter(beyond).count()
}

/// The difference, eight times enlarged, on black.
pub fn enlarged(a: &RgbImage, b: &RgbImage) -> RgbImage {
    let difference = |p: u8, q: u8| p.abs_diff(q).saturating_mul(8);
    RgbImage::from_fn(a.width(), a.height(), |x, y| {
        let (p, q) = (a.get_pixel(x, y).0, b.get_pixel(x, y).0);
        Rgb([0, 1, 2].map(|channel| difference(p[channel], q[channel])))
    })
}
