#!/usr/bin/env python3
"""Golden frames after parallel and serial transfer (frames.json), and a FITS file as a camera writes it (camera.fits).

Made by   arcticpy 2.6 (public add_cti, express = 0: every transfer is followed) and astropy 6.1.7 (io.fits), numpy 1.26.4
          (Python 3.11); two seconds on one core.
Command   python tests/golden/frames.py                      writes frames.json and camera.fits
          python tests/golden/frames.py --check IN OUT       astropy opens what ctiplan has made of IN: checksums are right,
                                                             cards are IN's with CTI* and HISTORY behind them, tables are the same

frames.json
    One field of 60 rows and 40 columns: a sky of 60 e-, 25 stars of 200 to 60 000 e- in single pixels and a block, whole
    electrons. It is trailed along its columns, 500 rows away from the register (`parallel`); along its rows, 100 columns away
    from the amplifier (`serial`); and along both, columns first (`both`). Row 0 is nearest the register, column 0 nearest the
    amplifier. `dark` is the field with a frame of nothing around it (4 columns on the amplifier's side, 3 on the other, 5 rows
    on top), trailed along both: prescan and overscan. What is said of arcticpy in packets.py holds; the second program there
    agrees with it, so values are good to the 10 digits stored.

camera.fits
    HDU 0: no data; GAIN, a long string over CONTINUE cards, a HIERARCH card, COMMENT and HISTORY.
    HDU 1 (SCI): unsigned 16-bit integers (BZERO 32768), BUNIT DN, bias 500 DN, 1.5 e-/DN; `dark` with photon and read noise
                 (seed 1); CHECKSUM and DATASUM.
    HDU 2 (ERR): 32-bit floats. HDU 3 (DQ): 16-bit integers. HDU 4 (STARS): a binary table.
    HDU 5 (SCI): 32-bit floats, BUNIT ELECTRONS, some NaN.
"""
import os
import sys

import numpy as np

from galaxies import HERE, digits, write_json
from packets import DETECTORS

MADE_BY = "arcticpy 2.6 add_cti (express 0), numpy 1.26.4: python tests/golden/frames.py"
ROWS, COLUMNS = 60, 40
ROWS_BEFORE, COLUMNS_BEFORE = 500, 100
PRESCAN, OVERSCAN_COLUMNS, OVERSCAN_ROWS = 4, 3, 5
DETECTOR, PARALLEL = DETECTORS["n-channel"]
SERIAL = [(0.2, 1.3), (0.4, 12.0)]


def field():
    rng = np.random.default_rng(20)
    image = np.full((ROWS, COLUMNS), 60.0)
    for charge in np.geomspace(200.0, 60000.0, 25):
        image[rng.integers(ROWS), rng.integers(COLUMNS)] += np.round(charge)
    image[20:26, 10:14] += 3000.0
    return image


def trailed(image, parallel, serial):
    import arcticpy
    full_well, notch, power = DETECTOR
    ccd = arcticpy.CCD(phases=[arcticpy.CCDPhase(full_well_depth=full_well, well_notch_depth=notch,
                                                 well_fill_power=power)], fraction_of_traps_per_phase=[1.0])

    def arguments(name, traps, offset):
        roe = arcticpy.ROE(dwell_times=[1.0], prescan_offset=offset, empty_traps_between_columns=True,
                           empty_traps_for_first_transfers=True)
        species = [arcticpy.TrapInstantCapture(density=density, release_timescale=release) for density, release in traps]
        return {name + "_ccd": ccd, name + "_roe": roe, name + "_traps": species, name + "_express": 0,
                name + "_prune_n_electrons": 0}
    settings = dict(verbosity=0)
    if parallel:
        settings.update(arguments("parallel", PARALLEL, ROWS_BEFORE))
    if serial:
        settings.update(arguments("serial", SERIAL, COLUMNS_BEFORE))
    return arcticpy.add_cti(np.array(image, dtype=float), **settings)


def surrounded(image):
    return np.pad(image, ((0, OVERSCAN_ROWS), (PRESCAN, OVERSCAN_COLUMNS)))


