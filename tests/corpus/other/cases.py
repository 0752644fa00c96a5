"""The cases: five detectors, what was measured with them, what is true of them that the mission file does not say.

A condition that is a list becomes a column, and a file has a row for every combination; any other condition stands in
the file's header. Errors are given in the proportions of SIGMA; all of a case are then multiplied by one number, so
that chi2 falls by `chi2_gain` when what is hidden is added to the mission (or by `sigma_factor`, where nothing is to be
found). That makes a case as easy or as hard as it is meant to be, without trying.
"""
import copy
import dataclasses
import datetime
import itertools
import math
from typing import Callable, Optional

import numpy as np

# ----------------------------------------------------------------------------------------------------- five detectors


def galaxy(name, sersic_index, half_light_px, flux_e, e1, weight_px):
    return {"name": name, "sersic_index": sersic_index, "half_light_px": half_light_px, "flux_e": flux_e, "e1": e1,
            "weight_px": weight_px}


def species(name, density_per_px, release_ms, energy_ev):
    return {"name": name, "density_per_px": density_per_px, "release_ms": release_ms, "energy_ev": energy_ev}


def mission(name, launch, model, dose_rate, well, temperatures_k, reference_dose, traps, line_time_ms, transfers,
            background_e):
    """A mission file. dose_rate in MeV/g per active year, well: (full well in e-, exponent), temperatures: (operating,
    that of the release times), reference_dose in MeV/g."""
    full_well_e, well_fill_power = well
    temperature_k, reference_k = temperatures_k
    return {
        "mission": {"name": name, "launch": datetime.date.fromisoformat(launch), "duration_yr": 10.0},
        "environment": {"model": model, "active_dose_rate_mev_g_yr": dose_rate,
                        "solar_maximum": [1989.9, 2000.3, 2014.3, 2024.8, 2035.8]},
        "detector": {"full_well_e": full_well_e, "notch_e": 0.0, "well_fill_power": well_fill_power,
                     "temperature_k": temperature_k, "reference_temperature_k": reference_k,
                     "reference_dose_mev_g": reference_dose, "traps": [species(*trap) for trap in traps]},
        "readout": {"line_time_ms": line_time_ms, "transfers": transfers},
        "sky": {"background_e": background_e},
        "psf": {"fwhm_px": 2.4, "moffat_beta": 3.0},
        "galaxies": [galaxy("small", 4.0, 0.7, 1800.0, 0.0, 4.2), galaxy("spiral", 1.0, 1.8, 4000.0, 0.1, 4.8)],
        "requirement": {"delta_e": 1.0e-3, "correction_factor": 10.0, "galaxy": "small"},
    }


SCANNER = mission("Drift scan with three species", "2012-05-15", "solar-cycle", 8.0e6, (190000.0, 0.55), (163.0, 163.0),
                  1.2e8, [("E1", 0.8, 0.9, 0.22), ("E2", 1.5, 14.0, 0.33), ("E3", 1.1, 210.0, 0.41)], 2.0, 1800, 30.0)
HOLES = mission("p-channel imager, slow lines", "2020-11-20", "solar-cycle", 1.4e7, (95000.0, 0.67), (140.0, 140.0),
                2.0e8, [("hole1", 0.9, 30.0, 0.24), ("hole2", 0.5, 900.0, 0.36)], 40.0, 1200, 15.0)
ORBITER = mission("Low orbit, warmer than its release times are quoted at", "2009-05-11", "constant", 3.0e7,
                  (68000.0, 0.46), (190.0, 180.0), 1.0e8,
                  [("a", 0.3, 2.0, 0.3), ("b", 0.8, 25.0, 0.37), ("c", 0.4, 160.0, 0.45)], 5.2, 1024, 12.0)
WARM = mission("Warm, large pixels, fast lines", "2024-09-01", "solar-cycle", 9.0e6, (260000.0, 0.72), (213.0, 213.0),
               5.0e7, [("fast", 1.2, 0.6, 0.3), ("slow", 2.2, 11.0, 0.42)], 1.0, 1400, 100.0)
SINGLE = mission("One species", "2016-03-10", "constant", 2.5e7, (80000.0, 0.5), (168.0, 168.0), 1.0e8,
                 [("only", 1.6, 18.0, 0.35)], 8.0, 900, 20.0)


def place_of(mission_, key):
    """(table, name) of a dotted key such as detector.traps.E1.density_per_px."""
    *path, name = key.split(".")
    table = mission_
    for part in path:
        table = next(entry for entry in table if entry["name"] == part) if isinstance(table, list) else table[part]
    return table, name


def value_of(mission_, key):
    table, name = place_of(mission_, key)
    return table[name]


def changed(mission_, values):
    """A mission with other values of some dotted keys."""
    other = copy.deepcopy(mission_)
    for key, value in values.items():
        table, name = place_of(other, key)
        table[name] = value
    return other


def launched(mission_, date, **environment):
    """A mission with another launch, and perhaps another model of the dose."""
    other = changed(mission_, {"mission.launch": datetime.date.fromisoformat(date)})
    other["environment"].update(environment)
    return other


# ------------------------------------------------------------------------------------------------------- measurements

# Errors in the units of the observable, before a case's factor.
SIGMA = {"trail": 2.0e-4, "packet_charge": 0.8, "eper": 1.5, "delta_e1": 2.0e-5, "delta_y": 2.0e-5,
         "delta_flux": 3.0e-5, "delta_size": 2.0e-5}

# Pixels behind a packet.
EVERY = [1, 2, 3, 4, 6, 9, 13, 18, 25, 35, 50]
SOME = [1, 2, 3, 5, 8, 13, 22, 40]
FAR = SOME + [80]
FEW = [1, 2, 4, 10, 30]


@dataclasses.dataclass
class File:
    """One file of measurements: `fixed` and `rows` hold conditions, `sigma` is (absolute, fraction of the value) to be
    added in quadrature, `random_columns` have a value drawn for each row."""
    observable: str
    fixed: dict
    rows: list
    sigma: tuple
    random_columns: dict = dataclasses.field(default_factory=dict)

    @property
    def name(self):
        return self.observable + ".ecsv"


def measured(observable, random_columns=None, sigma=None, repeats=1, **conditions):
    """A file with a row for every combination of the conditions that are lists, `repeats` times."""
    columns = [name for name, value in conditions.items() if isinstance(value, list)]
    fixed = {name: value for name, value in conditions.items() if name not in columns}
    rows = [dict(zip(columns, values)) for values in itertools.product(*(conditions[name] for name in columns))]
    return File(observable, fixed, rows * repeats, sigma or (SIGMA[observable], 0.0), random_columns or {})


def trail(**conditions):
    return measured("trail", **conditions)


def packets(**conditions):
    return measured("packet_charge", **conditions)


def edges(**conditions):
    return measured("eper", **conditions)


def shapes(*observables, **conditions):
    return [measured(observable, **conditions) for observable in observables]


def dose(until_yr, step_yr, fraction=0.02, absolute_mev_g=2.0e4):
    """The dose monitor, read at even times."""
    return measured("dose", sigma=(absolute_mev_g, fraction), t_yr=steps(step_yr, until_yr, step_yr))


def steps(first, last, step):
    return [round(first + step * k, 4) for k in range(int((last - first) / step + 1.0e-6) + 1)]


