"""ctiplan.arctic beside arcticpy 2.6: values made by tests/golden/arcticpy_api.py, whose cases are read here."""

import importlib.util
import inspect

import numpy as np
import pytest
from conftest import ROOT

import ctiplan as cp
from ctiplan import arctic

ORACLE = ROOT / "tests" / "golden" / "arcticpy_api.py"
VALUES = ROOT / "python" / "tests" / "data" / "arcticpy_api.npz"


def oracle():
    spec = importlib.util.spec_from_file_location("arcticpy_api", ORACLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CASES = oracle().cases(arctic)

# As a fraction of the largest displacement in the frame: the default, and what a smaller one leaves.
FINE = 1e-7
ARCTICPYS_OWN = {
    # arcticpy's cloud rises once more while capture goes on (tests/golden/effects.py).
    "slow": 1e-4,
    "slow carried": 1e-4,
    # arcticpy's tables of a continuum; and it lets traps of a continuum act after the others.
    "continuum": 1e-4,
}


@pytest.fixture(scope="module")
def golden():
    with np.load(VALUES) as values:
        return dict(values)


@pytest.fixture
def frame():
    return oracle().sky()


EMPTY = arctic.ROE(empty_traps_for_first_transfers=True)
CCD = arctic.CCD(full_well_depth=84700.0, well_fill_power=0.478)
TRAPS = [arctic.TrapInstantCapture(0.6, 0.74), arctic.TrapInstantCapture(1.6, 7.7)]
WORDS = {"parallel_ccd": CCD, "parallel_roe": EMPTY, "parallel_traps": TRAPS}


@pytest.mark.parametrize(("name", "function", "image", "words"), CASES, ids=[case[0] for case in CASES])
def test_frames_are_those_of_arcticpy(golden, name, function, image, words):
    moved = np.abs(golden[name] - image).max()
    assert moved > 0.01, "a case in which nothing moves cannot fail"
    deviation = np.abs(function(image, **words) - golden[name]).max() / moved
    assert deviation <= arctic.ACCURACY, f"{deviation:.1e} of {moved:.3g} e-"
    finely = {"parallel_express": FINE, "serial_express": FINE, **words}
    deviation = np.abs(function(image, **finely) - golden[name]).max() / moved
    assert deviation <= ARCTICPYS_OWN.get(name, 10 * FINE), f"{deviation:.1e} of {moved:.3g} e-"


def test_the_model_of_acs_is_that_of_arcticpy(golden):
    for date, expected in zip(golden["acs dates"], golden["acs traps"], strict=True):
        roe, ccd, traps = arctic.CTI_model_for_HST_ACS(date)
        assert np.allclose([[trap.density, trap.release_timescale] for trap in traps], expected, rtol=1e-8)
        assert (ccd.full_well_depths, ccd.well_fill_powers) == (84700.0, 0.478)
        assert not roe.empty_traps_for_first_transfers
    with pytest.raises(cp.InputError, match="Julian"):
        arctic.CTI_model_for_HST_ACS(2000.0)


def test_names_order_and_defaults_are_those_of_arcticpy():
    # As inspect.signature tells of arcticpy 2.6.
    direction = ["ccd", "roe", "traps", "express", "window_offset", "window_start", "window_stop", "time_start", "time_stop"]
    direction += ["prune_n_electrons", "prune_frequency"]
    both = [f"{name}_{word}" for name in ("parallel", "serial") for word in direction]
    add = ["image", "header", *both, "allow_negative_pixels", "pixel_bounce_list", "verbosity", "iteration"]
    remove = ["image", "n_iterations", "header", *both, "allow_negative_pixels", "pixel_bounce_list", "read_noise", "verbosity"]
    assert list(inspect.signature(arctic.add_cti).parameters) == add
    assert list(inspect.signature(arctic.remove_cti).parameters) == remove
    defaults = {key: each.default for key, each in inspect.signature(arctic.add_cti).parameters.items()}
    assert defaults["parallel_express"] == 0 and defaults["serial_window_stop"] == -1
    assert defaults["parallel_prune_n_electrons"] == 1e-10 and defaults["serial_prune_frequency"] == 20
    assert defaults["allow_negative_pixels"] == 1 and defaults["verbosity"] == 1
    expected = {
        "CCDPhase": {"full_well_depth": 1e4, "well_notch_depth": 0.0, "well_fill_power": 1.0, "first_electron_fill": 0.0},
        "ROE": {
            "dwell_times": 1.0,
            "prescan_offset": 0,
            "overscan_start": -1,
            "empty_traps_between_columns": True,
            "empty_traps_for_first_transfers": False,
            "force_release_away_from_readout": True,
            "use_integer_express_matrix": False,
            "pixel_bounce_kA": 0.0,
            "pixel_bounce_kv": 0.0,
            "pixel_bounce_omega": 1.0,
            "pixel_bounce_gamma": 1.0,
        },
        "TrapInstantCapture": {
            "density": 1.0,
            "release_timescale": 1.0,
            "fractional_volume_none_exposed": 0.0,
            "fractional_volume_full_exposed": 0.0,
        },
        "TrapSlowCapture": {"density": 1.0, "release_timescale": 1.0, "capture_timescale": 0.0},
        "TrapInstantCaptureContinuum": {"density": 1.0, "release_timescale": 1.0, "release_timescale_sigma": 0.0},
        "TrapSlowCaptureContinuum": {
            "density": 1.0,
            "release_timescale": 1.0,
            "release_timescale_sigma": 0.0,
            "capture_timescale": 0.0,
        },
    }
    for name, values in expected.items():
        made = getattr(arctic, name)
        assert list(inspect.signature(made).parameters) == list(values)
        assert {key: getattr(made(), key) for key in values} == values
    assert list(inspect.signature(arctic.CCD).parameters) == [
        "phases",
        "fraction_of_traps_per_phase",
        *expected["CCDPhase"],
    ]


def test_every_public_name_of_arcticpy_exists():
    for name, attributes in oracle().PUBLIC.items():
        assert name in arctic.__all__, name
        there = getattr(arctic, name)
        for attribute in attributes.split():
            assert hasattr(there(), attribute), f"{name}.{attribute}"
    assert set(arctic.__all__) == set(oracle().PUBLIC)


@pytest.mark.parametrize("name", ["PixelBounce", "ReadNoise", "ROETrapPumping", "add_pixel_bounce", "remove_pixel_bounce"])
def test_what_is_not_modelled_says_so(name):
    with pytest.raises(NotImplementedError, match=f"{name} is not modelled here"):
        getattr(arctic, name)()


@pytest.mark.parametrize(("density", "release", "value"), oracle().DELTA_ELLIPTICITY)
def test_the_change_of_ellipticity_is_that_of_arcticpy(density, release, value):
    assert arctic.TrapInstantCapture(density, release).delta_ellipticity == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(("pixels", "seed", "value"), oracle().POISSON_DENSITIES)
def test_a_density_of_counted_traps_is_that_of_arcticpy(pixels, seed, value):
    traps = arctic.TrapInstantCapture(1.6, 7.7, 0.1, 0.3)
    drawn = traps.poisson_density_from(total_pixels=pixels, seed=seed)
    assert drawn.density == value
    assert {**vars(drawn), "density": 1.6} == vars(traps)


def test_densities_of_counted_traps_scatter_as_counts_do():
    traps = arctic.TrapInstantCapture(0.5, 7.7)
    drawn = np.array([traps.poisson_density_from(200, seed).density for seed in range(400)])
    # A count of 100 scatters by 10; 400 of them know their mean to 0.5 and their scatter to 4 %.
    assert drawn.mean() == pytest.approx(0.5, abs=4 * 0.0025)
    assert drawn.std() == pytest.approx(0.05, rel=0.15)
    with pytest.raises(cp.InputError, match="total_pixels"):
        traps.poisson_density_from(0)


def test_an_accuracy_may_be_asked_for(frame):
    exact = arctic.add_cti(frame, **WORDS, parallel_express=1e-12)
    moved = np.abs(exact - frame).max()
    errors = [np.abs(arctic.add_cti(frame, **WORDS, parallel_express=wanted) - exact).max() for wanted in (1e-2, 1e-7)]
    assert errors[0] <= 1e-2 * moved and errors[1] <= 1e-7 * moved
    for express, wanted in ((0, arctic.ACCURACY), (1, arctic.GATHERED), (5, arctic.GATHERED), (600, arctic.GATHERED)):
        assert np.abs(arctic.add_cti(frame, **WORDS, parallel_express=express) - exact).max() <= wanted * moved


def test_without_traps_nothing_changes(frame):
    none = [arctic.TrapInstantCapture(density=0.0)]
    for roe in (EMPTY, arctic.ROE(), arctic.ROE(empty_traps_between_columns=False), arctic.ROE(overscan_start=9)):
        assert np.array_equal(arctic.add_cti(frame, parallel_ccd=CCD, parallel_roe=roe, parallel_traps=none), frame)
    assert np.array_equal(arctic.add_cti(frame), frame)
    assert np.array_equal(arctic.add_cti(frame, parallel_ccd=CCD, parallel_roe=EMPTY, parallel_traps=[]), frame)
    assert np.array_equal(arctic.remove_cti(frame, 5), frame)
    assert np.array_equal(arctic.remove_cti(frame, 0, **WORDS), frame)


def test_of_three_phases_less_is_trailed(frame):
    # One that is over no packet but the next gives part of its electrons back to the packet that has left.
    ccd = arctic.CCD([arctic.CCDPhase(84700.0, 0.0, 0.478)] * 3, [1 / 3] * 3)
    for empty in (True, False):
        one = arctic.add_cti(frame, **{**WORDS, "parallel_roe": arctic.ROE(empty_traps_for_first_transfers=empty)})
        roe = arctic.ROE(dwell_times=[1 / 3] * 3, empty_traps_for_first_transfers=empty)
        three = arctic.add_cti(frame, **{**WORDS, "parallel_ccd": ccd, "parallel_roe": roe})
        assert 0.1 < np.abs(three - frame).sum() / np.abs(one - frame).sum() < 1.0


@pytest.mark.parametrize("name", ["parallel", "serial"])
def test_charge_is_conserved_behind_empty_traps(frame, name):
    room = np.pad(frame, ((0, 300), (0, 0)))
    room = room if name == "parallel" else room.T
    # With this power even the last electrons are not caught again and again.
    words = {f"{name}_ccd": arctic.CCD(full_well_depth=84700.0), f"{name}_roe": EMPTY, f"{name}_traps": TRAPS}
    change = arctic.add_cti(room, **words) - room
    assert abs(change.sum()) < 1e-9 * np.abs(change).sum()


def test_rows_are_columns_of_the_turned_frame(frame):
    for roe in (EMPTY, arctic.ROE(), arctic.ROE(empty_traps_between_columns=False)):
        parallel = arctic.add_cti(frame, parallel_ccd=CCD, parallel_roe=roe, parallel_traps=TRAPS)
        serial = arctic.add_cti(frame.T, serial_ccd=CCD, serial_roe=roe, serial_traps=TRAPS).T
        assert np.array_equal(parallel, serial)


def test_what_is_added_is_removed(frame):
    for roe in (EMPTY, arctic.ROE()):
        words = {**WORDS, "parallel_roe": roe, "parallel_express": 1e-9}
        trailed = arctic.add_cti(frame, **words)
        assert np.abs(arctic.remove_cti(trailed, 12, **words) - frame).max() < 1e-6 * np.abs(trailed - frame).max()


def test_any_real_array_is_taken_and_left_as_it_is(frame):
    expected = arctic.add_cti(frame, **WORDS)
    assert expected.dtype == np.float64 and expected.shape == frame.shape
    wide = np.zeros((2 * frame.shape[0], 2 * frame.shape[1]))
    wide[::2, ::2] = frame
    read_only = frame.copy()
    read_only.flags.writeable = False
    for given in (
        frame.astype(np.float32),
        frame.astype(np.int32),
        frame.astype(np.uint16),
        frame.astype(">f8"),
        np.asfortranarray(frame),
        wide[::2, ::2],
        frame[::-1, ::-1].copy()[::-1, ::-1],
        read_only,
        frame.tolist(),
    ):
        before = np.array(given, copy=True)
        assert np.array_equal(arctic.add_cti(given, **WORDS), expected)
        assert np.array_equal(given, before)


def test_a_header_says_what_was_done(frame):
    header = {}
    arctic.add_cti(frame, header=header, **WORDS)
    assert set(header) == {"CTICOR", "CTIPAR"} and cp.__version__ in header["CTICOR"]
    header = {}
    arctic.remove_cti(frame, 1, header, serial_ccd=CCD, serial_roe=EMPTY, serial_traps=TRAPS)
    assert set(header) == {"CTICOR", "CTISER"}


@pytest.mark.parametrize(
    ("words", "exception", "said"),
    [
        ({"parallel_roe": None}, cp.InputError, "parallel_roe"),
        ({"parallel_ccd": None}, cp.InputError, "parallel_ccd"),
        ({"parallel_traps": TRAPS[0]}, TypeError, "list of traps"),
        ({"parallel_traps": [3.0]}, TypeError, "float"),
        ({"parallel_traps": TRAPS * 65}, cp.InputError, "at most 128"),
        ({"parallel_traps": [arctic.TrapInstantCapture(-1.0)]}, cp.InputError, "density = -1"),
        ({"parallel_traps": [arctic.TrapInstantCapture(np.nan)]}, cp.InputError, "density = nan"),
        ({"parallel_traps": [arctic.TrapInstantCapture("many")]}, TypeError, "many"),
        ({"parallel_traps": [arctic.TrapInstantCapture(1.0, -1.0)]}, cp.InputError, "release_timescale"),
        ({"parallel_traps": [arctic.TrapInstantCapture(1.0, 1.0, 0.5, 0.2)]}, cp.InputError, "full_exposed"),
        ({"parallel_ccd": arctic.CCD(full_well_depth=10.0, well_notch_depth=20.0)}, cp.InputError, "more than 20"),
        ({"parallel_ccd": arctic.CCD(well_fill_power=0.0)}, cp.InputError, "well_fill_power"),
        ({"parallel_ccd": arctic.CCD(first_electron_fill=1.0)}, cp.InputError, "first_electron_fill"),
        ({"parallel_ccd": arctic.CCD([arctic.CCDPhase()] * 3, [0.3] * 3)}, cp.InputError, "3 phases"),
        ({"parallel_roe": arctic.ROE(dwell_times=[0.0])}, cp.InputError, "dwell_times"),
        ({"parallel_roe": arctic.ROE(prescan_offset=-1)}, cp.InputError, "prescan_offset"),
        ({"parallel_roe": arctic.ROE(overscan_start=0)}, cp.InputError, "overscan_start"),
        ({"parallel_window_start": 2.5}, TypeError, "2.5"),
        ({"parallel_window_start": 30, "parallel_window_stop": 20}, cp.InputError, "window"),
        ({"parallel_window_stop": 51}, cp.InputError, "50"),
        ({"serial_window_start": -1}, cp.InputError, "serial_window_start"),
        ({"parallel_express": -1}, cp.InputError, "express"),
        ({"pixel_bounce_list": [object()]}, NotImplementedError, "bounce"),
        (
            {
                "parallel_ccd": arctic.CCD([arctic.CCDPhase(1e4), arctic.CCDPhase(2e4)], [0.5] * 2),
                "parallel_roe": arctic.ROE(dwell_times=[0.5, 0.5]),
            },
            NotImplementedError,
            "wells differ",
        ),
        (
            {"parallel_traps": [arctic.TrapSlowCapture(1.0, 1.0, 0.1)], "parallel_roe": arctic.ROE(overscan_start=9)},
            cp.InputError,
            "overscan_start",
        ),
        (
            {"parallel_traps": [arctic.TrapSlowCapture(1.0, 1.0, 0.1)], "parallel_roe": arctic.ROEChargeInjection()},
            cp.InputError,
            "no charge injection",
        ),
    ],
)
def test_what_cannot_be_used_is_refused_in_words(frame, words, exception, said):
    for function in (arctic.add_cti, lambda image, **words: arctic.remove_cti(image, 2, **words)):
        with pytest.raises(exception, match=said):
            function(frame, **{**WORDS, **words})


def test_frames_that_are_none_are_refused(frame):
    with pytest.raises(ValueError, match="shape"):
        arctic.add_cti(frame[:, 0], **WORDS)
    with pytest.raises(TypeError, match="complex"):
        arctic.add_cti(frame.astype(complex), **WORDS)
    with pytest.raises(cp.InputError, match="n_iterations"):
        arctic.remove_cti(frame, -1, **WORDS)
    with pytest.raises(NotImplementedError, match="read_noise"):
        arctic.remove_cti(frame, 1, read_noise=object(), **WORDS)
    for shape in ((0, 3), (3, 0)):
        for roe in (EMPTY, arctic.ROE(), arctic.ROE(empty_traps_between_columns=False, overscan_start=5)):
            assert arctic.add_cti(np.zeros(shape), **{**WORDS, "parallel_roe": roe}).shape == shape


def test_charge_that_is_none_stays_in_its_column(frame):
    for hole in (np.nan, np.inf):
        for roe in (EMPTY, arctic.ROE(), arctic.ROE(overscan_start=40)):
            words = {**WORDS, "parallel_roe": roe}
            broken = frame.copy()
            broken[12, 2] = hole
            found, expected = arctic.add_cti(broken, **words), arctic.add_cti(frame, **words)
            others = [0, 1, 3, 4, 5, 6]
            assert np.abs(found - expected)[:, others].max() <= 1e-4 * np.abs(expected - frame).max()


def test_the_first_column_does_not_depend_on_traps_between_columns():
    # The packets of 1 and 8 e- give the traps all they have, and leave layers of equal volume: what the next one fills was lost once.
    column = np.array([[2.0, -12.0, -4.0, 1.0, 8.0, 1206.0]]).T
    traps, ccd = [arctic.TrapInstantCapture(2.0, 0.6)], arctic.CCD(full_well_depth=6e4, well_fill_power=0.42)
    roes = [arctic.ROE(prescan_offset=400, empty_traps_between_columns=empty) for empty in (True, False)]
    alone, joined = (arctic.add_cti(column, parallel_traps=traps, parallel_ccd=ccd, parallel_roe=roe) for roe in roes)
    # arcticpy 2.6, both.
    expected = [1.9737, -3.4197, -2.3754, 0.0, 0.0, 1061.9839]
    assert np.abs(joined[:, 0] - expected).max() < 1e-4
    assert np.abs(alone[:, 0] - expected).max() < 2e-5 * 144.0
