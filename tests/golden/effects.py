#!/usr/bin/env python3
"""Golden columns and changes of shape with the effects on transfer itself: writes effects.json beside this file.

Made by   arcticpy 2.6 (public add_cti, express = 0: every transfer is followed), GalSim 2.8.5, numpy 1.26.4
          (Python 3.11); seven minutes on one core. effects.json is rewritten after every case.
Command   python tests/golden/effects.py            writes effects.json
          python tests/golden/effects.py --check    second programs, arcticpy's own continuum, its oddities (20 min)

What is in it
    `cases`: 29 lone packets and 6 flat blocks, trailed and stored as in packets.py. `shapes`: 6 changes of shape of the
    galaxy of shapes.json's first case, trailed and stored as in shapes.py. The detectors are those of packets.py; notch
    and exponent are those in `detector`. Each trap has besides
        capture_transfers   time constant of capture tau_c, in units of one transfer; null: capture at once
        release_sigma       standard deviation of the natural logarithm of the release time, whose median is
                            release_transfers; null: one release time
    Effects: finite capture; release continuum; both; notch of 60 e- (over a background of 2 e- and under one of 100 e-);
    exponents 0.3, 0.8, 1.0; several at once. Settings as in packets.py (empty start, no pruning).
    With background 0 the empty rows in front of a packet are left out (prescan_offset instead; the same bits).

Release continuum
    A species of density rho is trailed as 41 (sigma to 0.6) or 61 species tau * exp(sigma s), s evenly spaced in -8.5
    .. 8.5, densities in proportion to exp(-s^2/2): that sum is right to 1e-11 e- (--check; at sigma 1.2, 31 are good to
    4e-6 e- and 21 to 4e-4 e- where the trail's first pixel has 2.5 e-). Traps are arcticpy's TrapInstantCapture or TrapSlowCapture.
    arcticpy's TrapInstantCaptureContinuum(release_timescale, release_timescale_sigma) means the same: the median, and
    the standard deviation of the natural logarithm. Its tables, however, serve short times only. With one transfer as the unit of
    time (dwell 1.0) the filled fraction after the first transfer is too low by 2e-8 (release 10, sigma 0.2), 0.02 (release 10,
    sigma 1.2), 0.02 to 0.1 (release 40) and 0.3 (release 200), which puts 42 % too much in the first pixel behind a packet of
    p-channel. With dwell 0.001 and times in proportion it is good to 5e-7 of the filled fraction, and then agrees with what is
    stored here to 7e-5 e- and 2e-6 of the trail's first pixel, packets to 1e-9 e-; except for single slips of its
    tables: 1e-3 e- in one row of the shape continuum-0.6, where dwell 0.01 and 0.0001 agree to 3e-7 e-.
    TrapSlowCaptureContinuum is not used: it behaves as if one filled fraction per level served all release times, though
    capture that takes time leaves those with different fractions. With dwell 0.001 the trail is wrong by 0.03 % (capture 0.03, sigma 1.2),
    1 % (0.3, 0.6), 2 % (3, 0.2), nearly half (3, 1.2, no case here); with dwell 1.0 the packet too.

Finite capture: two sets of values
    TrapSlowCapture has the differential equation of the contract inside the cloud (the filled fraction goes to
    tau/(tau + tau_c) with rate 1/tau + 1/tau_c during one line time) and release alone above it, and the cloud's height
    is that of the charge on arrival. But then it looks again: what was released above the cloud joins the charge on arrival
    (what the cloud itself gained or lost does not), and where that makes the cloud higher, the traps between the old and the
    new height, having released for one line time, also have one line time of capture. With that rule the second program
    (`contract`, law="arcticpy") gives arcticpy's columns to 5e-13 e-. The contract has no second look. So finite-capture cases
    hold arcticpy's values in the usual fields, and in `contract` the same fields by the second program without the second look.
    They differ only where a packet follows a higher one:
        packets, blocks' last rows    2.5e-7 e- or less; none without background
        trails                        6e-4 or less of any pixel's excess over the background's pixel, 1.5e-2 e- or less
        delta_*                       4e-5 of themselves or less
    The contract's law does not turn into its own instant capture (release first, then the cloud's height) as tau_c goes to 0:
    after 100 transfers of 1000 e- on p-channel, 0.0022 e- too many in the first pixel of a trail of 3.5 e- (6e-4), 0.0006 too
    few in the second; arcticpy's comes within 6e-5 e-.

Where arcticpy goes wrong with finite capture (nothing of this is in the stored values)
    Rounding. Where a cloud rises to more than twice the height of a former one, the sum of a level's volumes may come out
    one bit above the cloud, and the traps between the old and the new cloud then capture nothing in that transfer (4 % of
    pairs of packets, 5.69 e- before 6 to 999 e-; up to 8 e- in a block). Which transfers is a matter of the last bit. So
    columns are made in several units of volume (full well times u, density times u^power: the same physics, other
    roundings) until two agree to 1e-9 e-. Of what is stored here it strikes 1 unit of 30 (packet of 200 e- of hst-like) and
    1 or 2 of 10 (two of the blocks), never the two that agree (second program).
    Below the notch. With a notch above 0, a packet that is not lifted above it gets nothing of what the traps release, though they
    do lose it: that charge vanishes. So there is no case here with finite capture and a background below the notch; by the
    contract's law such packets receive it.
    Too few electrons: where the cloud's traps would capture more than the packet has (below 1e-5 e- for these
    densities at power 0.5), they capture what is there and the packet is left empty. No stored case comes to that (`contract` refuses it).

How good it is, and the tolerance to ask for
    --check: all instant-capture columns agree with packets.py's second program to 7e-11 e-, finite-capture columns with
    the one here to 5e-13 e-, shapes' central columns to 1e-12 e-; deltas are as good as those of shapes.json. A consumer that follows every
    transfer with exact levels should ask for 1e-7 relative + 1e-6 e- of the values without capture and of `contract`
    with it, if it sums over release times as above (20 Gauss-Hermite nodes are good to 1e-8 of a trail's first pixel at
    sigma 0.6, to 2e-5 at 1.2), and compare with arcticpy's finite-capture
    values to 1e-3 of a pixel's excess over the background's + 1e-5 e-; of deltas 1e-3 relative + 1e-6, as for shapes.json.
"""
import sys

