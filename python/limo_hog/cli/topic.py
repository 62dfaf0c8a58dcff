"""`limo-hog topic`: look at ROS 2 topics, as `ros2 topic` does."""

from __future__ import annotations

import argparse
import io
import math
import re
import statistics
import sys
import time
from collections import deque
from typing import TYPE_CHECKING, Any

from limo_hog.cli.support.arguments import seconds
from limo_hog.cli.support.output import emit, printable
from limo_hog.exceptions import LimoHogError

if TYPE_CHECKING:
    from limo_hog.ros2.dds import Bus, Subscription

#: `ros2 topic echo` shows so many elements of a sequence and letters of a string.
_SHOWN = 128


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `topic`."""
    parser = subparsers.add_parser(
        "topic", description="Look at the topics on the ROS 2 network, as `ros2 topic` does."
    )
    actions = parser.add_subparsers(dest="action", metavar="list|info|hz|echo", required=True)
    listing = actions.add_parser("list", help="names of all topics")
    listing.add_argument("-t", "--show-types", action="store_true", help="with their types")
    for action, words in (
        ("info", "a topic's types, who publishes and subscribes, and with which quality of service"),
        ("hz", "how often its messages come"),
        ("echo", "what its messages say, as YAML"),
    ):
        one = actions.add_parser(action, help=words)
        one.add_argument("topic", metavar="/TOPIC")
        if action != "info":
            one.add_argument("--seconds", type=seconds, default=math.inf, metavar="S", help="stop after so long")
        if action == "echo":
            one.add_argument("--once", action="store_true", help="stop after one message")


def run(args: argparse.Namespace) -> int:
    """Look."""
    from limo_hog.ros2.arguments import NodeNames
    from limo_hog.ros2.dds import Bus

    # ROS 2 hides nodes whose names begin so.
    bus = Bus(NodeNames("_limo_hog_topic"))
    if args.action == "list":
        topics = bus.topics()
        if not topics:
            print(f"no topics in {bus.network}", file=sys.stderr)
        for name, ends in topics.items():
            print(printable(f"{name} [{', '.join(ends.types)}]" if args.show_types else name))
        return 0
    topic = args.topic if args.topic.startswith("/") else f"/{args.topic}"
    found = bus.topics(
        2.0, enough=lambda found: args.action != "info" and topic in found and bool(found[topic].publishers)
    )
    if topic not in found:
        known = ", ".join(found) or "none"
        raise LimoHogError(f"topic {topic} is not there in {bus.network}; there are: {known}")
    if args.action == "info":
        ends = found[topic]
        print(printable(f"Type: {', '.join(ends.types)}"))
        for what, those in (("Publisher", ends.publishers), ("Subscription", ends.subscriptions)):
            print(f"{what} count: {len(those)}")
            for kind, quality in those:
                print(printable(f"  {kind}: {quality}"))
        return 0
    # What all publishers keep for later readers is asked for, as `ros2 topic echo` does.
    qualities = [quality for _, quality in found[topic].publishers]
    kept = bool(qualities) and all("TransientLocal" in quality for quality in qualities)
    subscription = bus.subscription(topic, found[topic].types[0], kept=kept)
    (_hz if args.action == "hz" else _echo)(bus, subscription, topic, args)
    return 0


def _hz(bus: Bus, subscription: Subscription, topic: str, args: argparse.Namespace) -> None:
    """Say the rate once a second, over the last 10,000 messages, as `ros2 topic hz`."""
    gaps: deque[float] = deque(maxlen=10_000)
    last: float | None = None
    until = time.monotonic() + args.seconds
    said = time.monotonic()
    while time.monotonic() < until:
        bus.wait(0.2)
        for _ in subscription.take():
            now = time.monotonic()
            if last is not None:
                gaps.append(now - last)
            last = now
        if gaps and time.monotonic() - said >= 1.0:
            said = time.monotonic()
            _say_rate(gaps)
    if not gaps:
        raise LimoHogError(f"topic {topic}: no two messages came in {args.seconds:g} s")
    _say_rate(gaps)


def _say_rate(gaps: deque[float]) -> None:
    print(f"average rate: {len(gaps) / sum(gaps):.3f}")
    spread = f"min: {min(gaps):.3f}s max: {max(gaps):.3f}s std dev: {statistics.pstdev(gaps):.5f}s"
    emit(f"\t{spread} window: {len(gaps) + 1}")


def _echo(bus: Bus, subscription: Subscription, topic: str, args: argparse.Namespace) -> None:
    until = time.monotonic() + args.seconds
    heard = False
    while time.monotonic() < until:
        bus.wait(0.2)
        for message in subscription.take():
            heard = True
            emit(as_yaml(message) + "---")
            if args.once:
                return
    if not heard:
        raise LimoHogError(f"topic {topic}: no message came in {args.seconds:g} s")


def as_yaml(message: Any) -> str:
    """Return a message as `ros2 topic echo` prints it: block style, long sequences and strings cut short."""
    from ruamel.yaml import YAML  # rosbags brings it along

    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = sys.maxsize
    text = io.StringIO()
    yaml.dump(_plain(message), text)
    # YAML 1.1, which `ros2 topic echo` writes, wants a point in every number with an exponent.
    return re.sub(r"([:-] -?\d)(e[+-]\d+)$", r"\1.0\2", text.getvalue(), flags=re.MULTILINE)


def _plain(value: Any) -> Any:
    if hasattr(value, "__dataclass_fields__"):
        return {name: _plain(getattr(value, name)) for name in value.__dataclass_fields__ if name != "__msgtype__"}
    if isinstance(value, str):
        return value if len(value) <= _SHOWN else value[:_SHOWN] + "..."
    if hasattr(value, "tolist"):
        value = value[: _SHOWN + 1].tolist()
    if isinstance(value, list):
        return [_plain(item) for item in value[:_SHOWN]] + (["..."] if len(value) > _SHOWN else [])
    return value
