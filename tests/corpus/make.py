#!/usr/bin/env python3
"""Cases with known answers for `ctiplan diagnose`: simulated measurements, and missions that lack what made them.

Made by   arcticpy 2.6 (add_cti, express 0, no pruning: every transfer is followed), GalSim 2.8.5, astropy < 7, numpy 1.26
Command   python tests/corpus/make.py OUT                              all groups, two minutes on one core
          python tests/corpus/make.py OUT --kind strong --kind pair    some groups
          python tests/corpus/make.py OUT --only 'notch|preflash'      cases whose name matches

Each case is a folder OUT/NAME with mission.toml (what the user believes), measurements (*.ecsv) and truth.json (what was
really there). Nothing here knows of ctiplan: dose, traps, readout and moments follow the contract's words, and the
readout is ArCTIc's. The same seed gives the same bytes, whatever --kind and --only leave out.

Groups
    strong      one effect of the catalogue, on data that identify it
    complete    nothing hidden: fresh noise on a dozen arrangements
    outside     something that is not in the catalogue: verdict unexplained
    ambiguous   one effect, on data that cannot tell it from others
    unfit       data that carry no verdict
    pair        two effects at once
    edge        one effect, so weak that it is hard to see
    power       one effect at four strengths, from hard to see to plain

truth.json
    case, verdict, effects, accept (lists of effects that are right answers), parameters, files, note; covariates where
    something outside the catalogue is hidden. Besides:
        group            as above
        delta_chi2       chi2 that the noise-free measurements have against the mission without the effect, after its free
                         parameters have adjusted to them (in linear approximation)
        delta_chi2_each  for pairs: the same against the mission that lacks one of them but has the other
        free             true values of what the mission leaves free; the mission file has others
        target           for power: the delta_chi2 that was aimed at
    true.toml            the mission as it really is, where the catalogue has all of it

Readout
    A lone packet stands in a column whose every row, from row 0 up, holds the background; without background the rows in
    front hold nothing and are left out. The background read out alone is subtracted. A continuum of release times is a sum
    over 21 species; ArCTIc's own continuum is not used (tests/golden/effects.py says why). Capture that takes time is
    ArCTIc's, computed in two units of volume that must agree (see there).
    A serial register is one more column: the pixel that comes out of the parallel transfers is alone in its row, on the
    row's trailed background.
    Shapes are averaged over 3 evenly spaced positions in x and 3 Gauss-Legendre positions in y; against dose they are
    interpolated by a polynomial of fourth degree.
"""
import argparse
import copy
import datetime
import itertools
import json
import math
import os
import re
import sys
import time
import zlib

import numpy as np

BOLTZMANN_EV_K = 8.617333262e-5
SOLAR_MAXIMA = [1968.9, 1979.9, 1989.9, 2000.3, 2014.3, 2024.8, 2035.8]
GROUPS = ["strong", "complete", "outside", "ambiguous", "unfit", "pair", "edge", "power"]
# chi2 by which the truth of a case of group power is ahead of the mission.
POWER = [15, 30, 60, 120]


# ---------------------------------------------------------------- dose and traps


def decimal_year(date):
    start = datetime.date(date.year, 1, 1)
    days = (datetime.date(date.year + 1, 1, 1) - start).days
    return date.year + (date - start).days / days


class World:
    """A mission with effects: what is believed in, or what is true."""

    def __init__(self, mission, effects=()):
        self.mission, self.effects = mission, list(effects)

    def of(self, kind):
        """Parameters of every effect of a kind."""
        return [parameters for name, parameters in self.effects if name == kind]

    def one(self, kind):
        found = self.of(kind)
        return found[0] if found else None

    def rates(self):
        """(from, to, MeV/g/yr) in years since launch; they may overlap."""
        environment, far = self.mission["environment"], 100.0
        active_rate, floor = environment["active_dose_rate_mev_g_yr"], environment.get("cosmic_ray_floor_mev_g_yr", 0.0)
        rates = [(0.0, far, floor)] + [(0.0, far, f["rate_mev_g_yr"]) for f in self.of("cosmic-ray-floor")]
        if environment["model"] == "constant" and not self.of("solar-cycle"):
            return rates + [(0.0, far, active_rate * 7.0 / 11.0)]
        launch, last = decimal_year(self.mission["mission"]["launch"]), 0.0
        for maximum in environment["solar_maximum"]:
            start, end = max(maximum - 2.5 - launch, last), maximum + 4.5 - launch
            if end > start:
                rates.append((start, end, active_rate))
                last = end
        return rates

    def dose(self, t_yr):
        """Dose since launch, MeV/g: what a dose monitor sees."""
        steady = sum(rate * max(0.0, min(end, t_yr) - start) for start, end, rate in self.rates())
        return steady + sum(flare["dose_mev_g"] for flare in self.of("solar-flare") if flare["t_yr"] <= t_yr)

    def survival(self, made_yr, now_yr):
        """Fraction left of the traps made at a time."""
        left = 1.0
        for annealing in self.of("annealing"):
            left *= math.exp(-(now_yr - made_yr) / annealing["time_yr"])
        for bakeout in self.of("bakeout"):
            if made_yr < bakeout["t_yr"] <= now_yr:
                left *= 1.0 - bakeout["fraction"]
        return left

    def surviving_dose(self, t_yr):
        """Dose whose traps are left, MeV/g."""
        cuts = sorted(bakeout["t_yr"] for bakeout in self.of("bakeout"))
        constants = [annealing["time_yr"] for annealing in self.of("annealing")]
        length = 1.0 / sum(1.0 / constant for constant in constants) if constants else math.inf
        total = 0.0
        for start, end, rate in self.rates():
            edges = [start] + [cut for cut in cuts if start < cut < end] + [end]
            for a, b in zip(edges, edges[1:]):
                b = min(b, t_yr)
                if b <= a:
                    continue
                # the integral of an exponential, times its value in the middle for the bakeouts that come after
                middle = 0.5 * (a + b)
                baked = self.survival(middle, t_yr) / math.exp(-(t_yr - middle) / length)
                kept = (b - a) if math.isinf(length) else length * (math.exp(-(t_yr - b) / length)
                                                                    - math.exp(-(t_yr - a) / length))
                total += rate * baked * kept
        for flare in self.of("solar-flare"):
            if flare["t_yr"] <= t_yr:
                total += flare["dose_mev_g"] * self.survival(flare["t_yr"], t_yr)
        return total

    def conditions(self, meta, row):
        """Everything a row's value depends on, as it really was."""
        mission = self.mission
        at = {"temperature_k": mission["detector"]["temperature_k"], "transfers": mission["readout"]["transfers"],
              "line_time_ms": mission["readout"]["line_time_ms"], "background_e": mission["sky"]["background_e"]}
        at.update(meta)
        at.update(row)
        if "date" in at:
            at["t_yr"] = (datetime.date.fromisoformat(at["date"]) - mission["mission"]["launch"]).days / 365.25
        at["background_e"] += sum(preflash["electrons"] for preflash in self.of("preflash"))
        at["temperature_k"] += sum(offset["kelvin"] for offset in self.of("temperature-offset"))
        at["temperature_k"] += sum(
            season["amplitude_k"] * math.cos(2.0 * math.pi * (at["t_yr"] - season["warmest_t_yr"]) / season["period_yr"])
            for season in self.of("temperature-cycle"))
        at["temperature_k"] += sum(kelvin["of"](at) for kelvin in self.of("outside: temperature of every epoch"))
        return at

    def pixel(self):
        """(full well, notch, power) of the charge cloud."""
        detector = self.mission["detector"]
        notch, power = self.one("notch"), self.one("well-fill")
        return (detector["full_well_e"], notch["notch_e"] if notch else detector["notch_e"],
                power["well_fill_power"] if power else detector["well_fill_power"])

    def relative_dose(self, at):
        """Dose behind the traps over the reference dose, with what scales or removes them."""
        dose = at["dose_mev_g"] if "dose_mev_g" in at else self.surviving_dose(at["t_yr"])
        for scale in self.of("dose-scale"):
            dose *= scale["factor"]
        for factor in self.of("outside: density against a condition"):
            dose *= factor["of"](at)
        return dose / self.mission["detector"]["reference_dose_mev_g"]

    def release_ms(self, species, at):
        reference, now = self.mission["detector"]["reference_temperature_k"], at["temperature_k"]
        return species["release_ms"] * (reference / now) ** 2 * math.exp(
            species["energy_ev"] / BOLTZMANN_EV_K * (1.0 / now - 1.0 / reference))

    def traps(self, at):
        """((density, release time, capture time or None), ...) of the pixels, times in transfers."""
        relative = self.relative_dose(at)
        species = [(s["density_per_px"] * relative, s) for s in self.mission["detector"]["traps"]]
        for launch in self.of("prelaunch-traps"):
            kept = self.survival(0.0, at["t_yr"]) if self.of("annealing") or self.of("bakeout") else 1.0
            species = [(density + launch.get(s["name"], 0.0) * kept, s) for density, s in species]
        species += [(extra["density_per_px"] * relative, extra) for extra in self.of("extra-species")]
        capture, spread = self.one("finite-capture"), self.one("release-continuum")
        capture = capture["capture_ms"] / at["line_time_ms"] if capture else None
        traps = [(density, self.release_ms(s, at) / at["line_time_ms"], capture) for density, s in species]
        if spread:
            x = np.linspace(-4.5, 4.5, 21)
            weight = np.exp(-0.5 * x * x)
            weight /= weight.sum()
            traps = [(density * w, release * math.exp(spread["sigma"] * s), capture)
                     for density, release, capture in traps for s, w in zip(x, weight)]
        return tuple(trap for trap in traps if trap[0] > 0.0)

    def serial(self, at):
        """(traps, transfers) of the serial register, or None."""
        register = self.one("serial-traps")
        if not register:
            return None
        relative = self.relative_dose(at)
        return (tuple((s["density_per_px"] * relative, self.release_ms(s, at) / register["pixel_time_ms"], None)
                      for s in register["traps"]), register["transfers"])


