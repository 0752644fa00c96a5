#!/usr/bin/env python3
"""Measurement files to test the reader with: as astropy writes them, and with one mistake each.

Made by   astropy 6.1.7 with numpy 1.26.4 and PyYAML 6.0.3 (Python 3.11); five seconds.
Command   python tests/measurements/make.py            writes everything beside this file
          python tests/measurements/make.py --check    compares what is here with what would be written, and says
                                                       what astropy makes of the broken files; writes nothing

What is written
    NAME.ecsv, NAME.csv        files that must be read. Table.write or QTable.write (format="ascii.ecsv") wrote them;
                               those changed by hand afterwards, or written by hand altogether, say so in VALID below
    NAME.json                  what is in NAME.ecsv, as astropy reads it back
    broken/NAME.ecsv, .csv     files that must be refused. Each is a file that astropy wrote with one mistake put in by
                               hand, and the name states the mistake

    Everything fits missions/snap_l2.toml (launch 2009-01-01, galaxies faint, bright, large, disc). The numbers are of
    the size that mission would give (one formula per observable, below, and some noise), no more: nothing may be
    concluded from a fit to them.

NAME.json
    {"meta": {...}, "columns": [{"name", "unit", "datatype", "values"}, ...]}. Columns are those of the astropy
    table, in its order: a Time column is one column, also where the file holds it as two, and a mask is part of its column,
    also where the file holds it as a column of its own; `__serialized_columns__` is not in meta.
    unit       as in the file, null where there is none or it is dimensionless
    datatype   as in the file, with `subtype` beside it where there is one (plain CSV: int64, float64 or string)
    values     null where masked; "nan", "inf", "-inf" where a float is that; a float32 is the shortest decimal that
               reads back as it (the text in the file), not its neighbour in double precision
    time       only on Time columns: {"format", "scale", "utc": [the same instants in UTC, as YYYY-MM-DD hh:mm:ss.sss]}
    In meta: a mapping is an object whether the file has !!omap or not, sequences, tuples and numpy arrays are arrays, a
    Quantity is {"value", "unit"}, a unit its name, a Time its ISO string, a YAML date its ISO string, NaN "nan".

What to know of astropy (seen with 6.1.7)
    - A QTable cannot be written with a Quantity column called `value` (nor `unit`): TypeError, also in 8.0.2. The attribute of
      Quantity that holds the numbers has that name too. Table(qtable).write(...) works, or a `value` without unit.
    - Table().meta is an OrderedDict to begin with, so who writes t.meta["observable"] = ... gets !!omap; who gives
      Table(..., meta={...}) gets a plain mapping, sorted by key. astropy 7.2.3 and 8.0.2 write !!omap for both, and for the meta
      of a column too; otherwise 8.0.2 writes these files as 6.1.7 does, and both read them alike.
    - The default delimiter is the blank, and then the header has no `delimiter` line.
    - Units are written by astropy's own name: u.day is `d`, u.MeV / u.g is `MeV / g`, u.pix is `pix`, u.percent is `%`.
    - A masked cell is "" (two quotes) between blanks, nothing between commas. An empty string comes out the same, and so is
      masked when read. Blanks around a string are lost, and a row that starts with # is a comment when read (a
      string column that comes first can do that).
    - PyYAML is YAML 1.1: 1.78e8 without sign in the exponent is a string to it, so astropy itself writes 178000000.0
      and 1.0e+20, but a header typed by hand may well say 1.78e8 (hand_exponent.ecsv).
    - The header folds at 130 columns; text outside ASCII is escaped (\\xB5); the same object twice in meta is
      written as anchor and alias (&id001, *id001); line ends within a string of meta may be lost on reading, because astropy skips blank
      lines of the header (meta_newline.ecsv; the JSON beside it has what astropy reads, not what was put in).
"""

import datetime
import io
import itertools
import json
import math
import sys
import warnings
from collections import OrderedDict
from pathlib import Path

import astropy
import astropy.units as u
import numpy as np
import yaml
from astropy.io import ascii as io_ascii
from astropy.io.ascii.ecsv import InvalidEcsvDatatypeWarning
from astropy.table import Column, MaskedColumn, QTable, Table
from astropy.table.meta import get_header_from_yaml
from astropy.time import Time, TimeDelta

HERE = Path(__file__).resolve().parent

# --- numbers of the right size ---------------------------------------------------------------------------------------

FULL_WELL, LINE_TIME_MS, REFERENCE_DOSE = 161000.0, 25.0, 1.78e8
SPECIES = [(0.35, 250.0), (0.49, 12.15), (0.7, 5000.0)]  # density per pixel at the reference dose, release in ms
RATE = 2.54e6 * 7 / 11  # MeV/g per year, averaged over the cycle


def digits(x, n=5):
    """x to n significant digits, as a list or a number."""
    if np.ndim(x):
        return [digits(y, n) for y in x]
    return float(f"{x:.{n}g}")


def noise(seed, n, sigma):
    return np.random.default_rng(seed).normal(0.0, 1.0, n) * sigma


def dose(t_yr, seed=1, sigma=2e4):
    t = np.asarray(t_yr, float)
    return digits(RATE * t + noise(seed, t.size, sigma), 6)


