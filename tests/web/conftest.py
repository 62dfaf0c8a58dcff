"""The browser lab, served from target/web, in headless Chromium."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page
from tests.sim.view.browser import CHROMIUM
from tests.threads import served

BUILT = Path(__file__).parents[2] / "target/web"


@pytest.fixture(scope="session", autouse=True)
def built() -> Path:
    if not (BUILT / "hog-scalar.wasm").exists():
        pytest.skip("target/web is not there: .ci/web builds it")
    if CHROMIUM is None:
        pytest.skip("no Chromium")
    return BUILT


@dataclass
class Lab:
    """The open page, the addresses it asked for, and its errors."""

    page: Page
    asked: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def text(self, name: str) -> str:
        return self.page.locator(f"#{name}").text_content() or ""

    def people(self) -> int:
        return self.page.locator("#people button").count()

    def wait(self, condition: str) -> None:
        self.page.wait_for_function(f"() => {condition}")


def opened(browser: Browser | BrowserContext, address: str) -> Lab:
    lab = Lab(browser.new_page())
    lab.page.set_default_timeout(60_000)  # the machine may be busy
    lab.page.on("request", lambda request: lab.asked.append(request.url))
    lab.page.on("pageerror", lambda error: lab.errors.append(str(error)))
    lab.page.goto(address)
    lab.page.wait_for_selector("body[data-ready=yes]")
    return lab


@pytest.fixture(scope="session")
def address(built: Path) -> Iterator[str]:
    with served(built) as address:
        yield address