# ---------------------------------------------------------------- readout


def add_cti(image, pixel, traps, in_front):
    """Trail every column of image[row][column]; row r makes r + 1 + in_front transfers."""
    import arcticpy
    full_well, notch, power = pixel
    species = [arcticpy.TrapInstantCapture(density=density, release_timescale=release) if capture is None else
               arcticpy.TrapSlowCapture(density=density, release_timescale=release, capture_timescale=capture)
               for density, release, capture in traps]
    ccd = arcticpy.CCD(phases=[arcticpy.CCDPhase(full_well_depth=full_well, well_notch_depth=notch,
                                                 well_fill_power=power)], fraction_of_traps_per_phase=[1.0])
    roe = arcticpy.ROE(dwell_times=[1.0], prescan_offset=in_front, empty_traps_between_columns=True,
                       empty_traps_for_first_transfers=True)
    return arcticpy.add_cti(np.array(image, dtype=float), parallel_ccd=ccd, parallel_roe=roe, parallel_traps=species,
                            parallel_express=0, parallel_prune_n_electrons=0, verbosity=0)


def read_out(image, pixel, traps, in_front=0):
    if not traps:
        return np.array(image, dtype=float)
    if traps[0][2] is None:
        return add_cti(image, pixel, traps, in_front)
    # Slow capture: a rounding in ArCTIc may leave traps out, in one unit of volume but not in another.
    full_well, notch, power = pixel
    seen = []
    for unit in (1.0723 ** k for k in range(12)):
        scaled = tuple((density * unit ** power, release, capture) for density, release, capture in traps)
        seen.append(add_cti(image, (notch + (full_well - notch) * unit, notch, power), scaled, in_front))
        if any(abs(before - seen[-1]).max() < 1e-9 for before in seen[:-1]):
            return seen[-1]
    raise RuntimeError("no two units agree")


PACKETS = {}


def packets(pixel, traps, background_e, transfers, block_px, behind, signals):
    """{signal: (charges, charges of the background alone)} of the last row of a block and the rows behind it."""
    def key(signal):
        return (pixel, traps, background_e, transfers, block_px, behind, signal)
    new = sorted(signal for signal in set(signals) if key(signal) not in PACKETS)
    if new:
        in_front = transfers - block_px if background_e == 0.0 else 0
        last = transfers - 1 - in_front
        image = np.full((last + 1 + behind, len(new) + 1), background_e)
        image[last + 1 - block_px:last + 1, :-1] += np.array(new)
        after = read_out(image, pixel, traps, in_front)[last:]
        for column, signal in enumerate(new):
            PACKETS[key(signal)] = (after[:, column], after[:, -1])
    return {signal: PACKETS[key(signal)] for signal in signals}


SERIAL = {}


def through_serial(pixel, register, charges, backgrounds):
    """Each charge alone in its row; returns what is read of the charge less what is read of the background."""
    traps, transfers = register
    key = (pixel, register, charges.tobytes(), backgrounds.tobytes())
    if key not in SERIAL:
        both = np.concatenate([charges, backgrounds])
        if backgrounds.max() == 0.0:
            read = read_out(both[None, :], pixel, traps, transfers - 1)[0]
        else:
            image = np.tile(np.concatenate([backgrounds, backgrounds]), (transfers, 1))
            image[-1] = both
            read = read_out(image, pixel, traps)[-1]
        SERIAL[key] = read[:len(charges)] - read[len(charges):]
    return SERIAL[key]


# ---------------------------------------------------------------- shapes


STAMPS = {}
SHAPES = {}
SHAPE_COLUMNS = ("delta_e1", "delta_y", "delta_flux", "delta_size")


def stamp(galaxy, psf, dx, dy, half):
    """The galaxy's pixels without noise and background, drawn large and cropped so that wings neither fold nor end."""
    key = (galaxy["sersic_index"], galaxy["half_light_px"], galaxy["e1"], galaxy["flux_e"], psf["fwhm_px"],
           psf["moffat_beta"], dx, dy, half)
    if key not in STAMPS:
        import galsim
        large = 513
        fine = galsim.GSParams(folding_threshold=1e-4, maxk_threshold=1e-5, kvalue_accuracy=1e-6, maximum_fft_size=16384)
        light = galsim.Sersic(n=galaxy["sersic_index"], half_light_radius=galaxy["half_light_px"], flux=galaxy["flux_e"],
                              gsparams=fine).shear(e1=galaxy["e1"])
        seen = galsim.Convolve(light, galsim.Moffat(beta=psf["moffat_beta"], fwhm=psf["fwhm_px"], gsparams=fine),
                               gsparams=fine)
        image = seen.drawImage(nx=large, ny=large, scale=1.0, method="auto", offset=(dx, dy), dtype=np.float64).array
        low = large // 2 - half
        STAMPS[key] = image[low:low + 2 * half + 1, low:low + 2 * half + 1].copy()
    return STAMPS[key]


def moments(image, weight_px):
    """(e1, y, flux, size), with a round Gaussian weight on the weighted centroid."""
    axis = np.arange(len(image)) - len(image) // 2
    x, y = axis[None, :], axis[:, None]
    xc = yc = 0.0
    for _ in range(10000):
        weighted = image * np.exp(-((x - xc) ** 2 + (y - yc) ** 2) / (2.0 * weight_px ** 2))
        total = weighted.sum()
        xn, yn = (weighted * x).sum() / total, (weighted * y).sum() / total
        moved, xc, yc = max(abs(xn - xc), abs(yn - yc)), xn, yn
        if moved < 1e-12:
            break
    xx, yy = (weighted * (x - xc) ** 2).sum() / total, (weighted * (y - yc) ** 2).sum() / total
    return np.array([(xx - yy) / (xx + yy), yc, total, math.sqrt((xx + yy) / 2.0)])


def change_of_shape(galaxy, psf, pixel, traps, transfers, background_e, bounce):
    """delta_e1, delta_y, delta_flux, delta_size, averaged over sub-pixel positions."""
    weight = galaxy["weight_px"]
    key = (galaxy["name"], galaxy["flux_e"], galaxy["half_light_px"], weight, psf["fwhm_px"], pixel, traps, transfers,
           background_e, bounce)
    if key in SHAPES:
        return SHAPES[key]
    half = math.ceil(5.0 * weight - 1e-9)
    nodes, shares = np.polynomial.legendre.leggauss(3)
    # Symmetric in x: -1/3 is the mirror image of 1/3.
    places = [(dx, node / 2.0, share_x * share / 2.0) for dx, share_x in ((0.0, 1.0 / 3.0), (1.0 / 3.0, 2.0 / 3.0))
              for node, share in zip(nodes, shares)]
    galaxies = [stamp(galaxy, psf, dx, dy, half) for dx, dy, _ in places]
    image = np.hstack(galaxies + [np.zeros((2 * half + 1, 1))]) + background_e
    after = read_out(image, pixel, traps, transfers - 1 - half)
    total, width = np.zeros(4), 2 * half + 1
    for index, (before, (_, _, share)) in enumerate(zip(galaxies, places)):
        trailed = after[:, index * width:(index + 1) * width] - after[:, -1:]
        if bounce:
            behind = np.zeros(width)
            for row in range(width):
                trailed[row] += bounce[0] * behind
                behind = behind * math.exp(-1.0 / bounce[1]) + before[row]
        old, new = moments(before, weight), moments(trailed, weight)
        total += share * np.array([new[0] - old[0], new[1] - old[1], new[2] / old[2] - 1.0, new[3] / old[3] - 1.0])
    SHAPES[key] = total
    return total


def shapes(world, rows, observable):
    column = SHAPE_COLUMNS.index(observable)
    bounce = world.one("signal-bounce")
    bounce = (bounce["fraction"], bounce["length_px"]) if bounce else None
    galaxies = {galaxy["name"]: galaxy for galaxy in world.mission["galaxies"]}

    def change(at, traps):
        return change_of_shape(galaxies[at["galaxy"]], world.mission["psf"], world.pixel(), traps, at["transfers"],
                               at["background_e"], bounce)[column]
    values, lines = np.empty(len(rows)), {}
    for index, at in enumerate(rows):
        assert world.serial(at) is None, "shapes are not read through a serial register here"
        traps = world.traps(at)
        total = sum(trap[0] for trap in traps)
        mixture = tuple((float("%.9g" % (density / total)), release, capture) for density, release, capture in traps)
        line = (at["galaxy"], at["transfers"], at["background_e"], mixture)
        lines.setdefault(line, []).append((index, at, total))
    for line, members in lines.items():
        mixture, highest = line[3], max(total for _, _, total in members)

        def at_density(density):
            return change(members[0][1], tuple((share * density, release, capture) for share, release, capture in mixture))
        if len(members) < 6:
            for index, _, total in members:
                values[index] = at_density(total)
            continue
        # One mixture of traps in growing numbers: a polynomial in their density.
        densities = highest * (0.5 - 0.5 * np.cos(np.pi * np.arange(5) / 4.0))
        known = [at_density(density) for density in densities]
        polynomial = np.polynomial.Polynomial.fit(densities, known, 4)
        for index, _, total in members:
            values[index] = polynomial(total)
    return values


# ---------------------------------------------------------------- predictions


