"""Clients of the live page: strangers are refused by name, and who does not read is dropped; nothing is said of it."""

import asyncio
import dataclasses
import gc
import http.client
import itertools
import json
import socket
import threading
import time
import weakref
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack, asynccontextmanager, contextmanager, suppress
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.sim.logs import there
from tests.sim.view.stalled import HANDSHAKE, stalled
from tests.threads import beside

from limo_hog.detector import PeopleDetector
from limo_hog.follow.control.naming import controller_named
from limo_hog.live.access import Access
from limo_hog.live.pace import Pace
from limo_sim.run.episode import run_episode
from limo_sim.run.log import Step
from limo_sim.view.server import View
from limo_sim.view.tuning import Tunable
from limo_sim.world.scenario import Scenario

WORKSHOP = Scenario.load("workshop")


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    """Steps whose pictures are noise: 300 kB each, so that a stalled client's buffers are full at once."""
    seen: list[Step] = []
    run_episode(WORKSHOP, controller_named("tracking", None), PeopleDetector(scale=1.2), 0.5, 0, watch=seen.append)
    noise = np.random.default_rng(0).integers(0, 256, (len(seen), 480, 640, 3), dtype=np.uint8)
    return [pictured(step, image) for step, image in zip(seen, noise, strict=True) if step.log.frame is not None]


def pictured(step: Step, image: NDArray[np.uint8]) -> Step:
    frame = dataclasses.replace(there(step.log.frame), image=image)
    return dataclasses.replace(step, log=dataclasses.replace(step.log, frame=frame))


@asynccontextmanager
async def page_of(view: View) -> AsyncIterator[Any]:
    async with aiohttp.ClientSession() as session, session.ws_connect(view.url + "live", max_msg_size=0) as page:
        yield page


@contextmanager
def showing(view: View, steps: list[Step]) -> Iterator[None]:
    """Show the steps over and over, 50 a second, in a thread of their own."""

    def show(over: threading.Event) -> None:
        while not over.is_set():
            for step in steps:
                view.watch(step)
                time.sleep(0.02)

    with beside(show):
        yield


@pytest.mark.parametrize(
    "request_",
    [HANDSHAKE, "", "GET /live HTTP/1.1\r\nHost: ", "GET / HTTP/1.1\r\nHost: {host}\r\nContent-Length: 9\r\n\r\n"],
    ids=["never reads", "never asks", "asks half", "never sends its body"],
)
def test_a_run_ends_within_2_s_with_50_stalled_clients(request_: str, steps: list[Step]) -> None:
    with ExitStack() as served:
        view = served.enter_context(View(WORKSHOP, pace=Pace(0)))
        with stalled(view.url, 50, request_):
            with showing(view, steps):
                time.sleep(3)
            began = time.monotonic()
            view.end({"in_view": 1.0})
            served.close()
            assert time.monotonic() - began < 2


