"""Air in layers: temperature, pressure and water vapour against the height."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.air import _check, laws, moist
from nigemizu.air.courses import Course
from nigemizu.errors import InputError

if TYPE_CHECKING:
    from nigemizu.air.atmosphere import Atmosphere

__all__ = ["LayeredIndex", "Profile"]

FloatArray: TypeAlias = NDArray[np.float64]
Gravity: TypeAlias = Callable[[FloatArray], FloatArray]

_GAUSS: Final = tuple(np.polynomial.legendre.leggauss(4))
_BELOW: Final = 1e-6  # of a layer's width, below its upper break, where its own side is looked at
_STEPS: Final = (1e-2, 10.0, 1e-6)  # K, Pa and 1: over which the law of refraction is differentiated
_ROUNDS: Final = 14  # of halving nodes
_MOST_NODES: Final = 200_000
_EVEN, _MOIST = 250.0, 20_000.0  # m: so close are nodes up to where vapour counts
_KINK: Final = 0.02  # m, from a jump of the gradient to the next nodes
_CLOSEST: Final = (2.5e-5, 4e-7)  # m, and of the height: nodes that single precision tells apart
_RELATIVE: Final = 1e-6  # of dn/dh, that is as good as exact: temperatures are not known to a millionth
_HOTTEST: Final = 3000.0  # K


@final
@dataclass(frozen=True, eq=False)
class Profile:
    """Air in layers at rest under its own weight.

    Parameters
    ----------
    course : Course
        Temperature [K] against the height.
    vapour : Course
        Of water vapour, what `vapour_is` says.
    vapour_is : {"fraction", "relative humidity"}
    base, top : float, m
        Heights between which there is air.
    surface_pressure : float, Pa
        At the base.
    gravity : callable
        Gravity [m/s²] at heights [m].
    measured_top : float, m
        Height above which the profile is not data but their continuation.
    notes : tuple of str
        What was assumed.

    Attributes
    ----------
    height : (n,) float64, m
        From `base` to `top`, breaks among them.
    temperature, pressure, vapour_fraction : (n,) float64, K, Pa, 1

    Notes
    -----
    d ln p/dh = −g/(R_d T_v), T_v the virtual temperature, integrated by Gauss's rule with four points in each
    layer, and from a layer's base to any height within (3e-8 of the pressure where temperatures are smooth):
    p and n are as smooth as the temperature, all derivatives continuous between breaks.

    Limits: hydrostatic, ideal gas in the weight of the air (3e-4 of the pressure drop); layers are level.
    """

    course: Course
    vapour: Course
    vapour_is: str
    base: float
    top: float
    surface_pressure: float
    gravity: Gravity
    measured_top: float = np.inf
    notes: tuple[str, ...] = ()
    height: FloatArray = field(init=False)
    temperature: FloatArray = field(init=False)
    pressure: FloatArray = field(init=False)
    vapour_fraction: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        height = self._first_nodes()
        object.__setattr__(self, "height", height)
        object.__setattr__(self, "temperature", self.course.value_and_slope(height)[0])
        wrong = ~((self.temperature > 0) & (self.temperature < _HOTTEST))
        if np.any(wrong):
            place, value = float(height[wrong][0]), float(self.temperature[wrong][0])
            words = f"air of {'0 K or less' if value <= 0 else f'more than {_HOTTEST:g} K'} at {place:g} m"
            raise InputError(words, key="profile", value=value)
        # Of dry air first; the vapour's fraction depends on the pressure only slightly.
        pressure = self._integrated(None)
        for _ in range(3 if self._moist else 0):
            pressure = self._integrated(pressure)
        object.__setattr__(self, "pressure", pressure)
        object.__setattr__(self, "vapour_fraction", self._fraction(height, self.temperature, pressure))
        moist.refuse_boiling(self.vapour_fraction)
        for name in ("height", "temperature", "pressure", "vapour_fraction"):
            getattr(self, name).flags.writeable = False

    @property
    def breaks(self) -> FloatArray:
        """Heights [m] at which a derivative of the temperature, or of the vapour, jumps."""
        breaks = np.unique(np.concatenate([self.course.breaks, self.vapour.breaks]))
        breaks = breaks[(breaks > self.base) & (breaks < self.top)]
        return breaks[np.diff(breaks, prepend=-np.inf) > _closest(breaks)]

    def at(self, height: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Temperature [K], pressure [Pa] and mole fraction of water vapour at heights [m].

        Raises
        ------
        InputError
            If a height lies outside the profile.
        """
        h = _check.checked(
            height, "height", f"metres from {self.base:g} to {self.top:g}", low=self.base, high=self.top
        )
        temperature = self.course.value_and_slope(h)[0]
        pressure = self._pressure_at(h)
        return temperature, pressure, self._fraction(h, temperature, pressure)

    def refractivity(
        self, height: ArrayLike, atmosphere: Atmosphere, wavelength: ArrayLike | None = None
    ) -> FloatArray:
        """n − 1 at heights [m].

        Parameters
        ----------
        height : (...) array_like, m
        atmosphere : Atmosphere
            Its law, CO₂ and wavelength; its pressure and humidity are not used.
        wavelength : float or (K,) array_like, m, optional
            Instead of the atmosphere's; an array gives a last axis of K.
        """
        return _refractivity(self.at(height), atmosphere, wavelength)

    def index(self, atmosphere: Atmosphere, wavelength: ArrayLike | None = None) -> LayeredIndex:
        """The index with its derivative, as `nigemizu.trace.astronomical_refraction` takes it."""
        return LayeredIndex(self, atmosphere, wavelength)

    def nodes(self, tolerance: float = 1e-12) -> FloatArray:
        """Heights [m] at which a volume should know the air.

        Parameters
        ----------
        tolerance : float, 1/m
            By how much, in between, the derivative of Hermite's cubics through n may be wrong, apart from a
            millionth of itself, and from layers that are thinner than 0.1 mm or 2e-6 of their height. At
            1e-12 a ray errs by less than 1e-7 rad over 100 km, even if all errors have one sign.

        Raises
        ------
        InputError
            If it is not above 0, or takes more than 200 000 nodes.

        Notes
        -----
        Layers are halved until that is so. Heights at which the gradient jumps are closely surrounded, so
        that a spline that does not know them rounds them over some centimetres only. n′ = n e^(z/R) over
        conformal heights (`nigemizu.air.Earth`) is as smooth as n over heights.
        """
        from nigemizu.air.atmosphere import Atmosphere

        _check.checked(tolerance, "tolerance", "1/m above 0", above=0.0)
        index = LayeredIndex(self, Atmosphere(), None)
        low, high = self.height[:-1], self.height[1:]
        nodes = [self.height]
        for _ in range(_ROUNDS):
            coarse = (_wrong(index, low, high, tolerance) > 1) & (high - low > 4 * _closest(high))
            if not np.any(coarse):
                break
            low, high = low[coarse], high[coarse]
            nodes.append((low + high) / 2)
            low, high = np.concatenate([low, nodes[-1]]), np.concatenate([nodes[-1], high])
            if sum(map(len, nodes)) > _MOST_NODES:
                raise InputError(
                    f"takes more than {_MOST_NODES} nodes",
                    key="tolerance",
                    value=tolerance,
                    remedy="allow a larger one, or smooth the profile (profile.smoothing)",
                )
        return np.sort(np.concatenate(nodes))

    @property
    def _moist(self) -> bool:
        return bool(np.any(self.vapour.value_and_slope(self.height)[0] > 0))

    def _first_nodes(self) -> FloatArray:
        """Heights that see every break and every layer, coarse elsewhere."""
        far = np.concatenate([[0.0], np.geomspace(0.05, 1.0, 40)]) * (self.top - self.base)
        near = np.concatenate([[0.0], np.geomspace(0.02, 1000.0, 60)])
        # Between these the pressure's logarithm is nearly straight, as the vapour in `_drop` takes it.
        even = np.arange(0.0, _MOIST, _EVEN)
        places = [self.base + far, self.base + near, self.base + even]
        around = np.concatenate([sign * _KINK * 2.0 ** np.arange(12) for sign in (-1, 1)])
        kinks = np.concatenate([self.course.kinks, self.vapour.kinks])
        places.append((kinks[:, None] + around).ravel())
        for middle, extent in self.course.scales:
            places.append(middle + extent * np.linspace(-3, 3, 61))
            places.append(middle + extent * np.linspace(3, 12, 30))
        heights = np.unique(np.concatenate(places))
        # Breaks stay; what is too close to them, or to its neighbour, is left out.
        ends = np.concatenate([[self.base], self.breaks, [self.top]])
        heights = heights[(heights > self.base) & (heights < self.top)]
        closest = _closest(heights)
        heights = heights[(_nearest(heights, ends) > closest) & (np.diff(heights, prepend=-np.inf) > closest)]
        return np.unique(np.concatenate([heights, ends]))

    def _integrated(self, pressure: FloatArray | None) -> FloatArray:
        """Pressure [Pa] at the nodes, with vapour as at `pressure`."""
        low, width = self.height[:-1], np.diff(self.height)
        drops = self._drop(low, width, None if pressure is None else (pressure[:-1], pressure[1:]))
        return np.asarray(self.surface_pressure * np.exp(-np.concatenate([[0.0], np.cumsum(drops)])))

    def _drop(
        self, low: FloatArray, width: FloatArray, pressures: tuple[FloatArray, FloatArray] | None
    ) -> FloatArray:
        """∫ g/(R_d T_v) dh over layers; `pressures` at their ends."""
        points, weights = _GAUSS
        total = np.zeros_like(width)
        for point, weight in zip(points, weights, strict=True):
            part = (point + 1) / 2
            h = low + part * width
            virtual = self.course.value_and_slope(h)[0]
            if pressures is not None:
                below, above = pressures
                fraction = self._fraction(h, virtual, below ** (1 - part) * above**part)
                virtual = virtual * moist.virtual_factor(fraction)
            total += weight / 2 * width * self.gravity(h) / (moist.DRY_AIR_GAS_CONSTANT * virtual)
        return total

    def _pressure_at(self, h: FloatArray) -> FloatArray:
        cell = np.clip(np.searchsorted(self.height, h, side="right") - 1, 0, len(self.height) - 2)
        low, width = self.height[cell], h - self.height[cell]
        pressures = None
        if self._moist:
            part = width / (self.height[cell + 1] - low)
            below, above = self.pressure[cell], self.pressure[cell + 1]
            pressures = (below, below ** (1 - part) * above**part)
        return np.asarray(self.pressure[cell] * np.exp(-self._drop(low, width, pressures)))

    def _fraction(self, h: FloatArray, temperature: FloatArray, pressure: FloatArray) -> FloatArray:
        given = np.maximum(self.vapour.value_and_slope(h)[0], 0.0)
        if self.vapour_is == "fraction" or not np.any(given > 0):
            return given
        return moist.vapour_of(temperature, pressure, np.minimum(given, 1.0))


