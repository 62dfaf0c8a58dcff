"""Searches drawn at random, edges of images, and drawn people whose search is varied one option at a time."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from tests.parity.goldens import images
from tests.parity.goldens.case import DAIMLER, PEOPLE, Case
from tests.parity.goldens.images import Figure, Image
from tests.searches import some_search

Pictures = dict[str, Callable[[], Image]]

#: The image of most cases with people: four sizes, four colours.
FOUR = [Figure(80, 60, 150, (40, 30, 35), step=6), Figure(200, 90, 200, (20, 60, 120))]
FOUR += [Figure(300, 60, 110, (60, 20, 20), step=12), Figure(400, 40, 260, (30, 30, 90), step=12)]
STREET = partial(images.people, 2, 360, 480, FOUR)
#: Two persons who overlap, one cut off by the image's edge, one brighter than the ground; odd sizes.
CLOSE = [Figure(70, 50, 160, (50, 90, 40)), Figure(112, 60, 150, (90, 40, 110), step=5)]
CLOSE += [Figure(222, 30, 190, (250, 245, 255), step=11), Figure(310, 70, 140, (10, 20, 30))]
CROWD = partial(images.people, 5, 241, 319, CLOSE)
LONELY = partial(images.people, 8, 128, 64, [Figure(32, 16, 96, (40, 30, 35))])


def of_street() -> Image:
    return images.gray(STREET())


def flipped() -> Image:
    return CROWD()[::-1, ::-1]


#: How many searches are drawn, and OpenCV's clipping values among them.
DRAWN, CLIPS = 48, (0.2, 0.2, 0.05, 0.7)


def drawn() -> Iterator[Case]:
    for seed in range(DRAWN):
        search = some_search(seed, CLIPS[seed % len(CLIPS)])
        case = partial(Case, why="drawn at random", image=search.image, geometry=search.geometry)
        top_left, bottom_right = search.around
        around = {"paddingTL": top_left, "paddingBR": bottom_right}
        yield case(f"grad-{seed}", method="computeGradient", arguments=around)
        if search.fits("compute"):
            steps: dict[str, Any] = {"winStride": search.win_stride, "padding": search.padding}
            yield case(f"compute-{seed}", method="compute", arguments=steps)
        # Few windows, for their places are recorded in full.
        search = replace(search, win_stride=(24, 40))
        steps = {"hitThreshold": -1e9, "winStride": search.win_stride, "padding": search.padding}
        for method, more in (("detect", {}), ("detectMultiScale", {"scale": search.scale + 0.2, "groupThreshold": 0})):
            if search.fits(method) and search.steps(method)[1]:
                yield case(f"{method}-{seed}", method=method, arguments=steps | more, detector=search.detector)


def edges() -> Iterator[Case]:
    pictures: Pictures = {
        **{f"width-{w}": partial(images.noise, w, 9, w, 3, values=5) for w in (1, 2, 3, 7, 15, 16, 17, 33)},
        "one-pixel": partial(images.noise, 1, 1, 1),
        "one-row": partial(images.noise, 2, 1, 40),
        "ramp": partial(images.ramp, 60, 90),
        "checkers": partial(images.checkers, 64, 64, 5),
        "4k-strip": partial(images.noise, 21, 6, 3840, 3),
        "tall": partial(images.noise, 22, 1500, 5, 3),
        "people": STREET,
    }
    for name, picture in pictures.items():
        yield Case(f"grad-{name}", f"a picture of its own: {name}", picture, "computeGradient")
    crop = {"paddingTL": (-7, -3), "paddingBR": (-2, 9)}
    yield Case("grad-crop", "a negative padding crops", CROWD, "computeGradient", crop)
    around = {"paddingTL": (50, 40), "paddingBR": (31, 77)}
    small = partial(images.noise, 4, 6, 9)
    yield Case("grad-mirrored", "paddings larger than the image", small, "computeGradient", around)
    for name, size in (("exact-fit", (128, 64)), ("one-pixel-more", (129, 65)), ("no-window", (128, 56))):
        yield Case(f"compute-{name}", "windows at the image's edge", partial(images.noise, 33, *size), "compute")
    arguments = {"hitThreshold": -0.8, "winStride": (8, 8), "padding": (8, 8)}
    pictures = {"street": STREET, "street-gray": of_street, "crowd": CROWD}
    for name, picture in pictures.items():
        why = "persons of 96 px and what looks like them"
        yield Case(f"detect-{name}", why, picture, "detect", arguments, detector="default")
    yield Case("detect-lonely", "one window, one person", LONELY, "detect", detector="default")
    for method in ("detect", "detectMultiScale"):
        yield Case(f"{method}-no-detector", "without a detector nothing is found", LONELY, method)


#: Images searched without grouping, and the threshold of their hits.
BESIDE = [Figure(x, 10, 130, (30, 40, 50)) for x in (50, 1900, 3790)]
BELOW = [Figure(35, y, 110, (40, 30, 30)) for y in (10, 600, 1180)]
TALL = [Figure(300, 60, 600, (90, 80, 20)), Figure(900, 200, 300, (9, 9, 9))]
RAW: dict[str, tuple[Callable[[], Image], float]] = {
    "blocks": (partial(images.blocks, 52, 300, 260, 3, size=5), -2.2),
    "blocks-large": (partial(images.blocks, 53, 480, 640, size=16), -1.75),
    "exact-fit": (LONELY, 0.0),
    "flipped": (flipped, -1.0),
    "noise": (partial(images.noise, 54, 210, 170, 3), -2.5),
    "4k-strip": (partial(images.people, 55, 150, 3840, BESIDE), 0.3),
    "tall": (partial(images.people, 56, 1300, 70, BELOW), 0.0),
    "hd": (partial(images.people, 57, 720, 1280, TALL), 0.5),
}


def multi_scale() -> Iterator[Case]:
    usual: dict[str, Any] = {"winStride": (8, 8), "padding": (8, 8), "scale": 1.05}
    default = partial(Case, method="detectMultiScale", detector="default")
    for scale in (1.02, 1.05, 1.1, 1.3, 2.0, 1.0, 0.5):
        arguments = usual | {"scale": scale, "hitThreshold": 0.2, "groupThreshold": 0}
        yield default(f"dms-scale-{scale}-street", "steps of the pyramid", STREET, arguments=arguments)
    for stride, padding in product(((4, 4), (8, 8), (16, 8), (5, 7)), ((0, 0), (4, 4), (32, 32), (24, 16))):
        if stride == (5, 7) and padding != (0, 0):
            continue  # its cache stride is 1: any padding does, and one is enough
        arguments = {"hitThreshold": 0.5, "winStride": stride, "padding": padding, "scale": 1.1, "groupThreshold": 0}
        name = f"dms-stride-{stride}-padding-{padding}".replace(" ", "")
        yield default(name, "grids of windows on every level", CROWD, arguments=arguments)
    for group in (-1, 0, 0.9, 1, 2.7, 3, 8, 1000):
        arguments = usual | {"scale": 1.15, "groupThreshold": group}
        yield default(f"dms-group-{group}", "what a group needs", STREET, arguments=arguments)
    for threshold in (-0.5, 0.5, 1.5, 3.0):
        arguments = usual | {"hitThreshold": threshold, "groupThreshold": 1}
        yield default(f"dms-threshold-{threshold}", "hits from here on", CROWD, arguments=arguments)
    for group in (0.0, 0.5, 5.0):
        arguments = usual | {"scale": 1.2, "hitThreshold": 0.2, "groupThreshold": group, "useMeanshiftGrouping": True}
        yield default(f"dms-meanshift-{group}", "modes of the hits' density", STREET, arguments=arguments)
    pictures: Pictures = {
        "defaults-street": STREET,
        "defaults-street-gray": of_street,
        "defaults-one-channel": lambda: of_street()[:, :, None],
        "defaults-crowd-fortran": lambda: np.asfortranarray(CROWD()),
        "defaults-crowd-flipped": flipped,
        "defaults-exact-fit": LONELY,
        "defaults-flat": partial(images.flat, 128, 300, 300, 3),
        "defaults-noise": partial(images.noise, 51, 240, 320, 3),
        "defaults-checkers": partial(images.checkers, 240, 200, 20),
    }
    for name, picture in pictures.items():
        yield default(f"dms-{name}", "no argument but the image", picture)
    for name, (picture, threshold) in RAW.items():
        arguments = usual | {"hitThreshold": threshold, "scale": 1.15, "groupThreshold": 0}
        yield default(f"dms-raw-{name}", "hits before grouping, in level order", picture, arguments=arguments)
    for levels, gamma in product((1, 3), (False, True)):
        geometry = (*PEOPLE, 1, -1.0, 0, 0.2, gamma, levels)
        name, arguments = f"dms-levels-{levels}{'-gamma' * gamma}", {"hitThreshold": -1.5, "groupThreshold": 0}
        yield default(name, "a bound on the levels", CROWD, arguments=arguments, geometry=geometry)
    daimler = partial(Case, method="detectMultiScale", detector="daimler", geometry=DAIMLER)
    pictures = {"street": STREET, "street-gray": of_street, "crowd": CROWD}
    for name, picture in pictures.items():
        yield daimler(f"dms-daimler-{name}", "the other people model", picture, arguments=usual | {"padding": (16, 16)})
        arguments = usual | {"scale": 1.3, "groupThreshold": 0.4, "useMeanshiftGrouping": True}
        yield daimler(f"dms-daimler-meanshift-{name}", "modes of its hits' density", picture, arguments=arguments)


def varied() -> Iterator[Case]:
    for room in (drawn, edges, multi_scale):
        yield from room()
