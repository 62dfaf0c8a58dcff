"""The options of `follow`, `run` and `arena`: which scenario, and --view, --video, --record and --plot."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from limo_hog.cli.support.arguments import add_robot, file_ending, seconds, seed
from limo_hog.cli.support.output import STDOUT, write_json
from limo_hog.cli.support.page import PORT, add_view, announce, has_display
from limo_hog.exceptions import LimoHogError
from limo_hog.signals import held

if TYPE_CHECKING:
    from limo_sim.run.episode import Episode
    from limo_sim.run.log import Step, Watch
    from limo_sim.run.score import ScoreCard
    from limo_sim.view.server import View
    from limo_sim.view.tuning import Tunable
    from limo_sim.world.scenario import Scenario


def add_scenario(
    parser: argparse.ArgumentParser, default_seconds: float | None, seconds_help: str, more: str = ""
) -> None:
    """Add --scenario, --robot, --seconds and --seed."""
    add = parser.add_argument
    add("--scenario", default="workshop", metavar="NAME|FILE.toml", help=f"the scenario to run{more} (%(default)s)")
    add_robot(parser)
    add("--seconds", type=seconds, default=default_seconds, metavar="S", help=seconds_help)
    add("--seed", type=seed, default=0, metavar="N", help="of all random numbers (%(default)s)")


def add_watching(parser: argparse.ArgumentParser, *, plot: bool = True) -> None:
    """Add the options; --plot is not shown where a run has no end at which to draw."""
    group = parser.add_argument_group("to show and to record the run")
    add_view(
        group,
        f"show the run, in real time, on a page ({PORT}), which opens where there is a display; without HOST to "
        "this machine alone. `follow` shows it unasked where nothing else is asked for",
    )
    add, figure = group.add_argument, "draw path, pixel error, distance and speed in one figure"
    messages = "record everything sensed, found and commanded as ROS 2 messages (8 MB/s)"
    add("--video", type=file_ending(".mp4"), metavar="FILE.mp4", help="film what the follower saw (H.264)")
    add("--record", type=file_ending(".mcap"), metavar="FILE.mcap", help=messages)
    shown = figure if plot else argparse.SUPPRESS
    add("--plot", type=file_ending(".png", ".svg", ".pdf"), metavar="FILE.png", help=shown)


def finish(args: argparse.Namespace, card: ScoreCard) -> None:
    """Write the score card as JSON, or show it, and say what else was written."""
    if args.json:
        write_json(args.json, card.to_json())
    if args.json != STDOUT:
        from limo_hog.cli.support.console import console
        from limo_sim.cli.card import picture

        console().print(picture(card))
        if written := [str(one) for one in (args.json, args.video, args.record, args.plot) if one is not None]:
            print(f"written: {', '.join(written)}")


def shown_unasked(args: argparse.Namespace) -> bool:
    """Whether a run is to be shown though nobody said so: where it can be, and nothing else was asked for."""
    asked = (args.view, args.video, args.record, args.plot, args.json)
    return has_display() and all(one is None for one in asked)


@dataclass
class Observers:
    """Those who look on at one run: pass `notify` to the run, and call `end` after it."""

    keepers: list[Watch] = field(default_factory=list)  #: what writes to files; a signal does not interrupt these
    plot: Path | None = None  #: file of the figure, drawn at the end
    view: View | None = None  #: the live page
    _steps: list[Step] = field(default_factory=list)

    def __bool__(self) -> bool:
        """Whether a run needs to be shown to it."""
        return bool(self.keepers) or self.view is not None

    def notify(self, step: Step) -> None:
        """Keep and show a step; returns when the run may go on."""
        if self.plot is not None:
            self._steps.append(step.bare())
        if self.keepers:
            with held():
                for keep in self.keepers:
                    keep(step)
        if self.view is not None:
            self.view.watch(step)

    def end(self, episode: Episode, card: ScoreCard) -> None:
        """Draw the figure, and show the score card on the live page."""
        if self.plot is not None:
            from limo_sim.view.plot import plot

            plot(episode, self._steps, self.plot)
        if self.view is not None:
            self.view.end(card.to_json())


@contextmanager
def observing(
    args: argparse.Namespace, scenario: Scenario, controller: Tunable[Any] | None = None
) -> Iterator[Observers]:
    """Open every output that was asked for; a missing library is named first. Ctrl-C and SIGTERM leave whole files.

    `controller` is the one whose parameters the page may set.
    """
    stopped: KeyboardInterrupt | None = None
    try:
        with ExitStack() as stack:
            observers = Observers()
            if args.plot is not None:
                # Drawn at the end; a missing library is named now.
                import limo_sim.view.plot  # noqa: F401

                observers.plot = args.plot
            if args.video is not None:
                from limo_hog.imaging.writing import video_writer
                from limo_sim.view.reading import annotated

                film = stack.enter_context(video_writer(args.video, scenario.camera.rate_hz))
                observers.keepers.append(lambda step: film(annotated(step.log)) if step.log.frame else None)
            if args.record is not None:
                from limo_sim.view.record import recorded

                observers.keepers.append(stack.enter_context(recorded(args.record, scenario)))
            if args.view:
                from limo_sim.view.server import View

                observers.view = stack.enter_context(View(scenario, controller, *args.view))
                announce(observers.view.url)
            try:
                yield observers
            except KeyboardInterrupt as error:
                stopped = error
    except LimoHogError:
        # Stopped before the first frame, there is nothing to write, and that is not what is wrong.
        if stopped is None:
            raise
    if stopped is not None:
        raise stopped
