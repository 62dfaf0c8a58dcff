"""Measures a run step by step.

The card is about one person, the subject: the first person that the follower chose as its target, or the
scenario's first person where it never chose one. The indices of people are those of the scenario; `NO_PERSON`
stands for a box on none of them.
"""

from __future__ import annotations

import math
from array import array
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from limo_hog.follow.decision import Mode
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.measurement import Zone, zone_of
from limo_sim.run.log import Step
from limo_sim.run.matching import CRITERIA, NO_PERSON, Criteria, person_of
from limo_sim.run.provenance import code_version, scenario_hash
from limo_sim.run.score.card import ScoreCard
from limo_sim.run.score.subject import Mean, Subject
from limo_sim.world.furniture import Rectangle, distance_to
from limo_sim.world.robot import twist_of
from limo_sim.world.scenario import Scenario
from limo_sim.world.truth import Contacts, Truth


class Scorer:
    """Measures a run as it goes, and keeps no steps: its memory grows by 12 bytes a frame, for the percentiles.

    The scenario is that of the run: `Arena.scenario`, whose people are drawn.
    """

    def __init__(self, scenario: Scenario, criteria: Criteria = CRITERIA) -> None:
        self._scenario, self._criteria = scenario, criteria
        self._radii = [person.radius for person in scenario.people]
        robot, fastest = scenario.robot.geometry, scenario.robot.wheel_speed
        self._motion = _Motion(twist_of(-fastest, fastest, robot.wheel_separation).angular)
        # Everybody, until one of them is the target: then that one.
        self._subjects = [Subject(index, criteria) for index in range(max(len(scenario.people), 1))]
        self._steps = self._driven = self._frames = self._boxed = self._wrong = self._targets = self._switches = 0
        self._followed: int | None = None
        self._detect_ms, self._render_ms = array("f"), array("f")
        self._clearance = math.inf
        self._nearest: Counter[Zone] = Counter()
        self._modes: Counter[str] = Counter()
        self._reasons: Counter[str] = Counter()
        self._costs: Counter[str] = Counter()

    def add(self, step: Step) -> None:
        """Add the next step."""
        seen, boxes = step.seen, step.log.detections.windows
        hits = [] if seen is None else [person_of(box, seen.people, self._criteria) for box in boxes]
        target = None if step.log.decision.target is None else hits[step.log.decision.target]
        for subject in self._subjects:
            subject.add(step, hits, target)
        if seen is not None:
            self._frames += 1
            self._detect_ms.append(step.log.detect_ms)
            self._render_ms.append(step.render_ms)
            self._add_target(target)
        if hits:
            self._boxed += 1
            self._wrong += hits[0] == NO_PERSON
        self._steps += 1
        self._driven += bool(step.log.decision.twist.linear or step.log.decision.twist.angular)
        self._modes[step.log.decision.mode.value] += 1
        self._reasons[step.log.decision.reason] += 1
        self._costs.update(dict(step.log.decision.belief.shares))
        self._motion.add(step, target)
        self._clearance = min(self._clearance, _clearance(self._scenario.robot.geometry, step.truth, self._radii))
        distances = [person.distance for person in step.truth.people if person]
        if distances:
            self._nearest[zone_of(min(distances))] += 1

    def _add_target(self, target: int | None) -> None:
        self._targets += target is not None
        if target is None or target == NO_PERSON:
            return
        if self._followed is None:
            self._subjects = [self._subjects[target]]
        self._switches += self._followed not in (None, target)
        self._followed = target

    @property
    def driving(self) -> float:
        """Share of the steps whose command moves the robot."""
        return self._driven / max(self._steps, 1)

    def card(self, run: Episode) -> ScoreCard:
        """Return the card of the run whose steps were added."""
        subject, target, motion = self._subjects[0], run.target_distance, self._motion
        errors, gaps = np.array(subject.pixel_errors, float), subject.gaps
        detect_ms, render_ms = np.array(self._detect_ms, float), np.array(self._render_ms, float)
        least = subject.distances.least
        return ScoreCard(
            scenario=self._scenario.name,
            controller=run.controller,
            detector=run.detector,
            seed=run.seed,
            seconds=round(run.seconds, 6),
            scenario_hash=scenario_hash(self._scenario),
            code_version=code_version(),
            target_m=target,
            kept_m=None if target is None else subject.kept(target),
            success=self._success(run.contacts, subject),
            frames=self._frames,
            first_detection_s=subject.first_detection,
            in_view=_share(subject.in_view, subject.frames),
            kept_up=_share(subject.kept_up, subject.frames),
            detected=_share(subject.detected, subject.in_view),
            best_box_wrong=_share(self._wrong, self._boxed),
            longest_gap_s=subject.longest_gap,
            pixel_error_mean=_share(float(errors.sum()), len(errors)),
            pixel_error_p95=_percentile(errors, 95),
            distance_min_m=least if math.isfinite(least) else None,
            distance_mean_m=subject.distances.value,
            distance_rms_error_m=None if target is None else subject.distance_error(target),
            zone_intimate=_share(subject.zones[Zone.INTIMATE], subject.distances.count),
            zone_personal=_share(subject.zones[Zone.PERSONAL], subject.distances.count),
            zone_social=_share(subject.zones[Zone.SOCIAL], subject.distances.count),
            zone_public=_share(subject.zones[Zone.PUBLIC], subject.distances.count),
            clearance_min_m=self._clearance if math.isfinite(self._clearance) else None,
            intrusion_intimate=self._intrusion(Zone.INTIMATE),
            intrusion_personal=self._intrusion(Zone.PERSONAL),
            intrusion_social=self._intrusion(Zone.SOCIAL),
            contacts_person=run.contacts.person,
            contacts_wall=run.contacts.wall,
            lost=len(gaps),
            found_again=_share(sum(gap <= self._criteria.found_within_s for gap in gaps), len(gaps)),
            time_to_find_again_s=_share(sum(gaps), len(gaps)),
            follows_first=_share(subject.targeted, self._targets),
            identity_switches=self._switches,
            path_wrong_m=motion.path_wrong,
            mean_abs_domega=motion.turn_changes.value or 0.0,
            jerk_mean=motion.jerks.value,
            path_m=motion.path,
            modes=_shares(self._modes, [mode.value for mode in Mode if mode not in (Mode.DRIVE, Mode.STAND)]),
            reasons=_shares(self._reasons, []),
            critics={name: cost / self._steps for name, cost in self._costs.items()},
            detect_ms_p50=_percentile(detect_ms, 50),
            detect_ms_p95=_percentile(detect_ms, 95),
            detect_ms_mean=_share(float(detect_ms.sum()), len(detect_ms)),
            render_ms_p50=_percentile(render_ms, 50),
            real_time_factor=run.seconds / run.wall_seconds if run.wall_seconds > 0 else 0.0,
        )

    def _success(self, contacts: Contacts, subject: Subject) -> bool | None:
        if not self._nearest:
            return None
        if not subject.last_in_view or contacts.person > 0:
            return False
        return subject.longest_unseen <= self._criteria.unseen_s

    def _intrusion(self, zone: Zone) -> float | None:
        return self._nearest[zone] / self._steps if self._nearest else None


