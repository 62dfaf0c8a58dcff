"""The tracking controller stays with the person it began with, and knows them again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tests.follow.control.driven import CONTROLLER, run
from tests.follow.views import GREEN, RED, World

from limo_hog.detections import Detections
from limo_hog.follow import Mode, Observation, Odometry
from limo_hog.follow.control.selection import TrackingState
from limo_hog.follow.sense.observation import clothes_in


def together(one: Detections, two: Detections) -> Detections:
    return Detections(np.concatenate([one.windows, two.windows]), np.concatenate([one.scores, two.scores]))


def test_it_stays_with_the_person_it_began_with() -> None:
    world = World()
    state = run(world, 5.0).state
    mine = state.choice.number
    for _ in range(20):
        x, y = world.person
        other = World(person=(x + 0.5, y - 0.8), robot=world.robot, time=world.time)
        view, second = world.observe(), other.observe(score=5.0).detections
        assert len(second) == 1
        decision = CONTROLLER.step(replace(view, detections=together(second, view.detections)), state)
        state = decision.state
        world.time += 0.1
        assert state.choice.number == mine
        assert decision.target == 1


def seen_in(view: Observation, shirt: tuple[int, int, int]) -> Observation:
    """The same view with a colour image, in which whoever is seen wears a shirt."""
    image = np.full((480, 640, 3), shirt, np.uint8)
    return replace(view, clothes=clothes_in(image, view.detections.windows))


def lost(world: World) -> TrackingState:
    """Follow a person in red, who goes out of sight to the right for 9 s."""
    state = CONTROLLER.start()
    for _ in range(130):
        view = seen_in(world.observe(visible=world.time < 4.0), RED)
        decision = CONTROLLER.step(view, state)
        state = decision.state
        world.time += world.period
    assert decision.mode is Mode.LOST
    assert "lost person" in decision.reason
    return state


def test_a_person_in_other_clothes_is_not_the_lost_one_until_long_after() -> None:
    world = World()
    state = lost(world)
    parted = 4.0
    while world.time < parted + CONTROLLER.selection.reidentify_s - 0.1:
        decision = CONTROLLER.step(seen_in(world.observe(), GREEN), state)
        state = decision.state
        assert decision.target is None
        assert "another is in view" in decision.reason
        world.time += world.period
    world.time += 0.5
    decision = CONTROLLER.step(seen_in(world.observe(), GREEN), state)
    assert decision.target == 0
    assert decision.reason == "following another person: the lost one was not found"
    for _ in range(30):
        world.time += world.period
        decision = CONTROLLER.step(seen_in(world.observe(), GREEN), decision.state)
    assert decision.reason == "following a person"


def test_a_person_who_wears_what_the_lost_person_wore_is_followed_at_once() -> None:
    world = World()
    state = lost(world)
    decision = CONTROLLER.step(seen_in(world.observe(), RED), state)
    assert decision.target == 0
    assert "turning to a possible person" in decision.reason


def test_without_a_colour_image_anybody_will_do_at_once() -> None:
    world = World()
    state = lost(world)
    assert CONTROLLER.step(world.observe(), state).target == 0


def test_between_two_alike_it_stands_and_looks_and_says_that_it_is_not_sure() -> None:
    world = World(person=(2.5, 0.0))
    state = run(world, 4.0).state
    other = World(person=(2.5, 0.9), robot=world.robot, time=world.time)
    for _ in range(8):
        view, second = world.observe(), other.observe()
        people = together(view.detections, second.detections)
        assert view.depth is not None
        assert second.depth is not None
        both = replace(view, detections=people, depth=np.minimum(view.depth, second.depth))
        state = CONTROLLER.step(both, state).state
        world.time, other.time = world.time + 0.1, other.time + 0.1
    one, two = (person.number for person in state.tracks.people)
    likeness = state.choice.likeness
    assert likeness is not None
    doubtful = replace(likeness, chances=((one, 0.5), (two, 0.45)))
    decision = CONTROLLER.step(
        replace(world.observe(), odometry=Odometry(world.time, *world.robot)),
        replace(state, choice=replace(state.choice, likeness=doubtful)),
    )
    assert decision.mode is Mode.HOLD
    assert decision.reason == "not sure which of 2 is the person followed"
    assert decision.twist.linear == 0
    # Both are kept in view: it turns to between them.
    assert decision.twist.angular > 0.1
    assert decision.target is None
    same = [round(person.same or 0.0, 1) for person in decision.belief.people]
    assert same == [0.5, 0.5] or same == [0.5, 0.4]