def predict(world, file):
    """Values without noise."""
    rows = [world.conditions(file["meta"], row) for row in file["rows"]]
    observable = file["meta"]["observable"]
    if observable == "dose":
        return np.array([world.dose(at["t_yr"]) for at in rows])
    if observable in SHAPE_COLUMNS:
        return shapes(world, rows, observable)
    behind = max(at.get("trail_px", 0) for at in rows)
    bounce, pixel = world.one("signal-bounce"), world.pixel()
    scenes = {}
    for index, at in enumerate(rows):
        scene = (world.traps(at), at["background_e"], at["transfers"], at.get("block_px", 1), world.serial(at))
        scenes.setdefault(scene, []).append(index)
    values = np.empty(len(rows))
    for (traps, background_e, transfers, block_px, register), members in scenes.items():
        read = packets(pixel, traps, background_e, transfers, block_px, behind,
                       [rows[index]["signal_e"] for index in members])
        for index in members:
            at = rows[index]
            k, signal = at.get("trail_px", 0), at["signal_e"]
            charges, backgrounds = read[signal]
            if register:
                assert block_px == 1, "blocks are not read through a serial register here"
                wanted = sorted({rows[other].get("trail_px", 0) for other in members})
                charge = through_serial(pixel, register, charges[wanted], backgrounds[wanted])[wanted.index(k)]
            else:
                charge = charges[k] - backgrounds[k]
            if bounce and k > 0:
                charge += signal * bounce["fraction"] * sum(math.exp(-(k - 1 + row) / bounce["length_px"])
                                                            for row in range(block_px))
            values[index] = charge / signal if observable == "trail" else charge
    return values


# ---------------------------------------------------------------- missions


def species(name, density_per_px, release_ms, energy_ev):
    return {"name": name, "density_per_px": density_per_px, "release_ms": release_ms, "energy_ev": energy_ev}


def mission(name, launch, duration_yr, model, rate, detector, traps, line_time_ms, transfers, background_e,
            psf=(2.2, 3.2), weight_px=3.2, fluxes=(1400.0, 6000.0)):
    full_well, notch, power, temperature, reference, dose = detector
    galaxies = [{"name": label, "sersic_index": index, "half_light_px": radius, "flux_e": flux, "e1": 0.0,
                 "weight_px": weight_px}
                for label, index, radius, flux in (("faint", 4.0, 0.45, fluxes[0]), ("disc", 1.0, 1.0, fluxes[1]))]
    return {"mission": {"name": name, "launch": datetime.date.fromisoformat(launch), "duration_yr": duration_yr},
            "environment": {"model": model, "active_dose_rate_mev_g_yr": rate, "solar_maximum": SOLAR_MAXIMA},
            "detector": {"full_well_e": full_well, "notch_e": notch, "well_fill_power": power,
                         "temperature_k": temperature, "reference_temperature_k": reference,
                         "reference_dose_mev_g": dose, "traps": [species(*trap) for trap in traps]},
            "readout": {"line_time_ms": line_time_ms, "transfers": transfers}, "sky": {"background_e": background_e},
            "psf": {"fwhm_px": psf[0], "moffat_beta": psf[1]}, "galaxies": galaxies,
            "requirement": {"delta_e": 1.0e-3, "correction_factor": 10.0, "galaxy": "faint"}}


def snap(launch="2013-03-01", model="solar-cycle"):
    """p-channel, cold, slow clocks."""
    return mission("p-channel survey camera at L2", launch, 9.0, model, 2.54e6, (161000.0, 0.0, 0.5, 133.0, 133.0, 1.78e8),
                   [("Ci", 0.35, 250.0, 0.4), ("VV", 0.49, 12.15, 0.21), ("CO", 0.7, 5000.0, 0.5)], 25.0, 1650, 120.0)


def hst(launch="2009-05-16", model="constant"):
    """n-channel in low Earth orbit, many traps; operated colder than its release times are quoted at."""
    return mission("Camera in low Earth orbit", launch, 8.0, model, 5.2e7, (84700.0, 0.0, 0.478, 192.0, 196.0, 1.78e8),
                   [("A", 0.17, 1.54, 0.31), ("B", 0.45, 15.6, 0.34), ("C", 0.38, 66.2, 0.44)], 3.212, 2048, 30.0)


def gaia(launch="2013-12-19", model="solar-cycle"):
    """Drift scan with four species and fast lines."""
    return mission("Drift-scan astrometer at L2", launch, 7.0, model, 6.0e6, (190000.0, 0.0, 0.65, 163.0, 163.0, 4.0e7),
                   [("a", 0.30, 0.7, 0.18), ("b", 0.22, 6.5, 0.30), ("c", 0.40, 48.0, 0.37), ("d", 0.60, 700.0, 0.45)],
                   0.9828, 4500, 5.0)


def euclid(launch="2023-07-01", model="solar-cycle"):
    """Survey detector, three species and a wide range of release times; the cycle ends within the mission."""
    return mission("Visible imager at L2", launch, 8.5, model, 1.1e7, (205000.0, 0.0, 0.58, 153.0, 150.0, 9.0e7),
                   [("fast", 0.55, 9.0, 0.22), ("mid", 1.05, 85.0, 0.33), ("slow", 1.3, 1300.0, 0.41)], 14.9, 2066, 90.0)


def lab():
    """An irradiated device on the bench, two species."""
    return mission("Irradiated device in the laboratory", "2021-01-01", 5.0, "constant", 2.0e6,
                   (120000.0, 0.0, 0.45, 163.0, 163.0, 6.0e7), [("P", 1.4, 2.6, 0.26), ("Q", 2.1, 31.0, 0.39)], 2.0, 1024,
                   10.0)


def fast(launch="2026-10-01", model="constant"):
    """Microseconds for a line, a single species."""
    return mission("Fast wide-field camera in low orbit", launch, 6.0, model, 1.5e6,
                   (90000.0, 0.0, 0.75, 178.0, 178.0, 1.0e7), [("E", 3.0, 0.045, 0.29)], 0.02, 2000, 40.0)


def cube(launch="2018-02-01", model="solar-cycle"):
    """Small warm camera launched when the Sun goes quiet."""
    return mission("Small camera in polar orbit", launch, 7.0, model, 3.0e6, (50000.0, 0.0, 0.5, 223.0, 213.0, 2.0e7),
                   [("K", 0.5, 1.9, 0.33), ("L", 0.9, 40.0, 0.42)], 1.5, 1024, 15.0)


# ---------------------------------------------------------------- measurements


NEAR, FEW, WIDE = [1, 2, 4, 10], [1, 2, 3, 6, 12, 30], [1, 2, 3, 5, 8, 12, 20, 35, 60]
QUARTERLY, MONTHLY = 0.25, 1.0 / 12.0


def years(start, stop, step):
    return [round(float(start + step * k), 4) for k in range(int((stop - start) / step + 1e-6) + 1)]


def table(name, observable, sigma, **conditions):
    """Measurements at every combination of the conditions that are lists (columns); the others stand in meta.

    sigma: a number, or (floor, fraction of the value) added in quadrature.
    """
    columns = [key for key, value in conditions.items() if isinstance(value, list)]
    meta = {key: value for key, value in conditions.items() if key not in columns}
    rows = [dict(zip(columns, values)) for values in itertools.product(*(conditions[key] for key in columns))]
    return {"name": name + ".ecsv", "meta": dict(meta, observable=observable), "rows": rows, "sigma": sigma}


def trails(sigma, name="trails", **conditions):
    return table(name, "trail", sigma, **conditions)


def charges(sigma, name="packets", **conditions):
    return table(name, "packet_charge", sigma, **conditions)


def monitor(mission_, last_yr, step=QUARTERLY, fraction=0.02, floor=0.01, dated=False):
    """A dose monitor; its floor is given in active years' dose."""
    floor_mev_g = floor * mission_["environment"]["active_dose_rate_mev_g_yr"]
    times = years(step, last_yr, step)
    if not dated:
        return table("dose", "dose", (floor_mev_g, fraction), t_yr=[round(t, 4) for t in times])
    launch = mission_["mission"]["launch"]
    return table("dose", "dose", (floor_mev_g, fraction),
                 date=[(launch + datetime.timedelta(days=round(365.25 * t))).isoformat() for t in times])


def density_of(*names):
    return ["detector.traps.%s.density_per_px" % name for name in names]


def release_of(*names):
    return ["detector.traps.%s.release_ms" % name for name in names]


# ---------------------------------------------------------------- cases


def case(name, group, mission_, files, effects=(), verdict=None, accept=None, free=(), note="", **more):
    effects = list(effects)
    kinds = [kind for kind, _ in effects if not kind.startswith("outside")]
    if verdict is None:
        verdict = "missing" if kinds else "complete"
    if accept is None:
        accept = [list(order) for order in itertools.permutations(kinds)]
    return dict(more, name=name, group=group, mission=mission_, files=files, effects=effects, kinds=kinds, verdict=verdict,
                accept=accept, free=list(free), note=note)


def serial_register(density_per_px, release_ms, pixel_time_ms, transfers):
    return {"pixel_time_ms": pixel_time_ms, "transfers": transfers,
            "traps": [species("serial", density_per_px, release_ms, 0.2)]}


