"""The browser lab's detector: rectangles, time, size. `.ci/web` builds it."""

import base64
import gzip
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page
from tests.parity.goldens.case import Case, coefficients
from tests.parity.goldens.record import ANSWERS, CASES
from tests.sim.view.browser import chromium
from tests.web.conftest import Lab, opened

import limo_hog

ANSWER = json.loads(ANSWERS.read_text())
SERVED = [  # the page makes detectors of 8 × 8 cells in 16 × 16 blocks, and only searches
    case
    for case in CASES
    if case.method == "detectMultiScale"
    and case.detector is not None
    and (len(case.geometry) == 0 or case.geometry[1:] == ((16, 16), (8, 8), (8, 8), 9))
]
assert len(SERVED) >= 60
# V8 has no simd128 on a CPU without SSE4.1.
MODULES = {"hog.wasm": (), "hog-scalar.wasm": ("--js-flags=--no-enable-sse4-1",)}


@pytest.fixture(scope="module", params=MODULES)
def lab(address: str, request: pytest.FixtureRequest) -> Iterator[Lab]:
    with chromium(*MODULES[request.param]) as browser:
        lab = opened(browser, address)
        assert lab.page.evaluate("import('./engine.js').then((engine) => engine.MODULE)") == request.param
        yield lab


def searched(page: Page, case: Case) -> list[dict[str, float]]:
    """What the page finds in the case's image with its arguments."""
    image = np.ascontiguousarray(case.image())
    arguments = {"scale": 1.05, "groupThreshold": 2.0, "hitThreshold": 0.0, "winStride": (0, 0), "padding": (0, 0)}
    arguments |= case.arguments
    size = case.geometry[0] if case.geometry else (64, 128)
    wanted = limo_hog.HOGDescriptor(*case.geometry).getDescriptorSize()
    call: Any = {
        "data": base64.b64encode(image.tobytes()).decode(),
        "image": {"width": image.shape[1], "height": image.shape[0], "channels": image[0, 0].size},
        "make": [*size, coefficients(case.detector or 0, limo_hog, wanted).tolist(), int(not case.geometry)],
        "search": {
            "threshold": arguments["hitThreshold"],
            "stride": arguments["winStride"],
            "padding": arguments["padding"],
            "scale": arguments["scale"],
            "group": arguments["groupThreshold"],
            "meanShift": bool(arguments.get("useMeanshiftGrouping", False)),
        },
    }
    found: list[dict[str, float]] = page.evaluate(
        """({data, image, make, search}) => {
            lab.make(...make);
            return lab.search({...image, data: Uint8Array.from(atob(data), (c) => c.charCodeAt(0))}, search);
        }""",
        call,
    )
    return found


@pytest.mark.parametrize("case", [pytest.param(case, id=case.name) for case in SERVED])
def test_the_page_finds_opencvs_rectangles(lab: Lab, case: Case) -> None:
    answer, found = ANSWER[case.name], searched(lab.page, case)
    assert [[r["x"], r["y"], r["width"], r["height"]] for r in found] == (answer["foundLocations"] or [])
    np.testing.assert_allclose([r["weight"] for r in found], answer["foundWeights"] or [], rtol=0, atol=1e-5)


@pytest.mark.parametrize("module", MODULES)
def test_a_module_is_small(built: Path, module: str) -> None:
    assert len(gzip.compress((built / module).read_bytes(), 9)) <= 600_000


# One search for each line that comes; answers with its time [ms].
NATIVE = """
import sys, time, numpy, limo_hog
limo_hog.set_num_threads(1)
hog = limo_hog.HOGDescriptor()
hog.setSVMDetector(limo_hog.HOGDescriptor_getDefaultPeopleDetector())
image = numpy.random.default_rng(0).integers(0, 256, (480, 640, 3), numpy.uint8)
for _ in sys.stdin:
    begun = time.perf_counter()
    hog.detectMultiScale(image, winStride=(8, 8))
    print(1e3 * (time.perf_counter() - begun), flush=True)
"""


@pytest.mark.skipif("sse41" not in limo_hog._core.available_backends(), reason="a CPU without SSE4.1")
@pytest.mark.parametrize("lab", ["hog.wasm"], indirect=True)
def test_a_search_takes_at_most_three_times_as_long_as_with_sse41(lab: Lab) -> None:
    """In turns, the fastest of each: 3.7 times was measured without a lane for simd128."""
    lab.page.evaluate(
        """async (data) => {
            await lab.choose("opencv");
            const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
            window.noise = {width: 640, height: 480, channels: 3, data: bytes};
        }""",
        base64.b64encode(np.random.default_rng(0).integers(0, 256, (480, 640, 3), np.uint8).tobytes()).decode(),
    )
    once = "() => { const begun = performance.now(); lab.search(window.noise); return performance.now() - begun; }"
    command, env, pipe = [sys.executable, "-c", NATIVE], os.environ | {"LIMO_HOG_BACKEND": "sse41"}, subprocess.PIPE
    native = subprocess.Popen(command, env=env, stdin=pipe, stdout=pipe, text=True)
    assert native.stdin is not None and native.stdout is not None
    with native:
        wasm, sse41 = [], []
        for _ in range(20):
            wasm.append(lab.page.evaluate(once))
            print(file=native.stdin, flush=True)
            sse41.append(float(native.stdout.readline()))
        native.stdin.close()
    assert min(wasm) <= 3 * min(sse41), (min(wasm), min(sse41))
