"""Air as a labelled dataset: made from states of the heat equation, completed, turned into refractivity."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.air import Atmosphere
from nigemizu.errors import InputError
from nigemizu.heat.instants import Index, at_instant, bracket, has_temperature, instants, shaped
from nigemizu.heat.reading import absolute, read_air

if TYPE_CHECKING:
    from nigemizu.heat.grid import Grid

__all__ = ["UNBOUNDED", "complete", "mean_temperature_at", "read_air", "refractivity_at", "to_dataset"]

FloatArray: TypeAlias = NDArray[np.float64]

UNBOUNDED: Final = 1e5
"""m; half the width given to a horizontal axis that a dataset lacks, as a profile does."""

_AXES: Final[dict[str, dict[str, str]]] = {
    "time": {"long_name": "time since the start", "units": "s", "axis": "T"},
    "z": {
        "standard_name": "height",
        "long_name": "height above the ground",
        "units": "m",
        "axis": "Z",
        "positive": "up",
    },
    "y": {"standard_name": "projection_y_coordinate", "long_name": "left", "units": "m", "axis": "Y"},
    "x": {"standard_name": "projection_x_coordinate", "long_name": "forward", "units": "m", "axis": "X"},
}
_WIND: Final = {"x_wind": "forward", "y_wind": "to the left", "upward_air_velocity": "upwards"}
_VARIABLES: Final[dict[str, dict[str, str]]] = {
    "air_temperature": {
        "standard_name": "air_temperature",
        "long_name": "air temperature at the centres of the cells",
        "units": "K",
        "units_metadata": "temperature: on_scale",
    },
    "surface_temperature": {
        "standard_name": "surface_temperature",
        "long_name": "temperature of the skin of the ground",
        "units": "K",
        "units_metadata": "temperature: on_scale",
    },
    **{
        name: {"standard_name": name, "long_name": f"wind {way}", "units": "m s-1"}
        for name, way in _WIND.items()
    },
    "air_pressure": {"standard_name": "air_pressure", "long_name": "hydrostatic air pressure", "units": "Pa"},
    "air_refractivity": {
        "long_name": "refractivity of air, n - 1",
        "units": "1",
        "comment": "not a CF standard name; phase refractive index minus one",
    },
}


class _StateLike(Protocol):
    """An instant of the air, as the solver yields it."""

    @property
    def time(self) -> float: ...
    @property
    def temperature(self) -> FloatArray: ...
    @property
    def surface_temperature(self) -> FloatArray | None: ...


def to_dataset(
    grid: Grid,
    states: Iterable[_StateLike],
    *,
    title: str = "",
    scene: str = "",
    history: str = "",
) -> xr.Dataset:
    """Collect instants of the air into a dataset with CF attributes.

    Parameters
    ----------
    grid : Grid
        Its nz, ny, nx cells hold the temperatures.
    states : iterable of State
        Each with ``time`` (s), ``temperature`` (nz, ny, nx) float64 (K) and ``surface_temperature``
        (ny, nx) float64 (K), or None; where the air moves by itself also ``wind`` (m/s), three volumes.
    title : str
        What the air is, in a few words.
    scene : str
        The scene that made it, as TOML, kept in the attribute ``nigemizu_scene``.
    history : str
        The command that made it.

    Returns
    -------
    xarray.Dataset
        ``air_temperature`` on (time, z, y, x), ``surface_temperature`` on (time, y, x), K, the wind (m/s) if
        it is known, and the faces of the cells. With a single state the temperature is not copied.

    Raises
    ------
    InputError
        There is no state, or one does not fit the grid.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from nigemizu.heat import Grid
    >>> grid = Grid(np.linspace(0, 4, 5), np.linspace(0, 3, 4), np.linspace(0, 2, 3))
    >>> state = SimpleNamespace(time=0.0, temperature=np.full(grid.shape, 300.0), surface_temperature=None)
    >>> dict(to_dataset(grid, [state]).sizes)["x"]
    4
    """
    instants = list(states)
    if not instants:
        raise InputError("no instant of the air was given", key="states")
    for state in instants:
        if state.temperature.shape != grid.shape:
            raise InputError(
                "the temperature does not fit the grid",
                key="temperature",
                value=state.temperature.shape,
                expected=f"the shape {grid.shape}",
            )
    coordinates: dict[str, Any] = {
        "time": ("time", np.array([state.time for state in instants], dtype=np.float64), _AXES["time"]),
        "z": ("z", grid.z, {**_AXES["z"], "bounds": "z_bounds"}),
        "y": ("y", grid.y, {**_AXES["y"], "bounds": "y_bounds"}),
        "x": ("x", grid.x, {**_AXES["x"], "bounds": "x_bounds"}),
    }
    edges = {"z": grid.z_edges, "y": grid.y_edges, "x": grid.x_edges}
    variables: dict[str, Any] = {
        "air_temperature": (
            ("time", "z", "y", "x"),
            _stacked([state.temperature for state in instants]),
            _VARIABLES["air_temperature"],
        )
    }
    surfaces = [state.surface_temperature for state in instants]
    known = [surface for surface in surfaces if surface is not None]
    if len(known) == len(instants):
        variables["surface_temperature"] = (
            ("time", "y", "x"),
            _stacked(known),
            _VARIABLES["surface_temperature"],
        )
    winds = [getattr(state, "wind", None) for state in instants]
    if all(wind is not None for wind in winds):
        for name, part in zip(_WIND, zip(*winds, strict=True), strict=True):
            variables[name] = (("time", "z", "y", "x"), _stacked(list(part)), _VARIABLES[name])
    for name, edge in edges.items():
        variables[f"{name}_bounds"] = ((name, "bounds"), np.stack([edge[:-1], edge[1:]], axis=1))
    return xr.Dataset(variables, coordinates, _provenance(title, scene, history))


def complete(dataset: xr.Dataset, atmosphere: Atmosphere) -> xr.Dataset:
    """Return the dataset with hydrostatic pressure and refractivity added, every instant of it.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `to_dataset` or `read_air` return it.
    atmosphere : Atmosphere
        What the dataset does not say of the air.

    Returns
    -------
    xarray.Dataset
        With ``air_pressure`` (time, z), Pa, unless it was there, and ``air_refractivity``, n − 1, on all of
        its axes; a potential temperature has become one of temperature. The given dataset is not changed.

    Raises
    ------
    InputError
        The dataset holds no temperature, or the atmosphere cannot exist at its temperatures.

    Notes
    -----
    The pressure is hydrostatic in the horizontal mean of the temperature. Limits: pressure differences
    between neighbouring columns, below 1 Pa over a hot road, are left out; they change n − 1 by less than
    1e-5 of itself.
    """
    if not has_temperature(dataset):
        raise InputError("the dataset has no temperature to be completed", key="air_temperature")
    axes = [axis for axis in ("time", "z", "y", "x") if axis in dataset.dims]
    refractivity = np.empty([dataset.sizes[axis] for axis in axes])
    pressures = []
    for index in instants(dataset):
        temperature, pressure, humidity = _state(at_instant(dataset, index, atmosphere), atmosphere)
        volume = atmosphere.refractivity(temperature, pressure, relative_humidity=humidity)
        refractivity[index] = volume.reshape(refractivity[index].shape)
        pressures.append(pressure[:, 0, 0])
    added: dict[str, Any] = {
        "air_refractivity": (
            axes,
            refractivity,
            {
                **_VARIABLES["air_refractivity"],
                "wavelength_m": atmosphere.wavelength,
                "refractivity_model": atmosphere.model,
            },
        )
    }
    if "air_pressure" not in dataset:
        timed = "time" in dataset.dims
        added["air_pressure"] = (
            ("time", "z") if timed else ("z",),
            np.stack(pressures) if timed else pressures[0],
            _VARIABLES["air_pressure"],
        )
    completed = dataset.assign(added)
    if "air_temperature" in completed:
        return completed
    warmth = absolute(completed["air_potential_temperature"], completed["air_pressure"])
    return completed.drop_vars("air_potential_temperature").assign(air_temperature=warmth)


def refractivity_at(
    dataset: xr.Dataset, time: float, atmosphere: Atmosphere
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Refractivity of the air at one instant, linear in time between the stored ones.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `to_dataset`, `complete` or `read_air` return it.
    time : float, s
        Any, when the dataset has no time axis.
    atmosphere : Atmosphere
        Pressure at height 0, humidity, wavelength and law, for what the dataset does not hold. A stored
        ``air_refractivity`` is used only when there is no temperature.

    Returns
    -------
    x : (nx,) ndarray of float64, m
    y : (ny,) ndarray of float64, m
    z : (nz,) ndarray of float64, m
        From 0 when the temperature of the ground is known: its skin is then the first node, so that the
        volume reaches the ground.
    refractivity : (nz, ny, nx) ndarray of float64, 1
        n − 1. A horizontal axis that the dataset lacks has two nodes at ∓`UNBOUNDED`.

    Raises
    ------
    InputError
        The time is outside the range of the dataset.

    Notes
    -----
    n(t) = (1 − w) n(t₀) + w n(t₁), w = (t − t₀)/(t₁ − t₀).
    """
    lower, upper, weight = bracket(dataset, time)
    z, values = _nodes(dataset, lower, atmosphere)
    if weight > 0.0:
        later = _nodes(dataset, upper, atmosphere)[1]
        values = values + weight * (later - values)
    x, y = _horizontal(dataset, "x"), _horizontal(dataset, "y")
    full = np.broadcast_to(values, (z.size, y.size, x.size))
    return x, y, z, np.ascontiguousarray(full)