def strong():
    def one(number, kind, parameters, mission_, files, free=(), **more):
        return case("strong-%s-%d" % (kind, number), "strong", mission_, files, [(kind, parameters)], free=free, **more)

    m = euclid(model="constant")
    yield one(1, "solar-cycle", {}, m, [
        monitor(m, 8.0, QUARTERLY, 0.03, 0.05),
        charges(3.0, t_yr=years(1, 8, 1), transfers=[200, 600], signal_e=2000.0, background_e=50.0)])
    m = snap("2019-06-01", "constant")
    yield one(2, "solar-cycle", {}, m, [
        trails(1.0e-4, t_yr=years(0.5, 7.5, 0.5), trail_px=FEW, signal_e=600.0, background_e=20.0, transfers=1600)],
        free=density_of("VV"))
    m = cube(model="constant")
    yield one(3, "solar-cycle", {}, m, [
        monitor(m, 6.0, MONTHLY, 0.08, 0.12, dated=True),
        table("eper", "eper", 0.8, t_yr=years(1, 6, 1), trail_px=NEAR, signal_e=1200.0, block_px=150, background_e=15.0,
              transfers=500)])

    m = gaia()
    flare = {"t_yr": 2.13, "dose_mev_g": 2.2e6}
    yield one(1, "solar-flare", flare, m, [
        monitor(m, 5.0, MONTHLY, 0.02, 0.02),
        trails(1.5e-4, t_yr=years(0.5, 5.0, 0.5), trail_px=NEAR, signal_e=1000.0, background_e=5.0, transfers=900)])
    m = hst()
    yield one(2, "solar-flare", {"t_yr": 3.2, "dose_mev_g": 2.0e7}, m, [
        charges(1.0, t_yr=years(0.5, 6.0, 0.5), transfers=[300, 900], signal_e=1200.0, background_e=20.0)],
        free=density_of("B"))
    m = snap()
    yield one(3, "solar-flare", {"t_yr": 1.4, "dose_mev_g": 1.6e6}, m, [
        monitor(m, 6.0), table("delta_e1", "delta_e1", 2.0e-5, t_yr=years(0.5, 6.0, 0.5), galaxy="faint", transfers=900)])

    m = snap("2019-06-01")
    yield one(1, "cosmic-ray-floor", {"rate_mev_g_yr": 3.5e5}, m, [
        monitor(m, 7.0, QUARTERLY, 0.02, 0.02),
        trails(1.0e-4, t_yr=years(1, 7, 1), trail_px=FEW, signal_e=1200.0, background_e=30.0, transfers=1000)])
    m = cube()
    yield one(2, "cosmic-ray-floor", {"rate_mev_g_yr": 2.2e5}, m, [
        monitor(m, 6.5, MONTHLY, 0.03, 0.02),
        charges(0.7, t_yr=years(0.5, 6.5, 1), transfers=[250, 750], signal_e=900.0, background_e=15.0)])
    m = euclid("2027-09-01")
    yield one(3, "cosmic-ray-floor", {"rate_mev_g_yr": 1.8e6}, m, [
        trails(1.5e-4, t_yr=years(0.5, 7.5, 1), trail_px=FEW, signal_e=1800.0, background_e=40.0, transfers=800)],
        free=density_of("mid"))

    m = euclid()
    yield one(1, "dose-scale", {"factor": 1.25}, m, [
        monitor(m, 7.0), trails(2.0e-4, t_yr=years(1, 7, 1.5), trail_px=WIDE, signal_e=[600.0, 6000.0],
                                background_e=90.0, transfers=1000)])
    m = hst()
    yield one(2, "dose-scale", {"factor": 1.15}, m, [
        monitor(m, 6.0, MONTHLY), charges(1.2, t_yr=years(1, 6, 1), transfers=[200, 700, 1200],
                                          signal_e=[500.0, 4000.0], background_e=30.0),
        trails(1.2e-4, t_yr=[2.0, 5.0], trail_px=WIDE, signal_e=1500.0, background_e=30.0, transfers=700)])
    m = snap()
    yield one(3, "dose-scale", {"factor": 1.4}, m, [
        monitor(m, 6.0, dated=True),
        table("delta_flux", "delta_flux", 3.0e-5, t_yr=years(0.5, 6.0, 0.5), galaxy=["faint", "disc"],
              transfers=900),
        trails(6.0e-5, t_yr=[2.0, 4.0, 6.0], trail_px=FEW, signal_e=[300.0, 5000.0], background_e=40.0, transfers=900)])

    m = gaia()
    yield one(1, "prelaunch-traps", {"a": 0.05, "b": 0.03, "c": 0.06, "d": 0.04}, m, [
        monitor(m, 5.0), trails(1.5e-4, t_yr=[0.05, 0.3, 1.0, 2.5, 5.0], trail_px=WIDE, signal_e=1500.0,
                                background_e=5.0, transfers=[150, 800])])
    m = hst()
    yield one(2, "prelaunch-traps", {"A": 0.03, "B": 0.10, "C": 0.05}, m, [
        monitor(m, 6.0),
        trails(3.0e-4, t_yr=[0.1, 0.5, 1.0, 2.0, 4.0, 6.0], trail_px=FEW, signal_e=800.0, background_e=20.0, transfers=700),
        charges(1.0, t_yr=[0.1, 0.5, 1.0, 2.0, 4.0, 6.0], transfers=[300, 1000], signal_e=800.0, background_e=20.0)],
        free=density_of("A", "B", "C"))
    m = fast()
    yield one(3, "prelaunch-traps", {"E": 0.16}, m, [
        monitor(m, 5.0, fraction=0.015), charges(0.6, t_yr=[0.02, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0], transfers=[400, 1100],
                                                 signal_e=3000.0, background_e=40.0)])

    m = snap("2015-06-01")
    yield one(1, "annealing", {"time_yr": 4.0}, m, [
        monitor(m, 8.0), trails(1.0e-4, t_yr=years(0.5, 8.0, 0.75), trail_px=FEW, signal_e=1300.0, background_e=40.0,
                                transfers=1000)])
    m = euclid()
    yield one(2, "annealing", {"time_yr": 9.0}, m, [
        monitor(m, 8.0), charges(2.5, t_yr=years(0.5, 8.0, 0.5), transfers=[300, 900], signal_e=3000.0, background_e=60.0)])
    m = cube("2016-09-01")
    yield one(3, "annealing", {"time_yr": 3.5}, m, [
        monitor(m, 7.0, MONTHLY), table("eper", "eper", 0.4, t_yr=years(0.5, 7.0, 0.5), trail_px=NEAR, signal_e=1000.0,
                                        block_px=100, background_e=15.0, transfers=450)], free=density_of("K", "L"))

    m = hst()
    yield one(1, "bakeout", {"t_yr": 2.7, "fraction": 0.4}, m, [
        trails(3.0e-4, t_yr=years(0.5, 6.0, 0.5), trail_px=FEW, signal_e=1000.0, background_e=30.0, transfers=700)])
    m = gaia()
    yield one(2, "bakeout", {"t_yr": 1.6, "fraction": 0.35}, m, [
        monitor(m, 5.0), charges(0.4, t_yr=years(0.4, 4.8, 0.4), transfers=[300, 1000], signal_e=1500.0, background_e=5.0)],
        free=density_of("c"))
    m = snap()
    yield one(3, "bakeout", {"t_yr": 4.05, "fraction": 0.30}, m, [
        monitor(m, 6.0, dated=True),
        table("delta_y", "delta_y", 1.0e-4, t_yr=years(0.5, 6.0, 0.5), galaxy="disc", transfers=900),
        charges(0.3, t_yr=years(0.5, 6.0, 0.5), transfers=900, signal_e=800.0, background_e=20.0)])

    m = lab()
    yield one(1, "extra-species", {"density_per_px": 0.5, "release_ms": 300.0, "energy_ev": 0.42}, m, [
        trails(2.0e-4, trail_px=[1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 32, 40, 50, 65, 80, 100], signal_e=[700.0, 2000.0],
               background_e=0.0, transfers=1000, dose_mev_g=6.0e7),
        charges(0.8, transfers=[100, 250, 400, 550, 700, 850, 1000], signal_e=2000.0, background_e=0.0, dose_mev_g=6.0e7)],
        free=density_of("P", "Q"))
    m = fast()
    yield one(2, "extra-species", {"density_per_px": 1.1, "release_ms": 0.4, "energy_ev": 0.35}, m, [
        trails(6.0e-5, t_yr=[1.0, 3.0, 5.0], trail_px=[1, 2, 3, 4, 6, 9, 13, 18, 25, 35, 50], signal_e=[1500.0, 8000.0],
               background_e=40.0, transfers=900)], free=density_of("E") + release_of("E"))
    m = euclid()
    yield one(3, "extra-species", {"density_per_px": 0.45, "release_ms": 300.0, "energy_ev": 0.30}, m, [
        trails(2.0e-4, temperature_k=[145.0, 153.0, 161.0], trail_px=[1, 2, 3, 5, 8, 12, 18, 27, 40, 60, 90],
               signal_e=2000.0, background_e=60.0, transfers=1000, t_yr=[2.0, 5.0])])

    m = lab()
    yield one(1, "release-continuum", {"sigma": 0.8}, m, [
        trails(2.0e-4, line_time_ms=[1.0, 2.0, 5.0], trail_px=[1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 32, 40],
               signal_e=1500.0, background_e=0.0, transfers=900, dose_mev_g=6.0e7)],
        free=density_of("P", "Q") + release_of("P", "Q"))
    m = fast()
    yield one(2, "release-continuum", {"sigma": 0.75}, m, [
        trails(1.0e-4, t_yr=[2.0, 5.0], trail_px=[1, 2, 3, 4, 5, 6, 8, 10, 13, 17, 22, 30], signal_e=[2000.0, 9000.0],
               background_e=0.0, transfers=1000)], free=density_of("E"))
    m = snap()
    yield one(3, "release-continuum", {"sigma": 0.8}, m, [
        trails(1.5e-4, dose_mev_g=1.2e8, trail_px=WIDE, line_time_ms=[10.0, 25.0], signal_e=[300.0, 1500.0],
               background_e=10.0, transfers=600)])

    m = fast()
    yield one(1, "finite-capture", {"capture_ms": 0.004}, m, [
        trails(2.0e-4, line_time_ms=[0.01, 0.02, 0.05], trail_px=[1, 2, 3, 5, 8], signal_e=[1000.0, 5000.0],
               background_e=0.0, transfers=900, t_yr=4.0),
        charges(0.5, line_time_ms=[0.01, 0.02, 0.05], signal_e=[1000.0, 5000.0], transfers=[300, 900], background_e=0.0,
                t_yr=4.0)])
    m = hst()
    yield one(2, "finite-capture", {"capture_ms": 0.7}, m, [
        trails(2.5e-4, t_yr=[2.0, 5.0], line_time_ms=[1.6, 3.212, 8.0], trail_px=FEW, signal_e=2000.0, background_e=0.0,
               transfers=1000)])
    m = lab()
    yield one(3, "finite-capture", {"capture_ms": 0.9}, m, [
        trails(3.0e-4, line_time_ms=[1.0, 2.0, 4.0, 8.0], trail_px=[1, 2, 3, 6, 12, 25], signal_e=[400.0, 1500.0],
               background_e=0.0, transfers=800, dose_mev_g=6.0e7)], free=density_of("P", "Q"))

    m = snap()
    yield one(1, "notch", {"notch_e": 80.0}, m, [
        trails(1.5e-4, signal_e=[150.0, 300.0, 700.0, 2000.0, 8000.0], transfers=[600, 1500], trail_px=FEW, background_e=2.0,
               t_yr=5.0)])
    m = gaia()
    yield one(2, "notch", {"notch_e": 60.0}, m, [
        charges(0.15, signal_e=[60.0, 120.0, 250.0, 500.0, 1500.0, 5000.0, 20000.0], transfers=[500, 1000], t_yr=[2.0, 4.5],
                background_e=5.0)], free=density_of("a", "b", "c", "d"))
    m = euclid()
    yield one(3, "notch", {"notch_e": 70.0}, m, [
        trails(2.0e-4, signal_e=[200.0, 500.0, 1500.0, 6000.0], background_e=[5.0, 60.0, 150.0], trail_px=FEW,
               transfers=700, t_yr=4.0)])

    m = hst()
    yield one(1, "well-fill", {"well_fill_power": 0.56}, m, [
        trails(2.5e-4, signal_e=[300.0, 1000.0, 3000.0, 10000.0, 30000.0], trail_px=FEW, background_e=10.0, transfers=700,
               t_yr=[2.0, 4.0])])
    m = lab()
    yield one(2, "well-fill", {"well_fill_power": 0.55}, m, [
        table("eper", "eper", 0.9, signal_e=[300.0, 1000.0, 3000.0, 10000.0, 30000.0], trail_px=[1, 2, 3, 5, 10, 20],
              block_px=120, background_e=0.0, transfers=500, dose_mev_g=6.0e7)], free=density_of("P", "Q"))
    m = fast()
    yield one(3, "well-fill", {"well_fill_power": 0.68}, m, [
        charges((0.5, 1e-5), signal_e=[500.0, 1500.0, 5000.0, 15000.0, 40000.0], transfers=[300, 900], t_yr=[1.5, 4.5],
                background_e=20.0), trails(2e-4, signal_e=[1500.0, 15000.0], trail_px=NEAR, t_yr=4.5, transfers=900,
                                           background_e=20.0)], free=density_of("E"))

    m = snap()
    yield one(1, "preflash", {"electrons": 50.0}, m, [
        trails(1.0e-4, background_e=[0.0, 10.0, 40.0, 120.0], signal_e=[300.0, 1500.0, 8000.0], trail_px=FEW,
               transfers=1500, t_yr=6.5)])
    m = gaia()
    yield one(2, "preflash", {"electrons": 20.0}, m, [
        charges(0.15, background_e=[1.0, 5.0, 20.0, 80.0], signal_e=[120.0, 600.0, 3000.0], transfers=[400, 900],
                t_yr=4.0)], free=density_of("c", "d"))
    m = cube()
    yield one(3, "preflash", {"electrons": 25.0}, m, [
        table("eper", "eper", 0.6, background_e=[0.0, 15.0, 60.0], signal_e=[200.0, 1000.0, 4000.0],
              trail_px=[1, 2, 4, 8, 16, 32], block_px=80, transfers=400, t_yr=6.0),
        trails(2.5e-4, background_e=[0.0, 60.0], signal_e=[300.0, 2000.0], trail_px=NEAR, transfers=800, t_yr=6.0)])

    m = euclid()
    yield one(1, "temperature-offset", {"kelvin": 3.5}, m, [
        trails(1.5e-4, temperature_k=[143.0, 153.0, 163.0], trail_px=WIDE, signal_e=1800.0, background_e=60.0,
               transfers=900, t_yr=4.0)])
    m = lab()
    yield one(2, "temperature-offset", {"kelvin": -2.0}, m, [
        trails(2.5e-4, temperature_k=[148.0, 158.0, 168.0, 178.0], trail_px=WIDE, signal_e=[500.0, 3000.0],
               background_e=0.0, transfers=900, dose_mev_g=6.0e7)], free=density_of("P", "Q"))
    m = hst()
    yield one(3, "temperature-offset", {"kelvin": 3.0}, m, [
        charges(0.8, temperature_k=[182.0, 192.0, 202.0], transfers=[300, 900], signal_e=1000.0, background_e=20.0,
                t_yr=[2.0, 5.0]),
        trails(3.0e-4, temperature_k=[182.0, 192.0, 202.0], trail_px=FEW, transfers=900, signal_e=1000.0, background_e=20.0,
               t_yr=4.0)])

    m = euclid()
    yield one(1, "temperature-cycle", {"amplitude_k": 1.5, "period_yr": 1.0, "warmest_t_yr": 0.3}, m, [
        trails((3.0e-5, 0.01), t_yr=years(0.2, 4.1, 0.13), trail_px=FEW, signal_e=2000.0, background_e=60.0, transfers=1500)],
        free=density_of("fast", "mid", "slow"))
    m = hst()
    yield one(2, "temperature-cycle", {"amplitude_k": 3.0, "period_yr": 0.5, "warmest_t_yr": 0.1}, m, [
        trails(2.0e-4, t_yr=years(0.3, 2.3, 0.05), trail_px=NEAR, signal_e=1000.0, background_e=20.0, transfers=900)])

    m = snap()
    yield one(1, "signal-bounce", {"fraction": 1.2e-3, "length_px": 1.6}, m, [
        trails(1.5e-4, transfers=[40, 300, 1000], signal_e=[500.0, 3000.0], trail_px=FEW, background_e=20.0,
               t_yr=[1.0, 4.0])])
    m = gaia()
    yield one(2, "signal-bounce", {"fraction": -1.5e-3, "length_px": 3.0}, m, [
        trails(2.0e-4, transfers=[50, 400, 900], signal_e=[400.0, 4000.0], trail_px=FEW, background_e=5.0,
               t_yr=[0.5, 4.0])], free=density_of("a", "b"))
    m = fast()
    yield one(3, "signal-bounce", {"fraction": 2.0e-3, "length_px": 4.0}, m, [
        table("eper", "eper", 1.2, signal_e=[500.0, 3000.0], trail_px=[1, 2, 3, 5, 8, 13], block_px=30,
              transfers=[40, 300, 900], background_e=40.0, t_yr=3.0),
        charges(0.8, signal_e=[500.0, 3000.0], transfers=[40, 300, 900], background_e=40.0, t_yr=3.0)])

    m = hst()
    yield one(1, "serial-traps", serial_register(0.06, 0.06, 0.022, 1024), m, [
        charges(0.8, transfers=[10, 100, 400, 900], signal_e=[300.0, 1500.0, 8000.0], background_e=0.0, t_yr=[2.0, 5.0]),
        trails(3.0e-4, transfers=[100, 900], signal_e=1500.0, trail_px=FEW, background_e=0.0, t_yr=5.0)])
    m = lab()
    yield one(2, "serial-traps", serial_register(0.12, 0.012, 0.005, 500), m, [
        charges(0.8, transfers=[5, 100, 300, 600, 1000], signal_e=[400.0, 2000.0, 10000.0], background_e=0.0,
                dose_mev_g=6.0e7),
        trails(3.0e-4, transfers=[100, 1000], signal_e=2000.0, trail_px=FEW, background_e=0.0, dose_mev_g=6.0e7)],
        free=density_of("P", "Q"))
    m = euclid()
    yield one(3, "serial-traps", serial_register(0.4, 0.020, 0.014, 600), m, [
        charges(0.6, transfers=[10, 150, 600], signal_e=[500.0, 3000.0], background_e=20.0, t_yr=years(1, 7, 1.5)),
        trails(2.5e-4, transfers=600, signal_e=3000.0, trail_px=NEAR, background_e=20.0, t_yr=6.0)])