def numbers(first, last, step):
    return list(range(first, last + 1, step))


# ------------------------------------------------------------------------------------------------------ what a case is


@dataclasses.dataclass
class Case:
    """`hidden` effects are true and not in the mission file, `known` ones are true and in it."""
    name: str
    group: str
    mission: dict
    files: list
    hidden: list = dataclasses.field(default_factory=list)
    known: list = dataclasses.field(default_factory=list)
    free: list = dataclasses.field(default_factory=list)    # keys that the mission file lets fit
    believed: dict = dataclasses.field(default_factory=dict)  # key: factor by which the mission file is off
    chi2_gain: Optional[float] = None
    sigma_factor: float = 1.0
    # Outside the catalogue: effects that it does not have, conditions as they were (not as they are told), and what is
    # read where a value should be.
    beyond: list = dataclasses.field(default_factory=list)
    true_conditions: Optional[Callable] = None
    reading: Optional[Callable] = None
    covariates: list = dataclasses.field(default_factory=list)
    # What makes data unfit: errors quoted too large or too small by a factor, one row that is off by so many errors,
    # every row twice, second measurements that are off by so many errors.
    quoted_factor: float = 1.0
    outlier_sigma: float = 0.0
    copied: bool = False
    contradiction_sigma: float = 0.0
    note: str = ""

    @property
    def verdict(self):
        return {"complete": "complete", "strong": "missing", "pair": "missing", "outside": "unexplained",
                "ambiguous": "ambiguous", "unfit": "unfit"}[self.group]

    @property
    def true_effects(self):
        return self.known + self.hidden + self.beyond


def densities(*names):
    return [f"detector.traps.{name}.density_per_px" for name in names]


E1_DENSITY, E2_DENSITY, E3_DENSITY = densities("E1", "E2", "E3")
E2_RELEASE = "detector.traps.E2.release_ms"
ONLY_DENSITY, ONLY_RELEASE = "detector.traps.only.density_per_px", "detector.traps.only.release_ms"
HOLE1_DENSITY, HOLE2_DENSITY = densities("hole1", "hole2")
FAST_DENSITY, SLOW_DENSITY = densities("fast", "slow")
FILL_POWER = "detector.well_fill_power"


def flare(t_yr, dose_mev_g):
    return "solar-flare", {"t_yr": t_yr, "dose_mev_g": dose_mev_g}


def floor(rate_mev_g_yr):
    return "cosmic-ray-floor", {"rate_mev_g_yr": rate_mev_g_yr}


def dose_scale(factor):
    return "dose-scale", {"factor": factor}


def prelaunch(**densities_per_px):
    return "prelaunch-traps", densities_per_px


def annealing(time_yr):
    return "annealing", {"time_yr": time_yr}


def bakeout(t_yr, fraction):
    return "bakeout", {"t_yr": t_yr, "fraction": fraction}


def extra(density_per_px, release_ms, energy_ev=0.4, **name):
    return "extra-species", {**name, "density_per_px": density_per_px, "release_ms": release_ms, "energy_ev": energy_ev}


def continuum(sigma):
    return "release-continuum", {"sigma": sigma}


def capture(capture_ms):
    return "finite-capture", {"capture_ms": capture_ms}


def notch(notch_e):
    return "notch", {"notch_e": notch_e}


def well_fill(well_fill_power):
    return "well-fill", {"well_fill_power": well_fill_power}


def preflash(electrons):
    return "preflash", {"electrons": electrons}


def thermometer(kelvin):
    return "temperature-offset", {"kelvin": kelvin}


def bounce(fraction, length_px):
    return "signal-bounce", {"fraction": fraction, "length_px": length_px}


def serial(transfers, density_per_px, pixel_time_ms, release_ms):
    return "serial-traps", {"pixel_time_ms": pixel_time_ms, "transfers": transfers,
                            "traps": [species("serial", density_per_px, release_ms, 0.25)]}


SOLAR_CYCLE = ("solar-cycle", {})

# ---------------------------------------------------------------------------------------------------------- one effect


def strong(name, mission_, effect, files, chi2_gain, free=(), believed=None, known=()):
    return Case("strong-" + name, "strong", mission_, files, [effect], list(known), list(free), believed or {},
                chi2_gain)


def dose_effects():
    """Effects that change when the dose came, and which the dose monitor sees."""
    before_minimum = launched(ORBITER, "2006-06-01")
    yield strong("solar-cycle-monitored", before_minimum, SOLAR_CYCLE, [
        trail(t_yr=steps(1.0, 9.0, 1.0), trail_px=SOME, signal_e=1000.0, background_e=12.0, transfers=1024),
        dose(9.0, 0.5, 0.1, 3.0e6)], 800)
    yield strong("solar-cycle-packets", launched(SINGLE, "2014-09-01"), SOLAR_CYCLE, [
        packets(t_yr=steps(0.5, 9.5, 0.5), transfers=[300, 600, 900], signal_e=3000.0, background_e=20.0)], 1500)
    yield strong("solar-cycle-long", launched(SCANNER, "2003-02-01", model="constant"), SOLAR_CYCLE, [
        packets(t_yr=steps(0.5, 14.0, 0.5), transfers=[500, 1800], signal_e=2000.0, background_e=30.0)],
        700, [E2_DENSITY])

    yield strong("solar-flare-trails", SCANNER, flare(1.37, 3.0e6), [
        trail(t_yr=[0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0], trail_px=SOME, signal_e=2000.0, background_e=30.0,
              transfers=1800),
        dose(4.0, 0.1, 0.03, 8.0e4)], 1200, [E2_DENSITY], {E2_DENSITY: 1.03})
    yield strong("solar-flare-packets", WARM, flare(3.8, 9.0e6), [
        packets(t_yr=steps(0.5, 7.0, 0.5), signal_e=[500.0, 5000.0], background_e=100.0, transfers=1400),
        dose(7.0, 0.25, 0.05, 2.0e5)], 500)

    yield strong("floor-trails", launched(SCANNER, "2018-12-20"), floor(6.0e5), [
        trail(t_yr=[0.5, 1.0, 2.0, 3.0, 4.0, 6.0], trail_px=SOME, signal_e=2000.0, background_e=30.0, transfers=1800),
        dose(8.0, 0.5, 0.03, 2.0e5)], 900)
    short = changed(launched(HOLES, "2017-01-01"), {"readout.transfers": 700})
    yield strong("floor-shapes", short, floor(9.0e5), [
        *shapes("delta_e1", t_yr=steps(1.0, 8.0, 1.0), galaxy="small", transfers=700, background_e=15.0),
        dose(8.0, 0.25, 0.05, 4.0e5)], 250)
    yield strong("floor-packets", launched(SCANNER, "2018-02-01"), floor(5.0e5), [
        packets(t_yr=steps(0.25, 5.75, 0.5), signal_e=[400.0, 4000.0], background_e=30.0, transfers=1800),
        dose(6.0, 0.25, 0.04, 3.0e5)], 400)


