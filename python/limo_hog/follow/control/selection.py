"""Which of the tracked people to follow: stay with one, and recognise them after a loss."""

from __future__ import annotations

from dataclasses import dataclass, replace

from limo_hog.follow.parameters import bounded
from limo_hog.follow.sense.appearance import Appearance, Clothes
from limo_hog.follow.tracks.person import Person, separation
from limo_hog.follow.tracks.tracker import Tracks


@dataclass(frozen=True, slots=True)
class Choice:
    """The person followed.

    Attributes
    ----------
    number
        Of the person; None while none is followed.
    clothes
        What the confirmed person followed last wears; None where no colour image tells.
    measured
        When that person was last measured [s]; None where none was followed yet.
    """

    number: int | None = None
    clothes: Clothes | None = None
    measured: float | None = None


@dataclass(frozen=True, slots=True)
class Selection:
    """Chooses the person to follow.

    Attributes
    ----------
    min_existence
        Probability from which a person too far away for HOG is worth driving nearer, and waiting for [1]. Chosen: three
        clear frames.
    max_unconfirmed_frames
        A track that is not confirmed after so many frames, and less likely than `min_existence`, is given up [1].
        Chosen: 3 s, longer than a person takes to be confirmed who is found in every third frame.
    reidentify_s
        How long to look for a lost person before one in other clothes is followed [s]. Chosen: two full turns of the
        search.
    same_place, speed
        A new track nearer than this to the lost person, and so much more for each second, may be the same person [m,
        m/s]. Chosen: a body's width, and a walk.
    lead
        Probability by which another must exceed the track that is faced already [1]. Chosen: one frame of evidence.
    """

    min_existence: float = bounded(0.4, 0, 1)
    max_unconfirmed_frames: int = bounded(30, 1, 1000)
    reidentify_s: float = bounded(20.0, 0, 600)
    same_place: float = bounded(0.5, 0, 5)
    speed: float = bounded(1.0, 0, 5)
    lead: float = bounded(0.1, 0, 1)

    def choose(self, tracks: Tracks, choice: Choice, wait_s: float, appearance: Appearance) -> Choice:
        """Stay with a confirmed person while they are tracked; else take the likeliest track in view.

        Parameters
        ----------
        wait_s
            A confirmed person is not given up for another before they are unmeasured for so long [s].
        """
        followed = tracks.person(choice.number)
        if followed is not None and followed.confirmed:
            choice = replace(choice, clothes=followed.clothes, measured=followed.measured)
        candidates = [
            one
            for one in tracks.in_view
            if self.is_candidate(one) and not self.is_stranger(one, tracks, choice, appearance)
        ]
        if followed is not None and followed.confirmed:
            lost_s = followed.track.stamp - followed.measured
            if lost_s <= wait_s:
                return choice
            # A track that begins where the lost person can have walked to is taken for them.
            reach = self.same_place + self.speed * lost_s
            candidates = [one for one in candidates if separation(one, followed) < reach]
            if not candidates:
                return choice
        elif (
            followed is not None
            and self.is_candidate(followed)
            and not self.is_stranger(followed, tracks, choice, appearance)
        ):
            candidates.append(followed)
        if not candidates:
            return replace(choice, number=None)
        best = max(candidates, key=lambda one: one.existence + self.lead * (one is followed))
        return replace(choice, number=best.number)

    def is_candidate(self, person: Person) -> bool:
        """Whether a track is a person, or may yet turn out to be one."""
        return person.confirmed or person.age < self.max_unconfirmed_frames or person.existence > self.min_existence

    def is_stranger(self, person: Person, tracks: Tracks, choice: Choice, appearance: Appearance) -> bool:
        """Whether a person wears other clothes than the lost one, and it is too early to follow another."""
        if choice.measured is None or tracks.stamp is None:
            return False
        early = tracks.stamp - choice.measured <= self.reidentify_s
        return early and appearance.is_other(choice.clothes, person.clothes)
