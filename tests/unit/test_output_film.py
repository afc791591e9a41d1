"""Films and their numbered frames: whole, resumable, and readable by others."""

import errno
import json
import os

import av
import numpy as np
import pytest
from PIL import Image

from nigemizu.errors import InputError, MachineError
from nigemizu.output import FrameFolder, Provenance, encoded, read_picture, write_film, write_png

SCENE = Provenance(scene='title = "road"\n[camera]\nsamples = 16\n', command="nigemizu animate road")


def picture(number, height=48, width=64):
    """A smooth grey ramp on which a red column moves."""
    pixels = np.repeat(np.linspace(40, 200, width, dtype=np.uint8)[None, :, None], 3, axis=2)
    pixels = np.repeat(pixels, height, axis=0)
    pixels[:, 8 * number : 8 * number + 8] = (200, 30, 30)
    return pixels


@pytest.fixture
def folder(tmp_path):
    return FrameFolder(tmp_path / "road.frames", 3, SCENE)


def test_frames_that_are_there_are_done(folder):
    assert folder.missing() == [0, 1, 2]
    folder.write(1, np.zeros((4, 4, 3)))
    assert folder.missing() == [0, 2]
    assert [path.name for path in folder.frames()] == ["0000.png", "0001.png", "0002.png"]
    manifest = json.loads((folder.path / "frames.json").read_text(encoding="utf-8"))
    assert manifest["frames"] == ["0000.png", "0001.png", "0002.png"]
    assert manifest["origin"]["scene"] == SCENE.scene
    assert len(manifest["sha256"]) == 64


def test_an_interrupted_film_goes_on(folder):
    folder.write(0, np.zeros((4, 4, 3)))
    killed = folder.path / ".0001.abcd1234.part.png"
    killed.write_text("half a fr")
    again = FrameFolder(folder.path, 3, Provenance(scene=SCENE.scene, command="another command line"))
    assert again.missing() == [1, 2]
    assert not killed.exists()


def test_frames_of_another_scene_are_refused(folder):
    other = Provenance(scene=SCENE.scene.replace("16", "64"))
    with pytest.raises(
        InputError, match=r"made otherwise: \[camera\] 'samples = 16' is now 'samples = 64'"
    ) as raised:
        FrameFolder(folder.path, 3, other)
    assert "remove this folder" in str(raised.value)
    with pytest.raises(InputError, match=r"air was None and is 'other\.zarr'"):
        FrameFolder(folder.path, 3, SCENE, inputs={"air": "other.zarr"})
    with pytest.raises(InputError, match=r"holds 3 frames like 0000\.png; expected 4 like 0000\.png"):
        FrameFolder(folder.path, 4, SCENE)
    with pytest.raises(InputError, match=r"expected 3 like 0000\.exr"):
        FrameFolder(folder.path, 3, SCENE, suffix=".exr")


def test_frames_of_another_version_are_refused(folder, monkeypatch):
    monkeypatch.setattr(Provenance, "software", "nigemizu 99")
    with pytest.raises(InputError, match=r"software was 'nigemizu \S+' and is 'nigemizu 99'"):
        FrameFolder(folder.path, 3, SCENE)


def test_a_folder_with_something_else_is_left_alone(tmp_path):
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="holds something else"):
        FrameFolder(tmp_path, 3, SCENE)
    with pytest.raises(InputError, match="not a folder"):
        FrameFolder(tmp_path / "thesis.txt", 3, SCENE)
    with pytest.raises(InputError, match="mkdir -p"):
        FrameFolder(tmp_path / "missing" / "frames", 3, SCENE)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_broken_list_is_told(folder):
    (folder.path / "frames.json").write_text("{")
    with pytest.raises(InputError, match="list of frames cannot be read"):
        FrameFolder(folder.path, 3, SCENE)


def test_impossible_frames(folder, tmp_path):
    with pytest.raises(InputError, match="a number from 0 to 2"):
        folder.frame(3)
    with pytest.raises(InputError, match="at least one frame"):
        FrameFolder(tmp_path / "none", 0, SCENE)
    with pytest.raises(InputError, match=r"\.png or \.exr"):
        FrameFolder(tmp_path / "jpg", 1, SCENE, suffix=".jpg")


