//! Numbers for people.

/// A count with thousands separators: `1,234,567`.
pub fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// The nearest whole number with thousands separators; anything that is none becomes `-`.
pub fn rounded(number: f64) -> String {
    if number.is_finite() && number >= 0.0 { count(number.round() as u64) } else { "-".into() }
}

/// Bytes in binary units with three significant digits: `812 B`, `4.20 KiB`, `1.50 GiB`.
pub fn bytes(bytes: u64) -> String {
    const UNITS: [&str; 6] = ["KiB", "MiB", "GiB", "TiB", "PiB", "EiB"];
    if bytes < 1024 {
        return format!("{bytes} B");
    }
    let mut value = bytes as f64 / 1024.0;
    let mut unit = 0;
    // 1023.5 would be written as 1024.
    while value >= 1023.5 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.*} {}", decimals(value), UNITS[unit])
}

/// Milliseconds with a precision that suits the size: `0.042`, `3.14`, `271`.
pub fn milliseconds(ms: f64) -> String {
    if ms < 0.1 { format!("{ms:.3}") } else { format!("{ms:.*}", decimals(ms)) }
}

/// Decimals for three significant digits of a value of at least 0.1.
fn decimals(value: f64) -> usize {
    if value < 9.995 {
        2
    } else if value < 99.95 {
        1
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_separators() {
        assert_eq!([0, 999, 1000, 1_234_567].map(count), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!(count(u64::MAX), "18,446,744,073,709,551,615");
        assert_eq!([1999.5, f64::NAN].map(rounded), ["2,000", "-"]);
    }

    #[test]
    fn bytes_have_three_digits() {
        let cases = [0, 1023, 1024, 10_752, 104_858, 1_048_575, 1 << 20, 1_610_612_736];
        let texts = ["0 B", "1023 B", "1.00 KiB", "10.5 KiB", "102 KiB", "1.00 MiB", "1.00 MiB", "1.50 GiB"];
        assert_eq!(cases.map(bytes), texts);
        assert_eq!(bytes(u64::MAX), "16.0 EiB");
    }

    #[test]
    fn milliseconds_suit_their_size() {
        assert_eq!([0.0421, 3.456, 27.18, 271.8].map(milliseconds), ["0.042", "3.46", "27.2", "272"]);
    }
}