def trap_effects():
    """Effects that change how many traps a dose leaves behind.

    At a single line time, fewer traps than foreseen look like slow capture, and more of them like a further species
    that is as quick as the one that shows most. Two of the dose scales are therefore measured at two line times.
    """
    yield strong("dose-scale-trails", SCANNER, dose_scale(1.45), [
        trail(t_yr=[0.5, 2.0, 4.0], signal_e=[200.0, 2000.0, 20000.0], background_e=[5.0, 100.0],
              trail_px=[1, 3, 8, 25], transfers=1800),
        dose(6.0, 0.5)], 3000)
    yield strong("dose-scale-packets", WARM, dose_scale(0.72), [
        packets(t_yr=[0.5, 1.5, 3.0, 5.0], signal_e=[100.0, 1000.0, 10000.0, 60000.0], background_e=[10.0, 300.0],
                line_time_ms=[0.5, 2.0], transfers=1400),
        dose(6.0, 0.5)], 2500)
    yield strong("dose-scale-laboratory", HOLES, dose_scale(1.6), [
        edges(dose_mev_g=[2.0e7, 1.0e8, 3.0e8], signal_e=[100.0, 1000.0, 10000.0], background_e=[0.0, 50.0],
              line_time_ms=[40.0, 400.0], trail_px=[1, 3, 8, 20], block_px=30, transfers=1200)], 2000)

    yield strong("prelaunch-trails", SCANNER, prelaunch(E1=0.01, E2=0.05, E3=0.03), [
        trail(t_yr=[0.05, 0.3, 1.0, 2.0, 3.0, 5.0], trail_px=EVERY, signal_e=2000.0, background_e=30.0, transfers=1800),
        dose(5.0, 0.25)], 1500)
    yield strong("prelaunch-packets", SINGLE, prelaunch(only=0.06), [
        packets(t_yr=[0.02, 0.2, 0.5, 1.0, 2.0, 4.0], transfers=[300, 900], signal_e=[500.0, 5000.0],
                background_e=20.0),
        dose(4.0, 0.25)], 600)
    yield strong("prelaunch-shapes", changed(SINGLE, {"readout.transfers": 600}), prelaunch(only=0.07), [
        *shapes("delta_e1", "delta_flux", t_yr=[0.05, 0.5, 1.0, 2.0, 3.0, 4.0], galaxy="small", transfers=600,
                background_e=20.0),
        dose(4.0, 0.25)], 500)

    yield strong("annealing-trails", ORBITER, annealing(5.0), [
        trail(t_yr=[0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0], trail_px=SOME, signal_e=1000.0, background_e=12.0,
              transfers=1024),
        packets(t_yr=steps(1.0, 8.0, 1.0), signal_e=1000.0, background_e=12.0, transfers=1024),
        dose(8.0, 0.5)], 2000)
    yield strong("annealing-edges", HOLES, annealing(2.5), [
        edges(t_yr=[0.5, 1.0, 2.0, 4.0, 6.0, 8.0], signal_e=[300.0, 6000.0], trail_px=[1, 2, 4, 10, 25, 50],
              block_px=60, background_e=15.0, transfers=1200),
        dose(8.0, 0.5)], 1200, [HOLE1_DENSITY], {HOLE1_DENSITY: 0.96})
    yield strong("annealing-quick", WARM, annealing(1.5), [
        trail(t_yr=steps(0.5, 8.0, 0.5), signal_e=[1000.0, 10000.0], trail_px=SOME, background_e=100.0, transfers=1400),
        packets(t_yr=steps(0.25, 8.0, 0.25), signal_e=3000.0, background_e=100.0, transfers=1400),
        dose(8.0, 0.5)], 2500)

    yield strong("bakeout-packets", SINGLE, bakeout(3.2, 0.35), [
        packets(t_yr=steps(0.25, 7.0, 0.25), transfers=[400, 900], signal_e=4000.0, background_e=20.0),
        dose(7.0, 0.5)], 1500)
    yield strong("bakeout-trails", SCANNER, bakeout(2.3, 0.2), [
        trail(t_yr=steps(0.5, 5.0, 0.5), signal_e=[700.0, 7000.0], trail_px=FEW, background_e=30.0, transfers=1800),
        dose(5.0, 0.25)], 700, [E1_DENSITY, E2_DENSITY, E3_DENSITY], {E2_DENSITY: 1.04})
    dates = [f"{year}-{month:02d}-10" for year in range(2012, 2017) for month in (6, 9, 12)]
    yield strong("bakeout-dates", SCANNER, bakeout(2.6, 0.3), [
        trail(date=dates, trail_px=SOME, signal_e=3000.0, background_e=30.0, transfers=1800), dose(5.0, 0.25)], 900)
    yield strong("bakeout-second", SINGLE, bakeout(4.6, 0.4), [
        packets(t_yr=steps(0.25, 7.0, 0.25), transfers=[400, 900], signal_e=4000.0, background_e=20.0),
        dose(7.0, 0.5)], 1500, known=[bakeout(1.6, 0.3)])


def release_effects():
    """Effects that change when traps release, or how fast they capture."""
    yield strong("extra-species-laboratory", SINGLE, extra(0.5, 150.0), [
        trail(transfers=[450, 900], trail_px=EVERY + [70, 95], dose_mev_g=1.0e8, background_e=20.0, signal_e=1500.0),
        packets(signal_e=[300.0, 1500.0, 9000.0], transfers=[200, 500, 900], dose_mev_g=1.0e8, background_e=20.0)],
        1000, [ONLY_DENSITY], {ONLY_DENSITY: 1.02})
    yield strong("extra-species-temperatures", WARM, extra(0.7, 60.0, 0.28), [
        trail(temperature_k=[193.0, 203.0, 213.0, 223.0], trail_px=EVERY + [80], t_yr=3.0, background_e=100.0,
              signal_e=3000.0, transfers=1400)], 2000)
    yield strong("extra-species-slow", ORBITER, extra(0.35, 900.0), [
        trail(signal_e=[500.0, 5000.0], trail_px=EVERY + [80, 99], t_yr=4.0, background_e=12.0, transfers=1024)],
        500, densities("a", "b", "c"), {"detector.traps.c.density_per_px": 1.05})
    yield strong("extra-species-fast", WARM, extra(0.6, 0.15, 0.22), [
        trail(line_time_ms=[0.1, 0.4, 1.5], trail_px=EVERY, t_yr=3.0, background_e=100.0, signal_e=3000.0,
              transfers=1400)], 700, [FAST_DENSITY, SLOW_DENSITY])

    yield strong("continuum-clocks", HOLES, continuum(0.6), [
        trail(line_time_ms=[8.0, 40.0, 200.0], trail_px=EVERY + [80], t_yr=4.0, background_e=15.0, signal_e=3000.0,
              transfers=1200)], 800)
    yield strong("continuum-temperatures", SINGLE, continuum(0.9), [
        trail(temperature_k=[158.0, 168.0, 180.0], signal_e=[800.0, 8000.0], trail_px=EVERY, dose_mev_g=1.5e8,
              background_e=20.0, transfers=900)], 2500, [ONLY_DENSITY, ONLY_RELEASE], {ONLY_RELEASE: 1.05})
    yield strong("continuum-three-species", SCANNER, continuum(0.8), [
        trail(line_time_ms=[0.3, 2.0, 15.0], trail_px=EVERY + [70, 95], t_yr=4.0, background_e=30.0, signal_e=5000.0,
              transfers=1800)], 900, [E1_DENSITY, E2_DENSITY, E3_DENSITY])

    yield strong("capture-packets", WARM, capture(0.8), [
        trail(line_time_ms=[0.5, 1.0, 4.0, 16.0], trail_px=SOME, t_yr=3.0, background_e=100.0, signal_e=3000.0,
              transfers=1400),
        packets(line_time_ms=[0.5, 1.0, 4.0, 16.0], signal_e=[1000.0, 10000.0], t_yr=3.0, background_e=100.0,
                transfers=1400)], 1500)
    yield strong("capture-trails", SINGLE, capture(6.0), [
        trail(line_time_ms=[2.0, 8.0, 30.0], signal_e=[500.0, 5000.0], trail_px=SOME, t_yr=3.0, background_e=20.0,
              transfers=900)], 800)
    yield strong("capture-three-species", SCANNER, capture(1.2), [
        trail(line_time_ms=[0.5, 2.0, 8.0, 30.0], trail_px=SOME, t_yr=3.0, background_e=30.0, signal_e=3000.0,
              transfers=1800)], 700, [E1_DENSITY, E2_DENSITY, E3_DENSITY], {E2_DENSITY: 1.04})

    yield strong("thermometer-warm", ORBITER, thermometer(3.0), [
        trail(temperature_k=[175.0, 185.0, 195.0], trail_px=EVERY, t_yr=4.0, background_e=12.0, signal_e=1500.0,
              transfers=1024)], 1200)
    yield strong("thermometer-cold", WARM, thermometer(-2.2), [
        trail(temperature_k=[205.0, 213.0, 221.0], signal_e=[500.0, 5000.0], trail_px=SOME, t_yr=3.0,
              background_e=100.0, transfers=1400)], 900, [FAST_DENSITY, SLOW_DENSITY], {SLOW_DENSITY: 1.03})
    yield strong("thermometer-free", SCANNER, thermometer(-3.0), [
        trail(temperature_k=[150.0, 163.0, 176.0], trail_px=EVERY, t_yr=3.0, background_e=30.0, signal_e=2000.0,
              transfers=1800)], 600, [E1_DENSITY, E2_DENSITY, E3_DENSITY, FILL_POWER])


