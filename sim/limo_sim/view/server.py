"""The live page: an HTTP server beside the run, which shows its newest moment and takes wishes.

The run only leaves its newest moment here; pictures are made in the server's thread, at most some times a second
and only while somebody looks.
"""

from __future__ import annotations

import asyncio
import json
import math
import threading
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit

import cv2
import numpy as np
from aiohttp import WSMsgType, web
from numpy.typing import NDArray

from limo_hog.exceptions import LimoHogError
from limo_hog.follow.sense.observation import Scan
from limo_hog.follow.zones import ZONE_ENDS
from limo_sim.run.episode import Moment
from limo_sim.sensing.camera import FIELD
from limo_sim.sensing.lidar import MOUNT_AHEAD
from limo_sim.view.pace import Pace
from limo_sim.view.reading import annotated, depth_picture, reading
from limo_sim.view.tuning import ParameterError, Tunable
from limo_sim.world.furniture import Disc
from limo_sim.world.scenario import ROOM_HALF, Scenario

LOOPBACK = "127.0.0.1"
#: How often the page is brought up to date [s].
PERIOD = 0.1
#: Control periods that a page which opens late is told of.
_REMEMBERED = 3000
_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 80]


class ServeError(LimoHogError):
    """The page cannot be served where it was asked for."""


class View:
    """Serves the page of one run; a context manager, whose `watch` goes to `run_episode`.

    Parameters
    ----------
    scenario
        What is on the map.
    controller
        Whose parameters the page may set; None for a run without one of ours.
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
        self,
        scenario: Scenario,
        controller: Tunable[Any] | None = None,
        host: str = LOOPBACK,
        port: int = 0,
        pace: Pace | None = None,
    ) -> None:
        self._scenario, self._controller = scenario, controller
        self._host, self._port = host, port
        self.pace = pace or Pace()
        self._newest: Moment | None = None
        self._pictured: Moment | None = None
        self._rows: deque[list[float | None]] = deque(maxlen=_REMEMBERED)
        self._written = 0
        # Time and pose of the last control periods: a scan is as old as it is.
        self._poses: deque[tuple[float, float, float, float]] = deque(maxlen=32)
        self._ended: Mapping[str, Any] | None = None
        self._clients: set[web.WebSocketResponse] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="limo-hog view", daemon=True)
        self._runner: web.AppRunner | None = None

    @property
    def url(self) -> str:
        """Where to look."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        return f"http://{host}:{self._port}/"

    def watch(self, moment: Moment) -> None:
        """Show a moment, and return when the run may go on."""
        if moment.frame is not None:
            self._pictured = moment
        now, (x, y, _) = reading(moment.step), moment.step.truth.robot
        people = [(p.x, p.y) for p in moment.step.truth.people if p is not None]
        self._rows.append([*asdict(now).values(), x, y, *(people[0] if people else (None, None))])
        self._poses.append((moment.step.time, *moment.step.truth.robot))
        self._written += 1
        self._newest = moment
        self.pace.wait(moment.step.time)

    def end(self, card: Mapping[str, Any]) -> None:
        """Tell everybody that the run is over, with its score card."""
        self._ended = card
        asyncio.run_coroutine_threadsafe(self._say_goodbye(), self._loop).result(timeout=5)

    def __enter__(self) -> View:  # noqa: PYI034
        self._thread.start()
        try:
            asyncio.run_coroutine_threadsafe(self._start(), self._loop).result()
        except OSError as error:
            self._stop_loop()
            raise ServeError(
                f"the page cannot be served at {self._host}:{self._port}: {error.strerror or error}; "
                "give --view another port"
            ) from error
        return self

    def __exit__(self, *_: object) -> None:
        asyncio.run_coroutine_threadsafe(self._stop(), self._loop).result()
        self._stop_loop()

    def _stop_loop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _start(self) -> None:
        app = web.Application()
        app.router.add_get("/", _page("index.html", "text/html"))
        app.router.add_get("/view.css", _page("view.css", "text/css"))
        app.router.add_get("/view.js", _page("view.js", "text/javascript"))
        app.router.add_get("/live", self._live)
        self._runner = web.AppRunner(app, access_log=None)
        await self._runner.setup()
        site = web.TCPSite(self._runner, self._host, self._port)
        try:
            await site.start()
        except OSError:
            await self._runner.cleanup()
            raise
        self._port = self._runner.addresses[0][1]

    async def _stop(self) -> None:
        await self._say_goodbye()
        if self._runner is not None:
            await self._runner.cleanup()

    async def _say_goodbye(self) -> None:
        text = json.dumps({"ended": _finite(self._ended or {})})

        async def dismiss(client: web.WebSocketResponse) -> None:
            with suppress(ConnectionError, asyncio.TimeoutError):
                await asyncio.wait_for(client.send_str(text), 1)
                await asyncio.wait_for(client.close(), 1)

        await asyncio.gather(*map(dismiss, list(self._clients)))

    async def _live(self, request: web.Request) -> web.StreamResponse:
        # Another site's page, open in the same browser, may not steer; nor may one whose name leads here.
        origin = urlsplit(request.headers.get("Origin", f"//{request.host}"))
        names = {LOOPBACK, "localhost"} if self._host == LOOPBACK else {origin.hostname}
        if origin.netloc != request.host or origin.hostname not in names:
            raise web.HTTPForbidden(text="this page is not for other sites")
        client = web.WebSocketResponse(heartbeat=20, compress=False)
        await client.prepare(request)
        await client.send_str(json.dumps(self._welcome()))
        self._clients.add(client)
        showing = asyncio.create_task(self._show(client))
        try:
            async for message in client:
                if message.type is WSMsgType.TEXT:
                    complaint = self._obey(message.data)
                    if complaint:
                        await client.send_str(json.dumps({"complaint": complaint}))
        finally:
            self._clients.discard(client)
            showing.cancel()
        return client

    def _welcome(self) -> dict[str, Any]:
        return {
            "scenario": self._scenario.name,
            "room": ROOM_HALF,
            "field": FIELD,
            "furniture": [
                [f.x, f.y, f.radius] if isinstance(f, Disc) else [f.x, f.y, f.half_x, f.half_y, f.yaw]
                for f in (piece.footprint for piece in self._scenario.furniture)
            ],
            "zones": list(ZONE_ENDS.values()),
            "parameters": self._controller.parameters if self._controller else {},
        }

    async def _show(self, client: web.WebSocketResponse) -> None:
        """Send a page what is new, as fast as it takes it and no faster than `PERIOD`."""
        shown: tuple[Any, ...] = ()
        pictured, told = None, 0
        while not client.closed:
            newest, frame = self._newest, self._pictured
            now = (newest, self.pace.paused, self.pace.speed)
            if newest is not None and now != shown:
                shown = now
                written = self._written
                rows = list(self._rows)[-(written - told) :] if written > told else []
                told = written
                await client.send_str(json.dumps({"state": self._state(newest), "rows": rows}))
                if frame is not None and frame is not pictured:
                    pictured = frame
                    for picture in await self._loop.run_in_executor(None, self._pictures, frame):
                        await client.send_bytes(picture)
            # A run that hurries has no time to lose on pictures nobody can follow.
            await asyncio.sleep(PERIOD if self.pace.speed else 2 * PERIOD)

    def _state(self, moment: Moment) -> dict[str, Any]:
        step = moment.step
        return {
            **asdict(reading(step)),
            "mode": step.decision.mode.value,
            "reason": step.decision.reason,
            "robot": step.truth.robot,
            "people": [(p.x, p.y) for p in step.truth.people if p is not None],
            "scan": _hits(moment.scan, list(self._poses)),
            "detect_ms": step.frame.detect_ms or None if step.frame else None,
            "boxes": len(step.detections),
            "contacts": asdict(step.truth.contacts),
            "paused": self.pace.paused,
            "speed": self.pace.speed,
        }

    def _pictures(self, moment: Moment) -> list[bytes]:
        """Encode the pictures of a moment: the camera's, the depth's and a node's windows; a letter tells which."""
        if moment.frame is None:
            return []
        depth = depth_picture(moment.frame.depth[::2, ::2], self._scenario.depth.far_m)
        pictures = {b"c": annotated(moment.frame, moment.step), b"d": depth}
        encoded = [letter + cv2.imencode(".jpg", p, _JPEG)[1].tobytes() for letter, p in pictures.items()]
        # A window's name stands between its letter and its picture, ended by a line feed.
        return encoded + [
            b"w" + " ".join(name.split()).encode() + b"\n" + cv2.imencode(".jpg", p, _JPEG)[1].tobytes()
            for name, p in moment.windows.items()
        ]

    def _obey(self, text: str) -> str | None:
        """Do what a page wishes; returns what is wrong with the wish."""
        try:
            wish = json.loads(text)
            if "set" in wish:
                if self._controller is None:
                    return "this run has no parameters"
                self._controller.set(wish["set"], wish["value"])
            elif wish["do"] == "speed":
                speed = float(wish["value"])
                if not 0 <= speed <= 100:
                    return f"speed {speed:g} is not within 0 and 100"
                self.pace.set_speed(speed)
            else:
                {"pause": self.pace.pause, "resume": self.pace.resume, "step": self.pace.step}[wish["do"]]()
        except ParameterError as error:
            return str(error)
        except (ValueError, KeyError, TypeError):
            return f"not understood: {text[:100]}"
        return None


