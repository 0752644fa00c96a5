"""Threads, Ctrl-C and progress."""

import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import ctiplan as cp
from conftest import PRACTICE, ROOT


def test_results_do_not_depend_on_the_number_of_threads(snap):
    before = cp.threads()
    frame = np.random.default_rng(1).poisson(60, (100, 70)).astype(float)
    try:
        results = []
        for threads in (1, 3):
            cp.set_threads(threads)
            assert cp.threads() == threads
            read = snap.detector_at(t_yr=5).readout(frame)
            results.append((cp.evaluate(snap, samples=100).to_json(), read.tobytes()))
        assert results[0] == results[1]
    finally:
        cp.set_threads(0)
    assert cp.threads() == before


# Takes some seconds.
SLOW = {"accuracy.readout": "exact", "accuracy.noise_realisations": 0, "readout.transfers": 400, "accuracy.subpixel_grid": 1}

LONG = {
    "evaluate": "cp.evaluate(m.set({'accuracy.readout': 'exact', 'accuracy.noise_realisations': 1000}), samples=2000)",
    "compare": "cp.compare(m, {'detector.temperature_k': [120 + k / 100 for k in range(2000)]})",
    "study": "cp.compare(m, {'detector.temperature_k': [120 + k for k in range(50)]}, confidence=0.9)",
    "draws": "cp.evaluate(m, samples=65000)",
    "noise": "cp.evaluate(m, samples=0, monte_carlo=1000000)",
    "fit": "cp.fit(lab, data, ['detector.traps.VV.density_per_px'], samples=100000)",
    "diagnose": "cp.diagnose(lab, data)",
    "readout": "m.set({'accuracy.readout': 'exact'}).detector_at(t_yr=5).readout(np.random.default_rng(1).random((3000, 3000)))",
    "low orbit": "cp.evaluate(cp.Mission.read(root / 'missions/hst_leo.toml'), samples=60000)",
}


@pytest.mark.parametrize("work", LONG)
def test_work_ends_with_ctrl_c(work):
    program = f"""
        import pathlib, signal, threading, time, os
        import numpy as np
        import ctiplan as cp
        # A shell that starts this in the background has it ignore the signal, which Python would leave so.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        root, practice = pathlib.Path({str(ROOT)!r}), pathlib.Path({str(PRACTICE)!r})
        m, lab = cp.Mission.read(root / "missions/snap_l2.toml"), cp.Mission.read(practice / "mission.toml")
        data = [cp.DataSet.read(practice / name, lab) for name in ("packets.ecsv", "trails.ecsv")]
        begun = [0.0]
        def interrupt():
            time.sleep(0.6)
            begun[0] = time.monotonic()
            os.kill(os.getpid(), signal.SIGINT)
        threading.Thread(target=interrupt).start()
        try:
            {LONG[work]}
        except KeyboardInterrupt:
            print("interrupted", time.monotonic() - begun[0])
        else:
            print("done")
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, timeout=300)
    # Nothing else is said, and nothing is left running that keeps the process alive.
    assert done.stdout.startswith("interrupted ") and not done.stderr, (done.stdout, done.stderr)


def test_other_threads_of_python_go_on(snap):
    ticks = []
    ended = threading.Event()

    def tick():
        while not ended.wait(0.005):
            ticks.append(time.monotonic())

    ticking = threading.Thread(target=tick)
    ticking.start()
    begun = time.monotonic()
    cp.evaluate(snap.set(SLOW), samples=0)
    took = time.monotonic() - begun
    ended.set()
    ticking.join()
    assert took < 0.1 or len(ticks) > 5


def test_questions_may_be_asked_in_several_threads(snap):
    missions = [snap.set({"detector.temperature_k": kelvin}) for kelvin in (130, 140, 150)]
    alone = [cp.evaluate(mission, samples=50).to_json() for mission in missions]
    found = [None] * len(missions)

    def ask(place):
        found[place] = cp.evaluate(missions[place], samples=50).to_json()

    threads = [threading.Thread(target=ask, args=(place,)) for place in range(len(missions))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == alone


def test_an_exception_in_a_callback_ends_the_work(laboratory, data):
    class Enough(Exception):
        pass

    def progress(stage, done, total):
        assert isinstance(stage, str) and done >= 0 and total >= 0
        assert threading.current_thread() is threading.main_thread()
        raise Enough

    with pytest.raises(Enough):
        cp.diagnose(laboratory, data, progress=progress)
    # And what is asked next is answered.
    assert cp.validate(laboratory, data).n == 35


def test_a_handler_of_signals_is_called_meanwhile(snap):
    called = []
    before = signal.signal(signal.SIGALRM, lambda *_: called.append(True))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.02)
        cp.evaluate(snap.set(SLOW), samples=0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert called
