"""`limo-hog train`: labelled boxes in, a detector out."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from limo_hog.cli.support.arguments import add_labels, count, file_ending, number, seed, size
from limo_hog.cli.support.output import UsageError, warnings_in_one_line

if TYPE_CHECKING:
    from limo_hog.learn.sources import TrainingData
    from limo_hog.learn.training import Round, TrainingParameters


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `train`."""
    parser = subparsers.add_parser(
        "train",
        description="Train a detector of people or of anything else that looks alike from the same side, from labelled "
        "pictures. Ctrl-C keeps the last round.",
    )
    parser.add_argument(
        "data",
        nargs="+",
        type=Path,
        metavar="DATA",
        help="labels (VOC, YOLO, COCO, CVAT, imglab, boxes.json), or folders of crops of people as INRIA's",
    )
    parser.add_argument(
        "--out",
        required=True,
        type=file_ending(".yml", ".yaml", ".xml", ".json"),
        metavar="MODEL.yml",
        help="the detector, as OpenCV has it; its card MODEL.yml.json beside it",
    )
    parser.add_argument(
        "--negatives", nargs="+", type=Path, default=[], metavar="DIR", help="pictures without the object"
    )
    parser.add_argument(
        "--validate", type=Path, metavar="DATA", help="labels to measure on, instead of a share of DATA held out"
    )
    share = partial(number, low=0, high=0.99, what="share")
    parser.add_argument("--held-out", type=share, default=0.2, metavar="SHARE", help="share held out (%(default)s)")
    add_labels(parser)
    parser.add_argument(
        "--window", type=size, metavar="WxH", help="window size [px], multiples of 8 (chosen from DATA)"
    )
    parser.add_argument("--no-mirror", action="store_true", help="do not learn mirrored objects: left is not right")
    parser.add_argument(
        "--rounds", type=count, default=3, metavar="N", help="rounds of hard-negative mining (%(default)s)"
    )
    parser.add_argument("--seed", type=seed, default=0, metavar="N", help="of all that is drawn (%(default)s)")


def run(args: argparse.Namespace) -> int:
    """Train, and write the detector and its card after every round."""
    from limo_hog.cli.support.progress import progress
    from limo_hog.learn.sources import Wanted, gather
    from limo_hog.learn.training import TrainingParameters, train
    from limo_hog.parallel import cores

    if args.window and (args.window[0] % 8 or args.window[1] % 8 or min(args.window) < 16):
        raise UsageError(f"--window {args.window[0]}x{args.window[1]}: multiples of 8 from 16 on are wanted")
    how = TrainingParameters(rounds=args.rounds, mirror=not args.no_mirror, seed=args.seed)
    wanted = Wanted(
        tuple(args.data),
        tuple(args.negatives),
        args.validate,
        args.label,
        args.pictures,
        args.window,
        args.held_out,
        args.seed,
    )
    rounds: list[dict[str, Any]] = []
    with warnings_in_one_line(), progress("pictures") as bar:
        task, shown = bar.add_task("reading", total=None), "reading"
        data = gather(wanted)

        def step(stage: str, steps: int | None) -> None:
            nonlocal task, shown
            if shown != stage:
                bar.remove_task(task)
                task, shown = bar.add_task(stage, total=steps), stage
            bar.advance(task)

        try:
            for done in train(data, how, cores(), step):
                line = _keep(done, args.out, rounds, data, how)
                bar.console.print(line, highlight=False, soft_wrap=True)
        except KeyboardInterrupt:
            if rounds:
                print(f"limo-hog: {args.out} is round {rounds[-1]['round']}", file=sys.stderr)
            raise
    print(args.out)
    return 0


def _keep(done: Round, out: Path, rounds: list[dict[str, Any]], data: TrainingData, how: TrainingParameters) -> str:
    """Measure and write a round's detector, note it in `rounds`, and return what is said of it."""
    from limo_hog.learn.card import make_card, measure, write_model
    from limo_hog.learn.training import as_json

    measured = measure(done, data, final=done.number == how.rounds)
    figures = measured.get("figures", {})
    rounds.append(as_json(done) | {name: figures[name] for name in ("lamr", "ap") if name in figures})
    write_model(out, done.solution.coefficients, data.shape, make_card(measured, rounds, data, how))
    words = [
        f"round {done.number}: {done.objects} objects, {done.negatives} negatives",
        f"{done.descriptor_bytes / 2**20:.0f} MB of descriptors",
        f"{done.seconds:.0f} s",
    ]
    if done.number:
        words[0] += f" ({done.new} new, {done.left_out} left out for memory)" if done.left_out else f" ({done.new} new)"
    if "lamr" in figures:
        words.insert(
            1, f"LAMR {figures['lamr']:.3f}, AP {figures['ap']:.3f} on {figures['pictures']} pictures held out"
        )
    return "; ".join(words)