def lost(k, signal, transfers, t_yr, background=120.0, dose_mev_g=None):
    """Electrons that appear k pixels behind a packet, with every trap below the cloud filled once per transfer."""
    k, signal, transfers, t_yr = np.broadcast_arrays(*(np.asarray(x, float) for x in (k, signal, transfers, t_yr)))
    scale = (RATE * t_yr if dose_mev_g is None else dose_mev_g) / REFERENCE_DOSE
    height = np.sqrt((signal + background) / FULL_WELL) - np.sqrt(background / FULL_WELL)
    out = 0.0
    for density, release_ms in SPECIES:
        tau = release_ms / LINE_TIME_MS
        out = out + density * scale * height * transfers * (np.exp(-(k - 1) / tau) - np.exp(-k / tau))
    return out


def trail(k, signal, transfers, t_yr, sigma, seed=1, **more):
    x = lost(k, signal, transfers, t_yr, **more) / np.asarray(signal, float)
    return digits(x + noise(seed, x.size, sigma))


def packet(signal, transfers, t_yr, sigma, seed=1, **more):
    total = sum(lost(k, signal, transfers, t_yr, **more) for k in range(1, 400))
    return digits(np.asarray(signal, float) - total + noise(seed, np.size(total), sigma), 6)


def eper(k, signal, transfers, sigma, seed=1, **more):
    x = lost(k, signal, transfers, 0.0, **more)
    return digits(x + noise(seed, x.size, sigma))


def delta_e1(t_yr, galaxy, sigma, seed=1):
    size = np.array([{"faint": 1.0, "bright": 0.3, "large": 0.35, "disc": 0.3}[g] for g in galaxy])
    t = np.asarray(t_yr, float)
    return digits(-1.0e-3 * size * t / 3.8 + noise(seed, t.size, sigma))


# --- files that must be read -----------------------------------------------------------------------------------------

# Time formats with numbers or text, besides those that are written one by one below.
OTHER_FORMATS = (
    "jd unix unix_tai cxcsec gps plot_date datetime iso yday datetime64 fits byear jyear byear_str jyear_str".split()
)

VALID = {}  # name of the file -> its text


def ecsv(table, delimiter=" ", **options):
    out = io.StringIO()
    table.write(out, format="ascii.ecsv", delimiter=delimiter, **options)
    return out.getvalue().replace("\r\n", "\n")  # astropy ends lines as the system does


def valid(name, table, delimiter=" ", edit=lambda text: text, **options):
    VALID[name] = edit(ecsv(table, delimiter, **options))


def replaced(text, *pairs):
    for old, new in pairs:
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
        text = text.replace(old, new)
    return text


