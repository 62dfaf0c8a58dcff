"""The third controller: estimate, choose whom to follow, aim, and move by the command that costs least."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np

from limo_hog.follow.control.following import Aimed, Followed, Following
from limo_hog.follow.control.lookout import Lookout
from limo_hog.follow.control.planner import NO_WAY, Planner
from limo_hog.follow.control.selection import Choice, Selection, TrackingState, believed
from limo_hog.follow.control.situation import Goal, Situation, carried
from limo_hog.follow.control.wheels import Wheels
from limo_hog.follow.decision import Belief, Decision, Mode
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import LIMO, RobotGeometry, Twist
from limo_hog.follow.sense.clearance import NO_POINTS, DepthGrid, from_odometry, scan_points, to_odometry
from limo_hog.follow.sense.measurement import PERSON_RADIUS, RegionSize
from limo_hog.follow.sense.observation import Observation, pose_at
from limo_hog.follow.sense.region import FAR_WINDOW, Region
from limo_hog.follow.space.grid import Grid
from limo_hog.follow.tracks.asking import Whom, named
from limo_hog.follow.tracks.hiding import Hiding
from limo_hog.follow.tracks.kalman import bearing_range, predict, rates
from limo_hog.follow.tracks.person import Person
from limo_hog.follow.tracks.tracker import Tracker


@dataclass(frozen=True, slots=True)
class TrackingController:
    """Follows one person among others."""

    target_distance: float = param(1.5, "m", "Distance to hold, as the depth image measures it.", 0.1, 8)
    # Chosen: another person is noticed within 1.5 s.
    whole_image_every: int = param(15, "frames", "One in this many frames is searched whole, else a region.", 1, 1000)
    slowest: float = param(0.3, "m/s", "People slower than this stand: the lidar shows them where they are.", 0, 2)
    near_behind: float = param(1.2, "m", "Behind the robot, what the map shows this near counts as well.", 0, 5)
    mapped: float = param(3.5, "m", "Up to this far the depth image is entered into the map.", 0, 8)
    following: Following = field(default_factory=Following)  #: Where to be while the person is known to be somewhere.
    lookout: Lookout = field(default_factory=Lookout)  #: Where to look for a lost person.
    planner: Planner = field(default_factory=Planner)  #: Which command to send.
    wheels: Wheels = field(default_factory=Wheels)  #: What the wheels can do.
    selection: Selection = field(default_factory=Selection)  #: Whom to follow.
    tracker: Tracker = field(default_factory=Tracker)  #: Where all people are.
    hiding: Hiding = field(default_factory=Hiding)  #: Who is out of sight.
    region: RegionSize = field(default_factory=RegionSize)  #: How much of the image to search.
    grid: Grid = field(default_factory=Grid)  #: How the ground is mapped, and which depth pixels are looked at for it.
    depth_grid: DepthGrid = field(default_factory=lambda: DepthGrid(step=16))
    robot: RobotGeometry = LIMO  #: Where camera and lidar sit.
    person: Whom | None = None  #: Whom to follow first; None for who is ahead and near.

    def __post_init__(self) -> None:
        if self.tracker.robot != self.robot:
            movers = replace(self.tracker.movers, robot=self.robot)
            object.__setattr__(self, "tracker", replace(self.tracker, robot=self.robot, movers=movers))

    def start(self) -> TrackingState:
        """Return the state before the first observation: no people."""
        return TrackingState(choice=Choice(asked=self.person), acceleration=self.wheels.acceleration)

    def ask(self, whom: Whom, state: TrackingState) -> TrackingState:
        """Return the state in which a person is asked for: they are followed once they are in view."""
        return replace(state, choice=replace(state.choice, asked=whom))

    def step(self, observation: Observation, state: TrackingState) -> Decision[TrackingState]:
        """Estimate what is where, choose a person, aim, and move."""
        before = state.choice.measured
        state = self._estimate(observation, state)
        tracks, choice = state.tracks, state.choice
        person = None if choice.candidates else tracks.person(choice.number)
        if person is not None:
            person, tracks = self.tracker.follow_legs(person, tracks, self.grid, state.ground)
            state = replace(state, tracks=tracks)
        state, situation = self._situation(person, observation, state)
        (goal, mode, reason, state), belief = self._aim(person, situation, observation, state)
        if before is not None and (choice.measured or 0.0) - before > self.selection.reidentify_s:
            reason = "following another person: the lost one was not found"
        plan = self.planner.plan(situation, goal, state.kept)
        twist = plan.twist
        if plan.reason:
            moves = Mode.BLOCKED if plan.reason == NO_WAY else Mode.FOLLOW
            mode, reason = mode if mode in (Mode.LOST, Mode.SEARCH) else moves, plan.reason
        if observation.odometry is not None:
            twist = self.wheels.within_reach(twist, situation.driven, state.acceleration, situation.period, self.robot)
        target = dict(tracks.boxes).get(person.number) if person and belief.followed is not None else None
        region = self._region(person if belief.followed is not None else None, state, observation)
        since_full = 0 if region is None else state.since_full + 1
        state = replace(state, kept=plan.manoeuvre, sent=twist, since_full=since_full)
        if (asked := choice.asked) is not None:
            reason = f"{reason}; asked for {named(asked)}, not found yet"
        people, leads = believed(state, situation.pose, self.tracker.noise), tuple(map(tuple, plan.rollout.tolist()))
        belief = replace(belief, people=people, rollout=leads, rollouts=plan.rollouts, shares=plan.shares)
        return Decision(twist, state, mode, reason, target, region, belief)

    def _estimate(self, observation: Observation, state: TrackingState) -> TrackingState:
        """Bring wheels, tracks, choice and map up to an observation."""
        wheels, acceleration = observation.odometry, state.acceleration
        if wheels is not None and state.tracks.poses:
            acceleration = self.wheels.learn(acceleration, state.sent, state.tracks.poses[-1], wheels, self.robot)
        tracks, _ = self.tracker.update(observation, state.tracks)
        choice = self.selection.choose(tracks, state.choice)
        state = replace(state, tracks=tracks, choice=choice, acceleration=acceleration)
        return self._map(state, observation)

    def _map(self, state: TrackingState, observation: Observation) -> TrackingState:
        """Enter a new scan into what moves, and with the depth image into the map of the ground."""
        scan, tracks = observation.scan, state.tracks
        if scan is None or observation.odometry is None:
            return state
        half_view = min(self.robot.lidar_yaw - scan.angle_min, scan.angle_max - self.robot.lidar_yaw)
        tracks = self.tracker.follow_movers(tracks, (half_view, self.lookout.half_view), self.grid, state.ground)
        if state.ground is not None and scan.stamp < state.ground.stamp + self.grid.period_s:
            return replace(state, tracks=tracks)
        pose = pose_at(tracks.poses, scan.stamp)
        lately = observation.now - self.hiding.unseen_s
        known = [person.track.place for person in tracks.people if person.confirmed and person.measured > lately]
        people = np.array(known).reshape(-1, 2)
        depth_points = NO_POINTS
        if observation.depth is not None:
            near = self.depth_grid.points(observation.depth, observation.focal_px, self.mapped, self.robot)
            depth_points = to_odometry(near, pose_at(tracks.poses, observation.stamp))
        ground = self.grid.update(state.ground, scan, pose, people, depth_points, self.robot)
        return replace(state, tracks=tracks, ground=ground)

    def _situation(
        self, person: Person | None, observation: Observation, state: TrackingState
    ) -> tuple[TrackingState, Situation]:
        """Put together what commands are judged by, and bring up to it who is out of sight."""
        now, wheels, tracks = observation.now, observation.odometry, state.tracks
        pose = pose_at(tracks.poses, now)
        around, seen, own = self.tracker.around(tracks, person, now, self.hiding.unseen_s)
        felt = self.tracker.movers.felt(tracks.movers, now)
        lately = person is not None and now - person.measured < self.hiding.unseen_s
        place = np.array([person.track.place]) if person and lately else NO_POINTS
        others = self.hiding.remember(state.others, seen, felt, place, now)
        if others and state.ground is not None:
            # What lasts is no person: a wall's end seen from a new side seems to move.
            lasts = self.grid.is_near_blocked(state.ground, np.array([other[:2] for other in others]), lasting=True)
            others = tuple(other for other, stands in zip(others, lasts.tolist(), strict=True) if not stands)
        people = np.array([*map(attrgetter("mean"), around)]).reshape(-1, 4)
        pace = np.hypot(people[:, 2], people[:, 3])
        followed = None if own is None else around.index(own)
        walks = pace > self.slowest
        if followed is not None:
            if walks[followed] and pace[followed] < state.brisk:
                # One who has set out will walk as fast as they are known to; the estimate takes half a second.
                people[followed, 2:] *= state.brisk / pace[followed]
            walks[followed] = True
        people = carried(people, pose)
        points = NO_POINTS if observation.scan is None else scan_points(observation.scan, self.robot)
        if observation.remembered is not None:
            points = np.concatenate([points, observation.remembered])
        if state.ground is not None:
            mapped = from_odometry(self.grid.lasting_near(state.ground, pose, self.near_behind), pose)
            points = np.concatenate([points, mapped[mapped[:, 0] < -self.robot.half_length]])
        if walks.any():
            gaps = np.hypot(*(points[:, None] - people[walks][None, :, :2]).transpose(2, 0, 1)).min(axis=1)
            points = points[gaps > PERSON_RADIUS]
        driven = Twist() if wheels is None else Twist(wheels.linear, wheels.angular)
        situation = Situation(
            *(now, pose, driven, self.robot, state.acceleration, tracks.period),
            *(now - observation.stamp + tracks.period, people, followed, points, self.grid, state.ground),
            self.hiding.circles(others, now),
        )
        return replace(state, others=others), situation

    def _aim(
        self, person: Person | None, situation: Situation, observation: Observation, state: TrackingState
    ) -> tuple[Aimed, Belief]:
        """Return where the robot should be, and what is to be told about it."""
        if state.choice.candidates:
            return self._unsure(situation, state), Belief()
        if person is None:
            return self._search(situation, observation, state)
        now, following = situation.now, self.following
        track = predict(person.track, now, self.tracker.noise)
        bearing, distance = bearing_range(track, situation.pose)
        lost_s, brisk = min(observation.stamp - person.seen, now - person.felt), state.brisk
        if lost_s <= self.tracker.scan_period_s:
            state = self._measured(person, bearing, situation, state)
        hidden = bool(situation.is_hidden(np.array([bearing]), np.array([distance]))[0])
        patience = self.tracker.forget_s if hidden else following.waits_s
        # Behind another person one is hidden for a moment: waiting is better than driving round people.
        waits = hidden and state.hunt is None and not situation.is_behind(person.track.place)
        if person.confirmed and state.known is not None and state.ground is not None and not waits:
            patience = self.lookout.after_s
        if lost_s > patience:
            return self._search(situation, observation, state)
        least, visibility = 0.0, self.tracker.visibility
        if person.confirmed:
            least = visibility.least_distance(person.window, person.centre, observation.height) - self.robot.camera_x
        soon = predict(person.track, now + following.foresight_s, self.tracker.noise).place
        keeps = following.keeps(self.target_distance, least, brisk if person.confirmed else 0.0, soon, situation)
        too_small = person.window <= distance * self.tracker.visibility.smallest_window
        worth_nearing = too_small and person.existence >= self.selection.min_existence
        followed = Followed(person, track, bearing, distance, keeps, worth_nearing)
        aimed = following.aim(followed, situation, state, self.planner.sampling)
        if keeps > self.target_distance + following.distance_tolerance and aimed.mode in (Mode.HOLD, Mode.FOLLOW):
            reason = f"{aimed.reason}, further off than asked: nearer the camera would not show all of them"
            aimed = aimed._replace(reason=reason)
        return aimed, Belief(keeps, followed=person.number)

    def _measured(self, person: Person, bearing: float, situation: Situation, state: TrackingState) -> TrackingState:
        """Remember of a person who was just measured where they are, how fast they walk and to which side they leave.

        Only a measured bearing tells the side: a predicted one changes sign as the robot turns past it.
        """
        following, track, known, brisk = self.following, person.track, state.known, state.brisk
        speed, (rate, _) = math.hypot(*track.mean[2:]), rates(track, situation.pose)
        if person.confirmed and self._is_sure(person, state):
            known = track
            if speed > self.slowest:
                brisk += (following.rise if speed > brisk else following.fall) * (speed - brisk)
        side = math.copysign(1.0, rate if abs(rate) > following.steady_bearing_rate else bearing)
        return replace(state, side=side, known=known, hunt=None, brisk=brisk)

    def _unsure(self, situation: Situation, state: TrackingState) -> Aimed:
        """Stand and keep those in view of whom one is the person followed, until it shows which."""
        likeness, tracks = state.choice.likeness, state.tracks
        people = [person for person in tracks.people if person.number in state.choice.candidates]
        chances = [likeness.of(person.number) if likeness else 1.0 for person in people]
        now, noise = situation.now, self.tracker.noise
        offs = [bearing_range(predict(person.track, now, noise), situation.pose)[0] for person in people]
        off = sum(chance * off for chance, off in zip(chances, offs, strict=True)) / max(sum(chances), 1e-6)
        which = f"which of {len(people)}" if len(people) > 1 else "whether this"
        return Aimed(Goal(off), Mode.HOLD, f"not sure {which} is the person followed", state)

    def _search(self, situation: Situation, observation: Observation, state: TrackingState) -> tuple[Aimed, Belief]:
        """Turn to what may be the person, look where they may be, or turn on and on."""
        choice, known, scan, lookout = state.choice, state.known, observation.scan, self.lookout
        lost = choice.measured is not None
        mode = Mode.LOST if lost else Mode.SEARCH
        moving = self.tracker.may_be(choice.number, state.tracks, situation.now)
        if known is None and moving:
            off = min((bearing_range(track, situation.pose)[0] for track in moving), key=abs)
            turns = Goal(off, turn_limit=lookout.facing_rate)
            return Aimed(turns, mode, "turning to what moves in the scan", state), Belief()
        goal, belief, reason = None, Belief(), "searching for the lost person" if lost else "searching for a person"
        young = known is not None and situation.now - known.stamp < lookout.give_up_s
        if lost and known is not None and young and scan is not None and situation.ground is not None:
            hunt = state.hunt or lookout.begin(known, choice.number or 0, situation)
            means = np.array([*map(attrgetter("mean"), moving)]).reshape(-1, 4)
            hunt = lookout.step(hunt, scan, means, situation)
            goal, reason = lookout.goal(hunt, situation, self.planner.sampling.times)
            places, way = lookout.ways(hunt, situation)
            belief, state = Belief(places=places, way=way), replace(state, hunt=hunt)
        if any(self.selection.is_stranger(person, choice) for person in state.tracks.in_view):
            reason += ": another is in view"
        goal = goal or Goal(0.0, rate=state.side * lookout.search_rate)
        return Aimed(goal, mode, reason, state), belief

    def _is_sure(self, person: Person, state: TrackingState) -> bool:
        """Whether a track is the person followed, and not only the likeliest of those in view."""
        likeness = state.choice.likeness
        return likeness is None or likeness.of(person.number) >= self.selection.identity.sure

    def _region(self, person: Person | None, state: TrackingState, observation: Observation) -> Region | None:
        """Return where the person followed should be in the next frame; None to search the whole image as it is.

        For a lost person that is the whole image enlarged, which shows people who are far away as well.
        """
        everything = Region(0, 0, observation.width, observation.height, FAR_WINDOW)
        if person is None:
            return None if state.choice.measured is None else everything
        if state.since_full + 1 >= self.whole_image_every or not self.selection.is_candidate(person):
            return None
        if state.choice.asked is not None:
            # The person asked for may be outside the region of the person followed.
            return None
        stamp = observation.stamp + state.tracks.period
        pose = pose_at(state.tracks.poses, stamp)
        bearing, distance = bearing_range(predict(person.track, stamp, self.tracker.noise), pose)
        region = self.region.around(bearing, distance, person.window, person.centre, observation)
        is_far = region is not None and region.scale > 1.0
        if not self._is_sure(person, state):
            # The right person may be outside it.
            return everything if is_far else None
        # A near person who was missed is looked for in the whole image as it is, which would not show a far one.
        return region if is_far or person.seen == observation.stamp else None
