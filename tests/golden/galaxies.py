#!/usr/bin/env python3
"""Golden galaxy images and weighted moments: writes galaxies.json beside this file.

Made by   GalSim 2.8.5 with numpy 1.26.4 (Python 3.11); half a minute on one core.
Command   python tests/golden/galaxies.py            writes galaxies.json
          python tests/golden/galaxies.py --check    compares GalSim with a second method (needs scipy, 3 min)

What is drawn
    An untruncated Sersic profile (index n, circularised half-light radius in px, flux in e-), sheared to the
    distortion e1 = (a^2 - b^2)/(a^2 + b^2) at constant area, convolved with an untruncated Moffat PSF (beta, FWHM in
    px), integrated over square pixels of side 1. The stamp is 61 x 61, image_e[y][x]; the galaxy is centred on
    (30 + dx_px, 30 + dy_px), 0-based, an integer being the middle of a pixel. No noise and no background.

How the moments are taken
    On the GalSim pixels in double precision (not the rounded ones), over a square stamp of half-width `moments_half_px`
    = ceil(5 weight_px) round the central pixel:
        w     = exp(-((x - xc)^2 + (y - yc)^2) / (2 weight_px^2)),  w = 1 at its centre
        xc,yc = sum(I w x)/sum(I w), iterated until it moves by less than 1e-12 px
        I_ij  = sum(I w (x_i - xc_i)(x_j - xc_j)) / sum(I w)
        e1 = (Ixx - Iyy)/(Ixx + Iyy), e2 = 2 Ixy/(Ixx + Iyy), size_px = sqrt((Ixx + Iyy)/2), flux_e = sum(I w)
    x_px and y_px are the weighted centroid relative to the central pixel.

How good it is, and the tolerance to ask for
    --check integrates the same profile in real space (no Fourier transform, no GalSim): ten pixels each of five
    different galaxies agree to 2e-7 of the brightest pixel (four of the five to 1.1e-8), a whole stamp to 2.4e-8,
    its moments to 1e-9. With GSParams ten times looser the worst pixel of the five is off by 2.6e-6. Pixels are stored
    to 7 significant digits. A consumer may therefore ask for 1e-5 of the brightest pixel, 1e-5 in e1 and
    e2, 1e-5 px in x and y, 1e-5 (relative) in size and flux, and be sure that any miss is its own. 1e-4 is enough for
    shape errors by CTI (shapes.json), which are themselves wanted to 1 %. Far pixels (< 1e-6 of the peak) are good
    to 1e-8 of the peak but not to a relative error; do not compare them relatively.
"""
import json
import math
import os
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
MADE_BY = "GalSim 2.8.5, numpy 1.26.4: python tests/golden/galaxies.py"

# Drawn on a large image and cropped, so that the FFT's period (at least LARGE px) is far outside the stamp and the
# wings neither fold back nor get lost. GalSim's defaults (folding 5e-3, maxk 1e-3) are wrong by 1.5e-4 of the peak and
# put 1 % errors into the wings; these are good to 2e-7 (see --check).
LARGE = 1025
GSPARAMS = dict(folding_threshold=1e-5, maxk_threshold=1e-6, kvalue_accuracy=1e-7, integration_relerr=1e-8,
                integration_abserr=1e-10, maximum_fft_size=16384)


def draw(sersic_index, half_light_px, e1, fwhm_px, moffat_beta, flux_e, dx_px, dy_px, half_px,
         large=LARGE, gsparams=None):
    """Pixel-integrated galaxy on a (2 half_px + 1)^2 stamp, image[y][x], float64."""
    import galsim
    params = galsim.GSParams(**(GSPARAMS if gsparams is None else gsparams))
    galaxy = galsim.Sersic(n=sersic_index, half_light_radius=half_light_px, flux=flux_e, gsparams=params).shear(e1=e1)
    psf = galsim.Moffat(beta=moffat_beta, fwhm=fwhm_px, gsparams=params)
    seen = galsim.Convolve(galaxy, psf, gsparams=params)
    # method='auto' convolves with the pixel; the image has an odd side, so its true centre is a pixel's middle
    image = seen.drawImage(nx=large, ny=large, scale=1.0, method="auto", offset=(dx_px, dy_px), dtype=np.float64)
    low = large // 2 - half_px
    return image.array[low:low + 2 * half_px + 1, low:low + 2 * half_px + 1].copy()


