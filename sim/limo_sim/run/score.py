"""How well a robot followed: pure functions of an episode's log.

The person who counts is the first one the follower rightly took for a person; the scenario's first where it took
nobody. They are in view where the camera sees at least half of them.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.decision import Mode
from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.ranging import Zone, zone_of
from limo_sim.run.episode import Episode, Step
from limo_sim.sensing.camera import WIDTH
from limo_sim.world.truth import PersonTruth, Truth

#: Share of a person's silhouette from which they count as in view.
IN_VIEW = 0.5
#: Distance that following is measured against [m]: the middle of Hall's social zone, near.
TARGET = 1.5
#: A person not found for longer than this was lost [s]; found again means within the second [s].
LOST_AFTER, FOUND_WITHIN = 0.5, 3.0


@dataclass(frozen=True, slots=True)
class ScoreCard:
    """The figures of one run.

    Fractions are 0..1 of the frames after the person was first in view; None where there is nothing to measure.

    Attributes
    ----------
    frames
        Camera frames worked on.
    first_detection_s
        When the person was first found [s].
    in_view, detected
        Share of frames with the person in view; of those, share in which they were found.
    best_box_wrong
        Share of frames with boxes whose best box is on nobody.
    longest_gap_s
        Longest time between two frames in which the person was found [s].
    pixel_error_mean, pixel_error_p95
        Horizontal distance of the person from the middle of the image, where in view [px].
    distance_min_m, distance_mean_m, distance_rms_error_m
        From the robot's centre to the person's axis [m]; the error is to 1.5 m.
    zone_intimate, zone_personal, zone_social, zone_public
        Share of time in each of Hall's zones, by the same distance.
    clearance_min_m
        Smallest gap between the robot's outline and any person's [m].
    contacts_person, contacts_wall
        How often the robot touched a person; a wall or furniture.
    lost, found_again
        How often the person was lost for more than 0.5 s; share of these found again within 3 s, not counting
        the time they were hidden behind something.
    follows_first
        Share of frames with a target in which it is the person followed first.
    path_wrong_m
        Distance driven while what was followed is nobody [m].
    mean_abs_domega
        Mean change of the turn rate from one command to the next [rad/s].
    path_m
        Distance the robot's centre travelled [m].
    modes, reasons
        Share of control periods in each mode, and for each reason.
    detect_ms_p50, detect_ms_p95, detect_ms_mean, render_ms_p50, real_time_factor
        Wall time; the only figures that differ between two runs of one seed.
    """

    scenario: str
    controller: str
    detector: str
    seed: int
    seconds: float
    frames: int
    first_detection_s: float | None
    in_view: float | None
    detected: float | None
    best_box_wrong: float | None
    longest_gap_s: float | None
    pixel_error_mean: float | None
    pixel_error_p95: float | None
    distance_min_m: float | None
    distance_mean_m: float | None
    distance_rms_error_m: float | None
    zone_intimate: float | None
    zone_personal: float | None
    zone_social: float | None
    zone_public: float | None
    clearance_min_m: float | None
    contacts_person: int
    contacts_wall: int
    lost: int
    found_again: float | None
    follows_first: float | None
    path_wrong_m: float
    mean_abs_domega: float
    path_m: float
    modes: dict[str, float]
    reasons: dict[str, float]
    detect_ms_p50: float | None
    detect_ms_p95: float | None
    detect_ms_mean: float | None
    render_ms_p50: float | None
    real_time_factor: float

    def to_json(self) -> dict[str, Any]:
        """Return the figures as JSON's types."""
        return dataclasses.asdict(self)