def decode(path):
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        context = stream.codec_context
        facts = (stream.codec.name, context.pix_fmt, stream.average_rate, context.width, context.height)
        return frames, facts, container.metadata


def test_mp4_for_ordinary_players(tmp_path):
    """H.264, 4:2:0, even sides, index before the data; colours come back within a coding step or two."""
    frames = [picture(number, 47, 63) for number in range(5)]
    path = write_film(tmp_path / "a.mp4", frames, fps=25, quality=8, provenance=SCENE)
    decoded, facts, metadata = decode(path)
    assert facts == ("h264", "yuv420p", 25, 64, 48)
    assert len(decoded) == 5
    for number, (got, sent) in enumerate(zip(decoded, frames, strict=True)):
        grey = slice(8 * number + 12, 60)
        assert np.abs(got[:47, grey].astype(int) - sent[:, grey]).mean() < 2.0
        red = got[20, 8 * number + 4].astype(int)
        assert np.abs(red - [200, 30, 30]).max() < 12
    content = path.read_bytes()
    assert 0 < content.index(b"moov") < content.index(b"mdat")
    assert SCENE.scene.strip() in metadata["comment"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.mp4"]


def test_film_from_frames_on_disk(tmp_path):
    paths = [write_png(tmp_path / f"{number}.png", picture(number)) for number in range(3)]
    decoded, facts, _ = decode(write_film(tmp_path / "a.mp4", paths, fps=29.97))
    assert len(decoded) == 3
    assert float(facts[2]) == pytest.approx(29.97, abs=1e-3)


def test_equal_frames_give_equal_films(tmp_path):
    frames = [picture(number) for number in range(3)]
    first, second = (
        write_film(tmp_path / name, frames, fps=10, provenance=SCENE).read_bytes()
        for name in ("a.mp4", "b.mp4")
    )
    assert first == second


@pytest.mark.parametrize(("name", "tolerance"), [("a.gif", 25), ("a.webp", 25)])
def test_animated_images(tmp_path, name, tolerance):
    path = write_film(tmp_path / name, (picture(number) for number in range(4)), fps=20, width=32)
    with Image.open(path) as image:
        assert image.n_frames == 4
        assert image.size == (32, 24)
        assert image.info["loop"] == 0
        for number in range(4):
            image.seek(number)
            image.load()
            assert image.info["duration"] == 50
            red = np.asarray(image.convert("RGB"))[12, 4 * number + 1].astype(int)
            assert np.abs(red - [200, 30, 30]).max() <= tolerance


def test_linear_frames_are_encoded(tmp_path):
    frames = [np.full((16, 16, 3), 0.09, np.float32)] * 2
    decoded, _, _ = decode(write_film(tmp_path / "a.mp4", frames, fps=10, exposure=1.0))
    assert np.abs(decoded[0].astype(int) - 118).max() <= 2  # 18 % grey


@pytest.mark.parametrize(
    ("name", "frames", "fps", "words"),
    [
        ("a.avi", [picture(0)], 25, r"'\.avi'.*\.mp4, \.gif, \.webp"),
        ("a.mp4", [], 25, "at least one frame"),
        ("a.mp4", iter(()), 25, "at least one frame"),
        ("a.mp4", [picture(0)], 0, "impossible frame rate"),
        ("a.mp4", [picture(0), picture(0, 50, 64)], 25, "frame 1 has another size"),
        ("a.gif", [picture(0), picture(0, 50, 64)], 25, "frame 1 has another size"),
        ("a.mp4", ["missing.png"], 25, "no such picture"),
    ],
)
def test_refused(tmp_path, name, frames, fps, words):
    with pytest.raises(InputError, match=words):
        write_film(tmp_path / name, frames, fps=fps)
    assert list(tmp_path.iterdir()) == []


def test_full_disk_leaves_no_film(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(MachineError, match=r"a\.mp4: the disk is full"):
        write_film(tmp_path / "a.mp4", [picture(0)], fps=10)
    assert list(tmp_path.iterdir()) == []


def test_frames_read_back(folder):
    folder.write(0, np.full((4, 6, 3), 0.18))
    assert np.array_equal(read_picture(folder.frame(0)), encoded(np.full((4, 6, 3), 0.18)))
