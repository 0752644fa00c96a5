#!/usr/bin/env python3
"""Golden frames through arcticpy's own interface: writes arcticpy_api.npz into python/tests/data.

Made by   arcticpy 2.6 (add_cti, remove_cti, express = 0: every transfer is followed), numpy 1.26.4 (Python 3.11); ten seconds on
          one core.
Command   python tests/golden/arcticpy_api.py                  writes python/tests/data/arcticpy_api.npz
          python tests/golden/arcticpy_api.py --random 60      random frames through arcticpy and ctiplan.arctic, side by side: the
                                                               largest deviation of each as a fraction of the largest displacement
          python tests/golden/arcticpy_api.py --times          run times of both
          python tests/golden/arcticpy_api.py --accuracy 400   random frames through ctiplan.arctic at express 0 and 5, beside its
                                                               own result at 1e-8
          (these need numpy and ctiplan installed in this interpreter; arcticpy runs in the one named by ARCTICPY_PYTHON,
          or in this one)

What is trailed
    A noisy sky with sources, 50 x 7 pixels, with each setting in CASES alone or together with others. `CASES` is read by
    python/tests/test_arctic.py, so that both programs are given the same words. Nothing is pruned (prune_n_electrons = 0); the
    default loses electrons on flat columns (packets.py).

How good it is
    packets.py, clocked.py and effects.py compare arcticpy with second programs. arcticpy's TrapSlowCapture is right only where
    rounding lets it (effects.py, "Rounding"): on the noisy sky the results of one and the same physics, with the volume counted in
    other units, differ by up to 10 % of what moves. So the cases with it have a smooth frame, whose clouds never rise to twice the
    height of a former one. arcticpy's continuum is good for release times of a few transfers.
"""
import os
import pickle
import subprocess
import sys
import tempfile
import time
from types import SimpleNamespace

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
DATA = os.path.join(HERE, "..", "..", "python", "tests", "data", "arcticpy_api.npz")


# Public names of arcticpy 2.6 (`dir`), without its own modules, and those of the objects of its classes.
PUBLIC = {
    "CCD": "first_electron_fills fraction_of_traps_per_phase full_well_depths phases well_fill_powers well_notch_depths",
    "CCDPhase": "first_electron_fill full_well_depth well_fill_power well_notch_depth",
    "CTI_model_for_HST_ACS": "",
    "PixelBounce": "",
    "ROE": "dwell_times empty_traps_between_columns empty_traps_for_first_transfers force_release_away_from_readout overscan_start "
    "pixel_bounce_gamma pixel_bounce_kA pixel_bounce_kv pixel_bounce_omega prescan_offset use_integer_express_matrix",
    "ROEChargeInjection": "from_normal_roe dwell_times overscan_start prescan_offset",
    "ROETrapPumping": "",
    "ReadNoise": "",
    "TrapInstantCapture": "delta_ellipticity density fractional_volume_full_exposed fractional_volume_none_exposed "
    "poisson_density_from release_timescale",
    "TrapInstantCaptureContinuum": "density release_timescale release_timescale_sigma",
    "TrapSlowCapture": "capture_timescale density release_timescale",
    "TrapSlowCaptureContinuum": "capture_timescale density release_timescale release_timescale_sigma",
    "add_cti": "",
    "add_pixel_bounce": "",
    "print_array": "",
    "print_array_2D": "",
    "remove_cti": "",
    "remove_pixel_bounce": "",
}

# Density and release time of TrapInstantCapture, and arcticpy 2.6's delta_ellipticity.
DELTA_ELLIPTICITY = [
    (1.0, 1.0, 0.6159859911111484),
    (1.6, 7.7, 0.9650323588785311),
    (0.5, 0.1, 0.20501645198807686),
    (2.0, 30.0, 0.5907929272313567),
    (1.0, 100.0, 0.09281121163998082),
    (1.0, 1000.0, 0.03084199980318741),
]

# Pixels, seed, and the density of poisson_density_from of a density of 1.6.
POISSON_DENSITIES = [(80, 0, 1.625), (80, 1, 1.5625), (80, 2, 1.575), (1000, 0, 1.605), (1000, 1, 1.59), (1000, 2, 1.593)]