def moments(image, weight_px):
    """The weighted moments described above. The stamp's side must be odd; x and y count from its central pixel."""
    half = image.shape[0] // 2
    axis = np.arange(image.shape[0], dtype=float) - half
    x, y = axis[None, :], axis[:, None]
    xc = yc = 0.0
    for _ in range(10000):
        weighted = image * np.exp(-((x - xc) ** 2 + (y - yc) ** 2) / (2.0 * weight_px ** 2))
        total = weighted.sum()
        xn, yn = (weighted * x).sum() / total, (weighted * y).sum() / total
        moved = max(abs(xn - xc), abs(yn - yc))
        xc, yc = xn, yn
        if moved < 1e-12:
            break
    else:
        raise RuntimeError("the weighted centroid does not settle")
    weighted = image * np.exp(-((x - xc) ** 2 + (y - yc) ** 2) / (2.0 * weight_px ** 2))
    total = weighted.sum()
    ixx = (weighted * (x - xc) ** 2).sum() / total
    iyy = (weighted * (y - yc) ** 2).sum() / total
    ixy = (weighted * (x - xc) * (y - yc)).sum() / total
    return {"e1": (ixx - iyy) / (ixx + iyy), "e2": 2.0 * ixy / (ixx + iyy), "size_px": math.sqrt((ixx + iyy) / 2.0),
            "x_px": xc, "y_px": yc, "flux_e": total}


def half_width(weight_px):
    """Half-width of the stamp over which moments are taken: 5 weight_px on every side, whole pixels."""
    return int(math.ceil(5.0 * weight_px - 1e-9))


def digits(value, number):
    """Round to a number of significant digits (JSON then prints the shortest text that reads back)."""
    return float("%.*g" % (number, value))


def write_json(name, document):
    """Write compactly, and never leave a half-written file behind."""
    path = os.path.join(HERE, name)
    with open(path + ".part", "w") as out:
        json.dump(document, out, separators=(",", ":"))
        out.write("\n")
    os.replace(path + ".part", path)


# sersic_index, half_light_px, e1, fwhm_px, moffat_beta, dx_px, dy_px
PSF = {"wide": (2.91, 3.5), "sharp": (1.8, 2.5), "broad": (4.0, 4.765)}
OFF = {"centred": (0.0, 0.0), "off": (0.3, -0.2), "corner": (0.5, 0.5)}
CASES = [
    (4.0, 0.45, 0.0, "wide", "centred"),
    (4.0, 0.45, 0.0, "wide", "off"),
    (4.0, 0.45, 0.3, "wide", "corner"),
    (4.0, 0.45, -0.25, "sharp", "centred"),
    (4.0, 1.0, 0.3, "sharp", "off"),
    (4.0, 1.0, 0.0, "broad", "corner"),
    (4.0, 1.0, -0.25, "wide", "off"),
    (4.0, 2.9, 0.3, "wide", "centred"),
    (4.0, 2.9, -0.25, "sharp", "off"),
    (4.0, 2.9, 0.0, "broad", "off"),
    (1.0, 0.45, 0.0, "sharp", "corner"),
    (1.0, 0.45, 0.3, "broad", "centred"),
    (1.0, 0.45, -0.25, "wide", "off"),
    (1.0, 1.0, 0.3, "wide", "off"),
    (1.0, 1.0, -0.25, "sharp", "centred"),
    (1.0, 2.9, 0.0, "wide", "corner"),
    (1.0, 2.9, 0.3, "sharp", "off"),
    (2.5, 1.0, 0.3, "wide", "off"),
]
FLUX = 1000.0
STAMP_HALF = 30


def make():
    cases = []
    for n, half_light, e1, psf, off in CASES:
        (fwhm, beta), (dx, dy) = PSF[psf], OFF[off]
        weight = 7.7 if half_light > 2.0 else 5.4
        moments_half = half_width(weight)
        wide = max(moments_half, STAMP_HALF)
        image = draw(n, half_light, e1, fwhm, beta, FLUX, dx, dy, wide)

        def crop(half):
            return image[wide - half:wide + half + 1, wide - half:wide + half + 1]
        result = moments(crop(moments_half), weight)
        cases.append({
            "name": "n%g-r%g-e%+g-%s-%s" % (n, half_light, e1, psf, off),
            "sersic_index": n, "half_light_px": half_light, "e1": e1, "fwhm_px": fwhm, "moffat_beta": beta,
            "flux_e": FLUX, "dx_px": dx, "dy_px": dy, "weight_px": weight, "moments_half_px": moments_half,
            "moments": {key: digits(value, 12) for key, value in result.items()},
            "image_e": [[digits(v, 7) for v in row] for row in crop(STAMP_HALF)]})
        print(cases[-1]["name"], " ".join("%s=%.7g" % item for item in result.items()), flush=True)
        write_json("galaxies.json", {"made_by": MADE_BY, "cases": cases})


