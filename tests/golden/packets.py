#!/usr/bin/env python3
"""Golden lone packets and flat blocks after parallel transfer: writes packets.json beside this file.

Made by   arcticpy 2.6 (public add_cti, express = 0: every transfer is followed) with numpy 1.26.4 (Python 3.11); five
          seconds on one core.
Command   python tests/golden/packets.py            writes packets.json
          python tests/golden/packets.py --check    compares arcticpy with a second program (12 min)

What is trailed
    One column. Row 0 is nearest the register and row r makes r + 1 transfers. Every row from row 0 up holds
    `background_e`; `block_px` rows, of which the last is row transfers - 1, hold background_e + signal_e instead; 100
    rows of background alone follow. (With background 0 the packet is the first charge any trap has seen.) Stored
    are the charge of the last packet (`packet_e`), the 60 pixels behind it (`behind_e`, next to the packet first),
    for blocks the whole block too (`block_e`, first row first), and the same pixels of a column that holds the
    background alone (`background_packet_e`, `background_behind_e`). Nothing has been subtracted from anything.

Empty start
    The traps of each physical pixel are empty before the first packet that passes through it. Pixels beyond
    the packet's own starting row are never passed by the packet, but the rows behind it do start there, with
    empty traps. In arcticpy this is ROE(empty_traps_for_first_transfers=True). Its default, False, is another model:
    the traps then carry their state from one pixel of the array into the next, and a lone packet makes one loss
    whatever the number of transfers (observed: density 10, 1000 e-, full well 161000, power 0.5: loss 0.788 e- with
    prescan_offset 0 and also with 20; with True 0.788 and 16.485, and 21 steps of n -= 10 sqrt(n/161000) make 16.485).

Other settings
    Traps are TrapInstantCapture(density, release time in transfers), one dwell of 1.0 per transfer, one phase,
    empty_traps_between_columns=True (columns do not know of each other), no serial transfer, and
    parallel_prune_n_electrons=0, so that nothing is pruned; parallel_prune_frequency=10^9 gives the same bits.
    The default, 1e-10 e- every 20 rows, is not harmless on long flat columns: it changes the packet of 200 e- of
    hst-like (background 100, 1650 transfers) by 8.5 e- out of 224, that of n-channel by 4.5 e-, a block by 1.2 e-.
    Where empty traps want more electrons than the packet has (below density^2/full_well at power 0.5, some 1e-5 e-),
    all traps below the cloud's height get the same share of what they want and the packet is left empty.

How good it is, and the tolerance to ask for
    --check runs the project's model (README section "one transfer": release, join, capture below the cloud's height)
    in a few lines of numpy that keep exact trap levels, and agrees with arcticpy to 1e-10 e- or better on every column
    stored here and on 24 columns of random charge, so values are good to all the 10 digits stored. A consumer that follows every transfer with exact
    levels should ask for 1e-7 relative + 1e-6 e-; one that approximates (groups transfers, bins the cloud) for what
    it promises, in units of the trail: about 1e-3 of packet minus signal.
"""
import sys

import numpy as np

from galaxies import digits, write_json

MADE_BY = "arcticpy 2.6 add_cti (express 0), numpy 1.26.4: python tests/golden/packets.py"

# (full well, notch, power), [(density per px, release time in transfers)]
DETECTORS = {
    "p-channel": ((161000.0, 0.0, 0.5), [(0.35, 10.0), (0.49, 0.486), (0.7, 200.0)]),
    "n-channel": ((200000.0, 0.0, 0.58), [(0.12, 0.8), (0.26, 6.0), (0.33, 90.0)]),
    "hst-like": ((84700.0, 0.0, 0.478), [(0.34, 0.48), (0.9, 4.86), (0.76, 20.6)]),
    "notched": ((100000.0, 50.0, 0.7), [(0.6, 3.0), (0.9, 40.0)]),
}

# detector, background, signal, transfers, block
CASES = [
    ("p-channel", 0.0, 200.0, 1650, 1),
    ("p-channel", 2.0, 1580.0, 100, 1),
    ("p-channel", 100.0, 50000.0, 1650, 1),
    ("n-channel", 2.0, 200.0, 1650, 1),
    ("n-channel", 100.0, 1580.0, 100, 1),
    ("hst-like", 0.0, 1580.0, 1650, 1),
    ("hst-like", 100.0, 200.0, 1650, 1),
    ("notched", 2.0, 200.0, 1650, 1),
    ("notched", 100.0, 50000.0, 100, 1),
    ("p-channel", 50.0, 1000.0, 400, 100),
    ("hst-like", 50.0, 1000.0, 400, 100),
]
BEHIND_ROWS = 100
BEHIND_STORED = 60


def trail(image, detector, traps, prescan_offset=0, **options):
    """Trail every column of image[row][column]; row r makes r + 1 + prescan_offset transfers."""
    import arcticpy
    full_well, notch, power = detector
    ccd = arcticpy.CCD(phases=[arcticpy.CCDPhase(full_well_depth=full_well, well_notch_depth=notch,
                                                 well_fill_power=power)], fraction_of_traps_per_phase=[1.0])
    roe = arcticpy.ROE(dwell_times=[1.0], prescan_offset=prescan_offset, empty_traps_between_columns=True,
                       empty_traps_for_first_transfers=True)
    species = [arcticpy.TrapInstantCapture(density=density, release_timescale=release) for density, release in traps]
    settings = dict(parallel_express=0, parallel_prune_n_electrons=0, verbosity=0)
    settings.update(options)
    return arcticpy.add_cti(np.array(image, dtype=float), parallel_ccd=ccd, parallel_roe=roe, parallel_traps=species,
                            **settings)


