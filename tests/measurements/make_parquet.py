#!/usr/bin/env python3
"""Parquet files to test the reader with, as astropy, pandas and pyarrow write them.

Made by   astropy 6.1.7, numpy 1.26.4, pandas 2.2.3, pyarrow 20.0.0 (Python 3.11); two seconds.
Command   python tests/measurements/make_parquet.py      writes parquet/*.parquet and parquet/same.csv beside this file

All of parquet/*.parquet hold the measurements of parquet/same.csv: doses at four dates, with other units, types of times,
compressions and places for what `meta` says. The numbers are of the size that missions/snap_l2.toml gives, no more.
"""

import datetime
from pathlib import Path

import astropy.units as u
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from astropy.table import Column, MaskedColumn, QTable, Table
from astropy.time import Time, TimeDelta

HERE = Path(__file__).resolve().parent / "parquet"
DATES = ["2009-07-02T12:00:00", "2010-01-01T00:00:00", "2011-07-02T06:00:00", "2012-07-01T00:00:00"]
LAUNCH = datetime.datetime(2009, 1, 1)
DAYS = [(datetime.datetime.fromisoformat(date) - LAUNCH).total_seconds() / 86400 for date in DATES]
VALUE, SIGMA = [8.1e5, 1.62e6, 4.05e6, 5.67e6], [2e4] * 4
SAID = {"observable": "dose"}


def of_astropy(name, kind=Table, **columns):
    table = kind(columns)
    # A QTable cannot be written with a Quantity called `value`.
    unit = None if kind is QTable else "MeV / g"
    table["value"], table["sigma"] = Column(VALUE, unit=unit), Column(SIGMA, unit=unit)
    table.meta.update(SAID)
    table.write(HERE / f"astropy_{name}.parquet", overwrite=True)


def of_pandas(name, **columns):
    frame = pd.DataFrame({**columns, "value": VALUE, "sigma": SIGMA})
    frame.attrs.update(SAID)
    return lambda **how: frame.to_parquet(HERE / f"pandas_{name}.parquet", **how)


def of_pyarrow(name, dates, kind, fields=None, **how):
    table = pa.table({"date": pa.array(dates, kind), "value": VALUE, "sigma": SIGMA}).replace_schema_metadata(SAID)
    pq.write_table(table, HERE / f"pyarrow_{name}.parquet", **how)


def main():
    HERE.mkdir(exist_ok=True)
    rows = "".join(f"{date},{value!r},{sigma!r}\n" for date, value, sigma in zip(DATES, VALUE, SIGMA))
    (HERE / "same.csv").write_text("# observable: dose\ndate,value,sigma\n" + rows)

    of_astropy("days", t_yr=Column(DAYS, unit="d"))
    of_astropy("hours_masked", t_yr=MaskedColumn(np.array(DAYS) * 24, unit="h", mask=[False] * 4))
    of_astropy("quantity", QTable, t_yr=DAYS * u.day)
    of_astropy("time", date=Time(DATES))
    of_astropy("time_tt", date=Time(DATES).tt)
    of_astropy("difference", t_yr=TimeDelta(DAYS, format="jd"))
    times = pd.to_datetime(DATES)
    of_pandas("ns", date=times)()
    of_pandas("ns_utc", date=times.tz_localize("UTC"))()
    of_pandas("ns_rome", date=times.tz_localize("UTC").tz_convert("Europe/Rome"))()
    of_pandas("us", date=times.astype("datetime64[us]"))()
    of_pandas("ms", date=times.astype("datetime64[ms]"))()
    of_pandas("s", date=times.astype("datetime64[s]"))()
    of_pandas("int96", date=times)(use_deprecated_int96_timestamps=True)
    of_pandas("difference", t_yr=times - pd.Timestamp(LAUNCH))()
    of_pandas("strings", date=DATES)()
    of_pandas("zoned_strings", date=[date + "+00:00" for date in DATES])()
    of_pandas("decades", date=DATES)(index=True)
    for compression in ("snappy", "gzip", "zstd", "lz4", None):
        of_pandas(f"compressed_{compression}", date=times)(compression=compression)
    moments = [datetime.datetime.fromisoformat(date) for date in DATES]
    for unit in ("s", "ms", "us", "ns"):
        of_pyarrow(unit, moments, pa.timestamp(unit))
        of_pyarrow(f"{unit}_utc", moments, pa.timestamp(unit, "UTC"))
        # Durations, and units in the metadata of a field.
        differences = pa.array([moment - LAUNCH for moment in moments], pa.duration(unit))
        pair = pa.table({"t_yr": differences, "value": VALUE, "sigma": SIGMA}).replace_schema_metadata(SAID)
        pq.write_table(pair, HERE / f"pyarrow_duration_{unit}.parquet")
    with_unit = lambda name, unit: pa.field(name, pa.float64(), metadata={"note": "as read", "unit": unit})
    schema = pa.schema([with_unit("t_yr", "d"), with_unit("value", "keV / g"), with_unit("sigma", "keV / g")], metadata=SAID)
    kilo = [[1e3 * number for number in numbers] for numbers in (VALUE, SIGMA)]
    pq.write_table(pa.table([DAYS, *kilo], schema=schema), HERE / "pyarrow_units.parquet")


if __name__ == "__main__":
    main()
