"""A mission with its effects, and the values it would measure, without noise.

World       dose, traps and release times: what the contract's sections 1 and 4 say, as functions of a row's conditions
Galaxy      Sersic profile behind a Moffat PSF, drawn by its Fourier transform; weighted moments
Predictor   observables of section 3, from columns that simulator.c reads out

A mission is a dictionary laid out as the mission file is. Effects are a list of (kind, parameters).
Units as in the contract: electrons, pixels, milliseconds, kelvin, years since launch, MeV/g.
"""
import ctypes
import datetime
import functools
import math

import numpy as np

BOLTZMANN_EV_K = 8.617333262e-5
YEAR_DAYS = 365.25
# A year is active from so long before to so long after a solar maximum, and 7 years of 11 are.
ACTIVE_BEFORE_YR, ACTIVE_AFTER_YR, ACTIVE_SHARE = 2.5, 4.5, 7.0 / 11.0
SHAPES = ("delta_e1", "delta_y", "delta_flux", "delta_size")


# ----------------------------------------------------------------------------------------------------- dose and traps


def years_between(launch, date):
    """Time in years of 365.25 days between two dates."""
    return (date - launch).days / YEAR_DAYS


def decimal_year(date):
    """2012-07-01 as 2012.497."""
    start, end = datetime.date(date.year, 1, 1), datetime.date(date.year + 1, 1, 1)
    return date.year + (date - start) / (end - start)


