"""A sweep on whatever Dask runs on: python sweep_with_dask.py GRID.toml RESULT.parquet [SCHEDULER]

Every task is `ctiplan sweep --shard K/N`, in a folder that all workers see. A task whose worker is lost is run again by
Dask; that one ran twice does no harm.
"""

import subprocess
import sys

from dask.distributed import Client, as_completed

SHARDS = 32


def ctiplan(*arguments):
    command = ["ctiplan", "sweep", *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def main(grid, result, scheduler=None):
    # One thread per worker: ctiplan uses RAYON_NUM_THREADS threads, all cores if that is not set.
    with Client(scheduler) if scheduler else Client(threads_per_worker=1) as client:

        def submit(shards):
            tasks = [client.submit(ctiplan, grid, "--output", result, "--shard", f"{shard}/{SHARDS}", pure=False,
                                   retries=3) for shard in shards]
            for done, task in enumerate(as_completed(tasks), 1):
                if task.exception():
                    print(task.exception(), file=sys.stderr)
                print(f"{done} of {len(tasks)} tasks are over", file=sys.stderr)

        submit(range(1, SHARDS + 1))
    # Whatever Dask says, the files decide: --collect refuses a sweep with gaps and names them.
    print(ctiplan(grid, "--output", result, "--collect"))


if __name__ == "__main__":
    main(*sys.argv[1:])
