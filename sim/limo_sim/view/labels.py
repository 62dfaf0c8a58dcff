"""A run as labelled pictures: colour, depth, boxes and identities in COCO's JSON, to train and to measure detectors."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from limo_hog.atomic import whole_file
from limo_sim.run.episode import Moment
from limo_sim.sensing.camera import FOCAL_PX, WIDTH, CameraPose, Frame
from limo_sim.sensing.optics import Lens
from limo_sim.sensing.room import FLOOR_DEPTH
from limo_sim.sensing.solids import F32, upright_bounds
from limo_sim.world.furniture import KINDS, Furniture
from limo_sim.world.movers import Movers
from limo_sim.world.scenario import Scenario

ANNOTATIONS = "annotations.json"
# People of whom less than this is seen are marked as left out of measurements (`iscrowd`): the "reasonable" subset of
# P. Dollár et al., "Pedestrian Detection: An Evaluation of the State of the Art" (PAMI 2012).
_SEEN = 0.65
# Pieces of furniture that show less than this share of their height, or fewer rows than this, get no box. Chosen.
_STANDS, _LEAST_ROWS = 0.65, 8
# A pixel belongs to a piece when its depth is within the piece's radius and this of its middle [m].
_SLACK = 0.05
# A pixel is not of the floor when its depth is less than this share of the floor's in its row. Chosen: noise is 0.4 %.
_FLOOR = 0.97
_PERSON = 1
CATEGORIES = {"person": _PERSON} | {kind: number for number, kind in enumerate(KINDS, start=_PERSON + 1)}
"""Numbers of the categories, by name."""


@contextmanager
def labelled(folder: Path, scenario: Scenario) -> Iterator[Callable[[Moment], None]]:
    """Give a function that adds a moment's frame to a folder; the labels are written at the end.

    `images/N.png` is the colour image, `depth/N.png` the depth in millimetres, uint16, 0 where unknown or beyond the
    limits, and `annotations.json` COCO's labels. Beside COCO's keys an image has `depth_file_name`, `stamp` [s] and
    `robot` (x, y, yaw), a person's annotation has `track_id` (the person's number in the scenario, from 1), `visible`
    (share of the silhouette), `distance` from the robot's centre [m] and `pose` (x, y, yaw). A person's box goes
    round the whole silhouette, cut at the image's edge, whatever stands in front; a piece of furniture's round what is
    seen of it.
    """
    images: list[dict[str, Any]] = []
    notes: list[dict[str, Any]] = []
    movers = Movers(scenario.movers)
    lens = Lens(scenario.camera.k1, scenario.camera.k2)
    floor = np.repeat(FLOOR_DEPTH, WIDTH, axis=1)
    if not lens.is_plain:
        floor = lens.depth(floor)

    def watch(moment: Moment) -> None:
        frame = moment.frame
        if frame is None:
            return
        number, name = len(images) + 1, f"{len(images) + 1:06}.png"
        millimetres = np.where(np.isfinite(frame.depth), np.rint(1e3 * frame.depth), 0).astype(np.uint16)
        for part, picture in (("images", frame.image), ("depth", millimetres)):
            with whole_file(folder / part / name) as path:
                cv2.imwrite(str(path), picture)
        height, width = frame.image.shape[:2]
        images.append(
            {
                "id": number,
                "file_name": f"images/{name}",
                "depth_file_name": f"depth/{name}",
                "width": width,
                "height": height,
                "stamp": round(frame.stamp, 3),
                "robot": list(frame.truth.robot),
            }
        )
        for note in (*_people(frame), *_furniture(frame, (*scenario.furniture, *movers.at(frame.stamp)), lens, floor)):
            box = note["bbox"]
            notes.append({"id": len(notes) + 1, "image_id": number, "area": box[2] * box[3], **note})

    try:
        yield watch
    finally:
        table = {
            "info": {"description": f"limo-sim, scenario {scenario.name}"},
            "images": images,
            "annotations": notes,
            "categories": [{"id": number, "name": name} for name, number in CATEGORIES.items()],
        }
        with whole_file(folder / ANNOTATIONS) as path:
            path.write_text(json.dumps(table), encoding="utf-8")


def _people(frame: Frame) -> Iterator[dict[str, Any]]:
    for number, person in enumerate(frame.truth.people, start=1):
        if person is not None and person.box is not None and person.visible > 0:
            yield {
                "category_id": _PERSON,
                "bbox": list(person.box),
                "iscrowd": int(person.visible < _SEEN),
                "track_id": number,
                "visible": round(person.visible, 4),
                "distance": round(person.distance, 4),
                "pose": [round(value, 4) for value in (person.x, person.y, person.yaw)],
            }


def _furniture(frame: Frame, pieces: tuple[Furniture, ...], lens: Lens, floor: F32) -> Iterator[dict[str, Any]]:
    """Label furniture: what the depth image shows at the piece's place, and is not floor."""
    camera = CameraPose.on_robot(*frame.truth.robot)
    for piece in pieces:
        radius, top = KINDS[piece.kind].extent
        across, ahead = camera.ahead_of(piece.x, piece.y)
        bounds = upright_bounds(across, ahead, radius, 0.0, top)
        if bounds is None or ahead < radius:
            continue
        left, upper = math.floor(bounds[0]), math.floor(bounds[1])
        window = lens.box((left, upper, math.ceil(bounds[2]) - left, math.ceil(bounds[3]) - upper))
        if window is None:
            continue
        at = np.s_[window[1] : window[1] + window[3], window[0] : window[0] + window[2]]
        depth = frame.depth[at]
        rows, columns = np.nonzero((np.abs(depth - ahead) < radius + _SLACK) & (depth < _FLOOR * floor[at]))
        if len(rows) == 0:
            continue
        tall = int(rows.max() - rows.min()) + 1
        if tall < _LEAST_ROWS or tall < _STANDS * FOCAL_PX * top / ahead:
            continue
        box = window[0] + int(columns.min()), window[1] + int(rows.min()), int(np.ptp(columns)) + 1, tall
        yield {"category_id": CATEGORIES[piece.kind], "bbox": list(box), "iscrowd": 0}