def sky(seed=7, shape=(50, 7), level=60.0):
    rng = np.random.default_rng(seed)
    frame = rng.poisson(level, shape).astype(float)
    for charge in np.geomspace(100.0, 20000.0, 9):
        frame[rng.integers(shape[0]), rng.integers(shape[1])] += np.round(charge)
    frame[20:24, 3:6] += 900.0
    return frame


def smooth():
    """A sky with a broad source, faint enough for arcticpy's TrapSlowCapture."""
    rows, columns = np.mgrid[:50, :7]
    return 60.0 + 25.0 * columns * np.exp(-(((rows - 20.0) / 5.0) ** 2))


def cases(arctic):
    """Name, function, frame and keywords of each case, with the classes of a module that has arcticpy's names."""
    a = arctic
    ccd = a.CCD(phases=[a.CCDPhase(84700.0, 0.0, 0.478, 0.0)], fraction_of_traps_per_phase=[1.0])
    empty, carried = a.ROE(empty_traps_for_first_transfers=True), a.ROE()
    acs = [a.TrapInstantCapture(0.6, 0.74), a.TrapInstantCapture(1.6, 7.7), a.TrapInstantCapture(1.3, 37.0)]
    two = [a.TrapInstantCapture(density=2.0, release_timescale=1.5), a.TrapInstantCapture(0.7, 12.0)]
    base = dict(parallel_ccd=ccd, parallel_roe=empty, parallel_traps=acs)
    default = dict(base, parallel_roe=carried)
    serial = dict(serial_ccd=a.CCD([a.CCDPhase(1e5, 0.0, 0.6)], [1.0]), serial_traps=two)
    noise = np.random.default_rng(3).normal(0.0, 4.0, (50, 7))

    def well(*values):
        return dict(base, parallel_ccd=a.CCD([a.CCDPhase(*values)], [1.0]))

    def roe(**words):
        return dict(base, parallel_roe=a.ROE(empty_traps_for_first_transfers=True, **words))

    def roe_carried(**words):
        return dict(base, parallel_roe=a.ROE(**words))

    def injected(**words):
        return dict(base, parallel_roe=a.ROEChargeInjection(**words))

    add = [
        ("empty", sky(), base),
        ("carried", sky(), default),
        ("defaults", sky() / 60.0, dict(parallel_ccd=a.CCD(), parallel_roe=a.ROE(), parallel_traps=[a.TrapInstantCapture()])),
        ("hst", sky(), dict(zip(("parallel_roe", "parallel_ccd", "parallel_traps"), a.CTI_model_for_HST_ACS(2457000.0)))),
        ("offset", sky(), roe(prescan_offset=300)),
        ("offset carried", sky(), roe_carried(prescan_offset=300)),
        ("window offset", sky(), dict(base, parallel_window_offset=100)),
        ("overscan", sky(), roe(overscan_start=41, prescan_offset=4)),
        ("overscan carried", sky(), roe_carried(overscan_start=41, prescan_offset=4)),
        ("columns joined", sky(), roe(empty_traps_between_columns=False)),
        ("columns joined carried", sky(), roe_carried(empty_traps_between_columns=False, prescan_offset=5)),
        ("overscan, window offset", sky(), dict(roe(overscan_start=41, prescan_offset=4), parallel_window_offset=9)),
        ("overscan carried, window offset", sky(), dict(roe_carried(overscan_start=41), parallel_window_offset=9)),
        ("columns joined, window", sky(), dict(roe(empty_traps_between_columns=False), parallel_window_start=15)),
        ("columns joined carried, window", sky(), dict(roe_carried(empty_traps_between_columns=False, prescan_offset=5),
                                                       parallel_window_start=15, parallel_window_stop=45)),
        ("columns joined, overscan", sky(), roe(empty_traps_between_columns=False, overscan_start=31)),
        ("columns joined carried, overscan", sky(), roe_carried(empty_traps_between_columns=False, overscan_start=31)),
        ("columns joined carried, overscan, window", sky(), dict(
            roe_carried(empty_traps_between_columns=False, overscan_start=31, prescan_offset=3), parallel_window_start=12)),
        ("injected", sky(), injected()),
        ("injected, offset", sky(), dict(injected(prescan_offset=7), parallel_window_offset=4)),
        ("injected, overscan", sky(), dict(injected(overscan_start=41, prescan_offset=4), parallel_window_offset=9)),
        ("injected, window", sky(), dict(injected(prescan_offset=3), parallel_window_start=15, parallel_window_stop=45)),
        ("injected, window, overscan", sky(), dict(injected(overscan_start=31), parallel_window_start=12)),
        ("injected, columns joined", sky(), injected(empty_traps_between_columns=False, prescan_offset=3)),
        ("injected, from normal", sky(), dict(base, parallel_roe=a.ROEChargeInjection.from_normal_roe(carried, 50))),
        ("injected, serial", sky(), dict(serial, serial_roe=a.ROEChargeInjection())),
        ("injected, surface", sky(), dict(injected(), parallel_traps=[a.TrapInstantCapture(30.0, 3.0, 0.05, 0.4), *two])),
        ("injected, notch", sky(), dict(injected(), parallel_ccd=a.CCD([a.CCDPhase(84700.0, 70.0, 0.7)], [1.0]))),
        ("injected, negative", sky(level=3.0) + noise, injected()),
        ("dwell", sky(), roe(dwell_times=[0.25])),
        ("fraction", sky(), dict(base, parallel_ccd=a.CCD([a.CCDPhase(84700.0, 0.0, 0.478)], [0.4]))),
        ("notch", sky(), well(84700.0, 70.0, 0.7)),
        ("power 1", sky(), well(2e4, 0.0, 1.0)),
        ("power 0.3", sky(), well(2e5, 0.0, 0.3)),
        ("first electron", sky(level=2.0), well(84700.0, 0.0, 0.6, 0.01)),
        ("above full well", sky(), well(3000.0, 0.0, 0.5)),
        ("ccd by words", sky(), dict(base, parallel_ccd=a.CCD(full_well_depth=5e4, well_fill_power=0.58))),
        ("surface", sky(), dict(base, parallel_traps=[a.TrapInstantCapture(30.0, 3.0, 0.05, 0.05), *two])),
        ("partly exposed", sky(), dict(base, parallel_traps=[a.TrapInstantCapture(30.0, 3.0, 0.05, 0.4), *two])),
        ("partly exposed carried", sky(), dict(default, parallel_traps=[a.TrapInstantCapture(30.0, 3.0, 0.0, 0.4)])),
        ("slow", smooth(), dict(base, parallel_traps=[a.TrapSlowCapture(2.0, 5.0, 0.4), a.TrapSlowCapture(0.5, 20.0, 2.0)])),
        ("slow carried", smooth(), dict(default, parallel_traps=[a.TrapSlowCapture(2.0, 5.0, 0.4)])),
        ("continuum", sky(), dict(base, parallel_traps=[a.TrapInstantCaptureContinuum(2.0, 3.0, 0.3), *two])),
        ("serial", sky(), dict(serial, serial_roe=empty)),
        ("serial carried", sky(), dict(serial, serial_roe=carried)),
        ("both", sky(), dict(base, **serial, serial_roe=empty)),
        ("both, windows", sky(), dict(base, **serial, serial_roe=empty, parallel_window_start=15, parallel_window_stop=45,
                                      serial_window_start=2, serial_window_stop=6)),
        ("window carried", sky(), dict(default, parallel_window_start=15)),
        ("negative", sky(level=3.0) + noise, base),
        ("negative not allowed", sky(level=3.0) + noise, dict(base, allow_negative_pixels=0)),
        ("negative not allowed, window", sky(level=3.0) + noise,
         dict(base, allow_negative_pixels=0, parallel_window_start=15, parallel_window_stop=40)),
        ("no charge", sky(level=0.0), base),
        ("no charge carried", sky(level=0.0), default),
    ]
    remove = [
        ("remove 1", sky(), dict(base, n_iterations=1)),
        ("remove 5", sky(), dict(base, n_iterations=5)),
        ("remove carried", sky(), dict(default, n_iterations=3)),
        ("remove both", sky() + noise, dict(base, **serial, serial_roe=carried, n_iterations=4)),
        ("remove negative", sky(level=3.0) + noise, dict(base, n_iterations=3)),
        ("remove negative 2", sky(level=3.0) + noise, dict(default, n_iterations=2)),
        ("remove negative not allowed", sky(level=3.0) + noise, dict(base, n_iterations=3, allow_negative_pixels=0)),
        ("remove negative not allowed, window", sky(level=3.0) + noise,
         dict(base, n_iterations=3, allow_negative_pixels=0, parallel_window_start=15)),
        ("remove injected", sky(), dict(injected(), n_iterations=3)),
        ("remove in windows", sky(), dict(base, n_iterations=2, parallel_window_start=10, serial_window_stop=4)),
    ]
    return [(name, a.add_cti, *rest) for name, *rest in add] + [(name, a.remove_cti, *rest) for name, *rest in remove]


