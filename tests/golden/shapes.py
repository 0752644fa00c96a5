#!/usr/bin/env python3
"""Golden changes of shape by parallel transfer: writes shapes.json beside this file.

Made by   arcticpy 2.6 (public add_cti, express = 0: every transfer is followed), GalSim 2.8.5, numpy 1.26.4
          (Python 3.11); two minutes on one core. shapes.json is rewritten after every case.
Command   python tests/golden/shapes.py            writes shapes.json
          python tests/golden/shapes.py --check    the shortcuts, the galaxy's accuracy (2 min)

What is trailed
    A (2h + 1) x (2h + 1) stamp, h = ceil(5 weight_px): `background_e` everywhere plus one galaxy (galaxies.py, same
    profile, PSF and accuracy), centred on (h + dx_px, h + dy_px). Rows run along y, row 0 nearest the register. The
    central row makes exactly `transfers` transfers: ROE(prescan_offset = transfers - 1 - h), and row r makes
    r + 1 + prescan_offset. The stamp's row 0 is the first charge that the traps of any pixel have seen (empty start,
    as in packets.py, which has the settings, the reason for empty_traps_for_first_transfers=True, and the checks of both). A
    stamp of background alone is trailed in the same way and subtracted, and the weighted moments (galaxies.py) of the
    difference are compared with those of the untrailed galaxy:
        delta_e1, delta_e2, delta_y_px     after minus before
        delta_size, delta_flux             after / before - 1, of size_px and of flux_e = sum(I w)

    `mean` averages each over 4 x 4 sub-pixel positions, dx and dy in {-0.375, -0.125, 0.125, 0.375}. Columns do not know
    of each other and these galaxies are symmetric in x, so dx and -dx are mirror images: only dx > 0 are trailed, and
    the mean delta_e2 is 0 by symmetry. `one` is the position dx = 0.125, dy = -0.375, `before` its untrailed moments. The
    `column_..._e` are the stamp's central column (x = h) there, row 0 first, 10 digits: raw before trailing (galaxy +
    background), raw after, and the trailed background.

    `one_full_column` (first case only) is the same position with `transfers` - 1 - h rows of background between register
    and stamp: what the empty start in front of the stamp, instead of a sky that reaches down to row 0, is worth.

How good it is, and the tolerance to ask for
    Trailing is exact to 1e-10 e-, by a second program (here and in packets.py, --check). The galaxies' pixels are good to
    2e-7 of the peak; drawing them with GSParams ten times looser changes no delta by more than 3e-8 or by 2e-6 of
    itself (--check). Columns one by one and -dx give the same to the last bits, and pruning is off. So values are good to 1e-5
    relative. A consumer that follows every transfer with exact trap levels and draws its own galaxies to 1e-4 of the
    peak should ask for 1e-3 relative (+ 1e-6 absolute); one that groups transfers or bins trap levels for what it
    promises, say 1 %: the requirement of 1e-3 in e1 is then met or missed by no more than 1e-5.
"""
import sys

import numpy as np

from galaxies import GSPARAMS, digits, draw, half_width, moments, write_json
from packets import DETECTORS, second_program, trail

MADE_BY = "arcticpy 2.6 add_cti (express 0), GalSim 2.8.5, numpy 1.26.4: python tests/golden/shapes.py"
ONE = (0.125, -0.375)
POSITIONS = [(i + 0.5) / 4.0 - 0.5 for i in range(4)]
DELTAS = ("delta_e1", "delta_e2", "delta_y_px", "delta_size", "delta_flux")


def case(name, detector, density_factor, transfers, background, fwhm, beta, sersic, half_light, flux, e1, weight):
    (full_well, notch, power), traps = DETECTORS[detector]
    return {
        "name": name, "detector": {"full_well_e": full_well, "notch_e": notch, "well_fill_power": power},
        "traps": [{"density_per_px": density * density_factor, "release_transfers": release}
                  for density, release in traps],
        "transfers": transfers, "background_e": background, "psf": {"fwhm_px": fwhm, "moffat_beta": beta},
        "galaxy": {"sersic_index": sersic, "half_light_px": half_light, "flux_e": flux, "e1": e1,
                   "weight_px": weight}}


CASES = [
    # SNAP-like p-channel at its reference dose (110 yr at its rate) and after 5 yr
    case("p-channel-110yr", "p-channel", 1.0, 1650, 120.0, 2.91, 3.5, 4.0, 0.45, 1150.0, 0.0, 5.4),
    case("p-channel-5yr", "p-channel", 5.0 / 110.0, 1650, 120.0, 2.91, 3.5, 4.0, 0.45, 1150.0, 0.0, 5.4),
    # survey detector, elongated disc
    case("n-channel-survey", "n-channel", 1.0, 2066, 80.0, 2.91, 3.5, 1.0, 1.0, 5500.0, 0.3, 5.4),
    # heavily damaged, large de Vaucouleurs galaxy
    case("hst-like", "hst-like", 1.0, 2048, 30.0, 2.91, 3.5, 4.0, 2.9, 3200.0, 0.0, 7.7),
    # background below the notch: the sky itself is not trailed
    case("notched", "notched", 1.0, 500, 20.0, 1.8, 2.5, 1.0, 1.0, 2000.0, -0.25, 4.0),
    # near the register, where the stamp's own 55 rows matter against 60 transfers
    case("p-channel-near", "p-channel", 1.0, 60, 120.0, 2.91, 3.5, 4.0, 0.45, 5600.0, 0.0, 5.4),
]


