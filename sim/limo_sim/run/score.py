"""How well a robot followed: pure functions of an episode's log.

The card is about one person, the subject: the first person that the follower chose as its target, or the
scenario's first person where it never chose one. The indices of people are those of the scenario; `NO_PERSON`
stands for a box on none of them.
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
from limo_hog.follow.zones import Zone, zone_of
from limo_sim.run.episode import Episode, Step
from limo_sim.run.matching import CRITERIA, NO_PERSON, Criteria, person_of
from limo_sim.run.provenance import code_version, scenario_hash
from limo_sim.sensing.camera import WIDTH
from limo_sim.world.robot import max_turn_rate
from limo_sim.world.truth import PersonTruth, Truth


@dataclass(frozen=True, slots=True)
class ScoreCard:
    """The figures of one run.

    Fractions are 0..1 of the frames after the subject was first in view; None where there is nothing to measure. Times,
    shares and sizes that decide what counts are those of `Criteria`.

    Attributes
    ----------
    scenario_hash, code_version
        What was run, as `limo_sim.run.provenance` tells it: cards with both equal are of the same arena and code.
    target_m
        Distance that the controller holds [m]; None for one that holds none, such as `approach`.
    kept_m
        Mean of the distance it held at each time [m]: more than `target_m` where nearer the camera would not show the
        whole person.
    success
        Whether the run ended with the subject in view, without contact with a person, and the subject was never out of
        view for more than 10 s after being first in view; None where no person ever was in the arena.
    frames
        Camera frames worked on.
    first_detection_s
        When the subject was first detected [s].
    in_view, detected
        Share of frames with at least half of the subject in view; of those, share in which the subject was detected.
    best_box_wrong
        Share of frames with boxes whose best box is on no person.
    longest_gap_s
        Longest time between two frames in which the subject was detected [s].
    pixel_error_mean, pixel_error_p95
        Horizontal distance of the subject from the middle of the image, where in view [px].
    distance_min_m, distance_mean_m
        From the robot's centre to the subject's axis [m].
    distance_rms_error_m
        Of the distance that controllers hold, from the camera to the subject's surface, to the one they held at the
        time (`kept_m`) [m]; None without a target distance.
    zone_intimate, zone_personal, zone_social, zone_public
        Share of time in each of Hall's zones, by the distance from the robot's centre to the subject's axis.
    clearance_min_m
        Smallest gap between the robot's outline and the cylinder around any person [m].
    intrusion_intimate, intrusion_personal, intrusion_social
        Share of the whole run in which the nearest of all people is in this zone of Hall's, by the distance from the
        robot's centre to the person's axis; None where no person ever was in the arena.
    contacts_person, contacts_wall
        How often the robot touched a person; a wall or furniture.
    lost, found_again
        How often the subject was not the target for more than 0.5 s; share of these in which the subject was the target
        again within 3 s, not counting the time hidden behind something.
    time_to_find_again_s
        Mean time from such a loss until the subject is the target again, counted alike; a search that the run's end cut
        off counts as far as it got, if it took longer than 3 s [s].
    follows_first
        Share of frames with a target in which the target is the subject.
    identity_switches
        How often the target changed from one person to another.
    path_wrong_m
        Distance driven while the target is no person [m].
    mean_abs_domega
        Mean change of the commanded turn rate from one command to the next [rad/s]; a command beyond the wheels' limits
        counts as the limit, and one that is no number as 0.
    jerk_mean
        Mean size of the third derivative of the distance driven, forward positive [m/s³].
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
    scenario_hash: str
    code_version: str
    target_m: float | None
    kept_m: float | None
    success: bool | None
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
    intrusion_intimate: float | None
    intrusion_personal: float | None
    intrusion_social: float | None
    contacts_person: int
    contacts_wall: int
    lost: int
    found_again: float | None
    time_to_find_again_s: float | None
    follows_first: float | None
    identity_switches: int | None
    path_wrong_m: float
    mean_abs_domega: float
    jerk_mean: float | None
    path_m: float
    modes: dict[str, float]
    reasons: dict[str, float]
    detect_ms_p50: float | None
    detect_ms_p95: float | None
    detect_ms_mean: float | None
    render_ms_p50: float | None
    real_time_factor: float

    def to_json(self) -> dict[str, Any]:
        """Return the figures as JSON's types; all numbers are finite."""
        return dataclasses.asdict(self)


