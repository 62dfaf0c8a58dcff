"""Sizes, channels, strides, paddings, scales, groupings, geometries and drawn people, varied one or two at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from tests.parity.goldens import images
from tests.parity.goldens.case import DAIMLER, PEOPLE, Case
from tests.parity.goldens.images import Figure, Image

Pictures = dict[str, Callable[[], Image]]

#: The image of most cases with people: four sizes, four colours.
STREET = partial(
    images.people,
    2,
    360,
    480,
    [
        Figure(80, 60, 150, (40, 30, 35), step=6),
        Figure(200, 90, 200, (20, 60, 120)),
        Figure(300, 60, 110, (60, 20, 20), step=12),
        Figure(400, 40, 260, (30, 30, 90), step=12),
    ],
)
#: Two persons who overlap, one cut off by the image's edge, one brighter than the ground; odd sizes.
CROWD = partial(
    images.people,
    5,
    241,
    319,
    [
        Figure(70, 50, 160, (50, 90, 40)),
        Figure(112, 60, 150, (90, 40, 110), step=5),
        Figure(222, 30, 190, (250, 245, 255), step=11),
        Figure(310, 70, 140, (10, 20, 30)),
    ],
)
LONELY = partial(images.people, 8, 128, 64, [Figure(32, 16, 96, (40, 30, 35))])


def of_street() -> Image:
    return images.gray(STREET())


def fortran() -> Image:
    return np.asfortranarray(CROWD())


def flipped() -> Image:
    return CROWD()[::-1, ::-1]


def one_channel() -> Image:
    return of_street()[:, :, None]


def read_only() -> Image:
    image = LONELY()
    image.flags.writeable = False
    return image


def gradients() -> Iterator[Case]:
    for width in (1, 2, 3, 7, 15, 16, 17, 33):
        image = partial(images.noise, width, 9, width, 3, values=5)
        yield Case(f"grad-width-{width}", "colours tie around the ends of vectors", image, "computeGradient")
    pictures: Pictures = {
        "one-pixel": partial(images.noise, 1, 1, 1),
        "one-row": partial(images.noise, 2, 1, 40),
        "ramp": partial(images.ramp, 60, 90),
        "checkers": partial(images.checkers, 64, 64, 5),
        "flat": partial(images.flat, 200, 20, 30, 3),
        "4k-strip": partial(images.noise, 21, 6, 3840, 3),
        "tall": partial(images.noise, 22, 1500, 5, 3),
        "people": STREET,
    }
    for name, picture in pictures.items():
        yield Case(f"grad-{name}", f"a picture of its own: {name}", picture, "computeGradient")
    crop = {"paddingTL": (-7, -3), "paddingBR": (-2, 9)}
    yield Case("grad-crop", "a negative padding crops", CROWD, "computeGradient", crop)
    around = {"paddingTL": (50, 40), "paddingBR": (31, 77)}
    yield Case(
        "grad-mirrored", "paddings larger than the image", partial(images.noise, 4, 6, 9), "computeGradient", around
    )
    for nbins, signed, gamma in product((1, 2, 31, 128), (False, True), (False, True)):
        geometry = (*PEOPLE[:4], nbins, 1, -1.0, 0, 0.2, gamma, 64, signed)
        name = f"grad-bins-{nbins}{'-signed' * signed}{'-gamma' * gamma}"
        image = partial(images.noise, nbins, 24, 37, 3)
        yield Case(name, "how angles are quantised", image, "computeGradient", geometry=geometry)


#: Geometries that no people model has: window, block, block stride and cell [px], bins, aperture, sigma, norm, clip,
#: gamma correction, levels, signed gradient.
ODD: dict[str, tuple[Any, ...]] = {
    "cells-5x7": ((30, 49), (15, 14), (5, 7), (5, 7), 12),
    "one-cell-blocks": ((40, 40), (8, 8), (8, 8), (8, 8), 9),
    "dense-blocks": ((36, 40), (12, 16), (3, 4), (6, 8), 9),
    "gaps-between-blocks": ((56, 56), (16, 16), (20, 20), (8, 8), 9),
    "three-by-four-cells": ((33, 42), (21, 28), (6, 7), (7, 7), 7),
    "signed-18": ((64, 128), (16, 16), (8, 8), (8, 8), 18, 1, -1.0, 0, 0.2, False, 64, True),
    "sharp-gaussian": ((32, 32), (16, 16), (8, 8), (8, 8), 9, 1, 0.8, 0, 0.2, True),
    "wide-gaussian": ((32, 32), (16, 16), (8, 8), (8, 8), 9, 1, 30.0, 0, 0.2, True),
    "clip-0.05": ((64, 128), (16, 16), (8, 8), (8, 8), 9, 1, -1.0, 0, 0.05, True),
    "clip-0.7": ((64, 128), (16, 16), (8, 8), (8, 8), 9, 1, -1.0, 0, 0.7, True),
    "wide-window": ((128, 32), (16, 16), (8, 8), (8, 8), 9, 1, -1.0, 0, 0.2, True),
    "tall-window": ((16, 256), (16, 16), (8, 8), (8, 8), 9, 1, -1.0, 0, 0.2, True),
    "one-block": ((16, 16), (16, 16), (8, 8), (8, 8), 9),
    "two-bins": ((32, 32), (16, 16), (8, 8), (8, 8), 2),
}


def descriptors() -> Iterator[Case]:
    strides, paddings = (None, (4, 4), (3, 5), (16, 8), (100, 100)), (None, (8, 8), (13, 3), (-5, 40))
    for stride, padding in product(strides, paddings):
        name = f"compute-stride-{stride}-padding-{padding}".replace(" ", "")
        image = partial(images.noise, 31, 140, 75, 3)
        yield Case(name, "grids of windows", image, "compute", {"winStride": stride, "padding": padding})
    for name, geometry in ODD.items():
        arguments = {"winStride": (19, 16), "padding": (3, 6)}
        image = partial(images.noise, 32, 262, 140, 3)
        yield Case(f"compute-{name}", "a geometry of its own", image, "compute", arguments, geometry)
    pictures: Pictures = {
        "exact-fit": partial(images.noise, 33, 128, 64),
        "one-pixel-more": partial(images.noise, 33, 129, 65),
        "ramp": partial(images.ramp, 140, 80),
        "checkers": partial(images.checkers, 130, 66, 8),
        "fortran-order": fortran,
        "flipped": flipped,
        "read-only": read_only,
    }
    for name, picture in pictures.items():
        yield Case(f"compute-{name}", f"an image of its own: {name}", picture, "compute", {"winStride": (32, 32)})
    # Narrower by a stride: with one more pixel OpenCV would read beyond the image.
    yield Case("compute-no-window", "a grid of no windows", partial(images.noise, 34, 128, 56), "compute")


def single_scale() -> Iterator[Case]:
    everything: dict[str, Any] = {"hitThreshold": -1e9, "winStride": (24, 40), "padding": (8, 8)}
    for name, geometry in ODD.items():
        image = partial(images.noise, 41, 270, 135, 3)
        yield Case(
            f"detect-{name}", "random coefficients", image, "detect", everything | {"padding": (0, 0)}, geometry, 6
        )
    pictures: Pictures = {
        "street": STREET,
        "street-gray": of_street,
        "crowd": CROWD,
        "flat": partial(images.flat, 9, 200, 90),
    }
    for name, picture in pictures.items():
        arguments = everything | {"hitThreshold": -0.8, "winStride": (8, 8)}
        yield Case(
            f"detect-{name}",
            "persons of 96 px and what looks like them",
            picture,
            "detect",
            arguments,
            detector="default",
        )
        arguments = everything | {"winStride": (72, 64)}
        yield Case(f"detect-scores-{name}", "every score", picture, "detect", arguments, detector="default")
    yield Case("detect-lonely", "one window, one person", LONELY, "detect", detector="default")
    yield Case("detect-no-detector", "without a detector nothing is found", LONELY, "detect")


#: Images searched without grouping, and the threshold of their hits.
RAW: dict[str, tuple[Callable[[], Image], float]] = {
    "blocks": (partial(images.blocks, 52, 300, 260, 3, size=5), -2.2),
    "blocks-large": (partial(images.blocks, 53, 480, 640, size=16), -1.75),
    "exact-fit": (LONELY, 0.0),
    "flipped": (flipped, -1.0),
    "noise": (partial(images.noise, 54, 210, 170, 3), -2.5),
    "4k-strip": (
        partial(images.people, 55, 150, 3840, [Figure(x, 10, 130, (30, 40, 50)) for x in (50, 1900, 3790)]),
        0.3,
    ),
    "tall": (partial(images.people, 56, 1300, 70, [Figure(35, y, 110, (40, 30, 30)) for y in (10, 600, 1180)]), 0.0),
    "hd": (
        partial(images.people, 57, 720, 1280, [Figure(300, 60, 600, (90, 80, 20)), Figure(900, 200, 300, (9, 9, 9))]),
        0.5,
    ),
}


def multi_scale() -> Iterator[Case]:
    usual: dict[str, Any] = {"winStride": (8, 8), "padding": (8, 8), "scale": 1.05}
    default = partial(Case, method="detectMultiScale", detector="default")
    for scale in (1.02, 1.05, 1.1, 1.3, 2.0, 1.0, 0.5):
        yield default(
            f"dms-scale-{scale}-street",
            "steps of the pyramid",
            STREET,
            arguments=usual | {"scale": scale, "hitThreshold": 0.2, "groupThreshold": 0},
        )
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
        "defaults-one-channel": one_channel,
        "defaults-crowd-fortran": fortran,
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
        name = f"dms-levels-{levels}{'-gamma' * gamma}"
        yield default(
            name,
            "a bound on the levels",
            CROWD,
            arguments={"hitThreshold": -1.5, "groupThreshold": 0},
            geometry=geometry,
        )
    daimler = partial(Case, method="detectMultiScale", detector="daimler", geometry=DAIMLER)
    pictures = {"street": STREET, "street-gray": of_street, "crowd": CROWD}
    for name, picture in pictures.items():
        yield daimler(f"dms-daimler-{name}", "the other people model", picture, arguments=usual | {"padding": (16, 16)})
        arguments = usual | {"scale": 1.3, "groupThreshold": 0.4, "useMeanshiftGrouping": True}
        yield daimler(f"dms-daimler-meanshift-{name}", "modes of its hits' density", picture, arguments=arguments)
    for name, geometry in ODD.items():
        arguments = {"hitThreshold": 0.0, "winStride": (30, 28), "padding": (0, 0), "scale": 1.25, "groupThreshold": 0}
        image = partial(images.noise, 58, 300, 150, 3)
        yield Case(f"dms-{name}", "random coefficients", image, "detectMultiScale", arguments, geometry, 9)
    yield Case("dms-no-detector", "without a detector nothing is found", LONELY, "detectMultiScale")


def varied() -> Iterator[Case]:
    for room in (gradients, descriptors, single_scale, multi_scale):
        yield from room()