def score(episode: Episode) -> ScoreCard:
    """Measure an episode."""
    steps = episode.steps
    frames = [step for step in steps if step.seen is not None]
    hits = [_hits(step) for step in frames]
    targets = [_target(step, hit) for step, hit in zip(frames, hits, strict=True)]
    subject = next((who for who in targets if who is not None and who >= 0), 0)
    found = [subject in hit for hit in hits]
    views = [_person(step.seen, subject) for step in frames]
    visible = np.array([view is not None and view.visible >= IN_VIEW for view in views], bool)
    first = int(np.argmax(visible)) if visible.any() else len(frames)
    counted = [step for step in steps if first < len(frames) and step.time >= frames[first].time]
    distances = [person.distance for step in counted if (person := _person(step.truth, subject))]
    after = slice(first, None)
    boxed = [hit for step, hit in zip(frames, hits, strict=True) if len(step.detections)]
    errors = [_pixel_error(view) for view, ok in zip(views[after], visible[after], strict=True) if ok and view]
    gaps = _gaps(frames, targets, subject)
    detect_ms = [step.detect_ms for step in frames]
    stamps = [step.seen.stamp for step, ok in zip(frames, found, strict=True) if ok and step.seen]
    known = [who for who in targets if who is not None]
    zones = Counter(zone_of(distance) for distance in distances)
    return ScoreCard(
        scenario=episode.scenario.name,
        controller=episode.controller,
        detector=episode.detector,
        seed=episode.seed,
        seconds=round(episode.seconds, 6),
        frames=len(frames),
        first_detection_s=stamps[0] if stamps else None,
        in_view=_mean(visible[after]),
        detected=_mean(np.array(found, bool)[after][visible[after]]),
        best_box_wrong=_mean([hit[0] < 0 for hit in boxed]),
        longest_gap_s=max(np.diff(stamps).tolist(), default=None),
        pixel_error_mean=_mean(errors),
        pixel_error_p95=float(np.percentile(errors, 95)) if errors else None,
        distance_min_m=min(distances, default=None),
        distance_mean_m=_mean(distances),
        distance_rms_error_m=_rms(np.array(distances) - TARGET),
        zone_intimate=_share(zones, Zone.INTIMATE),
        zone_personal=_share(zones, Zone.PERSONAL),
        zone_social=_share(zones, Zone.SOCIAL),
        zone_public=_share(zones, Zone.PUBLIC),
        clearance_min_m=_clearance(episode),
        contacts_person=episode.contacts.person,
        contacts_wall=episode.contacts.wall,
        lost=len(gaps),
        found_again=_mean([gap <= FOUND_WITHIN for gap in gaps]),
        follows_first=_mean([who == subject for who in known]),
        path_wrong_m=_path_wrong(steps),
        mean_abs_domega=_mean(np.abs(np.diff([step.twist.angular for step in steps]))) or 0.0,
        path_m=_path(steps),
        modes=_shares([step.mode.value for step in steps], [mode.value for mode in Mode]),
        reasons=_shares([step.reason for step in steps], []),
        detect_ms_p50=float(np.percentile(detect_ms, 50)) if detect_ms else None,
        detect_ms_p95=float(np.percentile(detect_ms, 95)) if detect_ms else None,
        detect_ms_mean=_mean(detect_ms),
        render_ms_p50=float(np.percentile([step.render_ms for step in frames], 50)) if frames else None,
        real_time_factor=episode.seconds / episode.wall_seconds if episode.wall_seconds > 0 else 0.0,
    )


def on_person(box: NDArray[np.int32], truth: PersonTruth) -> bool:
    """Whether a detection window (x, y, w, h) [px] is on a person: its middle within theirs, of about their size."""
    if truth.box is None:
        return False
    x, y, w, h = truth.box
    column, row = box[0] + box[2] / 2, box[1] + box[3] / 2
    inside = x - 0.25 * w <= column <= x + 1.25 * w and y <= row <= y + h
    # The window is about 1.33 times the person; people cut off by the image's edge are less of it.
    return bool(inside and 0.6 <= box[3] / h <= 2.5)


def _hits(step: Step) -> list[int]:
    """Whom each box is on, in the boxes' order; -1 nobody."""
    return [_hit(box, _people(step.seen)) for box in step.detections.boxes]


