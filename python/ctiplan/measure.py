"""Measurements from frames: edges of flat fields, trails of warm pixels, injected charge, dipoles of trap pumping.

Frames are arrays of shape (rows, columns), row 0 the lowest, in DN, or paths of FITS files; one or a list of them. Every function
takes these options beside its own:

gain : float
    Electrons per DN; 1 where the values are electrons. Files may tell it by themselves (``BUNIT``).
bias : float, optional
    Value of a pixel without charge, DN; without it: measured where the frame offers it, or in `bias_from`
    (``"columns"``, ``"prescan"`` or ``"rows"``).
saturated_dn : float, optional
    Value from which on pixels are left out.
dq_bad : int, optional
    Sum of the bits of data quality (extension ``DQ`` or ``FLG`` of a file) of pixels to leave out; without it: 1, 2, 256 and 2048
    for HST/ACS, and none for others.
date : str or datetime, or t_yr : float, or dose_mev_g : float
    When the frames were taken: date, years since launch, or dose of the traps (MeV/g). Files tell it by ``DATE-OBS``.
temperature_k, line_time_ms : float, optional
    Conditions; without them the mission's hold.
amplifiers : str or path, optional
    Table of the camera's amplifiers (ECSV or CSV), in place of gain, corner, split, prescan, overscan and transfers_before.
    Arrays are its HDU 0. Rows then have the columns ``hdu`` and ``amplifier`` (row of that table, from 1).
corner, split, prescan, overscan, overscan_rows, transfers_before
    How the frames lie on the detector, as in :meth:`Detector.readout`. ``overscan_start`` may be given in place of `overscan_rows`:
    the first row behind the image, in the order of readout.
progress : callable, optional
    ``progress(stage, done, total)``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ctiplan import _ctiplan, _files
from ctiplan._detector import real, values, whole
from ctiplan._errors import InputError
from ctiplan._mission import DataSet, Mission, checked, dataset_of

if TYPE_CHECKING:
    import pandas
    from astropy.table import QTable

__all__ = ["Measurement", "dipoles", "eper", "injection", "trails"]


class Measurement:
    """A table of measurements, as ``validate``, ``fit`` and ``diagnose`` read it.

    Attributes
    ----------
    observable : str
        What was measured, such as ``eper``.
    first_pixel : Measurement or None
        The charges of first pixels (observable ``packet_charge``), where there are any.
    cti : Measurement or None
        The CTI that edges of flat fields tell (observable ``cti``), where there is any.
    document : dict
        What ``ctiplan measure --json`` prints: exposures, counts of pixels, options, warnings.
    """

    __slots__ = ("_ecsv", "_text", "cti", "document", "first_pixel", "observable")

    observable: str
    first_pixel: Measurement | None
    cti: Measurement | None
    document: dict[str, Any]

    def __init__(self, tables: list[tuple[str, str]], text: str, document: dict[str, Any]) -> None:
        (self.observable, self._ecsv), *rest = tables
        self._text = text
        self.document = document
        more = {table[0]: Measurement([table], text, document) for table in rest}
        self.first_pixel = more.get("packet_charge")
        self.cti = more.get("cti")

    def to_ecsv(self) -> str:
        """The text of the measurement file (ECSV)."""
        return self._ecsv

    def write(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the measurement file. An existing file is replaced only with `overwrite`."""
        _files.write(path, self._ecsv, overwrite=overwrite)

    def to_table(self) -> QTable:
        """The measurements as an astropy QTable with units. Needs astropy."""
        from astropy.table import QTable

        return QTable.read(self._ecsv, format="ascii.ecsv")

    def to_pandas(self) -> pandas.DataFrame:
        """The measurements as a pandas DataFrame. Needs astropy and pandas."""
        return self.to_table().to_pandas()

    def data_set(self, mission: Mission, *, name: str | None = None) -> DataSet:
        """The measurements for a mission."""
        return dataset_of(name or self.observable, self._ecsv, checked(mission))

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        rows = sum(not line.startswith("#") for line in self._ecsv.splitlines()) - 1
        return f"<Measurement of {self.observable}, {rows} rows>"