import numpy as np

from galaxies import digits, half_width, write_json
from packets import BEHIND_STORED, DETECTORS, column, second_program
from shapes import DELTAS, ONE, POSITIONS, case, deltas, picture, rounded, unpack

MADE_BY = "arcticpy 2.6 add_cti (express 0), GalSim 2.8.5, numpy 1.26.4: python tests/golden/effects.py"

# detector, notch or None, power or None, capture or None, sigma or None, background, signal, transfers, block
CASES = [
    # finite capture
    ("p-channel", None, None, 0.03, None, 0.0, 1000.0, 1650, 1),
    ("p-channel", None, None, 0.3, None, 0.0, 1000.0, 1650, 1),
    ("p-channel", None, None, 3.0, None, 0.0, 1000.0, 1650, 1),
    ("p-channel", None, None, 0.3, None, 2.0, 5000.0, 100, 1),
    ("p-channel", None, None, 0.3, None, 100.0, 1000.0, 538, 1),
    ("hst-like", None, None, 0.03, None, 0.0, 5000.0, 538, 1),
    ("hst-like", None, None, 0.3, None, 2.0, 200.0, 100, 1),
    ("hst-like", None, None, 3.0, None, 100.0, 200.0, 538, 1),
    # release continuum
    ("p-channel", None, None, None, 0.2, 0.0, 1000.0, 1650, 1),
    ("p-channel", None, None, None, 0.6, 2.0, 1000.0, 538, 1),
    ("p-channel", None, None, None, 1.2, 100.0, 1000.0, 1650, 1),
    ("hst-like", None, None, None, 0.2, 2.0, 200.0, 538, 1),
    ("hst-like", None, None, None, 0.6, 0.0, 200.0, 100, 1),
    ("hst-like", None, None, None, 1.2, 100.0, 5000.0, 538, 1),
    # both
    ("p-channel", None, None, 0.3, 0.6, 0.0, 1000.0, 538, 1),
    ("hst-like", None, None, 0.03, 1.2, 0.0, 5000.0, 100, 1),
    ("p-channel", None, None, 3.0, 0.2, 100.0, 250.0, 100, 1),
    # notch, above the background
    ("p-channel", 60.0, None, None, None, 2.0, 100.0, 1650, 1),
    ("p-channel", 60.0, None, None, None, 2.0, 1000.0, 538, 1),
    ("hst-like", 60.0, None, None, None, 2.0, 300.0, 100, 1),
    ("hst-like", 60.0, None, None, None, 2.0, 5000.0, 1650, 1),
    # other exponents
    ("p-channel", None, 0.3, None, None, 2.0, 1000.0, 538, 1),
    ("hst-like", None, 0.3, None, None, 100.0, 200.0, 538, 1),
    ("p-channel", None, 0.8, None, None, 2.0, 1000.0, 1650, 1),
    ("hst-like", None, 0.8, None, None, 0.0, 200.0, 100, 1),
    ("hst-like", None, 1.0, None, None, 100.0, 5000.0, 1650, 1),
    # several at once
    ("p-channel", 60.0, 0.8, 0.3, None, 100.0, 1000.0, 538, 1),
    ("hst-like", 60.0, 0.3, 0.03, None, 100.0, 5000.0, 100, 1),
    ("hst-like", 60.0, 0.8, None, 0.6, 2.0, 300.0, 538, 1),
    # flat blocks
    ("p-channel", None, None, 0.3, None, 50.0, 1000.0, 538, 500),
    ("hst-like", None, None, 0.03, None, 100.0, 5000.0, 538, 500),
    ("p-channel", None, None, None, 0.6, 50.0, 1000.0, 538, 500),
    ("p-channel", 60.0, None, None, None, 2.0, 1000.0, 538, 500),
    ("hst-like", None, 0.8, None, None, 100.0, 300.0, 538, 500),
    ("p-channel", 60.0, 0.3, 0.3, None, 100.0, 1000.0, 538, 500),
]

