"""Which of the tracked people to follow, and what else the tracking controller remembers from frame to frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from limo_hog.follow.control.lookout import Hunt
from limo_hog.follow.control.rollouts import DIRECT, Manoeuvre
from limo_hog.follow.control.situation import carried
from limo_hog.follow.decision import Believed
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.clearance import NO_POINTS, Points
from limo_hog.follow.sense.observation import Odometry, pose_at
from limo_hog.follow.space.grid import Ground
from limo_hog.follow.tracks.asking import Whom, picked
from limo_hog.follow.tracks.hiding import Other
from limo_hog.follow.tracks.identity import Identity, Likeness
from limo_hog.follow.tracks.kalman import Noise, Track, bearing_range, predict
from limo_hog.follow.tracks.person import Person
from limo_hog.follow.tracks.tracker import Tracks


@dataclass(frozen=True, slots=True)
class Choice:
    """The person followed."""

    number: int | None = None  #: Of the person; None while none is followed.
    #: What the confirmed person followed last looks like, and which track that is; None where none was followed yet.
    likeness: Likeness | None = None
    measured: float | None = None  #: When that person was last measured [s]; None where none was followed yet.
    #: Numbers of the tracks of which one is the person followed, where it is not sure which; else empty.
    candidates: tuple[int, ...] = ()
    unsure_at: float | None = None  #: Since when that is not sure [s]; None where it is.
    asked: Whom | None = None  #: The person asked for, not in view yet; None where nobody is.


@dataclass(frozen=True, slots=True)
class Selection:
    """Chooses the person to follow."""

    # Chosen: three clear frames.
    min_existence: float = param(0.4, "of 1", "A track too far away for HOG is approached if this probable.", 0, 1)
    # Chosen: 3 s, longer than a person takes to be confirmed who is found in every third frame.
    max_unconfirmed_frames: int = param(30, "frames", "Older tracks neither confirmed nor likely are dropped.", 1, 1000)
    # Chosen: as long as the lost person is looked for.
    reidentify_s: float = param(60.0, "s", "How long to look for a lost person before another is followed.", 0, 600)
    # Chosen: one frame of evidence.
    switch_lead: float = param(0.1, "of 1", "By this another must be likelier than the person faced already.", 0, 1)
    # Chosen: at the image's edge three frames of evidence; two metres are worth two.
    bearing_cost: float = param(0.6, "1/rad", "Probability that a radian off straight ahead takes from a person.", 0, 5)
    distance_cost: float = param(0.1, "1/m", "Probability that a metre of distance takes from a person.", 0, 5)
    # Chosen: more likely than not.
    min_same: float = param(0.5, "of 1", "Probability from which a track in view is the person followed.", 0, 1)
    # Chosen: one wrong in four guesses would be too many.
    min_same_odds: float = param(3.0, "times", "The surest track must be likelier by this than any in view.", 1, 100)
    other_below: float = param(0.1, "of 1", "Probability below which a track in view is another person.", 0, 1)
    # Chosen: people part within a few seconds, or leave the view.
    decide_s: float = param(4.0, "s", "After this time of doubt the likeliest is taken.", 0, 60)
    # Chosen: HOG misses a person in several frames of ten.
    settles_s: float = param(1.0, "s", "Time to look at people before one asked for by a word is taken.", 0, 60)
    identity: Identity = field(default_factory=Identity)  #: Which track the person followed is.

    def choose(self, tracks: Tracks, choice: Choice) -> Choice:
        """Follow the person asked for, then whoever is followed so far; before there is one, the likeliest in view."""
        answer = None if choice.asked is None else self._asked(choice.asked, tracks, choice)
        return answer or replace(self._known(tracks, choice), asked=choice.asked)

    def _known(self, tracks: Tracks, choice: Choice) -> Choice:
        now = tracks.stamp or 0.0
        if choice.likeness is None or choice.measured is None or now - choice.measured > self.reidentify_s:
            choice = self._anybody(tracks, choice)
            followed = tracks.person(choice.number)
            if followed is not None and followed.confirmed and followed.seen == now:
                likeness = self.identity.begin(followed)
                return Choice(followed.number, likeness, followed.measured)
            return choice
        likeness = self.identity.update(choice.likeness, tracks)
        choice = replace(choice, likeness=likeness)
        chances, measured, likelier = dict(likeness.chances), self.measured(tracks), None
        about = [person for person in measured if chances[person.number] >= self.other_below]
        about.sort(key=lambda person: -chances[person.number])
        if about:
            best, *rest = about
            chance = chances[best.number]
            next_best = chances[rest[0].number] if rest else 0.0
            if chance >= self.min_same and chance >= self.min_same_odds * next_best:
                return Choice(best.number, likeness, best.measured if chance >= self.identity.sure else choice.measured)
            likelier = best if chance >= self.min_same else None
            # Legs alone do not show who it is, however long they are looked at.
            about = [person for person in about if now - person.seen <= self.identity.unseen_s]
        if about:
            best, *rest = about
            since = now if choice.unsure_at is None else choice.unsure_at
            choice = replace(choice, unsure_at=since)
            if rest and sum(chances[person.number] for person in about) >= self.min_same:
                if now - since > self.decide_s:
                    likeness = replace(likeness, chances=((best.number, self.min_same),))
                    return Choice(best.number, likeness, choice.measured)
                return replace(choice, candidates=tuple(person.number for person in about))
            if best.number != choice.number and now - since <= self.decide_s:
                # The person may have come back: they are looked at, not turned away from.
                return replace(choice, candidates=(best.number,))
        choice = replace(choice, candidates=(), unsure_at=choice.unsure_at if about else None)
        # The track may have gone over to another person.
        followed = likelier or tracks.person(choice.number)
        if followed is None:
            return choice
        strange = followed in measured and chances[followed.number] < self.other_below
        return replace(choice, number=None if strange or not self.is_candidate(followed) else followed.number)

    def measured(self, tracks: Tracks) -> list[Person]:
        """Return the people who may be followed and were measured just now."""
        now, lately = tracks.stamp or 0.0, self.identity.unseen_s
        return [person for person in tracks.people if now - person.measured <= lately and self.is_candidate(person)]

    def _asked(self, whom: Whom, tracks: Tracks, choice: Choice) -> Choice | None:
        """Take the person asked for once they are in view; None where somebody else is followed until then."""
        now, follows = tracks.stamp or 0.0, choice.likeness is not None
        # Somebody who is followed is left for a confirmed person alone.
        people = [person for person in self.measured(tracks) if person.confirmed or not follows]
        person = picked(whom, people, pose_at(tracks.poses, now))
        if person is None:
            return None if follows else replace(choice, number=None)
        if follows and person.number == choice.number:
            return replace(choice, asked=None)
        since = now if choice.unsure_at is None else choice.unsure_at
        settled = follows or isinstance(whom, int) or now - since >= self.settles_s
        if settled and person.confirmed and person.seen == now:
            return Choice(person.number, self.identity.begin(person), person.measured)
        return None if follows else replace(choice, number=person.number, unsure_at=since)

    def _anybody(self, tracks: Tracks, choice: Choice) -> Choice:
        """Take the likeliest person in view, and of two the one straight ahead and near."""
        followed = tracks.person(choice.number)
        if followed is not None and followed.confirmed and followed.measured == tracks.stamp:
            return choice
        candidates = [person for person in tracks.in_view if self.is_candidate(person)]
        if followed is not None and followed not in candidates and self.is_candidate(followed):
            candidates.append(followed)
        if not candidates:
            return replace(choice, number=None)
        pose = pose_at(tracks.poses, tracks.stamp or 0.0)

        def rank(person: Person) -> float:
            off, distance = bearing_range(person.track, pose)
            lead = self.switch_lead * (person is followed)
            return person.existence - self.bearing_cost * abs(off) - self.distance_cost * distance + lead

        return replace(choice, number=max(candidates, key=rank).number)

    def is_candidate(self, person: Person) -> bool:
        """Whether a track is a person, or may yet turn out to be one."""
        return person.confirmed or person.age < self.max_unconfirmed_frames or person.existence > self.min_existence

    def is_stranger(self, person: Person, choice: Choice) -> bool:
        """Whether a person is not the one followed before."""
        return choice.likeness is not None and choice.likeness.of(person.number) < self.min_same


@dataclass(frozen=True, slots=True)
class TrackingState:
    """What the controller remembers."""

    tracks: Tracks = field(default_factory=Tracks)  #: All tracked people.
    choice: Choice = field(default_factory=Choice)  #: Which of them is followed.
    side: float = 1.0  #: Which way to search: 1 left, -1 right.
    since_full: int = 0  #: Frames since the whole image was searched [1].
    ground: Ground | None = None  #: What stands where; None before the first scan.
    known: Track | None = None  #: The followed person's track when last measured; None before anyone was followed.
    hunt: Hunt | None = None  #: What is remembered while looking for that person; None while they are measured.
    #: float64 (N, 2) [m], odometry frame: the way to the person where the direct one is not free; when planned [s].
    way: Points = field(default_factory=lambda: NO_POINTS)
    way_at: float = -math.inf
    acceleration: float = 1.0  #: Of the wheels, as learnt [m/s²].
    sent: Twist = field(default_factory=Twist)  #: The last command.
    others: tuple[Other, ...] = ()  #: Other people than the followed one, measured lately.
    brisk: float = 0.0  #: How fast the followed person walks at most, as far as known [m/s].
    kept: Manoeuvre = DIRECT  #: The manoeuvre begun.


def believed(state: TrackingState, pose: Odometry, noise: Noise) -> tuple[Believed, ...]:
    """Return everyone tracked, in the base frame of a robot at `pose`, as of its stamp."""
    boxes, likeness, people = dict(state.tracks.boxes), state.choice.likeness, state.tracks.people
    means = np.array([predict(person.track, pose.stamp, noise).mean for person in people]).reshape(-1, 4)
    moved = carried(means, pose).tolist()
    same = {} if likeness is None else dict(likeness.chances)
    everybody = []
    for person, (x, y, vx, vy) in zip(people, moved, strict=True):
        box, chance = boxes.get(person.number), None if likeness is None else same.get(person.number, 0.0)
        everybody.append(Believed(x, y, person.existence, person.number, vx, vy, box, chance))
    return tuple(everybody)
