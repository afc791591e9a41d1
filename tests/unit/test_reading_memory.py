"""A film of air larger than memory: only the instants around the time are held."""

import subprocess
import sys
import textwrap
import tracemalloc

import numpy as np
import pytest
import xarray as xr

from nigemizu.air import Atmosphere
from nigemizu.heat import read_air, refractivity_at

SHAPE = (64, 96, 128)  # 6.3 MB in double precision
VOLUME = int(np.prod(SHAPE)) * 8
INSTANTS = 60
# The indices of the two instants, of the later one its temperature and what it is read from; and room.
ALLOWED = 6


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """Potential temperature in °C, upside down, with ground: everything that has to be converted."""
    import zarr

    path = tmp_path_factory.mktemp("film") / "film.zarr"
    store = zarr.open_group(path, mode="w")
    warm = store.create_array(
        "theta",
        shape=(INSTANTS, *SHAPE),
        chunks=(1, 32, 96, 128),
        dtype="f8",
        dimension_names=("time", "z", "y", "x"),
    )
    warm.attrs["units"] = "degC"
    for index in range(INSTANTS):
        values = np.broadcast_to((25.0 + index / 10.0 + np.zeros(SHAPE[0]))[:, None, None], SHAPE).copy()
        values[-1] = np.nan
        warm[index] = values
    sizes = {"time": INSTANTS, "z": SHAPE[0], "y": SHAPE[1], "x": SHAPE[2]}
    for name, size in sizes.items():
        axis = np.arange(size, dtype=float)[:: -1 if name == "z" else 1]
        store.create_array(name, data=axis.copy(), dimension_names=(name,))
    return path


def test_one_instant_takes_the_memory_of_a_few_volumes(film):
    refractivity_at(read_air(film, crop={"x": (0, 3), "time": (0, 1)}), 0.0, Atmosphere())  # imports
    tracemalloc.start()
    try:
        air = read_air(film)
        index = refractivity_at(air, 20.5, Atmosphere())[3]
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert VOLUME < peak < ALLOWED * VOLUME < INSTANTS * VOLUME / 3
    # The column of air of one potential temperature that lies halfway between the two instants.
    halves = [
        refractivity_at(single(25.0 + tenth / 10.0), 0.0, Atmosphere())[3][:, 0, 0] for tenth in (20, 21)
    ]
    assert index[:, 7, 9] == pytest.approx(0.5 * (halves[0] + halves[1]), rel=1e-9)


def single(celsius):
    z = np.arange(SHAPE[0], dtype=float)
    return read_air(xr.Dataset({"theta": ("z", np.full(z.size, celsius), {"units": "degC"})}, {"z": z}))


def test_cropped_film_takes_the_memory_of_the_box(film):
    air = read_air(film, crop={"x": (10, 41), "y": (10, 33)})
    tracemalloc.start()
    try:
        refractivity_at(air, 20.5, Atmosphere())
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    # A chunk of the file is half a volume, and is opened whole; the box is a sixteenth.
    assert peak < 4 * VOLUME


@pytest.mark.skipif(sys.platform != "linux", reason="the limit on memory is that of Linux")
@pytest.mark.parametrize("greedy", [False, True])
def test_film_is_read_where_it_does_not_fit(film, greedy):
    """In a process that may take a quarter of the film; taking all of it fails there."""
    program = textwrap.dedent(f"""
        import resource
        from nigemizu.air import Atmosphere
        from nigemizu.heat import read_air, refractivity_at

        refractivity_at(read_air({str(film)!r}, crop={{"time": (0, 1)}}), 0.5, Atmosphere())
        with open("/proc/self/status") as status:
            used = next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmData"))
        resource.setrlimit(resource.RLIMIT_DATA, (used + {INSTANTS // 4 * VOLUME}, -1))
        air = read_air({str(film)!r}, available=lambda: None)
        if {greedy}:
            air.load()
        print(refractivity_at(air, 30.25, Atmosphere())[3].shape)
    """)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    if greedy:
        assert done.returncode != 0
        assert "MemoryError" in done.stderr or "allocate" in done.stderr
    else:
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip() == str(SHAPE)
