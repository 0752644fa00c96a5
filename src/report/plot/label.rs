//! A key or a column, such as `line_time_ms`, as the label of an axis: `line time [ms]`.

/// Units at the ends of keys, longest first, and their notation.
const UNITS: [(&str, &str); 14] = [
    ("_mev_g_yr", "MeV/g/yr"),
    ("_per_px", "1/px"),
    ("_mev_g", "MeV/g"),
    ("_mm_al", "mm Al"),
    ("_cm2_g", "cm²/g"),
    ("_arcsec", "arcsec"),
    ("_sigma", "σ"),
    ("_mev", "MeV"),
    ("_ms", "ms"),
    ("_yr", "yr"),
    ("_px", "px"),
    ("_ev", "eV"),
    ("_k", "K"),
    ("_e", "e⁻"),
];

/// Keys whose words alone would be unclear.
const NAMED: [(&str, &str); 14] = [
    ("launch", "launch [year]"),
    ("t_yr", "time since launch t [yr]"),
    ("dose_mev_g", "dose D [MeV/g]"),
    ("temperature_k", "temperature T [K]"),
    ("transfers", "transfers N"),
    ("signal_e", "signal S [e⁻]"),
    ("signal_read_e", "signal as read [e⁻]"),
    ("preceding_e", "preceding signal [e⁻]"),
    ("preceding_px", "distance of the preceding packet [px]"),
    ("background_e", "background [e⁻/px]"),
    ("trail_px", "distance behind the packet [px]"),
    ("block_px", "rows of the block [px]"),
    ("first_px", "first pixel behind the block"),
    ("last_px", "last pixel behind the block"),
];

/// The axis label of a key, with the unit at the end of its name.
pub fn label(key: &str) -> String {
    if let Some((_, label)) = NAMED.iter().find(|(known, _)| *known == key) {
        return label.to_string();
    }
    let unit = UNITS.iter().find_map(|(ending, unit)| Some((key.strip_suffix(ending)?, unit)));
    match unit {
        Some((name, unit)) => format!("{} [{unit}]", name.replace('_', " ")),
        None => key.replace('_', " "),
    }
}

/// A key with a value, as the name of a group: "signal 100 e⁻".
pub fn setting(key: &str, value: f64) -> String {
    let label = label(key);
    let (name, unit) = label.split_once(" [").map_or((label.as_str(), ""), |(name, unit)| (name, unit));
    // Symbols are for axes.
    let words = name.rsplit_once(' ').filter(|(_, last)| last.len() == 1).map_or(name, |(words, _)| words);
    format!("{words} {value} {}", unit.trim_end_matches(']')).trim_end().to_string()
}

/// Whether a key is a count.
pub fn counts(key: &str) -> bool {
    ["transfers", "trail_px", "block_px", "first_px", "last_px", "preceding_px"].contains(&key)
}

#[test]
fn labels_have_units() {
    for (key, expected) in [
        ("line_time_ms", "line time [ms]"),
        ("active_dose_rate_mev_g_yr", "active dose rate [MeV/g/yr]"),
        ("signal_e", "signal S [e⁻]"),
        ("humidity", "humidity"),
        ("launch", "launch [year]"),
    ] {
        assert_eq!(label(key), expected);
    }
    assert_eq!(setting("signal_e", 100.0), "signal 100 e⁻");
    assert_eq!(setting("transfers", 400.0), "transfers 400");
    assert_eq!(setting("humidity", 0.5), "humidity 0.5");
}
