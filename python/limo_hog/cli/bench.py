"""`limo-hog bench`: this detector against OpenCV's, timed in turn, with parity checked on the same images."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.table import Table

import limo_hog
from limo_hog.cli.support.arguments import add_json, add_search, size, threads
from limo_hog.cli.support.console import console
from limo_hog.cli.support.environment import environment
from limo_hog.cli.support.output import STDOUT, UsageError, write_json
from limo_hog.cli.support.progress import progress
from limo_hog.cli.support.race import Timing, race
from limo_hog.cli.support.scene import street
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.detector import PeopleDetector
from limo_hog.exceptions import LimoHogError
from limo_hog.parallel import cores

#: The workshop's parameters.
PARAMETERS: dict[str, Any] = {"winStride": (8, 8), "padding": (4, 4), "scale": 1.05}
SIZES = [(640, 480), (1280, 720), (1920, 1080)]
#: How long the calls of a row are timed [s].
SECONDS = 3.0

Image = NDArray[np.uint8]
#: Rectangles and weights found in an image; a second argument is the group threshold.
Find = Callable[..., tuple[Any, Any]]


@dataclass(frozen=True)
class Row:
    """The result for one size, channel count and thread count; without an OpenCV that has HOG, its fields are None."""

    size: tuple[int, int]
    channels: int
    threads: int
    backend: str
    search: str
    limo_ms: Timing
    cv2_ms: Timing | None
    ratio: float | None
    rects_equal: bool | None
    max_weight_diff: float | None


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `bench`."""
    parser = subparsers.add_parser(
        "bench",
        description="Time this detector against OpenCV's, call by call in turn, and check on the same images "
        "that both find the same rectangles. Without an OpenCV that has HOG, this detector is timed alone.",
    )
    parser.add_argument("--size", type=size, nargs="+", metavar="WxH", help="image sizes (640x480 1280x720 1920x1080)")
    parser.add_argument("--channels", choices=["gray", "bgr"], help="only this kind of image (both)")
    parser.add_argument("--threads", type=threads, nargs="+", metavar="N", help="thread counts, 0 for all cores (1 0)")
    add_search(parser)
    parser.add_argument("--image", type=Path, metavar="FILE", help="a picture instead of the drawn street")
    add_json(parser, "the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Bench every combination, print a table and, if asked, JSON."""
    facts = environment()
    opencv: Any = None
    if facts["opencv_has_hog"]:
        import cv2

        opencv = cv2.HOGDescriptor()
        opencv.setSVMDetector(np.asarray(cv2.HOGDescriptor.getDefaultPeopleDetector()))
    images = [
        _picture(size, channels, args.image)
        for size in (args.size or ([None] if args.image else SIZES))
        for channels in ([1, 3] if args.channels is None else [3 if args.channels == "bgr" else 1])
    ]
    # All cores may be one core: each count once.
    counts = list(dict.fromkeys(n or cores() for n in args.threads or [1, 0]))
    rows = []
    with progress("rows") as bar:
        task = bar.add_task("timing", total=len(images) * len(counts))
        for image in images:
            for count in counts:
                rows.append(_row(image, count, str(facts["backend"]), args.search, opencv))
                bar.advance(task)
    if args.json:
        write_json(args.json, {"environment": facts, "rows": [asdict(row) for row in rows]})
    if args.json != STDOUT:
        _print(facts, rows)
    # A guided search is allowed to miss hits; the table and the JSON tell whether it did.
    wrong = [row for row in rows if row.rects_equal is False and row.search == "exact"]
    if wrong:
        where = ", ".join(f"{r.size[0]}x{r.size[1]}x{r.channels} on {r.threads} threads" for r in wrong)
        raise LimoHogError(f"other rectangles than OpenCV {facts['opencv']}: {where}")
    return 0


def _picture(size: tuple[int, int] | None, channels: int, path: Path | None) -> Image:
    """Return the picture of a row; one smaller than the detector's window, on which OpenCV 4 crashes, is refused."""
    if path is None:
        width, height = size or SIZES[0]
        _refuse_less_than_a_window(width, height)
        return street(width, height, channels)
    from limo_hog.imaging.reading import Kind, Source, read_image

    image = read_image(Source(str(path), path, Kind.IMAGE))
    _refuse_less_than_a_window(*(size or image.shape[1::-1]))
    import cv2

    if size is not None:
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
    return image if channels == 3 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)


