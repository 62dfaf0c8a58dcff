"""`limo-hog export`: labelled frames of the arena, for training and for measuring."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from limo_hog.cli.support.arguments import count, seconds, seed
from limo_hog.cli.support.output import UsageError, refuse_to_overwrite
from limo_hog.cli.support.progress import progress

if TYPE_CHECKING:
    from limo_sim.run.export import Thing
    from limo_sim.sensing.camera import TrueFrame

# Less visible things are marked `iscrowd`: evaluators neither want them found nor count them as false. The share is
# that of the "reasonable" set in Dollár et al., "Pedestrian Detection: An Evaluation of the State of the Art", 2012.
_LEAST_VISIBLE = 0.65
_MILLIMETRES, _FARTHEST = 1000, 65535  # depth pictures hold millimetres in 16 bits, as depth cameras' do (REP 118)


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `export`."""
    parser = subparsers.add_parser(
        "export",
        description="Let the robot wander through the arena and write what its camera sees, with the boxes of people "
        "and furniture: DIR/coco.json and DIR/images, for `limo-hog train` and `limo-hog evaluate`.",
    )
    add = parser.add_argument
    add("--scenario", default="workshop", metavar="NAME|FILE.toml", help="the scenario to look at (%(default)s)")
    add("--out", type=Path, required=True, metavar="DIR", help="a new or empty folder")
    add("--frames", type=count, default=150, metavar="N", help="how many pictures (%(default)s)")
    add("--every", type=seconds, default=1.0, metavar="S", help="simulated time between two (%(default)s)")
    add("--depth", action="store_true", help="write depth pictures too: PNG, 16 bits, millimetres")
    add("--seed", type=seed, default=0, metavar="N", help="of all random numbers (%(default)s)")
    add("--resume", action="store_true", help="complete what an earlier run with the same options began")


def run(args: argparse.Namespace) -> int:
    """Write the pictures, then the labels: of those written, if it is stopped."""
    from limo_hog.atomic import json_text, write_text
    from limo_hog.signals import held
    from limo_sim.run.export import labelled_frames, labels_of
    from limo_sim.run.provenance import code_version, scenario_hash
    from limo_sim.world.scenario import Scenario

    scenario = Scenario.load(args.scenario)
    labels = sorted({"person", *labels_of(scenario)})
    info = {"scenario": scenario.name, "scenario_hash": scenario_hash(scenario), "seed": args.seed}
    info |= {"every_s": args.every, "code_version": code_version()}
    table: dict[str, Any] = {"info": info, "categories": [{"id": i, "name": name} for i, name in enumerate(labels, 1)]}
    images = table["images"] = []
    annotations = table["annotations"] = []
    file = args.out / "coco.json"
    known = _known(file, info) if args.resume else 0
    if not known:
        # What a killed run made can be told by this.
        write_text(file, json_text(table) + "\n")
    try:
        with progress("frames") as bar:
            task = bar.add_task(scenario.name, total=args.frames)
            for frame, things in labelled_frames(scenario, args.seed, args.frames, args.every):
                number = len(images) + 1
                with held():
                    images.append(_write_pictures(args.out, number, frame, depth=args.depth))
                    annotations += [
                        {"id": len(annotations) + i, "image_id": number, **_annotation(thing, labels)}
                        for i, thing in enumerate(things, 1)
                    ]
                bar.advance(task)
    finally:
        if len(images) > known:
            write_text(file, json_text(table) + "\n")
        print(f"{args.out}: pictures: {len(images)}, labelled things: {len(annotations)}, labels: {file.name}")
    return 0


def _known(file: Path, info: dict[str, Any]) -> int:
    """Return how many pictures an earlier run has labelled, 0 where the folder is new or empty; refuse any other."""
    if not file.exists():
        refuse_to_overwrite([file.parent])
        return 0
    try:
        before = json.loads(file.read_text("utf-8"))
        if before["info"] == info:
            return len(before["images"])
    except (ValueError, LookupError, TypeError):
        pass
    raise UsageError(f"{file} is of another run than {info}: give another folder")


def _write_pictures(folder: Path, number: int, frame: TrueFrame, *, depth: bool) -> dict[str, Any]:
    """Write a frame, and return its entry in COCO's `images`."""
    import numpy as np

    from limo_hog.imaging.writing import write_image

    name = f"{number:06d}.png"
    height, width = frame.depth.shape
    entry = {"id": number, "file_name": f"images/{name}", "width": width, "height": height, "stamp": frame.stamp}
    write_image(folder / "images" / name, frame.image)
    if depth:
        # 0 where the depth is unknown, too near or too far.
        known = np.where(np.isfinite(frame.depth), frame.depth * _MILLIMETRES, 0)
        write_image(folder / "depth" / name, np.rint(known).clip(0, _FARTHEST).astype(np.uint16))
        entry["depth_file_name"] = f"depth/{name}"
    return entry


def _annotation(thing: Thing, labels: list[str]) -> dict[str, Any]:
    return {
        "category_id": labels.index(thing.label) + 1,
        "bbox": thing.box,
        "area": thing.box[2] * thing.box[3],
        "iscrowd": int(thing.visible < _LEAST_VISIBLE),
        "track_id": thing.identity,
        "visible": round(thing.visible, 4),
    }
