"""The system's Chromium, driven by Playwright, whose own browsers would be a download."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, sync_playwright

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@contextmanager
def chromium(*flags: str) -> Iterator[Browser]:
    """Run a headless browser."""
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", *flags]
        with playwright.chromium.launch(executable_path=CHROMIUM, args=options) as browser:
            yield browser
