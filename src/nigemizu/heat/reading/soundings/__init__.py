"""Measured air: radiosondes, columns of models, and a person's own table, as plain arrays."""

from __future__ import annotations

from datetime import date, datetime
from pathlib import Path

import numpy as np

from nigemizu.heat.reading.soundings.choosing import wanted
from nigemizu.heat.reading.soundings.completing import finish
from nigemizu.heat.reading.soundings.sniffing import kind_of
from nigemizu.heat.reading.soundings.sounding import Sounding

__all__ = ["Sounding", "read_sounding"]


def read_sounding(
    path: str | Path,
    *,
    time: str | date | datetime | np.datetime64 | None = None,
    place: tuple[float, float] | None = None,
    station: str | int | None = None,
) -> Sounding:
    """Read a column of air from a file that a weather service, a model or a person wrote.

    Parameters
    ----------
    path : path
        A page of the University of Wyoming (TEXT:LIST, as text or HTML, or its CSV); a data file of IGRA v2,
        also packed (.zip, .gz); a netCDF file or Zarr store with columns of a model such as ERA5; a table in
        CSV or TOML. The content tells which, not the name.
    time : str, date, datetime or numpy.datetime64, optional
        In UTC unless it says otherwise, such as ``"2026-07-01 12:00"``; a date alone where the day has one
        sounding. Needed where the file holds several.
    place : (float, float), degree, optional
        Latitude and longitude, north and east. Chooses the nearest column of a model, within half a cell, or
        the sounding nearest to it, within 1 degree.
    station : str or int, optional
        Number, identifier or name of a station.

    Returns
    -------
    Sounding

    Raises
    ------
    InputError
        In one line: nothing is there, or a file of another kind (what it looks like); no such time, place or
        station (what there is); a value that cannot be (its row and the value): a temperature, pressure or
        humidity that no air has, heights that fall, pressures that rise or that the heights contradict; a
        record that is cut short; fewer than 3 levels that can be used.

    Notes
    -----
    Dew point and relative humidity are over liquid water at every temperature, as sondes report them; the
    mole fraction of vapour is x = f(p, T_d) e_w(T_d)/p, or x = h f(p, T) e_w(T)/p. Where a level has both,
    the dew point counts. Geopotential heights become geometric ones on the ellipsoid of the Earth. What is
    missing, doubled or filled in stands in `Sounding.notes`.

    Limits: no pressure levels in hybrid coordinates, no BUFR, no GRIB.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> rows = "height [m],temperature [C],pressure [hPa],humidity [%]"
    >>> rows += "\\n2,31.0,1005.0,40\\n50,28.5,999.6,45\\n200,27.0,982.7,47"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "mast.csv")
    ...     _ = file.write_text(rows)
    ...     sounding = read_sounding(file)
    >>> sounding.height
    array([  2.,  50., 200.])
    >>> sounding.vapour_fraction.round(4)
    array([0.018 , 0.0176, 0.0171])
    """
    path = Path(path).expanduser()
    want = wanted(time, place, station)
    kind = kind_of(path)
    # The readers are imported when needed: xarray alone takes longer than a text file.
    if kind == "columns":
        from nigemizu.heat.reading.soundings.columns import read_column

        levels = read_column(path, want)
    elif kind == "igra":
        from nigemizu.heat.reading.soundings.igra import read_igra

        levels = read_igra(path, want)
    elif kind == "wyoming":
        from nigemizu.heat.reading.soundings.wyoming import read_wyoming

        levels = read_wyoming(path, want)
    elif kind == "toml":
        from nigemizu.heat.reading.soundings.tables import read_toml

        levels = read_toml(path, want)
    else:
        from nigemizu.heat.reading.soundings.tables import read_csv

        levels = read_csv(path, want, wyoming=kind == "wyoming-csv")
    return finish(levels, str(path))
