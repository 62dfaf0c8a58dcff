"""A headless Chromium, driven over its debugging protocol."""

from __future__ import annotations

import asyncio
import base64
import itertools
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aiohttp

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class Tab:
    """One open page."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)

    async def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        number = next(self._numbers)
        await self._socket.send_json({"id": number, "method": method, "params": parameters})
        while True:
            answer = await self._socket.receive_json(timeout=30)
            if answer.get("id") == number:
                assert "error" not in answer, answer["error"]
                result: dict[str, Any] = answer["result"]
                return result

    async def value(self, expression: str) -> Any:
        """What a JavaScript expression gives."""
        answer = await self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    async def until(self, expression: str, seconds: float = 30) -> Any:
        """Wait until a JavaScript expression gives something true."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            # Until the page is there, its names are not.
            value = await self.value(f"(() => {{ try {{ return {expression} }} catch {{ return false }} }})()")
            if value:
                return value
            await asyncio.sleep(0.1)
        raise AssertionError(f"not within {seconds} s: {expression}")

    async def look(self, width: int, height: int, dark: bool = False) -> None:
        """Set the size of the window and whether its user likes it dark."""
        phone = width < 600
        await self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=2 if phone else 1,
            mobile=phone,
        )
        await self.call("Emulation.setScrollbarsHidden", hidden=True)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        await self.call("Emulation.setEmulatedMedia", features=[scheme])

    async def screenshot(self, path: Path) -> None:
        await asyncio.sleep(0.3)
        answer = await self.call("Page.captureScreenshot", captureBeyondViewport=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(base64.b64decode(answer["data"]))


@contextmanager
def chromium(profile: Path) -> Iterator[int]:
    """Run a browser and give the port it is driven through."""
    assert CHROMIUM is not None
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
    command += ["--remote-debugging-port=0", "--remote-allow-origins=*", f"--user-data-dir={profile}", "about:blank"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        ready = profile / "DevToolsActivePort"
        deadline = time.monotonic() + 60
        while not (ready.exists() and ready.read_text().strip()):
            assert time.monotonic() < deadline, "Chromium does not start"
            assert process.poll() is None, "Chromium has ended"
            time.sleep(0.1)
        yield int(ready.read_text().splitlines()[0])
    finally:
        process.terminate()
        process.wait(30)


async def open_tab(session: aiohttp.ClientSession, port: int, url: str) -> Tab:
    """Open a page."""
    async with session.put(f"http://127.0.0.1:{port}/json/new?{url}") as answer:
        target = await answer.json()
    tab = Tab(await session.ws_connect(target["webSocketDebuggerUrl"], max_msg_size=0))
    await tab.call("Page.enable")
    return tab
