"""The live page: an HTTP server beside the run, which shows its newest moment and applies the page's control messages.

The run only leaves its newest moment here; pictures are made in the server's thread, at most some times a second
and only while a page is open.
"""

from __future__ import annotations

import asyncio
import logging
import math
import socket
import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from limo_hog.atomic import json_text
from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_hog.live.controls import MAX_BYTES, Settable, apply
from limo_hog.live.pace import Pace

with needed(by="the live page"):
    from aiohttp import WSMsgType, web

from limo_hog.live.access import HEADERS, Access, QuietLogger

if TYPE_CHECKING:
    from typing_extensions import Self

Moment = TypeVar("Moment")
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

LOOPBACK = "127.0.0.1"
#: What a page's files are, by their ending.
_KINDS = {"html": "html", "css": "css", "js": "javascript"}
#: How often the page is brought up to date [s].
PERIOD = 0.1
#: Control periods that a page which opens late is told of.
_REMEMBERED = 3000
#: A page that takes nothing for so long is dropped [s]; it comes back by itself when it can. Wi-Fi that roams is
#: quiet for two or three.
STALL_S = 5.0
#: How long a page may take to hear that the run is over and to close [s]; a run ends within 2 s.
_CLOSE_S = 1.0
#: What the system keeps for a page that does not read [bytes]: about two pictures, so that what it shows is new.
_SEND_BUFFER = 1 << 17


class ServeError(LimoHogError):
    """The page cannot be served where it was asked for."""


@dataclass(frozen=True, eq=False, slots=True)
class _Page:
    """One open page."""

    #: client, transport: its connection, twice: what is sent through, and what can be cut.
    client: web.WebSocketResponse
    transport: asyncio.Transport
    #: What was wrong with its control messages, not told yet.
    complaints: deque[str] = field(default_factory=lambda: deque(maxlen=10))

    async def send(self, message: dict[str, Any] | bytes) -> None:
        """Send JSON or a picture; a page that does not take it in time is dropped. Raises OSError if it is gone."""
        client = self.client
        sending = client.send_bytes(message) if isinstance(message, bytes) else client.send_str(json_text(message))
        try:
            await asyncio.wait_for(sending, STALL_S)
        except asyncio.TimeoutError as error:
            self.transport.abort()
            raise ConnectionAbortedError("the page takes nothing") from error


