"""The browser lab in headless Chromium: rectangles, time, requests, keyboard. `.ci/web` builds it."""

from __future__ import annotations

import base64
import functools
import gzip
import http.server
import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page
from tests.parity.goldens.case import Case, coefficients
from tests.parity.goldens.record import ANSWERS, CASES
from tests.sim.view.browser import CHROMIUM, chromium

import limo_hog

BUILT = Path(__file__).parents[2] / "target/web"
pytestmark = [
    pytest.mark.skipif(not (BUILT / "hog.wasm").exists(), reason="target/web is not there: .ci/web builds it"),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium"),
]
ANSWER = json.loads(ANSWERS.read_text())


def serves(case: Case) -> bool:
    """The page makes detectors of 8 × 8 cells in 16 × 16 blocks; of their cases those with an SVM and a search."""
    own = len(case.geometry) == 0 or case.geometry[1:] == ((16, 16), (8, 8), (8, 8), 9)
    return case.method == "detectMultiScale" and own and case.detector is not None


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=BUILT)
    handler.log_message = lambda *_: None  # type: ignore[attr-defined]
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/index.html"
        server.shutdown()


@pytest.fixture(scope="module")
def lab(address: str) -> Iterator[tuple[Page, list[str], list[str]]]:
    """The page, the addresses it asked for, and its errors."""
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        asked: list[str] = []
        errors: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(address)
        page.wait_for_selector("body[data-ready=yes]", timeout=20_000)
        yield page, asked, errors


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


@pytest.mark.parametrize("case", [pytest.param(case, id=case.name) for case in CASES if serves(case)])
def test_the_page_finds_opencvs_rectangles(lab: tuple[Page, list[str], list[str]], case: Case) -> None:
    answer, found = ANSWER[case.name], searched(lab[0], case)
    assert [[r["x"], r["y"], r["width"], r["height"]] for r in found] == (answer["foundLocations"] or [])
    np.testing.assert_allclose([r["weight"] for r in found], answer["foundWeights"] or [], rtol=0, atol=1e-5)


def test_sixty_cases_and_more_are_compared() -> None:
    assert sum(map(serves, CASES)) >= 60


def test_the_first_picture_is_there_within_a_second_and_nothing_else_is_asked_for(
    lab: tuple[Page, list[str], list[str]], address: str
) -> None:
    page, asked, errors = lab
    begun = page.evaluate("performance.getEntriesByName('picture-shown')[0].startTime")
    found = page.evaluate("document.getElementById('found').textContent")
    assert begun < 3000, found  # within 1 s on an idle machine; this one may be busy
    assert errors == [] and all(url.startswith((address.rsplit("/", 1)[0], "data:")) for url in asked)
    assert page.locator("#people button").count() >= 3  # of the four who are drawn


def test_the_page_is_small() -> None:
    assert len(gzip.compress((BUILT / "hog.wasm").read_bytes(), 9)) <= 600_000


def test_a_search_takes_at_most_five_times_as_long_as_with_sse41(lab: tuple[Page, list[str], list[str]]) -> None:
    page, _, _ = lab
    image = np.random.default_rng(0).integers(0, 256, (480, 640, 3), np.uint8)
    page.evaluate(
        """async (data) => {
            await lab.choose("opencv");
            const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
            window.noise = {width: 640, height: 480, channels: 3, data: bytes};
        }""",
        base64.b64encode(image.tobytes()).decode(),
    )
    once = "() => { const begun = performance.now(); lab.search(window.noise); return performance.now() - begun; }"
    hog = limo_hog.HOGDescriptor()
    hog.setSVMDetector(limo_hog.HOGDescriptor_getDefaultPeopleDetector())
    threads = limo_hog.get_num_threads()
    limo_hog.set_num_threads(1)
    theirs, ours = [], []
    for _ in range(15):
        theirs.append(page.evaluate(once))
        begun = time.perf_counter()
        hog.detectMultiScale(image, winStride=(8, 8))
        ours.append(1e3 * (time.perf_counter() - begun))
    limo_hog.set_num_threads(threads)
    if limo_hog._core.backend() == "sse41":  # LIMO_HOG_BACKEND=sse41
        assert min(theirs) < 5 * min(ours), (min(theirs), min(ours))  # 3.7 measured; 3 would need a lane by hand


def test_cells_and_blocks_are_chosen_by_keys_and_told(lab: tuple[Page, list[str], list[str]]) -> None:
    page, _, _ = lab
    page.locator("#sample").click()
    for canvas, words in (("#cells", "#cell-says"), ("#shares", "#share-says")):
        page.locator(canvas).focus()
        before = page.locator(words).text_content()
        page.keyboard.press("ArrowLeft")
        assert page.locator(words).text_content() != before
    assert page.locator("#bins li").count() == 9
    nameless = """[...document.querySelectorAll('canvas, button, input, select')]
        .filter((e) => !(e.ariaLabel || e.labels?.length || e.textContent.trim())).length"""
    assert page.evaluate(nameless) == 0