def real_space(sersic_index, half_light_px, e1, fwhm_px, moffat_beta, flux_e, dx_px, dy_px, pixels,
               rings=700, nodes=6, density=14.0):
    """The same image without GalSim: an average of the pixel-integrated PSF over the galaxy's elliptical rings.

    Light in a ring: with t = b_n (r/r_e)^(1/n), weight t^(2n-1) exp(-t) dt / Gamma(2n). Gauss-Legendre in t and over
    the pixel, trapezoid round the ring; `pixels` lists (y, x) from the central pixel.
    """
    from scipy.special import gamma, gammaincinv
    n = sersic_index
    b = gammaincinv(2.0 * n, 0.5)
    r0 = fwhm_px / (2.0 * math.sqrt(2.0 ** (1.0 / moffat_beta) - 1.0))
    norm = (moffat_beta - 1.0) / (math.pi * r0 ** 2)
    q = math.sqrt((1.0 - e1) / (1.0 + e1))
    ax, ay = q ** -0.5, q ** 0.5
    t_max = 45.0 if n > 2.0 else 40.0
    t, w = np.polynomial.legendre.leggauss(rings)
    t, w = t_max * (t + 1.0) / 2.0, w * t_max / 2.0
    w = w * t ** (2.0 * n - 1.0) * np.exp(-t) / gamma(2.0 * n)
    r = half_light_px * (t / b) ** n
    s, sw = np.polynomial.legendre.leggauss(nodes)
    s, sw = s / 2.0, sw / 2.0
    values = []
    for y, x in pixels:
        total, far = 0.0, math.hypot(x, y)
        for ri, wi in zip(r, w):
            if wi < 1e-13:
                continue
            # the PSF seen along the ring is the smoother the farther the ring is from the pixel
            away = max(1.0, far - max(ax, ay) * ri - 1.0, min(ax, ay) * ri - far - 1.0)
            steps = int(24 + density * ri * max(ax, ay) / away)
            phi = (np.arange(steps) + 0.5) * 2.0 * math.pi / steps
            gx = (x + s)[:, None] - dx_px - ax * ri * np.cos(phi)[None, :]
            gy = (y + s)[:, None] - dy_px - ay * ri * np.sin(phi)[None, :]
            psf = (1.0 + (gx[:, None, :] ** 2 + gy[None, :, :] ** 2) / r0 ** 2) ** -moffat_beta
            total += wi * np.einsum("i,j,ijk->", sw, sw, psf) / steps
        values.append(flux_e * norm * total)
    return np.array(values)


def check():
    pixels = [(0, 0), (0, 1), (1, 0), (2, 2), (-3, 4), (6, -7), (0, 10), (3, 15), (-20, 20), (30, 30)]
    cases = [(4.0, 0.45, 0.0, 2.91, 3.5, FLUX, 0.3, -0.2), (4.0, 2.9, 0.3, 1.8, 2.5, FLUX, 0.5, 0.5),
             (1.0, 1.0, -0.25, 1.8, 2.5, FLUX, 0.0, 0.0), (4.0, 0.45, 0.3, 4.0, 4.765, FLUX, 0.0, 0.0),
             (2.5, 1.0, 0.3, 2.91, 3.5, FLUX, 0.3, -0.2)]
    pick = tuple(np.array([p[i] for p in pixels]) + STAMP_HALF for i in (0, 1))
    for case in cases:
        exact = real_space(*case, pixels=pixels)
        finer = real_space(*case, pixels=pixels[:5], rings=1000, nodes=8, density=22.0)
        print(case, "real space, finer: %.1e of the peak" % (abs(finer - exact[:5]).max() / exact.max()), flush=True)
        for label, change, large in (("GalSim defaults", None, 61),
                                     ("looser", dict(folding_threshold=1e-4, maxk_threshold=1e-5, kvalue_accuracy=1e-6,
                                                     integration_relerr=1e-7, integration_abserr=1e-9), 257),
                                     ("as used", {}, LARGE)):
            params = dict(maximum_fft_size=16384) if change is None else dict(GSPARAMS, **change)
            image = draw(*case, half_px=30, large=large, gsparams=params)
            print("   %-16s off by %.1e of the peak" % (label, abs(image[pick] - exact).max() / exact.max()), flush=True)
    # A whole stamp: the sharpest PSF, off centre, where sampling by pixels shows in the moments
    case, weight = (4.0, 1.0, 0.3, 1.8, 2.5, FLUX, 0.3, -0.2), 5.4
    half = half_width(weight)
    side = range(-half, half + 1)
    exact = real_space(*case, pixels=[(y, x) for y in side for x in side], rings=500).reshape(len(side), len(side))
    image = draw(*case, half_px=half)
    print("whole stamp: %.1e of the peak" % (abs(exact - image).max() / exact.max()))
    one, two = moments(exact, weight), moments(image, weight)
    print("moments, GalSim minus real space:", {key: "%.1e" % (two[key] - one[key]) for key in one})


if __name__ == "__main__":
    check() if "--check" in sys.argv[1:] else make()