# name, notch, power, capture, sigma, transfers, background: the galaxy, PSF and traps of shapes.json's first case
SHAPES = [
    ("capture-0.03", None, None, 0.03, None, 538, 120.0),
    ("capture-3", None, None, 3.0, None, 538, 120.0),
    ("continuum-0.6", None, None, None, 0.6, 1650, 120.0),
    ("notch-60", 60.0, None, None, None, 1650, 2.0),
    ("power-0.8", None, 0.8, None, None, 100, 120.0),
    ("together", 60.0, 0.3, 0.3, None, 538, 120.0),
]

REACH = 8.5                 # standard deviations on either side that release times are spread over


def spread(traps, capture, sigma, nodes=None):
    """(density, release) of a detector -> (density, release, capture) of what is trailed."""
    if sigma is None:
        return [(density, release, capture) for density, release in traps]
    x = np.linspace(-REACH, REACH, nodes or (41 if sigma <= 0.6 else 61))
    weight = np.exp(-0.5 * x * x)
    weight /= weight.sum()
    return [(density * w, release * np.exp(sigma * s), capture) for density, release in traps
            for w, s in zip(weight, x)]


def add_cti(image, detector, species, prescan_offset=0, line_time=1.0):
    import arcticpy
    full_well, notch, power = detector
    ccd = arcticpy.CCD(phases=[arcticpy.CCDPhase(full_well_depth=full_well, well_notch_depth=notch,
                                                 well_fill_power=power)], fraction_of_traps_per_phase=[1.0])
    roe = arcticpy.ROE(dwell_times=[line_time], prescan_offset=prescan_offset, empty_traps_between_columns=True,
                       empty_traps_for_first_transfers=True)
    return arcticpy.add_cti(np.array(image, dtype=float), parallel_ccd=ccd, parallel_roe=roe, parallel_traps=species,
                            parallel_express=0, parallel_prune_n_electrons=0, verbosity=0)


def in_units(image, detector, traps, prescan_offset, unit):
    """arcticpy on a pixel whose volume is counted in other units: the same physics, other roundings."""
    import arcticpy
    full_well, notch, power = detector
    density = unit ** power
    species = [arcticpy.TrapInstantCapture(density=rho * density, release_timescale=release) if capture is None else
               arcticpy.TrapSlowCapture(density=rho * density, release_timescale=release, capture_timescale=capture)
               for rho, release, capture in traps]
    return add_cti(image, (notch + (full_well - notch) * unit, notch, power), species, prescan_offset)


