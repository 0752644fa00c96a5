"""Arrays → measurements → the model's parameters."""

import datetime
import pickle

import numpy as np
import pytest
from astropy.io import fits

import ctiplan as cp


@pytest.fixture(scope="module")
def flat(snap):
    """A flat field of 1000 e-, 300 rows and 40 of overscan, read out at the dose of 40 MeV/g x 10^6; in DN, with bias and noise."""
    random = np.random.default_rng(3)
    charge = np.zeros((340, 200))
    charge[:300] = random.poisson(1000.0, (300, 200))
    detector = snap.detector_at(t_yr=1.0, dose_mev_g=4e7)
    read = detector.readout(charge, overscan_rows=40)
    return (read + random.normal(0.0, 3.0, read.shape)) / 1.5 + 200.0


def test_an_edge_is_that_of_the_model(snap, flat):
    measured = cp.measure.eper(flat, overscan_start=300, gain=1.5, bias=200.0, t_yr=1.0, level_rows=20, trail_px=5)
    table = measured.to_table()
    assert measured.observable == "eper" and len(table) == 5 and str(table["signal_e"].unit) == "electron"
    assert measured.first_pixel is not None and measured.first_pixel.observable == "packet_charge"
    # The model at the mission's own dose has too few traps, at that of the frame it fits.
    at_dose = cp.measure.eper(flat, overscan_start=300, gain=1.5, bias=200.0, dose_mev_g=4e7, trail_px=5)
    found = cp.validate(snap, at_dose.data_set(snap))
    assert found.rms_sigma < 2.5
    assert cp.validate(snap, measured.data_set(snap)).rms_sigma > 2 * found.rms_sigma


def test_arrays_and_files_are_measured_alike(flat, tmp_path):
    path = tmp_path / "flat.fits"
    fits.writeto(path, flat)
    options = {"gain": 1.5, "bias": 200.0, "date": "2030-06-01", "trail_px": 5}
    from_array = cp.measure.eper(flat, overscan_start=300, **options)
    from_file = cp.measure.eper(path, overscan_rows=40, **options)
    assert np.array_equal(from_array.to_table()["value"], from_file.to_table()["value"])
    both = cp.measure.eper([flat, flat], overscan_rows=40, **(options | {"date": datetime.date(2030, 6, 1)}))
    assert len(both.to_table()) == 2 * len(from_array.to_table())
    turned = cp.measure.eper(flat[::-1, ::-1], overscan_rows=40, corner="ur", **options)
    assert np.allclose(turned.to_table()["value"], from_array.to_table()["value"], rtol=1e-12)


def test_an_edge_tells_cti(snap, flat):
    options = {"overscan_start": 300, "gain": 1.5, "bias": 200.0, "dose_mev_g": 4e7, "trail_px": 7}
    edges = cp.measure.eper(flat, **options)
    assert edges.cti.observable == "cti" and list(edges.cti.to_table()["last_px"].value) == [1, 3, 7]
    charge = edges.to_table()
    one = cp.measure.eper(flat, cti_px=[(1, 2)], **options).cti.to_table()
    sum_e = charge["value"][:2].sum()
    assert one["value"][0] == pytest.approx((sum_e / charge["signal_e"][0] / 300).value)
    assert cp.validate(snap, edges.cti.data_set(snap)).rms_sigma < 2.5
    back = pickle.loads(pickle.dumps(edges))
    assert back.to_ecsv() == edges.to_ecsv() and back.cti.to_ecsv() == edges.cti.to_ecsv() and str(back) == str(edges)
    with pytest.raises(cp.InputError, match="pixels 2 to 9"):
        cp.measure.eper(flat, cti_px=[(2, 9)], **options)


def test_amplifiers_of_a_table(flat, tmp_path):
    both = np.hstack([flat, flat[:, ::-1]])
    table = tmp_path / "amplifiers.csv"
    table.write_text(
        "hdu,amplifier,corner,section,overscan_rows,gain_e_per_dn,bias_dn\n"
        '0,A,lower-left,"[1:200,1:340]",40,1.5,200\n0,B,lower-right,"[201:400,1:340]",40,1.5,200\n'
    )
    found = cp.measure.eper(both, amplifiers=table, t_yr=1.0, trail_px=5)
    alone = cp.measure.eper(flat, overscan_rows=40, gain=1.5, bias=200.0, t_yr=1.0, trail_px=5).to_table()
    assert list(found.to_table()["amplifier"]) == [1] * 5 + [2] * 5
    assert np.array_equal(found.to_table()["value"], np.tile(alone["value"], 2))
    with pytest.raises(TypeError, match="gain is told by the table"):
        cp.measure.eper(both, amplifiers=table, gain=1.5, t_yr=1.0)