def make_valid():
    # Comma, plain dict as meta (sorted when written), units as Unit objects on plain columns.
    t = [0.5, 1.0, 2.0, 3.0, 4.0]
    valid(
        "dose_plain_dict.ecsv",
        Table(
            [Column(t, "t_yr", unit=u.yr), Column(dose(t), "value", unit=u.MeV / u.g), Column([2e4] * 5, "sigma", unit=u.MeV / u.g)],
            meta={"observable": "dose", "instrument": "dose monitor 2"},
        ),
        ",",
    )

    # Blank (astropy's default: the header then names no delimiter), meta set key by key: !!omap, in that order.
    k = [1, 2, 3, 5, 8]
    tab = Table({"trail_px": k, "value": trail(k, 1000.0, 1650, 3.0, 2e-5), "sigma": [2e-5] * 5})
    tab["trail_px"].unit = u.pix
    tab["value"].unit = u.dimensionless_unscaled  # written as unit: ''
    tab.meta["observable"] = "trail"
    tab.meta["t_yr"] = 3.0
    tab.meta["signal_e"] = 1000
    tab.meta["background_e"] = 120.0
    tab.meta["transfers"] = 1650
    valid("trail_omap_blank.ecsv", tab)

    # Nested meta: mappings and lists in each other, OrderedDict within, null, booleans, strings that look like something
    # else, numpy scalars, keys that YAML must quote, and one object twice (anchor and alias).
    amplifier = {"name": "E", "gain_e_per_adu": 0.9987}
    k = [1, 2, 3, 4, 6, 10]
    tab = Table(
        {"trail_px": k, "value": eper(k, 5000.0, 1650, 0.1, dose_mev_g=1.0e7), "sigma": [0.1] * 6},
        meta={
            "observable": "eper",
            "signal_e": 5000.0,
            "background_e": 120,
            "block_px": np.int64(200),
            "transfers": 1650,
            "dose_mev_g": np.float64(1.0e7),
            "temperature_k": np.float32(133.0),
            "device": {
                "serial": "0042",
                "irradiated": True,
                "annealed": None,
                "history": [
                    {"step": "proton irradiation", "energy_mev": 12.5, "fluence_cm2": 1.0e20},
                    {"step": "cool-down", "to_k": 133.0},
                ],
                "layout": OrderedDict(rows=3512, columns=3512, amplifiers=["E", "F", "G", "H"]),
            },
            "read_by": amplifier,
            "calibrated_by": amplifier,
            "empty_list": [],
            "empty_mapping": {},
            "empty_string": "",
            "looks_like": {"date": "2012-01-01", "number": "1.0", "no": "no", "null": "null", "time": "12:30:00"},
            "1": "a key that is a number when not quoted",
            "taken": datetime.date(2012, 1, 1),
            "chi: squared": 1.25,
            "matrix": [[1, 2], [3, 4]],
            "floats": [0.1, -2.5e-07, 1.0e20, math.inf, math.nan],
        },
    )
    valid("eper_nested_meta.ecsv", tab, ",")
    tab = tab.copy()
    tab.meta = OrderedDict(tab.meta)
    valid("eper_nested_omap.ecsv", tab, ",")

    # QTable: every Quantity stands in __serialized_columns__, with tags of astropy's own. `value` cannot be one.
    k = [1, 2, 3, 5]
    q = QTable(
        {
            "t_yr": [3.0] * 4 * u.yr,
            "signal_e": [1000.0, 1000.0, 3000.0, 3000.0] * u.electron,
            "trail_px": k,
            "value": trail(k, [1000.0, 1000.0, 3000.0, 3000.0], 1650, 3.0, 2e-5),
            "sigma": [2e-5] * 4 * u.dimensionless_unscaled,
            "line_time_ms": [25.0] * 4 * u.ms,
            "temperature_k": [133.0, 133.0, 133.1, 133.1] * u.K,
        }
    )
    q.meta["observable"] = "trail"
    q.meta["background_e"] = 120.0
    q.meta["transfers"] = 1650
    valid("trail_qtable.ecsv", q)

    # The same idea with Quantity columns for value and sigma, turned into a Table first (the only way to write them).
    n = [500.0, 1500.0, 6000.0]
    q = QTable(
        {
            "signal_e": n * u.electron,
            "dose_mev_g": [1.0e7, 1.0e7, 2.0e7] * u.MeV / u.g,
            "value": packet(n, 1650, 0.0, 1.2, dose_mev_g=np.array([1.0e7, 1.0e7, 2.0e7])) * u.electron,
            "sigma": [1.2] * 3 * u.electron,
        }
    )
    q.meta.update(observable="packet_charge", transfers=1650, background_e=120.0)
    valid("packets_table_of_qtable.ecsv", Table(q), ",")

    # Custom unit strings, descriptions, formats (that do not change what is written), meta of a column, a unit astropy
    # does not know, adu, percent; column headers become blocks in the header.
    n = [500.0, 1500.0, 6000.0, 20000.0]
    tab = Table(
        [
            Column(n, "signal_e", unit="e-", description="charge put in: by Fe-55, or flashed [see log] # 3"),
            Column([1650, 1650, 800, 800], "transfers", description="row + 1", format="%05d"),
            Column(packet(n, [1650, 1650, 800, 800], 4.0, 1.2), "value", unit="e-", format=".3f", meta={"gain": 0.9987, "amplifier": "E"}),
            Column([1.2, 1.2, 1.3, 1.5], "sigma", unit="e-", format="{:.1e}", description='"scatter" of 25 packets'),
            Column([500.7, 1502.0, 6007.8, 20026.0], "peak_adu", unit=u.adu),
            Column([0.1, 0.1, 0.3, 0.4], "occupancy", unit=u.percent),
            Column([12.0, 12.5, 12.5, 13.0], "bias", unit="DN/volt-ish", meta=OrderedDict(probe="B", read_at={"row": 12})),
        ],
        meta={"observable": "packet_charge", "t_yr": 4.0, "background_e": 120.0},
    )
    valid("packets_units_formats.ecsv", tab, ",")

    # Units that are not those of the contract but mean the same quantity: days, seconds, degrees Celsius.
    n = [500.0, 1500.0, 6000.0]
    tab = Table(
        [
            Column([730.5, 1095.75, 1461.0], "t_yr", unit=u.day),
            Column(n, "signal_e", unit=u.electron),
            Column([-140.15] * 3, "temperature_k", unit=u.deg_C),
            Column([0.025] * 3, "line_time_ms", unit=u.s),
            Column(packet(n, 1650, [2.0, 3.0, 4.0], 1.2), "value", unit=u.electron),
            Column([1.2] * 3, "sigma", unit=u.electron),
        ],
        meta={"observable": "packet_charge", "background_e": 120.0, "transfers": 1650},
    )
    valid("packets_other_units.ecsv", tab, ",")

    # Time columns: ISO (a blank within the cell), without time of day, ISO 8601 with T, MJD, decimal year, and jd1 + jd2 in two columns.
    days = ["2009-07-02 12:00:00", "2010-01-01 00:00:00", "2011-07-02 06:30:00", "2012-07-01 00:00:00"]
    t = [0.5, 1.0, 2.5, 3.5]

    def dated(time, observable):
        if observable == "dose":
            tab = Table({"date": time, "value": dose(t), "sigma": [2e4] * 4})
        else:
            tab = Table({"date": time, "value": packet([1500.0] * 4, 1650, t, 1.2), "sigma": [1.2] * 4})
            tab.meta.update(signal_e=1500.0, background_e=120.0, transfers=1650)
        tab.meta["observable"] = observable
        return tab

    valid("dose_time_iso.ecsv", dated(Time(days), "dose"))
    valid("dose_time_day.ecsv", dated(Time([d[:10] for d in days], out_subfmt="date"), "dose"), ",")
    valid("packets_time_isot.ecsv", dated(Time([d.replace(" ", "T") for d in days]), "packet_charge"), ",")
    valid("packets_time_mjd.ecsv", dated(Time(Time(days).mjd, format="mjd", scale="tt"), "packet_charge"), ",")
    valid("packets_time_decimalyear.ecsv", dated(Time(digits(Time(days).decimalyear, 8), format="decimalyear"), "packet_charge"))
    valid("dose_time_jd1_jd2.ecsv", dated(Time(days), "dose"), ",", serialize_method="jd1_jd2")

    # The other formats, most in a scale of their own. (`datetime` and `ymdhms` become objects and several columns.)
    for scale, name in zip(itertools.cycle(["utc", "tai", "tt", "tdb", "tcg", "tcb"]), OTHER_FORMATS):
        time = getattr(Time(days, format="iso", scale="utc"), scale)
        valid(f"packets_time_{name}.ecsv", dated(Time(time, format=name), "packet_charge"), ",")
    valid("dose_time_tdb.ecsv", dated(Time(days, scale="utc").tdb, "dose"), ",")

    # Time differences, which are days, seconds, or days in two parts.
    for name, form, options in [
        ("jd", "jd", {}),
        ("sec", "sec", {}),
        ("jd1_jd2", "jd", {"serialize_method": "jd1_jd2"}),
    ]:
        tab = Table({"t_yr": TimeDelta(np.array(t) * 365.25, format="jd"), "value": dose(t), "sigma": [2e4] * 4})
        tab["t_yr"].format = form
        tab.meta["observable"] = "dose"
        valid(f"dose_difference_{name}.ecsv", tab, ",", **options)

    # Dates that are no Time: strings, and numpy's datetime64 (which astropy writes with its own name for a datatype).
    valid("dose_date_strings.ecsv", dated([d[:10] for d in days], "dose"), ",")
    valid("dose_date_datetime64.ecsv", dated(np.array([d[:10] for d in days], dtype="datetime64[D]"), "dose"), ",")

    # Missing values in covariates of every type; with serialize_method="data_mask" the mask is a column of its own.
    k = [1, 2, 3, 5]

    def masked():
        return Table(
            [
                Column(k, "trail_px"),
                Column(trail(k, 1000.0, 1650, 3.0, 2e-5), "value"),
                Column([2e-5] * 4, "sigma"),
                MaskedColumn([133.0, 133.1, 0.0, 133.2], "thermometer_b", unit=u.K, mask=[0, 0, 1, 0]),
                MaskedColumn([12, 0, 14, 0], "run", mask=[0, 1, 0, 1]),
                MaskedColumn([True, False, True, False], "lamp_on", mask=[1, 0, 0, 0]),
                MaskedColumn(["north", "", "south east", "none"], "quadrant", mask=[0, 0, 0, 1]),
                MaskedColumn([0.0] * 4, "humidity", mask=[1, 1, 1, 1]),
            ],
            meta={"observable": "trail", "t_yr": 3.0, "signal_e": 1000.0, "background_e": 120.0, "transfers": 1650},
        )

    valid("trail_masked_comma.ecsv", masked(), ",")
    valid("trail_masked_blank.ecsv", masked())
    valid("trail_masked_data_mask.ecsv", masked(), ",", serialize_method="data_mask")

    # Masked Quantity in a QTable.
    q = QTable(masked(), masked=True)
    valid("trail_masked_qtable.ecsv", q, ",")

    # Strings: blanks, both quotes, commas, number signs, backslash, other alphabets, words that look like values; and column
    # names that must be quoted.
    names = ["faint", "large", "faint", "large", "bright", "disc"]
    t = [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]
    tab = Table(
        [
            Column(t, "t_yr"),
            Column(names, "galaxy"),
            Column(delta_e1(t, names, 2e-5), "value"),
            Column([2e-5] * 6, "sigma"),
            Column(["plain", "two words", 'the "good" half', "it's, say, fine", "# not a comment", "Ångström, µm, 銀河"], "note"),
            Column(["nan", "1", "true", "null", "a\\b", "-"], "looks like"),
        ],
        meta={"observable": "delta_e1", "transfers": 1650, "background_e": 120.0, "observer": "Jürgen O'Neill", "motto": 'say "e1": -'},
    )
    valid("delta_e1_strings_comma.ecsv", tab, ",")
    valid("delta_e1_strings_blank.ecsv", tab)

    # Other datatypes: small and unsigned integers, float32 (values and conditions alike), bool.
    n = [500.0, 1500.0, 6000.0, 20000.0]
    tab = Table(
        [
            Column(n, "signal_e", dtype="float32"),
            Column([1650, 1650, 800, 800], "transfers", dtype="int16"),
            Column(packet(n, [1650, 1650, 800, 800], 4.0, 1.2), "value", dtype="float32"),
            Column([1.2, 1.2, 1.3, 1.5], "sigma", dtype="float32"),
            Column([True, False, True, True], "cosmic_rays_removed"),
            Column([0, 128, 255, 7], "quality", dtype="uint8"),
            Column([9007199254740993, 1, -1, 0], "exposure", dtype="int64"),
            Column([18446744073709551615, 1, 2, 3], "checksum", dtype="uint64"),
            Column([0.5, 0.25, 65504.0, 0.1], "weight", dtype="float16"),
        ],
        meta={"observable": "packet_charge", "t_yr": 4.0, "background_e": 120.0},
    )
    valid("packets_datatypes.ecsv", tab, ",")

    # More than one number in a cell (JSON in a string): fixed length, with missing elements, two by two, variable length.
    k = [1, 2, 3]
    ragged = np.empty(3, dtype=object)
    ragged[:] = [np.array([1.0]), np.array([1.0, 2.5]), np.array([])]
    tab = Table(
        [
            Column(k, "trail_px"),
            Column(trail(k, 1000.0, 1650, 3.0, 2e-5), "value"),
            Column([2e-5] * 3, "sigma"),
            Column([[10.5, 1650.0], [11.5, 1650.0], [12.5, 1650.0]], "position", unit=u.pix),
            MaskedColumn([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], "halves", mask=[[0, 0], [0, 1], [1, 1]]),
            Column(np.arange(12).reshape(3, 2, 2), "quadrants"),
            Column(ragged, "neighbours"),
        ],
        meta={"observable": "trail", "t_yr": 3.0, "signal_e": 1000.0, "background_e": 120.0, "transfers": 1650},
    )
    valid("trail_multidimensional_comma.ecsv", tab, ",")
    valid("trail_multidimensional_blank.ecsv", tab)

    # Objects: JSON in a string.
    things = np.empty(4, dtype=object)
    things[:] = [{"lamp": "UV", "flashes": 3}, [1, 2, None], None, 'a "word"']
    k = [1, 2, 4, 8]
    tab = Table({"trail_px": k, "value": eper(k, 5000.0, 1650, 0.1, dose_mev_g=1.0e7), "sigma": [0.1] * 4, "setup": things})
    tab.meta.update(observable="eper", signal_e=5000.0, background_e=120.0, block_px=200, transfers=1650, dose_mev_g=1.0e7)
    valid("eper_objects.ecsv", tab, ",")

    # NaN and infinities in covariates (never in value, sigma or a condition).
    n = [500.0, 1500.0, 6000.0, 20000.0]
    tab = Table(
        {
            "signal_e": n,
            "value": packet(n, 1650, 4.0, 1.2),
            "sigma": [1.2] * 4,
            "residual_gain": [1.0e-4, math.nan, -math.inf, math.inf],
            "tiny": [1e-300, 5e-324, -0.0, 1.7976931348623157e308],
        }
    )
    tab.meta.update(observable="packet_charge", t_yr=4.0, background_e=120.0, transfers=1650, reduced_chi2=math.nan)
    valid("packets_nan_inf.ecsv", tab)

    # Long strings in meta, folded over several lines: plain, in single quotes (they hold ": " or " #"), in double quotes (they hold text
    # outside ASCII, and folds are then marked by a backslash); and a long list.
    prose = (
        "The block was written by flat illumination through the 450 nm filter and read at the nominal clock; rows with a "
        "cosmic ray within 20 pixels were left out and the remaining columns averaged with weights from the photon transfer curve, "
        "twice, by two people who did not talk to each other until the numbers agreed"
    )
    k = [1, 2, 3, 4]
    tab = Table({"trail_px": k, "value": eper(k, 5000.0, 1650, 0.1, dose_mev_g=1.0e7), "sigma": [0.1] * 4})
    tab.meta = {
        "observable": "eper",
        "signal_e": 5000.0,
        "background_e": 120.0,
        "block_px": 200,
        "transfers": 1650,
        "dose_mev_g": 1.0e7,
        "method": prose,
        "method_quoted": "Note: " + prose + " # it's the second version, 'v2'; see also: log",
        "method_accents": "Messung in München, 25 µm pixels – " + prose + " – ±3 °C   (three blanks before this)",
        "path": "/data/irradiation/2012/campaign-03/" + "very-long-directory-name/" * 6 + "frame.fits",
        "rows_used": list(range(1500, 1548)),
        "people": {"first": prose[:100], "second": [prose[20:160], "short"]},
    }
    tab["value"].description = prose
    valid("eper_long_meta.ecsv", tab, ",")
    tab = tab.copy()
    tab.meta = OrderedDict((key, tab.meta[key]) for key in reversed(tab.meta))
    valid("eper_long_omap.ecsv", tab)

    # Strings of several lines in meta. astropy writes the first in single quotes, with blank lines for the line ends, and
    # loses them when it reads this; the second, which has an indented line, in double quotes, and loses nothing.
    tab = Table({"t_yr": [1.0, 2.0, 3.0], "value": dose([1.0, 2.0, 3.0]), "sigma": [2e4] * 3})
    tab.meta = {
        "observable": "dose",
        "log": "first line\nsecond: line\n\nafter a blank line\n",
        "log_indented": "first line\nsecond: line\n\n  indented after a blank line\n",
        "tab": "a\tb",
    }
    valid("meta_newline.ecsv", tab, ",")

    # Quantity, unit, Time, tuple and array in meta.
    k = [1, 2, 3]
    tab = Table({"trail_px": k, "value": trail(k, 1000.0, 1650, 3.0, 2e-5), "sigma": [2e-5] * 3})
    tab.meta = {
        "observable": "trail",
        "t_yr": 3.0,
        "signal_e": 1000.0,
        "transfers": 1650,
        "background_e": 120.0 * u.electron,
        "temperature_k": 133.0 * u.K,
        "line_time_ms": 25.0 * u.ms,
        "taken": Time("2012-01-01 12:00:00"),
        "unit_of_gain": u.electron / u.adu,
        "window": (100, 1650),
        "bias_levels": np.array([1.5, 2.5]),
    }
    valid("meta_quantities.ecsv", tab, ",")

    # Comments. What astropy keeps of comments it found in another file stands in meta as a list; those typed into the file by
    # hand are YAML comments in the header ("# # ..."), blank lines, and comment lines among the rows.
    tab = Table({"t_yr": [1.0, 2.0, 3.0, 4.0], "value": dose([1.0, 2.0, 3.0, 4.0]), "sigma": [2e4] * 4})
    tab.meta["comments"] = ["written by the monitor, version 3", "calibration: none", "", "end"]
    tab.meta["observable"] = "dose"

    def by_hand(text):
        lines = text.splitlines()
        lines.insert(2, "# # typed by hand: a YAML comment")
        lines.insert(3, "#")
        rows = next(i for i, line in enumerate(lines) if line.startswith("t_yr"))
        lines.insert(rows, "")
        lines.insert(rows + 3, "# monitor switched off for a week")
        lines.insert(rows + 5, "")
        return "\n".join(lines) + "\n\n"

    valid("dose_comments.ecsv", tab, ",", by_hand)

    # Numbers as people type them into a header: to YAML 1.1, and so to astropy, 1.0e7 is a string and 1.2e+2 is a number.
    # By hand too: blocks instead of braces, the version of older astropy, no schema, blanks at line ends.
    VALID["hand_exponent.ecsv"] = (
        "# %ECSV 0.9\n"
        "# ---\n"
        "# datatype:\n"
        "# - name: trail_px\n"
        "#   datatype: int64\n"
        "# - name: value\n"
        "#   unit: electron   \n"
        "#   datatype: float64\n"
        "# - {datatype: float64, unit: 'electron', name: sigma}\n"
        "# meta:\n"
        "#   observable: eper  # what is measured\n"
        "#   signal_e: 5.0e+3\n"
        "#   background_e: 1.2e+2\n"
        "#   block_px: 200\n"
        "#   transfers: +1650\n"
        "#   dose_mev_g: 1.0e7\n"
        "#   operator: |\n"
        "#     A. N. Other\n"
        '# delimiter: ","\n'
        "trail_px,value,sigma\n"
        + "".join(f"{k},{v}, 0.1 \n" for k, v in zip([1, 2, 3], eper([1, 2, 3], 5000.0, 1650, 0.1, dose_mev_g=1.0e7)))
    )

    # One row, everything else in meta.
    tab = Table({"value": trail([1], 1000.0, 1650, 3.0, 2e-5), "sigma": [2e-5]})
    tab.meta.update(observable="trail", t_yr=3.0, trail_px=1, signal_e=1000.0, background_e=120.0, transfers=1650)
    valid("one_row.ecsv", tab)

    # CRLF, as astropy writes on Windows; no line end at the end.
    tab = Table({"t_yr": [1.0, 2.0, 3.0], "value": dose([1.0, 2.0, 3.0]), "sigma": [2e4] * 3})
    tab.meta["observable"] = "dose"
    valid("dose_crlf.ecsv", tab, ",", lambda text: text.replace("\n", "\r\n"))
    valid("dose_no_last_line_end.ecsv", tab, " ", lambda text: text.rstrip("\n"))

    # Plain CSV: comment lines `# key: value`, then names, then rows. By hand.
    k = [1, 2, 3, 5]
    rows = zip([2.0, 2.0, 3.0, 3.0], k, trail(k, 1000.0, 1650, [2.0, 2.0, 3.0, 3.0], 2e-5), ["a", '"b, c"', "", "d"])
    VALID["trail_plain.csv"] = (
        "# observable: trail\n# signal_e: 1000.0\n# background_e: 120\n# transfers: 1650\n# taken by: the night shift\n"
        "t_yr,trail_px,value,sigma,note\n" + "".join(f"{t},{k},{v},2e-05,{n}\n" for t, k, v, n in rows)
    )
    VALID["dose_plain.csv"] = (
        "# observable: dose\ndate,value,sigma\n"
        + "".join(f"{d[:10]},{v},20000\n" for d, v in zip(days, dose([0.5, 1.0, 2.5, 3.5])))
    )
    # The same as a spreadsheet saves it: CRLF, and a byte order mark.
    VALID["dose_spreadsheet.csv"] = "\ufeff" + VALID["dose_plain.csv"].replace("\n", "\r\n")


