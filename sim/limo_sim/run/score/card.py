"""The score card: the figures of one run."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class ScoreCard:
    """The figures of one run.

    Fractions are 0..1 of the frames after the subject was first in view; None where there is nothing to measure. Times,
    shares and sizes that decide what counts are those of `Criteria`.
    """

    scenario: str
    controller: str
    detector: str
    seed: int
    seconds: float
    #: scenario_hash, code_version: what was run, as `limo_sim.run.provenance` tells it: cards with both equal are of
    #: the same arena and code.
    scenario_hash: str
    code_version: str
    target_m: float | None  #: distance that the controller holds [m]; None for one that holds none, such as `approach`
    #: Mean of the distance it held at each time [m]: more than `target_m` where nearer the camera would not show the
    #: whole person.
    kept_m: float | None
    #: Whether the run ended with the subject in view, without contact with a person, and the subject was never out of
    #: view for more than 10 s after being first in view; None where no person ever was in the arena. A node that
    #: failed, or never moved the robot, has no success.
    success: bool | None
    frames: int  #: camera frames worked on
    first_detection_s: float | None  #: when the subject was first detected [s]
    in_view: float | None  #: share of frames with at least half of the subject in view
    kept_up: float | None  #: share of frames that are `in_view`, and the robot's centre at most 3 m from the subject
    detected: float | None  #: of the frames that are `in_view`, share in which the subject was detected
    best_box_wrong: float | None  #: share of frames with boxes whose best box is on no person
    longest_gap_s: float | None  #: longest time between two frames in which the subject was detected [s]
    #: pixel_error_mean, pixel_error_p95: horizontal distance of the subject from the middle of the image, where in view
    #: [px].
    pixel_error_mean: float | None
    pixel_error_p95: float | None
    #: distance_min_m, distance_mean_m: from the robot's centre to the subject's axis [m].
    distance_min_m: float | None
    distance_mean_m: float | None
    #: Of the distance that controllers hold, from the camera to the subject's surface, to the one they held at the
    #: time (`kept_m`) [m]; None without a target distance.
    distance_rms_error_m: float | None
    #: zone_…: share of time in each of Hall's zones, by the distance from the robot's centre to the subject's axis.
    zone_intimate: float | None
    zone_personal: float | None
    zone_social: float | None
    zone_public: float | None
    clearance_min_m: float | None  #: smallest gap between the robot's outline and the cylinder around any person [m]
    #: intrusion_…: share of the whole run in which the nearest of all people is in this zone of Hall's, by the distance
    #: from the robot's centre to the person's axis; None where no person ever was in the arena.
    intrusion_intimate: float | None
    intrusion_personal: float | None
    intrusion_social: float | None
    contacts_person: int  #: how often the robot touched a person
    contacts_wall: int  #: how often it touched a wall or furniture
    lost: int  #: how often the subject was not the target for more than 0.5 s
    #: Share of these in which the subject was the target again within 3 s, not counting the time hidden behind
    #: something.
    found_again: float | None
    #: Mean time from such a loss until the subject is the target again, counted alike; a search that the run's end cut
    #: off counts as far as it got, if it took longer than 3 s [s].
    time_to_find_again_s: float | None
    follows_first: float | None  #: share of frames with a target in which the target is the subject
    identity_switches: int | None  #: how often the target changed from one person to another
    path_wrong_m: float  #: distance driven while the target is no person [m]
    #: Mean change of the commanded turn rate from one command to the next [rad/s]; a command beyond the wheels' limits
    #: counts as the limit, and one that is no number as 0.
    mean_abs_domega: float
    jerk_mean: float | None  #: mean size of the third derivative of the distance driven, forward positive [m/s³]
    path_m: float  #: distance the robot's centre travelled [m]
    modes: dict[str, float]  #: share of control periods in each mode
    reasons: dict[str, float]  #: share of control periods for each reason
    critics: dict[str, float]  #: mean cost that each critic of the planner adds to the command sent; empty without one
    #: detect_ms_…, render_ms_p50, real_time_factor: wall time, the only figures that differ between two runs of one
    #: seed.
    detect_ms_p50: float | None
    detect_ms_p95: float | None
    detect_ms_mean: float | None
    render_ms_p50: float | None
    real_time_factor: float
    failure: str | None = None  #: how the node failed, in a line; None where it did not

    def to_json(self) -> dict[str, Any]:
        """Return the figures as JSON's types; all numbers are finite."""
        return dataclasses.asdict(self)
