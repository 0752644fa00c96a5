"""arcticpy's names, defaults and conventions on ctiplan's readout.

``from ctiplan.arctic import add_cti, remove_cti, CCD, ROE, TrapInstantCapture`` in place of ``from arcticpy import ...``. Results are
those of arcticpy 2.6 at express 0, every transfer followed, to a relative accuracy (see :func:`add_cti`). What agrees, to how much,
and what differs is in docs/arctic.md.

Frames have shape (rows, columns) and are in electrons. Row 0 is nearest to the serial register, column 0 to the amplifier. Times
are in the units of ``ROE.dwell_times``.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, SupportsIndex

import numpy as np
import numpy.typing as npt

from ctiplan import _ctiplan
from ctiplan._detector import values
from ctiplan._errors import InputError

__all__ = [
    "CCD",
    "CCDPhase",
    "CTI_model_for_HST_ACS",
    "PixelBounce",
    "ROE",
    "ROEChargeInjection",
    "ROETrapPumping",
    "ReadNoise",
    "TrapInstantCapture",
    "TrapInstantCaptureContinuum",
    "TrapSlowCapture",
    "TrapSlowCaptureContinuum",
    "add_cti",
    "add_pixel_bounce",
    "print_array",
    "print_array_2D",
    "remove_cti",
    "remove_pixel_bounce",
]

#: Error of a frame over the largest displacement of charge in it at express 0, where every transfer is asked for.
ACCURACY = 2e-4

#: The same for other whole numbers, with which arcticpy gathers transfers and is off by some 5e-3.
GATHERED = 1e-3


class CCDPhase:
    """How electrons fill the potential well below one phase of a pixel.

    A cloud of n electrons fills the volume ``f + (1 - f) ((n - notch)/(full_well - notch))**power``, with f the first electron's,
    no less than f and no more than 1.

    Parameters
    ----------
    full_well_depth : float
        Charge that fills the well, e-.
    well_notch_depth : float
        Charge in the notch (supplementary buried channel), which meets no traps, e-.
    well_fill_power : float
        Exponent of the filled volume.
    first_electron_fill : float
        Fraction of the volume that any charge fills.
    """

    def __init__(
        self,
        full_well_depth: float = 1e4,
        well_notch_depth: float = 0.0,
        well_fill_power: float = 1.0,
        first_electron_fill: float = 0.0,
    ) -> None:
        self.full_well_depth = full_well_depth
        self.well_notch_depth = well_notch_depth
        self.well_fill_power = well_fill_power
        self.first_electron_fill = first_electron_fill


class CCD:
    """The phases of a pixel and the traps below them.

    Parameters
    ----------
    phases : sequence of CCDPhase
        Phases in the direction of transfer, all with the same well. Of several, see docs/arctic.md: arcticpy 2.6 has no results.
    fraction_of_traps_per_phase : sequence of float
        Part of the traps below each phase.
    full_well_depth, well_notch_depth, well_fill_power, first_electron_fill : float, optional
        A single phase of these values, those not given at the defaults of :class:`CCDPhase`; in place of `phases`.
    """

    def __init__(
        self,
        phases: Sequence[CCDPhase] | CCDPhase | None = None,
        fraction_of_traps_per_phase: npt.ArrayLike = (1.0,),
        full_well_depth: float | None = None,
        well_notch_depth: float | None = None,
        well_fill_power: float | None = None,
        first_electron_fill: float | None = None,
    ) -> None:
        given = {
            "full_well_depth": full_well_depth,
            "well_notch_depth": well_notch_depth,
            "well_fill_power": well_fill_power,
            "first_electron_fill": first_electron_fill,
        }
        words = {name: value for name, value in given.items() if value is not None}
        if words or phases is None:
            phases = [CCDPhase(**words)]
        self.phases: list[CCDPhase] = [phases] if isinstance(phases, CCDPhase) else list(phases)
        self.fraction_of_traps_per_phase = np.atleast_1d(np.asarray(fraction_of_traps_per_phase, dtype=np.float64))

    @property
    def full_well_depths(self) -> np.ndarray:
        """Charge that fills the well of each phase, e-, shape (phases,)."""
        return np.array([phase.full_well_depth for phase in self.phases], dtype=np.float64)

    @property
    def well_notch_depths(self) -> np.ndarray:
        """Charge in the notch of each phase, e-, shape (phases,)."""
        return np.array([phase.well_notch_depth for phase in self.phases], dtype=np.float64)

    @property
    def well_fill_powers(self) -> np.ndarray:
        """Exponent of each phase, shape (phases,)."""
        return np.array([phase.well_fill_power for phase in self.phases], dtype=np.float64)

    @property
    def first_electron_fills(self) -> np.ndarray:
        """Fraction of the volume of each phase that any charge fills, shape (phases,)."""
        return np.array([phase.first_electron_fill for phase in self.phases], dtype=np.float64)


class ROE:
    """How the readout electronics move the charge.

    Parameters
    ----------
    dwell_times : sequence of float
        Time that charge stays below each phase, shape (phases,), in the unit of all times.
    prescan_offset : int
        Pixels with traps between the first pixel of the frame and the register or amplifier.
    overscan_start : int
        Number of the first pixel beyond the physical ones, as arcticpy counts it: pixels from ``overscan_start - 1`` on have no
        traps. -1: none.
    empty_traps_between_columns : bool
        Traps are empty when a column begins; otherwise they are as the column before has left them.
    empty_traps_for_first_transfers : bool
        Traps of a pixel are empty when its first packet comes; otherwise they are as that packet has left the pixel before.
    force_release_away_from_readout, use_integer_express_matrix : bool
        Taken for the sake of arcticpy; with one phase, and with every transfer followed, they make no difference.
    pixel_bounce_kA, pixel_bounce_kv, pixel_bounce_omega, pixel_bounce_gamma : float
        Kept as they are; pixel bounce is not modelled.
    """

    def __init__(
        self,
        dwell_times: npt.ArrayLike = (1.0,),
        prescan_offset: int = 0,
        overscan_start: int = -1,
        empty_traps_between_columns: bool = True,
        empty_traps_for_first_transfers: bool = False,
        force_release_away_from_readout: bool = True,
        use_integer_express_matrix: bool = False,
        pixel_bounce_kA: float = 0.0,  # noqa: N803 (arcticpy's name)
        pixel_bounce_kv: float = 0.0,
        pixel_bounce_omega: float = 1.0,
        pixel_bounce_gamma: float = 1.0,
    ) -> None:
        self.dwell_times = np.atleast_1d(np.asarray(dwell_times, dtype=np.float64))
        self.prescan_offset = prescan_offset
        self.overscan_start = overscan_start
        self.empty_traps_between_columns = empty_traps_between_columns
        self.empty_traps_for_first_transfers = empty_traps_for_first_transfers
        self.force_release_away_from_readout = force_release_away_from_readout
        self.use_integer_express_matrix = use_integer_express_matrix
        self.pixel_bounce_kA = pixel_bounce_kA
        self.pixel_bounce_kv = pixel_bounce_kv
        self.pixel_bounce_omega = pixel_bounce_omega
        self.pixel_bounce_gamma = pixel_bounce_gamma


class ROEChargeInjection(ROE):
    """Charge is injected at the far end of the columns: every packet passes all pixels on its way to the register.

    Traps of a pixel are empty when its first packet comes. Between columns with ``empty_traps_between_columns=False`` they are as
    the column before has left the last of the pixels.

    Parameters
    ----------
    dwell_times, prescan_offset, overscan_start, empty_traps_between_columns, ... :
        As of :class:`ROE`. The offset adds to the pixels of the frame; an overscan takes its own away.
    """

    def __init__(
        self,
        dwell_times: npt.ArrayLike = (1.0,),
        prescan_offset: int = 0,
        overscan_start: int = -1,
        empty_traps_between_columns: bool = True,
        force_release_away_from_readout: bool = True,
        use_integer_express_matrix: bool = False,
        pixel_bounce_kA: float = 0.0,  # noqa: N803 (arcticpy's name)
        pixel_bounce_kv: float = 0.0,
        pixel_bounce_omega: float = 1.0,
        pixel_bounce_gamma: float = 1.0,
    ) -> None:
        super().__init__(
            dwell_times, prescan_offset, overscan_start, empty_traps_between_columns, False,
            force_release_away_from_readout, use_integer_express_matrix,
            pixel_bounce_kA, pixel_bounce_kv, pixel_bounce_omega, pixel_bounce_gamma,
        )  # fmt: skip

    @staticmethod
    def from_normal_roe(roe: ROE, n_pixels_in_image: int) -> ROEChargeInjection:
        """The same electronics with injected charge, and so many pixels more in ``prescan_offset``, as arcticpy has it."""
        return ROEChargeInjection(
            roe.dwell_times, roe.prescan_offset + n_pixels_in_image, roe.overscan_start, roe.empty_traps_between_columns,
            roe.force_release_away_from_readout, roe.use_integer_express_matrix,
            roe.pixel_bounce_kA, roe.pixel_bounce_kv, roe.pixel_bounce_omega, roe.pixel_bounce_gamma,
        )  # fmt: skip


class TrapInstantCapture:
    """Traps that capture at once whatever the cloud reaches.

    Parameters
    ----------
    density : float
        Traps per pixel.
    release_timescale : float
        Time constant of release, in the units of the dwell times.
    fractional_volume_none_exposed, fractional_volume_full_exposed : float
        Fractions of the well's volume below which there is no trap, and above which their density is constant; in between it grows
        evenly. Both 0: traps in the whole volume.
    """

    def __init__(
        self,
        density: float = 1.0,
        release_timescale: float = 1.0,
        fractional_volume_none_exposed: float = 0.0,
        fractional_volume_full_exposed: float = 0.0,
    ) -> None:
        self.density = density
        self.release_timescale = release_timescale
        self.fractional_volume_none_exposed = fractional_volume_none_exposed
        self.fractional_volume_full_exposed = fractional_volume_full_exposed

    @property
    def delta_ellipticity(self) -> float:
        """Change of e1 of a faint galaxy by these traps, left uncorrected, in Euclid's set-up; in proportion to their density.

        A fit to simulated galaxies, after Israel et al. 2015 (MNRAS 453, 561), with l the decimal logarithm of the release time in
        transfers: ``4 density (A - D_a arctan((l - D_p)/D_w) + G_a exp(-(l - G_p)**2/(2 G_w**2)))``. The factor 4, with which the
        fit's density is that of a pixel, is arcticpy's. It knows nothing of the well, the sky, or another galaxy: ``ctiplan.Mission``
        computes the change of shape of the galaxies of a mission.
        """
        decades = math.log10(_number("release_timescale", self.release_timescale, above=0.0))
        density = _number("density", self.density, least=0.0)
        step = 0.05333 - 0.03357 * math.atan((decades - 1.628) / 0.2951)
        peak = 0.09901 * math.exp(-((decades - 0.4553) ** 2) / (2.0 * 0.4132**2))
        return 4.0 * density * (step + peak)

    def poisson_density_from(self, total_pixels: int, seed: int = -1) -> TrapInstantCapture:
        """The same traps with the density of so many pixels in which their number is drawn at random, from Poisson's distribution.

        Parameters
        ----------
        total_pixels : int
            Pixels in which traps are counted.
        seed : int
            Seed of numpy's RandomState, with which the draw is arcticpy's; -1: another draw each time.
        """
        pixels = _whole("total_pixels", total_pixels, least=1)
        seed = _whole("seed", seed, least=-1)
        expected = _number("density", self.density, least=0.0) * pixels
        count = np.random.RandomState(None if seed == -1 else seed).poisson(expected)
        return TrapInstantCapture(
            float(count) / pixels, self.release_timescale,
            self.fractional_volume_none_exposed, self.fractional_volume_full_exposed,
        )  # fmt: skip


class TrapSlowCapture:
    """Traps that need time to capture.

    Parameters
    ----------
    density : float
        Traps per pixel.
    release_timescale, capture_timescale : float
        Time constants of release, and of capture inside the cloud, in the units of the dwell times.
    """

    def __init__(self, density: float = 1.0, release_timescale: float = 1.0, capture_timescale: float = 0.0) -> None:
        self.density = density
        self.release_timescale = release_timescale
        self.capture_timescale = capture_timescale


class TrapInstantCaptureContinuum:
    """Traps that capture at once, with release times spread log-normally.

    Parameters
    ----------
    density : float
        Traps per pixel.
    release_timescale : float
        Median of the release times, in the units of the dwell times.
    release_timescale_sigma : float
        Standard deviation of their natural logarithm.
    """

    def __init__(
        self, density: float = 1.0, release_timescale: float = 1.0, release_timescale_sigma: float = 0.0
    ) -> None:
        self.density = density
        self.release_timescale = release_timescale
        self.release_timescale_sigma = release_timescale_sigma


class TrapSlowCaptureContinuum(TrapSlowCapture):
    """Traps that need time to capture, with release times spread log-normally.

    Parameters
    ----------
    density : float
        Traps per pixel.
    release_timescale : float
        Median of the release times, in the units of the dwell times.
    release_timescale_sigma : float
        Standard deviation of their natural logarithm.
    capture_timescale : float
        Time constant of capture inside the cloud, in the units of the dwell times.
    """

    def __init__(
        self,
        density: float = 1.0,
        release_timescale: float = 1.0,
        release_timescale_sigma: float = 0.0,
        capture_timescale: float = 0.0,
    ) -> None:
        super().__init__(density, release_timescale, capture_timescale)
        self.release_timescale_sigma = release_timescale_sigma


Trap = TrapInstantCapture | TrapSlowCapture | TrapInstantCaptureContinuum | TrapSlowCaptureContinuum


class _NotModelled:
    """A name of arcticpy's that can be imported, and says at its first use that it is not modelled."""

    remedy = ""

    def __init__(self, *_given: Any, **_words: Any) -> None:
        raise NotImplementedError(f"{type(self).__name__} is not modelled here{self.remedy}")


