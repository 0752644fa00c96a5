"""Missions, measurements and what is refused of them."""

import copy
import datetime
import multiprocessing
import pickle

import numpy as np
import pandas
import pytest
from astropy import units as u
from astropy.coordinates import SkyCoord
from astropy.table import QTable, Table
from astropy.time import Time, TimeDelta

import ctiplan as cp
from conftest import PRACTICE


def test_values_of_any_kind_can_be_set(snap):
    other = snap.set({
        "detector.temperature_k": np.float32(150),
        "readout.transfers": np.int64(800),
        "mission.launch": datetime.date(2012, 1, 1),
        "fit.free": ("sky.background_e",),
        "detector.traps.VV.release_ms": 12,
    })
    said = other.to_dict()
    assert said["detector"]["temperature_k"] == 150.0 and said["readout"]["transfers"] == 800
    assert other.launch == "2012-01-01" == snap.set({"mission.launch": "2012-01-01"}).launch
    assert said["fit"]["free"] == ["sky.background_e"]
    assert snap.launch == "2009-01-01"
    assert cp.Mission.from_toml(other.to_toml()) == other != snap


def test_what_is_refused_says_where_and_what_to_try(snap, tmp_path):
    with pytest.raises(cp.InputError) as refused:
        snap.set({"detector.temperatur_k": 150})
    assert "temperature_k" in refused.value.help and "temperatur_k" in str(refused.value)
    broken = tmp_path / "broken.toml"
    broken.write_text(snap.to_toml().replace("temperature_k = 133.0", "temperature_k = -120.0", 1))
    with pytest.raises(ValueError) as refused:
        cp.Mission.read(broken)
    assert refused.value.place.startswith("line ") and "detector.temperature_k" in refused.value.place
    assert str(broken) in refused.value.refused
    with pytest.raises(TypeError, match="number"):
        snap.set({"detector.temperature_k": object()})
    for wrong in (None, 150j, b"150", [object()]):
        with pytest.raises((TypeError, ValueError)):
            snap.set({"detector.temperature_k": wrong})


def test_missions_can_be_copied_and_sent(snap):
    assert pickle.loads(pickle.dumps(snap)) == snap == copy.deepcopy(snap)
    assert len({snap, copy.copy(snap)}) == 1


def dose(mission):
    return cp.evaluate(mission, samples=0).years[-1]["dose_mev_g"]


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_processes_may_be_started(snap, method):
    with multiprocessing.get_context(method).Pool(2) as pool:
        doses = pool.map(dose, [snap, snap.set({"mission.duration_yr": 2})])
    assert doses[0] == dose(snap) > doses[1]


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(snap):
    before = dose(snap)
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(dose, (snap,)).get(timeout=60) == before


def chi2(mission, data):
    return cp.validate(mission, data).chi2


def test_tables_of_all_kinds_are_the_same_measurements(laboratory):
    read = cp.DataSet.read(PRACTICE / "trails.ecsv", laboratory)
    table = Table.read(PRACTICE / "trails.ecsv", format="ascii.ecsv")
    expected = chi2(laboratory, read)
    assert len(read) == len(table) and read.observable == "trail"
    assert np.array_equal(read.value, table["value"]) and np.array_equal(read.sigma, table["sigma"])
    meta = {key: value for key, value in table.meta.items()}
    columns = {name: np.array(table[name]) for name in table.colnames}
    for given in (table, QTable(table), columns, pandas.DataFrame(columns)):
        more = {} if hasattr(given, "meta") else meta
        assert chi2(laboratory, cp.DataSet.from_table(given, laboratory, **more)) == expected
    assert chi2(laboratory, cp.DataSet.from_table(read.to_table(), laboratory)) == expected


