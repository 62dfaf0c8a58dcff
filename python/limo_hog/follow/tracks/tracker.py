"""All tracked people from frame to frame: predict, associate, update, initiate, forget."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter

from limo_hog.follow.parameters import param
from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.sense.clearance import scan_points, to_odometry
from limo_hog.follow.sense.measurement import STATURE, WALK, Measurement, Visibility, measure
from limo_hog.follow.sense.observation import Observation, Odometry, pose_at
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.association import Association, Returns
from limo_hog.follow.tracks.hiding import Other
from limo_hog.follow.tracks.kalman import Noise, Track, bearing_range, innovation
from limo_hog.follow.tracks.movers import Mover, Movers
from limo_hog.follow.tracks.person import Existence, Person, Recall, predict


@dataclass(frozen=True, slots=True)
class Tracks:
    """What is known about people and the robot's recent past."""

    people: tuple[Person, ...] = ()  #: Everyone tracked.
    boxes: tuple[tuple[int, int], ...] = ()  #: Number and index of the box of each person found in the last frame.
    next_number: int = 1  #: Number of the next new person.
    poses: tuple[Odometry, ...] = ()  #: Where the robot was and what the lidar hit lately, oldest first.
    scans: tuple[Returns, ...] = ()
    #: Stamp of the last frame, None before the first, and the time between the last two [s].
    stamp: float | None = None
    period: float = 0.1
    recall: Recall = field(default_factory=Recall)  #: How often people are found, as learnt so far.
    variance: float = 1.0  #: Of the clothes in one person's boxes, times that of `ColourSampling`, as learnt so far.
    #: What may move in the scan, whether the camera shows it or not, and the stamp of that scan [s].
    movers: tuple[Mover, ...] = ()
    moved_at: float = -math.inf

    def person(self, number: int | None) -> Person | None:
        """Return the person of a number, if they are tracked."""
        return next((person for person in self.people if person.number == number), None)

    @property
    def in_view(self) -> list[Person]:
        """People found in the last frame."""
        return [person for person in self.people if person.seen == self.stamp]