def charge_effects():
    """Effects that change which traps a packet meets."""
    yield strong("notch-trails", SCANNER, notch(90.0), [
        trail(signal_e=[60.0, 150.0, 400.0, 1500.0, 8000.0], trail_px=SOME, t_yr=4.0, background_e=2.0,
              transfers=1800)],
        1000, [E1_DENSITY, E2_DENSITY, E3_DENSITY], {E1_DENSITY: 1.05})
    yield strong("notch-packets", HOLES, notch(200.0), [
        packets(signal_e=[100.0, 300.0, 800.0, 3000.0, 20000.0], background_e=[0.0, 50.0, 250.0], t_yr=5.0,
                transfers=1200)], 900)
    yield strong("notch-free", SINGLE, notch(150.0), [
        packets(signal_e=[80.0, 160.0, 250.0, 400.0, 800.0, 3000.0, 10000.0, 40000.0], t_yr=3.0, transfers=900,
                background_e=0.0),
        trail(signal_e=[250.0, 1000.0, 10000.0], trail_px=EVERY, t_yr=3.0, transfers=900, background_e=0.0)],
        800, [ONLY_DENSITY, FILL_POWER, ONLY_RELEASE], {FILL_POWER: 1.03})

    yield strong("well-fill-trails", SINGLE, well_fill(0.57), [
        trail(signal_e=[100.0, 1000.0, 10000.0, 50000.0], background_e=[5.0, 100.0], trail_px=[1, 2, 4, 8, 15],
              t_yr=3.0, transfers=900)], 2000, [ONLY_DENSITY], {ONLY_DENSITY: 0.97})
    yield strong("well-fill-packets", WARM, well_fill(0.68), [
        packets(t_yr=[1.0, 3.0, 5.0], signal_e=[100.0, 500.0, 2500.0, 12000.0, 60000.0], background_e=[10.0, 300.0],
                transfers=1400),
        dose(6.0, 0.5)], 1200)
    yield strong("well-fill-free", SCANNER, well_fill(0.62), [
        trail(signal_e=[100.0, 600.0, 4000.0, 25000.0], trail_px=EVERY, t_yr=3.0, background_e=30.0, transfers=1800)],
        600, [E1_DENSITY, E2_DENSITY, E3_DENSITY, E2_RELEASE], {E2_RELEASE: 1.03})

    yield strong("preflash-trails", SCANNER, preflash(25.0), [
        trail(signal_e=[150.0, 1000.0, 8000.0], background_e=[0.0, 10.0, 60.0, 300.0], trail_px=FEW, t_yr=3.0,
              transfers=1800)], 1500)
    yield strong("preflash-edges", HOLES, preflash(8.0), [
        edges(t_yr=[2.0, 5.0], signal_e=[200.0, 2000.0], background_e=[0.0, 20.0, 100.0], trail_px=[1, 3, 8, 20, 45],
              block_px=40, transfers=1200)], 600, [HOLE1_DENSITY, HOLE2_DENSITY])
    yield strong("preflash-packets", WARM, preflash(120.0), [
        packets(transfers=[400, 900, 1400], signal_e=[100.0, 1000.0, 10000.0],
                background_e=[0.0, 20.0, 100.0, 500.0, 2000.0], t_yr=3.0)], 900, [FAST_DENSITY, SLOW_DENSITY])


def register_effects():
    """Effects behind the columns: the amplifier and the serial register."""
    yield strong("bounce-trails", SCANNER, bounce(0.002, 1.6), [
        trail(transfers=[100, 600, 1800], signal_e=[500.0, 8000.0], trail_px=[1, 2, 3, 4, 6, 9, 15], t_yr=3.0,
              background_e=30.0)], 800)
    yield strong("bounce-negative", HOLES, bounce(-0.0012, 4.0), [
        edges(transfers=[60, 500, 1200], signal_e=[1000.0, 10000.0], trail_px=SOME, block_px=30, t_yr=4.0,
              background_e=15.0)], 1500)
    yield strong("bounce-shapes", changed(HOLES, {"readout.transfers": 700}), bounce(0.0015, 2.0),
                 shapes("delta_e1", "delta_y", "delta_size", transfers=[100, 300, 500, 700], galaxy="small", t_yr=4.0,
                        background_e=15.0), 400)

    yield strong("serial-packets", SINGLE, serial(600, 1.2, 0.01, 0.03), [
        packets(t_yr=[1.0, 3.0, 5.0], signal_e=[300.0, 3000.0, 20000.0], transfers=[50, 300, 900], background_e=20.0),
        dose(5.0, 0.5)], 1500)
    yield strong("serial-trails", WARM, serial(1500, 0.5, 0.0007, 0.004), [
        packets(t_yr=[1.0, 3.0, 5.0], signal_e=[300.0, 3000.0, 20000.0], transfers=[50, 500, 1400], background_e=100.0),
        trail(transfers=[500, 1400], trail_px=SOME, t_yr=3.0, signal_e=3000.0, background_e=100.0)], 900)
    yield strong("serial-shapes", changed(SINGLE, {"readout.transfers": 500}), serial(500, 1.5, 0.01, 0.025),
                 shapes("delta_e1", "delta_y", "delta_size", t_yr=[1.0, 2.0, 3.0, 4.0, 5.0], galaxy="small",
                        transfers=500, background_e=20.0), 600)


