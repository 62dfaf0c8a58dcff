"""What to do without a person to follow: turn in place, to one side."""

from __future__ import annotations

from dataclasses import dataclass

from limo_hog.follow.decision import Mode
from limo_hog.follow.parameters import bounded
from limo_hog.follow.twist import Twist


@dataclass(frozen=True, slots=True)
class Search:
    """Turns the robot until a person is found.

    Attributes
    ----------
    rate
        Turn rate [rad/s]. Chosen: a full turn in 9 s; in it the image moves by 31 px a frame, and everything is in view
        for 17 frames, more than the 12 that confirm a person.
    after_s
        How long to face the predicted position of an unmeasured person before searching [s]. Chosen: a person passes
        behind a pillar within 2 s. Behind something wider than that, `Detour.hides` extends the wait.
    """

    rate: float = bounded(0.7, 0, 3)
    after_s: float = bounded(2.0, 0, 30)

    def command(self, side: float, *, lost: bool, other_in_view: bool) -> tuple[Twist, Mode, str]:
        """Return the command, the mode and the reason.

        Parameters
        ----------
        side
            1 to turn left, -1 right.
        lost
            Whether a person was followed before.
        other_in_view
            Whether a person is in view who is not the one followed before.
        """
        turn = Twist(0.0, side * self.rate)
        if other_in_view:
            return turn, Mode.LOST, "searching for the lost person: another is in view"
        if lost:
            return turn, Mode.LOST, "searching for the lost person"
        return turn, Mode.SEARCH, "searching for a person"