class World:
    """A mission as it is believed, or as it is."""

    def __init__(self, mission, effects=()):
        self.mission = mission
        self.effects = list(effects)

    def all_of(self, kind):
        """Parameters of every effect of a kind."""
        return [parameters for name, parameters in self.effects if name == kind]

    def one_of(self, kind):
        """Parameters of the effect of a kind, or None."""
        return next(iter(self.all_of(kind)), None)

    # -- dose

    def active_periods(self):
        """(start, end) in years since launch."""
        launch = decimal_year(self.mission["mission"]["launch"])
        maxima = [maximum - launch for maximum in self.mission["environment"]["solar_maximum"]]
        return [(maximum - ACTIVE_BEFORE_YR, maximum + ACTIVE_AFTER_YR) for maximum in maxima]

    def irradiations(self, until_yr):
        """(start, end, MeV/g per year) of each period of steady dose up to a time; periods may overlap."""
        environment = self.mission["environment"]
        rate = environment["active_dose_rate_mev_g_yr"]
        if environment["model"] == "constant" and not self.all_of("solar-cycle"):
            periods = [(0.0, until_yr, ACTIVE_SHARE * rate)]
        else:
            periods = [(max(start, 0.0), min(end, until_yr), rate) for start, end in self.active_periods()]
        periods += [(0.0, until_yr, floor["rate_mev_g_yr"]) for floor in self.all_of("cosmic-ray-floor")]
        return [(start, end, rate) for start, end, rate in periods if end > start]

    def flares(self, until_yr):
        """(time, MeV/g) of each flare up to a time."""
        flares = [(flare["t_yr"], flare["dose_mev_g"]) for flare in self.all_of("solar-flare")]
        return [(t_yr, dose) for t_yr, dose in flares if t_yr <= until_yr]

    def dose(self, t_yr):
        """Dose since launch in MeV/g, as a dose monitor sees it."""
        steady = sum(rate * (end - start) for start, end, rate in self.irradiations(t_yr))
        return steady + sum(dose for _, dose in self.flares(t_yr))

    # -- what becomes of traps

    def bakeouts(self, until_yr, species):
        """(time, fraction) of each bakeout of a species up to a time. One with a `species` is of that species alone,
        which nothing in the catalogue is."""
        return [(bakeout["t_yr"], bakeout["fraction"]) for bakeout in self.all_of("bakeout")
                if bakeout["t_yr"] <= until_yr and bakeout.get("species", species) == species]

    def left_by_bakeouts(self, made_yr, now_yr, species):
        """Fraction of the traps made at a time that bakeouts have left."""
        return math.prod(1.0 - fraction for t_yr, fraction in self.bakeouts(now_yr, species) if t_yr >= made_yr)

    def left_by_annealing(self, made_yr, now_yr):
        """Fraction of the traps made at a time that annealing has left."""
        return math.exp(-sum((now_yr - made_yr) / annealing["time_yr"] for annealing in self.all_of("annealing")))

    def annealed_years(self, start_yr, end_yr, now_yr):
        """Integral of left_by_annealing over the times at which traps were made."""
        rate = sum(1.0 / annealing["time_yr"] for annealing in self.all_of("annealing"))
        if rate == 0.0:
            return end_yr - start_yr
        return (self.left_by_annealing(end_yr, now_yr) - self.left_by_annealing(start_yr, now_yr)) / rate

    def surviving_dose(self, now_yr, species):
        """Dose in MeV/g without that whose traps have disappeared."""
        total = 0.0
        for start, end, rate in self.irradiations(now_yr):
            inside = sorted(t_yr for t_yr, _ in self.bakeouts(now_yr, species) if start < t_yr < end)
            edges = [start, *inside, end]
            for begin, stop in zip(edges, edges[1:]):
                total += rate * self.left_by_bakeouts(stop, now_yr, species) * self.annealed_years(begin, stop, now_yr)
        for t_yr, dose in self.flares(now_yr):
            total += dose * self.left_by_bakeouts(t_yr, now_yr, species) * self.left_by_annealing(t_yr, now_yr)
        return total

    def relative_dose(self, at, species=None):
        """Dose behind the traps over the reference dose. A laboratory's dose has no clock: nothing of it anneals."""
        dose = at["dose_mev_g"] if "dose_mev_g" in at else self.surviving_dose(at["t_yr"], species)
        scale = math.prod(scale["factor"] for scale in self.all_of("dose-scale"))
        return scale * dose / self.mission["detector"]["reference_dose_mev_g"]

    def launch_density(self, at, species):
        """Traps per pixel left of those that were there at launch."""
        density = sum(launch.get(species, 0.0) for launch in self.all_of("prelaunch-traps"))
        if "dose_mev_g" in at:
            return density
        return density * self.left_by_bakeouts(0.0, at["t_yr"], species) * self.left_by_annealing(0.0, at["t_yr"])

    # -- conditions and detector of a row

    def conditions(self, row):
        """All conditions of a row: where it does not give them, the mission does; effects change them."""
        mission = self.mission
        at = {"temperature_k": mission["detector"]["temperature_k"], "line_time_ms": mission["readout"]["line_time_ms"],
              "transfers": mission["readout"]["transfers"], "background_e": mission["sky"]["background_e"], **row}
        if "date" in at:
            at["t_yr"] = years_between(mission["mission"]["launch"], datetime.date.fromisoformat(at["date"]))
        at["temperature_k"] += sum(offset["kelvin"] for offset in self.all_of("temperature-offset"))
        at["background_e"] += sum(flash["electrons"] for flash in self.all_of("preflash"))
        return at

    def well(self):
        """(full well in e-, notch in e-, exponent) of the cloud."""
        detector, notch, fill = self.mission["detector"], self.one_of("notch"), self.one_of("well-fill")
        return (detector["full_well_e"], notch["notch_e"] if notch else detector["notch_e"],
                fill["well_fill_power"] if fill else detector["well_fill_power"])

    def release_ms(self, species, temperature_k):
        """Release time of a species at a temperature."""
        reference_k = self.mission["detector"]["reference_temperature_k"]
        exponent = species["energy_ev"] / BOLTZMANN_EV_K * (1.0 / temperature_k - 1.0 / reference_k)
        return species["release_ms"] * (reference_k / temperature_k) ** 2 * math.exp(exponent)

    def detector(self, at):
        """What simulator.c reads columns out with: (well, capture time, ((density, release time), ...)), times in
        transfers."""
        traps = []
        for species in self.mission["detector"]["traps"]:
            density = species["density_per_px"] * self.relative_dose(at, species["name"])
            traps.append((density + self.launch_density(at, species["name"]), species))
        for species in self.all_of("extra-species"):
            traps.append((species["density_per_px"] * self.relative_dose(at), species))
        traps = [(density, self.release_ms(species, at["temperature_k"]) / at["line_time_ms"])
                 for density, species in traps]
        spread, capture = self.one_of("release-continuum"), self.one_of("finite-capture")
        if spread:
            traps = spread_releases(traps, spread["sigma"])
        return self.well(), capture["capture_ms"] / at["line_time_ms"] if capture else 0.0, tuple(traps)

    def serial_register(self, at):
        """The same for the serial register (a transfer takes `pixel_time_ms`), and its number of transfers; or None."""
        register = self.one_of("serial-traps")
        if not register:
            return None
        traps = tuple((species["density_per_px"] * self.relative_dose(at),
                       self.release_ms(species, at["temperature_k"]) / register["pixel_time_ms"])
                      for species in register["traps"])
        return (self.well(), 0.0, traps), register["transfers"]