# --------------------------------------------------------------------------------------------------- several effects


def pair(name, mission_, effects, files, chi2_gain, free=()):
    return Case("pair-" + name, "pair", mission_, files, list(effects), free=list(free), chi2_gain=chi2_gain)


def pairs_with_dose():
    """Pairs of which at least one effect is a matter of when."""
    yield pair("prelaunch-bakeout", SINGLE, [prelaunch(only=0.08), bakeout(3.4, 0.45)], [
        packets(t_yr=[0.02] + steps(0.25, 6.0, 0.25), transfers=[400, 900], signal_e=4000.0, background_e=20.0),
        dose(6.0, 0.25)], 3000)
    yield pair("annealing-well-fill", ORBITER, [annealing(4.0), well_fill(0.55)], [
        trail(t_yr=[0.5, 1.0, 2.0, 4.0, 8.0], signal_e=[150.0, 1500.0, 15000.0], background_e=[0.0, 60.0],
              trail_px=[1, 2, 5, 12, 30], transfers=1024),
        dose(8.0, 0.5)], 4000)
    yield pair("flare-bounce", SCANNER, [flare(2.2, 6.0e6), bounce(0.002, 3.0)], [
        trail(t_yr=[0.25, 1.0, 2.0, 2.5, 3.0, 4.0], transfers=[150, 1800], trail_px=SOME, signal_e=3000.0,
              background_e=30.0),
        dose(4.0, 0.2, 0.03, 1.0e5)], 2500)
    yield pair("continuum-prelaunch", HOLES, [continuum(0.7), prelaunch(hole1=0.04, hole2=0.02)], [
        trail(t_yr=[0.05, 1.0, 3.0, 5.0], line_time_ms=[10.0, 40.0, 160.0], trail_px=EVERY, background_e=15.0,
              signal_e=3000.0, transfers=1200),
        dose(5.0, 0.5)], 4000)
    cyclic = launched(SINGLE, "2017-06-01", model="solar-cycle")
    yield pair("floor-extra-species", cyclic, [floor(4.0e6), extra(0.9, 120.0)], [
        trail(t_yr=[0.5, 1.5, 3.0, 4.0, 5.0, 6.0, 7.0], trail_px=EVERY + [70], background_e=20.0, signal_e=2000.0,
              transfers=900),
        dose(7.0, 0.25, 0.05, 4.0e5)], 3000)
    yield pair("annealing-flare", SCANNER, [annealing(4.0), flare(1.8, 8.0e6)], [
        trail(t_yr=[0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0], trail_px=SOME, background_e=30.0, transfers=1800,
              signal_e=3000.0),
        packets(t_yr=[0.5, 1.5, 2.0, 4.0, 6.0], signal_e=[1000.0, 10000.0], background_e=30.0, transfers=1800),
        dose(6.0, 0.2, 0.03, 1.0e5)], 3000)
    yield pair("bakeout-extra-species", SINGLE, [bakeout(2.7, 0.4), extra(0.6, 200.0)], [
        trail(t_yr=steps(0.5, 6.0, 0.5), trail_px=SOME + [70], background_e=20.0, signal_e=2000.0, transfers=900),
        dose(6.0, 0.5)], 2500)
    yield pair("serial-prelaunch", SINGLE, [serial(800, 0.8, 0.01, 0.03), prelaunch(only=0.06)], [
        packets(t_yr=[0.02, 0.5, 1.0, 2.0, 4.0], signal_e=[500.0, 5000.0], transfers=[50, 300, 900], background_e=20.0),
        trail(t_yr=[0.02, 1.0, 4.0], trail_px=SOME, transfers=900, background_e=20.0, signal_e=3000.0),
        dose(4.0, 0.25)], 2500)
    yield pair("solar-cycle-thermometer", launched(ORBITER, "2006-06-01"), [SOLAR_CYCLE, thermometer(3.5)], [
        trail(t_yr=steps(1.0, 9.0, 1.0), temperature_k=[170.0, 180.0, 190.0, 200.0], trail_px=SOME, signal_e=1000.0,
              background_e=12.0, transfers=1024),
        dose(9.0, 0.5, 0.1, 3.0e6)], 12000)


def pairs_with_dose_scale():
    """Traps per dose, and something else: since every trail grows with it, it hides much."""
    yield pair("bounce-dose-scale", SCANNER, [bounce(0.003, 2.0), dose_scale(1.3)], [
        trail(t_yr=[0.5, 2.0, 4.0], transfers=[200, 1800], signal_e=[300.0, 3000.0, 30000.0],
              trail_px=[1, 2, 3, 5, 10, 25]),
        dose(5.0, 0.5)], 4000)
    yield pair("dose-scale-preflash", SCANNER, [dose_scale(1.35), preflash(20.0)], [
        trail(t_yr=[1.0, 3.0], signal_e=[150.0, 1500.0, 15000.0], background_e=[0.0, 10.0, 60.0, 300.0], trail_px=FEW,
              transfers=1800),
        dose(4.0, 0.5)], 4000)
    # Colder, and more traps: neither alone does much to trails that release within a few pixels.
    for name, mission_, kelvin, factor, temperatures_k in (
            ("orbiter", ORBITER, -4.0, 1.3, [175.0, 185.0, 195.0]), ("warm", WARM, -3.0, 1.25, [205.0, 213.0, 221.0]),
            ("holes", HOLES, 3.0, 1.25, [132.0, 140.0, 148.0])):
        yield pair("thermometer-dose-scale-" + name, mission_, [thermometer(kelvin), dose_scale(factor)], [
            trail(t_yr=[1.0, 4.0], signal_e=[200.0, 20000.0], temperature_k=temperatures_k, trail_px=SOME,
                  transfers=mission_["readout"]["transfers"], background_e=mission_["sky"]["background_e"]),
            dose(5.0, 0.5)], 3000)
    yield pair("dose-scale-continuum", HOLES, [dose_scale(1.3), continuum(0.8)], [
        trail(t_yr=[1.0, 4.0], line_time_ms=[10.0, 40.0, 160.0], signal_e=[300.0, 20000.0], trail_px=SOME,
              transfers=1200, background_e=15.0),
        dose(5.0, 0.5)], 3000)
    yield pair("dose-scale-capture", WARM, [dose_scale(1.3), capture(0.5)], [
        trail(t_yr=[1.0, 4.0], line_time_ms=[0.5, 1.0, 8.0], signal_e=[300.0, 20000.0], trail_px=SOME, transfers=1400,
              background_e=100.0),
        dose(5.0, 0.5)], 3000)
    yield pair("annealing-dose-scale", SCANNER, [annealing(4.0), dose_scale(1.4)], [
        trail(t_yr=[0.3, 1.0, 2.0, 4.0, 6.0], signal_e=[300.0, 20000.0], background_e=[10.0, 200.0],
              trail_px=[1, 3, 10, 30], transfers=1800),
        dose(6.0, 0.5)], 3000)


