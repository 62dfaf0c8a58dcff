"""The social force model of pedestrians: accelerations, as a pure function of where people are and want to go.

D. Helbing and P. Molnár, "Social force model for pedestrian dynamics", Physical Review E 51 (1995) 4282-4286, with its
parameters for an adult. A person of another stature is that adult scaled: lengths and speeds by the ratio of statures,
times as they are. People who touch are pushed apart as in D. Helbing, I. Farkas and T. Vicsek, "Simulating dynamical
features of escape panic", Nature 407 (2000) 487-490; the model of 1995 knows points alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

# Lengths below this are taken for it [m]: a direction needs two points that differ.
_TINY = 1e-6


@dataclass(frozen=True, slots=True)
class SocialForce:
    """Parameters of the model, for an adult; those without another origin are from the paper of 1995."""

    relaxation_s: float = 0.5  #: time in which people return to the velocity they want, τ [s]
    #: repulsion, repulsion_m: potential between two people, V⁰ [m²/s²], and how far it reaches, σ [m]
    repulsion: float = 2.1
    repulsion_m: float = 0.3
    step_s: float = 2.0  #: how far people look ahead at the steps of others, Δt [s]
    #: border, border_m: potential of a wall or an obstacle, U⁰ [m²/s²], and how far it reaches, R [m]
    border: float = 10.0
    border_m: float = 0.2
    sight: float = math.radians(100.0)  #: half of the angle of sight, φ [rad]
    behind: float = 0.5  #: weight of what lies outside it, c [1]
    top_speed: float = 1.3  #: highest speed, relative to the speed wanted [1]
    stiffness: float = 1500.0  #: of bodies that touch, k / m [1/s²]: 1.2·10⁵ kg/s² over 80 kg in the paper of 2000
    adult_m: float = 1.72  #: stature of the adult [m]. Chosen: between the mean statures of women and men in Europe.
    #: Radius of the body, relative to the stature [1]: half of the shoulders' breadth in `person.body`.
    body: float = 0.13


@dataclass(frozen=True, slots=True)
class People:
    """Who and what moves in the room at one instant; the first n are the people who feel forces."""

    #: position, velocity: float64 (m, 2) [m], [m/s]
    position: F64
    velocity: F64
    radius: F64  #: float64 (m,), of the bodies [m]
    height: F64  #: float64 (n,), statures of those who feel forces [m]
    wanted: F64  #: float64 (n, 2): the velocities that those who feel forces want [m/s]
    ahead: F64  #: float64 (n, 2): unit vectors in which they look


def acceleration(people: People, away: F64, hidden: NDArray[np.bool_], model: SocialForce) -> F64:
    """Return what the first n people feel: float64 (n, 2) [m/s²].

    `away`, float64 (n, k, 2), is from the nearest point of each obstacle to each person [m], inf where one does not
    count. Where `hidden`, bool (n, m), the person does not see the other, or does not care: it has no effect.
    """
    count = len(people.wanted)
    driven = (people.wanted - people.velocity[:count]) / model.relaxation_s
    scale = people.height / model.adult_m
    return driven + from_others(people, scale, hidden, model) + from_borders(away, scale, model)


def from_borders(away: F64, scale: F64, model: SocialForce) -> F64:
    """Return the repulsion by obstacles: float64 (n, 2) [m/s²]; `away` as in `acceleration`."""
    gap = np.hypot(away[..., 0], away[..., 1])
    counts = np.isfinite(gap)
    gap = np.where(counts, np.maximum(gap, _TINY), 1.0)
    size = scale[:, None]
    strength = np.where(counts, size * model.border / model.border_m * np.exp(-gap / (size * model.border_m)), 0.0)
    return np.asarray((np.where(counts[..., None], away, 0.0) * (strength / gap)[..., None]).sum(axis=1))


def from_others(people: People, scale: F64, hidden: NDArray[np.bool_], model: SocialForce) -> F64:
    """Return the repulsion by what else moves: float64 (n, 2) [m/s²]; `hidden` as in `acceleration`."""
    count, everyone = len(people.wanted), len(people.position)
    size = scale[:, None]
    apart = people.position[:count, None] - people.position[None, :]
    step = people.velocity * model.step_s
    gap = np.maximum(np.hypot(apart[..., 0], apart[..., 1]), _TINY)
    later = apart - step[None, :]
    gap_later = np.maximum(np.hypot(later[..., 0], later[..., 1]), _TINY)
    # Equipotential lines are ellipses; foci: the other, and the other one step ahead; b: half minor axis.
    both = gap + gap_later
    half_minor = np.maximum(0.5 * np.sqrt(np.maximum(both**2 - (step**2).sum(axis=1)[None, :], 0.0)), _TINY)
    strength = size * model.repulsion / model.repulsion_m * np.exp(-half_minor / (size * model.repulsion_m))
    slope = (both / (4.0 * half_minor))[..., None] * (apart / gap[..., None] + later / gap_later[..., None])
    force = strength[..., None] * slope
    towards = -(people.ahead[:, None] * force).sum(axis=2)
    seen = towards >= np.hypot(force[..., 0], force[..., 1]) * math.cos(model.sight)
    force *= np.where(seen, 1.0, model.behind)[..., None]
    touching = people.radius[:count, None] + people.radius[None, :] - gap
    force += (model.stiffness * np.maximum(touching, 0.0) / gap)[..., None] * apart
    itself = np.arange(everyone)[None, :] == np.arange(count)[:, None]
    return np.asarray(np.where((itself | hidden)[..., None], 0.0, force).sum(axis=1))
