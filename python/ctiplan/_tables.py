"""Tables of results, and tables as measurements."""

from __future__ import annotations

import csv
import datetime
import io
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ctiplan._errors import InputError
from ctiplan._units import unit_of

if TYPE_CHECKING:
    import pandas
    from astropy.table import QTable

# Columns of counts.
_WHOLE = frozenset({"line", "n", "free"})


def columns_of(text: str) -> dict[str, np.ndarray]:
    """Columns of comma-separated values by name: numbers (NaN where a cell is empty), whole numbers, or words."""
    header, *rows = csv.reader(io.StringIO(text))
    return {name: _column(name, [row[place] for row in rows]) for place, name in enumerate(header)}


def _column(name: str, cells: list[str]) -> np.ndarray:
    try:
        if name in _WHOLE:
            return np.array([int(cell) for cell in cells], dtype=np.int64)
        numbers = np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
    except ValueError:
        return np.array(cells, dtype=np.str_)
    # A column without any entry may be one of dates.
    words = np.all(np.isnan(numbers)) and unit_of(name) is None
    return np.array(cells, dtype=np.str_) if words else numbers


def to_qtable(text: str, meta: Mapping[str, Any]) -> QTable:
    """Comma-separated values as an astropy QTable, with the units that the names carry."""
    try:
        from astropy.table import QTable
    except ImportError as error:
        raise ImportError("to_table needs astropy: pip install astropy") from error
    columns = columns_of(text)
    units = {name: unit for name in columns if columns[name].dtype.kind == "f" and (unit := unit_of(name))}
    return QTable(columns, units=units, meta=dict(meta))


def to_pandas(text: str) -> pandas.DataFrame:
    """Comma-separated values as a pandas DataFrame; the names carry the units."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("to_pandas needs pandas: pip install pandas") from error
    return pandas.DataFrame(columns_of(text))


def to_ecsv(table: Any, meta: Mapping[str, Any]) -> str:
    """The text of an ECSV file with a table: of astropy, of pandas, or a mapping of names to columns.

    Cells without a value (masked, None, NaN in words) are empty.
    """
    if hasattr(table, "reset_index") and any(name is not None for name in table.index.names):
        table = table.reset_index()
    columns = [(str(name), *_cells(table[name])) for name in _names(table)]
    rows = len(columns[0][-1]) if columns else 0
    said: dict[str, Any] = {}
    # A DataFrame has `attrs` for what a table of astropy has in `meta`.
    own = getattr(table, "meta", None) or getattr(table, "attrs", {})
    for name, of in {**own, **meta}.items():
        of = _difference(of)
        if hasattr(of, "unit") and np.ndim(of) == 0:
            # A quantity holds for all rows, with its unit.
            columns.append((str(name), str(of.unit), "float64", [_cell(float(of.value))] * rows))
        elif _is_plain(plain := _plain(of)):
            said[str(name)] = plain
        elif name in meta:
            kind = type(of).__name__
            raise TypeError(f"{name} = {of!r}: a number, a text, a date or a quantity is needed; found {kind}")
    if not columns:
        raise InputError("cannot use the table", None, "it has no columns")
    lengths = {name: len(cells) for name, _, _, cells in columns}
    if len(set(lengths.values())) != 1:
        raise InputError("cannot use the table", None, f"its columns differ in length: {lengths}")
    out = io.StringIO()
    out.write("# %ECSV 1.0\n# ---\n# delimiter: ','\n# datatype:\n")
    for name, unit, datatype, _ in columns:
        head = {"name": name, "datatype": datatype} | ({"unit": unit} if unit else {})
        out.write(f"# - {json.dumps(head)}\n")
    kept = {key: value for key, value in said.items() if not key.startswith("__")}
    out.write(f"# meta: {json.dumps(kept)}\n# schema: astropy-2.0\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([name for name, *_ in columns])
    writer.writerows(zip(*(cells for *_, cells in columns), strict=True))
    return out.getvalue()


def _names(table: Any) -> list[Any]:
    for attribute in ("colnames", "columns"):
        if hasattr(table, attribute):
            return list(getattr(table, attribute))
    if isinstance(table, Mapping):
        return list(table)
    if isinstance(table, np.ndarray) and table.dtype.names:
        return list(table.dtype.names)
    raise TypeError(f"a table of astropy or pandas, or a dict of columns, is needed; found {type(table).__name__}")


def _cells(column: Any) -> tuple[str | None, str, list[str]]:
    """Unit, datatype and cells of a column."""
    column = _difference(column)
    unit = getattr(column, "unit", None)
    if hasattr(column, "isot"):
        dates = np.ma.asarray(np.atleast_1d(_in_utc(column).isot))
        return None, "string", ["" if hole else str(cell) for cell, hole in zip(dates.data, np.ma.getmaskarray(dates), strict=True)]
    if hasattr(column, "frame") or hasattr(column, "to_geodetic"):
        kind = type(column).__name__
        raise InputError("cannot use the table", None, f"a column is a {kind}; numbers, dates or words are needed")
    values = np.ma.asarray(getattr(column, "value", getattr(column, "values", column)))
    if values.ndim != 1:
        raise InputError("cannot use the table", None, f"a column has shape {values.shape}; one value per row is needed")
    empty = np.ma.getmaskarray(values)
    plain = [None if hole else cell for cell, hole in zip(values.data.tolist(), empty, strict=True)]
    datatype = {"f": "float64", "i": "int64", "u": "int64", "b": "bool"}.get(values.dtype.kind, "string")
    if values.dtype.kind == "M":
        plain = [None if np.isnat(cell) else str(cell) for cell in values.data.astype("datetime64[s]")]
    return (str(unit) if unit else None), datatype, [_cell(cell) for cell in plain]


def _difference(value: Any) -> Any:
    """A time difference, of astropy, pandas or numpy, as a quantity of days or of the unit that it has; others as they are."""
    if hasattr(value, "to_value") and hasattr(value, "jd1") and not hasattr(value, "isot"):
        return value.to("d")
    if isinstance(value, datetime.timedelta):
        return _Quantity(value.total_seconds() / 86400, "d")
    values = getattr(value, "values", value)
    if isinstance(values, (np.ndarray, np.generic)) and values.dtype.kind == "m":
        difference: Any = values
        return _Quantity(difference / np.timedelta64(1, "D"), "d")
    return value


class _Quantity(NamedTuple):
    """Numbers with a unit, where astropy may not be there."""

    value: Any
    unit: str


def _in_utc(time: Any) -> Any:
    # A local time has no relation to UTC.
    return time if time.scale == "local" else time.utc


def _cell(cell: Any) -> str:
    if cell is None or (isinstance(cell, float) and np.isnan(cell)):
        return ""
    return repr(cell) if isinstance(cell, float) else str(cell)


def _plain(value: Any) -> Any:
    """Scalars of numpy and dates as JSON has them."""
    if hasattr(value, "isot") and np.ndim(value) == 0:
        return str(_in_utc(value).isot)
    if isinstance(value, np.datetime64):
        return str(value)
    if isinstance(value, np.generic):
        return value.item()
    return value.isoformat() if hasattr(value, "isoformat") else value


def _is_plain(value: Any) -> bool:
    try:
        json.dumps(value)
    except (TypeError, ValueError):
        return False
    return True
