"""The inertial measurement unit: turn rates and accelerations in the robot's frame at 100 Hz."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_sim.world.scenario import Imu

RATE_HZ = 100.0
"""As on the Limo."""
GRAVITY = 9.80665
"""Standard gravity [m/s²] (CGPM 1901)."""


@dataclass(frozen=True, slots=True)
class ImuReading:
    """One sample."""

    stamp: float  #: when it was taken [s]
    angular_velocity: tuple[float, float, float]  #: about x, y, z [rad/s]
    #: Along x, y, z, gravity's reaction included: a robot at rest reads +9.8 on z [m/s²].
    acceleration: tuple[float, float, float]


def samples(
    stamp: float, turn_rate: float, forward: float, sideways: float, settings: Imu, noise: np.random.Generator
) -> tuple[ImuReading, ...]:
    """Measure a true turn rate [rad/s] and accelerations along x and y [m/s²] twice, the second time at `stamp` [s]."""
    readings = []
    for at in (stamp - 1 / RATE_HZ, stamp):
        roll, pitch, yaw = (settings.gyro_noise * noise.standard_normal(3)).tolist()
        x, y, z = (settings.accel_noise * noise.standard_normal(3)).tolist()
        rates, accelerations = (roll, pitch, turn_rate + yaw), (forward + x, sideways + y, GRAVITY + z)
        readings.append(ImuReading(at, rates, accelerations))
    return tuple(readings)