def pairs_in_charge():
    """Pairs of which at least one effect is a matter of the packet's charge."""
    yield pair("thermometer-notch", WARM, [thermometer(4.0), notch(80.0)], [
        trail(temperature_k=[203.0, 213.0, 223.0], signal_e=[80.0, 200.0, 1000.0, 10000.0], trail_px=SOME, t_yr=3.0,
              background_e=2.0, transfers=1400)], 12000)
    yield pair("preflash-extra-species", SINGLE, [preflash(30.0), extra(0.8, 160.0)], [
        trail(signal_e=[200.0, 1500.0, 9000.0], background_e=[0.0, 20.0, 150.0], trail_px=EVERY + [70],
              dose_mev_g=1.0e8, transfers=900)], 3000)
    yield pair("notch-bounce", HOLES, [notch(120.0), bounce(0.004, 1.5)], [
        trail(transfers=[100, 1200], signal_e=[80.0, 200.0, 500.0, 2000.0, 20000.0], trail_px=SOME, background_e=1.0,
              t_yr=5.0)], 3000)
    yield pair("notch-well-fill", HOLES, [notch(150.0), well_fill(0.6)], [
        trail(signal_e=[100.0, 250.0, 1000.0, 6000.0, 40000.0], background_e=[0.0, 100.0], trail_px=[1, 2, 5, 12, 30],
              t_yr=4.0, transfers=1200)], 3000)
    yield pair("thermometer-preflash", ORBITER, [thermometer(-3.0), preflash(20.0)], [
        trail(background_e=[0.0, 20.0, 100.0], signal_e=[300.0, 5000.0], temperature_k=[175.0, 185.0, 195.0],
              trail_px=SOME, transfers=1024, t_yr=4.0)], 3000)


def pairs_in_release():
    """Pairs in which both effects change the shape of a trail."""
    yield pair("thermometer-extra-species-1", WARM, [thermometer(3.0), extra(0.8, 70.0)], [
        trail(temperature_k=[193.0, 203.0, 213.0, 223.0], line_time_ms=[0.5, 4.0], trail_px=EVERY + [80], t_yr=3.0,
              background_e=100.0, signal_e=3000.0, transfers=1400)], 4000)
    yield pair("thermometer-extra-species-2", SCANNER, [thermometer(-3.5), extra(0.9, 60.0)], [
        trail(temperature_k=[150.0, 163.0, 176.0], line_time_ms=[2.0, 8.0], trail_px=FAR, t_yr=3.0, background_e=30.0,
              signal_e=3000.0, transfers=1800)], 2500)
    yield pair("thermometer-extra-species-free", WARM, [thermometer(3.0), extra(0.8, 70.0)], [
        trail(temperature_k=[193.0, 203.0, 213.0, 223.0], line_time_ms=[0.5, 4.0], trail_px=FAR, t_yr=3.0,
              background_e=100.0, signal_e=3000.0, transfers=1400)], 2000, [FAST_DENSITY, SLOW_DENSITY])
    yield pair("capture-bounce", WARM, [capture(0.7), bounce(0.003, 2.0)], [
        trail(line_time_ms=[0.5, 1.0, 4.0, 16.0], transfers=[100, 1400], trail_px=SOME, t_yr=3.0, background_e=100.0,
              signal_e=3000.0)], 2500)
    yield pair("continuum-extra-species", SINGLE, [continuum(0.7), extra(0.9, 250.0)], [
        trail(line_time_ms=[2.0, 8.0, 32.0, 128.0], trail_px=FAR, t_yr=3.0, background_e=20.0, signal_e=3000.0,
              transfers=900)], 3000)
    yield pair("continuum-thermometer", HOLES, [continuum(0.7), thermometer(3.0)], [
        trail(temperature_k=[132.0, 140.0, 148.0], line_time_ms=[10.0, 40.0], trail_px=FAR, t_yr=3.0, background_e=15.0,
              signal_e=3000.0, transfers=1200)], 3000)
    yield pair("capture-extra-species", WARM, [capture(0.5), extra(1.0, 60.0)], [
        trail(line_time_ms=[0.25, 1.0, 4.0, 16.0], trail_px=FAR, t_yr=3.0, background_e=100.0, signal_e=3000.0,
              transfers=1400),
        packets(line_time_ms=[0.25, 0.5, 1.0, 2.0, 4.0, 16.0], t_yr=3.0, background_e=100.0, signal_e=3000.0,
                transfers=1400)], 4000)
    yield pair("continuum-bounce", SCANNER, [continuum(0.7), bounce(0.002, 3.0)], [
        trail(transfers=[100, 1800], line_time_ms=[0.5, 2.0, 8.0], trail_px=FAR, t_yr=3.0, background_e=30.0,
              signal_e=3000.0)], 3000)
    yield pair("thermometer-capture", SINGLE, [thermometer(4.0), capture(4.0)], [
        trail(temperature_k=[158.0, 168.0, 178.0], line_time_ms=[2.0, 8.0, 32.0], trail_px=FAR, t_yr=3.0,
              background_e=20.0, signal_e=3000.0, transfers=900)], 3500)
    yield pair("two-extra-species", SINGLE, [extra(0.7, 1.2, name="p"), extra(0.8, 300.0, name="q")], [
        trail(line_time_ms=[1.0, 8.0, 64.0], trail_px=FAR, t_yr=3.0, background_e=20.0, signal_e=3000.0,
              transfers=900)], 3000)
    yield pair("three-effects", SCANNER,
               [bounce(0.004, 1.5), prelaunch(E1=0.02, E2=0.06, E3=0.03), notch(100.0)], [
                   trail(t_yr=[0.05, 1.0, 3.0, 5.0], transfers=[100, 1800], signal_e=[150.0, 600.0, 5000.0],
                         trail_px=SOME, background_e=2.0),
                   dose(5.0, 0.5)], 6000)


# ------------------------------------------------------------------------------------------------------ nothing hidden


def complete(name, mission_, files, free=(), believed=None, known=(), sigma_factor=1.0):
    return Case("complete-" + name, "complete", mission_, files, known=list(known), free=list(free),
                believed=believed or {}, sigma_factor=sigma_factor)


