#!/usr/bin/env python3
"""Cases in which a search can take a wrong turn. Each is a folder here: mission.toml, truth.json and the measurements.

narrow-notch          A notch that nearly holds the fainter of two backgrounds: chi2 has a narrow minimum there, and a wide one beyond.
no-growth             Traps at launch that anneal faster than radiation makes new ones, both free: without annealing the best fit has no
                      growth, and no effect on what grows can be seen from there. Two lists of epochs, and two seeds.
one-epoch-of-trails   Trails at one epoch beside doses at many: rows that are left out by their epoch are doses, and no trail.
second-bakeout        Trap densities before and after two bakeouts, of which the second may be noise if errors may be wrong.
runaway-release-time  A release time that is free runs away as long as the notch is missing, and does not come back of itself.

Command   python make.py [CASE ...] (numpy; two minutes): writes the measurements into the folders of the
          cases, all of them by default.

Every packet passes every pixel from its own to the register. Nothing here knows of ctiplan. The same seed gives the same bytes
wherever numpy's normal deviates are the same.
"""
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

BOLTZMANN_EV_K = 8.617333262e-5
REFERENCE_DOSE, TRAIL = 1.78e8, 30


@dataclass
class Case:
    """What a camera is in truth, and what is measured of it."""

    seed: int
    notch_e: float
    full_well_e: float
    power: float
    reference_k: float
    # Density at the reference dose (1/px), release time at the reference temperature (line times), energy level (eV).
    species: list
    transfers: int
    dose_rate: float
    epochs_yr: tuple
    backgrounds_e: tuple
    temperatures_k: tuple
    signals_e: tuple
    pixels: tuple
    trail_sigma: float
    # Error of a packet's charge, in electrons and as a part of it: the larger of them.
    packet_sigma: tuple
    has_doses: bool


CASES = {
    "narrow-notch": Case(
        seed=3, notch_e=4.9, full_well_e=90_000.0, power=0.55, reference_k=150.0,
        species=[(0.8, 2.0, 0.25), (1.5, 30.0, 0.35)], transfers=300, dose_rate=1.1e7 * 7 / 11,
        epochs_yr=(0.5, 2.0, 4.0, 7.0), backgrounds_e=(5.0, 100.0), temperatures_k=(150.0, 160.0),
        signals_e=(100.0, 1000.0, 20_000.0), pixels=(1, 2, 4, 8, 20), trail_sigma=5e-5, packet_sigma=(0.2, 1e-4),
        has_doses=True,
    ),
    "one-epoch-of-trails": Case(
        seed=4, notch_e=0.0, full_well_e=90_000.0, power=0.62, reference_k=150.0,
        species=[(0.8, 2.0, 0.25), (1.5, 30.0, 0.35)], transfers=300, dose_rate=1.1e7 * 7 / 11,
        epochs_yr=(4.0,), backgrounds_e=(30.0,), temperatures_k=(150.0,),
        signals_e=(100.0, 1000.0, 20_000.0), pixels=(1, 2, 4, 8, 20), trail_sigma=3e-5, packet_sigma=None,
        has_doses=True,
    ),
    "runaway-release-time": Case(
        seed=5, notch_e=30.0, full_well_e=50_000.0, power=0.74, reference_k=140.0,
        species=[(4.9, 1.3, 0.22), (1.5, 13.0, 0.31), (3.7, 120.0, 0.39)], transfers=200, dose_rate=2e7 * 7 / 11,
        epochs_yr=(2.0, 6.0), backgrounds_e=(0.0, 20.0, 200.0), temperatures_k=(140.0,),
        signals_e=(100.0, 1000.0, 20_000.0), pixels=(1, 2, 3, 5, 10, 30), trail_sigma=1.5e-4, packet_sigma=(0.5, 3e-4),
        has_doses=False,
    ),
}


def height(case, charge_e):
    if charge_e <= case.notch_e:
        return 0.0
    return min(1.0, (charge_e - case.notch_e) / (case.full_well_e - case.notch_e)) ** case.power


class Traps:
    """Filled traps of a species in one pixel: layers from the bottom, each with its top and its filled fraction."""

    def __init__(self, density, release):
        self.density, self.kept, self.layers = density, np.exp(-1.0 / release), [(1.0, 0.0)]

    def release(self):
        out, low = 0.0, 0.0
        for top, filled in self.layers:
            out += self.density * (top - low) * filled * (1.0 - self.kept)
            low = top
        self.layers = [(top, filled * self.kept) for top, filled in self.layers]
        return out

    def empty(self, height):
        empty, low = 0.0, 0.0
        for top, filled in self.layers:
            empty += self.density * max(0.0, min(top, height) - low) * (1.0 - filled)
            low = top
        return empty

    def fill(self, height):
        if height > 0.0:
            self.layers = [(height, 1.0)] + [layer for layer in self.layers if layer[0] > height]


def read_out(case, charge_e, densities, releases):
    """Charges of rows 0, 1, ... which make 1, 2, ... transfers."""
    charge_e = list(charge_e)
    for pixel in reversed(range(len(charge_e))):
        species = [Traps(density, release) for density, release in zip(densities, releases)]
        for row in range(pixel, len(charge_e)):
            present_e = charge_e[row] + sum(traps.release() for traps in species)
            wanted = height(case, present_e)
            taken_e = sum(traps.empty(wanted) for traps in species)
            # No packet here has less than its traps would take.
            assert taken_e <= present_e
            for traps in species:
                traps.fill(wanted)
            charge_e[row] = present_e - taken_e
    return charge_e


