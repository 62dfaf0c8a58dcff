"""The system's Chromium, driven by Playwright, whose own browsers would be a download."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from playwright.sync_api import Browser, sync_playwright
from tests.threads import beside

from limo_hog.detections import Detector
from limo_hog.live.pace import Pace
from limo_sim.run.episode import run_episode, score
from limo_sim.view.server import View
from limo_sim.view.tuning import Tunable
from limo_sim.world.scenario import Scenario

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@contextmanager
def chromium(*flags: str) -> Iterator[Browser]:
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", *flags]
        with playwright.chromium.launch(executable_path=CHROMIUM, args=options) as browser:
            yield browser


@contextmanager
def played(scenario: Scenario, controller: Tunable[Any], detector: Detector, speed: float) -> Iterator[View]:
    """Show a run of 90 s, longer than a browser takes to start and look, on a page; end it as fast as it can be."""
    with View(scenario, controller, pace=Pace(speed)) as view:

        def episode(_: object) -> None:
            view.end(score(run_episode(scenario, controller, detector, 90.0, 0, watch=view.watch)).to_json())

        with beside(episode):
            try:
                yield view
            finally:
                view.pace.set_speed(0)
                view.pace.resume()
