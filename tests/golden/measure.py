#!/usr/bin/env python3
"""Frames with known traps, of which `ctiplan measure` makes tables (measure/*.fits), and the mission with those traps.

Made by   arcticpy 2.6 (public add_cti, express = 0: every transfer is followed) and astropy 6.1.7 (io.fits), numpy 1.26.4
          (Python 3.11); a minute on one core.
Command   python tests/golden/measure.py          writes tests/golden/measure/*.fits; random numbers have fixed seeds

All frames are unsigned 16-bit integers of 1.5 e-/DN over a bias of 1000 DN, with 4 e- of read noise (`add_noise`), after
parallel transfer through the traps of DETECTOR and TRAPS below, which are those of tests/measure/truth.toml. Row 0 is nearest
the register. Light has photon noise before it is transferred. Headers have DATE-OBS, GAIN, CCDTEMP; each frame lies so many
rows (`before`) from the register:

flat-LEVEL.fits         200 rows of flat, 24 rows of overscan, 64 columns of image, 8 columns of overscan, 300 rows before.
flat-LEVEL-dirty.fits   The same with 1 % of pixel-to-pixel response, two hot columns, a dead one, 60 cosmic rays in the image and
                        20 on the overscan rows (they hit while the frame is read out), other noise.
warm-N.fits             Warm pixels of 500 to 20000 e- (the same in all N) on 30 e- of background, 192 rows x 384
                        columns, 8 columns of overscan, 600 rows before.
warm-dirty-N.fits       The same warm pixels with other noise, and: faint warm pixels of 20 to 200 e- in 2 % of all pixels, a
                        background that grows from 20 to 60 e- along the columns, 120 cosmic rays in each frame, 1 % of each pixel's
                        charge seen in each of its four neighbours (interpixel capacitance, after transfer).
injection.fits          Blocks of 5 rows of 3000 e- every 40 rows from row 10 on, 10 % different from column to column; 200 rows x
                        64 columns, 8 columns of overscan, 300 rows before, 2 e- of background, 20 cosmic rays.
pumped-N.fits           A flat of 2000 e- after 2000 cycles of trap pumping with N of ten phase times (header: PHASE in ms, CYCLES), 60 rows
                        x 48 columns, 8 columns of overscan: 40 traps with the release time of the fast species, each of whose pumps
                        moves an electron with the probability exp(-t/tau) - exp(-2t/tau) from one pixel to its neighbour along the
                        column; 10 hot pixels, 5 cosmic rays in each. No other traps.
"""
import os

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
FOLDER = os.path.join(HERE, "measure")
GAIN, BIAS, READ_NOISE = 1.5, 1000.0, 4.0
# Full well (e-), notch (e-), exponent; density per pixel, release time in transfers.
DETECTOR = (100000.0, 0.0, 0.6)
TRAPS = [(0.8, 1.5), (1.2, 6.0)]
OVERSCAN_COLUMNS = 8


def trailed(image, before):
    import arcticpy
    full_well, notch, power = DETECTOR
    ccd = arcticpy.CCD(phases=[arcticpy.CCDPhase(full_well_depth=full_well, well_notch_depth=notch,
                                                 well_fill_power=power)], fraction_of_traps_per_phase=[1.0])
    roe = arcticpy.ROE(dwell_times=[1.0], prescan_offset=before, empty_traps_between_columns=True,
                       empty_traps_for_first_transfers=True)
    species = [arcticpy.TrapInstantCapture(density=density, release_timescale=release) for density, release in TRAPS]
    return arcticpy.add_cti(np.array(image, dtype=float), parallel_ccd=ccd, parallel_roe=roe, parallel_traps=species,
                            parallel_express=0, parallel_prune_n_electrons=0, verbosity=0)


def add_noise(charge, rng):
    """Columns of overscan, read noise, gain, bias."""
    whole = np.pad(charge, ((0, 0), (0, OVERSCAN_COLUMNS)))
    noisy = whole + rng.normal(0.0, READ_NOISE, whole.shape)
    return np.clip(np.round(noisy / GAIN + BIAS), 0, 65535).astype(np.uint16)


def write(name, raw, date, **more):
    from astropy.io import fits
    hdu = fits.PrimaryHDU(raw)
    hdu.header["BUNIT"] = "ADU"
    hdu.header["GAIN"] = (GAIN, "[e-/ADU]")
    hdu.header["DATE-OBS"] = date
    hdu.header["CCDTEMP"] = (150.0, "[K]")
    for keyword, value in more.items():
        hdu.header[keyword] = value
    hdu.writeto(os.path.join(FOLDER, name), overwrite=True)