def nothing_hidden():
    yield complete("scanner-signals", SCANNER, [
        trail(signal_e=[150.0, 1000.0, 8000.0], background_e=[0.0, 30.0, 300.0], trail_px=FEW, t_yr=3.0,
              transfers=1800)], [E1_DENSITY, E2_DENSITY, E3_DENSITY], {E1_DENSITY: 1.05, E3_DENSITY: 0.95})
    yield complete("scanner-notch", changed(SCANNER, {"detector.notch_e": 70.0}), [
        trail(signal_e=[60.0, 150.0, 400.0, 1500.0, 8000.0], trail_px=SOME, t_yr=4.0, background_e=2.0,
              transfers=1800)],
        ["detector.notch_e"], {"detector.notch_e": 1.08})
    yield complete("scanner-three-observables", SCANNER, [
        dose(6.0, 0.1, 0.03, 8.0e4),
        trail(t_yr=[0.5, 1.5, 3.0, 5.0], transfers=[100, 1800], trail_px=SOME, background_e=30.0, signal_e=3000.0),
        packets(t_yr=[0.5, 3.0, 5.0], signal_e=[300.0, 3000.0], transfers=[100, 900, 1800], background_e=30.0)],
        [E1_DENSITY, E2_DENSITY, E3_DENSITY, E2_RELEASE, FILL_POWER], {E2_RELEASE: 1.04, FILL_POWER: 0.98})
    yield complete("holes-edges", HOLES, [
        edges(t_yr=[1.0, 3.0, 6.0], signal_e=[200.0, 2000.0, 20000.0], trail_px=SOME, block_px=50, transfers=1200,
              background_e=15.0),
        dose(6.0, 0.5)], sigma_factor=0.5)
    yield complete("holes-shapes", changed(HOLES, {"readout.transfers": 700}),
                   shapes("delta_e1", "delta_y", "delta_size", "delta_flux", t_yr=[2.0, 4.0, 6.0, 8.0],
                          galaxy=["small", "spiral"], transfers=700, background_e=15.0))
    yield complete("holes-many-rows", HOLES, [
        trail(t_yr=[1.0, 2.0, 3.0, 4.0, 6.0], signal_e=[200.0, 2000.0, 20000.0], line_time_ms=[20.0, 80.0],
              trail_px=SOME, background_e=15.0, transfers=1200)],
        [HOLE1_DENSITY, HOLE2_DENSITY, "detector.traps.hole1.release_ms", "detector.traps.hole2.release_ms"],
        {"detector.traps.hole2.release_ms": 0.95})
    yield complete("orbiter-temperatures", ORBITER, [
        trail(temperature_k=[170.0, 180.0, 190.0, 200.0], trail_px=EVERY, t_yr=4.0, background_e=12.0, signal_e=1500.0,
              transfers=1024)], [*densities("a", "b", "c"), FILL_POWER], {"detector.traps.b.density_per_px": 0.93})
    aged = [annealing(5.0), prelaunch(b=0.05)]
    yield complete("orbiter-known-effects", ORBITER, [
        trail(t_yr=[0.1, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0], trail_px=SOME, signal_e=1000.0, background_e=12.0,
              transfers=1024),
        dose(8.0, 0.5)], known=aged)
    yield complete("orbiter-dates", ORBITER, [
        packets(date=["2009-12-01", "2011-02-11", "2013-07-30", "2016-01-01"], signal_e=[300.0, 3000.0],
                transfers=[200, 1024], background_e=12.0),
        dose(7.0, 1.0)], sigma_factor=4.0)
    yield complete("warm-packets", WARM, [
        packets(t_yr=[1.0, 3.0, 5.0], signal_e=[100.0, 1000.0, 10000.0, 60000.0], background_e=[10.0, 300.0],
                transfers=[300, 800, 1400]),
        dose(6.0, 0.25)], sigma_factor=1.5)
    yield complete("warm-clocks", WARM, [
        trail(line_time_ms=[0.5, 1.0, 4.0, 16.0], trail_px=SOME, t_yr=3.0, background_e=100.0, signal_e=3000.0,
              transfers=1400)], sigma_factor=0.3)
    yield complete("warm-known-bounce", WARM, [
        trail(transfers=[100, 1400], signal_e=[500.0, 8000.0], trail_px=EVERY, t_yr=3.0, background_e=100.0)],
        known=[bounce(0.003, 2.0)], sigma_factor=2.0)
    yield complete("warm-shapes", changed(WARM, {"readout.transfers": 500}), shapes(
        "delta_e1", t_yr=[1.0, 3.0, 5.0], transfers=[150, 300, 500], galaxy="small", background_e=100.0))
    yield complete("single-epochs", SINGLE, [
        packets(t_yr=steps(0.25, 7.0, 0.25), transfers=[400, 900], signal_e=4000.0, background_e=20.0),
        dose(7.0, 0.5)], [ONLY_DENSITY, ONLY_RELEASE], {ONLY_DENSITY: 1.06})
    yield complete("single-long-trail", SINGLE, [
        trail(trail_px=[*range(1, 11), *range(12, 23, 2), 25, 28, 30, 33, 36, *range(40, 71, 5), 80, 95],
              dose_mev_g=1.0e8, background_e=20.0, signal_e=1500.0, transfers=900)], sigma_factor=0.7)
    yield complete("single-laboratory", SINGLE, [
        edges(dose_mev_g=[3.0e7, 1.0e8], transfers=[450, 900], signal_e=[500.0, 30000.0], background_e=[0.0, 60.0],
              trail_px=SOME, block_px=100)], [ONLY_DENSITY, FILL_POWER], {FILL_POWER: 1.02})


# ---------------------------------------------------------------------------------------------- outside the catalogue


def outside(name, mission_, files, covariates, note, **more):
    return Case("outside-" + name, "outside", mission_, files, covariates=covariates, note=note, **more)


def columns_that_matter():
    """A covariate of which the catalogue knows nothing."""
    volts = [float(volt) for volt in np.arange(0.0, 9.0, 0.5)]
    yield outside("substrate-voltage", SCANNER, [
        trail(signal_e=[300.0, 1000.0, 3000.0, 10000.0, 30000.0], trail_px=EVERY, t_yr=3.0, background_e=30.0,
              transfers=1800, random_columns={"substrate_v": volts})],
        ["substrate_v"], "every trail plus 2.2e-4 per volt above 3 V",
        reading=lambda value, row: value + 2.2e-4 * (row["substrate_v"] - 3.0))
    focus_um = [float(focus) for focus in range(-40, 41, 4)]
    yield outside("focus", SINGLE, [
        packets(signal_e=[300.0, 1000.0, 3000.0, 10000.0], transfers=[100, 300, 500, 700, 900], t_yr=3.0,
                background_e=20.0, repeats=2, random_columns={"focus_um": focus_um})],
        ["focus_um"], "charges times 1 - 8e-7 focus^2: no correlation, a parabola",
        reading=lambda value, row: value * (1.0 - 8.0e-7 * row["focus_um"] ** 2))
    yield outside("amplifier", WARM, [
        packets(signal_e=[500.0, 3000.0, 10000.0], transfers=numbers(100, 1400, 100), t_yr=3.0, background_e=100.0,
                random_columns={"amplifier": ["left", "right"]})],
        ["amplifier"], "the left amplifier's gain is larger by 1.5e-3",
        reading=lambda value, row: value * (1.0015 if row["amplifier"] == "left" else 1.0))


def other_electronics():
    """Readings that are not what arrived."""
    yield outside("gain-swings", WARM, [
        packets(t_yr=steps(0.2, 6.0, 0.2), signal_e=[1000.0, 10000.0], transfers=[200, 1400], background_e=100.0)],
        ["t_yr"], "the gain swings by 4e-4 with a period of 1.7 yr", sigma_factor=2.0,
        reading=lambda value, row: value * (1.0 + 4.0e-4 * math.sin(2.0 * math.pi * row["t_yr"] / 1.7)))
    yield outside("gain-step", SCANNER, [
        packets(t_yr=steps(0.25, 6.0, 0.25), signal_e=[1000.0, 8000.0], transfers=[300, 1800], background_e=30.0)],
        ["t_yr"], "the gain is smaller by 5e-4 from 3.1 yr on",
        reading=lambda value, row: value * (0.9995 if row["t_yr"] > 3.1 else 1.0))
    yield outside("nonlinear-gain-faint", WARM, [
        packets(signal_e=[200.0, 1000.0, 5000.0, 20000.0], transfers=numbers(100, 1400, 100), t_yr=3.0,
                background_e=100.0)],
        ["signal_e"], "charge minus 3e-8 charge^2", sigma_factor=2.0,
        reading=lambda value, row: value * (1.0 - 3.0e-8 * value))
    yield outside("nonlinear-gain-bright", SINGLE, [
        packets(signal_e=[100.0, 500.0, 2500.0, 12000.0, 60000.0], transfers=numbers(100, 900, 100), t_yr=3.0,
                background_e=20.0)],
        ["signal_e"], "charge minus 1.5e-8 signal^2",
        reading=lambda value, row: value - 1.5e-8 * row["signal_e"] ** 2)
    yield outside("constant-offset", SINGLE, [
        packets(signal_e=[200.0, 1000.0, 5000.0, 20000.0], transfers=numbers(100, 900, 100), t_yr=3.0,
                background_e=20.0)],
        [], "every charge is read 3 e- too low: nothing leans on any condition",
        reading=lambda value, row: value - 3.0)