def spread_releases(traps, sigma):
    """Each species as 48 species whose release times are log-normal about its own (Gauss-Hermite quadrature)."""
    return [(density * share, release * math.exp(sigma * deviation))
            for density, release in traps for deviation, share in normal_nodes()]


@functools.lru_cache(maxsize=None)
def normal_nodes():
    """(deviation, share) of each node."""
    deviations, weights = np.polynomial.hermite_e.hermegauss(48)
    return list(zip(deviations, weights / weights.sum()))


# ----------------------------------------------------------------------------------------------------------- galaxies

# Samples per pixel, and width in pixels, of the grid on which galaxies are drawn: fine enough for the sharpest PSF used
# here, wide enough for no wing to fold back into the stamp.
OVERSAMPLING, FIELD_PX = 4, 256
# Beyond this wavenumber (in 1/px) nothing is left behind a PSF of two pixels or more.
HIGHEST_WAVENUMBER = 10.0
# Positions in a pixel over which shapes are averaged: even ones, more of them along the trails.
X_OFFSETS_PX, Y_OFFSETS_PX = [(np.arange(number) + 0.5) / number - 0.5 for number in (3, 7)]


def bessel_j0(x):
    """Bessel function of order zero: Abramowitz and Stegun 1964, 9.4.1 and 9.4.3 (error below 1e-7)."""
    near = (np.minimum(x, 3.0) / 3.0) ** 2
    inner = np.polynomial.polynomial.polyval(
        near, [1.0, -2.2499997, 1.2656208, -0.3163866, 0.0444479, -0.0039444, 0.0002100])
    far = 3.0 / np.maximum(x, 3.0)
    amplitude = np.polynomial.polynomial.polyval(
        far, [0.79788456, -0.00000077, -0.00552740, -0.00009512, 0.00137237, -0.00072805, 0.00014476])
    phase = np.polynomial.polynomial.polyval(
        far, [-0.78539816, -0.04166397, -0.00003954, 0.00262573, -0.00054125, -0.00029333, 0.00013558])
    return np.where(x <= 3.0, inner, amplitude * np.cos(x + phase) / np.sqrt(np.maximum(x, 3.0)))


@functools.lru_cache(maxsize=None)
def wavenumber_table():
    return np.arange(0.0, HIGHEST_WAVENUMBER, 0.002)


@functools.lru_cache(maxsize=None)
def sersic_transform(index, half_light_px):
    """Fourier transform of a round Sersic profile of unit flux, at wavenumber_table().

    The profile is a sum of rings. In u = b (r / half_light_px)^(1/index) their flux is u^(2 index - 1) e^-u, and b is
    the u within which half of it lies.
    """
    step = 0.02
    u = np.arange(0.5 * step, 32.0, step)
    flux = u ** (2.0 * index - 1.0) * np.exp(-u)
    flux /= flux.sum()
    b = np.interp(0.5, np.cumsum(flux), u + 0.5 * step)
    radii_px = half_light_px * (u / b) ** index
    return sum(share * bessel_j0(wavenumber_table() * radius) for share, radius in zip(flux, radii_px))


