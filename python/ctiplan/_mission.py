"""Missions and measurements."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ctiplan import _ctiplan, _files, _tables

if TYPE_CHECKING:
    import pandas
    from astropy.table import QTable

    from ctiplan._detector import Detector


class Mission:
    """A mission: launch, orbit, shielding, detector, clocking, galaxies, requirement, effects.

    Missions do not change; :meth:`set` gives another one. Made by :meth:`read` or :meth:`from_toml`.
    """

    __slots__ = ("_inner", "path")

    #: The file it was read from; None where it was made otherwise.
    path: Path | None

    def __init__(self, inner: _ctiplan.Mission, path: Path | None = None) -> None:
        if not isinstance(inner, _ctiplan.Mission):
            raise TypeError("missions are made by Mission.read(path) or Mission.from_toml(text)")
        self._inner = inner
        self.path = path

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Mission:
        """Read a mission file (TOML).

        Raises
        ------
        InputError
            Where the file cannot be read or makes no sense, with its line and key.
        """
        return cls(_ctiplan.Mission.read(os.fspath(path)), Path(path))

    @classmethod
    def from_toml(cls, text: str) -> Mission:
        """Read a mission from the text of a mission file."""
        return cls(_ctiplan.Mission.parse(text))

    def set(self, values: Mapping[str, Any]) -> Mission:
        """The same mission with other values of some keys.

        Parameters
        ----------
        values : mapping
            Dotted keys, such as ``detector.temperature_k`` or ``detector.traps.VV.release_ms``, with values in the unit that the
            key names.
        """
        return Mission(self._inner.set(dict(values)), self.path)

    def to_toml(self) -> str:
        """The mission as resolved, with all defaults: a mission file that can be run again."""
        return self._inner.to_toml()

    def to_dict(self) -> dict[str, Any]:
        """The mission as resolved, as nested dicts; dates are text."""
        return json.loads(self._inner.json())

    def write(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the mission as resolved. An existing file is replaced only with `overwrite`."""
        _files.write(path, self.to_toml(), overwrite=overwrite)

    @property
    def name(self) -> str:
        """Name of the mission."""
        return self.to_dict()["mission"]["name"]

    @property
    def launch(self) -> str:
        """Launch date, as text."""
        return self.to_dict()["mission"]["launch"]

    @property
    def duration_yr(self) -> float:
        """Duration of the mission, yr."""
        return self.to_dict()["mission"]["duration_yr"]

    def detector_at(self, t_yr: float | None = None, *, dose_mev_g: float | None = None) -> Detector:
        """The detector with its traps at one time.

        Parameters
        ----------
        t_yr : float
            Time of the exposure, years since launch.
        dose_mev_g : float, optional
            Dose of the traps, MeV/g, instead of the mission's: for a detector irradiated in a laboratory `t_yr` years ago.
        """
        from ctiplan._detector import Detector

        return Detector(self, t_yr, dose_mev_g=dose_mev_g)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mission) and self._inner == other._inner

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __reduce__(self) -> tuple[Any, ...]:
        return Mission, (self._inner, self.path)

    def __repr__(self) -> str:
        header = self.to_dict()["mission"]
        return f"<Mission {header['name']!r}, {header['duration_yr']} yr from {header['launch']}>"

    def _repr_html_(self) -> str:
        return f"<details><summary>{escape(repr(self))}</summary><pre>{escape(self.to_toml())}</pre></details>"


class DataSet:
    """Measurements of one observable, with conditions in columns, as the model of a mission understands them.

    Made by :meth:`read` or :meth:`from_table`.
    """

    __slots__ = ("_inner", "_mission")

    def __init__(self, inner: _ctiplan.DataSet, mission: Mission) -> None:
        self._inner = inner
        self._mission = mission

    @classmethod
    def read(cls, path: str | os.PathLike[str], mission: Mission) -> DataSet:
        """Read a measurement file (ECSV or CSV) for a mission.

        Raises
        ------
        InputError
            Where the file cannot be read or makes no sense for the mission, with its line and column.
        """
        return cls(_ctiplan.DataSet.read(os.fspath(path), checked(mission)._inner), mission)

    @classmethod
    def from_table(cls, table: Any, mission: Mission, *, name: str = "table", **meta: Any) -> DataSet:
        """Take a table as measurements for a mission.

        Parameters
        ----------
        table : astropy.table.Table, astropy.table.QTable, pandas.DataFrame or mapping of columns
            Columns ``value``, ``sigma`` and conditions, one row per measurement. Units of astropy columns are heeded; without them
            names tell the units (``t_yr``, ``signal_e``). A `meta` of the table is used.
        mission : Mission
            What the conditions that have no column are taken from.
        name : str
            What to call it in results.
        **meta
            Entries of ``meta`` beside the table's, such as ``observable="trail"``, or conditions that all rows share.
        """
        return dataset_of(name, _tables.to_ecsv(table, meta), checked(mission))

    @property
    def name(self) -> str:
        """The file as given, or the name of the table."""
        return self._inner.name

    @property
    def observable(self) -> str:
        """What was measured, such as ``trail``."""
        return self._inner.observable

    @property
    def varying(self) -> list[str]:
        """Conditions and covariates that vary from row to row."""
        return self._inner.varying

    @property
    def value(self) -> np.ndarray:
        """Values of all rows, shape (n,), in the unit of the observable."""
        return np.array(self._inner.values()[0])

    @property
    def sigma(self) -> np.ndarray:
        """1-sigma errors of all rows, shape (n,), in the unit of the observable; floors and errors of conditions included."""
        return np.array(self._inner.values()[1])

    def to_ecsv(self) -> str:
        """The text of a measurement file (ECSV)."""
        return self._inner.to_ecsv()

    def to_table(self) -> QTable:
        """The measurements as an astropy QTable with units."""
        from astropy.table import QTable

        return QTable.read(self.to_ecsv(), format="ascii.ecsv")

    def to_pandas(self) -> pandas.DataFrame:
        """The measurements as a pandas DataFrame."""
        return self.to_table().to_pandas()

    def __len__(self) -> int:
        return len(self._inner)

    def __reduce__(self) -> tuple[Any, ...]:
        return dataset_of, (self.name, self.to_ecsv(), self._mission)

    def __repr__(self) -> str:
        return f"<DataSet {self.name!r}, {self.observable}, {len(self)} rows>"


def dataset_of(name: str, text: str, mission: Mission) -> DataSet:
    """Measurements from the text of a file (ECSV or CSV)."""
    return DataSet(_ctiplan.DataSet.parse(name, text, mission._inner), mission)


def checked(mission: Any) -> Mission:
    """A mission, or a refusal of anything else."""
    if not isinstance(mission, Mission):
        raise TypeError(f"a mission is needed, as Mission.read(path) gives it; found {type(mission).__name__}")
    return mission