def _page(name: str, kind: str) -> Any:
    body = files("limo_sim.view").joinpath("page").joinpath(name).read_bytes()

    async def answer(_: web.Request) -> web.Response:
        return web.Response(body=body, content_type=kind, charset="utf-8", headers={"Cache-Control": "no-cache"})

    return answer


def _hits(scan: Scan | None, poses: list[tuple[float, float, float, float]]) -> list[list[float]]:
    """Return every second lidar hit in the arena's frame [m], to the centimetre, by the pose at the scan's time."""
    if scan is None:
        return []
    times, *pose = np.array(poses).T
    x, y, yaw = (float(np.interp(scan.stamp, times, values)) for values in (*pose[:2], np.unwrap(pose[2])))
    ranges: NDArray[np.float64] = scan.ranges.astype(np.float64)
    angles = yaw + np.linspace(scan.angle_min, scan.angle_max, len(ranges))
    hit = np.isfinite(ranges)
    hit[1::2] = False
    points = np.stack(
        [
            x + MOUNT_AHEAD * math.cos(yaw) + ranges[hit] * np.cos(angles[hit]),
            y + MOUNT_AHEAD * math.sin(yaw) + ranges[hit] * np.sin(angles[hit]),
        ],
        axis=1,
    )
    rounded: list[list[float]] = np.round(points, 2).tolist()
    return rounded


def _finite(values: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what a page does not show: all but plain numbers and words."""
    return {k: v for k, v in values.items() if isinstance(v, (int, float, str)) and v == v}