def score(episode: Episode, criteria: Criteria = CRITERIA) -> ScoreCard:
    """Measure an episode."""
    steps = episode.steps
    frames = [step for step in steps if step.seen is not None]
    hits = [_hits(step, criteria) for step in frames]
    targets = [_target(step, hit) for step, hit in zip(frames, hits, strict=True)]
    chosen = [person for person in targets if person is not None and person != NO_PERSON]
    subject = chosen[0] if chosen else 0
    found = [subject in hit for hit in hits]
    views = [_person(step.seen, subject) for step in frames]
    visible = np.array([view is not None and view.visible >= criteria.in_view for view in views], bool)
    first = int(np.argmax(visible)) if visible.any() else len(frames)
    counted = [step for step in steps if first < len(frames) and step.time >= frames[first].time]
    people = [person for step in counted if (person := _person(step.truth, subject))]
    distances = [person.distance for person in people]
    target = episode.target_distance
    kept = np.array(_kept([step for step in counted if _person(step.truth, subject)], target))
    held = np.array([person.surface_distance for person in people])
    after = slice(first, None)
    boxed = [hit for step, hit in zip(frames, hits, strict=True) if len(step.detections)]
    errors = [_pixel_error(view) for view, ok in zip(views[after], visible[after], strict=True) if ok and view]
    gaps = _gaps(frames, targets, subject, criteria)
    detect_ms = [step.frame.detect_ms for step in frames if step.frame]
    render_ms = [step.frame.render_ms for step in frames if step.frame]
    stamps = [step.seen.stamp for step, ok in zip(frames, found, strict=True) if ok and step.seen]
    known = [person for person in targets if person is not None]
    zones = Counter(zone_of(distance) for distance in distances)
    nearest = Counter(zone_of(distance) for step in steps if (distance := _nearest(step)) is not None)
    return ScoreCard(
        scenario=episode.scenario.name,
        controller=episode.controller,
        detector=episode.detector,
        seed=episode.seed,
        seconds=round(episode.seconds, 6),
        scenario_hash=scenario_hash(episode.scenario),
        code_version=code_version(),
        target_m=target,
        kept_m=_mean(kept),
        success=_success(episode, [step.time for step in frames[first:]], visible[after], criteria),
        frames=len(frames),
        first_detection_s=stamps[0] if stamps else None,
        in_view=_mean(visible[after]),
        detected=_mean(np.array(found, bool)[after][visible[after]]),
        best_box_wrong=_mean([hit[0] == NO_PERSON for hit in boxed]),
        longest_gap_s=max(np.diff(stamps).tolist(), default=None),
        pixel_error_mean=_mean(errors),
        pixel_error_p95=float(np.percentile(errors, 95)) if errors else None,
        distance_min_m=min(distances, default=None),
        distance_mean_m=_mean(distances),
        distance_rms_error_m=None if target is None else _rms(held - kept),
        zone_intimate=_share(zones, Zone.INTIMATE, zones.total()),
        zone_personal=_share(zones, Zone.PERSONAL, zones.total()),
        zone_social=_share(zones, Zone.SOCIAL, zones.total()),
        zone_public=_share(zones, Zone.PUBLIC, zones.total()),
        clearance_min_m=_clearance(episode),
        intrusion_intimate=_share(nearest, Zone.INTIMATE, len(steps)),
        intrusion_personal=_share(nearest, Zone.PERSONAL, len(steps)),
        intrusion_social=_share(nearest, Zone.SOCIAL, len(steps)),
        contacts_person=episode.contacts.person,
        contacts_wall=episode.contacts.wall,
        lost=len(gaps),
        found_again=_mean([gap <= criteria.found_within_s for gap in gaps]),
        time_to_find_again_s=_mean(gaps),
        follows_first=_mean([person == subject for person in known]),
        identity_switches=sum(one != other for one, other in itertools.pairwise(chosen)),
        path_wrong_m=_path_wrong(steps, criteria),
        mean_abs_domega=_mean(np.abs(np.diff(_turn_rates(episode)))) or 0.0,
        jerk_mean=_jerk_mean(steps),
        path_m=_path(steps),
        modes=_shares(
            [step.decision.mode.value for step in steps],
            [mode.value for mode in Mode if mode not in (Mode.DRIVE, Mode.STAND)],
        ),
        reasons=_shares([step.decision.reason for step in steps], []),
        detect_ms_p50=float(np.percentile(detect_ms, 50)) if detect_ms else None,
        detect_ms_p95=float(np.percentile(detect_ms, 95)) if detect_ms else None,
        detect_ms_mean=_mean(detect_ms),
        render_ms_p50=float(np.percentile(render_ms, 50)) if render_ms else None,
        real_time_factor=episode.seconds / episode.wall_seconds if episode.wall_seconds > 0 else 0.0,
    )


def _hits(step: Step, criteria: Criteria) -> list[int]:
    """Return the person that each box is on, in the boxes' order."""
    return [person_of(box, _people(step.seen), criteria) for box in step.detections.boxes]


def _target(step: Step, hits: Sequence[int]) -> int | None:
    """Return the person that the target is; None without a target."""
    return None if step.decision.target is None else hits[step.decision.target]


def _people(truth: Truth | None) -> tuple[PersonTruth | None, ...]:
    return () if truth is None else truth.people


def _person(truth: Truth | None, index: int) -> PersonTruth | None:
    people = _people(truth)
    return people[index] if index < len(people) else None


def _pixel_error(person: PersonTruth) -> float:
    """Return how far the middle of the person's box is from the image's [px]."""
    return 0.0 if person.box is None else abs(person.box[0] + person.box[2] / 2 - WIDTH / 2)


