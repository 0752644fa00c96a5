"""A detector at one time: frames in, frames out."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from ctiplan import _ctiplan
from ctiplan._errors import InputError

if TYPE_CHECKING:
    from ctiplan._mission import Mission

Corner = Literal["ll", "lr", "ul", "ur"]
Axis = Literal["parallel", "serial", "both"]
Split = Literal["columns", "rows", "both"]


@dataclass(frozen=True)
class Residual:
    """What the forward model leaves unexplained of a frame."""

    #: Root mean square, e-.
    rms_e: float
    #: Largest magnitude, e-.
    max_e: float


@dataclass(frozen=True, eq=False)
class Corrected:
    """A frame without its trails."""

    #: Charge before the transfers, e-, in the shape of the frame.
    image: np.ndarray = field(repr=False)
    #: Pixels whose charge does not follow from the frame, because their packets were emptied; bool, in the shape of the frame.
    uncertain: np.ndarray = field(repr=False)
    #: Error of all other pixels, e-, if the model is right, and missing and saturated pixels held what is assumed of them.
    error_e: float
    #: Whether the residual is as small as required.
    converged: bool
    #: Before the first iteration, and after each.
    residuals: tuple[Residual, ...]
    #: Pixels with a full well, which keep their values.
    saturated_px: int
    #: Pixels without a value.
    missing_px: int


class Detector:
    """Traps, wells, registers and amplifier of a mission's detector at one time. Made by :meth:`Mission.detector_at`.

    Frames are arrays of electrons, shape (rows, columns); a single column may have shape (rows,). Row 0 is the lowest; with
    ``corner="ll"`` it is the row nearest to the serial register, and column 0 the nearest to the amplifier. Any real dtype and any
    strides are taken. float32 comes back as float32, everything else as float64.
    """

    __slots__ = ("_given", "_inner", "mission")

    mission: Mission

    def __init__(self, mission: Mission, t_yr: float | None = None, *, dose_mev_g: float | None = None) -> None:
        self.mission = mission
        self._given = (t_yr, dose_mev_g)
        self._inner = _ctiplan.Detector(mission._inner, t_yr=t_yr, dose_mev_g=dose_mev_g)

    @property
    def t_yr(self) -> float:
        """Time of the exposure, years since launch."""
        return self._inner.t_yr

    @property
    def dose_mev_g(self) -> float:
        """Displacement damage dose, MeV/g."""
        return self._inner.dose_mev_g

    @property
    def traps(self) -> dict[str, dict[str, float]]:
        """Each species: ``density_per_px`` and ``release_ms``."""
        return {name: {"density_per_px": density, "release_ms": release} for name, density, release in self._inner.traps}

    def readout(
        self,
        frame: npt.ArrayLike,
        *,
        corner: Corner = "ll",
        split: Split | None = None,
        axis: Axis = "parallel",
        prescan: int = 0,
        overscan: int = 0,
        overscan_rows: int = 0,
        transfers_before: int = 0,
        charge_before_e: float = 0.0,
        serial_transfers_before: int = 0,
        trap_map: npt.ArrayLike | None = None,
        relative: float = 1e-3,
    ) -> np.ndarray:
        """Read a frame out: add its trails.

        Parameters
        ----------
        frame : array_like, shape (rows, columns) or (rows,)
            Charge, e-, with the background.
        corner : {"ll", "lr", "ul", "ur"}
            Corner that is read first: lower or upper, left or right.
        split : {"columns", "rows", "both"}, optional
            Amplifiers on both sides.
        axis : {"parallel", "serial", "both"}
            Directions of transfer; serial ones need ``[effects.serial-traps]``.
        prescan, overscan, overscan_rows : int
            First columns and last columns and rows that are read; they hold no charge before.
        transfers_before : int
            Rows between the frame's first row and the register.
        charge_before_e : float
            Charge in each pixel of those rows, e-.
        serial_transfers_before : int
            Pixels of the serial register between the frame's first column and the amplifier.
        trap_map : array_like, optional
            Factors on the trap densities of the pixels: shape (1, columns) or (columns,) by column, (rows, 1) by row, (rows, columns)
            by pixel, or numbers of blocks that divide rows and columns.
        relative : float
            Accuracy: error of a packet over the largest displacement of charge.

        Returns
        -------
        numpy.ndarray
            Charge as read, e-, in the shape of `frame`.
        """
        charge, give_back = electrons(frame)
        layout = _layout(
            axis, corner, split, prescan, overscan, overscan_rows, transfers_before, charge_before_e, serial_transfers_before
        )
        return give_back(self._inner.readout(charge, layout, factors(trap_map, frame), real("relative", relative)))

    def correct(
        self,
        frame: npt.ArrayLike,
        *,
        tolerance: float = 1e-4,
        tolerance_e: float | None = None,
        iterations: int = 20,
        read_noise_e: float | None = None,
        corner: Corner = "ll",
        split: Split | None = None,
        axis: Axis = "parallel",
        prescan: int = 0,
        overscan: int = 0,
        overscan_rows: int = 0,
        transfers_before: int = 0,
        charge_before_e: float = 0.0,
        serial_transfers_before: int = 0,
        trap_map: npt.ArrayLike | None = None,
        relative: float = 1e-3,
    ) -> Corrected:
        """Correct a frame: remove its trails.

        Parameters
        ----------
        frame : array_like, shape (rows, columns) or (rows,)
            Charge as read, e-, with the background. NaN where a pixel has no value. Full wells keep their values.
        tolerance : float
            Largest residual of the forward model at which iterations end, over its initial value.
        tolerance_e : float, optional
            Required error of the image, e- rms, in place of `tolerance`.
        iterations : int
            Largest number of iterations.
        read_noise_e : float, optional
            Read noise, e- rms: noise that may be the amplifier's is separated before the correction and added again, which amplifies
            it less.
        corner, split, axis, prescan, overscan, overscan_rows, transfers_before, charge_before_e, serial_transfers_before, trap_map, relative
            As in :meth:`readout`.
        """
        whole("iterations", iterations, 1, 1000)
        charge, give_back = electrons(frame)
        layout = _layout(
            axis, corner, split, prescan, overscan, overscan_rows, transfers_before, charge_before_e, serial_transfers_before
        )
        options = {
            "tolerance": real("tolerance", tolerance),
            "tolerance_e": None if tolerance_e is None else real("tolerance_e", tolerance_e),
            "iterations": iterations,
            "relative": real("relative", relative),
            "read_noise_e": None if read_noise_e is None else real("read_noise_e", read_noise_e),
        }
        found = self._inner.correct(charge, layout, factors(trap_map, frame), options)
        return Corrected(
            image=give_back(found["image"]),
            uncertain=found["uncertain"].reshape(np.shape(frame)),
            error_e=found["error_e"],
            converged=found["converged"],
            residuals=tuple(Residual(*each) for each in found["residuals"]),
            saturated_px=found["saturated_px"],
            missing_px=found["missing_px"],
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _detector_of, (self.mission, *self._given)

    def __repr__(self) -> str:
        return f"<Detector of {self.mission.name!r} at {self.t_yr} yr, {self.dose_mev_g:.3e} MeV/g>"


def _detector_of(mission: Mission, t_yr: float | None, dose_mev_g: float | None) -> Detector:
    return Detector(mission, t_yr, dose_mev_g=dose_mev_g)


def _layout(
    axis: Axis,
    corner: Corner,
    split: Split | None,
    prescan: int,
    overscan: int,
    overscan_rows: int,
    transfers_before: int,
    charge_before_e: float,
    serial_transfers_before: int,
) -> dict[str, Any]:
    """How a frame lies on the detector, as the private module takes it."""
    counts = {
        "prescan": prescan,
        "overscan": overscan,
        "overscan_rows": overscan_rows,
        "transfers_before": transfers_before,
        "serial_transfers_before": serial_transfers_before,
    }
    for name, count in counts.items():
        whole(name, count, 0, 1_000_000)
    one_of("axis", axis, get_args(Axis))
    one_of("corner", corner, get_args(Corner))
    one_of("split", split, (None, *get_args(Split)))
    return {
        "axis": axis,
        "corner": corner,
        "split": split,
        "prescan": prescan,
        "overscan": overscan,
        "overscan_rows": overscan_rows,
        "transfers_before": transfers_before,
        "charge_before_e": real("charge_before_e", charge_before_e),
        "serial_transfers_before": serial_transfers_before,
    }


def one_of(name: str, value: Any, allowed: tuple[str | None, ...]) -> None:
    """A word of some, or a refusal that names it."""
    if value not in allowed:
        words = ", ".join(repr(word) for word in allowed)
        raise InputError(f"cannot use {name} = {value!r}", None, f"allowed: {words}")


def real(name: str, value: Any) -> float:
    """A finite number, or a refusal that names it."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if isinstance(value, (str, bool)) or not math.isfinite(number):
        raise InputError(f"cannot use {name} = {value!r}", None, "allowed: a finite number")
    return number