def cosmic_rays(image, count, rng):
    """Tracks of 1 to 6 pixels with 300 to 5000 e- in each."""
    rows, columns = image.shape
    for _ in range(count):
        row, column, angle = rng.uniform(0, rows), rng.uniform(0, columns), rng.uniform(0, 2 * np.pi)
        for step in range(rng.integers(1, 7)):
            r, c = int(row + step * np.sin(angle)), int(column + step * np.cos(angle))
            if 0 <= r < rows and 0 <= c < columns:
                image[r, c] += np.exp(rng.uniform(np.log(300.0), np.log(5000.0)))


def flats():
    rows, columns, overscan, before = 200, 64, 24, 300
    for index, level in enumerate([300, 3000, 30000]):
        rng = np.random.default_rng(100 + index)
        image = np.zeros((rows + overscan, columns))
        image[:rows] = rng.poisson(level, (rows, columns))
        write("flat-%d.fits" % level, add_noise(trailed(image, before), rng), "2024-01-01")
        rng = np.random.default_rng(200 + index)
        response = rng.normal(1.0, 0.01, (rows, columns))
        image[:rows] = rng.poisson(level * response)
        image[:rows, [11, 40]] += 0.7 * level
        image[:rows, 25] = 0.0
        cosmic_rays(image[:rows], 60, rng)
        read = trailed(image, before)
        cosmic_rays(read[rows:], 20, rng)
        write("flat-%d-dirty.fits" % level, add_noise(read, rng), "2024-01-01")


def warm():
    rows, columns, before = 192, 384, 600
    rng = np.random.default_rng(300)
    hot = np.zeros((rows, columns))
    count = 900
    hot[rng.integers(0, rows, count), rng.integers(0, columns, count)] = np.exp(
        rng.uniform(np.log(500.0), np.log(20000.0), count))
    faint = np.where(rng.uniform(size=hot.shape) < 0.02, np.exp(rng.uniform(np.log(20.0), np.log(200.0), hot.shape)), 0.0)
    for frame in range(3):
        rng = np.random.default_rng(310 + frame)
        image = rng.poisson(hot + 30.0).astype(float)
        write("warm-%d.fits" % (frame + 1), add_noise(trailed(image, before), rng), "2024-01-%02d" % (frame + 1))
        rng = np.random.default_rng(320 + frame)
        sky = np.linspace(20.0, 60.0, rows)[:, None]
        image = rng.poisson(hot + faint + sky).astype(float)
        cosmic_rays(image, 120, rng)
        read = trailed(image, before)
        seen = 0.96 * read
        seen[1:] += 0.01 * read[:-1]
        seen[:-1] += 0.01 * read[1:]
        seen[:, 1:] += 0.01 * read[:, :-1]
        seen[:, :-1] += 0.01 * read[:, 1:]
        write("warm-dirty-%d.fits" % (frame + 1), add_noise(seen, rng), "2024-01-%02d" % (frame + 1))


def injection():
    rows, columns, before = 200, 64, 300
    rng = np.random.default_rng(400)
    image = rng.poisson(np.full((rows, columns), 2.0)).astype(float)
    level = rng.normal(3000.0, 300.0, columns)
    for first in range(10, rows - 5, 40):
        # Injected charge has less noise than light.
        image[first:first + 5] += rng.normal(level, 10.0, (5, columns))
    cosmic_rays(image, 20, rng)
    write("injection.fits", add_noise(trailed(image, before), rng), "2024-01-01")


def pumped():
    rows, columns, cycles, release = 60, 48, 2000, TRAPS[0][1]
    rng = np.random.default_rng(500)
    places = [(r, c) for r in range(2, rows - 3, 4) for c in range(columns)]
    traps = [places[index] for index in rng.permutation(len(places))[:40]]
    signs = rng.choice([-1, 1], len(traps))
    hot = [(rng.integers(rows), rng.integers(columns)) for _ in range(10)]
    for number, phase in enumerate(np.geomspace(0.2, 12.0, 10).round(3)):
        image = rng.poisson(2000.0, (rows, columns)).astype(float)
        share = np.exp(-phase / release) - np.exp(-2.0 * phase / release)
        for (row, column), sign in zip(traps, signs):
            moved = sign * rng.binomial(cycles, share)
            image[row, column] += moved
            image[row + 1, column] -= moved
        for row, column in hot:
            image[row, column] += 1500.0
        cosmic_rays(image, 5, rng)
        write("pumped-%d.fits" % (number + 1), add_noise(image, rng), "2024-01-01", PHASE=phase, CYCLES=cycles)


if __name__ == "__main__":
    os.makedirs(FOLDER, exist_ok=True)
    flats()
    warm()
    injection()
    pumped()
