//! The pictures of a flight in; a few of them, scaled down, as data that stands in the page, out.

use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ImageEncoder, ImageReader};

use super::ReportError;

/// A picture in the page.
#[derive(Debug)]
pub struct Picture {
    /// `data:image/png;base64,...`
    pub source: String,
    /// What it shows.
    pub name: String,
    /// Width and height in pixels.
    pub size: (u32, u32),
}

/// So many pictures of a flight are shown.
const MOST: usize = 6;
/// And so large, in pixels.
const MOST_WIDTH: u32 = 640;
const MOST_HEIGHT: u32 = 480;

/// Some of the pictures in these files, from the first to the last, evenly.
///
/// # Errors
/// [`ReportError::Read`] and [`ReportError::Picture`].
pub fn pictures(files: &[PathBuf]) -> Result<Vec<Picture>, ReportError> {
    chosen(files.len()).into_iter().map(|number| picture(&files[number])).collect()
}

fn chosen(count: usize) -> Vec<usize> {
    let shown = count.min(MOST);
    (0..shown).map(|i| if shown > 1 { i * (count - 1) / (shown - 1) } else { 0 }).collect()
}

fn picture(file: &Path) -> Result<Picture, ReportError> {
    let reader =
        ImageReader::open(file).map_err(|cause| ReportError::Read { cause, path: file.to_owned() })?;
    let damaged = |cause| ReportError::Picture { cause, path: file.to_owned() };
    let mut image = reader.decode().map_err(damaged)?;
    if image.width() > MOST_WIDTH || image.height() > MOST_HEIGHT {
        image = image.thumbnail(MOST_WIDTH, MOST_HEIGHT);
    }
    let pixels = image.to_rgb8();
    let size = pixels.dimensions();
    let mut png = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive);
    encoder.write_image(&pixels, size.0, size.1, image::ExtendedColorType::Rgb8).map_err(damaged)?;
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let number = stem.trim_start_matches("frame_").trim_start_matches('0');
    let name = format!("frame {}", if number.is_empty() { "0" } else { number });
    Ok(Picture { source: format!("data:image/png;base64,{}", STANDARD.encode(png)), name, size })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_pictures_are_chosen_evenly() {
        assert!(chosen(0).is_empty());
        assert_eq!(chosen(1), [0]);
        assert_eq!(chosen(4), [0, 1, 2, 3]);
        assert_eq!(chosen(1001), [0, 200, 400, 600, 800, 1000]);
    }

    #[test]
    fn pictures_are_scaled_down_and_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("frame_00050.png");
        image::RgbaImage::from_pixel(1280, 720, image::Rgba([9, 8, 7, 255])).save(&file).unwrap();
        let made = picture(&file).unwrap();
        assert_eq!((made.size, made.name.as_str()), ((640, 360), "frame 50"));
        let bytes = STANDARD.decode(made.source.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        let read = image::load_from_memory(&bytes).unwrap().to_rgb8();
        assert_eq!((read.dimensions(), read.get_pixel(5, 5).0), ((640, 360), [9, 8, 7]));
        std::fs::write(&file, "no picture").unwrap();
        assert!(picture(&file).unwrap_err().to_string().contains("not a picture"));
    }
}