def other_traps():
    """Traps that the catalogue's effects do not make."""
    yield outside("trap-in-one-row", SINGLE, [
        packets(signal_e=[500.0, 3000.0, 20000.0], transfers=numbers(50, 900, 50), t_yr=3.0, background_e=0.0)],
        ["transfers"], "a single pixel traps 6 e- of every packet from beyond it",
        reading=lambda value, row: value - (6.0 if row["transfers"] > 520 else 0.0))
    yield outside("dose-power", HOLES, [
        trail(dose_mev_g=[1.0e7, 3.0e7, 6.0e7, 1.2e8, 2.4e8], signal_e=[500.0, 5000.0], trail_px=SOME,
              background_e=15.0, transfers=1200)],
        ["dose_mev_g"], "traps grow with dose to the power 1.4", sigma_factor=2.0,
        true_conditions=lambda row: {**row, "dose_mev_g": 2.0e8 * (row["dose_mev_g"] / 2.0e8) ** 1.4})
    yield outside("background-factor", SCANNER, [
        trail(signal_e=[150.0, 1000.0, 8000.0], background_e=[5.0, 20.0, 80.0, 300.0, 1000.0], trail_px=FEW, t_yr=3.0,
              transfers=1800)],
        ["background_e"], "the background is 1.8 times what is told", sigma_factor=0.3,
        true_conditions=lambda row: {**row, "background_e": 1.8 * row["background_e"]})
    one_species = ("bakeout", {"t_yr": 2.6, "fraction": 0.5, "species": "E2"})
    yield outside("bakeout-of-one-species", SCANNER, [
        trail(t_yr=steps(0.5, 5.0, 0.5), trail_px=EVERY, background_e=30.0, transfers=1800, signal_e=3000.0),
        dose(5.0, 0.5)],
        ["t_yr", "trail_px"], "half of one species of three disappears at 2.6 yr", sigma_factor=0.4,
        beyond=[one_species])
    yield outside("trails-by-temperature", SINGLE, [
        trail(temperature_k=[150.0, 160.0, 170.0, 180.0], signal_e=[500.0, 5000.0], trail_px=SOME, background_e=20.0,
              t_yr=3.0, transfers=900)],
        ["temperature_k"], "every trail times 1 + 0.02 (T - 168 K)",
        reading=lambda value, row: value * (1.0 + 0.02 * (row["temperature_k"] - 168.0)))


# --------------------------------------------------------------------------------------------- ambiguous and unfit data


def ambiguous(name, mission_, effect, files, chi2_gain, note):
    return Case("ambiguous-" + name, "ambiguous", mission_, files, [effect], chi2_gain=chi2_gain, note=note)


def data_that_cannot_tell():
    yield ambiguous("dose-scale", SCANNER, dose_scale(1.3), [
        trail(trail_px=EVERY, t_yr=3.0, background_e=30.0, signal_e=2000.0, transfers=1800)], 400,
        "one epoch and no dose monitor: as well more dose, from whatever")
    yield ambiguous("floor", ORBITER, floor(4.0e6), [
        trail(trail_px=SOME, t_yr=3.0, background_e=12.0, signal_e=1000.0, transfers=1024)], 400,
        "one epoch and no dose monitor: as well a flare, or more traps for the dose")
    yield ambiguous("prelaunch-trails", SINGLE, prelaunch(only=0.12), [
        trail(trail_px=SOME, t_yr=2.0, background_e=20.0, signal_e=2000.0, transfers=900)], 400,
        "one epoch and one species: as well more traps for the dose")
    yield ambiguous("prelaunch-packets", HOLES, prelaunch(hole1=0.05), [
        packets(transfers=numbers(100, 1200, 100), t_yr=2.0, background_e=15.0, signal_e=3000.0)], 400,
        "one epoch, one signal, no trails: as well anything that traps")
    yield ambiguous("bounce-of-one-pixel", SINGLE, bounce(0.005, 0.3), [
        trail(trail_px=EVERY, t_yr=3.0, background_e=20.0, signal_e=2000.0, transfers=900)], 250,
        "one signal and one distance: as well a species that releases within a pixel")


def unfit(name, mission_, files, note, free=(), **more):
    return Case("unfit-" + name, "unfit", mission_, files, free=list(free), note=note, **more)


def data_without_a_verdict():
    two_signals = trail(signal_e=[300.0, 3000.0], trail_px=EVERY, t_yr=3.0, background_e=30.0, transfers=1800)
    yield unfit("sigma-too-large-trails", SCANNER, [two_signals], "errors are quoted 12 times too large",
                quoted_factor=12.0)
    yield unfit("sigma-too-large-packets", WARM, [
        packets(signal_e=[300.0, 3000.0], transfers=numbers(100, 1400, 100), t_yr=3.0, background_e=100.0)],
        "errors are quoted 8 times too large", quoted_factor=8.0)
    yield unfit("sigma-too-small", SCANNER, [
        trail(signal_e=[300.0, 1000.0, 3000.0, 10000.0], trail_px=EVERY, t_yr=3.0, background_e=30.0, transfers=1800)],
        "errors are quoted 4 times too small", quoted_factor=0.25)
    yield unfit("copied-rows", WARM, [
        packets(signal_e=[300.0, 3000.0, 10000.0], transfers=[200, 500, 800, 1100, 1400], t_yr=3.0,
                background_e=100.0)],
        "every row stands twice", copied=True)
    yield unfit("contradiction", SINGLE, [
        trail(signal_e=[500.0, 5000.0], trail_px=EVERY, t_yr=3.0, background_e=20.0, transfers=900, repeats=2)],
        "rows under the same conditions are eight errors apart", contradiction_sigma=8.0)
    yield unfit("one-wrong-row", HOLES, [
        trail(t_yr=[1.0, 2.0, 4.0], signal_e=[200.0, 2000.0, 20000.0], trail_px=EVERY, background_e=15.0,
              transfers=1200)],
        "one row of 99 is off by 14 errors", outlier_sigma=14.0)
    yield unfit("three-rows", SCANNER, [
        trail(trail_px=[1, 3, 8], t_yr=3.0, background_e=30.0, transfers=1800, signal_e=3000.0)],
        "three rows, three free parameters", [E1_DENSITY, E2_DENSITY, E3_DENSITY])


def all_cases():
    for group in (dose_effects, trap_effects, release_effects, charge_effects, register_effects, pairs_with_dose,
                  pairs_with_dose_scale, pairs_in_charge, pairs_in_release, nothing_hidden, columns_that_matter,
                  other_electronics, other_traps, data_that_cannot_tell, data_without_a_verdict):
        yield from group()