@dataclass(frozen=True, slots=True)
class Tracker:
    """Keeps the tracks of all people."""

    noise: Noise = field(default_factory=Noise)  #: The parts, each with its parameters.
    association: Association = field(default_factory=Association)
    existence: Existence = field(default_factory=Existence)
    movers: Movers = field(default_factory=Movers)
    visibility: Visibility = field(default_factory=Visibility)
    forget_s: float = param(8.0, "s", "An unmeasured person is forgotten after this time.")
    legs_only_s: float = param(4.0, "s", "A person is followed for this time by legs alone that do not walk.")
    restart_s: float = param(1.0, "s", "A person measured again after this time has a new track.")
    size_rate: float = param(0.2, "1", "Share by which one box moves a person's size.")
    turn_speed: float = param(1.0, "m/s", "Added to the velocity's deviation by a box outside the gate.")
    astray: float = param(0.25, "m", "A box whose range differs by more may be on another person.")
    stature_from: float = param(1.4, "m", "From nearer the outline's top is no measure of the stature.")
    poses_s: float = param(2.0, "s", "How long odometry is kept: a camera image may be as late as this.")
    scans_s: float = param(1.0, "s", "How long scans are kept.")
    scan_period_s: float = param(0.13, "s", "A scan may be older by this than the image it is used with.")
    walks_on_s: float = param(2.0, "s", "A person not measured is taken to walk on for this time.")
    walk: float = param(WALK, "m/s", "How fast people walk who are not measured.")
    min_period_s: float = param(0.02, "s", "Shortest time between two frames that is used to predict the next.")
    max_period_s: float = param(0.5, "s", "Longest time between two frames that is used to predict the next.")
    robot: RobotGeometry = LIMO  #: Where camera and lidar sit.

    def update(self, observation: Observation, tracks: Tracks) -> tuple[Tracks, dict[int, int]]:
        """Bring all tracks up to a frame; also number -> index of the box of each person found."""
        tracks = self._remember(observation, tracks)
        stamp, pose = observation.stamp, pose_at(tracks.poses, observation.stamp)
        known = [person for person in tracks.people if stamp - person.measured < self.forget_s]
        scans = tracks.scans if observation.between else ()
        known = [predict(self._walked(person, scans, tracks, stamp), stamp, self.noise) for person in known]
        measured = measure(observation, self.robot)
        flat = {which for which, seen in enumerate(measured) if not self.existence.is_solid(seen)}
        moving = self.movers.moving(tracks.movers, stamp - self.movers.forget_s)
        others = self.movers.others(moving, known, measured, pose, self.noise)
        # A box that does not stand out from what is behind it is no confirmed person's.
        for which in flat:
            others |= {(who, which) for who, person in enumerate(known) if person.confirmed}
        noise, variance = self.noise.turning(pose.angular), tracks.variance
        pairs = self.association.pair(known, measured, pose, noise, others, variance)
        people, boxes, recall = list[Person](), dict[int, int](), tracks.recall
        for who, person in enumerate(known):
            bearing, distance = bearing_range(person.track, pose)
            expected = self.visibility.expected(
                bearing, distance, person.window, person.centre, observation, confirmed=person.confirmed
            )
            height = person.window / max(distance, 0.3)
            chance = self.existence.recall_of(tracks.recall, height)
            if expected and person.confirmed:
                recall = self.existence.learn(recall, height, found=who in pairs)
            if who in pairs:
                boxes[person.number] = pairs[who]
                person = self.correct(person, measured[pairs[who]], pose, chance, tracks.variance)
                if person.confirmed and not person.strained:
                    variance = self.association.appearance.varied(variance, known[who].clothes, person.worn)
            elif expected and (not person.confirmed or stamp - person.measured < self.restart_s):
                # Later than that it shows only that the person walked on, not that there is none. Legs that walk show
                # that there is one.
                walks = any(mover.number == person.number for mover in moving)
                evidence = 0.0 if walks else self.existence.of_miss(chance)
                person = self.existence.update(person, evidence, found=False)
            people.append(person if who in pairs else self._glimpsed(person, observation, pose))
        number = tracks.next_number
        for which, seen in enumerate(measured):
            if which not in boxes.values() and which not in flat and self.association.is_new(seen, people, pose):
                people.append(self.begin(number, seen, stamp, pose))
                boxes[number] = which
                number += 1
        learnt = replace(tracks, recall=recall, variance=variance)
        return replace(learnt, people=tuple(people), next_number=number, boxes=tuple(boxes.items())), boxes

    def _glimpsed(self, person: Person, observation: Observation, pose: Odometry) -> Person:
        """Note what a confirmed person without a box wears, where the camera shows it."""
        if not person.confirmed:
            return person
        bearing, distance = bearing_range(person.track, pose)
        place = distance * math.cos(bearing), distance * math.sin(bearing)
        worn = self.visibility.glimpse(place, person.window, person.centre, observation, self.robot)
        return person if worn is None else replace(person, worn=worn, tall=None, glimpsed=observation.stamp)

    def begin(self, number: int, seen: Measurement, stamp: float, pose: Odometry) -> Person:
        """Begin to track a box that belongs to no known person."""
        odds = self.existence.prior + self.existence.of_box(seen, self.existence.recall)
        distance, noise = seen.range, self.noise.turning(pose.angular)
        if distance is None:
            distance, noise = self.association.unknown, replace(noise, range=self.association.unknown_sigma)
        track = kalman.initiate(stamp, seen.bearing, distance, pose, noise)
        window = seen.window or seen.height * distance
        centre = seen.middle if seen.window else seen.centre * distance
        worn, tall = self.association.worn(seen), window if seen.whole and seen.window else None
        stature = seen.stature or STATURE
        return Person(number, track, stamp, odds, window, centre, stature, clothes=worn, worn=worn, tall=tall)

    def correct(
        self, person: Person, seen: Measurement, pose: Odometry, recall: float = 0.9, variance: float = 1.0
    ) -> Person:
        """Update a person, found with `recall`, by their box, whose clothes have `variance`; both have one stamp."""
        window, centre, stature = person.window, person.centre, person.stature
        solid, fits = self.existence.is_solid(seen), self.association.fits_size(person, seen)
        if seen.range is not None and solid:
            # A range that contradicts the size counts too: the size may have been wrong from the beginning.
            if seen.whole:
                window += self.size_rate * (seen.window - window)
                centre += self.size_rate * (seen.middle - centre)
                stature += self.size_rate * (seen.stature - stature)
            elif seen.window > window:
                window, centre, stature = seen.window, seen.middle, seen.stature
        off = 0.0 if seen.range is None else abs(seen.range - bearing_range(person.track, pose)[1])
        in_place = off < self.astray
        worn = self.association.worn(seen) if fits else None
        # A box on a part of the body still shows the stature, by the depth image.
        far = (seen.range or 0.0) >= self.stature_from
        tall = seen.window if in_place and far and seen.whole and seen.window else None
        evidence = self.existence.of_box(seen, recall)
        if person.confirmed and solid:
            # Near by, and on parts of the body, HOG's scores are low for people, too.
            evidence = max(evidence, 0.0)
        if not fits:
            # Something stands in front of the person.
            seen = replace(seen, range=None)
        track, noise = person.track, self.noise.turning(pose.angular)
        if seen.range is not None and track.stamp - person.measured > self.restart_s:
            track = kalman.initiate(track.stamp, seen.bearing, seen.range, pose, noise)
        fit = innovation(track, seen.bearing, seen.range, pose, noise)
        strained = fit.distance2 > self.association.gate
        if strained:
            track = kalman.loosened(track, self.association.same_place, self.turn_speed)
            fit = innovation(track, seen.bearing, seen.range, pose, noise)
        clothes = self.association.appearance.learn(person.clothes, worn, variance)
        track = kalman.update(track, fit)
        person = self.existence.update(person, evidence, found=True)
        person = replace(person, seen=track.stamp, track=track, window=window, centre=centre, stature=stature)
        return replace(person, clothes=clothes, worn=worn, tall=tall, strained=strained or not in_place)

    def follow_legs(self, person: Person, tracks: Tracks, grid: Grid, ground: Ground | None) -> tuple[Person, Tracks]:
        """Bring a person up to the newest scan, if their legs are in it; returns on the known `ground` are none.

        Among the tracks returned, a person found in the last frame stays at its stamp: the next may be older.
        """
        if tracks.stamp is None or not person.confirmed:
            return person, tracks
        unseen = tracks.stamp - person.seen
        if person.misses:
            height = person.window / max(bearing_range(person.track, pose_at(tracks.poses, tracks.stamp))[1], 0.3)
            if not self.existence.is_chance(person.misses, self.existence.recall_of(tracks.recall, height)):
                return person, tracks
        # Walls and furniture that are known already are nobody's legs.
        is_ground = None if ground is None else partial(grid.is_near_blocked, ground)
        now = person
        for returns in tracks.scans:
            # The track of an unseen person already contains the scans up to `felt`: each may count only once.
            if returns.stamp - now.measured > self.restart_s or unseen > self.legs_only_s:
                # Legs continue a track; after a gap, whatever stands there could be taken for them.
                break
            if (unseen == 0 or returns.stamp > person.felt) and returns.stamp > now.track.stamp - self.scan_period_s:
                now = self.movers.walked(now, tracks.movers, returns, self.noise, is_ground)
        kept = now if unseen > 0 else replace(person, felt=now.felt)
        people = [kept if other.number == person.number else other for other in tracks.people]
        return now, replace(tracks, people=tuple(people))

    def _walked(self, person: Person, scans: tuple[Returns, ...], tracks: Tracks, stamp: float) -> Person:
        """Bring a person up to the last scan before `stamp` [s] with their legs: between slow frames people turn."""
        for returns in scans:
            if person.confirmed and person.track.stamp < returns.stamp <= stamp and returns.stamp > person.felt:
                person = self.movers.walked(person, tracks.movers, returns, self.noise)
        return person

    def follow_movers(self, tracks: Tracks, views: tuple[float, float], grid: Grid, ground: Ground | None) -> Tracks:
        """Enter the new scans into what moves; see `Movers.update`."""
        movers, new = tracks.movers, [returns for returns in tracks.scans if returns.stamp > tracks.moved_at]
        if not new:
            return tracks
        people = tracks.people
        seen = [person for person in people if person.confirmed and person.seen == tracks.stamp]
        for returns in new:
            movers = self.movers.update(movers, returns, views, self.noise, grid, ground)
            movers = self.movers.assign(movers, seen, returns.stamp, self.noise)
            unseen = [person for person in people if person.confirmed and person.seen != tracks.stamp]
            walking = {mover.number for mover in self.movers.moving(movers)} if unseen else set()
            for person in unseen:
                if (tracks.stamp or 0.0) - person.seen < self.legs_only_s or person.number in walking:
                    now = self.movers.continued(person, movers, returns.stamp)
                    people = tuple(now if other is person else other for other in people)
        return replace(tracks, people=people, movers=movers, moved_at=new[-1].stamp)

    def around(
        self, tracks: Tracks, followed: Person | None, now: float, lately_s: float
    ) -> tuple[list[Track], list[Other], Track | None]:
        """Return all people, seen by the camera or moving in the scan, as of `now` [s].

        Also others than `followed` who were measured within `lately_s` [s], and which track is the person followed;
        None for none of them.
        """
        people: dict[int, Track] = {}
        others: list[Other] = []
        for person in tracks.people:
            person = followed if followed is not None and person.number == followed.number else person
            if person.confirmed and now - person.measured <= self.walks_on_s:
                people[person.number] = track = kalman.predict(person.track, now, self.noise)
                if person is not followed and now - person.measured <= lately_s:
                    others.append(Other(*track.place, now, person.clothes))
        own = None if followed is None else people.get(followed.number)
        reach = self.association.same_place + (self.walk * (now - followed.measured) if followed else 0.0)
        places, nameless = [*map(attrgetter("place"), people.values())], []
        for mover in self.movers.moving(tracks.movers):
            if mover.number in people:
                continue
            track = kalman.predict(mover.track, now, self.noise)
            here = track.place
            if min([math.dist(here, place) for place in places], default=math.inf) <= self.association.same_place:
                continue
            nameless.append(track)
            may_be_own = followed is not None and (
                mover.number == followed.number or math.dist(followed.track.place, here) < reach
            )
            if now - mover.felt <= lately_s and not may_be_own:
                others.append(Other(*here, now))
        return [*people.values(), *nameless], others, own

    def may_be(self, number: int | None, tracks: Tracks, now: float) -> list[Track]:
        """Return what moves in the scan and may be the person of a number, or one not shown yet, as of `now` [s]."""
        moving = [mover for mover in self.movers.moving(tracks.movers) if mover.number in (number, None)]
        moved = [kalman.predict(mover.track, now, self.noise) for mover in moving if mover.shown < self.movers.looks]
        others = [
            kalman.predict(person.track, now, self.noise).place
            for person in tracks.people
            if person.confirmed and person.number != number and person.measured > now - self.movers.forget_s
        ]
        legs = self.movers.legs.radius
        return [track for track in moved if all(math.dist(track.place, place) > legs for place in others)]

    def _remember(self, observation: Observation, tracks: Tracks) -> Tracks:
        poses, scans = tracks.poses, tracks.scans
        for scan, odometry in (*observation.between, (observation.scan, observation.odometry)):
            if odometry is not None:
                poses = (*[pose for pose in poses if odometry.stamp - pose.stamp < self.poses_s], odometry)
            if scan is not None and (not scans or scan.stamp > scans[-1].stamp):
                at = pose_at(poses, scan.stamp)
                new = Returns(scan.stamp, to_odometry(scan_points(scan, self.robot), at), at)
                scans = (*[returns for returns in scans if scan.stamp - returns.stamp < self.scans_s], new)
        period = tracks.period if tracks.stamp is None else observation.stamp - tracks.stamp
        period = min(max(period, self.min_period_s), self.max_period_s)
        return replace(tracks, poses=poses, scans=scans, stamp=observation.stamp, period=period)
