"""Frames through a detector."""

import copy
import pickle

import numpy as np
import pytest

import ctiplan as cp


@pytest.fixture(scope="module")
def detector(snap):
    return snap.detector_at(t_yr=5)


@pytest.fixture(scope="module")
def frame():
    random = np.random.default_rng(2)
    sky = random.poisson(60.0, (40, 30)).astype(float)
    sky[20:23, 5:8] += 3000.0
    return sky


def test_a_detector_has_traps(detector, snap):
    last = cp.evaluate(snap, samples=0).years[-1]
    assert detector.dose_mev_g == pytest.approx(last["dose_mev_g"], rel=1e-12)
    assert {name: trap["density_per_px"] for name, trap in detector.traps.items()} == pytest.approx(
        {trap["name"]: trap["density_per_px"] for trap in last["traps"]}
    )


def test_any_real_array_is_taken(detector, frame):
    expected = detector.readout(frame)
    assert expected.shape == frame.shape and expected.dtype == np.float64
    whole = frame.astype(np.int32)
    wide = np.zeros((80, 60))
    wide[::2, ::2] = frame
    read_only = frame.copy()
    read_only.flags.writeable = False
    for given in (
        whole,
        whole.astype(np.uint16),
        np.asfortranarray(frame),
        wide[::2, ::2],
        frame[::-1, ::-1][::-1, ::-1],
        frame.astype(">f8"),
        read_only,
        frame.tolist(),
    ):
        assert np.array_equal(detector.readout(given), expected)
    single = detector.readout(frame.astype(np.float32))
    assert single.dtype == np.float32 and np.array_equal(single, expected.astype(np.float32))
    assert np.array_equal(detector.readout(frame[:, 3])[:, None], detector.readout(frame[:, 3:4]))


def test_corners_are_mirror_images(detector, frame):
    expected = detector.readout(frame)
    for corner, turn in (("lr", np.s_[:, ::-1]), ("ul", np.s_[::-1]), ("ur", np.s_[::-1, ::-1])):
        assert np.allclose(detector.readout(frame[turn], corner=corner)[turn], expected, atol=1e-9)


def test_charge_moves_away_from_the_register(snap, frame):
    quick = {f"detector.traps.{name}.release_ms": 100.0 for name in ("Ci", "VV", "CO")}
    detector = snap.set(quick).detector_at(t_yr=5)
    long = np.vstack([frame, np.zeros((1000, 30))])
    change = detector.readout(long, overscan_rows=1000) - long
    assert change[23:26, 5:8].sum() > 0 > change[20, 5:8].sum()
    # What the smallest packets carry is caught again in the empty pixels behind: a few millionths are held to the end.
    assert -1e-5 * np.abs(change).sum() < change.sum() < 0
    exact = detector.mission.set({"accuracy.readout": "exact"}).detector_at(t_yr=5).readout(long, overscan_rows=1000) - long
    assert np.abs(change - exact).max() < 1e-3 * np.abs(exact).max()


def test_frames_that_are_none_are_refused(detector, frame):
    with pytest.raises(ValueError, match="shape"):
        detector.readout(np.zeros((2, 2, 2)))
    with pytest.raises(TypeError, match="complex"):
        detector.readout(frame.astype(complex))
    with pytest.raises(cp.InputError, match="corner"):
        detector.readout(frame, corner="middle")
    for wrong in ({"corner": None}, {"axis": 1}, {"split": True}, {"charge_before_e": "x"}, {"relative": "x"}):
        with pytest.raises(cp.InputError, match=next(iter(wrong))):
            detector.readout(frame, **wrong)
    with pytest.raises(cp.InputError, match="prescan"):
        detector.readout(frame, prescan=30)
    with pytest.raises(cp.InputError, match="serial"):
        detector.readout(frame, axis="both")
    with pytest.raises(cp.InputError, match="no pixels"):
        detector.readout(np.zeros((0, 5)))


def test_times_that_are_none_are_refused(snap):
    for wrong in ({}, {"t_yr": -1.0}, {"t_yr": float("nan")}, {"dose_mev_g": -1.0}):
        with pytest.raises(cp.InputError):
            snap.detector_at(**wrong)
    assert snap.detector_at(dose_mev_g=1e6).dose_mev_g == 1e6


def test_a_correction_gives_the_frame_back(detector, frame):
    shape = {"corner": "ur", "overscan_rows": 5, "transfers_before": 800, "charge_before_e": 60.0}
    framed = np.vstack([np.zeros((5, 30)), frame])
    read = detector.readout(framed, **shape)
    fix = detector.correct(read, **shape)
    assert fix.converged and not fix.uncertain.any() and fix.uncertain.shape == framed.shape
    moved = np.abs(read - framed).max()
    assert np.abs(fix.image - framed)[5:].max() < 1e-3 * moved < moved / 2
    assert fix.residuals[-1].max_e < 1e-3 * fix.residuals[0].max_e
    by_error = detector.correct(read, tolerance_e=0.5, **shape)
    assert np.sqrt(np.mean((by_error.image - framed)[5:] ** 2)) < 0.5
    assert detector.correct(read.astype(np.float32), **shape).image.dtype == np.float32
    column = detector.correct(detector.readout(frame[:, 6]))
    assert column.image.shape == column.uncertain.shape == (40,)