def test_a_client_that_does_not_read_is_dropped(steps: list[Step], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("limo_hog.live.server.STALL_S", 1.0)

    async def pictures(view: View, seconds: float) -> int:
        async with page_of(view) as page:
            count, until = 0, time.monotonic() + seconds
            while time.monotonic() < until:
                count += (await page.receive(timeout=5)).type is aiohttp.WSMsgType.BINARY
            return count

    with View(WORKSHOP, pace=Pace(0)) as view, stalled(view.url, 5) as clients, showing(view, steps):
        # Ten a second on an idle machine; on busy cores fewer, but not none.
        assert asyncio.run(pictures(view, 4)) > 3
        for client in clients:
            # What was under way when it was dropped, then the end.
            with suppress(ConnectionResetError):
                while client.recv(1 << 20):
                    pass


def test_clients_that_do_not_read_keep_no_frames_of_the_run(steps: list[Step]) -> None:
    images: list[weakref.ref[Any]] = []

    def show(view: View) -> None:
        for step in steps:
            image = there(step.log.frame).image.copy()
            images.append(weakref.ref(image))
            view.watch(pictured(step, image))
            del image
            time.sleep(0.05)

    with View(WORKSHOP, pace=Pace(0)) as view, ExitStack() as clients:
        # One after another, so that each stalls at a step of its own.
        for _ in range(12):
            clients.enter_context(stalled(view.url, 1))
            show(view)
        gc.collect()
        # The newest, the one whose pictures were made last, and one that is being encoded.
        assert sum(image() is not None for image in images) <= 3


def test_ten_pages_share_their_pictures(steps: list[Step], monkeypatch: pytest.MonkeyPatch) -> None:
    encoded: list[Step] = []

    def count(_: View, step: Step) -> list[bytes]:
        encoded.append(step)
        return [b"c"]

    monkeypatch.setattr(View, "_pictures", count)

    async def look(view: View) -> None:
        async with page_of(view) as page:
            while (await page.receive(timeout=5)).type is not aiohttp.WSMsgType.BINARY:
                pass

    async def all_look(view: View) -> None:
        await asyncio.gather(*(look(view) for _ in range(10)))

    with View(WORKSHOP, pace=Pace(0)) as view:
        view.watch(steps[0])
        asyncio.run(all_look(view))
    assert encoded == [steps[0]]


OWN_NAME = socket.gethostname()
#: Names of this machine that lead to loopback, whatever the page was bound to.
LOOPBACK = ["127.0.0.1:{port}", "localhost:{port}", "LOCALHOST:{port}", "localhost", "127.0.0.53:9", "[::1]:{port}"]
#: Names by which other machines know this one: for a page that was opened to the network.
NETWORK = ["192.0.2.7:{port}", "[2001:db8::7]:{port}", "0.0.0.0:{port}", f"{OWN_NAME}:{{port}}", f"{OWN_NAME}.local"]
#: Names that may lead here only because their owner makes them, and what is no name at all.
EVIL = ["evil.example", "evil.example:{port}", "127.0.0.1.evil.example:{port}", "localhost.evil.example:{port}"]
EVIL += ["127.0.0.1@evil.example:{port}", "evil.example@127.0.0.1:{port}", "127.0.0.1:{port}/evil.example"]
EVIL += ["127.0.0.1:{port}:{port}", "127.0.0.1:99999", "127.1", "2130706433", "[::1", ""]
BINDS = ["127.0.0.1", "localhost", "::1", "0.0.0.0"]
ORIGINS = {
    "none": None,
    "same": "http://{host}",
    "https": "https://{host}",
    "evil": "http://evil.example",
    "other port": "http://{name}:1",
    "null": "null",
    "empty": "",
    "other scheme": "ftp://{host}",
    "unclosed": "http://[::1",
}
SAME = {"none", "same", "https"}


@pytest.fixture
def quiet(capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """Nothing is printed or logged."""
    yield
    gc.collect()  # an exception of a task that was not awaited is told here
    assert capfd.readouterr().err == ""
    assert caplog.get_records("call") == []


def _has_ipv6() -> bool:
    try:
        with socket.create_server(("::1", 0), family=socket.AF_INET6):
            return True
    except OSError:
        return False


def _status(view: View, path: str, headers: dict[str, str]) -> tuple[int, dict[str, str]]:
    where = urlsplit(view.url)
    connection = http.client.HTTPConnection(str(where.hostname), where.port, timeout=10)
    connection.putrequest("GET", path, skip_host=True, skip_accept_encoding=True)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    answer.close()
    connection.close()
    return answer.status, {name.lower(): value for name, value in answer.getheaders()}


@pytest.mark.parametrize("bind", BINDS)
def test_a_request_comes_in_by_this_machines_own_names_and_from_its_own_page(bind: str, quiet: None) -> None:
    if bind == "::1" and not _has_ipv6():
        pytest.skip("this machine has no IPv6 loopback")
    with View(WORKSHOP, host=bind) as view:
        port = urlsplit(view.url).port
        for pattern, kind, path in itertools.product(LOOPBACK + NETWORK + EVIL, ORIGINS, ("/", "/live")):
            host = pattern.format(port=port)
            known = pattern in LOOPBACK or (bind == "0.0.0.0" and pattern in NETWORK)
            admitted = known and kind in SAME
            origin = (ORIGINS[kind] or "").format(host=host, name=host.partition(":")[0])
            status, _ = _status(view, path, {"Host": host} | ({"Origin": origin} if kind != "none" else {}))
            # A socket is asked for without the rest of its handshake: what is let in is told what is missing.
            wanted = {"/": 200, "/live": 400}[path] if admitted else 403
            assert status == wanted, (bind, host, origin, path)


def test_a_page_asked_for_by_a_name_answers_to_it() -> None:
    for loopback in (True, False):
        access = Access("Robot.Lab", loopback).at("Robot.Lab", ["127.0.1.1" if loopback else "192.0.2.7"])
        assert access.admits("robot.lab:8488", "http://robot.lab:8488")
        assert not access.admits("evil.lab:8488", "http://evil.lab:8488")
        assert access.admits("192.0.2.7:8488", None) is not loopback
    # A mapped loopback address is loopback.
    assert Access.at("::ffff:127.0.0.1", ["::ffff:127.0.0.1"]).loopback
    assert not Access.at("localhost", ["127.0.0.1", "192.0.2.7"]).loopback


@pytest.mark.parametrize("path", ["/", "/view.js", "/plots.js", "/view.css", "/live", "/nothing", "/../server.py"])
def test_every_answer_has_the_headers_that_keep_other_code_out(path: str) -> None:
    with View(WORKSHOP) as view:
        _, headers = _status(view, path, {"Host": urlsplit(view.url).netloc})
    policy = dict(rule.strip().partition(" ")[::2] for rule in headers["content-security-policy"].split(";"))
    assert policy["default-src"] == policy["frame-ancestors"] == "'none'"
    assert policy["script-src"] == policy["style-src"] == "'self'"
    assert (headers["x-content-type-options"], headers["x-frame-options"]) == ("nosniff", "DENY")


def _answer(view: View, text: str | bytes) -> dict[str, Any] | None:
    """What the page is told after a control message: a complaint, or None where the connection is closed."""

    async def ask() -> dict[str, Any] | None:
        async with page_of(view) as page:
            assert (await page.receive_json(timeout=10))["scenario"] == "workshop"
            await (page.send_bytes(text) if isinstance(text, bytes) else page.send_str(text))
            message = await page.receive(timeout=10)
            return json.loads(message.data) if message.type is aiohttp.WSMsgType.TEXT else None

    return asyncio.run(ask())


NONSENSE = ["", "[]", "{}", "1e999", '"set"', '{"do": "fly"}', '{"do": ["pause"]}', '{"do": "speed"}', "[" * 1000]
NONSENSE += [f'{{"do": "speed", "value": {value}}}' for value in ("-1", "true", "NaN", "9" * 400, "1e308")]
NONSENSE += [f'{{"set": "target_distance", "value": {value}}}' for value in ("1e308", "9" * 400, '"1"', "null")]
NONSENSE += ['{"set": "x", "value": 1}', '{"set": ["target_distance"], "value": 1}', '{"set": "target_distance"}']


@pytest.mark.parametrize(
    "text", [*NONSENSE, '{"do":' * 150, b"\xff\xfe", b'{"do": "pause"}'], ids=lambda text: repr(text)[:40]
)
def test_a_control_message_that_makes_no_sense_is_answered_and_changes_nothing(text: str | bytes, quiet: None) -> None:
    controller: Tunable[Any] = Tunable(controller_named("tracking", None))
    before = controller.parameters
    with View(WORKSHOP, controller, pace=Pace(2)) as view:
        assert len(there(_answer(view, text))["complaint"]) < 1000
        assert (view.pace.speed, view.pace.paused) == (2, False)
    assert controller.parameters == before


@pytest.mark.parametrize("text", ["[" * 100_000, " " * 1025, b"x" * 2000], ids=["deep", "long", "bytes"])
def test_a_message_longer_than_any_control_message_closes_the_connection(text: str | bytes, quiet: None) -> None:
    with View(WORKSHOP) as view:
        assert _answer(view, text) is None


@pytest.mark.parametrize(
    "request_",
    [
        b"\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
        b"GET\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: http://[::1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: x\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
        b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"a" * 100_000 + b"\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\n" + b"".join(b"X%d: 1\r\n" % i for i in range(10_000)) + b"\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\nnonsense\r\n\r\n",
        b"GET /live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n" + b"\xff" * 64,
    ],
    ids=lambda request: repr(request[:60]),
)
def test_a_malformed_request_is_refused_without_a_word(request_: bytes, quiet: None) -> None:
    with View(WORKSHOP) as view:
        where = urlsplit(view.url)
        with socket.create_connection((str(where.hostname), where.port or 0), timeout=10) as client:
            client.sendall(request_)
            client.shutdown(socket.SHUT_WR)
            with suppress(ConnectionResetError):
                while client.recv(1 << 16):
                    pass
        # The page is there for others all the same.
        assert _status(view, "/", {"Host": where.netloc})[0] == 200


def test_a_fault_of_the_page_itself_is_told(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    def fail(*_: object) -> bool:
        raise ZeroDivisionError("ours")

    monkeypatch.setattr(Access, "admits", fail)
    with View(WORKSHOP) as view:
        assert _status(view, "/", {"Host": "localhost"})[0] == 500
    assert "ZeroDivisionError: ours" in caplog.text