UNPRUNED = dict(parallel_prune_n_electrons=0.0, serial_prune_n_electrons=0.0, verbosity=0)


def make():
    import arcticpy
    made = {}
    for name, function, frame, words in cases(arcticpy):
        made[name] = function(frame.copy(), **UNPRUNED, **words)
    made["acs dates"] = np.array([2452400.0, 2453919.5, 2453920.0, 2454967.5, 2454968.0, 2459000.5])
    models = [arcticpy.CTI_model_for_HST_ACS(date)[2] for date in made["acs dates"]]
    made["acs traps"] = np.array([[[trap.density, trap.release_timescale] for trap in traps] for traps in models])
    np.savez_compressed(DATA, **made)
    print("%d cases, %d bytes" % (len(made) - 2, os.path.getsize(DATA)))


def random_frame(arctic, number):
    """A random frame through a random setting, with the time that it took."""
    rng = np.random.default_rng([5, number])
    a = arctic
    rows, columns = int(rng.integers(20, 150)), int(rng.integers(3, 12))
    frame = rng.poisson([60.0, 0.0, 5.0, 200.0, 0.5, 1000.0][number % 6], (rows, columns)).astype(float)
    for _ in range(rows * columns // 60 + 1):
        row, column = rng.integers(rows), rng.integers(columns)
        frame[row:row + rng.integers(1, 4), column] += 10 ** rng.uniform(1.5, 4.5)
    if number % 4 == 1:
        frame += rng.normal(0.0, 4.0, frame.shape)
    notch, first = [0.0, 0.0, 50.0][number % 3], [0.0, 0.0, 0.02][number % 9 // 3] * (number % 4 != 1)
    ccd = a.CCD([a.CCDPhase(10 ** rng.uniform(4, 5.3), notch, rng.uniform(0.3, 1.0), first)], [1.0])
    number_of_traps = rng.integers(1, 4)
    traps = [[a.TrapInstantCapture(10 ** rng.uniform(-2, most), 10 ** rng.uniform(-0.5, 2)) for _ in range(number_of_traps)]
             for most in (1.0, 0.5)]
    empty = bool(number % 2)
    roe = a.ROE(prescan_offset=int(rng.integers(0, 300)) if number % 3 else 0, empty_traps_for_first_transfers=empty)
    words = dict(parallel_ccd=ccd, parallel_roe=roe, parallel_traps=traps[0])
    if number % 5 == 2:
        words.update(serial_ccd=a.CCD([a.CCDPhase(5e4, 0.0, 0.5)], [1.0]), serial_traps=traps[1],
                     serial_roe=a.ROE(empty_traps_for_first_transfers=empty))
    if number % 7 == 3 and first == 0.0:
        words.update(parallel_window_start=rows // 4, parallel_window_stop=rows // 2)
    if number % 6 in (4, 5):
        roe.overscan_start = int(rng.integers(rows // 2, rows + 1))
        words.update(parallel_window_offset=int(rng.integers(0, 30)))
    roe.empty_traps_between_columns = number % 8 not in (5, 6)
    if number % 11 == 7:
        words.update(parallel_roe=a.ROEChargeInjection.from_normal_roe(roe, 0))
    start = time.perf_counter()
    if number % 10 in (8, 9) and first == 0.0:
        result = a.remove_cti(frame, 3, **UNPRUNED, **words)
    else:
        result = a.add_cti(frame, **UNPRUNED, **words)
    return frame, result, time.perf_counter() - start, "empty" if empty else "carried"


def timed(arctic, number):
    """The run time on a sky of 1024 rows and 64 columns with sources, in both conventions and at express 0 and 5."""
    a = arctic
    frame = np.tile(sky(), (21, 10))[:1024, :64] + np.random.default_rng(1).normal(0.0, 3.0, (1024, 64))
    _, ccd, traps = a.CTI_model_for_HST_ACS(2459000.0)
    empty, express = number // 2 == 1, 5 * (number % 2)
    roe = a.ROE(empty_traps_for_first_transfers=empty)
    words = dict(parallel_ccd=ccd, parallel_roe=roe, parallel_traps=traps, parallel_express=express, **UNPRUNED)
    a.add_cti(frame[:20], **words)
    start = time.perf_counter()
    result = a.add_cti(frame, **words)
    return frame, result, time.perf_counter() - start, "%s, express %d" % ("empty" if empty else "carried", express)


def by_arcticpy(what, number):
    """What a function finds with arcticpy, in an interpreter that has it; None where that ends with an error of memory."""
    with tempfile.NamedTemporaryFile() as file:
        python = os.environ.get("ARCTICPY_PYTHON", sys.executable)
        command = [python, __file__, "--oracle", what, str(number), file.name]
        run = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
        return pickle.load(file) if run.returncode == 0 else None


def compare(what, count):
    from ctiplan import arctic
    worst = 0.0
    for number in range(count):
        found = by_arcticpy(what, number)
        if found is None:
            print("%3d arcticpy ended with an error of memory" % number)
            continue
        frame, theirs, their_s, kind = found
        _, ours, our_s, _ = globals()[what](arctic, number)
        moved, error = abs(theirs - frame).max(), abs(theirs - ours).max()
        deviation = error / moved if moved > 0.0 else error
        worst = max(worst, deviation)
        print("%3d %-20s %3d x %3d  moved %9.3g e-  deviation %.1e of that  %.4f s, arcticpy %.4f s"
              % (number, kind, *frame.shape, moved, deviation, our_s, their_s))
    print("largest deviation: %.1e of the largest displacement in the frame" % worst)


def at_express(arctic, express):
    """The module with another accuracy of `add_cti` and `remove_cti`."""
    def with_express(function):
        return lambda *given, **words: function(*given, parallel_express=express, serial_express=express, **words)
    names = {name: getattr(arctic, name) for name in arctic.__all__}
    names.update(add_cti=with_express(arctic.add_cti), remove_cti=with_express(arctic.remove_cti))
    return SimpleNamespace(**names)


def accuracy(count):
    from ctiplan import arctic
    for express in (0, 5):
        errors = []
        for number in range(count):
            frame, exact, _, _ = random_frame(at_express(arctic, 1e-8), number)
            _, found, _, _ = random_frame(at_express(arctic, express), number)
            moved = abs(exact - frame).max()
            errors.append(abs(found - exact).max() / moved if moved > 0.0 else 0.0)
        print("express %d: largest error %.1e of the largest displacement, 99 %% below %.1e"
              % (express, max(errors), np.quantile(errors, 0.99)))


if __name__ == "__main__":
    if "--oracle" in sys.argv:
        import arcticpy
        with open(sys.argv[4], "wb") as file:
            pickle.dump(globals()[sys.argv[2]](arcticpy, int(sys.argv[3])), file)
    elif "--random" in sys.argv:
        compare("random_frame", int(sys.argv[2]))
    elif "--accuracy" in sys.argv:
        accuracy(int(sys.argv[2]))
    elif "--times" in sys.argv:
        compare("timed", 4)
    else:
        make()
