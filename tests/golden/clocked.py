#!/usr/bin/env python3
"""Golden columns with traps at the surface, and with traps that carry their state on: writes clocked.json beside this file.

Made by   arcticpy 2.6 (public add_cti, express = 0: every transfer is followed) with numpy 1.26.4 (Python 3.11); five
          seconds on one core.
Command   python tests/golden/clocked.py            writes clocked.json
          python tests/golden/clocked.py --check    compares arcticpy with a second program, and says whether it clocks three
                                                    phases (1 min)

What is trailed
    One column of a background with a galaxy, a lone packet and a faint one. Row r makes r + 1 + `offset` transfers, and no charge
    lies in front of row 0. Stored are the column before and after.

Traps at the surface
    In arcticpy TrapInstantCapture(fractional_volume_none_exposed = v, fractional_volume_full_exposed = v): traps are spread evenly
    over the volume of the cloud above v (observed: 10 traps and v = 0.2 take 10 (V - 0.2)/0.8 of a packet of volume V). With a
    well fill power of 1 the volume is n/full_well, and with v = level/full_well this is (n - level)/(full_well - level).

First transfers
    `carried` is arcticpy's default, empty_traps_for_first_transfers=False. What it does was found by comparison: pixels are taken
    from the register on, and the traps of each start in the state in which the first packet of the one before left them. The second
    program of --check does so, and agrees to 1e-12 e-.

Phases
    arcticpy 2.6 ends with a segmentation fault for a clock of more than one phase, whatever its options. Clocks of several phases are
    held against crates/readout/tests/brute_force instead.

How good it is, and the tolerance to ask for
    As packets.py: 1e-7 relative. The project asks for 0.2 % of the largest trail.
"""
import subprocess
import sys

import numpy as np

from galaxies import digits, write_json

MADE_BY = "arcticpy 2.6 add_cti (express 0), numpy 1.26.4: python tests/golden/clocked.py"
FULL_WELL = 84700.0
ROWS = 40

# name, power, background, offset, carried, [(density per px, release time in transfers, level)]
CASES = [
    ("surface alone", 1.0, 0.0, 0, False, [(20.0, 1.5, 900.0)]),
    ("surface and bulk", 1.0, 60.0, 100, False, [(2.0, 0.4, None), (20.0, 1.5, 900.0), (9.0, 12.0, 300.0)]),
    ("surface below the background", 1.0, 400.0, 30, False, [(9.0, 3.0, 200.0), (2.0, 0.7, None)]),
    ("carried", 0.5, 0.0, 0, True, [(0.5, 2.0, None), (0.3, 9.0, None)]),
    ("carried behind an offset", 0.5, 0.0, 200, True, [(0.5, 2.0, None), (0.3, 9.0, None)]),
    ("carried with background", 0.478, 60.0, 100, True, [(0.34, 0.48, None), (0.9, 4.86, None), (0.76, 20.6, None)]),
    ("carried at the surface", 1.0, 60.0, 50, True, [(20.0, 1.5, 900.0), (2.0, 0.4, None)]),
    ("empty", 0.478, 60.0, 100, False, [(0.34, 0.48, None), (0.9, 4.86, None), (0.76, 20.6, None)]),
]


def column(background):
    rows = np.arange(ROWS)
    charge = background + 2500 * np.exp(-0.5 * ((rows - 8) / 1.6) ** 2)
    charge[20] += 1500.0
    charge[24] += 300.0
    return charge


def arctic(charge, power, offset, carried, species):
    import arcticpy
    ccd = arcticpy.CCD(phases=[arcticpy.CCDPhase(full_well_depth=FULL_WELL, well_notch_depth=0.0, well_fill_power=power)],
                       fraction_of_traps_per_phase=[1.0])
    roe = arcticpy.ROE(dwell_times=[1.0], prescan_offset=offset, empty_traps_for_first_transfers=not carried)

    def trap(density, release, level):
        if level is None:
            return arcticpy.TrapInstantCapture(density=density, release_timescale=release)
        return arcticpy.TrapInstantCapture(density=density, release_timescale=release,
                                           fractional_volume_none_exposed=level / FULL_WELL,
                                           fractional_volume_full_exposed=level / FULL_WELL)

    return arcticpy.add_cti(charge.reshape(-1, 1).copy(), parallel_roe=roe, parallel_ccd=ccd,
                            parallel_traps=[trap(*one) for one in species], parallel_express=0,
                            parallel_prune_n_electrons=0.0, verbosity=0)[:, 0]


def second_program(charge, power, offset, carried, species):
    """Exact trap levels [top, fill] of each species; release first, then capture below the height."""
    def passing(states, n):
        for (density, release, _), levels in zip(species, states):
            floor = 0.0
            for level in levels:
                out = level[1] * -np.expm1(-1 / release)
                level[1] -= out
                n += density * out * (level[0] - floor)
                floor = level[0]
        captured = 0.0
        for (density, _, level_e), levels in zip(species, states):
            level_e = level_e or 0.0
            height = min(1.0, (max(n - level_e, 0.0) / (FULL_WELL - level_e)) ** power)
            floor = 0.0
            for top, fill in levels:
                captured += density * (1 - fill) * max(min(top, height) - floor, 0.0)
                floor = top
            levels[:] = ([[height, 1.0]] if height > 0 else []) + [level for level in levels if level[0] > height]
        return n - captured

    def fresh():
        return [[[1.0, 0.0]] for _ in species]

    def copied(states):
        return [[list(level) for level in levels] for levels in states]

    charge = charge.copy()
    start = fresh()
    pixels = range(len(charge) + offset)
    for pixel in pixels if carried else reversed(pixels):
        states = copied(start) if carried else fresh()
        first = max(0, pixel - offset)
        for row in range(first, len(charge)):
            charge[row] = passing(states, charge[row])
            if row == first:
                start = copied(states)
    return charge


def make():
    cases = []
    for name, power, background, offset, carried, species in CASES:
        before = column(background)
        after = arctic(before, power, offset, carried, species)
        cases.append({
            "name": name,
            "well_fill_power": power,
            "offset": offset,
            "carried": carried,
            "traps": [dict(density_per_px=density, release_transfers=release, surface_level_e=level)
                      for density, release, level in species],
            "before_e": [digits(value, 12) for value in before],
            "after_e": [digits(value, 12) for value in after],
        })
    write_json("clocked.json", {"made_by": MADE_BY, "full_well_e": FULL_WELL, "cases": cases})


def check():
    for name, power, background, offset, carried, species in CASES:
        before = column(background)
        difference = arctic(before, power, offset, carried, species) - second_program(before, power, offset, carried, species)
        print("%s: second program differs by %.1e e-" % (name, abs(difference).max()))
    three = ("import arcticpy, numpy; phase = arcticpy.CCDPhase(full_well_depth=1e4, well_notch_depth=0., well_fill_power=.5); "
             "arcticpy.add_cti(numpy.full((9, 1), 100.), parallel_express=0, verbosity=0, "
             "parallel_roe=arcticpy.ROE(dwell_times=[1/3] * 3), "
             "parallel_ccd=arcticpy.CCD(phases=[phase] * 3, fraction_of_traps_per_phase=[1/3] * 3), "
             "parallel_traps=[arcticpy.TrapInstantCapture(density=1., release_timescale=2.)])")
    status = subprocess.run([sys.executable, "-c", three], capture_output=True, check=False).returncode
    print("three phases: exit status %d (-11 is a segmentation fault)" % status)


if __name__ == "__main__":
    check() if "--check" in sys.argv[1:] else make()
