"""The five questions give what the command line gives, as objects."""

import copy
import datetime
import json
import multiprocessing
import pickle
import subprocess
import sys

import numpy as np
import pytest
from astropy import units as u

import ctiplan as cp
from conftest import PRACTICE, ROOT


def command(*arguments, **more):
    run = [sys.executable, "-c", "import sys; from ctiplan._command import main; sys.exit(main())", *map(str, arguments)]
    return subprocess.run(run, capture_output=True, text=True, **more)


def printed(*arguments):
    done = command(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_an_evaluation_is_that_of_the_command(snap):
    evaluation = cp.evaluate(snap, samples=100)
    assert evaluation.document == printed("evaluate", ROOT / "missions/snap_l2.toml", "--samples", 100)
    crossing = evaluation.verdict.uncorrected
    assert crossing.exceeded and crossing.date == datetime.date(2012, 10, 22)
    assert evaluation.verdict.corrected.t_yr is None
    assert evaluation.passes and evaluation.galaxy == "faint"
    assert str(crossing.date) in str(evaluation)


def test_tables_carry_units(snap):
    evaluation = cp.evaluate(snap, samples=0)
    table = evaluation.to_table()
    assert table["t_yr"].unit == u.yr and table["dose_mev_g"].unit == u.MeV / u.g
    assert table["traps_per_px"].unit == 1 / u.pix and table["delta_y_px"].unit == u.pix
    assert table["delta_e1"].unit in (None, u.dimensionless_unscaled)
    last = evaluation.years[-1]
    faint = table[(table["galaxy"] == "faint") & (table["t_yr"] == 5 * u.yr)]
    assert faint["delta_e1"] == last["galaxies"][0]["delta_e1"]
    frame = evaluation.to_pandas()
    assert list(frame.columns) == table.colnames and len(frame) == len(table)


def test_a_page_and_figures_are_those_of_the_command(snap, tmp_path):
    evaluation = cp.evaluate(snap, samples=100)
    assert evaluation.to_html(tmp_path / "python.html") is None
    page = evaluation.to_html()
    done = command("evaluate", ROOT / "missions/snap_l2.toml", "--samples", "100", "--html", tmp_path / "command.html")
    assert done.returncode == 0
    assert page == (tmp_path / "command.html").read_text() == (tmp_path / "python.html").read_text()
    assert "iframe" in evaluation._repr_html_() and "snap" in evaluation._repr_html_().lower()
    figures = evaluation.figures("png")
    assert {"shape", "dose", "traps"} <= set(figures) and figures["shape"].startswith(b"\x89PNG")


def test_a_comparison_is_that_of_the_command(snap):
    comparison = cp.compare(snap, {"readout.line_time_ms": [5, 25], "mission.launch": ["2009-01-01", "2012-01-01"]})
    path = ROOT / "missions/snap_l2.toml"
    same = printed("compare", path, "--line-time-ms", "5,25", "--launch", "2009-01-01,2012-01-01")
    by_command = [(s["settings"], s["delta_e"]) for s in same["scenarios"]]
    by_python = [(s["settings"], s["delta_e"]) for s in comparison.scenarios]
    key = lambda pair: (pair[0]["mission.launch"], pair[0]["readout.line_time_ms"])
    assert sorted(by_python, key=key) == sorted(by_command, key=key)
    assert len(comparison.to_table()) == 4


def test_a_validation_is_that_of_the_command(laboratory, data):
    validation = cp.validate(laboratory, data)
    names = ["mission.toml", "packets.ecsv", "trails.ecsv"]
    assert validation.chi2 == printed("validate", *(PRACTICE / name for name in names))["chi2"]
    assert np.isclose(np.sum(validation.residuals**2), validation.chi2) and len(validation.residuals) == validation.n


def test_a_fit_has_a_covariance_and_a_mission(laboratory, data):
    free = ["detector.traps.VV.density_per_px", "detector.traps.Ci.density_per_px"]
    told = []
    fitted = cp.fit(laboratory, data, free, progress=lambda *now: told.append(now))
    assert [each.key for each in fitted.parameters] == free
    sigma = np.array([each.sigma for each in fitted.parameters])
    assert np.allclose(np.sqrt(np.diag(fitted.covariance)), sigma) and np.allclose(fitted.covariance, fitted.covariance.T)
    assert cp.validate(fitted.mission, data).chi2 == pytest.approx(fitted.chi2, rel=1e-9)
    assert told and told[-1][0].startswith("chi2")


@pytest.fixture(scope="module")
def diagnosed(laboratory, data):
    """A diagnosis, and the stages that it reported."""
    stages = []
    return cp.diagnose(laboratory, data, stability=False, progress=lambda *now: stages.append(now)), stages


def test_a_diagnosis_finds_the_missing_effect(diagnosed, data):
    diagnosis, stages = diagnosed
    assert (diagnosis.verdict, diagnosis.added) == ("missing", ("extra-species",))
    assert [rung.effect for rung in diagnosis.ladder] == [None, "extra-species"]
    assert diagnosis.ladder[1].chi2 < diagnosis.ladder[0].chi2
    # The mission that was found has the chi2 of the ladder, but for the digits of its values.
    assert diagnosis.ladder[1].chi2 <= cp.validate(diagnosis.mission, data).chi2 < diagnosis.ladder[1].chi2 + 1
    assert len({stage for stage, _, _ in stages}) > 1


def test_the_command_is_installed():
    assert command("--version").stdout == f"ctiplan {cp.__version__}\n"
    refused = command("evaluate", "none.toml")
    assert refused.returncode == 2 and "none.toml" in refused.stderr and not refused.stdout


@pytest.fixture(scope="module")
def results(snap, laboratory, data, diagnosed):
    """A result of each question."""
    return [
        cp.evaluate(snap, samples=20),
        cp.compare(snap, {"readout.line_time_ms": [5, 25]}),
        cp.validate(laboratory, data),
        cp.fit(laboratory, data, free=["detector.traps.VV.density_per_px"]),
        diagnosed[0],
    ]


def test_results_can_be_pickled(results):
    for result in results:
        for back in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
            assert type(back) is type(result) and repr(back) == repr(result) and str(back) == str(result)
            assert back.document == result.document and back.to_json() == result.to_json()
            assert back.to_csv() == result.to_csv() and back.to_html() == result.to_html()
            assert back.figures() == result.figures() and back._repr_html_() == result._repr_html_()
            if hasattr(result, "parameters"):
                assert back.mission == result.mission
            again = pickle.loads(pickle.dumps(back))
            assert again.to_json() == result.to_json()
            with pytest.raises(cp.InputError, match="figures as svg"):
                back.figures("pdf")


def ask(kelvin):
    return cp.evaluate(cp.Mission.read(ROOT / "missions" / "snap_l2.toml").set({"detector.temperature_k": kelvin}), samples=20)


def test_results_come_back_from_other_processes():
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.map(ask, [140, 150])
    for kelvin, result in zip([140, 150], found):
        assert result.to_json() == ask(kelvin).to_json()


def test_nothing_is_replaced_unasked(snap, tmp_path):
    page, mission = tmp_path / "page.html", tmp_path / "mission.toml"
    evaluation = cp.evaluate(snap, samples=0)
    for path, write in [(page, evaluation.to_html), (mission, snap.write)]:
        write(path)
        first = path.read_text()
        path.write_text("of another day")
        with pytest.raises(cp.InputError) as refused:
            write(path)
        assert "overwrite" in refused.value.help and path.read_text() == "of another day"
        write(path, overwrite=True)
        assert path.read_text() == first
    assert sorted(tmp_path.iterdir()) == [mission, page]


def test_data_follow_the_mission_that_is_asked(laboratory, data):
    other = laboratory.set({"fit.floor": 0.1})
    again = [cp.DataSet.read(PRACTICE / name, other) for name in ("packets.ecsv", "trails.ecsv")]
    assert cp.validate(other, data).document["chi2"] == cp.validate(other, again).document["chi2"]