# --- what is in them --------------------------------------------------------------------------------------------------


def plain(x):
    """x as JSON can say it."""
    if x is np.ma.masked or x is None:
        return None
    if isinstance(x, dict):
        return {str(key): plain(value) for key, value in x.items()}
    if isinstance(x, np.ma.MaskedArray):
        return [plain(y) for y in x]
    if isinstance(x, u.UnitBase):
        return x.to_string()
    if isinstance(x, Time):
        return x.iso if x.isscalar else list(x.iso)
    if isinstance(x, u.Quantity):
        return {"value": plain(x.value), "unit": plain(x.unit)}
    if isinstance(x, np.ndarray):
        return [plain(y) for y in x] if x.ndim else plain(x[()])
    if isinstance(x, (list, tuple)):
        return [plain(y) for y in x]
    if isinstance(x, (bool, np.bool_)):
        return bool(x)
    if isinstance(x, (int, np.integer)):
        return int(x)
    if isinstance(x, (float, np.floating)):
        x = float(str(x))  # a float32 as its shortest decimal
        return x if math.isfinite(x) else str(x)
    if isinstance(x, (datetime.date, np.datetime64)):
        return str(x)
    assert isinstance(x, str), type(x)
    return str(x)


def read_csv(text):
    """The plain CSV of the contract, by astropy's reader and guesses."""
    meta, text = {}, text.lstrip("\ufeff")
    for line in text.splitlines():
        if line.startswith("#"):
            key, value = line[1:].split(":", 1)
            meta[key.strip()] = yaml.safe_load(value)
    tab = io_ascii.read(text, format="csv", comment="#")
    tab.meta = meta
    return tab, {name: {"datatype": tab[name].dtype.name} for name in tab.colnames}