class PixelBounce(_NotModelled):
    """Not modelled: ringing of the readout electronics."""

    remedy = "; see `ctiplan effects signal-ringing` for a mission's own"


class ReadNoise(_NotModelled):
    """Not modelled: separates read noise before a correction."""

    remedy = "; use `ctiplan correct --separate-noise`"


class ROETrapPumping(_NotModelled):
    """Not modelled: trap pumping."""

    remedy = "; see `ctiplan study pocket-pumping` and `ctiplan measure dipoles`"


def add_pixel_bounce(*_given: Any, **_words: Any) -> np.ndarray:
    """Not modelled: ringing of the readout electronics."""
    raise NotImplementedError(f"add_pixel_bounce is not modelled here{PixelBounce.remedy}")


def remove_pixel_bounce(*_given: Any, **_words: Any) -> np.ndarray:
    """Not modelled: ringing of the readout electronics."""
    raise NotImplementedError(f"remove_pixel_bounce is not modelled here{PixelBounce.remedy}")


def print_array(array: npt.ArrayLike) -> None:
    """Prints the values of an array."""
    print(np.asarray(array, dtype=np.float64))


def print_array_2D(array: npt.ArrayLike) -> None:  # noqa: N802 (arcticpy's name)
    """Prints the values of an array with rows and columns."""
    print(np.asarray(array, dtype=np.float64))