def mean_temperature_at(
    dataset: xr.Dataset, time: float, atmosphere: Atmosphere | None = None
) -> FloatArray | None:
    """Horizontal mean of the temperature at the heights of `refractivity_at`, linear in time.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `to_dataset`, `complete` or `read_air` return it.
    time : float, s
        Any, when the dataset has no time axis.
    atmosphere : Atmosphere, optional
        Tells the pressure at height 0, for a potential temperature without a pressure; default: the standard.

    Returns
    -------
    (nz,) ndarray of float64, K, or None
        The skin of the ground first, when it is known. None when only the refractivity is stored.

    Raises
    ------
    InputError
        The time is outside the range of the dataset.
    """
    if not has_temperature(dataset):
        return None
    air = atmosphere or Atmosphere()
    lower, upper, weight = bracket(dataset, time)
    before, after = (_mean_nodes(at_instant(dataset, index, air, optics=False)) for index in (lower, upper))
    return before + weight * (after - before)


def _stacked(arrays: list[FloatArray]) -> FloatArray:
    return arrays[0][np.newaxis] if len(arrays) == 1 else np.stack(arrays)


def _provenance(title: str, scene: str, history: str) -> dict[str, str]:
    attributes = {"Conventions": "CF-1.11", "source": f"nigemizu {version('nigemizu')}"}
    attributes |= {"title": title} if title else {}
    attributes |= {"history": history} if history else {}
    attributes |= {"nigemizu_scene": scene} if scene else {}
    return attributes