def eper(
    frames: Any,
    *,
    overscan_start: int | None = None,
    trail_px: int | None = None,
    level_rows: int | None = None,
    column_groups: int = 1,
    cti_px: Sequence[tuple[int, int]] = (),
    **options: Any,
) -> Measurement:
    """Extended pixel edge response of flat fields with overscan rows, and their first pixel response.

    Parameters
    ----------
    frames : array_like or path, or a sequence of them
    overscan_start : int, optional
        First row behind the image.
    trail_px : int, optional
        Rows behind the edge; by default all that the bias does not need, up to 50.
    level_rows : int, optional
        Last rows of the flat of which its level is the mean; by default 20, or a quarter of the image.
    column_groups : int
        Groups of columns to measure apart, by the level of the flat.
    cti_px : sequence of (first, last)
        Pixels behind the edge whose charge is counted for a CTI; by default 1, 2 to 3, 4 to 7, ...
    **options
        Those of all functions of this module.
    """
    _check_whole(trail_px=trail_px, level_rows=level_rows, column_groups=column_groups)
    pixels = [tuple(whole("cti_px", one, 1, 10_000) for one in pair) for pair in cti_px]
    if any(len(pair) != 2 for pair in pixels):
        raise InputError(f"cannot use cti_px = {cti_px!r}", None, "pairs are needed", "such as [(1, 1), (2, 3)]")
    way = {"eper_trail_px": trail_px, "level_rows": level_rows, "column_groups": column_groups, "cti_px": pixels}
    return _measure(frames, way, overscan_start, options)


def trails(
    frames: Any,
    *,
    overscan_start: int | None = None,
    trail_px: int = 15,
    threshold_e: float = 300.0,
    bins_per_decade: int = 4,
    transfer_bins: int = 3,
    fewest_px: int = 10,
    epoch_days: float = 10.0,
    signal_as_read: bool = False,
    **options: Any,
) -> Measurement:
    """Trails behind warm and hot pixels, stacked in bins of signal, transfers and background.

    Parameters
    ----------
    frames : array_like or path, or a sequence of them
    overscan_start : int, optional
        First row behind the image.
    trail_px : int
        Pixels of the trail.
    threshold_e : float
        Least charge of a warm pixel above the background, e-.
    bins_per_decade, transfer_bins : int
        Bins of the signal, and of the number of transfers.
    fewest_px : int
        Fewest pixels of a bin.
    epoch_days : float
        Exposures as near in time as this are one epoch, d.
    signal_as_read : bool
        Whether rows have the charge of packets as it was read (``signal_read_e``), and not before transfer.
    **options
        Those of all functions of this module.
    """
    _check_whole(trail_px=trail_px, bins_per_decade=bins_per_decade, transfer_bins=transfer_bins, fewest_px=fewest_px)
    _check_above_0(threshold_e=threshold_e, epoch_days=epoch_days)
    way = {
        "trail_px": trail_px,
        "threshold_e": threshold_e,
        "bins_per_decade": bins_per_decade,
        "transfer_bins": transfer_bins,
        "fewest_px": fewest_px,
        "epoch_days": epoch_days,
        "signal_as_read": signal_as_read,
    }
    return _measure(frames, way, overscan_start, options)


