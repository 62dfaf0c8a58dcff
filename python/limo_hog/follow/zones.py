"""What a distance means to a person: Hall's zones."""

from __future__ import annotations

from enum import Enum


class Zone(str, Enum):
    """Hall's zones of personal space (The Hidden Dimension, 1966), nearest first."""

    INTIMATE = "intimate"
    PERSONAL = "personal"
    SOCIAL = "social"
    PUBLIC = "public"


#: Where each zone but the last ends [m].
ZONE_ENDS = {Zone.INTIMATE: 0.45, Zone.PERSONAL: 1.2, Zone.SOCIAL: 3.6}


def zone_of(distance: float) -> Zone:
    """Return the zone of a person `distance` [m] away."""
    for zone, end in ZONE_ENDS.items():
        if distance <= end:
            return zone
    return Zone.PUBLIC