def read_ecsv(text):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InvalidEcsvDatatypeWarning)  # datetime64
        tab = Table.read(text, format="ascii.ecsv")
    lines = itertools.takewhile(lambda line: line.startswith("#"), (x.strip() for x in text.splitlines() if x.strip()))
    header = get_header_from_yaml([line[1:] for line in lines if line != "#"])  # as astropy does it
    return tab, {item["name"]: item for item in header["datatype"]}


def content(name, text):
    tab, header = (read_csv if name.endswith(".csv") else read_ecsv)(text)
    columns = []
    for key in tab.colnames:
        column = tab[key]
        is_time = isinstance(column, Time)
        item = header.get(key, {"datatype": "string" if is_time else "float64"})
        unit = None if is_time else {"jd": "d", "sec": "s"}[column.format] if isinstance(column, TimeDelta) else column.unit
        out = {"name": key, "unit": str(unit) if unit is not None and str(unit) else None}
        out["datatype"] = "string" if item["datatype"].startswith("str") else item["datatype"]
        if "subtype" in item:
            out["subtype"] = item["subtype"]
        is_text = is_time and item["datatype"] == "string"
        out["values"] = [plain(x) for x in (column.value if is_time or isinstance(column, TimeDelta) else column)]
        if is_text and column.format in ("datetime", "datetime64"):
            out["values"] = [x.isoformat() if column.format == "datetime" else str(x) for x in column.value]
        if is_time:
            out["time"] = {"format": column.format, "scale": column.scale, "utc": list(Time(column.utc, out_subfmt="*").iso)}
        columns.append(out)
    return {"meta": plain(dict(tab.meta)), "columns": columns}