def trail(image, detector, traps, prescan_offset=0):
    """Trail every column of image[row][column]; with finite capture, until two units give the same column."""
    image = np.array(image, dtype=float)
    if all(capture is None for _, _, capture in traps):
        return in_units(image, detector, traps, prescan_offset, 1.0)
    result, waiting, seen = np.empty_like(image), np.arange(image.shape[1]), []
    for k in range(40):
        seen.append(np.full_like(image, np.nan))
        seen[-1][:, waiting] = in_units(image[:, waiting], detector, traps, prescan_offset, 1.0723 ** k)
        for before in seen[:-1]:
            with np.errstate(invalid="ignore"):
                same = np.abs(before - seen[-1]).max(axis=0) < 1e-9
            result[:, same] = before[:, same]
            waiting = waiting[~same[waiting]]
        if len(waiting) == 0:
            return result
    raise RuntimeError("no two units agree")


def contract(image, detector, traps, prescan_offset=0, law="contract"):
    """Finite capture by its description alone, with exact trap levels: every column of image[row][column].

    Traps are uniform in 0 < h < 1. That range is kept in steps lo .. hi (in no order), with the filled fraction of each
    species in each. law="arcticpy" adds what arcticpy does besides (docstring above).
    """
    full_well, notch, power = detector
    density, release, capture = np.array(traps).T
    keep_out, keep_in = np.exp(-1.0 / release), np.exp(-1.0 / release - 1.0 / capture)
    settled = release / (release + capture)
    charge = np.array(image, dtype=float).T.copy()
    columns, rows = charge.shape
    size = (2 if law == "arcticpy" else 1) * rows + 2
    every = np.arange(columns)

    def height(n):
        return np.clip((n - notch) / (full_well - notch), 0.0, 1.0) ** power

    for pixel in range(rows - 1 + prescan_offset, -1, -1):
        lo, hi = np.zeros((columns, size)), np.zeros((columns, size))
        fill = np.zeros((columns, size, len(traps)))
        hi[:, 0] = 1.0
        used = 1

        def cut(h):
            """A border at h in every column; returns which steps are below it."""
            nonlocal used
            low, high = lo[:, :used], hi[:, :used]
            within = (low < h[:, None]) & (h[:, None] < high)
            which = within.argmax(axis=1)
            found = within[every, which]
            lo[:, used] = h
            hi[:, used] = np.where(found, high[every, which], h)
            fill[:, used] = fill[every, which]
            high[every[found], which[found]] = h[found]
            used += 1
            return hi[:, :used] <= h[:, None]

        for row in range(max(0, pixel - prescan_offset), rows):
            n = charge[:, row]
            h = height(n)
            inside = cut(h)[:, :, None]
            old = fill[:, :used]
            new = np.where(inside, settled + (old - settled) * keep_in, old * keep_out)
            freed = ((old - new) @ density) * (hi[:, :used] - lo[:, :used])
            gain = freed.sum(axis=1)
            fill[:, :used] = new
            if law == "arcticpy":
                higher = height(n + (freed * ~inside[:, :, 0]).sum(axis=1))
                between = (cut(higher) & (lo[:, :used] >= h[:, None]))[:, :, None]
                old = fill[:, :used]
                new = np.where(between, settled + (old - settled) * keep_in, old)
                gain += (((old - new) @ density) * (hi[:, :used] - lo[:, :used])).sum(axis=1)
                fill[:, :used] = new
                if notch > 0.0:
                    gain[higher == 0.0] = 0.0
            charge[:, row] = n + gain
            if charge[:, row].min() < 0.0:
                raise RuntimeError("too few electrons: not described")
    return charge.T


def detector_of(name, notch, power):
    (full_well, old_notch, old_power), traps = DETECTORS[name]
    return (full_well, old_notch if notch is None else notch, old_power if power is None else power), traps


def effect_names(notch, power, capture, sigma):
    return "".join("-%s%g" % (label, value) for label, value in
                   (("notch", notch), ("power", power), ("capture", capture), ("sigma", sigma)) if value is not None)


def described(detector, traps, capture, sigma):
    return {"detector": {"full_well_e": detector[0], "notch_e": detector[1], "well_fill_power": detector[2]},
            "traps": [{"density_per_px": density, "release_transfers": release, "capture_transfers": capture,
                       "release_sigma": sigma} for density, release in traps]}


