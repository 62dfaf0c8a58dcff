"""Every quirk that was found in OpenCV 4.14, once."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from tests.parity.goldens import images
from tests.parity.goldens.case import DAIMLER, PEOPLE, Case
from tests.parity.goldens.images import Image

Options = dict[str, Any]


def specified() -> Iterator[Case]:
    seven = partial(images.noise, 7, 200, 150)
    eight = partial(images.noise, 8, 161, 99, 3)
    astronaut = partial(images.photograph, "astronaut")
    gray_flat = partial(images.flat, 77, 140, 100)
    signed = (*PEOPLE[:4], 18, 1, -1.0, 0, 0.2, False, 64, True)
    two_levels = (*PEOPLE, 1, -1.0, 0, 0.2, True, 2, False)

    def case(name: str, why: str, image: Callable[[], Image], method: str, **arguments: Any) -> Case:
        geometry, detector = arguments.pop("geometry", ()), arguments.pop("detector", None)
        return Case(name, why, image, method, arguments, geometry, detector)

    gradient = partial(case, method="computeGradient")
    why = "where colours tie, the lowest channel wins in columns 0 to 63, the highest in the last width % 4"
    tied = partial(images.noise, 3, 140, 67, 3, values=4)
    yield gradient("grad-ties", why, tied, paddingTL=(0, 0), paddingBR=(0, 0))
    why = "rows of 1036 = 1024 + 12: the last 12 columns use the scalar arctangent"
    yield gradient("grad-wide-1024-block", why, partial(images.noise, 9, 130, 1036))
    why = "14 columns with padding, fewer than 16: scalar arctangent everywhere; a padding of its own on each side"
    narrow = partial(images.noise, 10, 33, 13, 3)
    yield gradient("grad-narrow-asym-pad", why, narrow, paddingTL=(1, 2), paddingBR=(0, 3))
    why = "signed gradient, 18 bins, no gamma correction"
    yield gradient("grad-signed-18", why, eight, geometry=signed, paddingTL=(8, 8), paddingBR=(16, 5))

    compute = partial(case, method="compute")
    yield compute("compute-default", "no arguments: gamma correction is on, winStride is cellSize", seven)
    yield compute("compute-5arg-ctor", "five arguments: gamma correction is off", seven, geometry=PEOPLE)
    odd: Options = {"winStride": (6, 6), "padding": (5, 7)}
    yield compute("compute-pad-5-7", "padding (5, 7) becomes (6, 8): cache stride 2", eight, **odd)
    why = "padding (5, 7) becomes (10, 8), not (6, 12): a bit mask of -6 rounds it"
    yield compute("compute-cell6-pad-nonpow2", why, seven, geometry=((48, 96), (12, 12), (6, 6), (6, 6), 9), **odd)
    why, tail = "blocks of 63 elements: the normalisation has a scalar tail of 3", ((15, 15), (5, 5), (5, 5), 7)
    yield compute("compute-tail-bins", why, seven, geometry=((60, 60), *tail), winStride=(10, 14))
    why, wide = "blocks of 32 × 16, sigma 6", ((64, 64), (32, 16), (8, 16), (8, 8), 9)
    yield compute("compute-nonsquare-block", why, seven, geometry=wide, winStride=(8, 16))
    why = "one bin: only the second share of a vote counts"
    yield compute("compute-one-bin", why, seven, geometry=(*PEOPLE[:4], 1))
    usual: Options = {"winStride": (8, 8), "padding": (8, 8)}
    why = "a location outside gives zeros and keeps its row; none need be aligned"
    places = [(0, 0), (500, 500), (-8, -8), (-9, 0), (3, 5), (94, 80)]
    yield compute("compute-locations", why, seven, **usual, locations=places)
    tiny = partial(images.noise, 12, 2, 3)
    yield compute("compute-tiny-pad", "3 × 2 pixels mirrored many times", tiny, winStride=(8, 8), padding=(40, 72))
    yield compute("compute-flat", "a flat image gives zeros, not NaN", gray_flat)
    beside = partial(images.view, 14)
    yield compute("compute-view", "pixels beside a view are not used", beside, winStride=(16, 16), padding=(8, 8))

    detect = partial(case, method="detect", detector="default")
    places = [(86, 72), (0, 0), (3, 5), (1000, 0), (-1, -1), (87, 72), (3, 5)]
    low: Options = {"hitThreshold": -9.0, "winStride": (8, 8)}
    why = "locations in the order given; those outside are dropped"
    yield detect("detect-locations", why, seven, **low, padding=(0, 0), searchLocations=places)
    flat: Options = {"detector": "default_no_bias", "hitThreshold": 0.0, "winStride": (16, 16)}
    yield detect("detect-flat-nobias", "a score of 0.0 reaches a threshold of 0", gray_flat, **flat)
    why = "padding gives negative locations; windows come row by row"
    wide_steps: Options = {"winStride": (32, 48), "padding": (32, 32)}
    yield detect("detect-negative-locations", why, seven, **low | wide_steps)

    search = partial(case, method="detectMultiScale", detector="default")
    yield search("dms-astro", "the call of most tutorials", astronaut, **usual, hitThreshold=0.0, scale=1.05)
    grouped: Options = {"hitThreshold": -1.0, "scale": 1.05, "groupThreshold": 2}
    yield search("dms-astro-low", "a low threshold, grouped", astronaut, **usual, **grouped)
    raw: Options = {"winStride": (4, 4), "padding": (32, 32), "scale": 1.2, "groupThreshold": 0}
    why = "hits of all levels in level order, clipped to the image"
    yield search("dms-astro-ungrouped", why, astronaut, hitThreshold=-1.0, **raw)
    rocket, camera, coffee = (partial(images.photograph, name) for name in ("rocket", "camera", "coffee"))
    why = "groupThreshold 0.9 is truncated to 0: no grouping"
    cut: Options = {"padding": (4, 4), "groupThreshold": 0.9}
    yield search("dms-frac-group", why, rocket, **usual | cut, hitThreshold=-0.8, scale=1.1)
    daimler: Options = usual | {"geometry": DAIMLER, "detector": "daimler", "hitThreshold": 0.0, "scale": 1.1}
    why = "the Daimler model of 48 × 96, without gamma correction"
    bare: Options = {"padding": (0, 0), "groupThreshold": 1}
    yield search("dms-daimler", why, camera, **daimler | bare)
    modes: Options = {"groupThreshold": 0.3, "useMeanshiftGrouping": True}
    yield search("dms-meanshift", "mean-shift grouping; its threshold is not truncated", astronaut, **daimler | modes)
    own: Options = {"padding": (0, 0), "scale": 1.0, "groupThreshold": 0}
    yield search("dms-scale-1", "the image's own level alone", coffee, **usual | own, hitThreshold=-1.5)
    why, small = "an image smaller than the window, padded to one level", partial(images.noise, 13, 100, 50)
    yield search("dms-small-padded", why, small, **low, padding=(32, 32), groupThreshold=0)
    yield search("dms-nlevels", "two levels at most", seven, geometry=two_levels, hitThreshold=-9.0, groupThreshold=0)