def add_cti(
    image: npt.ArrayLike,
    header: Any = None,
    parallel_ccd: CCD | None = None,
    parallel_roe: ROE | None = None,
    parallel_traps: Iterable[Trap] | None = None,
    parallel_express: float = 0,
    parallel_window_offset: int = 0,
    parallel_window_start: int = 0,
    parallel_window_stop: int = -1,
    parallel_time_start: int = 0,
    parallel_time_stop: int = -1,
    parallel_prune_n_electrons: float = 1e-10,
    parallel_prune_frequency: int = 20,
    serial_ccd: CCD | None = None,
    serial_roe: ROE | None = None,
    serial_traps: Iterable[Trap] | None = None,
    serial_express: float = 0,
    serial_window_offset: int = 0,
    serial_window_start: int = 0,
    serial_window_stop: int = -1,
    serial_time_start: int = 0,
    serial_time_stop: int = -1,
    serial_prune_n_electrons: float = 1e-10,
    serial_prune_frequency: int = 20,
    allow_negative_pixels: bool | int = 1,
    pixel_bounce_list: Sequence[Any] | None = None,
    verbosity: int = 1,
    iteration: int = 0,
) -> np.ndarray:
    """Add the trails of a readout: along the columns first (parallel), then along the rows (serial).

    Parameters
    ----------
    image : array_like, shape (rows, columns)
        Charge before the readout, e-; any real dtype and strides. It is left as it is.
    header : mapping, optional
        Gets the keys CTICOR, CTIPAR and CTISER.
    parallel_ccd, parallel_roe, parallel_traps : CCD, ROE and a list of traps, optional
        Parallel transfer; without traps there is none.
    parallel_express : int or float
        The accuracy. Whatever it is, the result is what arcticpy gives at express 0. With 0 the error of a pixel is at most about
        2e-4 of the largest displacement of charge in the frame, with any other whole number 1e-3, and mostly far smaller.
        Between 0 and 1: that fraction.
    parallel_window_offset : int
        More pixels between the frame and the register, added to ``prescan_offset``.
    parallel_window_start, parallel_window_stop : int
        Rows that are read out: from start up to, not including, stop; -1: to the end. Charge in front of them does not take part.
    parallel_time_start, parallel_time_stop, parallel_prune_n_electrons, parallel_prune_frequency : int or float
        Taken for the sake of arcticpy; nothing is pruned, and all times count.
    serial_ccd, serial_roe, ... :
        The same for serial transfer, and for columns.
    allow_negative_pixels : bool
        False: negative charge counts as none.
    pixel_bounce_list : sequence, optional
        Must be empty: pixel bounce is not modelled.
    verbosity, iteration : int
        Taken for the sake of arcticpy; nothing is printed.

    Returns
    -------
    numpy.ndarray, shape (rows, columns), float64
        Charge as read, e-.

    Raises
    ------
    InputError
        Where a value cannot be used.
    NotImplementedError
        For phases whose wells differ, trap pumping and pixel bounce.
    """
    parallel = _Direction.of(
        "parallel", parallel_ccd, parallel_roe, parallel_traps, parallel_express,
        parallel_window_offset, parallel_window_start, parallel_window_stop,
    )  # fmt: skip
    serial = _Direction.of(
        "serial", serial_ccd, serial_roe, serial_traps, serial_express,
        serial_window_offset, serial_window_start, serial_window_stop,
    )  # fmt: skip
    _no_bounce(pixel_bounce_list)
    trailed = _read_out(_electrons(image), parallel, serial, bool(allow_negative_pixels))
    _sign(header, parallel, serial)
    return trailed


