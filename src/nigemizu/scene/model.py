"""The scene: one frozen, validated description of a whole experiment."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, final

from nigemizu.errors import InputError
from nigemizu.memory import available_memory
from nigemizu.progress import SILENT, ProgressMeter
from nigemizu.scene.builtins import builtin_names, builtin_text
from nigemizu.scene.reading import apply_overrides, parse_toml, read_text, validate
from nigemizu.scene.sections import Sections
from nigemizu.scene.writing import to_toml
from nigemizu.values import nearest

if TYPE_CHECKING:
    import xarray

    from nigemizu.scene import running
    from nigemizu.scene.film import Tell
    from nigemizu.scene.picture import RenderedPicture
    from nigemizu.scene.rays import TracedRays
    from nigemizu.scene.running import AirSource, Variant

__all__ = ["Scene", "builtin_scenes", "load"]


@final
class Scene(Sections):
    """A whole experiment: the air, how it is heated, how light crosses it, and what is seen.

    It is the TOML file, this class, and what the command line's ``--set`` changes.

    Parameters
    ----------
    title : str
        A few words.
    description : str
        What is shown, and where its numbers come from.
    air : Atmosphere
        Pressure, humidity, wavelength and law of refraction.
    earth : Earth, optional
        Its size and the latitude; left out, the world is flat.
    profile : ProfileSpec, optional
        Air in layers: all there is, or what lies above and beyond the mesh.
    grid : GridSpec, optional
        The mesh of air that is heated.
    initial : Initial, optional
        Its temperature at the beginning.
    ground, sides, top, diffusivity, wind : GroundBoundary, Sides, Top, Diffusivity, Wind
        Boundaries of that air, and how heat spreads and is carried.
    process : {"diffusion", "convection"}
        Whether heat spreads in air that the wind alone moves, or hot air rises, breaks up and mixes.
    convection : Convection
        How it does so.
    sources : tuple of Source
        What is heated or pushed inside air that moves by itself.
    turbulence : Turbulence, optional
        Fluctuations that no grid computes, added where light passes.
    time, film, tracer : TimeSpec, FilmSpec, Tracer
        What is simulated, what a film shows, and how rays are followed.
    camera, light : Camera, Light
        The eye, and sun and sky.
    objects : tuple of Object
        What stands in the scene.

    Examples
    --------
    >>> scene = Scene.load("pyramid", {"camera.samples": 4})
    >>> scene.camera.samples
    4
    >>> Scene.from_toml(scene.to_toml()) == scene
    True
    """

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> Self:
        """Read a built-in scene or a TOML file.

        Parameters
        ----------
        name_or_path : str or path
            Name of a built-in scene (`builtin_scenes`) or path of a TOML file.
        overrides : mapping, optional
            ``{"section.key": value}`` to replace, as ``--set`` does.

        Raises
        ------
        InputError
            If there is no such scene or anything in it cannot be used.
        """
        name = os.fspath(name_or_path)
        if name in builtin_names():
            return cls.from_toml(builtin_text(name), file=name, overrides=overrides)
        path = Path(name).expanduser()
        if not path.is_file():
            raise InputError("no such scene or file", file=name, remedy=nearest(name, builtin_names()))
        return cls.from_toml(read_text(path), file=name, folder=path.resolve().parent, overrides=overrides)

    @classmethod
    def from_toml(
        cls,
        text: str,
        *,
        file: str | None = None,
        folder: Path | None = None,
        overrides: Mapping[str, Any] | None = None,
    ) -> Self:
        """Read a scene from TOML text; relative paths in it count from `folder` (the working directory)."""
        try:
            data = apply_overrides(parse_toml(text, file), overrides or {})
        except InputError as error:
            raise error.in_file(file) from error
        return validate(cls, data, file=file, folder=folder or Path.cwd())

    def with_changes(self, overrides: Mapping[str, Any]) -> Self:
        """Return a scene with ``{"section.key": value}`` replaced, and everything validated again."""
        return self.from_toml(self.to_toml(), overrides=overrides)

    def to_toml(self, *, comments: bool = False) -> str:
        """The scene as TOML that reads back equal; with `comments`, units and meanings stand beside keys."""
        return to_toml(self, comments=comments)

    @classmethod
    def json_schema(cls) -> dict[str, Any]:
        """JSON schema of scene files; editors with TOML support complete and check keys with it."""
        from nigemizu.scene.schema import schema

        return schema(cls)

    def check(self, *, available: Callable[[], int | None] = available_memory) -> None:
        """Look for what cannot work although each value is valid by itself.

        Parameters
        ----------
        available : callable
            Tells the bytes of memory at hand, or None.

        Raises
        ------
        InputError
            For an eye below the ground, a volume larger than the memory, a missing file.

        Warns
        -----
        NigemizuWarning
            For objects beyond the air that bends light.
        """
        from nigemizu.scene.checks import check

        check(self, available)

    def simulate(
        self,
        times: Iterable[float] | None = None,
        *,
        variant: Variant = "auto",
        progress: ProgressMeter = SILENT,
    ) -> xarray.Dataset:
        """Heat the air.

        Parameters
        ----------
        times : iterable of float, s, optional
            Instants to keep; those of `time` unless given.
        variant : {"auto", "llvm", "cuda"}
            Where air moves by itself: on the processor (``llvm``), or on a graphics card.
        progress : ProgressMeter
            Receives how far the work has come.

        Returns
        -------
        xarray.Dataset
            ``air_temperature``, ``surface_temperature``, ``air_pressure`` and ``air_refractivity`` over
            ``(time, z, y, x)``.
        """
        from nigemizu.scene import running

        instants = self.time.stored if times is None else tuple(times)
        return running.simulate(self, instants, progress, variant)

    def save_air(
        self,
        path: str | os.PathLike[str],
        *,
        variant: Variant = "auto",
        command: str = "",
        progress: ProgressMeter = SILENT,
    ) -> Path:
        """Heat the air and write it to ``.zarr`` or ``.nc``, instant by instant.

        One instant is held at a time: the dataset may be larger than the memory.
        """
        from nigemizu.scene import running

        return running.save_air(self, Path(path), command, progress, variant)

    def air_at(
        self,
        time: float | None = None,
        *,
        air: AirSource = None,
        progress: ProgressMeter = SILENT,
    ) -> running.AirVolume:
        """The refractive-index volume at an instant [s], simulated, or taken from the dataset `air`."""
        from nigemizu.scene import running

        return running.air_at(self, time, air, progress)

    def render(
        self,
        time: float | None = None,
        *,
        air: AirSource = None,
        method: str | None = None,
        samples: int | None = None,
        truth: bool = False,
        variant: Variant = "auto",
        progress: ProgressMeter = SILENT,
    ) -> RenderedPicture:
        """Render one picture.

        Parameters
        ----------
        time : float, s, optional
            Instant to show; that of `time` unless given.
        air : dataset, path or AirVolume, optional
            Air to look through instead of simulating it.
        method : {"bent", "straight", "layered"}, optional
            How light travels, instead of ``tracer.method``.
        samples : int, optional
            Rays per pixel, instead of ``camera.samples``.
        truth : bool
            Whether to find out what each pixel sees, too (`nigemizu.scene.truth`).
        variant : {"auto", "llvm", "cuda"}
            Compute device; one per process.
        progress : ProgressMeter
            Receives how far the work has come.

        Returns
        -------
        RenderedPicture
            Its ``pixels`` are linear light; ``save("x.png")`` and ``save("x.exr")`` write it.
        """
        from nigemizu.scene import rendering

        return rendering.render(self._seen(method, samples), time, air, variant, progress, truth=truth)

    def compare(
        self,
        path: str | os.PathLike[str],
        *,
        time: float | None = None,
        air: AirSource = None,
        variant: Variant = "auto",
        command: str = "",
        progress: ProgressMeter = SILENT,
    ) -> list[Path]:
        """Render by straight, layered and bent light, into one labelled picture and each alone.

        Parameters
        ----------
        path : path
            The ``.png`` to write; the single pictures go beside it, ``…_straight.png`` and so on.
        time, air, variant, command, progress
            As for `render` and `animate`.

        Returns
        -------
        list of Path
            The comparison, then the single pictures.
        """
        from nigemizu.scene import comparison

        return comparison.compare(self, Path(path), time, air, variant, command, progress)

    def animate(
        self,
        path: str | os.PathLike[str],
        *,
        air: AirSource = None,
        method: str | None = None,
        samples: int | None = None,
        workers: int = 1,
        variant: Variant = "auto",
        command: str = "",
        progress: ProgressMeter = SILENT,
        tell: Tell | None = None,
        truth: bool = False,
    ) -> Path:
        """Render the film `film` into an MP4 and a folder of numbered frames beside it.

        A film that was interrupted goes on where it stopped when this is called again.

        Parameters
        ----------
        path : path
            The ``.mp4`` (or ``.gif``, ``.webp``) to write.
        workers : int
            Processes that render. More than one needs the calling script to protect its main part with
            ``if __name__ == "__main__":``.
        air, method, samples, variant, progress, truth
            As for `render`; ground truth goes into a folder ``NAME_truth`` beside the film.
        command : str
            Kept in the film's header: how it was made.
        tell : callable, optional
            Called as ``tell(statuses, report)``: camera rays by status, the joined error report.

        Returns
        -------
        Path
            Where the film is.
        """
        from nigemizu.scene import film

        seen = self._seen(method, samples)
        return film.animate(seen, Path(path), air, workers, variant, command, progress, tell, truth=truth)

    def trace(
        self,
        elevations: Iterable[float] | None = None,
        azimuths: Iterable[float] | None = None,
        *,
        time: float | None = None,
        air: AirSource = None,
        method: str | None = None,
        paths: bool = True,
        variant: Variant = "auto",
        progress: ProgressMeter = SILENT,
    ) -> TracedRays:
        """Follow single rays from the eye.

        Parameters
        ----------
        elevations : iterable of float, degrees, optional
            Above the horizontal; a fan over what the camera sees near the horizon unless given.
        azimuths : iterable of float, degrees, optional
            From the camera's heading, positive to the left; 0 unless given. Every elevation is traced at
            every azimuth.
        paths : bool
            Whether to keep the points along the rays, which the diagram shows.
        time, air, method, variant, progress
            As for `render`.

        Returns
        -------
        TracedRays
            One record per ray, and the paths; ``save("rays.svg")`` draws the ray diagram.
        """
        from nigemizu.scene import rays

        seen = self._seen(method, None)
        options: dict[str, Any] = {"variant": variant, "progress": progress}
        return rays.trace(seen, elevations, azimuths, time=time, air=air, paths=paths, **options)

    def _seen(self, method: str | None, samples: int | None) -> Scene:
        changes = {"tracer.method": method, "camera.samples": samples}
        given = {key: value for key, value in changes.items() if value is not None}
        return self.with_changes(given) if given else self


def load(name_or_path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> Scene:
    """Read a built-in scene or a TOML file; see `Scene.load`."""
    return Scene.load(name_or_path, overrides)


def builtin_scenes() -> dict[str, str]:
    """Names of the built-in scenes and their titles."""
    return {name: Scene.load(name).title for name in builtin_names()}
