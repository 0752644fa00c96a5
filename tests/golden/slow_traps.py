#!/usr/bin/env python3
"""Change of shape by traps that never release: writes slow_traps.json beside this file.

Made by   numpy 1.26.4 alone (Python 3.11); 5 s on one core.
Command   python tests/golden/slow_traps.py            writes slow_traps.json
          python tests/golden/slow_traps.py --check    compares with whole traps at random places (5 min)

What it settles
    Rhodes et al. 2010, section 5.1, say that traps with very long release times make a galaxy smaller and leave e1 slightly
    negative (stretched along the transfers). ctiplan finds e1 positive. This program shares nothing with ctiplan, ArCTIc or
    GalSim but the images of galaxies.json.

The readout
    Every packet of the column, from the register to the last row of the stamp, makes every one of its transfers: row r starts
    in pixel r and passes through pixels r, r - 1, ... 0. A trap that never releases is either full or empty, so the state of
    a pixel is the height below which its traps are full. A packet of n electrons that finds the height H loses
        density * max(0, h(n) - H),   h(n) = (n / full_well_e)^well_fill_power,
    and the height becomes max(H, h(n)). All traps are empty at the start. No steady state is assumed: the sky in front
    of the stamp is read out too.

The shape
    Galaxy plus sky are read out, the same sky alone is subtracted, and the weighted moments of galaxies.py are taken before
    and after. Stamp: galaxies.json, its flux scaled; the central row makes `transfers` transfers.

How good it is, and the tolerance to ask for
    The sum over transfers is exact but for rounding. The height after a capture is that of the packet before it, the
    same in ctiplan (all empty traps below h(n) capture at once). ctiplan starts in the steady state of the sky, which is a
    part of 1e-3 different at these densities (tests/suite/steady_state.rs): ask for 2e-3 of each change.
    --check puts whole traps at random places and heights into the same columns; each takes one whole electron. The mean over
    400 such detectors agrees within about its standard error: delta_e1 0.0075 +- 0.0006 (every transfer: 0.0069), delta_y_px
    0.0688 +- 0.0008 (0.0686), delta_size 0.0001 +- 0.0003 (0.0003), delta_flux -0.0395 +- 0.0003 (-0.0396).
"""
import json
import os
import sys

import numpy as np

from galaxies import digits, half_width, moments, write_json

HERE = os.path.dirname(os.path.abspath(__file__))
MADE_BY = "numpy: python tests/golden/slow_traps.py"

FULL_WELL = 161000.0
GALAXIES = {"centred": "n4-r0.45-e+0-wide-centred", "off": "n4-r0.45-e+0-wide-off", "disc": "n1-r1-e+0.3-wide-off",
            "large": "n4-r2.9-e+0.3-wide-centred"}
# galaxy, flux_e, background_e, well_fill_power, density_per_px, transfers, weight_px
CASES = [("centred", 1150.0, 120.0, 0.5, 1.0, 1650, 5.4), ("off", 1150.0, 120.0, 0.5, 1.0, 1650, 5.4),
         ("off", 1150.0, 120.0, 0.5, 0.1, 1650, 5.4), ("off", 1150.0, 120.0, 0.5, 1.0, 1650, 3.0),
         ("off", 1150.0, 10.0, 0.5, 0.3, 1650, 5.4), ("off", 20000.0, 120.0, 0.5, 1.0, 1650, 5.4),
         ("off", 1150.0, 120.0, 0.8, 3.0, 1650, 5.4), ("disc", 5500.0, 120.0, 0.5, 1.0, 1650, 5.4),
         ("large", 3200.0, 120.0, 0.5, 1.0, 1650, 5.4)]


def height(charge_e, power):
    return np.minimum(np.maximum(charge_e, 0.0) / FULL_WELL, 1.0) ** power


def every_transfer(charge_e, density_per_px, power):
    """Columns of packets (charge_e[row, column], row 0 at the register) after all their transfers."""
    charge_e = charge_e.copy()
    rows = len(charge_e)
    full = np.zeros_like(charge_e)  # full[pixel, column]: height below which the traps of a pixel are full
    for clock in range(rows):
        # row r is in pixel r - clock; rows below `clock` have been read out
        packets, pixels = charge_e[clock:], full[:rows - clock]
        reached = height(packets, power)
        packets -= density_per_px * np.maximum(reached - pixels, 0.0)
        np.maximum(pixels, reached, out=pixels)
    return charge_e