@final
class LayeredIndex:
    """n − 1 and dn/dh of a profile (`nigemizu.trace.RadialIndex`).

    Parameters
    ----------
    profile : Profile
    atmosphere : Atmosphere
    wavelength : float or (K,) array_like, m, optional
        An array gives results with a last axis of K, for heights with a last axis of 1 or K.
    """

    def __init__(self, profile: Profile, atmosphere: Atmosphere, wavelength: ArrayLike | None) -> None:
        self._profile, self._atmosphere = profile, atmosphere
        self._wavelength = atmosphere.wavelength if wavelength is None else np.asarray(wavelength)
        self.breaks, self.top = profile.breaks, profile.top

    def __call__(self, height: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """n − 1 and dn/dh [1/m] at heights [m], which are held within the profile."""
        profile = self._profile
        h = np.clip(np.asarray(height, dtype=np.float64), profile.base, profile.top)
        temperature, warmth = profile.course.value_and_slope(h)
        pressure = profile._pressure_at(h)
        fraction = profile._fraction(h, temperature, pressure)
        virtual = temperature * moist.virtual_factor(fraction)
        fall = -pressure * profile.gravity(h) / (moist.DRY_AIR_GAS_CONSTANT * virtual)
        given, rise = profile.vapour.value_and_slope(h)
        state = (temperature, pressure, fraction)
        slope = warmth * self._partial(state, 0) + fall * self._partial(state, 1)
        if np.any(fraction > 0):
            if profile.vapour_is != "fraction":
                # x_w = h f(T, p) e_s(T)/p, by all three
                warmer, denser = _STEPS[0], 1e-3 * pressure
                by_warmth = self._change(h, temperature, pressure, warmer, 0.0) / (2 * warmer)
                by_pressure = self._change(h, temperature, pressure, 0.0, denser) / (2 * denser)
                rise = np.divide(fraction * rise, given, out=np.zeros_like(fraction), where=given > 0)
                rise = rise + by_warmth * warmth + by_pressure * fall
            slope = slope + rise * self._partial(state, 2)
        return self._law(*state), slope

    def _change(
        self, h: FloatArray, temperature: FloatArray, pressure: FloatArray, warmer: float, denser: Any
    ) -> FloatArray:
        """Of the vapour's mole fraction, from so much below to so much above."""
        up = self._profile._fraction(h, temperature + warmer, pressure + denser)
        return up - self._profile._fraction(h, temperature - warmer, pressure - denser)

    def _law(self, temperature: FloatArray, pressure: FloatArray, fraction: FloatArray) -> FloatArray:
        return _law(self._atmosphere, self._wavelength, temperature, pressure, fraction)

    def _partial(self, state: tuple[FloatArray, FloatArray, FloatArray], number: int) -> FloatArray:
        step: FloatArray | float = _STEPS[number] if number != 1 else np.minimum(_STEPS[1], 1e-3 * state[1])
        up, down = (
            [part + sign * step if which == number else part for which, part in enumerate(state)]
            for sign in (1, -1)
        )
        if number == 2:
            down[2] = np.maximum(down[2], 0.0)
            return np.asarray((self._law(*up) - self._law(*down)) / (up[2] - down[2]))
        return (self._law(*up) - self._law(*down)) / (2 * step)


def _refractivity(
    state: tuple[FloatArray, FloatArray, FloatArray], atmosphere: Atmosphere, wavelength: ArrayLike | None
) -> FloatArray:
    if wavelength is None:
        return _law(atmosphere, atmosphere.wavelength, *state)
    lengths = np.asarray(wavelength, dtype=np.float64)
    if lengths.ndim:
        state = tuple(part[..., None] for part in state)  # type: ignore[assignment]
    return _law(atmosphere, lengths, *state)


def _law(
    atmosphere: Atmosphere,
    wavelength: ArrayLike,
    temperature: FloatArray,
    pressure: FloatArray,
    fraction: FloatArray,
) -> FloatArray:
    return laws.refractivity(
        temperature,
        pressure,
        vapour_fraction=fraction,
        wavelength=wavelength,
        co2_fraction=atmosphere.co2_fraction,
        model=atmosphere.model,
        gladstone_dale_constant=atmosphere.gladstone_dale_constant,
    )


def _wrong(index: LayeredIndex, low: FloatArray, high: FloatArray, tolerance: float) -> FloatArray:
    """Largest error of the derivative of Hermite's cubics in layers, in units of what is allowed."""
    width = (high - low) * (1 - _BELOW)
    (begin, first), (end, last) = index(low), index(low + width)
    rise, first, last = end - begin, first * width, last * width
    worst = np.zeros_like(width)
    for w in (0.2, 0.5, 0.8):
        cubic = (first + w * (2 * (3 * rise - 2 * first - last) + w * 3 * (first + last - 2 * rise))) / width
        slope = index(low + w * width)[1]
        worst = np.maximum(worst, np.abs(cubic - slope) / (tolerance + _RELATIVE * np.abs(slope)))
    return worst


def _closest(heights: FloatArray) -> FloatArray:
    """How near [m] to heights the next node may be."""
    return np.maximum(_CLOSEST[0], _CLOSEST[1] * np.abs(heights))


def _nearest(heights: FloatArray, ends: FloatArray) -> FloatArray:
    """Distance of each height to the nearest of the ends, which increase."""
    place = np.clip(np.searchsorted(ends, heights), 1, len(ends) - 1)
    return np.asarray(np.minimum(np.abs(heights - ends[place - 1]), np.abs(ends[place] - heights)))
