"""Inputs become pictures; an input that is none is an error of one line."""

from __future__ import annotations

import io
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest

from limo_hog.imaging.reading import (
    STDIN,
    Kind,
    ReadError,
    Source,
    find_sources,
    open_video,
    read_image,
    standard_input,
)
from limo_hog.imaging.writing import video_writer, write_image


def test_a_folder_stands_for_all_pictures_below_it_in_order(tmp_path: Path) -> None:
    picture = np.zeros((8, 8, 3), np.uint8)
    for name in ("b.png", "a.JPG", "deep/c.bmp"):
        write_image(tmp_path / name, picture)
    (tmp_path / "notes.txt").write_text("no picture")
    (tmp_path / "film.mp4").write_bytes(b"")
    found = find_sources(str(tmp_path))
    assert [s.path.name for s in found] == ["a.JPG", "b.png", "c.bmp", "film.mp4"]
    assert [s.kind for s in found] == [Kind.IMAGE] * 3 + [Kind.VIDEO]


def test_a_glob_stands_for_what_it_matches(tmp_path: Path) -> None:
    for name in ("b.png", "a.png", "c.bmp"):
        write_image(tmp_path / name, np.zeros((8, 8, 3), np.uint8))
    assert [s.path.name for s in find_sources(str(tmp_path / "*.png"))] == ["a.png", "b.png"]


def test_a_file_whose_name_looks_like_a_glob_or_a_number_is_that_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_image(Path("[1].png"), np.zeros((8, 8, 3), np.uint8))
    Path("0").write_bytes(b"")
    assert [s.path for s in find_sources("[1].png")] == [Path("[1].png")]
    assert find_sources("0")[0].kind is Kind.IMAGE
    assert find_sources("7")[0].kind is Kind.CAMERA


@pytest.mark.parametrize("name", ["nothing.jpg", "*.jpg", "empty"])
def test_an_input_that_stands_for_nothing_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(ReadError, match=r"no such file, folder or glob|no image or video"):
        find_sources(str(tmp_path / name))


def test_an_empty_name_does_not_stand_for_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_image(Path("a.png"), np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(ReadError, match="the name of an input is empty"):
        find_sources("")


def test_an_image_is_read_as_opencv_reads_it(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (31, 47, 3), dtype=np.uint8)
    path = tmp_path / "noise.jpg"
    write_image(path, picture)
    np.testing.assert_array_equal(read_image(find_sources(str(path))[0]), np.asarray(cv2.imread(str(path))))


@pytest.mark.parametrize(
    ("content", "said"), [(b"", "the file is empty"), (b"hello", "not an image that OpenCV can read")]
)
def test_a_file_that_is_no_image_is_named(content: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.jpg"
    path.write_bytes(content)
    with pytest.raises(ReadError, match=f"bad.jpg: {said}"):
        read_image(find_sources(str(path))[0])


def _film(path: Path, frames: int = 20) -> Source:
    with video_writer(path, fps=10) as write:
        for i in range(frames):
            write(np.full((48, 64, 3), 10 * i, np.uint8))
    return find_sources(str(path))[0]


def test_a_video_gives_every_nth_frame_that_is_not_done_yet(tmp_path: Path) -> None:
    with open_video(_film(tmp_path / "film.mp4")) as video:
        frames = dict(video.frames(every=5, skip={5}))
    assert (video.fps, video.frame_count) == (10.0, 20)
    assert list(frames) == [0, 10, 15]
    assert abs(float(frames[10].mean()) - 100) < 5


def test_a_video_that_was_cut_off_gives_its_frames_and_then_says_so(tmp_path: Path) -> None:
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10, (64, 48))
    for i in range(40):
        writer.write(np.full((48, 64, 3), 5 * i, np.uint8))
    writer.release()
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    seen: list[int] = []
    with pytest.raises(ReadError, match=r"cut off: \d+ of 40 frames"), open_video(find_sources(str(path))[0]) as video:
        seen.extend(number for number, _ in video.frames())
    assert 5 < len(seen) < 40


@pytest.mark.parametrize(("content", "said"), [(b"", "empty"), (b"x" * 999, "not a video")])
def test_a_file_that_is_no_video_is_named(content: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.mp4"
    path.write_bytes(content)
    with pytest.raises(ReadError, match=said), open_video(find_sources(str(path))[0]):
        pass


@pytest.mark.parametrize("index", ["97", "99999999999999999999"])
def test_a_camera_that_is_not_there_is_named(index: str) -> None:
    with pytest.raises(ReadError, match=f"^{index}: no camera"), open_video(find_sources(index)[0]):
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


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    """The address of a web server on `tmp_path`."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(tmp_path))) as http:
        thread = threading.Thread(target=http.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{http.server_port}"
        http.shutdown()
        thread.join()


def test_a_video_is_read_from_its_address(server: str, tmp_path: Path) -> None:
    writer = cv2.VideoWriter(str(tmp_path / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10, (64, 48))
    for i in range(12):
        writer.write(np.full((48, 64, 3), 10 * i, np.uint8))
    writer.release()
    (source,) = find_sources(f"{server}/film.avi?token=1")
    assert (source.kind, source.path) == (Kind.STREAM, Path("film.avi"))
    with open_video(source) as video:
        means = [float(image.mean()) for _, image in video.frames()]
    np.testing.assert_allclose(means, 10 * np.arange(12), atol=3)


@pytest.mark.parametrize("place", ["{server}/none.mp4", "http://127.0.0.1:9/a.mp4", "rtsp://127.0.0.1:9/live", "x://y"])
def test_an_address_without_a_video_is_named(place: str, server: str) -> None:
    name = place.format(server=server)
    with pytest.raises(ReadError) as told, open_video(find_sources(name)[0]):
        pass
    assert str(told.value).startswith(f"{name}: OpenCV found no video there within 10 s; wanted is the address")


def test_what_is_no_address_is_named() -> None:
    with pytest.raises(ReadError, match=r"^http://\[1: not an address"):
        find_sources("http://[1")