def remove_cti(
    image: npt.ArrayLike,
    n_iterations: int,
    header: Any = None,
    parallel_ccd: CCD | None = None,
    parallel_roe: ROE | None = None,
    parallel_traps: Iterable[Trap] | None = None,
    parallel_express: float = 0,
    parallel_window_offset: int = 0,
    parallel_window_start: int = 0,
    parallel_window_stop: int = -1,
    parallel_time_start: int = 0,
    parallel_time_stop: int = -1,
    parallel_prune_n_electrons: float = 1e-10,
    parallel_prune_frequency: int = 20,
    serial_ccd: CCD | None = None,
    serial_roe: ROE | None = None,
    serial_traps: Iterable[Trap] | None = None,
    serial_express: float = 0,
    serial_window_offset: int = 0,
    serial_window_start: int = 0,
    serial_window_stop: int = -1,
    serial_time_start: int = 0,
    serial_time_stop: int = -1,
    serial_prune_n_electrons: float = 1e-10,
    serial_prune_frequency: int = 20,
    allow_negative_pixels: bool | int = 1,
    pixel_bounce_list: Sequence[Any] | None = None,
    read_noise: Any = None,
    verbosity: int = 1,
) -> np.ndarray:
    """Take the trails of a readout out of an image: ``n_iterations`` times ``estimate += image - add_cti(estimate)``.

    Parameters
    ----------
    image : array_like, shape (rows, columns)
        Charge as read, e-; any real dtype and strides. It is left as it is.
    n_iterations : int
        Number of steps, each of which takes out what the one before has left.
    read_noise : optional
        Must be None: separate the read noise before; see docs/images.md.
    allow_negative_pixels : bool
        False: negative charge counts as none, in every step.

    Other parameters are those of :func:`add_cti`.

    Returns
    -------
    numpy.ndarray, shape (rows, columns), float64
        Charge before the readout, e-.

    Raises
    ------
    InputError
        Where a value cannot be used.
    NotImplementedError
        As :func:`add_cti`, and with `read_noise`.
    """
    parallel = _Direction.of(
        "parallel", parallel_ccd, parallel_roe, parallel_traps, parallel_express,
        parallel_window_offset, parallel_window_start, parallel_window_stop,
    )  # fmt: skip
    serial = _Direction.of(
        "serial", serial_ccd, serial_roe, serial_traps, serial_express,
        serial_window_offset, serial_window_start, serial_window_stop,
    )  # fmt: skip
    _no_bounce(pixel_bounce_list)
    if read_noise is not None:
        raise NotImplementedError("read_noise is not taken: separate the read noise first, and pass the image without it")
    observed = _electrons(image)
    estimate: np.ndarray = observed.copy()
    for step in range(_whole("n_iterations", n_iterations, least=0)):
        if not allow_negative_pixels:
            estimate = np.maximum(estimate, 0.0)
        estimate = estimate + observed - _trailed_in_step(step, estimate, parallel, serial)
    if not allow_negative_pixels:
        estimate = np.maximum(estimate, 0.0)
    _sign(header, parallel, serial)
    return estimate


