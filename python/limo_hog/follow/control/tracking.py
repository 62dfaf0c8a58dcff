"""The third controller: track people, follow one, search the part of the image where they are expected."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.control.backing import Backing, Poses
from limo_hog.follow.control.company import Company, Way, walker_of
from limo_hog.follow.control.lookout import Lookout, Search
from limo_hog.follow.control.selection import Choice, Selection, TrackingState, believed
from limo_hog.follow.control.steer import Aim, Detour, Steering, Wheels, stoppable_turn
from limo_hog.follow.decision import Belief, Decision, Mode
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import LIMO, RobotGeometry, Twist
from limo_hog.follow.sense.clearance import NO_POINTS, DepthGrid, Points, scan_points, to_odometry
from limo_hog.follow.sense.detectors import Region, RegionSize
from limo_hog.follow.sense.observation import Observation, Odometry, Scan, pose_at
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.space.routes import point_ahead
from limo_hog.follow.tracks.asking import Whom, named
from limo_hog.follow.tracks.kalman import Track, bearing_range, predict, rates
from limo_hog.follow.tracks.person import Person
from limo_hog.follow.tracks.tracker import Tracker


@dataclass(frozen=True, slots=True)
class TrackingController:
    """Kalman tracks in bearing and range, feed-forward, region search, coasting and a search turn.

    Attributes
    ----------
    steering
        From the followed person's position to a command.
    search
        What to do without one.
    selection
        Which person to follow.
    detour
        How to drive around obstacles.
    region
        How much of the image to search.
    tracker
        Where all people are.
    company, backing
        How to give way to people, and when to back.
    wheels
        What the wheels can do.
    lookout, grid, depth_grid
        How to look for a lost person, how the ground is mapped, and which depth pixels are looked at for it.
    robot
        Where camera and lidar sit.
    person
        Whom to follow first; None for who is ahead and near.
    """

    target_distance: float = param(1.5, "m", "Distance to hold, as the depth image measures it.", 0.1, 8)
    # Chosen: another person is noticed within 1.5 s.
    whole_image_every: int = param(
        15,
        "frames",
        "Once in this many frames the whole image is searched, else a region.",
        1,
        1000,
    )
    # Computed, at 1 m/s² of the wheels: .2 s to notice a start, .7 s to turn aside, .8 s to drive .3 m; .2 s more,
    # measured: of ten people at 1.5 m/s the nearest comes to .47 m, not .44. At a walk that is less than 1.6 m.
    headway_s: float = param(1.9, "s", "The robot keeps off a fast walker by the way they walk in this time.", 0, 5)
    speed_rise: float = param(
        0.15,
        "share",
        "Share by which a faster frame raises a person's top speed; a slower one lowers it by a hundredth.",
        0,
        1,
    )
    # The workshop's camera period. In a longer one a person who turns and the robot come nearer to each other unseen.
    usual_delay_s: float = param(
        0.1, "s", "Delay of an image, its period included, up to which no distance is added.", 0, 5
    )
    # Chosen: the edge of Hall's personal zone; the time in which the robot comes up by that much.
    hiding_distance: float = param(1.2, "m", "Distance to hold to a person who will soon be out of sight.", 0.5, 8)
    hiding_foresight_s: float = param(
        1.0, "s", "How far ahead it is foreseen that a person will be out of sight.", 0, 5
    )
    steering: Steering = field(default_factory=Steering)
    search: Search = field(default_factory=Search)
    selection: Selection = field(default_factory=Selection)
    detour: Detour = field(default_factory=Detour)
    region: RegionSize = field(default_factory=RegionSize)
    tracker: Tracker = field(default_factory=Tracker)
    company: Company = field(default_factory=Company)
    backing: Backing = field(default_factory=Backing)
    wheels: Wheels = field(default_factory=Wheels)
    lookout: Lookout = field(default_factory=Lookout)
    grid: Grid = field(default_factory=Grid)
    depth_grid: DepthGrid = field(default_factory=lambda: DepthGrid(step=16))
    robot: RobotGeometry = LIMO
    person: Whom | None = None

    def __post_init__(self) -> None:
        tracker = self.tracker
        if tracker.robot != self.robot:
            tracker = replace(tracker, robot=self.robot, movers=replace(tracker.movers, robot=self.robot))
            object.__setattr__(self, "tracker", tracker)

    def start(self) -> TrackingState:
        """Return the state before the first observation: no people."""
        return TrackingState(choice=Choice(asked=self.person), acceleration=self.wheels.acceleration)

    def ask(self, whom: Whom, state: TrackingState) -> TrackingState:
        """Return the state in which a person is asked for: they are followed once they are in view."""
        return replace(state, choice=replace(state.choice, asked=whom))

    def step(self, observation: Observation, state: TrackingState) -> Decision[TrackingState]:
        """Follow a person, give way to all, and ask of the wheels what they can do."""
        wheels, before = observation.odometry, state.tracks.poses[-1:]
        if wheels is not None:
            acceleration = state.acceleration
            for last in before:
                acceleration = self.wheels.learn(acceleration, state.sent, last, wheels, self.robot)
            state = replace(state, acceleration=acceleration)
        points = NO_POINTS if observation.scan is None else scan_points(observation.scan, self.robot)
        decision, person = self._follow(observation, points, state)
        people = believed(decision.state, observation.now, self.tracker.noise)
        decision = replace(decision, belief=replace(decision.belief, people=people))
        if (asked := decision.state.choice.asked) is not None:
            decision = replace(decision, reason=f"{decision.reason}; asked for {named(asked)}, not found yet")
        return self._give_way(decision, person, observation, points)

    def _follow(
        self, observation: Observation, points: Points, state: TrackingState
    ) -> tuple[Decision[TrackingState], Person | None]:
        """Bring the tracks up to the frame, choose the person to follow, and steer to where they are now.

        `points` are the scan's returns, base frame. Returns the decision, and the person followed as of the newest
        stamp.
        """
        tracks, boxes = self.tracker.update(observation, state.tracks)
        before, choice = state.choice.measured, self.selection.choose(tracks, state.choice)
        another = before is not None and (choice.measured or 0.0) - before > self.selection.reidentify_s
        state = self._map(replace(state, tracks=tracks, choice=choice), observation)
        if choice.candidates:
            return self._look_at(state, observation), None
        person = tracks.person(choice.number)
        if person is None:
            return self._search(state, observation), None
        unseen_s = observation.stamp - person.seen
        person, tracks = self.tracker.follow_legs(person, state.tracks, self.grid, state.ground)
        state = replace(state, tracks=tracks)
        keeps = self._keeps(person, state, observation)
        aim, state = self._aim(person, keeps, points, state, observation)
        lost_s = min(unseen_s, observation.now - person.felt)
        if lost_s <= self.tracker.scan_period_s:
            # Only a measured bearing tells the side: a predicted one changes sign as the robot turns past it.
            known = person.track if person.confirmed and self._is_sure(person, choice) else state.known
            speed = math.hypot(*person.track.mean[2:])
            share = self.speed_rise if speed > state.brisk else self.speed_rise / 100
            brisk = state.brisk + share * (speed - state.brisk)
            state = replace(state, side=self.steering.side_of(aim), known=known, hunt=None, brisk=brisk)
        can_look = state.ground is not None and state.known is not None and person.confirmed
        if can_look and aim.hidden and state.ground is not None and state.hunt is None:
            # Behind another person one is hidden for a moment; waiting is better than driving round people.
            pose = pose_at(state.tracks.poses, observation.now)
            can_look = self._hides(state.ground, pose, person.track.place)
        patience = self.lookout.after_s if can_look else self.tracker.forget_s if aim.hidden else self.search.after_s
        if observation.now - state.gave_way_at < self.tracker.movers.unseen_s:
            # It turned away from a person who walks on where nothing looks; it turns to them before it looks round.
            patience = max(patience, self.tracker.movers.unseen_s)
        if lost_s > patience:
            return self._search(state, observation), person
        twist, mode, reason = self.steering.command(
            aim,
            keeps,
            self.robot,
            confirmed=person.confirmed,
            worth_nearing=self._is_worth_nearing(person, aim),
            in_view=unseen_s == 0,
            lost_s=lost_s,
        )
        if another:
            reason = "following another person: the lost one was not found"
        elif keeps > self.target_distance + self.steering.distance_tolerance and mode in (Mode.HOLD, Mode.FOLLOW):
            reason += ", further off than asked: nearer the camera would not show all of them"
        off = aim.bearing if aim.heading is None else max(aim.bearing, aim.heading, key=abs)
        most = float(stoppable_turn(off, state.acceleration, self.robot)) + abs(aim.bearing_rate)
        twist = Twist(twist.linear, min(max(twist.angular, -most), most))
        wanted = aim.distance - self.robot.camera_x - keeps
        if twist.linear < 0:
            facing, others = np.array([0.0, 0.0, aim.bearing]), state.others
            pose, ground = pose_at(state.tracks.poses, observation.now), state.ground
            seen_free = self.backing.is_free_behind(facing, pose, self.grid, ground, others, self.robot)
            if not seen_free and self.backing.is_blocked(pose, self.grid, ground, self.robot):
                twist = Twist(0.0, twist.angular)
            elif not seen_free:
                limit = self.backing.blind_limit(others, pose, self.robot, observation.now)
                twist, reason = self.backing.blindly(twist, limit, aim, wanted, self.company.min_speed, reason)
        region = self._region(person, state, observation) if unseen_s == 0 else None
        state = replace(
            state,
            since_full=0 if region is None else state.since_full + 1,
            detour=0.0 if aim.heading is None or wanted < 0 else aim.heading - aim.bearing,
        )
        belief = Belief(keeps, followed=person.number)
        return Decision(twist, state, mode, reason, boxes.get(person.number), region, belief), person

    def _give_way(
        self, decision: Decision[TrackingState], person: Person | None, observation: Observation, points: Points
    ) -> Decision[TrackingState]:
        """Replace a command by a way out of the way of people, where there is need, and by what the wheels can do."""
        state, twist, mode, reason = decision.state, decision.twist, decision.mode, decision.reason
        now, wheels, acceleration = observation.now, observation.odometry, state.acceleration
        if wheels is None:
            return decision
        driven, pose = Twist(wheels.linear, wheels.angular), pose_at(state.tracks.poses, now)
        begun = None
        if state.way_out is not None:
            yaw, speed, since = state.way_out
            begun = Way(math.remainder(yaw - pose.yaw, math.tau), speed, now - since)

        tracks, seen, own = self.tracker.around(state.tracks, person, now, self.steering.coast_s)
        felt = self.tracker.movers.felt(state.tracks.movers, now)
        age_s = math.inf if person is None else now - person.measured
        followed = NO_POINTS if person is None or age_s >= self.backing.unseen_s else np.array([person.track.place])
        others = self.backing.remember(state.others, seen, felt, followed, now)

        def may_back(poses: Poses) -> NDArray[np.bool_]:
            return self.backing.is_free_behind(poses, pose, self.grid, state.ground, others, self.robot)

        walkers = [
            walker_of(track, pose, followed=True, measured=age_s <= self.tracker.scan_period_s).at_least(
                state.brisk, self.company.min_speed
            )
            if track is own
            else walker_of(track, pose)
            for track in tracks
        ]
        blind_speed = self.backing.blind_limit(others, pose, self.robot, now)
        way = self.company.way_out(
            twist, driven, walkers, points, self.robot, begun, acceleration, may_back, blind_speed
        )
        if way is not None:
            twist, reason = self.company.command(way, acceleration, self.robot), "giving way to a person"
            mode = mode if mode in (Mode.LOST, Mode.SEARCH) else Mode.FOLLOW
        twist = self.wheels.within_reach(twist, driven, acceleration, state.tracks.period, self.robot)
        way_out = None if way is None else (pose.yaw + way.turn, way.speed, now - way.age)
        gave_way_at = state.gave_way_at if way is None else now
        state = replace(state, way_out=way_out, gave_way_at=gave_way_at, sent=twist, others=others)
        return replace(decision, state=state, twist=twist, mode=mode, reason=reason)

    def _map(self, state: TrackingState, observation: Observation) -> TrackingState:
        """Enter a new scan into what moves, and with the depth image into the map of the ground."""
        scan, tracks = observation.scan, state.tracks
        if scan is None or observation.odometry is None:
            return state
        half_view = min(self.robot.lidar_yaw - scan.angle_min, scan.angle_max - self.robot.lidar_yaw)
        tracks = self.tracker.follow_movers(tracks, half_view, self.lookout.half_view, self.grid, state.ground)
        if state.ground is not None and scan.stamp < state.ground.stamp + self.grid.period_s:
            return replace(state, tracks=tracks)
        pose = pose_at(tracks.poses, scan.stamp)
        lately = observation.now - self.steering.coast_s
        known = [one.track.place for one in tracks.people if one.confirmed and one.measured > lately]
        people = np.array(known).reshape(-1, 2)
        depth_points = NO_POINTS
        if observation.depth is not None:
            near = self.depth_grid.points(observation.depth, observation.focal_px, self.lookout.view, self.robot)
            depth_points = to_odometry(near, pose_at(tracks.poses, observation.stamp))
        ground = self.grid.update(state.ground, scan, pose, people, depth_points, self.robot)
        return replace(state, tracks=tracks, ground=ground)

    def _search(self, state: TrackingState, observation: Observation) -> Decision[TrackingState]:
        tracks, choice = state.tracks, state.choice
        other = any(self.selection.is_stranger(one, choice) for one in tracks.in_view)
        lost = choice.measured is not None
        known, ground, scan = state.known, state.ground, observation.scan
        if (off := self._off_unknown(state, observation)) is not None:
            twist, mode = Twist(0.0, self.lookout.turn(off)), Mode.LOST if lost else Mode.SEARCH
            reason = "turning to what moves in the scan"
            return Decision(twist, state, mode, reason)
        if (
            lost
            and known is not None
            and ground is not None
            and scan is not None
            and observation.now - known.stamp < self.lookout.give_up_s
        ):
            decision = self._look_round(state, known, ground, scan, observation)
            return replace(decision, reason=f"{decision.reason}: another is in view") if other else decision
        twist, mode, reason = self.search.command(state.side, lost=lost, other_in_view=other)
        return Decision(twist, state, mode, reason)

    def _off_unknown(self, state: TrackingState, observation: Observation) -> float | None:
        """Return the bearing [rad] of what moves in the scan and may be the person; None where there is none.

        A lost person cannot be further off than they walk.
        """
        now, known = observation.now, state.known
        pose = pose_at(state.tracks.poses, now)
        tracks = self.tracker.may_be(state.choice.number, state.tracks, now)
        if known is not None:
            reach = self.tracker.association.same_place + self.lookout.wandering.walk * (now - known.stamp)
            tracks = [one for one in tracks if math.dist(one.place, known.place) < reach]
        return min((bearing_range(one, pose)[0] for one in tracks), key=abs, default=None)

    def _look_at(self, state: TrackingState, observation: Observation) -> Decision[TrackingState]:
        """Stand and keep those in view of whom one is the person followed, until it shows which."""
        likeness, tracks = state.choice.likeness, state.tracks
        people = [one for one in tracks.people if one.number in state.choice.candidates]
        pose = pose_at(tracks.poses, observation.now)
        chances = [likeness.of(one.number) if likeness else 1.0 for one in people]
        offs = [bearing_range(predict(one.track, observation.now, self.tracker.noise), pose)[0] for one in people]
        off = sum(chance * off for chance, off in zip(chances, offs, strict=True)) / max(sum(chances), 1e-6)
        limit = self.steering.max_angular
        twist = Twist(0.0, min(max(self.steering.angular_gain * off, -limit), limit))
        reason = f"not sure which of {len(people)} is the person followed"
        if len(people) == 1:
            reason = "not sure whether this is the person followed"
        return Decision(twist, replace(state, since_full=0), Mode.HOLD, reason)

    def _is_sure(self, person: Person, choice: Choice) -> bool:
        """Whether a track is the person followed, and not only the likeliest of those in view."""
        return choice.likeness is None or choice.likeness.of(person.number) >= self.selection.identity.sure

    def _look_round(
        self, state: TrackingState, known: Track, ground: Ground, scan: Scan, observation: Observation
    ) -> Decision[TrackingState]:
        now = observation.now
        pose = pose_at(state.tracks.poses, now)
        hunt = state.hunt or self.lookout.begin(known, state.choice.number or 0, self.grid, ground)
        hunt = self.lookout.step(hunt, scan, now, pose, self.grid, ground, self.robot)
        points, turn = scan_points(scan, self.robot), Twist(0.0, state.side * self.search.rate)
        twist, reason = self.lookout.command(hunt, pose, points, self.detour, self.robot, turn)
        places, way = self.lookout.ways(hunt, pose)
        belief = Belief(places=places, way=way)
        return Decision(twist, replace(state, hunt=hunt), Mode.LOST, reason, belief=belief)

    def _aim(
        self, person: Person, keeps: float, points: Points, state: TrackingState, observation: Observation
    ) -> tuple[Aim, TrackingState]:
        """Return where the person is at the newest stamp and which way leads there, and the state with that way."""
        now, poses, ground = observation.now, state.tracks.poses, state.ground
        pose, track = pose_at(poses, now), predict(person.track, now, self.tracker.noise)
        bearing, distance = bearing_range(track, pose)
        bearing_rate, range_rate = rates(track, pose)
        if observation.scan is None or not person.confirmed:
            return Aim(bearing, distance, bearing_rate, range_rate, heading=bearing, hidden=False), state
        heading: float | None = bearing
        obstacles = self.detour.obstacles(points, bearing, distance)
        if distance - self.robot.camera_x > keeps - self.steering.distance_tolerance:
            preferred = state.detour or self.detour.lean_s * bearing_rate
            heading = self.detour.heading(obstacles, bearing, distance, preferred, self.robot)
            if heading == bearing or ground is None or self._is_passing(ground, obstacles, bearing, distance, pose):
                state = replace(state, way=NO_POINTS, way_at=-math.inf) if state.way_at > -math.inf else state
            elif now - state.way_at >= self.lookout.replan_s:
                way = self.lookout.router.way_towards(self.grid, ground, pose, np.array(track.place))
                state = replace(state, way=way if len(way) > 1 else NO_POINTS, way_at=now)
            if len(state.way):
                heading = self._along(state.way, obstacles, pose)
        elif observation.remembered is not None:
            around = np.concatenate([points, observation.remembered])
            heading = self.backing.heading(bearing, around, self.robot)
        hidden = self.detour.hides(obstacles, bearing, distance)
        return Aim(bearing, distance, bearing_rate, range_rate, heading, hidden), state

    def _is_passing(self, ground: Ground, obstacles: Points, bearing: float, distance: float, pose: Odometry) -> bool:
        """Whether only what came lately is in the direct way: that goes away as well, and needs no other way."""
        lasting = obstacles[self.grid.is_blocked(ground, to_odometry(obstacles, pose), lasting=True)]
        reach = min(distance - 2 * self.detour.person_radius, self.detour.look_ahead)
        return self.detour.free(lasting, bearing, 0.0, reach, self.robot, 0) is not None

    def _hides(self, ground: Ground, pose: Odometry, place: tuple[float, ...]) -> bool:
        """Whether something that lasts is between the robot and a place x, y in the odometry frame."""
        return not self.grid.sees(ground, np.array([[pose.x, pose.y]]), np.array([place]), lasting=True)[0, 0]

    def _keeps(self, person: Person, state: TrackingState, observation: Observation) -> float:
        """Return the distance to hold from the camera [m]: the target, but none from which a person is cut off."""
        if not person.confirmed:
            return self.target_distance
        least = self.tracker.visibility.least_distance(person.window, person.centre, observation.height)
        late_s = observation.now - observation.stamp + state.tracks.period
        notice_s = late_s + self.headway_s / math.sqrt(state.acceleration)
        least += 2 * state.brisk * max(late_s - self.usual_delay_s, 0.0)
        keeps = max(self.target_distance, least - self.robot.camera_x, notice_s * state.brisk)
        if keeps > self.hiding_distance and state.ground is not None:
            pose = pose_at(state.tracks.poses, observation.now)
            soon = predict(person.track, observation.now + self.hiding_foresight_s, self.tracker.noise).place
            if self._hides(state.ground, pose, soon):
                return self.hiding_distance
        return keeps

    def _along(self, way: Points, obstacles: Points, pose: Odometry) -> float:
        """Return the direction along a way [rad], or one near it that is free."""
        x, y = point_ahead(way, pose, self.lookout.ahead)
        off = math.remainder(math.atan2(y - pose.y, x - pose.x) - pose.yaw, math.tau)
        near = self.detour.near(obstacles, off, self.robot) if abs(off) < self.lookout.aside else None
        return off if near is None else near

    def _is_worth_nearing(self, person: Person, aim: Aim) -> bool:
        """Whether a track is too far away for HOG to confirm it, and likely enough to be one to drive there."""
        too_small = person.window <= aim.distance * self.tracker.visibility.smallest_window
        return too_small and person.existence >= self.selection.min_existence

    def _region(self, person: Person, state: TrackingState, observation: Observation) -> Region | None:
        """Return where the person should be in the next frame; None to search all of it."""
        if state.since_full + 1 >= self.whole_image_every or not self.selection.is_candidate(person):
            return None
        if state.choice.asked is not None or not self._is_sure(person, state.choice):
            # The person asked for, or the right person, may be outside the region of the person followed.
            return None
        stamp = observation.stamp + state.tracks.period
        pose = pose_at(state.tracks.poses, stamp)
        bearing, distance = bearing_range(predict(person.track, stamp, self.tracker.noise), pose)
        width, height = observation.width, observation.height
        return self.region.around(bearing, distance, person.window, person.centre, observation.focal_px, width, height)