def _hit(box: NDArray[np.int32], people: Sequence[PersonTruth | None]) -> int:
    """Whom a box is on: of several, of those in view before those hidden, the one whose middle is nearest."""
    middle = box[0] + box[2] / 2
    ranks = [
        (person.visible < IN_VIEW, abs(person.box[0] + person.box[2] / 2 - middle), who)
        for who, person in enumerate(people)
        if person and person.box and on_person(box, person)
    ]
    return min(ranks)[2] if ranks else -1


def _target(step: Step, hits: Sequence[int]) -> int | None:
    """Who is followed: -1 nobody, None without a target."""
    return None if step.target is None else hits[step.target]


def _people(truth: Truth | None) -> tuple[PersonTruth | None, ...]:
    return () if truth is None else truth.people


def _person(truth: Truth | None, who: int) -> PersonTruth | None:
    people = _people(truth)
    return people[who] if who < len(people) else None


def _pixel_error(person: PersonTruth) -> float:
    """Return how far the middle of the person's box is from the image's [px]."""
    return 0.0 if person.box is None else abs(person.box[0] + person.box[2] / 2 - WIDTH / 2)


def _gaps(frames: Sequence[Step], targets: Sequence[int | None], subject: int) -> list[float]:
    """Return the time [s] it took to find the subject again after each loss, without the time they were hidden."""
    gaps = []
    length = searched = 0.0
    last: float | None = None
    for step, target in zip(frames, targets, strict=True):
        if last is not None:
            dt = step.time - last
            length += dt
            person = _person(step.seen, subject)
            hidden = person is not None and person.box is not None and person.visible < IN_VIEW
            searched += 0.0 if hidden else dt
        if target == subject:
            if length > LOST_AFTER:
                gaps.append(searched)
            length = searched = 0.0
        if target == subject or last is not None:
            last = step.time
    if searched > FOUND_WITHIN:
        gaps.append(searched)
    return gaps


def _clearance(episode: Episode) -> float | None:
    """Return the smallest gap between the robot's rectangle and a person's cylinder [m]."""
    gaps = []
    for step in episode.steps:
        x, y, yaw = step.truth.robot
        for who, person in enumerate(step.truth.people):
            if person is None:
                continue
            dx, dy = person.x - x, person.y - y
            ahead = abs(dx * math.cos(yaw) + dy * math.sin(yaw)) - LIMO.half_length
            beside = abs(dy * math.cos(yaw) - dx * math.sin(yaw)) - LIMO.half_width
            gaps.append(math.hypot(max(ahead, 0), max(beside, 0)) - episode.scenario.people[who].radius)
    return min(gaps, default=None)


def _path(steps: Sequence[Step]) -> float:
    places = np.array([step.truth.robot[:2] for step in steps]).reshape(-1, 2)
    return float(np.hypot(*np.diff(places, axis=0).T).sum())


def _path_wrong(steps: Sequence[Step]) -> float:
    """Return the distance driven while the last target is nobody [m]."""
    total, wrong = 0.0, False
    for step, after in itertools.pairwise(steps):
        if step.target is not None:
            wrong = _hits(step)[step.target] < 0
        if wrong:
            total += math.dist(step.truth.robot[:2], after.truth.robot[:2])
    return total


def _mean(values: Sequence[float] | NDArray[Any]) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _rms(values: NDArray[np.float64]) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def _share(zones: Counter[Zone], zone: Zone) -> float | None:
    return zones[zone] / zones.total() if zones else None


def _shares(values: Sequence[str], always: Sequence[str]) -> dict[str, float]:
    """Return the share of each value, those in `always` first, then the most frequent first."""
    counts = Counter(values)
    names = [*always, *(name for name, _ in counts.most_common() if name not in always)]
    return {name: counts[name] / max(len(values), 1) for name in names}