def pair(background, signal, transfers, block):
    """The column of packets.py and the one of background alone, and how many rows of them were left out in front.

    Without background the rows in front of the packet hold nothing and change nothing: left out.
    """
    image = np.hstack([column(background, s, transfers, block) for s in (signal, 0.0)])
    image = image[:transfers + BEHIND_STORED]
    out = transfers - block if background == 0.0 else 0
    return image[out:], out


def stored(after, packet, block):
    def behind(k):
        return [digits(v, 10) for v in after[packet + 1:packet + 1 + BEHIND_STORED, k]]
    values = {"packet_e": digits(after[packet, 0], 10), "behind_e": behind(0),
              "background_packet_e": digits(after[packet, 1], 10), "background_behind_e": behind(1)}
    if block > 1:
        values["block_e"] = [digits(v, 10) for v in after[packet + 1 - block:packet + 1, 0]]
    return values


def make_column(entry):
    name, notch, power, capture, sigma, background, signal, transfers, block = entry
    detector, traps = detector_of(name, notch, power)
    species = spread(traps, capture, sigma)
    image, out = pair(background, signal, transfers, block)
    theirs = trail(image, detector, species, out)
    c = {"name": "%s-%s%s-b%g-s%g-t%d" % ("packet" if block == 1 else "block", name,
                                         effect_names(notch, power, capture, sigma), background, signal, transfers)}
    c.update(described(detector, traps, capture, sigma))
    c.update({"background_e": background, "signal_e": signal, "transfers": transfers, "block_px": block})
    c.update(stored(theirs, transfers - 1 - out, block))
    if capture is not None:
        law = contract(image, detector, species, out)
        c["contract"] = stored(law, transfers - 1 - out, block)
        print("   contract - arcticpy: packet %+.1e, behind %+.1e (of %.1e)" % (
            (law - theirs)[transfers - 1 - out, 0], (law - theirs)[transfers - out, 0],
            (theirs[transfers - out, 0] - theirs[transfers - out, 1])))
    print(c["name"], c["packet_e"], c["behind_e"][:3], c["background_packet_e"], flush=True)
    return c


def shape_case(entry):
    name, notch, power, capture, sigma, transfers, background = entry
    detector, traps = detector_of("p-channel", notch, power)
    c = case(name, "p-channel", 1.0, transfers, background, 2.91, 3.5, 4.0, 0.45, 1150.0, 0.0, 5.4)
    c.update(described(detector, traps, capture, sigma))
    return c, detector, spread(traps, capture, sigma)


def changes(c, galaxies, after, empty):
    """mean, one and columns as in shapes.json, from the trailed stamps of all positions, side by side."""
    half = half_width(c["galaxy"]["weight_px"])
    width, seen, result = 2 * half + 1, [], {}
    for k, (position, galaxy) in enumerate(galaxies):
        stamp = after[:, k * width:(k + 1) * width]
        change, before = deltas(c, galaxy, stamp, empty)
        seen.append(change)
        if position == ONE:
            result["one"] = dict({"dx_px": ONE[0], "dy_px": ONE[1]}, **rounded(change))
            result["one"]["before"] = rounded(before)
            columns = {"column_before_e": (galaxy + c["background_e"])[:, half], "column_e": stamp[:, half],
                       "column_background_e": empty[:, 0]}
    mean = {key: float(np.mean([change[key] for change in seen])) for key in DELTAS}
    mean["delta_e2"] = 0.0      # dx and -dx cancel
    result = dict(mean=rounded(mean), **result)
    for key, values in columns.items():
        result[key] = [digits(v, 10) for v in values]
    return result


def make_shape(entry):
    c, detector, species = shape_case(entry)
    _, _, half, offset = unpack(c)
    galaxies = [((dx, dy), picture(c, dx, dy)) for dx in POSITIONS if dx > 0.0 for dy in POSITIONS]
    image = np.hstack([galaxy for _, galaxy in galaxies] + [np.zeros((2 * half + 1, 1))]) + c["background_e"]
    after = trail(image, detector, species, offset)
    c = dict(c, **changes(c, galaxies, after[:, :-1], after[:, -1:]))
    print(c["name"], c["mean"], flush=True)
    if entry[3] is not None:
        law = contract(image, detector, species, offset)
        c["contract"] = changes(c, galaxies, law[:, :-1], law[:, -1:])
        for key in ("column_before_e",):
            del c["contract"][key]
        print("   contract", c["contract"]["mean"], flush=True)
    return c


