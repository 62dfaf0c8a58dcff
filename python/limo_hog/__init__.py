"""OpenCV's HOG people detector, many times faster, and a follower to use it with."""

from __future__ import annotations