def test_what_cannot_be_measured_is_refused(flat):
    with pytest.raises(cp.InputError, match="overscan"):
        cp.measure.eper(flat, gain=1.5, bias=200.0, t_yr=1.0)
    with pytest.raises(cp.InputError, match="gain"):
        cp.measure.eper(flat, overscan_start=300, bias=200.0, t_yr=1.0)
    with pytest.raises(cp.InputError, match="overscan_start"):
        cp.measure.eper(flat, overscan_start=340, gain=1.5, t_yr=1.0)
    with pytest.raises(TypeError, match="overscn"):
        cp.measure.eper(flat, overscn=3)
    with pytest.raises(ValueError, match="shape"):
        cp.measure.trails(np.zeros(3))
    with pytest.raises(cp.InputError, match="none.fits"):
        cp.measure.dipoles("none.fits", gain=1.0)
    with pytest.raises(cp.InputError, match="period_px"):
        cp.measure.injection(flat, first_row=0, block_px=10, period_px=10)
    with pytest.raises(cp.InputError, match="there are none"):
        cp.measure.eper([], gain=1.5, t_yr=1.0)


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("eper", {"trail_px": 0}),
        ("eper", {"overscan_start": 300.0}),
        ("eper", {"level_rows": "many"}),
        ("eper", {"cti_px": [(1, 2, 3)]}),
        ("trails", {"trail_px": 2.5}),
        ("trails", {"threshold_e": -1.0}),
        ("injection", {"column_groups": None, "first_row": 0.5, "block_px": 2, "period_px": 9}),
        ("dipoles", {"found_in": 0}),
        ("dipoles", {"threshold_sigma": "six"}),
    ],
)
def test_options_out_of_range_are_refused_by_name(flat, kind, options):
    with pytest.raises(cp.InputError) as refused:
        getattr(cp.measure, kind)(flat, gain=1.5, bias=200.0, t_yr=1.0, **options)
    assert any(name in str(refused.value) for name in options)
    assert "Way" not in str(refused.value)


def test_help_names_keywords_not_options(flat):
    with pytest.raises(cp.InputError) as refused:
        cp.measure.eper(flat, gain=1.5, overscan_start=300)
    assert "--" not in str(refused.value)
    assert "give date" in refused.value.help and "t_yr" in refused.value.help


def test_flats_that_brighten_and_a_bias_that_drifts(flat):
    options = {"gain": 1.5, "t_yr": 1.0, "trail_px": 5}
    sloped = flat.copy()
    sloped[:300] = 200.0 + (sloped[:300] - 200.0) * np.linspace(1.05, 1.0, 300)[:, np.newaxis]
    measured = cp.measure.eper(sloped, overscan_start=300, bias=200.0, **options)
    assert any("brighter at its first row" in warning for warning in measured.document["warnings"])
    level, first = measured.to_table()["signal_e"][0], measured.first_pixel.to_table()["signal_e"][0]
    assert (first / level).value == pytest.approx(1.05, abs=0.005)
    overscan = np.random.default_rng(4).normal(200.0, 2.0, (340, 8))
    steady = cp.measure.eper(np.hstack([flat, overscan]), overscan=8, overscan_rows=40, **options)
    assert steady.document["warnings"] == []

    def drifting(bias):
        """The same with a bias that drifts in all columns."""
        frame = np.hstack([flat, overscan]) + bias[:, np.newaxis]
        return cp.measure.eper(frame, overscan=8, overscan_rows=40, **options)

    evenly = drifting(np.linspace(0.0, 3.0, 340))
    assert evenly.document["warnings"] == []
    assert evenly.document["exposures"][0]["bias_slope_dn_per_row"] == pytest.approx(3.0 / 339, rel=0.05)
    # Five values and their errors, with a line that has an error as well.
    steady_e, even_e = steady.to_table()["value"].value, evenly.to_table()["value"].value
    assert np.all(np.abs(even_e - steady_e) < 3 * evenly.to_table()["sigma"].value)
    bent = drifting(6.0 * np.linspace(0.0, 1.0, 340) ** 4)
    assert any("off a straight line" in warning for warning in bent.document["warnings"])
    dark = np.hstack([flat + 0.5, overscan])
    rest = cp.measure.eper(dark, overscan=8, overscan_rows=40, **options)
    assert any("above the bias and do not fall" in warning for warning in rest.document["warnings"])


def test_flagged_pixels_are_left_out(flat, tmp_path):
    hit = flat.copy()
    hit[320, ::10] += 3.0
    flags = np.zeros(flat.shape, dtype=np.int16)
    flags[320, ::10] = 4096
    path = tmp_path / "flt.fits"
    frame, quality = fits.ImageHDU(hit, name="SCI", ver=1), fits.ImageHDU(flags, name="DQ", ver=1)
    fits.HDUList([fits.PrimaryHDU(), frame, quality]).writeto(path)
    options = {"overscan_rows": 40, "gain": 1.5, "bias": 200.0, "t_yr": 1.0}
    # Too faint to be clipped.
    missing = np.where(flags == 0, hit, np.nan)
    without, with_all = (cp.measure.eper(frame, **options).to_table()["value"] for frame in (missing, hit))
    assert not np.array_equal(without, with_all)
    assert np.array_equal(cp.measure.eper(path, dq_bad=4096, **options).to_table()["value"], without)
    assert np.array_equal(cp.measure.eper(path, dq_bad=16, **options).to_table()["value"], with_all)
    with pytest.raises(cp.InputError, match="arrays have no data quality"):
        cp.measure.eper(hit, dq_bad=4096, **options)


def test_a_bias_fills_in_for_a_table_without_one(flat, tmp_path):
    table = tmp_path / "amplifiers.csv"
    table.write_text("amplifier,hdu,corner,overscan_rows,gain_e_per_dn\nA,0,lower-left,40,1.5\n")
    with pytest.raises(cp.InputError, match="no bias is known"):
        cp.measure.eper(flat, amplifiers=table, t_yr=1.0, bias_from="columns")
    of_table = cp.measure.eper(flat, amplifiers=table, bias=200.0, t_yr=1.0).to_table()
    alone = cp.measure.eper(flat, overscan_rows=40, gain=1.5, bias=200.0, t_yr=1.0).to_table()
    assert np.array_equal(of_table["value"], alone["value"])
