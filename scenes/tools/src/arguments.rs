//! Values of command-line flags that several commands have; messages say what was expected.

/// Pixels, such as 1280x720, each side from 1 to 16384.
///
/// # Errors
/// What was expected.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse::<u32>().ok().filter(|side| (1..=16_384).contains(side));
    let size = text.split_once(['x', 'X']).and_then(|(width, height)| Some((side(width)?, side(height)?)));
    size.ok_or_else(|| "expected two numbers from 1 to 16384, such as 1280x720".into())
}

/// An exposure value from -60 to 60.
///
/// # Errors
/// What was expected.
pub fn parse_exposure(text: &str) -> Result<f32, String> {
    let value = text.parse::<f32>().ok().filter(|value| (-60.0..=60.0).contains(value));
    value.ok_or_else(|| "expected a number from -60 to 60".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_numbers() {
        assert_eq!(parse_size("640x480"), Ok((640, 480)));
        for text in ["640", "0x480", "640x", "axb", "99999x1"] {
            assert!(parse_size(text).is_err(), "{text}");
        }
    }
}