def injection(
    frames: Any,
    *,
    overscan_start: int | None = None,
    first_row: int | None = None,
    block_px: int | None = None,
    period_px: int | None = None,
    trail_px: int | None = None,
    level_rows: int | None = None,
    column_groups: int = 1,
    background_in_front: bool = False,
    **options: Any,
) -> Measurement:
    """Trails behind blocks of injected charge, and the charge of their first rows.

    Parameters
    ----------
    frames : array_like or path, or a sequence of them
    overscan_start : int, optional
        First row behind the image.
    first_row, block_px, period_px : int, optional
        First row of the first block, rows of a block, rows from block to block; found in the frame where they are not given.
    trail_px : int, optional
        Rows behind each block.
    level_rows : int, optional
        Last rows of a block of which its level is the mean.
    column_groups : int
        Groups of columns to measure apart.
    background_in_front : bool
        Whether the background is that of the rows in front of the first block, not of the gaps.
    **options
        Those of all functions of this module.
    """
    given = (first_row, block_px, period_px)
    if None in given and given != (None, None, None):
        raise InputError("cannot measure injected charge", None, "first_row, block_px and period_px go together")
    _check_whole(
        first_row=first_row, block_px=block_px, period_px=period_px,
        trail_px=trail_px, level_rows=level_rows, column_groups=column_groups,
    )  # fmt: skip
    if block_px is not None and period_px is not None and block_px >= period_px:
        problem = f"blocks of {block_px} rows every {period_px} rows leave none between them"
        raise InputError(f"cannot use period_px = {period_px}", None, problem, "give a larger one")
    way = {
        "pattern": None if first_row is None else given,
        "injection_trail_px": trail_px,
        "level_rows": level_rows,
        "column_groups": column_groups,
        "in_front": background_in_front,
    }
    return _measure(frames, way, overscan_start, options)


def dipoles(
    frames: Any,
    *,
    overscan_start: int | None = None,
    phase_time_ms: float | None = None,
    pumping_cycles: float | None = None,
    threshold_sigma: float = 6.0,
    found_in: int = 2,
    species: str | None = None,
    **options: Any,
) -> Measurement:
    """Dipoles of trap pumping in flat fields.

    Parameters
    ----------
    frames : array_like or path, or a sequence of them
    overscan_start : int, optional
        First row behind the image.
    phase_time_ms : float
        Time of one phase, ms.
    pumping_cycles : float
        Cycles of trap pumping.
    threshold_sigma : float
        Least dipole, in standard deviations of the flat.
    found_in : int
        Fewest exposures in which a dipole must be found.
    species : str, optional
        The species of the traps.
    **options
        Those of all functions of this module.
    """
    _check_whole(found_in=found_in)
    _check_above_0(threshold_sigma=threshold_sigma)
    way = {"threshold_sigma": threshold_sigma, "found_in": found_in, "species": species}
    return _measure(frames, way, overscan_start, {**options, "phase_time_ms": phase_time_ms, "pumping_cycles": pumping_cycles})


_LAYOUT: dict[str, Any] = {
    "axis": "parallel",
    "corner": "ll",
    "split": None,
    "prescan": 0,
    "overscan": 0,
    "overscan_rows": 0,
    "transfers_before": 0,
    "charge_before_e": 0.0,
    "serial_transfers_before": 0,
}

_TOLD: dict[str, Any] = {
    "amplifiers": None,
    "gain": None,
    "gain_keyword": None,
    "saturated_dn": None,
    "bias": None,
    "bias_from": None,
    "dq_bad": None,
    "date": None,
    "t_yr": None,
    "dose_mev_g": None,
    "temperature_k": None,
    "line_time_ms": None,
    "phase_time_ms": None,
    "pumping_cycles": None,
}

# Options that are numbers.
_NUMBERS = ("gain", "bias", "saturated_dn", "t_yr", "dose_mev_g", "temperature_k", "line_time_ms", "phase_time_ms")

# What a table of amplifiers tells.
_IN_TABLE = (
    "gain",
    "gain_keyword",
    "saturated_dn",
    "corner",
    "split",
    "prescan",
    "overscan",
    "overscan_rows",
    "transfers_before",
)

# What trails and first pixels of one frame do not depend on.
_UNUSED = ("axis", "charge_before_e", "serial_transfers_before")