def release(case, line_times, level_ev, temperature_k):
    scale = (case.reference_k / temperature_k) ** 2
    return line_times * scale * np.exp(level_ev / BOLTZMANN_EV_K * (1 / temperature_k - 1 / case.reference_k))


def write(name, meta, columns, rows):
    with open(name, "w") as file:
        file.write("# %ECSV 1.0\n# ---\n# datatype:\n")
        file.writelines(f"# - {{name: {column}, datatype: float64}}\n" for column in columns)
        file.write("# delimiter: ','\n# meta: {" + ", ".join(f"{key}: {value}" for key, value in meta.items()) + "}\n")
        file.write("# schema: astropy-2.0\n" + ",".join(columns) + "\n")
        file.writelines(",".join(repr(float(value)) for value in row) + "\n" for row in rows)


def make(case, folder):
    random = np.random.default_rng(case.seed)
    trails, packets = [], []
    for t_yr in case.epochs_yr:
        densities = [density * case.dose_rate * t_yr / REFERENCE_DOSE for density, _, _ in case.species]
        for background_e in case.backgrounds_e:
            for temperature_k in case.temperatures_k:
                releases = [release(case, line_times, level, temperature_k) for _, line_times, level in case.species]
                for signal_e in case.signals_e:
                    flat = np.full(case.transfers + TRAIL, background_e)
                    image = flat.copy()
                    image[case.transfers - 1] += signal_e
                    read = [np.array(read_out(case, charge_e, densities, releases)) for charge_e in (image, flat)]
                    left = read[0] - read[1]
                    at = (t_yr, background_e, temperature_k, signal_e)
                    for behind in case.pixels:
                        value = left[case.transfers - 1 + behind] / signal_e + random.normal() * case.trail_sigma
                        trails.append((*at, behind, value, case.trail_sigma))
                    if case.packet_sigma:
                        sigma = max(case.packet_sigma[0], case.packet_sigma[1] * signal_e)
                        packets.append((*at, left[case.transfers - 1] + random.normal() * sigma, sigma))
    at = ["t_yr", "background_e", "temperature_k", "signal_e"]
    of = {"transfers": case.transfers}
    write(folder / "trails.ecsv", {"observable": "trail"} | of, [*at, "trail_px", "value", "sigma"], trails)
    if packets:
        write(folder / "packets.ecsv", {"observable": "packet_charge"} | of, [*at, "value", "sigma"], packets)
    if case.has_doses:
        epochs_yr = np.arange(0.25, 8.1, 0.25)
        doses = [(t_yr, case.dose_rate * t_yr + random.normal() * 1e5, 1e5) for t_yr in epochs_yr]
        write(folder / "dose.ecsv", {"observable": "dose"}, ["t_yr", "value", "sigma"], doses)


# Seed, and the bakeouts: time in years, and the fraction of the traps that are there which it removes.
BAKEOUTS = (4, [(2.9, 0.15), (6.6, 0.25)])


def make_bakeouts(folder):
    seed, bakeouts = BAKEOUTS
    random = np.random.default_rng(seed)
    densities, dose_rate, reference_dose = {"p": 0.4, "q": 0.8}, 2e7 * 7 / 11, 1e8
    with open(folder / "trap_density.csv", "w") as file:
        file.write("# observable: trap_density\nt_yr,species,value,sigma\n")
        for t_yr in 0.4 + 0.8 * np.arange(13):
            kept, last_yr = 0.0, 0.0
            for at_yr, fraction in bakeouts:
                if at_yr < t_yr:
                    kept, last_yr = (kept + at_yr - last_yr) * (1 - fraction), at_yr
            dose = dose_rate * (kept + t_yr - last_yr) / reference_dose
            for species, density in densities.items():
                sigma = 0.04 * density * dose
                file.write(f"{t_yr:.1f},{species},{float(density * dose + random.normal() * sigma)!r},{float(sigma)!r}\n")


# File, seed, number of epochs, and years between them.
NO_GROWTH = [("yearly.csv", 5, 22, 1.0), ("dense.csv", 2, 60, 22 / 60)]


def make_no_growth(folder):
    at_launch, per_year, annealing_yr, packet_e, full_well_e, transfers = 4.0, 0.1, 8.0, 407.0, 1e5, 200
    for name, seed, epochs, step_yr in NO_GROWTH:
        random = np.random.default_rng(seed)
        with open(folder / name, "w") as file:
            file.write(f"# observable: cti\n# signal_e: {packet_e}\n# background_e: 0.0\n# transfers: {transfers}\n")
            file.write("t_yr,value,sigma\n")
            for t_yr in 0.5 + step_yr * np.arange(epochs):
                left = np.exp(-t_yr / annealing_yr)
                traps = at_launch * left + per_year * annealing_yr * (1 - left)
                charge = packet_e
                for _ in range(transfers):
                    charge -= traps * (charge / full_well_e) ** 0.5
                cti = 1 - (charge / packet_e) ** (1 / transfers)
                sigma = 0.003 * cti
                file.write(f"{t_yr:.4f},{float(cti + random.normal() * sigma)!r},{float(sigma)!r}\n")


for name in sys.argv[1:] or [*CASES, "no-growth", "second-bakeout"]:
    if name == "second-bakeout":
        make_bakeouts(Path(__file__).parent / name)
    elif name == "no-growth":
        make_no_growth(Path(__file__).parent / name)
    else:
        make(CASES[name], Path(__file__).parent / name)