def _refuse_less_than_a_window(width: int, height: int) -> None:
    least = Geometry().winSize
    if width < least[0] or height < least[1]:
        raise UsageError(
            f"a picture of {width}x{height} is smaller than the detector's window; {least[0]}x{least[1]} or more is "
            "wanted"
        )


def _find(search: str) -> Find:
    """Return the search of an image with the workshop's parameters: by OpenCV's method, or guided."""
    if search == "guided":
        detectors = {
            group: PeopleDetector(model="opencv", min_height=None, nms="group", group_threshold=group, search="guided")
            for group in (0, 2)
        }

        def guided(image: Image, group: int = 2) -> tuple[Any, Any]:
            found = detectors[group].detect(image)
            return found.windows, found.scores

        return guided
    hog = limo_hog.HOGDescriptor()
    hog.setSVMDetector(limo_hog.HOGDescriptor_getDefaultPeopleDetector())
    return partial(_method, hog)


def _method(hog: Any, image: Image, group: int = 2) -> tuple[Any, Any]:
    boxes, weights = hog.detectMultiScale(image, **PARAMETERS, groupThreshold=group)
    return boxes, weights


def _row(image: Image, threads: int, backend: str, search: str, opencv: Any) -> Row:
    find = _find(search)
    limo_hog.set_num_threads(threads)
    height, width = image.shape[:2]
    size, channels = (width, height), 1 if image.ndim == 2 else 3
    if opencv is None:
        (ours,) = race([partial(find, image)], SECONDS)
        return Row(size, channels, threads, backend, search, ours, None, None, None, None)
    import cv2

    # With several threads cv2 now and then pairs a rectangle with another's weight: parity is checked with one.
    cv2.setNumThreads(1)
    rival = partial(_method, opencv)
    equal, difference = _parity(find, rival, image)
    cv2.setNumThreads(threads)
    ours, theirs = race([partial(each, image) for each in (find, rival)], SECONDS)
    return Row(size, channels, threads, backend, search, ours, theirs, theirs.min / ours.min, equal, difference)


def _parity(find: Find, rival: Find, image: Image) -> tuple[bool, float | None]:
    """Compare rectangles, grouped and raw, and the weights of equal ones."""
    worst = 0.0
    for group in (2, 0):
        ours, theirs = (_found(each(image, group)) for each in (find, rival))
        if [rect for rect, _ in ours] != [rect for rect, _ in theirs]:
            return False, None
        for (_, a), (_, b) in zip(ours, theirs, strict=True):
            worst = max(worst, abs(a - b))
    return True, worst


def _found(result: tuple[Any, Any]) -> list[tuple[tuple[int, ...], float]]:
    """Sort by place, then weight: the order of cv2's levels is not defined."""
    rects, weights = result
    return sorted((tuple(map(int, r)), float(w)) for r, w in zip(rects, weights, strict=True))


def _print(facts: dict[str, Any], rows: list[Row]) -> None:
    screen = console()
    opponent = f"OpenCV {facts['opencv']}" if facts["opencv_has_hog"] else "nothing"
    screen.print(f"[bold]limo-hog {facts['limo_hog']} ({facts['backend']}) against {opponent}[/]")
    screen.print(f"{facts['cpu']}, {facts['cores']} cores, Python {facts['python']}")
    if (facts["load"] or 0) > 0.5 * facts["cores"]:
        screen.print(f"[yellow]The machine is busy (load {facts['load']}): do not trust these times.[/]")
    if not facts["opencv_has_hog"]:
        screen.print(
            "No OpenCV with HOGDescriptor here: pip install 'opencv-python-headless<5' to compare.", soft_wrap=True
        )
    table = Table(
        caption=f"ms a call: least (median); winStride 8, padding 4, scale 1.05; {rows[0].search} search",
        box=box.SIMPLE_HEAD,
        padding=0,
    )
    for name in ("size", "image", "threads", "limo-hog", "OpenCV", "faster", "rectangles"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        agreement = f"equal ±{row.max_weight_diff:.0e}" if row.rects_equal else "[bold red]differ[/]"
        table.add_row(
            f"{row.size[0]}×{row.size[1]}",
            "gray" if row.channels == 1 else "BGR",
            str(row.threads),
            _ms(row.limo_ms),
            _ms(row.cv2_ms),
            "" if row.ratio is None else f"[bold]{row.ratio:.1f}×[/]",
            "" if row.rects_equal is None else agreement,
        )
    screen.print(table)


def _ms(timing: Timing | None) -> str:
    return "" if timing is None else f"{timing.min:.1f} ({timing.p50:.1f})"