@functools.lru_cache(maxsize=None)
def moffat_transform(fwhm_px, beta):
    """Fourier transform of a Moffat profile of unit flux, at wavenumber_table().

    (1 + r^2 / a^2)^-beta is a sum of Gaussians, the integral over t of t^(beta - 1) e^(-t (1 + r^2 / a^2)), whose
    transforms are Gaussians again.
    """
    scale_px = 0.5 * fwhm_px / math.sqrt(2.0 ** (1.0 / beta) - 1.0)
    logarithm = np.arange(-14.0, 5.0, 0.01)
    t = np.exp(logarithm)
    share = t ** (beta - 1.0) * np.exp(-t)
    share /= share.sum()
    return sum(s * np.exp(-(wavenumber_table() * scale_px) ** 2 / (4.0 * width)) for s, width in zip(share, t))


class Galaxy:
    """A galaxy of the mission file, seen through the mission's PSF."""

    def __init__(self, galaxy, psf):
        self.name, self.weight_px = galaxy["name"], galaxy["weight_px"]
        self.half_width_px = math.ceil(5.0 * self.weight_px)
        self.galaxy, self.psf = galaxy, psf

    def transform(self):
        """Fourier transform of the pixels' charge on the oversampled grid, and its wavenumbers (x, y)."""
        samples = OVERSAMPLING * FIELD_PX
        axis = 2.0 * np.pi * OVERSAMPLING * np.fft.fftfreq(samples)
        kx, ky = axis[None, :], axis[:, None]
        e1 = self.galaxy["e1"]
        shear = e1 / (1.0 + math.sqrt(1.0 - e1 * e1))
        stretched = np.hypot(kx * (1.0 + shear), ky * (1.0 - shear)) / math.sqrt(1.0 - shear * shear)
        light = sersic_transform(self.galaxy["sersic_index"], self.galaxy["half_light_px"])
        psf = moffat_transform(self.psf["fwhm_px"], self.psf["moffat_beta"])
        table = wavenumber_table()
        square_pixel = np.sinc(kx / (2.0 * np.pi)) * np.sinc(ky / (2.0 * np.pi))
        seen = np.interp(stretched, table, light) * np.interp(np.hypot(kx, ky), table, psf, right=0.0)
        return self.galaxy["flux_e"] * OVERSAMPLING ** 2 * seen * square_pixel, kx, ky

    @functools.cached_property
    def stamps(self):
        """Electrons per pixel [row, column], galaxy only, at each sub-pixel position."""
        transform, kx, ky = self.transform()
        chosen = np.arange(-self.half_width_px, self.half_width_px + 1) * OVERSAMPLING
        stamps = []
        for dx in X_OFFSETS_PX:
            for dy in Y_OFFSETS_PX:
                image = np.fft.ifft2(transform * np.exp(-1j * (kx * dx + ky * dy))).real
                stamps.append(image[np.ix_(chosen, chosen)])
        return stamps


def moments(image, weight_px):
    """(e1, y of the centroid in px, weighted flux in e-, size in px), with a round Gaussian weight that is moved until
    it stands on the weighted centroid."""
    axis = np.arange(len(image)) - len(image) // 2
    x, y = axis[None, :], axis[:, None]
    x_centre = y_centre = 0.0
    moved = math.inf
    while moved > 1e-12:
        weighted = image * np.exp(-((x - x_centre) ** 2 + (y - y_centre) ** 2) / (2.0 * weight_px ** 2))
        flux = weighted.sum()
        x_next, y_next = (weighted * x).sum() / flux, (weighted * y).sum() / flux
        moved = max(abs(x_next - x_centre), abs(y_next - y_centre))
        x_centre, y_centre = x_next, y_next
    xx, yy = (weighted * (x - x_centre) ** 2).sum() / flux, (weighted * (y - y_centre) ** 2).sum() / flux
    return (xx - yy) / (xx + yy), y_centre, flux, math.sqrt(0.5 * (xx + yy))