def make():
    image = field()
    dark = surrounded(image)

    def rounded(frame):
        return [[digits(value, 10) for value in row] for row in frame]
    write_json("frames.json", {
        "made_by": MADE_BY,
        "detector": {"full_well_e": DETECTOR[0], "notch_e": DETECTOR[1], "well_fill_power": DETECTOR[2]},
        "parallel_traps": [{"density_per_px": d, "release_transfers": r} for d, r in PARALLEL],
        "serial_traps": [{"density_per_px": d, "release_transfers": r} for d, r in SERIAL],
        "rows_before": ROWS_BEFORE, "columns_before": COLUMNS_BEFORE,
        "prescan_columns": PRESCAN, "overscan_columns": OVERSCAN_COLUMNS, "overscan_rows": OVERSCAN_ROWS,
        "field_e": [[int(value) for value in row] for row in image],
        "parallel_e": rounded(trailed(image, True, False)),
        "serial_e": rounded(trailed(image, False, True)),
        "both_e": rounded(trailed(image, True, True)),
        "dark_e": rounded(trailed(dark, True, True))})
    camera(dark)


def camera(dark):
    from astropy.io import fits
    rng = np.random.default_rng(1)
    primary = fits.PrimaryHDU()
    header = primary.header
    header["TELESCOP"] = ("nowhere", "no telescope")
    header["GAIN"] = (1.5, "[e-/DN] electrons per DN")
    header["LONGTEXT"] = ("a value that does not fit a card, " * 4, "over CONTINUE cards")
    header["HIERARCH chip temperature"] = (133.0, "[K]")
    header["COMMENT"] = "A frame for tests: see tests/golden/frames.py."
    header["HISTORY"] = "made"
    noisy = np.where(dark > 0.0, rng.poisson(dark), 0.0) + rng.normal(0.0, 4.0, dark.shape)
    raw = np.round(noisy / 1.5 + 500.0).astype(np.uint16)
    science = fits.ImageHDU(raw, name="SCI")
    science.header["EXTVER"] = 1
    science.header["BUNIT"] = ("DN", "brightness units")
    science.header["EXPTIME"] = (565.0, "[s]")
    science.header["HISTORY"] = "bias 500 DN"
    error = fits.ImageHDU(np.full(dark.shape, 4.0, dtype=np.float32), name="ERR")
    quality = fits.ImageHDU((dark > 50000.0).astype(np.int16), name="DQ")
    rows, columns = np.nonzero(dark > 3100.0)
    stars = fits.BinTableHDU.from_columns([fits.Column("ROW", "J", array=rows), fits.Column("COLUMN", "J", array=columns)],
                                          name="STARS")
    floats = dark.astype(np.float32)
    floats[30, 10:13] = np.nan
    floats[2, 7] = np.inf
    electrons = fits.ImageHDU(floats, name="SCI")
    electrons.header["EXTVER"] = 2
    electrons.header["BUNIT"] = "ELECTRONS"
    hdus = fits.HDUList([primary, science, error, quality, stars, electrons])
    science.add_checksum(when="data unit checksum")
    hdus.writeto(os.path.join(HERE, "camera.fits"), overwrite=True)


def check(before, after):
    import warnings
    from astropy.io import fits
    warnings.simplefilter("error")
    with fits.open(before) as old, fits.open(after, checksum=True) as new:
        new.verify("exception")
        assert len(old) == len(new)
        for one, other in zip(old, new):
            known, cards = list(one.header.cards), list(other.header.cards)
            added = cards[len(known):]
            assert all(card.keyword == "HISTORY" or card.keyword.startswith("CTI") for card in added), added
            for a, b in zip(known, cards):
                same = (a.keyword, a.value, a.comment) == (b.keyword, b.value, b.comment)
                assert same or a.keyword in ("CHECKSUM", "DATASUM"), (a, b)
            unlike = "no data"
            if one.data is not None:
                if one.is_image:
                    a, b = one.data.astype(float), other.data.astype(float)
                    assert one.data.dtype == other.data.dtype and (np.isfinite(a) == np.isfinite(b)).all()
                    unlike = "%d of %d pixels differ" % ((a != b)[np.isfinite(a)].sum(), a.size)
                else:
                    assert one.data.tobytes() == other.data.tobytes()
                    unlike = "the same table"
            print("HDU %s: %d cards kept, %d added, %s" % (one.name, len(known), len(added), unlike))


if __name__ == "__main__":
    check(*sys.argv[2:]) if "--check" in sys.argv[1:2] else make()