def _state(instant: xr.Dataset, atmosphere: Atmosphere) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Temperature, pressure and humidity (if stored) of the instant, broadcastable to (nz, ny, nx)."""
    temperature = shaped(instant["air_temperature"])
    humidity = shaped(instant["relative_humidity"]) if "relative_humidity" in instant else None
    if "air_pressure" in instant:
        return temperature, shaped(instant["air_pressure"]), humidity
    profile = temperature.mean(axis=(1, 2))
    pressure = atmosphere.hydrostatic_pressure(instant["z"].values, profile)
    return temperature, pressure[:, None, None], humidity


def _nodes(dataset: xr.Dataset, index: Index, atmosphere: Atmosphere) -> tuple[FloatArray, FloatArray]:
    """Heights and refractivity (nz, ny or 1, nx or 1) of a stored instant, with the ground below if known."""
    instant = at_instant(dataset, index, atmosphere)
    z = np.asarray(dataset["z"].values, dtype=np.float64)
    if not has_temperature(dataset):
        return z, shaped(instant["air_refractivity"])
    temperature, pressure, humidity = _state(instant, atmosphere)
    air = atmosphere.refractivity(temperature, pressure, relative_humidity=humidity)
    if not _has_skin(instant):
        return z, air
    surface = shaped(instant["surface_temperature"].expand_dims("z"))
    # The air below the first node is hydrostatic too, at that node's temperature.
    column = atmosphere.hydrostatic_pressure(z[:1], temperature[:1].mean(axis=(1, 2)))
    base = pressure[:1] * (atmosphere.surface_pressure / column[0])
    ground = atmosphere.refractivity(
        surface, base, relative_humidity=None if humidity is None else humidity[:1]
    )
    shape = np.broadcast_shapes(air.shape[1:], ground.shape[1:])
    joined = [np.broadcast_to(part, (part.shape[0], *shape)) for part in (ground, air)]
    return np.concatenate([[0.0], z]), np.concatenate(joined)


def _has_skin(instant: xr.Dataset) -> bool:
    """Whether the skin of the ground is a node of its own below the others."""
    return "surface_temperature" in instant and float(instant["z"][0]) > 0.0


def _mean_nodes(instant: xr.Dataset) -> FloatArray:
    means = shaped(instant["air_temperature"]).mean(axis=(1, 2))
    if not _has_skin(instant):
        return np.asarray(means)
    return np.concatenate([[float(instant["surface_temperature"].mean())], means])


def _horizontal(dataset: xr.Dataset, axis: str) -> FloatArray:
    if axis not in dataset.dims:
        return np.array([-UNBOUNDED, UNBOUNDED])
    values = np.asarray(dataset[axis].values, dtype=np.float64)
    return values if values.size > 1 else values[0] + np.array([-UNBOUNDED, UNBOUNDED])
