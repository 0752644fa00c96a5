#!/usr/bin/env python3
"""Golden shear biases of a small population: writes population.json and population.csv beside this file.

Made by   arcticpy 2.6 (public add_cti, express = 0), GalSim 2.8.5, numpy 1.26.4 (Python 3.11); 2 min on one core
Command   python tests/golden/population.py

The chain
    An independent chain from a galaxy to a shear bias: GalSim draws a Sersic galaxy of distortion (e1, e2), sheared by
    (+-G, 0) before the PSF, through a Moffat PSF, integrated over pixels; ArCTIc follows every transfer; GalSim takes the moments
    (galsim.utilities.unweighted_moments of the image times a round Gaussian weight, its centre iterated). Detector and
    traps are SNAP's (packets.py) after 5 yr. Stamp, background and start of the traps are those of shapes.py; positions are
    4 x 4 per pixel, without any use of symmetry.

        R      = (<e1>(+G) - <e1>(-G)) / 2G                  response, before and after the readout
        c1     = sum w (<delta e1> - S delta e1*) / sum w R  <delta e1> over both shears
        m1     = sum w (R_after - R) / sum w R
        S      = the same difference of <e1> with the PSF sheared by +-G, over that of a star with the same weight

    `c1_error`, `m1_error`: of the finite sample, n/(n - 1) sum of squared residuals. `galaxies` has what each contributes.

How good it is
    Galaxies are good to 1e-5 of the peak, trails are exact; 4 x 4 even positions and those of ctiplan differ by less than 0.3 %
    in c (a cusp where two rows are equally bright). A consumer should ask for 1 % in c and R.
"""
import csv
import os

import numpy as np

from galaxies import HERE, digits, half_width, write_json
from packets import DETECTORS, trail

MADE_BY = "arcticpy 2.6 add_cti (express 0), GalSim 2.8.5, numpy 1.26.4: python tests/golden/population.py"
G = 0.01
POSITIONS = [(i + 0.5) / 4.0 - 0.5 for i in range(4)]
BACKGROUND, FWHM, BETA, STARS = 120.0, 2.91, 3.5, 1e4
YEARS = 5.0 / 110.0
COLUMNS = ("flux_e", "half_light_px", "sersic_index", "e1", "e2", "weight_px", "transfers", "weight")
GALAXIES = [
    (1150.0, 0.45, 4.0, 0.4, 0.0, 5.4, 1650, 1.0),
    (1150.0, 0.45, 4.0, -0.4, 0.0, 5.4, 1650, 1.0),
    (3200.0, 2.9, 4.0, 0.2, 0.3, 5.4, 1200, 1.0),
    (5500.0, 1.0, 1.0, -0.1, -0.3, 5.4, 400, 2.0),
    (2000.0, 2.0, 1.0, 0.1, 0.5, 5.4, 900, 1.5),
    (900.0, 1.5, 2.0, -0.3, 0.1, 5.4, 1500, 0.7),
]
PARAMS = dict(folding_threshold=1e-4, maxk_threshold=1e-5, kvalue_accuracy=1e-6, maximum_fft_size=16384)


def draw(flux, half_light, sersic, e, shear, psf_shear, dx, dy, half):
    import galsim
    params = galsim.GSParams(**PARAMS)
    psf = galsim.Moffat(beta=BETA, fwhm=FWHM, gsparams=params).shear(g1=psf_shear, g2=0.0)
    seen = psf.withFlux(flux)
    if half_light is not None:
        galaxy = galsim.Sersic(n=sersic, half_light_radius=half_light, flux=flux, gsparams=params)
        seen = galsim.Convolve(galaxy.shear(e1=e[0], e2=e[1]).shear(g1=shear, g2=0.0), psf, gsparams=params)
    large = 513
    image = seen.drawImage(nx=large, ny=large, scale=1.0, method="auto", offset=(dx, dy), dtype=np.float64)
    low = large // 2 - half
    return image.array[low:low + 2 * half + 1, low:low + 2 * half + 1].copy()