def make():
    done = {"made_by": MADE_BY, "cases": [], "shapes": []}
    for entry in CASES:
        done["cases"].append(make_column(entry))
        write_json("effects.json", done)
    for entry in SHAPES:
        done["shapes"].append(make_shape(entry))
        write_json("effects.json", done)


def of_class(kind, detector, traps, image, out, line_time, sigma, capture=None):
    """The same by one of arcticpy's own classes for a continuum, with a line time in units of its tables."""
    import arcticpy
    settings = {} if capture is None else {"capture_timescale": capture * line_time}
    species = [getattr(arcticpy, kind)(density=density, release_timescale=release * line_time,
                                       release_timescale_sigma=sigma, **settings) for density, release in traps]
    return add_cti(image, detector, species, out, line_time)


def check_continuum_class():
    """The filled fraction, seen without recapture: what follows the packet stays below the notch."""
    detector, rows = (1e5, 50.0, 0.7), np.full((40, 1), 20.0)
    rows[0] = 1000.0
    filled = (950.0 / (1e5 - 50.0)) ** 0.7
    x = np.linspace(-9.0, 9.0, 4001)
    weight = np.exp(-0.5 * x * x)
    weight /= weight.sum()
    after = np.arange(1, 40)
    for line_time in (1.0, 0.1, 1e-2, 1e-3, 1e-4):
        print("line time %g: filled fraction after 1 .. 39 transfers wrong by (sigma 0.2, 0.6, 1.2)" % line_time, end="")
        for release in (0.3, 3.0, 10.0, 40.0, 200.0):
            wrong = []
            for sigma in (0.2, 0.6, 1.2):
                trailed = of_class("TrapInstantCaptureContinuum", detector, [(1.0, release)], rows, 0, line_time, sigma)
                theirs = 1.0 - np.cumsum(trailed[1:, 0] - 20.0) / filled
                exact = (np.exp(-after[:, None] / (release * np.exp(sigma * x))) * weight).sum(axis=1)
                wrong.append("%.0e" % abs(theirs - exact).max())
            print("; release %g: %s" % (release, " ".join(wrong)), end="")
        print(flush=True)
    for sigma in (0.2, 0.6, 1.2):
        detector, traps = DETECTORS["p-channel"]
        image, out = pair(100.0, 1000.0, 100, 1)
        reference = trail(image, detector, spread(traps, None, sigma, 161), out)
        print("sigma %g, %.3g e- in the first pixel, wrong with so many release times per species:" % (
            sigma, reference[-BEHIND_STORED, 0] - reference[-BEHIND_STORED, 1]), " ".join(
            "%d: %.0e e-" % (nodes, abs(trail(image, detector, spread(traps, None, sigma, nodes), out) - reference).max())
            for nodes in (21, 31, 41, 61)), flush=True)


def check_slow_class():
    """Where arcticpy's slow capture is odd, in the smallest columns that show it."""
    detector, traps = (161000.0, 0.0, 0.5), [(3.0, 3.0, 0.3)]

    def both(rows, detector=detector, traps=traps):
        image = np.array(rows, dtype=float)[:, None]
        return [in_units(image, detector, traps, 0, 1.0)[:, 0], contract(image, detector, traps, 0, "arcticpy")[:, 0],
                contract(image, detector, traps)[:, 0]]
    for label, values in (("lower packet after a higher one, 1000 and 300", both([1000.0, 300.0])),
                          ("rounding, 5.69 and 122.9", both([5.69, 122.9])),
                          ("below the notch, 1000 and 20", both([1000.0, 20.0, 20.0], (1e5, 50.0, 0.7)))):
        print("%s: arcticpy %s, its law here %s, contract %s" % ((label,) + tuple(values)))
    lost = sum(abs(a - b).max() > 1e-6 for a, b, _ in (both([5.69, x]) for x in np.arange(6.0, 1000.0)))
    print("rounding, 5.69 and 6 .. 999: %d of 994 columns without the capture above the old cloud" % lost)
    dense = [(100.0, 3000.0, 0.03)]
    print("too few electrons, 0.01 and 1000: arcticpy %s; 0 and 1000: %s" % tuple(
        in_units(np.array([[n], [1000.0]]), detector, dense, 0, 1.0)[:, 0] for n in (0.01, 0.0)))
    image, out = pair(0.0, 1000.0, 100, 1)
    detector, traps = DETECTORS["p-channel"]
    instant = trail(image, detector, spread(traps, None, None), out)
    for capture in (0.1, 0.01, 1e-3, 1e-4, 1e-6):
        slow = contract(image, detector, spread(traps, capture, None), out)
        theirs = trail(image, detector, spread(traps, capture, None), out)
        print("capture in %g transfers less instant capture (%s), packet and first 2 behind: contract %s, arcticpy %s" % (
            capture, instant[:3, 0], (slow - instant)[:3, 0], (theirs - instant)[:3, 0]), flush=True)


