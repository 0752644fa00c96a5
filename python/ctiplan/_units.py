"""Units of columns, which their names carry."""

from __future__ import annotations

# The end of a name, and the unit as astropy spells it; the first that fits holds.
_ENDINGS = (
    ("_mev_g_yr", "MeV / (g yr)"),
    ("_mev_g", "MeV / g"),
    ("_per_px", "1 / pix"),
    ("_per_yr", "1 / yr"),
    ("_cm2", "1 / cm2"),
    ("_mev", "MeV"),
    ("_ev", "eV"),
    ("_yr", "yr"),
    ("_ms", "ms"),
    ("_mm", "mm"),
    ("_km", "km"),
    ("_khz", "kHz"),
    ("_px", "pix"),
    ("_k", "K"),
    ("_e", "electron"),
)

# Names with such an end that are pure numbers.
_PURE = ("delta_e",)


def unit_of(name: str) -> str | None:
    """The unit of a column, as astropy spells it; None for a pure number or words."""
    if name in _PURE or name.endswith("_delta_e"):
        return None
    return next((unit for ending, unit in _ENDINGS if name == ending[1:] or name.endswith(ending)), None)