def complete():
    """A dozen arrangements; fresh noise on each."""
    snap_, hst_, gaia_, euclid_, lab_, fast_, cube_ = snap(), hst(), gaia(), euclid(), lab(), fast(), cube()
    quiet = snap("2019-06-01")
    arrangements = [
        ("p-channel-epochs", snap_, [monitor(snap_, 6.0), trails(1.5e-4, t_yr=years(1, 6, 1), trail_px=FEW, signal_e=1200.0,
                                                                 background_e=30.0, transfers=900)], []),
        ("p-channel-quiet", quiet, [monitor(quiet, 7.0, MONTHLY, 0.03, 0.02),
                                    charges(0.4, t_yr=years(0.5, 7.5, 1), transfers=[300, 900], signal_e=1500.0,
                                            background_e=20.0)], density_of("VV")),
        ("p-channel-shapes", snap_, [table("delta_e1", "delta_e1", 2.0e-5, t_yr=years(0.5, 6.0, 0.5), galaxy="faint",
                                           transfers=900), monitor(snap_, 6.0, dated=True)], []),
        ("orbit-signals", hst_, [trails(3.0e-4, signal_e=[200.0, 1000.0, 5000.0], t_yr=[2.0, 4.0], trail_px=FEW,
                                        background_e=10.0, transfers=700)], density_of("A", "B", "C")),
        ("orbit-packets", hst_, [charges(1.0, t_yr=years(1, 6, 1), transfers=[200, 500, 900], signal_e=[500.0, 3000.0],
                                         background_e=30.0), monitor(hst_, 6.0)], []),
        ("drift-scan-epochs", gaia_, [trails(1.5e-4, t_yr=[0.3, 1.0, 2.0, 3.0, 4.0, 5.0], trail_px=WIDE, signal_e=1500.0,
                                             background_e=5.0, transfers=800), monitor(gaia_, 5.0)],
         density_of("a", "b", "c")),
        ("drift-scan-faint", gaia_, [charges(0.3, signal_e=[60.0, 250.0, 1500.0, 10000.0], transfers=[300, 800],
                                             background_e=[2.0, 20.0], t_yr=[2.0, 4.5])], []),
        ("imager-temperatures", euclid_, [trails((1.0e-4, 0.01), temperature_k=[145.0, 153.0, 161.0], trail_px=WIDE,
                                                 signal_e=1800.0, background_e=60.0, transfers=900, t_yr=[2.0, 5.0])],
         density_of("mid") + release_of("mid")),
        ("bench-trails", lab_, [trails(2.5e-4, trail_px=[1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48], signal_e=[500.0, 2500.0],
                                       line_time_ms=[1.0, 4.0], background_e=0.0, transfers=900, dose_mev_g=6.0e7),
                                charges(0.8, transfers=[100, 400, 700, 1000], signal_e=2500.0, background_e=0.0,
                                        dose_mev_g=6.0e7)], density_of("P", "Q") + release_of("P", "Q")),
        ("bench-eper", lab_, [table("eper", "eper", 1.5, signal_e=[500.0, 2000.0, 8000.0],
                                    trail_px=[1, 2, 3, 5, 8, 13, 21, 34], block_px=150, background_e=0.0, transfers=500,
                                    dose_mev_g=[2.0e7, 6.0e7])], []),
        ("fast-clocks", fast_, [charges(0.6, line_time_ms=[0.01, 0.02, 0.05], t_yr=[1.0, 3.0, 5.0], transfers=[300, 900],
                                        signal_e=[1000.0, 6000.0], background_e=40.0),
                                trails(2.0e-4, t_yr=[1.0, 3.0, 5.0], trail_px=NEAR, transfers=900, signal_e=6000.0,
                                       background_e=40.0)], density_of("E")),
        ("imager-shapes", euclid_, [table("delta_size", "delta_size", 1.0e-4, t_yr=years(0.5, 8.0, 0.5),
                                          galaxy=["faint", "disc"], transfers=700),
                                    table("delta_y", "delta_y", 4.0e-4, t_yr=years(0.5, 8.0, 0.5), galaxy="disc",
                                          transfers=700)], density_of("fast")),
        ("small-camera", cube_, [monitor(cube_, 6.5, MONTHLY, 0.03, 0.02, dated=True),
                                 table("eper", "eper", 0.8, t_yr=years(0.5, 6.5, 1.0), trail_px=NEAR, signal_e=1200.0,
                                       block_px=100, background_e=15.0, transfers=450)], []),
    ]
    for number in range(100):
        name, mission_, files, free = arrangements[number % len(arrangements)]
        yield case("complete-%s-%d" % (name, number // len(arrangements) + 1), "complete", mission_, files, free=free,
                   arrangement=name)


def with_column(file, name, of_row):
    """The same measurements with one more column."""
    return dict(file, rows=[dict(row, **{name: of_row(number, row)}) for number, row in enumerate(file["rows"])])


def outside():
    def one(name, mission_, files, change, covariates, note, free=(), effects=()):
        return case("outside-" + name, "outside", mission_, files, effects, "unexplained", [[]], free, note,
                    change=change, covariates=covariates)

    def scattered(number, low, high):
        """Without order, but the same every time."""
        return round(low + (high - low) * ((number * 0.6180339887) % 1.0), 2)

    m = gaia()
    yield one("gain-drift", m, [charges(0.6, t_yr=years(0.5, 5.0, 0.5), signal_e=[500.0, 2000.0, 8000.0],
                                        transfers=[100, 500, 900], background_e=5.0)],
              lambda value, at: value * (1.0 + 8.0e-4 * at["t_yr"] - 2.4e-4 * at["t_yr"] ** 2), ["t_yr"],
              "the gain drifts: charges times 1 + 8e-4 t - 2.4e-4 t^2")
    m = hst()
    yield one("nonlinear-gain", m, [charges(1.0, signal_e=[200.0, 600.0, 2000.0, 6000.0, 15000.0, 30000.0],
                                            transfers=[50, 300, 900], t_yr=[1.0, 4.0], background_e=20.0)],
              lambda value, at: value - 4.0e-8 * value ** 2, ["signal_e"],
              "the amplifier saturates: charge minus 4e-8 charge^2", free=density_of("B"))
    m = snap()
    offset = {1: -2.5, 2: 1.0, 3: 3.0, 4: -1.0}
    yield one("offset-by-ccd", m, [charges(0.5, t_yr=years(1, 6, 1), ccd=[1, 2, 3, 4], transfers=[200, 800],
                                           signal_e=1500.0, background_e=20.0)],
              lambda value, at: value + offset[at["ccd"]], ["ccd"], "each CCD has an offset of its own")
    m = euclid()
    gain = {"A": 1.0, "B": 1.12, "C": 0.9, "D": 1.05}
    yield one("factor-by-amplifier", m, [trails(1.5e-4, t_yr=[1.0, 3.0, 5.0, 7.0], amplifier=["A", "B", "C", "D"],
                                                trail_px=FEW, signal_e=2000.0, background_e=60.0, transfers=800)],
              lambda value, at: value * gain[at["amplifier"]], ["amplifier"],
              "trails times a factor that depends on the amplifier")
    m = cube()
    angled = with_column(charges(0.8, t_yr=years(0.25, 6.25, 0.5), transfers=[150, 500, 850], signal_e=[600.0, 2500.0],
                                 background_e=15.0), "sun_angle_deg", lambda n, row: scattered(n, 0.0, 360.0))
    yield one("sun-angle", m, [angled],
              lambda value, at: value + 3.0 * math.sin(math.radians(at["sun_angle_deg"])), ["sun_angle_deg"],
              "3 e- sin(sun angle) on every charge")
    m = lab()
    damp = with_column(trails(2.5e-4, trail_px=[1, 2, 3, 5, 8, 12, 20, 32], signal_e=[500.0, 1500.0, 5000.0],
                              transfers=[200, 600, 1000], background_e=0.0, dose_mev_g=6.0e7),
                       "humidity", lambda n, row: scattered(n, 20.0, 80.0))
    yield one("humidity", m, [damp], lambda value, at: value + 4.0e-5 * (at["humidity"] - 40.0), ["humidity"],
              "4e-5 per per cent of humidity above 40 on every trail", free=density_of("P", "Q"))
    m = euclid()
    yield one("density-by-temperature", m, [
        trails(1.5e-4, temperature_k=[141.0, 147.0, 153.0, 159.0, 165.0], t_yr=[2.0, 5.0], trail_px=FEW, signal_e=2000.0,
               background_e=60.0, transfers=800),
        charges(0.8, temperature_k=[141.0, 147.0, 153.0, 159.0, 165.0], t_yr=[2.0, 5.0], transfers=[300, 800],
                signal_e=2000.0, background_e=60.0)], None, ["temperature_k"],
        "as many traps times 1 + 0.03 (T - 153 K)",
        effects=[("outside: density against a condition", {"of": lambda at: 1.0 + 0.03 * (at["temperature_k"] - 153.0)})])
    m = euclid()
    yield one("temperature-by-epoch", m, [
        trails((3.0e-5, 0.01), t_yr=years(0.2, 4.1, 0.26), trail_px=FEW, signal_e=2000.0, background_e=60.0, transfers=1500)],
        None, [], "a temperature of its own at every epoch, normal with 1.2 K, that no column records",
        effects=[("outside: temperature of every epoch",
                  {"of": lambda at: np.random.default_rng(int(1e4 * at["t_yr"])).normal(0.0, 1.2)})])
    m = snap()
    yield one("one-pixel", m, [trails(2.0e-4, signal_e=[150.0, 400.0, 1500.0, 6000.0], transfers=[300, 900],
                                      trail_px=[1, 2, 3, 4, 6, 10], background_e=5.0, t_yr=[2.0, 5.0])],
              lambda value, at: value + (2.5e-3 if at["trail_px"] == 2 and at["signal_e"] < 500.0 else 0.0),
              ["trail_px", "signal_e"], "2.5e-3 more in the second pixel of faint packets' trails")
    m = hst()
    yield one("gain-step", m, [charges(1.0, t_yr=years(0.5, 6.5, 0.5), signal_e=[400.0, 2000.0, 9000.0],
                                       transfers=[50, 400], background_e=30.0), monitor(m, 6.5)],
              lambda value, at: value * (1.0015 if at["observable"] == "packet_charge" and at["t_yr"] > 3.3 else 1.0),
              ["t_yr"], "other electronics from 3.3 yr on: charges times 1.0015")
    m = fast()
    many = {1: 1.0, 2: 1.3, 3: 0.75}
    yield one("density-by-ccd", m, [trails(1.5e-4, t_yr=[1.0, 3.0, 5.0], ccd=[1, 2, 3], trail_px=NEAR,
                                           signal_e=[1500.0, 8000.0], background_e=40.0, transfers=800)],
              None, ["ccd"], "three CCDs with 1, 1.3 and 0.75 times the traps", free=density_of("E"),
              effects=[("outside: density against a condition", {"of": lambda at: many[at["ccd"]]})])


def ambiguous():
    """Six arrangements, each twice: so few rows that one draw of noise says little."""
    def twice(kind, parameters, mission_, files):
        for number in (1, 2):
            yield case("ambiguous-%s-%d" % (kind, number), "ambiguous", mission_, files, [(kind, parameters)], "ambiguous",
                       [[kind]], note="one epoch, one signal, one distance: other effects give the same",
                       arrangement=kind)

    yield from twice("dose-scale", {"factor": 1.5}, snap(), [
        trails(1.0e-4, trail_px=FEW, signal_e=600.0, background_e=40.0, transfers=1600, t_yr=5.0)])
    yield from twice("prelaunch-traps", {"E": 0.15}, fast(), [
        trails(1.5e-4, trail_px=[1, 2, 3, 4, 6, 10, 15, 25], signal_e=3000.0, background_e=40.0, transfers=1000, t_yr=1.0)])
    yield from twice("annealing", {"time_yr": 8.0}, euclid(), [
        trails(3.0e-4, trail_px=[1, 2, 3, 4, 6, 9, 14, 25], signal_e=2500.0, background_e=90.0, transfers=1000, t_yr=5.0)])
    yield from twice("preflash", {"electrons": 40.0}, gaia(), [
        trails(1.5e-4, trail_px=[1, 2, 3, 4, 5, 7, 10, 15], signal_e=400.0, background_e=2.0, transfers=1500, t_yr=4.0)])
    yield from twice("cosmic-ray-floor", {"rate_mev_g_yr": 1.2e6}, cube(), [
        table("eper", "eper", 0.8, trail_px=[1, 2, 3, 5, 8, 12, 20], signal_e=1200.0, block_px=100, background_e=15.0,
              transfers=450, t_yr=3.0)])
    yield from twice("bakeout", {"t_yr": 2.0, "fraction": 0.3}, hst(), [
        trails(2.0e-4, trail_px=WIDE, signal_e=1500.0, background_e=30.0, transfers=900, t_yr=4.0)])


def unfit():
    def one(name, mission_, files, note, free=(), **more):
        return case("unfit-" + name, "unfit", mission_, files, (), "unfit", [[]], free, note, **more)

    m = snap()
    files = [monitor(m, 6.0), trails(1.5e-4, t_yr=years(1, 6, 1), trail_px=FEW, signal_e=1200.0, background_e=30.0,
                                     transfers=900)]
    yield one("sigma-too-small", m, files, "the scatter is four times the quoted sigma", noise=4.0)
    m = hst()
    yield one("sigma-too-large", m, [charges(8.0, t_yr=years(1, 6, 1), transfers=[200, 500, 900], signal_e=[500.0, 3000.0],
                                             background_e=30.0)],
              "the scatter is an eighth of the quoted sigma", noise=1.0 / 8.0)
    m = euclid()
    yield one("repeated-rows", m, [trails(2.0e-4, t_yr=years(1, 7, 1), trail_px=WIDE, signal_e=2500.0, background_e=90.0,
                                          transfers=1000)], "a third of the rows are exact copies of others", repeat=True)
    m = gaia()
    yield one("contradictory-rows", m, [charges(0.4, signal_e=[250.0, 1500.0, 10000.0], transfers=[300, 800],
                                                t_yr=[1.0, 2.0, 3.5, 5.0], background_e=5.0)],
              "rows under the same conditions are 15 sigma apart", contradict=True)
    m = lab()
    yield one("three-rows", m, [trails(3.0e-4, trail_px=[1, 3, 10], signal_e=1500.0, background_e=0.0, transfers=900,
                                       dose_mev_g=6.0e7)], "three rows, five free parameters",
              density_of("P", "Q") + release_of("P", "Q") + ["detector.well_fill_power"])


def pair():
    def one(number, effects, mission_, files, free=()):
        name = "pair-%d-%s" % (number, "-and-".join(kind for kind, _ in effects))
        return case(name, "pair", mission_, files, effects, free=free)

    m = euclid()
    long = [1, 2, 3, 5, 8, 12, 18, 27, 40, 60, 90]
    yield one(1, [("extra-species", {"density_per_px": 0.5, "release_ms": 330.0, "energy_ev": 0.35}),
                  ("annealing", {"time_yr": 8.0})], m, [
        monitor(m, 8.0), trails(1.2e-4, t_yr=years(1, 8, 1), trail_px=long, signal_e=2000.0, background_e=60.0,
                                transfers=900)])
    m = snap()
    yield one(2, [("notch", {"notch_e": 90.0}), ("prelaunch-traps", {"Ci": 0.012, "VV": 0.02, "CO": 0.015})], m, [
        trails(1.5e-4, t_yr=[0.1, 1.0, 3.0, 5.0], signal_e=[150.0, 400.0, 1500.0, 6000.0], trail_px=FEW, background_e=2.0,
               transfers=900), monitor(m, 5.0)])
    m = gaia()
    yield one(3, [("solar-flare", {"t_yr": 2.4, "dose_mev_g": 4.0e6}), ("dose-scale", {"factor": 1.2})], m, [
        monitor(m, 5.0, MONTHLY), trails(1.5e-4, t_yr=years(0.5, 5.0, 0.5), trail_px=FEW, signal_e=1500.0, background_e=5.0,
                                         transfers=800)])
    m = hst()
    yield one(4, [("bakeout", {"t_yr": 3.3, "fraction": 0.3}), ("signal-bounce", {"fraction": 2.5e-3, "length_px": 2.0})],
              m, [trails(3.0e-4, t_yr=years(0.5, 6.0, 0.5), transfers=[60, 600], trail_px=FEW, signal_e=1500.0,
                         background_e=20.0)])
    m = lab()
    yield one(5, [("preflash", {"electrons": 20.0}),
                  ("extra-species", {"density_per_px": 1.5, "release_ms": 350.0, "energy_ev": 0.42})], m, [
        trails(2.5e-4, background_e=[0.0, 10.0, 60.0], signal_e=[300.0, 1500.0, 6000.0], trail_px=long, transfers=700,
               dose_mev_g=6.0e7)], free=density_of("P", "Q"))
    m = cube("2016-09-01")
    yield one(6, [("well-fill", {"well_fill_power": 0.54}), ("annealing", {"time_yr": 6.0})], m, [
        monitor(m, 7.0), charges(1.5, t_yr=years(1, 7, 1), signal_e=[300.0, 1500.0, 8000.0], transfers=[200, 700],
                                 background_e=10.0),
        trails(2.5e-4, t_yr=[2.0, 6.5], signal_e=[500.0, 5000.0], trail_px=FEW, transfers=700, background_e=10.0)])
    m = euclid("2025-02-01")
    yield one(7, [("dose-scale", {"factor": 1.2}), ("signal-bounce", {"fraction": 2.0e-3, "length_px": 3.0})], m, [
        monitor(m, 6.0), trails(2.5e-4, t_yr=years(0.5, 6.5, 1), transfers=[50, 300, 900], trail_px=FEW, signal_e=2000.0,
                                background_e=50.0)])
    m = fast()
    yield one(8, [("finite-capture", {"capture_ms": 0.006}), ("prelaunch-traps", {"E": 0.12})], m, [
        trails(2.0e-4, t_yr=[0.05, 0.5, 2.0, 5.0], line_time_ms=[0.01, 0.02, 0.05], trail_px=[1, 2, 3, 5, 8],
               signal_e=4000.0, background_e=0.0, transfers=900),
        charges(1.5, t_yr=[0.05, 0.5, 2.0, 5.0], line_time_ms=[0.01, 0.02, 0.05], transfers=[300, 900], signal_e=4000.0,
                background_e=0.0)])


def weaker(kind, parameters, strength, believed):
    """The same effect at a fraction of its strength; its trace in the data grows about in proportion."""
    p = copy.deepcopy(parameters)
    for name in {"solar-flare": ["dose_mev_g"], "cosmic-ray-floor": ["rate_mev_g_yr"], "prelaunch-traps": list(p),
                 "bakeout": ["fraction"], "extra-species": ["density_per_px"], "finite-capture": ["capture_ms"],
                 "notch": ["notch_e"], "preflash": ["electrons"], "temperature-offset": ["kelvin"],
                 "temperature-cycle": ["amplitude_k"],
                 "signal-bounce": ["fraction"]}.get(kind, []):
        p[name] *= strength
    if kind == "dose-scale":
        p["factor"] = 1.0 + (p["factor"] - 1.0) * strength
    if kind == "annealing":
        p["time_yr"] /= strength
    if kind == "release-continuum":
        p["sigma"] *= math.sqrt(strength)
    if kind == "well-fill":
        power = believed["detector"]["well_fill_power"]
        p["well_fill_power"] = power + (p["well_fill_power"] - power) * strength
    if kind == "serial-traps":
        p["traps"][0]["density_per_px"] *= strength
    return p


def edge():
    """The first of the strong cases of each effect, weakened until it is hard to see."""
    for strong_case in strong():
        (kind, parameters), = strong_case["effects"]
        if not strong_case["name"].endswith("-1"):
            continue
        # Without free parameters, which would only hide part of it.
        c = dict(strong_case, name="edge-" + kind, group="edge", free=[],
                 note="edge: any answer but a wrong one will do")
        c["tune"] = (kind, parameters)
        yield c


def power():
    """The same at several strengths: how strong must an effect be to be named?"""
    for edge_case in edge():
        kind, _ = edge_case["tune"]
        for target in POWER:
            yield dict(edge_case, name="power-%s-%d" % (kind, target), group="power", target=target, note="")


def tune(c):
    """Strength (or, for an effect without parameters, sigma) at which delta_chi2 is within a fifth of what is wanted."""
    kind, parameters = c["tune"]
    target = c.get("target", 12.0)
    strength, weak, plain = 0.2, 0.0, math.inf
    for _ in range(30):
        if parameters:
            c["effects"] = [(kind, weaker(kind, parameters, strength, c["mission"]))]
        elif strength != 0.2:
            factor = math.sqrt(now / target)
            c["files"] = [dict(file, sigma=tuple(np.array(file["sigma"]) * factor) if isinstance(file["sigma"], tuple)
                               else file["sigma"] * factor) for file in c["files"]]
        now = simulate(c)["delta_chi2"]
        if 0.83 * target < now < 1.25 * target:
            return
        weak, plain = (max(weak, strength), plain) if now < target else (weak, min(plain, strength))
        strength *= min(5.0, max(0.1, math.sqrt(target / now))) if now > 0.0 else 5.0
        if not weak < strength < plain:
            strength = math.sqrt(weak * plain)
    raise RuntimeError(c["name"] + ": cannot be tuned")


# ---------------------------------------------------------------- simulation


def seed_of(*words):
    return zlib.crc32(" ".join(map(str, words)).encode())


def set_key(mission_, key, change):
    """Apply a function to a dotted key (detector.traps.NAME.density_per_px or detector.NAME); returns the new value."""
    parts = key.split(".")
    if parts[1] == "traps":
        place = next(s for s in mission_["detector"]["traps"] if s["name"] == parts[2])
    else:
        place = mission_[parts[0]]
    place[parts[-1]] = float("%.4g" % change(place[parts[-1]]))
    return place[parts[-1]]


def true_mission(c):
    """What the user leaves free is a little off in the mission file; returns the true mission, and true values."""
    true, values = copy.deepcopy(c["mission"]), {}
    rng = np.random.default_rng(seed_of("free", c.get("arrangement", c["name"])))
    for key in c["free"]:
        off = rng.uniform(-1.0, 1.0) * (0.1 if key.endswith("density_per_px") else 0.04)
        values[key] = set_key(true, key, lambda value: value * (1.0 + off))
    return true, values


def sigma_of(file, values):
    if isinstance(file["sigma"], tuple):
        sigma = np.hypot(file["sigma"][0], file["sigma"][1] * values)
    else:
        sigma = np.full(len(values), file["sigma"])
    return np.array([float("%.4g" % s) for s in sigma])


def moved(effects):
    """Effects with each of their parameters a little changed, one after the other; days of events stay."""
    for index, (kind, parameters) in enumerate(effects):
        for name, value in parameters.items():
            if isinstance(value, float) and name != "t_yr":
                yield effects[:index] + [(kind, dict(parameters, **{name: 1.03 * value}))] + effects[index + 1:]


def missed_chi2(c, true, values, sigmas, effects):
    """chi2 of a mission with these effects alone, free parameters and the effects' own adjusted (linear)."""
    def predicted(world):
        return np.concatenate([predict(world, file) / sigma for file, sigma in zip(c["files"], sigmas)])
    base = predicted(World(true, effects))
    missed = np.concatenate([value / sigma for value, sigma in zip(values, sigmas)]) - base
    others = [World(true, changed) for changed in moved(effects)]
    for key in c["free"]:
        changed = copy.deepcopy(true)
        set_key(changed, key, lambda value: 1.03 * value)
        others.append(World(changed, effects))
    if others:
        slopes = np.array([predicted(other) - base for other in others]).T
        missed = missed - slopes @ np.linalg.lstsq(slopes, missed, rcond=None)[0]
    return float("%.4g" % (missed @ missed))


def simulate(c):
    """True values without noise, their sigma, and how much the believed mission misses them by."""
    true, free = true_mission(c)
    world, values = World(true, c["effects"]), []
    for file in c["files"]:
        truth = predict(world, file)
        if c.get("change"):
            rows = [world.conditions(file["meta"], row) for row in file["rows"]]
            truth = np.array([c["change"](value, at) for value, at in zip(truth, rows)])
        values.append(truth)
    result = {"values": values, "sigmas": [sigma_of(file, truth) for file, truth in zip(c["files"], values)],
              "free": free, "delta_chi2": 0.0}
    if c["group"] not in ("complete", "unfit"):
        result["delta_chi2"] = missed_chi2(c, true, values, result["sigmas"], [])
    if c["group"] == "pair":
        result["delta_chi2_each"] = {
            kind: missed_chi2(c, true, values, result["sigmas"], [other for other in c["effects"] if other[0] != kind])
            for kind in c["kinds"]}
    return result


KNOWN = {}


def simulated(c):
    """Cases of one arrangement share everything but noise."""
    if "arrangement" not in c:
        return simulate(c)
    if c["arrangement"] not in KNOWN:
        KNOWN[c["arrangement"]] = simulate(c)
    return KNOWN[c["arrangement"]]


# ---------------------------------------------------------------- files


def toml_value(value):
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return value.isoformat() if isinstance(value, datetime.date) else repr(value)


def write_mission(mission_, path, free=(), effects=()):
    def lines_of(table):
        return ["%s = %s" % (key, toml_value(value)) for key, value in table.items() if key != "traps"] + [""]
    lines = []
    for section, content in mission_.items():
        if section == "galaxies":
            for galaxy in content:
                lines += ["[[galaxies]]"] + lines_of(galaxy)
            continue
        lines += ["[%s]" % section] + lines_of(content)
        for trap in content.get("traps", []):
            lines += ["[[%s.traps]]" % section] + lines_of(trap)
    if free:
        lines += ["[fit]", "free = " + toml_value(list(free)), ""]
    for kind, parameters in effects:
        lines += ["[effects.%s]" % kind] + lines_of(parameters)
        for trap in parameters.get("traps", []):
            lines += ["[[effects.%s.traps]]" % kind] + lines_of(trap)
    with open(path, "w") as out:
        out.write("\n".join(lines))


def write_measurements(file, values, sigmas, path):
    from astropy.table import Table
    columns = {name: [row[name] for row in file["rows"]] for name in file["rows"][0]}
    columns["value"] = [float("%.8g" % value) for value in values]
    columns["sigma"] = list(sigmas)
    Table(columns, meta=file["meta"]).write(path, format="ascii.ecsv", delimiter=",", overwrite=True)


def with_noise(c, file, values, sigmas, rng):
    """Noise, and what makes data unfit."""
    noisy = values + c.get("noise", 1.0) * sigmas * rng.standard_normal(len(values))
    if c.get("repeat"):
        copied = rng.permutation(len(noisy))[:len(noisy) // 2]      # a third of the file that results
        order = np.sort(np.concatenate([np.arange(len(noisy)), copied]))
        return dict(file, rows=[file["rows"][k] for k in order]), noisy[order], sigmas[order]
    if c.get("contradict"):
        again = values + 15.0 * sigmas + sigmas * rng.standard_normal(len(values))
        return dict(file, rows=file["rows"] * 2), np.concatenate([noisy, again]), np.tile(sigmas, 2)
    return file, noisy, sigmas


def parameters_of(c):
    merged = {}
    for kind, parameters in c["effects"]:
        if kind == "serial-traps":
            trap = parameters["traps"][0]
            parameters = dict(pixel_time_ms=parameters["pixel_time_ms"], transfers=parameters["transfers"],
                              density_per_px=trap["density_per_px"], release_ms=trap["release_ms"])
        if not kind.startswith("outside"):
            merged.update({k: float("%.6g" % v) if isinstance(v, float) else v for k, v in parameters.items()})
    return merged


def write_case(c, out, seed):
    if "tune" in c:
        tune(c)
    result = simulated(c)
    folder = os.path.join(out, c["name"])
    os.makedirs(folder, exist_ok=True)
    rng = np.random.default_rng([seed, seed_of(c["name"])])
    rows = 0
    for file, values, sigmas in zip(c["files"], result["values"], result["sigmas"]):
        file, noisy, sigmas = with_noise(c, file, values, sigmas, rng)
        write_measurements(file, noisy, sigmas, os.path.join(folder, file["name"]))
        rows += len(noisy)
    write_mission(c["mission"], os.path.join(folder, "mission.toml"), c["free"])
    if c["group"] != "unfit" and all(kind in c["kinds"] for kind, _ in c["effects"]) and not c.get("change"):
        write_mission(true_mission(c)[0], os.path.join(folder, "true.toml"), (), c["effects"])
    truth = {"case": c["name"], "verdict": c["verdict"], "effects": c["kinds"], "accept": c["accept"],
             "parameters": parameters_of(c), "files": [file["name"] for file in c["files"]], "note": c["note"]}
    if "covariates" in c:
        truth["covariates"] = c["covariates"]
    truth.update(group=c["group"], delta_chi2=result["delta_chi2"], free=result["free"])
    if "target" in c:
        truth["target"] = c["target"]
    if "delta_chi2_each" in result:
        truth["delta_chi2_each"] = result["delta_chi2_each"]
    with open(os.path.join(folder, "truth.json"), "w") as file:
        json.dump(truth, file, indent=1)
        file.write("\n")
    return rows, result["delta_chi2"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", help="folder to make; one folder in it for each case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", metavar="REGEX", help="cases whose name matches")
    parser.add_argument("--kind", action="append", choices=GROUPS, help="groups to make; all by default")
    arguments = parser.parse_args()
    start = time.time()
    print("%-56s %5s %11s %7s" % ("case", "rows", "delta chi2", "s"))
    for group in GROUPS:
        if arguments.kind and group not in arguments.kind:
            continue
        for c in globals()[group]():
            if not re.search(arguments.only, c["name"]):
                continue
            began = time.time()
            rows, delta_chi2 = write_case(c, arguments.out, arguments.seed)
            print("%-56s %5d %11.4g %7.1f" % (c["name"], rows, delta_chi2, time.time() - began), flush=True)
        # Other groups share little; memory is better free.
        PACKETS.clear()
        SERIAL.clear()
    print("%.0f s" % (time.time() - start), file=sys.stderr)


if __name__ == "__main__":
    main()