def check():
    np.set_printoptions(precision=7, linewidth=160)
    check_continuum_class()
    check_slow_class()
    for name, notch, power, capture, sigma, background, signal, transfers, block in CASES:
        detector, traps = detector_of(name, notch, power)
        species = spread(traps, capture, sigma)
        image, out = pair(background, signal, transfers, block)
        theirs = trail(image, detector, species, out)
        packet = transfers - 1 - out
        print("%s%s, background %g, signal %g, %d transfers, block %d" % (
            name, effect_names(notch, power, capture, sigma), background, signal, transfers, block))
        if capture is None:
            mine = second_program(image[:, 0], detector, species, out)
            print("   second program differs by %.1e" % abs(mine - theirs[:, 0]).max())
        else:
            mine = contract(image, detector, species, out, "arcticpy")
            print("   its law by the second program differs by %.1e" % abs(mine - theirs).max())
            law = contract(image, detector, species, out)
            wrong = law - theirs
            print("   contract - arcticpy: packet %+.1e, behind up to %.1e of %.3g, %.1e of what is there; background %.1e"
                  % (wrong[packet, 0], abs(wrong[packet + 1:, 0]).max(), theirs[packet + 1, 0] - theirs[packet + 1, 1],
                     abs(wrong[packet + 1:, 0] / (theirs - theirs[:, 1:])[packet + 1:, 0]).max(), abs(wrong[:, 1]).max()))
            units = [abs(in_units(image, detector, species, out, 1.0723 ** k) - theirs).max() for k in range(4)]
            print("   rounding: %d of 4 units differ, by up to %.1e" % (sum(u > 1e-9 for u in units), max(units)))
        if sigma is not None:
            kind = "TrapInstantCaptureContinuum" if capture is None else "TrapSlowCaptureContinuum"
            for line_time in (1e-3, 1.0):
                difference = of_class(kind, detector, traps, image, out, line_time, sigma, capture) - theirs
                print("   %s, line time %g: packet %+.1e, behind up to %.1e of %.3g, background %.1e" % (
                    kind, line_time, difference[packet, 0], abs(difference[packet + 1:, 0]).max(),
                    theirs[packet + 1, 0] - theirs[packet + 1, 1], abs(difference[:, 1]).max()))
        sys.stdout.flush()
    for entry in SHAPES:
        c, detector, species = shape_case(entry)
        _, _, half, offset = unpack(c)
        middle = picture(c, *ONE)[:, half:half + 1] + c["background_e"]
        theirs = trail(middle, detector, species, offset)
        mine = (second_program(middle[:, 0], detector, species, offset)[:, None] if entry[3] is None else
                contract(middle, detector, species, offset, "arcticpy"))
        print("%s: central column by the second program %.1e e-" % (c["name"], abs(mine - theirs).max()), flush=True)
        if entry[4] is not None and entry[3] is None:
            _, traps = detector_of("p-channel", entry[1], entry[2])
            other = of_class("TrapInstantCaptureContinuum", detector, traps, middle, offset, 1e-3, entry[4])
            print("   TrapInstantCaptureContinuum, line time 0.001: %.1e e-" % abs(other - theirs).max(), flush=True)


if __name__ == "__main__":
    check() if "--check" in sys.argv[1:] else make()
