//! Numbers as people read them.

/// Four figures: plain where that is short, with an exponent where it is not.
#[must_use]
pub fn figures(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let decimals = [(1000.0, 1), (100.0, 2), (10.0, 3), (1.0, 4), (0.1, 4), (0.01, 5)];
    let decimals = decimals.iter().find(|(from, _)| size >= *from).map_or(6, |(_, decimals)| *decimals);
    let text = format!("{value:.decimals$}");
    // A whole number has no decimals to show.
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::figures;

    #[test]
    fn numbers_keep_four_figures_whatever_their_size() {
        let cases = [
            (0.0, "0"),
            (12_569.486_6, "12569.5"),
            (-3_382.513_2, "-3382.5"),
            (28.9127, "28.913"),
            (100.0, "100"),
            (0.0584, "0.0584"),
            (1.505e-5, "1.505e-5"),
            (8.71e4, "87100"),
            (2.5e9, "2.500e9"),
            (0.5, "0.5"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(figures(value), text);
        }
    }
}
