"""Inputs become pictures; an input that is none is an error of one line."""

import io
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.threads import served

from limo_hog.imaging.reading import STDIN, Kind, ReadError, find_sources, open_video, read_image, standard_input
from limo_hog.imaging.writing import video_writer, write_image


def test_a_folder_stands_for_all_pictures_below_it_and_a_glob_for_its_matches(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    for name in ("b.png", "a.JPG", "e.png", "deep/c.bmp", "notes.txt", "film.mp4"):
        (tmp_path / name).write_bytes(b"")
    found = find_sources(str(tmp_path))
    assert [s.path.name for s in found] == ["a.JPG", "b.png", "c.bmp", "e.png", "film.mp4"]
    assert [s.kind for s in found] == [Kind.IMAGE] * 4 + [Kind.VIDEO]
    assert [s.path.name for s in find_sources(str(tmp_path / "*.png"))] == ["b.png", "e.png"]


def test_a_file_whose_name_looks_like_a_glob_or_a_number_is_that_file(here: Path) -> None:
    for name in ("[1].png", "0"):
        (here / name).write_bytes(b"")
    assert [s.path for s in find_sources("[1].png")] == [Path("[1].png")]
    assert find_sources("0")[0].kind is Kind.IMAGE and find_sources("7")[0].kind is Kind.CAMERA


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("", "the name of an input is empty"),  # and does not stand for this folder
        ("http://[1", "http://.1: not an address"),
        *((name, ".*[.]jpg: no such file, folder or glob") for name in ("nothing.jpg", "?.jpg")),
        ("empty", "empty: no image or video"),
    ],
)
def test_an_input_that_stands_for_nothing_is_named(name: str, told: str, here: Path) -> None:
    (here / "empty").mkdir()
    (here / "a.png").write_bytes(b"")
    with pytest.raises(ReadError, match=f"^{told}"):
        find_sources(name)


def test_an_image_is_read_as_opencv_reads_it(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (31, 47, 3), dtype=np.uint8)
    path = tmp_path / "noise.jpg"
    write_image(path, picture)
    np.testing.assert_array_equal(read_image(find_sources(str(path))[0]), np.asarray(cv2.imread(str(path))))


@pytest.mark.parametrize(
    ("content", "said"), [(b"", "the file is empty"), (b"hi", "not an image that OpenCV can read")]
)
def test_a_file_that_is_no_image_is_named(content: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.jpg"
    path.write_bytes(content)
    with pytest.raises(ReadError, match=f"bad.jpg: {said}"):
        read_image(find_sources(str(path))[0])


def _film(path: Path) -> None:
    """Write 20 gray frames, as motion JPEG or H.264, whose gray is ten times their number."""
    frames = [np.full((48, 64, 3), 10 * i, np.uint8) for i in range(20)]
    if path.suffix == ".avi":
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10, (64, 48))
        for frame in frames:
            writer.write(frame)
        writer.release()
    else:
        with video_writer(path, fps=10) as write:
            for frame in frames:
                write(frame)


def test_a_video_gives_every_nth_frame_that_is_not_done_yet(tmp_path: Path) -> None:
    _film(tmp_path / "film.mp4")
    with open_video(find_sources(str(tmp_path / "film.mp4"))[0]) as video:
        frames = dict(video.frames(every=5, skip={5}))
    assert (video.fps, video.frame_count) == (10.0, 20) and list(frames) == [0, 10, 15]
    assert abs(float(frames[10].mean()) - 100) < 5


def test_a_video_that_was_cut_off_gives_its_frames_and_then_says_so(tmp_path: Path) -> None:
    path = tmp_path / "film.avi"
    _film(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 3 // 4])
    seen: list[int] = []
    with pytest.raises(ReadError, match=r"cut off: \d+ of 20 frames"), open_video(find_sources(str(path))[0]) as video:
        seen.extend(number for number, _ in video.frames())
    assert 3 < len(seen) < 20


@pytest.mark.parametrize(
    ("name", "said"),
    [
        *(("empty.mp4", "empty.mp4: the file is empty"), ("bad.mp4", "bad.mp4: not a video")),
        *((index, f"{index}: no camera") for index in ("97", "99999999999999999999")),
    ],
)
def test_what_is_no_video_and_no_camera_is_named(name: str, said: str, here: Path) -> None:
    for file, content in (("empty.mp4", b""), ("bad.mp4", b"x" * 999)):
        (here / file).write_bytes(content)
    with pytest.raises(ReadError, match=f"^{said}"), open_video(find_sources(name)[0]):
        pass


@pytest.mark.parametrize("suffix", [".png", ".mp4"])
def test_standard_input_holds_an_image_or_a_video(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / f"thing{suffix}"
    if suffix == ".png":
        write_image(path, np.zeros((8, 8, 3), np.uint8))
    else:
        _film(path)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(path.read_bytes())))
    with standard_input() as source:
        assert source.name == STDIN
        if suffix == ".png":
            assert read_image(source).shape == (8, 8, 3)
        else:
            with open_video(source) as video:
                assert len(list(video.frames())) == 20
    assert not source.path.exists()


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    with served(tmp_path) as address:
        yield address.rstrip("/")


def test_a_video_is_read_from_its_address(server: str, tmp_path: Path) -> None:
    _film(tmp_path / "film.avi")
    (source,) = find_sources(f"{server}/film.avi?token=1")
    assert (source.kind, source.path) == (Kind.STREAM, Path("film.avi"))
    with open_video(source) as video:
        means = [float(image.mean()) for _, image in video.frames()]
    np.testing.assert_allclose(means, 10 * np.arange(20), atol=3)


@pytest.mark.parametrize("place", ["{server}/none.mp4", "http://127.0.0.1:9/a.mp4", "rtsp://127.0.0.1:9/live", "x://y"])
def test_an_address_without_a_video_is_named(place: str, server: str) -> None:
    name = place.format(server=server)
    with pytest.raises(ReadError) as told, open_video(find_sources(name)[0]):
        pass
    assert str(told.value).startswith(f"{name}: OpenCV found no video there within 10 s; wanted is the address")