def whole(name: str, value: Any, least: int, most: int) -> int:
    """A whole number in a range, or a refusal that names it."""
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if not least <= number <= most:
        raise InputError(f"cannot use {name} = {value!r}", None, f"allowed: a whole number from {least} to {most}")
    return number


def factors(trap_map: npt.ArrayLike | None, frame: Any) -> np.ndarray | None:
    """Factors on densities as float64 of two axes, which are those of the frame."""
    if trap_map is None:
        return None
    given = np.asarray(trap_map, dtype=np.float64)
    if given.ndim not in (1, 2):
        raise InputError("cannot use trap_map", None, f"its shape is {given.shape}; (rows, columns) or (columns,) is needed")
    if given.ndim == 2:
        return given
    return given[:, np.newaxis] if np.ndim(frame) == 1 else given[np.newaxis, :]


def electrons(frame: Any) -> tuple[np.ndarray, Any]:
    """A frame of electrons as float64 of two axes, and what gives an array of that shape back as the frame was.

    Units are heeded; masked pixels are missing (NaN).
    """
    given = values(frame, unit="electron")
    if given.ndim not in (1, 2):
        raise ValueError(f"a frame has shape (rows, columns) or (rows,); found {given.shape}")
    dtype = np.float32 if given.dtype.kind == "f" and given.dtype.itemsize == 4 else np.float64
    charge = given.astype(np.float64, copy=False)
    charge = charge[:, np.newaxis] if given.ndim == 1 else charge

    def give_back(result: np.ndarray) -> np.ndarray:
        return result.reshape(given.shape).astype(dtype, copy=False)

    return charge, give_back


def values(frame: Any, *, unit: str | None) -> np.ndarray:
    """Pixel values of an array of numpy, a Quantity or CCDData of astropy, in `unit`; masked pixels are NaN.

    With `unit` None any unit is taken, and its values stay as they are.
    """
    said = getattr(frame, "unit", None)
    mask = getattr(frame, "mask", None)
    # A method of that name, as pandas has, is none.
    mask = None if callable(mask) else mask
    given = np.asarray(getattr(frame, "data", frame) if said is not None and not isinstance(frame, np.ndarray) else frame)
    if given.dtype.kind not in "fiub":
        raise TypeError(f"a frame of real numbers is needed; found dtype {given.dtype}")
    if said is not None and unit is not None:
        given = given * _factor(said, unit)
    if mask is not None and np.any(mask):
        given = np.where(mask, np.nan, given)
    return given


def _factor(said: Any, unit: str) -> float:
    if str(said) == unit:
        return 1.0
    try:
        return float(said.to(unit))
    except Exception as error:
        problem = f"its unit is {str(said) or 'dimensionless'}; frames are in {unit}"
        raise InputError("cannot use the frame", None, problem, "multiply by the gain, or give the values alone") from error