def json_text(found):
    one = lambda x: json.dumps(x, ensure_ascii=False, allow_nan=False)
    columns = ",\n".join("    " + one(column) for column in found["columns"])
    return f'{{"meta": {one(found["meta"])},\n "columns": [\n{columns}]}}\n'


# --- files that must be refused ----------------------------------------------------------------------------------------

BROKEN = {}


def make_broken():
    k, t = [1, 2, 3, 5], [2.0, 2.0, 3.0, 3.0]
    trails = Table(
        [
            Column(t, "t_yr", unit=u.yr),
            Column([1000.0] * 4, "signal_e", unit=u.electron),
            Column(k, "trail_px"),
            Column(trail(k, 1000.0, 1650, t, 2e-5), "value"),
            Column([2e-5] * 4, "sigma"),
        ],
        meta={"observable": "trail", "transfers": 1650, "background_e": 120.0},
    )
    doses = Table(
        [Column([1.0, 2.0, 3.0], "t_yr"), Column(dose([1.0, 2.0, 3.0]), "value", unit=u.MeV / u.g), Column([2e4] * 3, "sigma", unit=u.MeV / u.g)],
        meta={"observable": "dose"},
    )
    names = ["faint", "large", "faint"]
    shapes = Table(
        {"t_yr": [1.0, 2.0, 3.0], "galaxy": names, "value": delta_e1([1.0, 2.0, 3.0], names, 2e-5), "sigma": [2e-5] * 3},
        meta={"observable": "delta_e1", "transfers": 1650},
    )
    blocks = Table({"trail_px": k, "value": eper(k, 5000.0, 1650, 0.1, dose_mev_g=1.0e7), "sigma": [0.1] * 4})
    blocks.meta = {"observable": "eper", "signal_e": 5000.0, "background_e": 120.0, "block_px": 200, "transfers": 1650, "dose_mev_g": 1.0e7}
    base, base_dose, base_shape = ecsv(trails, ","), ecsv(doses, ","), ecsv(shapes, ",")
    base_csv = VALID["trail_plain.csv"]

    def write(name, text):
        BROKEN[name if "." in name else name + ".ecsv"] = text

    def edited(name, *pairs, of=base):
        write(name, replaced(of, *pairs))

    def changed(name, table, columns=(), remove=(), **meta):
        """The table with columns added or replaced, others removed, and meta set (None removes)."""
        table = table.copy()
        for key in remove:
            table.remove_column(key)
        for key, column in dict(columns).items():
            at = table.colnames.index(key) if key in table.colnames else 0
            if key in table.colnames:
                table.remove_column(key)
            table.add_column(column, name=key, index=at)
        for key, value in meta.items():
            if value is None:
                table.meta.pop(key)
            else:
                table.meta[key] = value
        write(name, ecsv(table, ","))

    first = base.splitlines()[-4]  # the first row
    cells = first.split(",")

    def in_first_row(name, column, cell):
        row = list(cells)
        row[trails.colnames.index(column)] = cell
        edited(name, (first, ",".join(row)))

    # what is measured
    changed("no_observable", trails, observable=None)
    edited("unknown_observable", ("observable: trail", "observable: trial"))
    changed("no_value_column", trails, remove=["value"])
    changed("no_sigma_column", trails, remove=["sigma"])
    in_first_row("sigma_zero", "sigma", "0.0")
    in_first_row("sigma_negative", "sigma", "-2e-05")
    in_first_row("sigma_nan", "sigma", "nan")
    in_first_row("sigma_missing", "sigma", '""')
    in_first_row("value_nan", "value", "nan")
    in_first_row("value_infinite", "value", "inf")
    in_first_row("value_missing", "value", '""')

    # conditions
    changed("krad_dose", doses, {"value": Column([3.2, 6.5, 9.7], unit="krad"), "sigma": Column([0.1] * 3, unit="krad")})
    changed("krad_dose_mev_g", trails, {"dose_mev_g": Column([5.0, 5.0, 10.0, 10.0], unit="krad")}, remove=["t_yr"])
    changed("celsius_temperature", trails, temperature_k=-140.0)
    changed("celsius_temperature_column", trails, {"temperature_k": [-140.0, -140.0, -140.1, -139.9]})
    changed("column_temperature_K", trails, {"temperature_K": [133.0, 133.0, 133.1, 132.9]})
    changed("column_lne_time_ms", trails, {"lne_time_ms": [25.0, 25.0, 25.0, 30.0]})
    changed("line_time_in_metres", trails, {"line_time_ms": Column([25.0] * 4, unit=u.m)})
    in_first_row("before_launch", "t_yr", "-0.5")
    changed("date_before_launch", doses, {"date": ["2008-07-01", "2010-01-01", "2011-01-01"]}, remove=["t_yr"])
    changed("date_is_none", doses, {"date": ["2009-13-01", "2010-01-01", "2011-01-01"]}, remove=["t_yr"])
    changed("date_and_t_yr_contradict", doses, {"date": ["2010-01-01", "2011-01-01", "2014-07-01"]})
    edited("unknown_galaxy", ("1.0,faint,", "1.0,feint,"), of=base_shape)
    in_first_row("trail_px_zero", "trail_px", "0")
    changed("trail_px_fraction", trails, {"trail_px": [1.0, 1.5, 2.0, 3.0]})
    changed("missing_trail_px", trails, remove=["trail_px"])
    changed("missing_signal", trails, remove=["signal_e"])
    changed("missing_time_and_dose", trails, remove=["t_yr"])
    changed("missing_block_px", blocks, block_px=None)
    changed("transfers_zero", trails, transfers=0)
    changed("transfers_fraction", trails, transfers=1650.5)
    changed("signal_zero", trails, {"signal_e": Column([1000.0, 0.0, 1000.0, 1000.0], unit=u.electron)})
    changed("background_negative", trails, background_e=-120.0)

    # the format
    edited("ragged_row", (first, first + ",7"))
    edited("short_row", (first, ",".join(cells[:-1])))
    in_first_row("not_a_number", "value", "0.0O3")
    in_first_row("decimal_comma", "value", '"0,0031"')
    edited("not_an_integer", (first, first.replace(",1,", ",one,", 1)))
    write("empty_file", "")
    write("no_rows", base[: base.index(first)])
    write("header_only", base[: base.index("t_yr,signal_e")])
    edited("bad_yaml", ("# meta: {", "# meta: observable: {"))
    edited("header_unclosed", ("transfers: 1650}", "transfers: 1650"))
    edited("not_ecsv_version", ("%ECSV 1.0", "%ECSV one"))
    edited("unknown_delimiter", ("delimiter: ','", "delimiter: '|'"))
    edited("wrong_delimiter", ("# delimiter: ','\n", ""))
    edited("unknown_datatype", ("- {name: value, datatype: float64}", "- {name: value, datatype: real}"))
    again = [(row, row + ",0.5") for row in base.splitlines()[-4:]]
    last = "# - {name: sigma, datatype: float64}\n"
    edited("duplicate_column", (last, last + last.replace("sigma", "value")), ("value,sigma\n", "value,sigma,value\n"), *again)
    edited("wrong_count_of_datatypes", ("# - {name: sigma, datatype: float64}\n", ""))
    edited("other_names_in_header", ("trail_px,value,sigma\n", "trail_px,sigma,value\n"))
    edited("meta_is_a_list", ("# meta: {background_e: 120.0, observable: trail, transfers: 1650}", "# meta: [observable, trail]"))
    write("utf16", base.encode("utf-16"))

    # plain CSV
    edited("no_observable.csv", ("# observable: trail\n", ""), of=base_csv)
    edited("unknown_observable.csv", ("# observable: trail\n", "# observable: trial\n"), of=base_csv)
    row = base_csv.splitlines()[6]
    edited("ragged_row.csv", (row, row + ",7"), of=base_csv)
    edited("not_a_number.csv", (row, row.replace("2e-05", "2e-O5")), of=base_csv)
    edited("meta_background_ee.csv", ("# background_e:", "# background_ee:"), of=base_csv)
    edited("no_rows.csv", (base_csv[base_csv.index(row):], ""), of=base_csv)
    edited("no_names.csv", ("t_yr,trail_px,value,sigma,note\n", ""), of=base_csv)