class Live(ABC, Generic[Moment]):
    """Serves the page of one run; a context manager, to which the run hands its moments.

    Parameters
    ----------
    package
        Whose folder `page` has the page's files.
    controller
        Whose parameters the page sets; None where there are none.
    host, port
        Where to listen; port 0 takes any free one. Anything but loopback lets others on the network steer.
    pace
        How fast the run goes at first.

    Raises
    ------
    ServeError
        On entering, when the port is in use or the host is not ours.
    """

    def __init__(
        self, package: str, controller: Settable | None, host: str = LOOPBACK, port: int = 0, pace: Pace | None = None
    ) -> None:
        self._package, self._controls = package, controller
        self._host, self._port = host, port
        self.pace = pace or Pace()
        self._newest: Moment | None = None
        # The newest moment with a picture, with its number.
        self._pictured: tuple[int, Moment] | None = None
        self._rows: deque[list[float | None]] = deque(maxlen=_REMEMBERED)
        self._written = 0
        self._ended: Mapping[str, Any] | None = None
        # Open pages, each with the task that shows it the run; the newest pictures, encoded once for all of them.
        self._pages: dict[_Page, asyncio.Task[None]] = {}
        self._encoded: tuple[int, asyncio.Future[list[bytes]]] | None = None
        self._over = asyncio.Event()
        self._access = Access(host, loopback=True)
        self._loop = asyncio.new_event_loop()
        # One thread encodes: what it makes serves all pages, and each thread more would keep megabytes of its own.
        self._loop.set_default_executor(ThreadPoolExecutor(1, thread_name_prefix="limo-hog pictures"))
        self._thread = threading.Thread(target=self._loop.run_forever, name="limo-hog view", daemon=True)
        self._runner: web.AppRunner | None = None

    @abstractmethod
    def _welcome(self) -> dict[str, Any]:
        """Return what a page is told first."""

    @abstractmethod
    def _state(self, moment: Moment) -> dict[str, Any]:
        """Return the numbers and words of a moment."""

    @abstractmethod
    def _pictures(self, moment: Moment) -> list[bytes]:
        """Encode the pictures of a moment, as the page reads them."""

    @property
    def url(self) -> str:
        """Where to look."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        return f"http://{host}:{self._port}/"

    def end(self, card: Mapping[str, Any]) -> None:
        """Tell all pages that the run is over, with its figures."""
        self._ended = card
        asyncio.run_coroutine_threadsafe(self._close_pages(), self._loop).result()

    def __enter__(self) -> Self:
        self._thread.start()
        try:
            asyncio.run_coroutine_threadsafe(self._start(), self._loop).result()
        except OSError as error:
            self.__exit__()
            raise ServeError(
                f"the page cannot be served at {self._host}:{self._port}: {error.strerror or error}; "
                "give --view another port"
            ) from error
        return self

    def __exit__(self, *_: object) -> None:
        asyncio.run_coroutine_threadsafe(self._stop(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _start(self) -> None:
        app = web.Application(middlewares=[self._guard])
        app.on_response_prepare.append(_add_headers)
        # Styles and connection are those of every page; the rest of `limo_hog.live` is the page of films.
        folders = [files(package).joinpath("page") for package in ("limo_hog.live", self._package)]
        for name, file in {file.name: file for folder in folders for file in folder.iterdir()}.items():
            where, kind = "/" if name == "index.html" else f"/{name}", _KINDS[name.rpartition(".")[2]]
            app.router.add_get(where, partial(_file, file.read_bytes(), kind))
        app.router.add_get("/live", self._live)
        logger: Any = QuietLogger(logging.getLogger("limo_hog.live"), {})
        # Connections that ask nothing, or never finish asking, do not hold up the end.
        self._runner = web.AppRunner(
            app, access_log=None, logger=logger, shutdown_timeout=0.1, lingering_time=0, keepalive_timeout=30
        )
        await self._runner.setup()
        await web.TCPSite(self._runner, self._host, self._port).start()
        addresses = self._runner.addresses
        self._port = addresses[0][1]
        self._access = Access.at(self._host, [address[0] for address in addresses])

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if self._access.admits(request.headers.get("Host"), request.headers.get("Origin")):
            return await handler(request)
        raise web.HTTPForbidden(
            text="This page answers to this machine's own addresses, and to no other site.\n"
            "Open it by the address that limo-hog printed, or give --view the name: --view NAME:PORT\n"
        )

    async def _stop(self) -> None:
        await self._close_pages()
        if self._runner is not None:
            await self._runner.cleanup()

    async def _close_pages(self) -> None:
        """Let every page hear that it is over, and drop those that do not."""
        self._over.set()
        if self._pages:
            await asyncio.wait(self._pages.values(), timeout=_CLOSE_S)
        for page in self._pages:
            page.transport.abort()

    async def _live(self, request: web.Request) -> web.StreamResponse:
        client = web.WebSocketResponse(heartbeat=20, compress=False, max_msg_size=MAX_BYTES, timeout=_CLOSE_S)
        await client.prepare(request)
        if request.transport is None:
            return client
        connection = request.transport.get_extra_info("socket")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        page = _Page(client, request.transport)
        showing = self._pages[page] = asyncio.create_task(self._show(page))
        try:
            async for message in client:
                if message.type is WSMsgType.ERROR:
                    break  # longer than any control message, or against the protocol
                text = message.data if message.type is WSMsgType.TEXT else ""
                if complaint := apply(text, self.pace, self._controls):
                    page.complaints.append(complaint)
        finally:
            del self._pages[page]
            showing.cancel()
            with suppress(asyncio.CancelledError):
                await showing
        return client

    async def _show(self, page: _Page) -> None:
        """Send a page what is new, as fast as it takes it and no faster than `PERIOD`; nothing else sends to it.

        While a page takes its time, this holds no moment, whose frame is 2 MB: numbers tell what was sent.
        """
        shown: tuple[Any, ...] = ()
        pictured, told = -1, 0
        with suppress(OSError):
            await page.send(self._welcome())
            while not page.client.closed:
                while page.complaints:
                    await page.send({"complaint": page.complaints.popleft()})
                written = self._written
                now = (written, self.pace.paused, self.pace.speed)
                if self._newest is not None and now != shown:
                    shown = now
                    rows = list(self._rows)[-(written - told) :] if written > told else []
                    told = written
                    encoded = self._newest_pictures()
                    await page.send({"state": self._state(self._newest), "rows": rows})
                    if encoded is not None and encoded[0] != pictured:
                        pictured, pictures = encoded
                        # A page that leaves does not take the pictures from the others.
                        for picture in await asyncio.shield(pictures):
                            await page.send(picture)
                if self._over.is_set():
                    await page.send({"ended": _finite(self._ended or {})})
                    await page.client.close()
                    return
                # At full speed ten pictures a second are too fast to follow, and take time from the run.
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self._over.wait(), PERIOD if self.pace.speed else 2 * PERIOD)

    def _newest_pictures(self) -> tuple[int, asyncio.Future[list[bytes]]] | None:
        """Encode the newest pictures, once for all pages and beside the server's loop; None without any."""
        if self._pictured is not None and (self._encoded is None or self._encoded[0] != self._pictured[0]):
            number, moment = self._pictured
            self._encoded = number, self._loop.run_in_executor(None, self._pictures, moment)
        return self._encoded


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    response.headers.update(HEADERS)


async def _file(body: bytes, kind: str, _: web.Request) -> web.Response:
    return web.Response(body=body, content_type=f"text/{kind}", charset="utf-8", headers={"Cache-Control": "no-cache"})


def _finite(values: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what a page does not show: all but plain numbers and words."""
    return {k: v for k, v in values.items() if isinstance(v, str) or (isinstance(v, (int, float)) and math.isfinite(v))}