def _trailed_in_step(step: int, estimate: np.ndarray, parallel: _Direction, serial: _Direction) -> np.ndarray:
    # In its second step arcticpy reads the positive charge out alone, and adds the negative one afterwards.
    if step == 1:
        trailed = _read_out(np.maximum(estimate, 0.0), parallel, serial, True)
        return np.asarray(trailed + np.minimum(estimate, 0.0))
    return _read_out(estimate, parallel, serial, True)


def CTI_model_for_HST_ACS(date: float) -> tuple[ROE, CCD, list[TrapInstantCapture]]:  # noqa: N802 (arcticpy's name)
    """Traps of the Advanced Camera for Surveys on the Hubble Space Telescope, for parallel transfer.

    The values of arcticpy 2.6, read off its results; their source is Massey et al. 2014 (MNRAS 439, 887) and later calibration.

    Parameters
    ----------
    date : float
        Julian date, from the launch of ACS (2002 March 1) on.

    Returns
    -------
    roe : ROE
    ccd : CCD
    traps : list of TrapInstantCapture
        Three species; density per pixel, release time in transfers.
    """
    if not date >= _ACS_LAUNCH_JD:
        raise InputError(
            "cannot model HST/ACS", f"date = {date}", f"the Julian date must be {_ACS_LAUNCH_JD} (launch) or later"
        )
    release = _ACS_RELEASE_WARM if date < _ACS_COOLER_JD else _ACS_RELEASE_COLD
    total = _ACS_BEFORE_SM4 if date < _ACS_REPAIR_JD else _ACS_AFTER_SM4
    density = total[0] + total[1] * date
    traps = [
        TrapInstantCapture(density=fraction * density, release_timescale=time)
        for fraction, time in zip(_ACS_FRACTION, release, strict=True)
    ]
    return ROE(), CCD(full_well_depth=84700.0, well_notch_depth=0.0, well_fill_power=0.478), traps


