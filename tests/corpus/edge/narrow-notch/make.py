#!/usr/bin/env python3
"""A notch that nearly holds the fainter of two backgrounds: chi2 has a narrow minimum there, and a wide one beyond it.

Command   python make.py (numpy; two minutes), in any folder: it writes trails.ecsv, packets.ecsv and dose.ecsv there.

Every packet passes every pixel from its own to the register. Nothing here knows of ctiplan. The same seed gives the same bytes
wherever numpy's normal deviates are the same.
"""
import numpy as np

BOLTZMANN_EV_K = 8.617333262e-5
NOTCH_E, FULL_WELL_E, POWER = 4.9, 90_000.0, 0.55
REFERENCE_K, REFERENCE_DOSE = 150.0, 1.78e8
# Density at the reference dose (1/px), release time at the reference temperature (line times), energy level (eV).
SPECIES = [(0.8, 2.0, 0.25), (1.5, 30.0, 0.35)]
TRANSFERS, TRAIL, DOSE_RATE = 300, 30, 1.1e7 * 7 / 11


def height(charge_e):
    if charge_e <= NOTCH_E:
        return 0.0
    return min(1.0, (charge_e - NOTCH_E) / (FULL_WELL_E - NOTCH_E)) ** POWER


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


def read_out(charge_e, densities, releases):
    """Charges of rows 0, 1, ... which make 1, 2, ... transfers."""
    charge_e = list(charge_e)
    for pixel in reversed(range(len(charge_e))):
        species = [Traps(density, release) for density, release in zip(densities, releases)]
        for row in range(pixel, len(charge_e)):
            present_e = charge_e[row] + sum(traps.release() for traps in species)
            wanted = height(present_e)
            taken_e = sum(traps.empty(wanted) for traps in species)
            # No packet here has less than its traps would take.
            assert taken_e <= present_e
            for traps in species:
                traps.fill(wanted)
            charge_e[row] = present_e - taken_e
    return charge_e


def release(line_times, level_ev, temperature_k):
    scale = (REFERENCE_K / temperature_k) ** 2
    return line_times * scale * np.exp(level_ev / BOLTZMANN_EV_K * (1 / temperature_k - 1 / REFERENCE_K))


def write(name, meta, columns, rows):
    with open(name, "w") as file:
        file.write("# %ECSV 1.0\n# ---\n# datatype:\n")
        file.writelines(f"# - {{name: {column}, datatype: float64}}\n" for column in columns)
        file.write("# delimiter: ','\n# meta: {" + ", ".join(f"{key}: {value}" for key, value in meta.items()) + "}\n")
        file.write("# schema: astropy-2.0\n" + ",".join(columns) + "\n")
        file.writelines(",".join(repr(float(value)) for value in row) + "\n" for row in rows)


def main():
    random = np.random.default_rng(3)
    trails, packets = [], []
    for t_yr in (0.5, 2.0, 4.0, 7.0):
        densities = [density * DOSE_RATE * t_yr / REFERENCE_DOSE for density, _, _ in SPECIES]
        for background_e in (5.0, 100.0):
            for temperature_k in (150.0, 160.0):
                releases = [release(line_times, level, temperature_k) for _, line_times, level in SPECIES]
                for signal_e in (100.0, 1000.0, 20_000.0):
                    flat = np.full(TRANSFERS + TRAIL, background_e)
                    image = flat.copy()
                    image[TRANSFERS - 1] += signal_e
                    read = [np.array(read_out(charge_e, densities, releases)) for charge_e in (image, flat)]
                    left = read[0] - read[1]
                    at = (t_yr, background_e, temperature_k, signal_e)
                    for behind in (1, 2, 4, 8, 20):
                        value = left[TRANSFERS - 1 + behind] / signal_e + random.normal() * 5e-5
                        trails.append((*at, behind, value, 5e-5))
                    sigma = max(0.2, 1e-4 * signal_e)
                    packets.append((*at, left[TRANSFERS - 1] + random.normal() * sigma, sigma))
    doses = [(t_yr, DOSE_RATE * t_yr + random.normal() * 1e5, 1e5) for t_yr in np.arange(0.25, 8.1, 0.25)]
    at = ["t_yr", "background_e", "temperature_k", "signal_e"]
    write("trails.ecsv", {"observable": "trail", "transfers": TRANSFERS}, [*at, "trail_px", "value", "sigma"], trails)
    write("packets.ecsv", {"observable": "packet_charge", "transfers": TRANSFERS}, [*at, "value", "sigma"], packets)
    write("dose.ecsv", {"observable": "dose"}, ["t_yr", "value", "sigma"], doses)


main()