def unpack(c):
    d, g = c["detector"], c["galaxy"]
    half = half_width(g["weight_px"])
    return ((d["full_well_e"], d["notch_e"], d["well_fill_power"]),
            [(t["density_per_px"], t["release_transfers"]) for t in c["traps"]], half, c["transfers"] - 1 - half)


def picture(c, dx, dy, gsparams=None):
    g, p = c["galaxy"], c["psf"]
    return draw(g["sersic_index"], g["half_light_px"], g["e1"], p["fwhm_px"], p["moffat_beta"], g["flux_e"], dx, dy,
                half_width(g["weight_px"]), gsparams=gsparams)


def deltas(c, before, trailed, background_column):
    """Compare the trailed galaxy with the untrailed one; returns the five changes and the moments before."""
    weight = c["galaxy"]["weight_px"]
    old, new = moments(before, weight), moments(trailed - background_column, weight)
    return {"delta_e1": new["e1"] - old["e1"], "delta_e2": new["e2"] - old["e2"],
            "delta_y_px": new["y_px"] - old["y_px"], "delta_size": new["size_px"] / old["size_px"] - 1.0,
            "delta_flux": new["flux_e"] / old["flux_e"] - 1.0}, old


def rounded(values):
    return {key: digits(value, 10) for key, value in values.items()}


def make():
    done = []
    for c in CASES:
        detector, traps, half, offset = unpack(c)
        empty = trail(np.full((2 * half + 1, 1), c["background_e"]), detector, traps, offset)
        seen = []
        for dx in (d for d in POSITIONS if d > 0.0):
            for dy in POSITIONS:
                galaxy = picture(c, dx, dy)
                after = trail(galaxy + c["background_e"], detector, traps, offset)
                change, before = deltas(c, galaxy, after, empty)
                seen.append(change)
                if (dx, dy) == ONE:
                    one = dict({"dx_px": dx, "dy_px": dy}, **rounded(change))
                    one["before"] = rounded(before)
                    columns = {"column_before_e": (galaxy + c["background_e"])[:, half], "column_e": after[:, half],
                               "column_background_e": empty[:, 0]}
                    kept = galaxy
        mean = {key: float(np.mean([change[key] for change in seen])) for key in DELTAS}
        mean["delta_e2"] = 0.0      # dx and -dx cancel
        c = dict(c, mean=rounded(mean), one=one)
        for key, values in columns.items():
            c[key] = [digits(v, 10) for v in values]
        done.append(c)
        print(c["name"], c["mean"], flush=True)
        write_json("shapes.json", {"made_by": MADE_BY, "cases": done})
        if len(done) == 1:
            # the sky from row 0 up, instead of nothing in front of the stamp; every column on its own
            front = np.full((offset, 1), c["background_e"])
            full_empty = trail(np.vstack([front, np.full((2 * half + 1, 1), c["background_e"])]), detector, traps)
            full = np.hstack([trail(np.vstack([front, kept[:, i:i + 1] + c["background_e"]]), detector, traps)[offset:]
                              for i in range(2 * half + 1)])
            done[0]["one_full_column"] = rounded(deltas(c, kept, full, full_empty[offset:])[0])
            print(done[0]["one"], done[0]["one_full_column"], flush=True)
            write_json("shapes.json", {"made_by": MADE_BY, "cases": done})


def check():
    looser = dict(GSPARAMS, folding_threshold=1e-4, maxk_threshold=1e-5, kvalue_accuracy=1e-6,
                  integration_relerr=1e-7, integration_abserr=1e-9)
    for c in CASES:
        detector, traps, half, offset = unpack(c)
        empty = trail(np.full((2 * half + 1, 1), c["background_e"]), detector, traps, offset)
        print(c["name"])

        def at(dx, dy, gsparams=None, **options):
            galaxy = picture(c, dx, dy, gsparams)
            after = trail(galaxy + c["background_e"], detector, traps, offset, **options)
            return deltas(c, galaxy, after, empty)[0], galaxy, after
        reference, galaxy, after = at(*ONE)
        alone = np.hstack([trail(galaxy[:, i:i + 1] + c["background_e"], detector, traps, offset)
                           for i in range(0, 2 * half + 1, 9)])
        print("   columns one by one: %.1e e-" % abs(alone - after[:, ::9]).max())
        pruned = at(*ONE, parallel_prune_n_electrons=1e-10)[2]
        never = at(*ONE, parallel_prune_frequency=10 ** 9)[2]
        print("   default pruning: %.1e e-, never pruned: %.1e e-" % (abs(pruned - after).max(), abs(never - after).max()))
        for label, values in (("mirror, -dx", at(-ONE[0], ONE[1])[0]), ("looser GSParams", at(*ONE, gsparams=looser)[0])):
            print("   %-16s" % label, " ".join("%s %+.1e" % (key, values[key] - reference[key]) for key in DELTAS))
        middle = second_program(galaxy[:, half] + c["background_e"], detector, traps, offset)
        print("   central column by the second program: %.1e e-" % abs(middle - after[:, half]).max())
        sys.stdout.flush()


if __name__ == "__main__":
    check() if "--check" in sys.argv[1:] else make()