def trap_by_trap(charge_e, density_per_px, power, random):
    """The same with whole traps at random heights, each of which takes one whole electron and keeps it."""
    charge_e = charge_e.copy()
    rows, columns = charge_e.shape
    # Traps higher than any packet reaches are never met: only those below `top` are drawn.
    top = height(charge_e.max(), power)
    number = random.poisson(density_per_px * top, (rows, columns))
    most = number.max()
    heights = np.where(np.arange(most)[:, None, None] < number, top * random.random((most, rows, columns)), np.inf)
    for clock in range(rows):
        packets, empty = charge_e[clock:], heights[:, :rows - clock]
        met = empty < height(packets, power)
        packets -= met.sum(axis=0)
        empty[met] = np.inf
    return charge_e


def column(image, background_e, transfers):
    """The stamp on its sky, with the sky from the register up in front of it."""
    half = len(image) // 2
    sky = np.full((transfers - 1 - half, image.shape[1]), background_e)
    return np.concatenate([sky, background_e + image])


def change(before, after, weight_px):
    before, after = moments(before, weight_px), moments(after, weight_px)
    return {"delta_e1": after["e1"] - before["e1"], "delta_y_px": after["y_px"] - before["y_px"],
            "delta_size": after["size_px"] / before["size_px"] - 1.0,
            "delta_flux": after["flux_e"] / before["flux_e"] - 1.0}


def stamp(galaxies, name, flux_e, weight_px):
    case = next(case for case in galaxies["cases"] if case["name"] == GALAXIES[name])
    image = np.array(case["image_e"]) * (flux_e / case["flux_e"])
    cut = len(image) // 2 - half_width(weight_px)
    return case, image[cut:len(image) - cut, cut:len(image) - cut]


def read_json(name):
    with open(os.path.join(HERE, name)) as file:
        return json.load(file)


def make():
    galaxies, cases = read_json("galaxies.json"), []
    for name, flux_e, background_e, power, density, transfers, weight_px in CASES:
        case, image = stamp(galaxies, name, flux_e, weight_px)
        sky = every_transfer(column(0.0 * image[:, :1], background_e, transfers), density, power)
        read = every_transfer(column(image, background_e, transfers), density, power) - sky
        after = read[-len(image):]
        keys = ("sersic_index", "half_light_px", "e1", "fwhm_px", "moffat_beta", "dx_px", "dy_px")
        cases.append({"galaxy": {key: case[key] for key in keys}, "flux_e": flux_e, "weight_px": weight_px,
                      "background_e": background_e, "full_well_e": FULL_WELL, "well_fill_power": power,
                      "density_per_px": density, "transfers": transfers,
                      "change": {key: digits(value, 10) for key, value in change(image, after, weight_px).items()}})
        print(name, flux_e, background_e, power, density, cases[-1]["change"], flush=True)
    write_json("slow_traps.json", {"made_by": MADE_BY, "cases": cases})


def check(detectors=400):
    galaxies = read_json("galaxies.json")
    name, flux_e, background_e, power, density, transfers, weight_px = CASES[1]
    _, image = stamp(galaxies, name, flux_e, weight_px)
    expected = next(case for case, this in zip(read_json("slow_traps.json")["cases"], CASES) if this == CASES[1])["change"]
    found = {key: [] for key in expected}
    for seed in range(detectors):
        # The same traps for the galaxy and for the sky alone: what the sky loses to them cancels.
        read, sky = (trap_by_trap(column(part * image, background_e, transfers), density, power,
                                  np.random.default_rng(seed))[-len(image):] for part in (1.0, 0.0))
        for key, value in change(image, read - sky, weight_px).items():
            found[key].append(value)
    for key, values in found.items():
        error = np.std(values, ddof=1) / np.sqrt(len(values))
        print("%s: %.5f +- %.5f over %d detectors; every transfer of fractional traps %.5f" %
              (key, np.mean(values), error, detectors, expected[key]), flush=True)


if __name__ == "__main__":
    check() if "--check" in sys.argv[1:] else make()
