//! Values as people type them: counts with a suffix, sizes in pixels, bytes.

/// A positive count, with k, M or G for thousands: `500k`, `1.5M`.
pub fn count(text: &str) -> Result<u32, String> {
    let number = scaled(text, &[("k", 1e3), ("M", 1e6), ("G", 1e9)])?;
    if number < 1.0 {
        return Err("must be at least 1".to_owned());
    }
    // One less than the greatest u32 is the largest budget that the passes can add up.
    if number > f64::from(u32::MAX - 1) {
        return Err(format!("must be at most {}", u32::MAX - 1));
    }
    Ok(number as u32)
}

/// The same beyond 32 bits, and 0 as well: what asks for it says what is wrong with it.
pub fn large_count(text: &str) -> Result<u64, String> {
    let number = scaled(text, &[("k", 1e3), ("M", 1e6), ("G", 1e9)])?;
    if number <= 1e15 { Ok(number as u64) } else { Err("must be at most 1000000 G".to_owned()) }
}

/// A number of bytes, with a unit or without: `64MiB`, `4096`.
pub fn bytes(text: &str) -> Result<u64, String> {
    const UNITS: [(&str, f64); 7] = [
        ("KiB", 1024.0),
        ("MiB", 1_048_576.0),
        ("GiB", 1_073_741_824.0),
        ("kB", 1e3),
        ("MB", 1e6),
        ("GB", 1e9),
        ("B", 1.0),
    ];
    let number = scaled(text, &UNITS)?;
    if (1.0..=1e18).contains(&number) { Ok(number as u64) } else { Err("must be at least 1 byte".to_owned()) }
}

fn scaled(text: &str, units: &[(&str, f64)]) -> Result<f64, String> {
    let found = units.iter().find_map(|&(unit, scale)| Some((text.strip_suffix(unit)?, scale)));
    let (digits, scale) = found.unwrap_or((text, 1.0));
    let number: f64 =
        digits.trim().replace('_', "").parse().map_err(|_| format!("`{text}` is not a number"))?;
    if number.is_finite() && number >= 0.0 {
        return Ok(number * scale);
    }
    let names: Vec<&str> = units.iter().map(|unit| unit.0).collect();
    Err(match names.join(", ") {
        names if names.is_empty() => "must be a number from 0 up".to_owned(),
        names => format!("must be a positive number, with {names} or without"),
    })
}

/// A size in pixels: `1920x1080`.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let parsed = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parsed {
        Some((width, height)) if width > 0 && height > 0 => Ok((width, height)),
        _ => Err("must be width x height in pixels, as in 1280x720".to_owned()),
    }
}

/// A field of view.
pub fn degrees(text: &str) -> Result<f64, String> {
    let degrees = scaled(text, &[])?;
    if (1.0..=170.0).contains(&degrees) { Ok(degrees) } else { Err("must be from 1 to 170".to_owned()) }
}

/// A strength.
pub fn up_to_two(text: &str) -> Result<f64, String> {
    let number = scaled(text, &[])?;
    if number <= 2.0 { Ok(number) } else { Err("must be from 0 to 2".to_owned()) }
}

/// A number above zero.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        _ => Err("must be a number above 0".to_owned()),
    }
}

/// A share above zero and at most one.
pub fn ratio(text: &str) -> Result<f64, String> {
    positive(text)
        .ok()
        .filter(|&ratio| ratio <= 1.0)
        .ok_or_else(|| "must be above 0 and at most 1".to_owned())
}

/// Zero or a number above it.
pub fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number >= 0.0 && number.is_finite() => Ok(number),
        _ => Err("must be 0 or a number above it".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_bytes_take_units() {
        assert_eq!(count("1.5M"), Ok(1_500_000));
        assert_eq!(count("20_000"), Ok(20_000));
        assert!(count("0").is_err() && count("-1").is_err() && count("1e99").is_err() && count("x").is_err());
        assert_eq!(large_count("332M"), Ok(332_000_000));
        assert!(large_count("1e99").is_err() && large_count("-5").is_err() && large_count("NaN").is_err());
        assert_eq!(bytes("64MiB"), Ok(64 << 20));
        assert_eq!(bytes("12"), Ok(12));
        assert!(bytes("0").is_err());
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert!(size("640").is_err() && size("0x4").is_err());
        assert!(ratio("1.5").is_err() && ratio("0").is_err() && ratio("0.5").is_ok());
    }
}
