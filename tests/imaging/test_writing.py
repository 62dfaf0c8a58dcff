"""Files appear under their name whole or not at all."""

import errno
import os
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from tests.cli.material import film_of

from limo_hog.atomic import about, part_of, whole_file, write_text
from limo_hog.extras import MissingExtraError
from limo_hog.imaging.writing import WriteError, video_writer, write_image


def test_an_image_comes_back_as_it_was_written(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (31, 47, 3), dtype=np.uint8)
    path = tmp_path / "new" / "folder" / "noise.png"
    write_image(path, picture)
    np.testing.assert_array_equal(np.asarray(cv2.imread(str(path))), picture)
    assert list(path.parent.iterdir()) == [path]
    for suffix in (".jpg", ".bmp", ".webp", ".tiff"):
        write_image(tmp_path / f"a{suffix}", picture)
    assert capfd.readouterr().err == ""  # no format complains


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system has no choice of cores")
def test_a_film_has_the_same_bytes_on_one_core(tmp_path: Path) -> None:
    mine = os.sched_getaffinity(0)
    films = []
    for allowed in (mine, {min(mine)}):
        os.sched_setaffinity(0, allowed)
        try:
            film_of(tmp_path / "film.mp4", 40)
        finally:
            os.sched_setaffinity(0, mine)
        films.append((tmp_path / "film.mp4").read_bytes())
    assert films[0] == films[1]


def test_an_unknown_picture_format_and_a_video_without_a_frame_are_refused(tmp_path: Path) -> None:
    for name in ("a.docx", "a"):
        with pytest.raises(WriteError, match="OpenCV cannot encode"):
            write_image(tmp_path / name, np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(WriteError, match="no frame"), video_writer(tmp_path / "film.mp4", fps=10):
        pass
    assert list(tmp_path.iterdir()) == []


def test_what_fails_half_way_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), whole_file(path) as part:
        part.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


class ForeignError(OSError):
    """As PyAV's: its file cannot be set."""

    filename = property(lambda self: self.args[2] if len(self.args) > 2 else None)


@pytest.mark.parametrize("kind", [OSError, ForeignError])
@pytest.mark.parametrize("named", [True, False])
def test_an_error_of_the_unfinished_file_names_the_file_itself(kind: Any, named: bool, tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    with pytest.raises(OSError, match="No space left on device") as caught, whole_file(path) as part, about(path):
        raise kind(errno.ENOSPC, "No space left on device", *[str(part)] * named)
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(path))


def test_an_error_of_another_file_keeps_its_name(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as caught, whole_file(tmp_path / "a.json"), about(tmp_path / "a.json"):
        (tmp_path / "other.json").read_bytes()
    assert caught.value.filename == str(tmp_path / "other.json")


def test_a_folder_and_a_name_that_is_too_long_are_no_files_to_write(tmp_path: Path) -> None:
    for folder in (tmp_path, Path(), Path("/"), Path("..")):
        with pytest.raises(IsADirectoryError) as caught, whole_file(folder):
            pass
        assert caught.value.filename == str(folder)
    too_long = tmp_path / f"{'a' * 256}.csv"
    with pytest.raises(OSError, match="File name too long") as named:
        write_text(too_long, "")
    assert named.value.filename == str(too_long)


def test_what_is_written_to_a_pipe_comes_out_of_it_and_it_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE) as reader:
        write_text(pipe, "text")
        assert reader.communicate(timeout=10)[0] == b"text"
    assert stat.S_ISFIFO(pipe.stat().st_mode) and list(tmp_path.iterdir()) == [pipe]


def test_a_device_stays_a_device_also_where_writing_fails(tmp_path: Path) -> None:
    # By links: what went wrong here would replace them, not the devices.
    null, full = tmp_path / "null", tmp_path / "full"
    for link in (null, full):
        link.symlink_to(f"/dev/{link.name}")
    write_text(null, "text")
    with pytest.raises(OSError, match="No space left on device") as caught:
        write_text(full, "text")
    assert caught.value.filename == str(full)
    assert all(stat.S_ISCHR(link.stat().st_mode) for link in (null, full))
    assert sorted(tmp_path.iterdir()) == [full, null]


@pytest.mark.parametrize("letter", ["a", "ä", "人"])
def test_a_name_as_long_as_a_file_system_allows_can_be_written(letter: str, tmp_path: Path) -> None:
    for suffix in (".csv", f".{'x' * 240}"):
        longest = letter * ((255 - len(suffix)) // len(letter.encode()))
        first, other = (tmp_path / f"{longest[:-1]}{last}{suffix}" for last in "12")
        for path in (first, other):
            write_text(path, path.name)
            assert path.read_text() == path.name
        assert part_of(first) != part_of(other)
    assert len(list(tmp_path.iterdir())) == 4


@pytest.mark.parametrize(("width", "height"), [(64, 48), (63, 47)])
def test_a_video_is_h264_of_the_right_size_rate_and_length(width: int, height: int, tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    with video_writer(path, fps=12.5) as write:
        for i in range(30):
            write(np.full((height, width, 3), 8 * i, np.uint8))
        assert not path.exists()
    with av.open(path) as container:
        stream = container.streams.video[0]
        frames = [frame.to_ndarray(format="gray") for frame in container.decode(stream)]
    told = (stream.codec_context.name, stream.width, stream.height, stream.average_rate, len(frames))
    assert told == ("h264", 64, 48, 12.5, 30) and abs(float(frames[20].mean()) - 160) < 3


def test_without_pyav_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    told = r"needs PyAV: pip install 'limo-hog\[video\]'"
    with pytest.raises(MissingExtraError, match=told), video_writer(tmp_path / "film.mp4", fps=10):
        pass
