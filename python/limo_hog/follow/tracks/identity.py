"""Which track is the person followed? A probability for each track, and the rest for none of them.

Every frame multiplies the probabilities by how much more likely the clothes and the stature in a track's box are for
the person followed than for another (Bayes), and lets some of them pass to where the person may have gone: from a track
that is not measured to one that begins, between two that meet, from every track to none.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace

import numpy as np

from limo_hog.follow.parameters import param
from limo_hog.follow.sense.measurement import WALK
from limo_hog.follow.sense.observation import Clothes, mixed
from limo_hog.follow.tracks.person import Person, separation
from limo_hog.follow.tracks.tracker import Tracks


@dataclass(frozen=True, slots=True)
class Traits:
    """What a person looks like."""

    number: int  #: Of the track it was learnt from.
    clothes: Clothes | None  #: What is worn; None where no colour image tells.
    window: float  #: Height of the detection window, times the distance [px m]: the stature.
    boxes: int = 1  #: Boxes it was learnt from [1].
    first: tuple[Clothes, ...] = ()  #: What the first of them showed, of which any may be odd.


@dataclass(frozen=True, slots=True)
class Likeness:
    """The person followed, and which track that is."""

    traits: Traits  #: What the person looks like.
    #: Where and when the person was last measured for sure: x, y [m] in the odometry frame, [s].
    place: tuple[float, float]
    at: float
    #: Number and probability of each track; what is missing to 1 is the probability that none is the person.
    chances: tuple[tuple[int, float], ...]
    others: tuple[Traits, ...] = ()  #: What other people look like, who were about lately.

    def of(self, number: int) -> float:
        """Return the probability that a track is the person followed."""
        return dict(self.chances).get(number, 0.0)


@dataclass(frozen=True, slots=True)
class Identity:
    """Moves the probabilities from frame to frame."""

    sure: float = param(0.95, "1", "From this probability on the person's place, clothes and stature are learnt.")
    strange: float = param(0.1, "1", "How likely another is to wear just these clothes, at a variance of 1.")
    odd: float = param(0.05, "1", "Share of boxes that show something else in the place of the clothes.")
    stature_sigma: float = param(0.05, "1", "Standard deviation of the stature in the depth image, as a share.")
    strange_stature: float = param(0.3, "1", "As `strange`, of the stature.")
    odd_stature: float = param(0.3, "1", "As `odd`, of the stature.")
    again: float = param(0.5, "1", "Share of its own evidence that a box counts for after a track's first.")
    steady: float = param(0.1, "1", "The same for the stature, and for everything while the legs are the same.")
    stays: float = param(0.5, "1", "Probability from which a track counts as the person for `steady`.")
    glimpse: float = param(0.4, "1", "Share of their evidence that clothes count for that fit where HOG found nobody.")
    misfit: float = param(0.02, "1", "The same for clothes there that do not fit: somebody may be before the person.")
    most: float = param(2.5, "log-odds", "The most that a box can tell either way.")
    passes: float = param(0.002, "1", "Chance that the next box of a track is on another person, where it fits.")
    strained: float = param(0.1, "1", "The same where its place or size contradicts the track.")
    legs_s: float = param(1.0, "s", "Legs that are the same for this time, with nobody's near, are the same person's.")
    legs_apart: float = param(0.4, "m", "Other legs nearer than this may have changed places with them.")
    fades_s: float = param(2.0, "s", "Time constant with which an unmeasured track loses the person.")
    shows_s: float = param(2.0, "s", "Time constant with which a lost person who is near gets a track.")
    near_s: float = param(4.0, "s", "A person is near for this time after it was last sure where they are.")
    meets: float = param(0.5, "m", "Two tracks nearer than this to each other may swap their people.")
    swaps: float = param(0.2, "1/m", "Chance of a swap for each metre by which they pass each other.")
    unseen_s: float = param(0.3, "s", "A person not measured for longer may be a track that begins.")
    reach: float = param(0.5, "m", "A track that begins nearer than this to the last place may be the person's.")
    speed: float = param(WALK, "m/s", "And further off by this for each second since.")
    clear: float = param(6.0, "chi² of 3", "A shirt or trousers that differ by more are not learnt.")
    rate: float = param(0.05, "1", "Share by which one box moves clothes and stature once they are learnt.")
    settled: int = param(20, "1", "The first boxes of a person followed, of which none contradicts that it is them.")
    voters: int = param(30, "1", "Boxes whose median is what a person wears; later what differs clearly is not learnt.")
    remembered: int = param(8, "1", "Other people that are remembered.")

    def begin(self, person: Person) -> Likeness:
        """Begin with a person who is followed from now on."""
        traits = Traits(person.number, person.clothes, person.window)
        return Likeness(traits, person.track.place, person.measured, ((person.number, 1.0 - self.passes),))

    def update(self, known: Likeness, tracks: Tracks) -> Likeness:
        """Bring the probabilities up to a frame, whose boxes `tracks` holds."""
        people, seen = {person.number: person for person in tracks.people}, tracks.in_view
        walking = {person.number for person in tracks.people if self._walks_on(person, tracks)}
        chances = self._passed(known, people, tracks, walking)
        absent, before, variance = max(1.0 - sum(chances.values()), 1e-6), dict(known.chances), tracks.variance
        others = [self._told_apart(traits, known.traits, variance) for traits in known.others]
        # The first boxes of a track that goes on show what the person looks like: none of them can contradict it.
        begins = [person for person in seen if person.number == known.traits.number and not person.strained]
        learns = known.traits.boxes < self.settled
        settling = [person.number for person in begins if learns and not self._beside(person, tracks)]
        glimpsed = [] if learns else [person for person in tracks.people if person.glimpsed == tracks.stamp]
        for person in (*seen, *glimpsed):
            if person.number in settling:
                continue
            evidence = self._evidence(known.traits, others, person, variance, first=person.age <= 1)
            if person.glimpsed == tracks.stamp:
                evidence *= self.glimpse if evidence > 0.0 else self.misfit
            stays = before.get(person.number, 0.0) >= self.stays and person.number in walking
            chances[person.number] *= math.exp(self.steady * evidence if stays else evidence)
        if (tracks.stamp or 0.0) - known.at < self.near_s:
            absent *= math.exp(-tracks.period / self.shows_s)
        total = sum(chances.values()) + absent
        chances = {number: odds / total for number, odds in chances.items()}
        known = replace(known, chances=tuple(chances.items()))
        own = [person for person in seen if chances[person.number] >= self.sure or person.number in settling]
        for person in own:
            traits = known.traits if self._beside(person, tracks) else self._moved(known.traits, person, variance)
            known = replace(known, place=person.track.place, at=person.measured, traits=traits)
        # While it is sure where the person is, by legs alone too, whoever else is seen is another.
        lately = (tracks.stamp or 0.0) - self.unseen_s
        felt = [person.number for person in tracks.people if person.number in walking and person.measured >= lately]
        is_sure = bool(own) or any(chances[number] >= self.sure for number in felt)
        for person in seen:
            if is_sure and person.confirmed and chances[person.number] <= 1.0 - self.sure:
                known = self._other(known, person, variance)
        return known

    def _passed(
        self, known: Likeness, people: dict[int, Person], tracks: Tracks, walking: AbstractSet[int]
    ) -> dict[int, float]:
        """Return the tracks' probabilities before the frame's boxes; `walking` are those whose legs go on."""
        stamp = tracks.stamp or 0.0
        chances = {number: chance for number, chance in known.chances if number in people}
        gone = {person.number for person in people.values() if self._is_gone(person, tracks, walking)}
        chances = self._stayed(chances, tracks, walking, gone)
        lost_s = stamp - known.at
        share = min(max(lost_s - self.unseen_s, 0.0) / self.fades_s, 1.0) / 2
        for number, person in people.items():
            if number in chances:
                continue
            taken = share if self._reaches(known, person, lost_s) else 0.0
            absent = max(1.0 - sum(chances.values()), 0.0)
            leaving = gone & chances.keys()
            chances[number] = taken * (absent + sum(chances[other] for other in leaving))
            for other in leaving:
                chances[other] *= 1.0 - taken
        measured = [person for person in people.values() if stamp - person.measured <= self.unseen_s]
        absent = max(1.0 - sum(chances.values()), 0.0)
        for person in measured:
            # A track may have gone over to the person; their own may have been doubted for a box that was nobody's.
            if person.number == known.traits.number or self._reaches(known, person, lost_s):
                chances[person.number] += self.passes * absent
        for left, right in itertools.combinations(measured, 2):
            if separation(left, right) < self.meets and not {left.number, right.number} <= walking:
                passing = math.dist(left.track.mean[2:], right.track.mean[2:]) * tracks.period
                rate = min(self.passes + self.swaps * passing, 0.5)
                swapped = rate * (chances[right.number] - chances[left.number])
                chances[left.number] += swapped
                chances[right.number] -= swapped
        return chances

    def _stayed(
        self, chances: dict[int, float], tracks: Tracks, walking: AbstractSet[int], gone: AbstractSet[int]
    ) -> dict[int, float]:
        """Return what each track keeps of its probability, and gets from tracks whose legs may be its own."""
        stamp, gains = tracks.stamp or 0.0, dict.fromkeys(chances, 0.0)
        people = {person.number: person for person in tracks.people}
        for number, chance in chances.items():
            person = people[number]
            if number in gone:
                leaves = 1.0 - math.exp(-tracks.period / self.fades_s)
            elif number in walking:
                leaves = 0.0
            else:
                leaves = self.strained if person.strained and person.seen == stamp else self.passes
            gains[number] -= leaves * chance
            beside = self._beside(person, tracks) if number in gone and stamp - person.measured <= self.unseen_s else []
            takes = [other.number for other in beside if other.number in chances]
            for other in takes:
                gains[other] += leaves * chance / len(takes)
        return {number: chance + gains[number] for number, chance in chances.items()}

    def _reaches(self, known: Likeness, person: Person, lost_s: float) -> bool:
        """Whether the person followed, lost for `lost_s` [s], can have walked to where a track is."""
        return math.dist(person.track.place, known.place) < self.reach + self.speed * lost_s

    def _is_gone(self, person: Person, tracks: Tracks, walking: AbstractSet[int]) -> bool:
        """Whether a track is not measured, or only by legs that may be those of somebody beside it."""
        stamp = tracks.stamp or 0.0
        lost, unseen = stamp - person.measured > self.unseen_s, stamp - person.seen > self.unseen_s
        if lost or not unseen or person.number in walking:
            return lost
        beside = [mover.track.place for mover in tracks.movers if mover.number != person.number]
        here = person.track.place
        near = min([math.dist(here, place) for place in beside], default=math.inf) < self.meets
        return near or bool(self._beside(person, tracks))

    def _walks_on(self, person: Person, tracks: Tracks) -> bool:
        """Whether the scan shows that a track's legs are those they were, with nobody's beside them to change with."""
        others = [mover.track.place for mover in tracks.movers if mover.left and mover.number != person.number]
        kept = [mover for mover in tracks.movers if mover.number == person.number]
        own = [mover.track.place for mover in kept if mover.felt - mover.named >= self.legs_s]
        return any(all(math.dist(here, place) > self.legs_apart for place in others) for here in own)

    def _beside(self, person: Person, tracks: Tracks) -> list[Person]:
        """Return everyone who is so near that a person's box may show both or the other."""
        lately = (tracks.stamp or 0.0) - self.unseen_s
        others = [other for other in tracks.people if other is not person and other.measured >= lately]
        return [other for other in others if separation(other, person) <= self.meets]

    def _evidence(
        self, own: Traits, others: Sequence[Traits], person: Person, variance: float, *, first: bool
    ) -> float:
        """Return how much more likely a person's last box is on the person followed than on another [log-odds]."""
        same = self._fit(person, own, variance, first=first)
        fits = [self._fit(person, traits, variance, first=first) for traits in (None, *others)]
        # Of a track that begins, anybody who is about is as likely as the person; then whoever fits best is left.
        strange = math.log(sum(map(math.exp, fits))) if first else max(fits)
        return min(max(same - strange, -self.most), self.most)

    def _fit(self, person: Person, traits: Traits | None, variance: float, *, first: bool) -> float:
        """Return how likely a person's last box is on one who looks like this, or on anybody [log]."""
        clothes = stature = 0.0
        if person.worn is not None:
            # The density of six numbers falls with the cube of their variance.
            strange = self.strange * variance**3
            same = strange
            if traits is not None and traits.clothes is not None:
                off = float(((traits.clothes - person.worn) ** 2).sum()) / variance
                same = (1.0 - self.odd) * math.exp(-off / 2) + self.odd * strange
            clothes = math.log(same)
        if person.tall is not None and traits is None:
            stature = math.log(self.strange_stature)
        elif person.tall is not None and traits is not None:
            same = math.exp(-((math.log(person.tall / traits.window) / self.stature_sigma) ** 2) / 2)
            stature = math.log((1.0 - self.odd_stature) * same + self.odd_stature * self.strange_stature)
        return clothes + stature if first else self.again * clothes + self.steady * stature

    def _other(self, known: Likeness, person: Person, variance: float) -> Likeness:
        """Learn what another person looks like, who is seen beside the one followed."""
        others = {traits.number: traits for traits in known.others}
        # By the boxes themselves: the track may have been another person's.
        learnt = self._moved(others.pop(person.number, Traits(person.number, None, person.window)), person, variance)
        return replace(known, others=(*others.values(), learnt)[-self.remembered :])

    def _told_apart(self, other: Traits, own: Traits, variance: float) -> Traits:
        """Return another's traits, with the person's own shirt or trousers where these do not clearly differ.

        What little they differ by is light, the same in every frame, and would soon add up to a proof.
        """
        if other.clothes is None or own.clothes is None:
            return other
        same = ((other.clothes - own.clothes) ** 2).sum(axis=1) < self.clear * variance
        return replace(other, clothes=np.where(same[:, None], own.clothes, other.clothes))

    def _moved(self, traits: Traits, person: Person, variance: float) -> Traits:
        rate = max(self.rate, 1.0 / (traits.boxes + 1))
        clothes, window, first = traits.clothes, traits.window, traits.first
        if person.worn is not None and len(first) < self.voters:
            first = (*first, person.worn)
            clothes = np.asarray(np.median(first, axis=0))
        elif person.worn is not None and clothes is not None:
            clothes = mixed(clothes, person.worn, rate, self.clear * variance)
        if person.tall is not None and abs(math.log(person.tall / window)) < self.stature_sigma:
            window += rate * (person.tall - window)
        return Traits(person.number, clothes, window, traits.boxes + 1, first)
