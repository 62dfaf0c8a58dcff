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
        view for more than 10 s after being first in view; None where no person ever was in the arena. A node that
        failed, or never moved the robot, has no success.
    frames
        Camera frames worked on.
    first_detection_s
        When the subject was first detected [s].
    in_view, detected
        Share of frames with at least half of the subject in view; of those, share in which the subject was detected.
    kept_up
        Share of frames with at least half of the subject in view, and the robot's centre at most 3 m from the subject.
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
    failure
        How the node failed, in a line; None where it did not.
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
    kept_up: float | None
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
    failure: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the figures as JSON's types; all numbers are finite."""
        return dataclasses.asdict(self)