# Read off arcticpy 2.6 (bisection of its results): first date; date from which the detectors are colder; the repair of ACS.
_ACS_LAUNCH_JD = 2452334.5
_ACS_COOLER_JD = 2453920.0
_ACS_REPAIR_JD = 2454968.0
# Traps per pixel in all, as a constant and a rate per day of the Julian date.
_ACS_BEFORE_SM4 = (-870.26662236, 3.5488e-4)
_ACS_AFTER_SM4 = (-1386.13410763791, 5.6512878e-4)
_ACS_FRACTION = (0.17, 0.45, 0.38)
_ACS_RELEASE_WARM = (0.48, 4.86, 20.6)
_ACS_RELEASE_COLD = (0.74, 7.7, 37.0)


@dataclass(frozen=True)
class _Direction:
    """A direction of transfer, checked: what the private module is given."""

    traps: list[dict[str, float]]
    setting: dict[str, Any]
    window: tuple[int, int]
    #: Whether charge is injected behind the pixels.
    injected: bool = False

    @classmethod
    def of(
        cls, name: str, ccd: CCD | None, roe: ROE | None, traps: Iterable[Trap] | None, express: float,
        offset: int, start: int, stop: int,
    ) -> _Direction:  # fmt: skip
        given = [] if traps is None else _listed(name, traps)
        first = _whole(f"{name}_window_start", start, least=0)
        last = _whole(f"{name}_window_stop", stop, least=-1)
        offset = _whole(f"{name}_window_offset", offset, least=0)
        accuracy = _accuracy(name, express)
        if not given:
            return cls([], {}, (first, last))
        if ccd is None or roe is None:
            raise InputError(
                f"cannot use {name}_traps", None, f"{name}_ccd and {name}_roe are needed beside them",
                f"{name}_ccd=CCD(), {name}_roe=ROE() are the defaults",
            )  # fmt: skip
        phase, dwells, shares = _phases(name, ccd, roe)
        prescan = _whole(f"{name}_roe.prescan_offset", roe.prescan_offset, least=0)
        setting = _well(f"{name}_ccd", phase) | {
            "offset": offset + prescan,
            "pixels": _pixels(name, roe, prescan),
            "empty_for_first": bool(roe.empty_traps_for_first_transfers),
            "empty_between": bool(roe.empty_traps_between_columns),
            "relative": accuracy,
            "dwells": dwells,
            "shares": shares,
        }
        line, fraction = sum(dwells), sum(shares)
        species = [_species(f"{name}_traps", trap, line, fraction) for trap in given]
        return cls(species, setting, (first, last), isinstance(roe, ROEChargeInjection))

    def rows(self, length: int, name: str) -> slice:
        """The window among so many rows."""
        first, last = self.window
        last = length if last == -1 else last
        if not first <= last <= length:
            raise InputError(
                "cannot use the window", f"{name}_window_start = {first}, {name}_window_stop = {self.window[1]}",
                f"0 <= start <= stop <= {length} is needed, or stop = -1",
            )  # fmt: skip
        return slice(first, last)

    def read(self, frame: np.ndarray, start: int, length: int) -> np.ndarray:
        """Reads a frame out along its first axis, from so many pixels on: charge in front does not take part.

        `length` is that of the CCD, of which the frame holds the pixels up to the end of the window.
        """
        if not self.traps or not frame[start:].size:
            return frame
        if start > 0:
            frame = frame.copy()
            frame[:start] = 0.0
        injected = length + self.setting["offset"] if self.injected else None
        return _ctiplan.arctic_readout(frame, self.traps, self.setting | {"first": start, "injected": injected})


