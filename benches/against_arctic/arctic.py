"""Trails or corrects a frame with ArCTIc:
arctic.py IN.f64 OUT.f64 ROWS COLUMNS OFFSET EXPRESS REPEATS TRAPS FULL_WELL POWER EMPTY ITERATIONS

Frames are raw little-endian doubles, row after row, row 0 nearest the register. TRAPS is density:release,density:release...
(release in transfers). EMPTY is 1 where traps are empty for first transfers. With 0 ITERATIONS the frame is trailed, else corrected
by so many. Prints the seconds of the fastest repeat. Threads: OMP_NUM_THREADS.
"""

import sys
import time

import arcticpy
import numpy

source, target, rows, columns, offset, express, repeats, traps, full_well, power, empty, iterations = sys.argv[1:]
image = numpy.fromfile(source).reshape(int(rows), int(columns))
species = [[float(number) for number in trap.split(":")] for trap in traps.split(",")]
arguments = dict(
    parallel_traps=[arcticpy.TrapInstantCapture(density=density, release_timescale=time) for density, time in species],
    parallel_ccd=arcticpy.CCD(full_well_depth=float(full_well), well_notch_depth=0.0, well_fill_power=float(power)),
    parallel_roe=arcticpy.ROE(dwell_times=[1.0], prescan_offset=int(offset), empty_traps_between_columns=True,
                              empty_traps_for_first_transfers=bool(int(empty))),
    parallel_express=int(express),
    parallel_prune_n_electrons=0,
    verbosity=0,
)
seconds = []
for _ in range(int(repeats)):
    start = time.perf_counter()
    if int(iterations) == 0:
        result = arcticpy.add_cti(image, **arguments)
    else:
        result = arcticpy.remove_cti(image, n_iterations=int(iterations), **arguments)
    seconds.append(time.perf_counter() - start)
result.tofile(target)
print(min(seconds))