def _measure(frames: Any, way: dict[str, Any], overscan_start: int | None, options: dict[str, Any]) -> Measurement:
    progress = options.pop("progress", None)
    known = (set(_LAYOUT) | set(_TOLD)) - set(_UNUSED)
    for name in options:
        if name not in known:
            raise TypeError(f"no option is called {name!r}; there are: {', '.join(sorted(known))}")
    given = [_given(frame, place) for place, frame in enumerate(_several(frames), start=1)]
    layout = _LAYOUT | {name: of for name, of in options.items() if name in _LAYOUT}
    told = _TOLD | {name: of for name, of in options.items() if name in _TOLD}
    if told["amplifiers"] is not None:
        for name in set(options) & set(_IN_TABLE):
            raise TypeError(f"{name} is told by the table of amplifiers: give one")
    if told["date"] is not None and not isinstance(told["date"], str):
        if not hasattr(told["date"], "isoformat"):
            raise TypeError(f"date: a date or its text is needed; found {told['date']!r}")
        told["date"] = told["date"].isoformat()
    for name in _NUMBERS:
        if told.get(name) is not None:
            told[name] = real(name, told[name])
    for name in ("prescan", "overscan", "overscan_rows", "transfers_before"):
        whole(name, layout[name], 0, 1_000_000)
    if told["dq_bad"] is not None:
        whole("dq_bad", told["dq_bad"], 0, 2**32 - 1)
        if not all(isinstance(frame, str) for frame in given):
            raise InputError("cannot use dq_bad", None, "arrays have no data quality", "set the pixels to NaN")
    if overscan_start is not None:
        layout["overscan_rows"] = _rows_behind(given, overscan_start, layout)
    tables, text, document = _ctiplan.measure(given, layout, told, way, progress)
    return Measurement(tables, text, json.loads(document))


# Ranges of options that are whole numbers, as on the command line.
_WHOLE: dict[str, tuple[int, int]] = {
    "trail_px": (1, 10_000),
    "level_rows": (1, 100_000),
    "column_groups": (1, 1000),
    "bins_per_decade": (1, 100),
    "transfer_bins": (1, 1000),
    "fewest_px": (5, 1_000_000),
    "first_row": (0, 1_000_000),
    "block_px": (1, 100_000),
    "period_px": (2, 1_000_000),
    "found_in": (1, 100_000),
}


def _check_whole(**options: Any) -> None:
    for name, value in options.items():
        if value is not None:
            whole(name, value, *_WHOLE[name])


def _check_above_0(**options: Any) -> None:
    for name, value in options.items():
        if real(name, value) <= 0.0:
            raise InputError(f"cannot use {name} = {value!r}", None, "allowed: a number above 0")


def _several(frames: Any) -> Sequence[Any]:
    if isinstance(frames, (list, tuple)) and not frames:
        raise InputError("cannot measure frames", None, "there are none")
    if isinstance(frames, (str, os.PathLike)):
        return [frames]
    if isinstance(frames, (list, tuple)) and (np.ndim(frames[0]) == 2 or isinstance(frames[0], (str, os.PathLike))):
        return frames
    return [frames]


def _given(frame: Any, place: int) -> str | tuple[str, np.ndarray, bool]:
    if isinstance(frame, (str, os.PathLike)):
        return os.fspath(frame)
    array = values(frame, unit=None)
    if array.ndim != 2:
        raise ValueError(f"a frame has shape (rows, columns); found {array.shape}")
    return f"frame {place}", array.astype(np.float64, copy=False), array.dtype.kind in "iub"


def _rows_behind(given: list[Any], overscan_start: int, layout: dict[str, Any]) -> int:
    if layout["overscan_rows"]:
        raise TypeError("overscan_start and overscan_rows say the same: give one")
    rows = {frame[1].shape[0] for frame in given if not isinstance(frame, str)}
    if len(rows) != 1 or any(isinstance(frame, str) for frame in given):
        raise InputError("cannot use overscan_start", None, "it needs arrays of one number of rows", "give overscan_rows")
    whole("overscan_start", overscan_start, 0, 1_000_000)
    rows_read = rows.pop() // (2 if layout["split"] in ("rows", "both") else 1)
    if not 0 < overscan_start < rows_read:
        problem = f"the frame has {rows_read} rows: 1 to {rows_read - 1} is needed"
        raise InputError(f"cannot use overscan_start = {overscan_start}", None, problem)
    return rows_read - overscan_start