# --- writing and checking ---------------------------------------------------------------------------------------------


def everything():
    make_valid()
    make_broken()
    files = {}
    for name, text in VALID.items():
        files[name] = text.encode()
        files[Path(name).with_suffix(".json").name] = json_text(content(name, text)).encode()
    for name, text in BROKEN.items():
        files["broken/" + name] = text if isinstance(text, bytes) else text.encode()
    return files


def say_of_broken():
    for name, text in sorted(BROKEN.items()):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                (read_csv if name.endswith(".csv") else read_ecsv)(text.decode() if isinstance(text, bytes) else text)
            answer = "reads it"
        except Exception as error:  # whatever astropy raises
            answer = f"{type(error).__name__}: {str(error).splitlines()[0]}"
        print(f"{name:36} {answer[:110]}")


def main():
    if astropy.__version__ != "6.1.7" or np.__version__ != "1.26.4":
        print(f"note: made with astropy 6.1.7 and numpy 1.26.4; this is {astropy.__version__}, {np.__version__}", file=sys.stderr)
    files = everything()
    kept = {"make.py", ".gitattributes", "README.md"}
    here = {str(path.relative_to(HERE)) for path in HERE.rglob("*") if path.is_file()} - kept
    here = {name for name in here if "__pycache__" not in name}
    if sys.argv[1:] == ["--check"]:
        differ = [name for name, data in files.items() if name not in here or (HERE / name).read_bytes() != data]
        say_of_broken()
        for name in sorted(here - set(files)):
            print(f"not written by this script: {name}")
        for name in differ:
            print(f"differs: {name}")
        print(f"{len(VALID)} valid, {len(BROKEN)} broken, {len(differ)} differ")
        return 1 if differ or here - set(files) else 0
    if sys.argv[1:]:
        print(__doc__)
        return 2
    (HERE / "broken").mkdir(exist_ok=True)
    for name, data in files.items():
        (HERE / name).write_bytes(data)
    print(f"{len(VALID)} valid and {len(BROKEN)} broken files written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