def _read_out(frame: np.ndarray, parallel: _Direction, serial: _Direction, allow_negative: bool) -> np.ndarray:
    rows, columns = parallel.rows(frame.shape[0], "parallel"), serial.rows(frame.shape[1], "serial")
    trailed = frame.copy()
    if not allow_negative:
        trailed[rows, columns] = np.maximum(trailed[rows, columns], 0.0)
    height, width = frame.shape
    trailed[rows, columns] = parallel.read(trailed[: rows.stop, columns], rows.start, height)[rows]
    trailed[rows, columns] = serial.read(trailed[rows, : columns.stop].T, columns.start, width)[columns].T
    return trailed


def _electrons(image: npt.ArrayLike) -> np.ndarray:
    given = values(image, unit="electron")
    if np.any(getattr(image, "mask", False)):
        raise InputError("cannot use the image", None, "it has masked pixels", "fill them: image.filled(background)")
    if given.ndim != 2:
        raise ValueError(f"an image has shape (rows, columns); found {given.shape}")
    return given.astype(np.float64, copy=False)


def _phases(name: str, ccd: CCD, roe: ROE) -> tuple[CCDPhase, list[float], list[float]]:
    """The well that all phases have, the dwell times and the shares of traps."""
    for attribute, value in (("n_pumps", -1), ("type", 0)):
        if getattr(roe, attribute, value) != value:
            raise NotImplementedError(f"{name}_roe: trap pumping is not read out here")
    phases, dwells, given = ccd.phases, roe.dwell_times, ccd.fraction_of_traps_per_phase
    if not len(phases) == len(dwells) == len(given) > 0:
        raise InputError(
            f"cannot use {name}_ccd and {name}_roe", None,
            f"{len(phases)} phases, {len(given)} fractions of traps and {len(dwells)} dwell times; as many of each are needed",
        )  # fmt: skip
    if any(vars(phase) != vars(phases[0]) for phase in phases):
        raise NotImplementedError(f"{name}_ccd: phases whose wells differ are not read out here")
    shares = [_number(f"{name}_ccd.fraction_of_traps_per_phase", share, least=0.0) for share in given]
    if not sum(shares) > 0.0:
        raise InputError(f"cannot use {name}_ccd", f"fraction_of_traps_per_phase = {shares}", "one must be more than 0")
    return phases[0], [_number(f"{name}_roe.dwell_times", dwell, above=0.0) for dwell in dwells], shares


