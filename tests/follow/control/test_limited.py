"""The owner's limits slow the commands and keep their arc."""

from __future__ import annotations

import pytest
from tests.follow.loop import Loop
from tests.follow.views import look

from limo_hog.follow.control.limited import Limited
from limo_hog.follow.robot import Twist


@pytest.mark.parametrize(
    ("max_speed", "max_turn", "wanted"),
    [(1.0, 1.0, Twist(0.5, 0.1)), (0.25, 1.0, Twist(0.25, 0.05)), (1.0, 0.02, Twist(0.1, 0.02))],
)
def test_what_is_too_fast_is_slowed_on_the_same_arc(max_speed: float, max_turn: float, wanted: Twist) -> None:
    limited = Limited(Loop(), max_speed, max_turn)
    decision = limited.step(look(), limited.start())
    assert (decision.twist.linear, decision.twist.angular) == pytest.approx((wanted.linear, wanted.angular))
    assert (decision.state, decision.reason) == (1, "step 0")