# -------------------------------------------------------------------------------------------------------- observables


class _Detector(ctypes.Structure):
    _fields_ = [("full_well_e", ctypes.c_double), ("notch_e", ctypes.c_double), ("well_fill_power", ctypes.c_double),
                ("capture_transfers", ctypes.c_double), ("species", ctypes.c_int),
                ("density_per_px", ctypes.POINTER(ctypes.c_double)),
                ("release_transfers", ctypes.POINTER(ctypes.c_double))]


class _Scene(ctypes.Structure):
    _fields_ = [("background_e", ctypes.c_double), ("rows_in_front", ctypes.c_int), ("columns", ctypes.c_int),
                ("rows", ctypes.c_int)]


class Predictor:
    """Observables, by columns that the compiled simulator.c reads out. What has been read out once is remembered."""

    def __init__(self, library):
        self.library = ctypes.CDLL(str(library))
        self.galaxies = {}
        self.known_packets, self.known_pixels, self.known_shapes = {}, {}, {}

    def forget(self):
        """Gives back memory; the next case shares little with the one before."""
        for known in (self.known_packets, self.known_pixels, self.known_shapes):
            known.clear()

    def read_out(self, detector, background_e, rows_in_front, columns):
        """Charge in e- that arrives of columns[column, row], behind rows that hold the background."""
        (full_well_e, notch_e, well_fill_power), capture_transfers, traps = detector
        densities, releases = np.array(traps).T.copy()
        charge = np.ascontiguousarray(columns, dtype=float)
        read = np.empty_like(charge)

        def pointer(array):
            return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        failed = self.library.read_out(
            ctypes.byref(_Detector(full_well_e, notch_e, well_fill_power, capture_transfers, len(traps),
                                   pointer(densities), pointer(releases))),
            ctypes.byref(_Scene(background_e, rows_in_front, *charge.shape)), pointer(charge), pointer(read))
        if failed:
            raise ValueError("too many species for slow capture")
        return read

    def packet(self, detector, at, block_px, behind_px):
        """Charges in e- that arrive of the last row of a block and of the pixels behind it, and those of the background
        alone."""
        key = (detector, at["background_e"], at["transfers"], at["signal_e"], block_px, behind_px)
        if key not in self.known_packets:
            columns = np.full((2, block_px + behind_px), at["background_e"])
            columns[0, :block_px] += at["signal_e"]
            read = self.read_out(detector, at["background_e"], at["transfers"] - block_px, columns)
            self.known_packets[key] = read[:, block_px - 1:]
        return self.known_packets[key]

    def through_serial(self, register, charge_e, background_e):
        """What arrives, less the background that arrives, of one pixel of a row that else holds the background."""
        key = (register, charge_e, background_e)
        if key not in self.known_pixels:
            detector, transfers = register
            read = self.read_out(detector, background_e, transfers - 1, [[charge_e], [background_e]])
            self.known_pixels[key] = read[0, 0] - read[1, 0]
        return self.known_pixels[key]

    def behind_packet(self, world, at, block_px, pixel, behind_px):
        """Charge in e- less the background, `pixel` behind the last row of a block (0: in that row)."""
        charges, backgrounds = self.packet(world.detector(at), at, block_px, behind_px)
        register = world.serial_register(at)
        if register:
            signal = self.through_serial(register, charges[pixel], backgrounds[pixel])
        else:
            signal = charges[pixel] - backgrounds[pixel]
        if pixel > 0:
            for bounce in world.all_of("signal-bounce"):
                rows = np.arange(block_px)
                signal += at["signal_e"] * bounce["fraction"] * np.exp(-(pixel - 1 + rows) / bounce["length_px"]).sum()
        return signal

    def galaxy(self, world, name):
        psf = world.mission["psf"]
        galaxy = next(galaxy for galaxy in world.mission["galaxies"] if galaxy["name"] == name)
        key = (tuple(galaxy.items()), tuple(psf.items()))
        if key not in self.galaxies:
            self.galaxies[key] = Galaxy(galaxy, psf)
        return self.galaxies[key]

    def trailed_stamps(self, world, galaxy, at):
        """Each stamp of a galaxy after read-out, less the trailed background."""
        half, width = galaxy.half_width_px, 2 * galaxy.half_width_px + 1
        background = np.zeros((1, width))
        columns = np.concatenate([*(stamp.T for stamp in galaxy.stamps), background]) + at["background_e"]
        read = self.read_out(world.detector(at), at["background_e"], at["transfers"] - 1 - half, columns)
        background = read[-1]
        trailed = [(read[k * width:(k + 1) * width] - background).T for k in range(len(galaxy.stamps))]
        register = world.serial_register(at)
        if register:
            trailed = self.rows_through_serial(register, trailed, background, half)
        for bounce in world.all_of("signal-bounce"):
            trailed = [image + bounced(stamp, bounce) for image, stamp in zip(trailed, galaxy.stamps)]
        return trailed

    def rows_through_serial(self, register, images, backgrounds, half_width_px):
        """Each row of images without background, read out through the serial register with its background."""
        detector, transfers = register
        images = np.array(images)
        for row, background_e in enumerate(backgrounds):
            columns = np.concatenate([images[:, row], np.zeros((1, images.shape[2]))]) + background_e
            read = self.read_out(detector, background_e, transfers - 1 - half_width_px, columns)
            images[:, row] = read[:-1] - read[-1]
        return list(images)

    def shapes(self, world, at):
        """delta_e1, delta_y, delta_flux and delta_size, averaged over the sub-pixel positions."""
        galaxy = self.galaxy(world, at["galaxy"])
        bounces = tuple(tuple(bounce.items()) for bounce in world.all_of("signal-bounce"))
        key = (id(galaxy), world.detector(at), world.serial_register(at), bounces, at["background_e"], at["transfers"])
        if key not in self.known_shapes:
            changes = []
            for stamp, trailed in zip(galaxy.stamps, self.trailed_stamps(world, galaxy, at)):
                e1, y, flux, size = moments(stamp, galaxy.weight_px)
                new_e1, new_y, new_flux, new_size = moments(trailed, galaxy.weight_px)
                changes.append((new_e1 - e1, new_y - y, new_flux / flux - 1.0, new_size / size - 1.0))
            self.known_shapes[key] = dict(zip(SHAPES, np.mean(changes, axis=0)))
        return self.known_shapes[key]

    def value(self, world, observable, row, behind_px):
        """One measurement without noise; `behind_px` is the farthest pixel that its file asks for."""
        at = world.conditions(row)
        if observable == "dose":
            return world.dose(at["t_yr"])
        if observable in SHAPES:
            return self.shapes(world, at)[observable]
        if observable == "packet_charge":
            return self.behind_packet(world, at, 1, 0, behind_px)
        if observable == "trail":
            return self.behind_packet(world, at, 1, at["trail_px"], behind_px) / at["signal_e"]
        return self.behind_packet(world, at, at["block_px"], at["trail_px"], behind_px)

    def values(self, world, observable, rows):
        """Measurements without noise under the conditions of each row."""
        behind_px = max((row.get("trail_px", 0) for row in rows), default=0)
        return np.array([self.value(world, observable, row, behind_px) for row in rows])


def bounced(stamp, bounce):
    """The amplifier's own trail of an image, in e-."""
    trail = np.zeros_like(stamp)
    for k in range(1, len(stamp)):
        trail[k:] += bounce["fraction"] * math.exp(-(k - 1) / bounce["length_px"]) * stamp[:-k]
    return trail
