"""A publisher in a thread of its own."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from tests.threads import beside

from limo_hog.ros2 import dds, messages, names


@contextmanager
def publishing(topic: str, message: Any, hertz: float = 10.0) -> Iterator[None]:
    """Publish a message again and again, stamped with the time where it has a header."""
    publisher = dds.Bus().publisher(topic, message.__msgtype__, kept=topic == names.TF_STATIC)

    def work(over: threading.Event) -> None:
        at = time.monotonic()
        while not over.is_set():
            if hasattr(message, "header"):
                message.header.stamp = messages.to_time(time.time())
            publisher.publish(message)
            at += 1 / hertz
            time.sleep(max(at - time.monotonic(), 0))

    with beside(work):
        yield


def until_it_comes(bus: dds.Bus, send: Callable[[], Any], take: Callable[[], Any]) -> Any:
    """Send again and again, for 10 s at most, until there is something to take: what was taken."""
    until = time.monotonic() + 10
    while not (came := take()) and time.monotonic() < until:
        send()
        bus.wait(0.1)
    return came