def _success(episode: Episode, times: Sequence[float], visible: NDArray[np.bool_], criteria: Criteria) -> bool | None:
    """Judge a run by whether the subject was in view [s, bool], frame by frame from the first time on."""
    if not any(person for step in episode.steps for person in step.truth.people):
        return None
    if not visible.any() or not visible[-1] or episode.contacts.person > 0:
        return False
    in_view = [time for time, seen in zip(times, visible, strict=True) if seen]
    return bool(max(np.diff(in_view), default=0.0) <= criteria.unseen_s)


def _gaps(frames: Sequence[Step], targets: Sequence[int | None], subject: int, criteria: Criteria) -> list[float]:
    """Return how long the search after each loss of the subject took [s], without the time the subject was hidden."""
    gaps = []
    length = searched = 0.0
    last: float | None = None
    for step, target in zip(frames, targets, strict=True):
        if last is not None:
            dt = step.time - last
            length += dt
            person = _person(step.seen, subject)
            hidden = person is not None and person.box is not None and person.visible < criteria.in_view
            searched += 0.0 if hidden else dt
        if target == subject:
            if length > criteria.lost_after_s:
                gaps.append(searched)
            length = searched = 0.0
        if target == subject or last is not None:
            last = step.time
    if searched > criteria.found_within_s:
        gaps.append(searched)
    return gaps


def _clearance(episode: Episode) -> float | None:
    """Return the smallest gap between the robot's rectangle and a person's cylinder [m]."""
    gaps = []
    for step in episode.steps:
        x, y, yaw = step.truth.robot
        for person, settings in zip(step.truth.people, episode.scenario.people, strict=False):
            if person is None:
                continue
            dx, dy = person.x - x, person.y - y
            ahead = abs(dx * math.cos(yaw) + dy * math.sin(yaw)) - LIMO.half_length
            beside = abs(dy * math.cos(yaw) - dx * math.sin(yaw)) - LIMO.half_width
            gaps.append(math.hypot(max(ahead, 0), max(beside, 0)) - settings.radius)
    return min(gaps, default=None)


def _kept(steps: Sequence[Step], target: float | None) -> list[float]:
    """Return the distance that the controller held at each step [m]; nothing for one that holds none."""
    if target is None:
        return []
    kept, last = [], target
    for step in steps:
        last = step.decision.belief.keeps or last
        kept.append(last)
    return kept


def _path(steps: Sequence[Step]) -> float:
    places = np.array([step.truth.robot[:2] for step in steps]).reshape(-1, 2)
    return float(np.hypot(*np.diff(places, axis=0).T).sum())


def _path_wrong(steps: Sequence[Step], criteria: Criteria) -> float:
    """Return the distance driven while the last target is no person [m]."""
    total, wrong = 0.0, False
    for step, after in itertools.pairwise(steps):
        if step.decision.target is not None:
            wrong = _hits(step, criteria)[step.decision.target] == NO_PERSON
        if wrong:
            total += math.dist(step.truth.robot[:2], after.truth.robot[:2])
    return total


def _turn_rates(episode: Episode) -> NDArray[np.float64]:
    """Return the commanded turn rates [rad/s], as far as the wheels can turn the robot."""
    rates = np.array([step.decision.twist.angular for step in episode.steps], np.float64)
    limit = max_turn_rate(episode.scenario.robot.wheel_speed)
    return np.clip(np.where(np.isfinite(rates), rates, 0.0), -limit, limit)


def _jerk_mean(steps: Sequence[Step]) -> float | None:
    """Return the mean size of the change of acceleration along the robot's heading [m/s³], by differences."""
    poses = np.array([step.truth.robot for step in steps]).reshape(-1, 3)
    times = np.array([step.time for step in steps])
    across, along = np.diff(poses[:, :2], axis=0).T[::-1] if len(poses) else np.empty((2, 0))
    heading = (poses[1:, 2] + poses[:-1, 2]) / 2
    values = along * np.cos(heading) + across * np.sin(heading)
    # Speed, acceleration, jerk: each difference belongs to the middle between its two times.
    values = values / np.diff(times)
    for _ in range(2):
        times = (times[1:] + times[:-1]) / 2
        values = np.diff(values) / np.diff(times)
    return _mean(np.abs(values))


def _mean(values: Sequence[float] | NDArray[Any]) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _rms(values: NDArray[np.float64]) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def _nearest(step: Step) -> float | None:
    """Return the distance from the robot's centre to the axis of the nearest person [m]."""
    return min((person.distance for person in step.truth.people if person), default=None)


def _share(zones: Counter[Zone], zone: Zone, total: int) -> float | None:
    return zones[zone] / total if zones else None


def _shares(values: Sequence[str], always: Sequence[str]) -> dict[str, float]:
    """Return the share of each value, those in `always` first, then the most frequent first."""
    counts = Counter(values)
    names = [*always, *(name for name, _ in counts.most_common() if name not in always)]
    return {name: counts[name] / max(len(values), 1) for name in names}