@dataclass(frozen=True, slots=True)
class Episode:
    """A run that has ended."""

    #: scenario, controller, detector, seed: what was run; the controller and the detector by name.
    scenario: Scenario
    controller: str
    detector: str
    seed: int
    seconds: float  #: simulated time [s]
    scorer: Scorer  #: has measured every control period
    contacts: Contacts
    wall_seconds: float  #: how long the run took [s]
    #: Distance that the controller held at the end, from the camera to the person's surface [m]; None where it holds
    #: none.
    target_distance: float | None = None


class _Motion:
    """How the robot drove."""

    def __init__(self, max_turn_rate: float) -> None:
        self._limit = max_turn_rate
        #: Distance travelled [m]; of it, that while the last target was no person.
        self.path = self.path_wrong = 0.0
        #: Sizes of the changes of the commanded turn rate, as far as the wheels can turn the robot [rad/s].
        self.turn_changes = Mean()
        self.jerks = Mean()  #: sizes of the change of acceleration along the robot's heading, by differences [m/s³]
        self._after_nobody = False
        self._rate: float | None = None
        # Time [s] and pose [m, m, rad].
        self._last: deque[tuple[float, float, float, float]] = deque(maxlen=4)

    def add(self, step: Step, target: int | None) -> None:
        """Add the next step, and the person its target is."""
        pose = step.truth.robot
        if self._last:
            way = math.dist(self._last[-1][1:3], pose[:2])
            self.path += way
            self.path_wrong += way if self._after_nobody else 0.0
        if target is not None:
            self._after_nobody = target == NO_PERSON
        asked = float(step.log.decision.twist.angular)
        rate = min(max(asked, -self._limit), self._limit) if math.isfinite(asked) else 0.0
        if self._rate is not None:
            self.turn_changes.add(abs(rate - self._rate))
        self._rate = rate
        self._last.append((step.log.time, *pose))
        if len(self._last) == 4:
            self.jerks.add(abs(_jerk(self._last)))


def _jerk(poses: Sequence[tuple[float, float, float, float]]) -> float:
    """Return the third derivative of the distance driven, forward positive, by four times and poses [m/s³]."""
    times, x, y, yaw = np.array(poses).T
    heading = (yaw[1:] + yaw[:-1]) / 2
    values = np.diff(x) * np.cos(heading) + np.diff(y) * np.sin(heading)
    # Speed, acceleration, jerk: each difference belongs to the middle between its two times.
    values = values / np.diff(times)
    for _ in range(2):
        times = (times[1:] + times[:-1]) / 2
        values = np.diff(values) / np.diff(times)
    return float(values[0])


def _clearance(robot: RobotGeometry, truth: Truth, radii: Sequence[float]) -> float:
    """Return the smallest gap between the robot's rectangle and a person's cylinder [m]; infinite without people."""
    x, y, yaw = truth.robot
    body, least = Rectangle(x, y, robot.half_length, robot.half_width, yaw), math.inf
    for person, radius in zip(truth.people, radii, strict=False):
        if person is not None:
            least = min(least, distance_to(body, person.x, person.y) - radius)
    return least


def _share(part: float, whole: int) -> float | None:
    return part / whole if whole else None


def _percentile(values: np.ndarray[tuple[int], np.dtype[np.float64]], share: float) -> float | None:
    return float(np.percentile(values, share)) if len(values) else None


def _shares(counts: Counter[str], always: Sequence[str]) -> dict[str, float]:
    """Return the share of each value, those in `always` first, then the most frequent first."""
    names = [*always, *(name for name, _ in counts.most_common() if name not in always)]
    return {name: counts[name] / max(counts.total(), 1) for name in names}