def column(background, signal, transfers, block):
    """The column described above, as one-column image."""
    rows = np.full((transfers + BEHIND_ROWS, 1), background)
    rows[transfers - block:transfers, 0] += signal
    return rows


def make():
    cases = []
    for name, background, signal, transfers, block in CASES:
        detector, traps = DETECTORS[name]
        after = trail(column(background, signal, transfers, block), detector, traps)[:, 0]
        empty = trail(column(background, 0.0, transfers, block), detector, traps)[:, 0]

        def behind(rows):
            return [digits(v, 10) for v in rows[transfers:transfers + BEHIND_STORED]]
        case = {
            "name": "%s-%s-b%g-s%g-t%d" % ("packet" if block == 1 else "block", name, background, signal, transfers),
            "detector": {"full_well_e": detector[0], "notch_e": detector[1], "well_fill_power": detector[2]},
            "traps": [{"density_per_px": density, "release_transfers": release} for density, release in traps],
            "background_e": background, "signal_e": signal, "transfers": transfers, "block_px": block,
            "packet_e": digits(after[transfers - 1], 10), "behind_e": behind(after),
            "background_packet_e": digits(empty[transfers - 1], 10), "background_behind_e": behind(empty)}
        if block > 1:
            case["block_e"] = [digits(v, 10) for v in after[transfers - block:transfers]]
        cases.append(case)
        print(case["name"], case["packet_e"], case["behind_e"][:3], case["background_packet_e"], flush=True)
        write_json("packets.json", {"made_by": MADE_BY, "cases": cases})


def second_program(rows, detector, traps, prescan_offset=0):
    """One column by the project's description of a transfer alone, with exact trap levels; slow.

    Traps are uniform in 0 < h < 1. `edges` cuts that range into steps, `fill` is the filled fraction of each species
    in each step. A pixel of the array sees the rows that start at or beyond it, nearest the register first.
    """
    full_well, notch, power = detector
    density = np.array([trap[0] for trap in traps])[:, None]
    gone = -np.expm1(-1.0 / np.array([trap[1] for trap in traps]))[:, None]
    charge = np.array(rows, dtype=float)
    for pixel in range(len(charge) - 1 + prescan_offset, -1, -1):
        edges, fill = np.array([0.0, 1.0]), np.zeros((len(traps), 1))
        for row in range(max(0, pixel - prescan_offset), len(charge)):
            released = density * fill * gone
            fill = fill * (1.0 - gone)
            n = charge[row] + (released * np.diff(edges)).sum()
            height = min(max((n - notch) / (full_well - notch), 0.0), 1.0) ** power if n > notch else 0.0
            if height > 0.0:
                step = np.searchsorted(edges, height)
                if edges[step] != height:
                    edges = np.insert(edges, step, height)
                    fill = np.insert(fill, step, fill[:, step - 1], axis=1)
                below = np.diff(edges)[:step]
                wanted = (density * (1.0 - fill[:, :step]) * below).sum()
                share = min(1.0, n / wanted) if wanted > 0.0 else 1.0
                fill[:, :step] += share * (1.0 - fill[:, :step])
                n -= share * wanted
                if share == 1.0 and step > 1:       # all full below: one step will do
                    edges = np.concatenate(([0.0], edges[step:]))
                    fill = np.concatenate((np.ones((len(traps), 1)), fill[:, step:]), axis=1)
            charge[row] = n
    return charge


def check():
    # 1. what prescan_offset means: a lone packet in row 0, one species, against the closed recursion
    for offset in (0, 1, 5, 20, 500):
        rows = np.zeros((4, 1))
        rows[0, 0] = 1000.0
        loss = 1000.0 - trail(rows, (161000.0, 0.0, 0.5), [(10.0, 3.0)], offset)[0, 0]
        n = 1000.0
        for _ in range(offset + 1):
            n -= 10.0 * (n / 161000.0) ** 0.5
        print("prescan_offset %3d: loss %.9f, %d transfers by hand %.9f" % (offset, loss, offset + 1, 1000.0 - n))
    # 2. the second program on busy columns, with and without offset, notch, background
    rng = np.random.default_rng(1)
    for name, (detector, traps) in DETECTORS.items():
        for background in (0.0, 2.0, 100.0):
            for offset in (0, 300):
                rows = background + np.where(rng.random(60) < 0.3, rng.random(60) * 3000.0, 0.0)
                mine = second_program(rows, detector, traps, offset)
                theirs = trail(rows[:, None], detector, traps, offset)[:, 0]
                pruned = trail(rows[:, None], detector, traps, offset, parallel_prune_n_electrons=1e-10)[:, 0]
                print("%-10s background %5g offset %3d: changed by up to %8.3f, second program differs by %.1e, pruning"
                      " by %.1e" % (name, background, offset, abs(theirs - rows).max(), abs(mine - theirs).max(),
                                    abs(pruned - theirs).max()), flush=True)
    # 3. the second program on the stored cases, and arcticpy's own pruning there
    for name, background, signal, transfers, block in CASES:
        detector, traps = DETECTORS[name]
        rows = column(background, signal, transfers, block)[:transfers + BEHIND_STORED]
        theirs = trail(rows, detector, traps)[:, 0]
        pruned = abs(trail(rows, detector, traps, parallel_prune_n_electrons=1e-10)[:, 0] - theirs)
        mine = second_program(rows[:, 0], detector, traps)
        print("%s, background %g, signal %g, %d transfers: second program differs by %.1e, pruning by %.1e (row %d)"
              % (name, background, signal, transfers, abs(mine - theirs).max(), pruned.max(), pruned.argmax()), flush=True)


if __name__ == "__main__":
    check() if "--check" in sys.argv[1:] else make()