def test_missing_pixels_stay_missing_and_full_wells_keep_their_values(detector, frame):
    spoiled = detector.readout(frame)
    spoiled[10, 3], spoiled[12, 4] = np.nan, 1e6
    fix = detector.correct(spoiled)
    assert np.array_equal(np.isnan(fix.image), np.isnan(spoiled)) and fix.missing_px == 1
    assert fix.image[12, 4] == 1e6 and fix.saturated_px == 1
    assert np.array_equal(np.isnan(detector.readout(spoiled)), np.isnan(spoiled))


def test_read_noise_is_amplified_less_where_it_is_separated(snap):
    detector = snap.detector_at(dose_mev_g=4e7)
    random = np.random.default_rng(4)
    sky = random.poisson(60.0, (800, 20)).astype(float)
    noisy = detector.readout(sky) + random.normal(0.0, 4.0, sky.shape)
    plain = (detector.correct(noisy).image - sky).std()
    separated = (detector.correct(noisy, read_noise_e=4.0).image - sky).std()
    assert separated < plain and plain > 4.0


def test_corrections_that_are_none_are_refused(detector, frame):
    for wrong in ({"tolerance": 0.0}, {"tolerance_e": -1.0}, {"iterations": 0}, {"relative": 2.0}, {"read_noise_e": 0.0}):
        with pytest.raises(cp.InputError, match=next(iter(wrong))):
            detector.correct(frame, **wrong)


def test_units_and_masks_of_frames_are_heeded(detector, frame):
    from astropy import units as u
    from astropy.nddata import CCDData

    expected = detector.readout(frame)
    assert np.array_equal(detector.readout(frame * u.electron), expected)
    assert np.allclose(detector.readout(frame / 1000 * u.Unit("1000 electron")), expected, rtol=1e-12)
    assert np.array_equal(detector.readout(CCDData(frame, unit="electron")), expected)
    for wrong in (frame * u.adu, CCDData(frame, unit="adu"), frame * u.m, frame * u.dimensionless_unscaled):
        with pytest.raises(cp.InputError, match="unit"):
            detector.readout(wrong)
    holes = np.zeros(frame.shape, dtype=bool)
    holes[10, 3] = True
    spoiled = frame.copy()
    spoiled[10, 3] = np.nan
    expected = detector.readout(spoiled)
    spoiled[10, 3] = -1e9
    for masked in (np.ma.array(spoiled, mask=holes), CCDData(spoiled, unit="electron", mask=holes)):
        assert np.array_equal(detector.readout(masked), expected, equal_nan=True)
        assert detector.correct(masked).missing_px == 1
    assert detector.readout(frame.astype(">f4")).dtype == np.float32
    pandas = pytest.importorskip("pandas")
    assert np.array_equal(detector.readout(pandas.DataFrame(frame)), detector.readout(frame))


def test_detectors_and_measurements_go_to_other_processes(detector, snap, frame):
    expected = detector.readout(frame)
    for back in (pickle.loads(pickle.dumps(detector)), copy.deepcopy(detector)):
        assert np.array_equal(back.readout(frame), expected) and back.mission == snap
    dosed = snap.detector_at(dose_mev_g=1e6)
    assert pickle.loads(pickle.dumps(dosed)).dose_mev_g == 1e6
    columns = {"t_yr": [1.0, 2.0], "value": [1e6, 2e6], "sigma": [1e5, 1e5]}
    data = cp.DataSet.from_table(columns, snap, observable="dose")
    for back in (pickle.loads(pickle.dumps(data)), copy.deepcopy(data)):
        assert back.to_ecsv() == data.to_ecsv() and np.array_equal(back.sigma, data.sigma)
    with pytest.raises(TypeError, match="a mission is needed"):
        cp.DataSet.from_table(columns, None, observable="dose")


def test_counts_that_are_none_are_refused(detector, frame):
    for wrong in ({"prescan": -1}, {"prescan": 2.5}, {"overscan": "4"}, {"transfers_before": 10**30}):
        with pytest.raises(cp.InputError, match=next(iter(wrong))):
            detector.readout(frame, **wrong)
    with pytest.raises(cp.InputError, match="iterations"):
        detector.correct(frame, iterations=-1)


def test_a_map_gives_columns_rows_and_pixels_their_own_traps(detector, frame):
    by_column = np.resize([1.0, 0.0, 2.0], frame.shape[1])
    read = detector.readout(frame, trap_map=by_column)
    assert np.array_equal(read[:, 1::3], frame[:, 1::3])
    assert np.array_equal(read, detector.readout(frame, trap_map=np.broadcast_to(by_column, frame.shape)))
    by_row = np.repeat([0.5, 0.0, 3.0, 1.0], 10)
    read = detector.readout(frame, trap_map=by_row[:, None], transfers_before=500)
    blocks = np.broadcast_to(by_row.reshape(4, 10)[:, :1], (4, 3))
    assert np.array_equal(read, detector.readout(frame, trap_map=blocks, transfers_before=500))
    assert np.allclose(read[:, 3], detector.readout(frame[:, 3], trap_map=by_row, transfers_before=500), atol=0.05)
    fix = detector.correct(read, trap_map=by_row[:, None], transfers_before=500)
    assert fix.converged and np.abs(fix.image - frame).max() < 0.05
    for bad in (np.ones(7), -by_row[:, None], np.ones((2, 2, 2))):
        with pytest.raises(cp.InputError, match="trap_map|trap map"):
            detector.readout(frame, trap_map=bad)