def _well(name: str, phase: CCDPhase) -> dict[str, float]:
    notch = _number(f"{name}: well_notch_depth", phase.well_notch_depth, least=0.0)
    return {
        "full_well": _number(f"{name}: full_well_depth", phase.full_well_depth, above=notch),
        "notch": notch,
        "power": _number(f"{name}: well_fill_power", phase.well_fill_power, above=0.0),
        "first_electron_fill": _number(f"{name}: first_electron_fill", phase.first_electron_fill, least=0.0, below=1.0),
    }


def _pixels(name: str, roe: ROE, prescan: int) -> int | None:
    """Pixels with traps. A window's offset does not move the overscan."""
    start = _whole(f"{name}_roe.overscan_start", roe.overscan_start, least=-1)
    if start == -1:
        return None
    if start == 0:
        raise InputError(f"cannot use {name}_roe", "overscan_start = 0", "a number of 1 or more is needed, or -1 for none")
    # arcticpy takes the traps away from one pixel earlier on.
    return start - 1 + prescan


def _species(name: str, trap: Trap, dwell: float, fraction: float) -> dict[str, float]:
    def value(key: str, **bounds: float) -> float:
        return _number(f"{name}: {key}", getattr(trap, key, 0.0), **bounds)

    none = value("fractional_volume_none_exposed", least=0.0, most=1.0)
    return {
        "density": value("density", least=0.0) * fraction,
        "release": value("release_timescale", least=0.0) / dwell,
        "sigma": value("release_timescale_sigma", least=0.0),
        "capture": value("capture_timescale", least=0.0) / dwell,
        "none_exposed": none,
        "full_exposed": value("fractional_volume_full_exposed", least=none, most=1.0),
    }


def _listed(name: str, traps: Iterable[Trap]) -> list[Trap]:
    if not isinstance(traps, Iterable):
        raise TypeError(f"{name}_traps: a list of traps is needed; found {type(traps).__name__}")
    listed = list(traps)
    for trap in listed:
        if not (hasattr(trap, "density") and hasattr(trap, "release_timescale")):
            raise TypeError(f"{name}_traps: found {type(trap).__name__}; TrapInstantCapture and its kin are traps")
    return listed


def _accuracy(name: str, express: float) -> float:
    value = _number(f"{name}_express", express, least=0.0)
    if value == 0.0:
        return ACCURACY
    return value if value < 1.0 else GATHERED


def _no_bounce(pixel_bounce_list: Sequence[Any] | None) -> None:
    if pixel_bounce_list:
        raise NotImplementedError("pixel_bounce_list: pixel bounce is not modelled")


def _number(
    name: str, given: Any, *, least: float = -math.inf, above: float = -math.inf, most: float = math.inf,
    below: float = math.inf,
) -> float:  # fmt: skip
    try:
        value = float(given)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: a number is needed; found {given!r}") from None
    if not (math.isfinite(value) and least <= value <= most and above < value < below):
        bounds = [f"{least} or more" if least > -math.inf else "", f"more than {above}" if above > -math.inf else ""]
        bounds += [f"{most} or less" if most < math.inf else "", f"less than {below}" if below < math.inf else ""]
        allowed = ", ".join(bound for bound in bounds if bound) or "a finite number"
        raise InputError("cannot read the frame out", f"{name} = {value:g}", f"allowed: {allowed}")
    return value


def _whole(name: str, given: SupportsIndex, *, least: int) -> int:
    try:
        value = operator.index(given)
    except TypeError:
        raise TypeError(f"{name}: a whole number is needed; found {given!r}") from None
    if value < least:
        raise InputError("cannot read the frame out", f"{name} = {value}", f"allowed: {least} or more")
    return value


def _sign(header: Any, *directions: _Direction) -> None:
    """Says in a header what was done, in the keys that arcticpy writes."""
    if header is None:
        return
    said = f"ctiplan {_ctiplan.__version__}"
    header["CTICOR"] = said
    for key, direction in zip(("CTIPAR", "CTISER"), directions, strict=True):
        if direction.traps:
            header[key] = said