def e1_of(image, weight_px):
    import galsim
    half = image.shape[0] // 2
    axis = np.arange(image.shape[0], dtype=float) - half
    x, y = axis[None, :], axis[:, None]
    xc = yc = 0.0
    for _ in range(500):
        weighted = galsim.Image(image * np.exp(-((x - xc) ** 2 + (y - yc) ** 2) / (2.0 * weight_px ** 2)), xmin=-half,
                                ymin=-half)
        found = galsim.utilities.unweighted_moments(weighted)
        moved = max(abs(found["Mx"] - xc), abs(found["My"] - yc))
        xc, yc = found["Mx"], found["My"]
        if moved < 1e-9:
            return (found["Mxx"] - found["Myy"]) / (found["Mxx"] + found["Myy"])
    raise RuntimeError("the weighted centroid does not settle")


def over_positions(of):
    return np.mean([of(dx, dy) for dx in POSITIONS for dy in POSITIONS], axis=0)


def before_and_after(flux, half_light, sersic, e, shear, weight, transfers):
    """<e1> before and after the readout."""
    (full_well, notch, power), traps = DETECTORS["p-channel"]
    traps = [(density * YEARS, release) for density, release in traps]
    half = half_width(weight)
    offset = transfers - 1 - half
    empty = trail(np.full((2 * half + 1, 1), BACKGROUND), (full_well, notch, power), traps, offset)

    def at(dx, dy):
        image = draw(flux, half_light, sersic, e, shear, 0.0, dx, dy, half)
        after = trail(image + BACKGROUND, (full_well, notch, power), traps, offset) - empty
        return e1_of(image, weight), e1_of(after, weight)
    return over_positions(at)


def psf_response(flux, half_light, sersic, e, weight):
    half = half_width(weight)
    plus, minus = (over_positions(lambda dx, dy: e1_of(draw(flux, half_light, sersic, e, 0.0, g, dx, dy, half), weight))
                   for g in (G, -G))
    return (plus - minus) / (2.0 * G)


def ratio(weights, values, responses):
    weights, values, responses = map(np.asarray, (weights, values, responses))
    total = (weights * responses).sum()
    found = (weights * values).sum() / total
    left = weights * (values - found * responses) / total
    n = len(weights)
    return found, np.sqrt(n / (n - 1.0) * (left ** 2).sum())


def make():
    with open(os.path.join(HERE, "population.csv"), "w", newline="") as out:
        rows = csv.writer(out, lineterminator="\n")
        rows.writerow(COLUMNS)
        rows.writerows(GALAXIES)
    found = []
    star_response = psf_response(STARS, None, None, None, 5.4)
    for flux, half_light, sersic, e1, e2, weight_px, transfers, weight in GALAXIES:
        e = (e1, e2)
        plus, minus = (before_and_after(flux, half_light, sersic, e, g, weight_px, transfers) for g in (G, -G))
        star = before_and_after(STARS, None, None, None, 0.0, weight_px, transfers)
        found.append({
            "weight": weight,
            "response": (plus[0] - minus[0]) / (2.0 * G), "response_after": (plus[1] - minus[1]) / (2.0 * G),
            "delta_e1": 0.5 * (plus[1] - plus[0] + minus[1] - minus[0]), "star_delta_e1": star[1] - star[0],
            "psf_response": psf_response(flux, half_light, sersic, e, weight_px) / star_response})
        print(found[-1], flush=True)
    weights, responses = [f["weight"] for f in found], [f["response"] for f in found]
    results = {}
    for name, values in (
            ("c1", [f["delta_e1"] for f in found]),
            ("c1_stars", [f["delta_e1"] - f["psf_response"] * f["star_delta_e1"] for f in found]),
            ("m1", [f["response_after"] - f["response"] for f in found])):
        value, error = ratio(weights, values, responses)
        results[name], results[name + "_error"] = digits(value, 7), digits(error, 7)
    print(results)
    galaxies = [{key: digits(value, 8) for key, value in f.items()} for f in found]
    write_json("population.json", dict({"made_by": MADE_BY, "psf_stars_e": STARS}, **results, galaxies=galaxies))


if __name__ == "__main__":
    make()