def test_units_of_a_table_are_heeded(laboratory):
    years = {"value": [1e5, 1.1e5], "sigma": [1e3, 1e3], "t_yr": [1.0, 2.0]}
    days = QTable({**years, "t_yr": np.array([365.25, 730.5]) * u.day})
    by_years = cp.DataSet.from_table(years, laboratory, observable="dose")
    by_days = cp.DataSet.from_table(days, laboratory, observable="dose")
    assert chi2(laboratory, by_days) == pytest.approx(chi2(laboratory, by_years), rel=1e-12)
    differences = (TimeDelta([365.25, 730.5], format="jd"), TimeDelta([365.25 * 86400, 730.5 * 86400], format="sec"))
    for difference in (*differences, pandas.to_timedelta([365.25, 730.5], unit="D")):
        given = cp.DataSet.from_table({**years, "t_yr": difference}, laboratory, observable="dose")
        assert chi2(laboratory, given) == pytest.approx(chi2(laboratory, by_years), rel=1e-12)
    first = {"value": [1e5], "sigma": [1e3]}
    in_utc = cp.DataSet.from_table({**first, "date": Time(["2010-01-01"])}, laboratory, observable="dose")
    for date in (Time(["2010-01-01"]).tt, Time(Time(["2010-01-01"]), format="jyear")):
        given = cp.DataSet.from_table({**first, "date": date}, laboratory, observable="dose")
        assert chi2(laboratory, given) == pytest.approx(chi2(laboratory, in_utc), rel=1e-9)
    with pytest.raises(cp.InputError, match="SkyCoord"):
        cp.DataSet.from_table({**first, "sky": SkyCoord([1] * u.deg, [2] * u.deg)}, laboratory, observable="dose")
    dated = QTable({"value": [1e5], "sigma": [1e3], "date": Time(["2010-01-01"])})
    assert len(cp.DataSet.from_table(dated, laboratory, observable="dose")) == 1


def test_tables_that_are_none_are_refused(laboratory):
    with pytest.raises(cp.InputError):
        cp.DataSet.from_table({"value": [1.0], "sigma": [1.0, 2.0]}, laboratory, observable="trail")
    with pytest.raises(cp.InputError, match="observable"):
        cp.DataSet.from_table({"value": [1.0], "sigma": [1.0]}, laboratory)
    with pytest.raises(cp.InputError, match="sigma"):
        cp.DataSet.from_table({"value": [1.0, 2.0], "sigma": [1.0, -2.0]}, laboratory, observable="trail", signal_e=1e3)
    with pytest.raises(TypeError):
        cp.DataSet.from_table(3, laboratory)


def test_entries_of_meta_of_any_scalar_kind_hold(laboratory):
    columns = {"value": [1500.0, 1400.0], "sigma": [1.0, 1.0], "transfers": [400, 800]}
    meta = {"observable": "packet_charge", "signal_e": 1620.0, "t_yr": 1.0, "background_e": 50.0}
    expected = chi2(laboratory, cp.DataSet.from_table(columns, laboratory, **meta))
    for name, same in (
        ("background_e", np.float32(50)),
        ("background_e", np.int64(50)),
        ("background_e", 50 * u.electron),
        ("t_yr", 365.25 * u.day),
    ):
        assert chi2(laboratory, cp.DataSet.from_table(columns, laboratory, **{**meta, name: same})) == expected
    dated = {**meta, "date": datetime.date(2011, 1, 1)}
    del dated["t_yr"]
    assert len(cp.DataSet.from_table(columns, laboratory, **dated)) == 2
    with pytest.raises(TypeError, match="background_e"):
        cp.DataSet.from_table(columns, laboratory, **{**meta, "background_e": object()})
    indexed = pandas.DataFrame(columns).set_index("transfers")
    assert chi2(laboratory, cp.DataSet.from_table(indexed, laboratory, **meta)) == expected


def test_slips_are_named(laboratory):
    data = cp.DataSet.read(PRACTICE / "trails.ecsv", laboratory)
    for wrong in (lambda: cp.evaluate("mission.toml"), lambda: cp.compare("mission.toml"), lambda: cp.Mission("mission.toml")):
        with pytest.raises(TypeError, match="Mission.read"):
            wrong()
    with pytest.raises(TypeError, match="DataSet.read"):
        cp.validate(laboratory, "trails.ecsv")
    for ask in (cp.validate, cp.diagnose):
        with pytest.raises(cp.InputError, match="no measurements"):
            ask(laboratory, [])
    for wrong in ({"samples": -1}, {"samples": 10**15}, {"confidence": 1}, {"seed": -1}, {"monte_carlo": 1}):
        with pytest.raises(cp.InputError, match=next(iter(wrong))):
            cp.evaluate(laboratory, **wrong)
    one = cp.fit(laboratory, data, "detector.traps.VV.density_per_px")
    assert [each.key for each in one.parameters] == ["detector.traps.VV.density_per_px"]
    for threads in (-1, 10**6):
        with pytest.raises(cp.InputError, match="threads"):
            cp.set_threads(threads)
