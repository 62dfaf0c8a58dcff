"""Runs a model node of the workshop under rclpy, whose cv_bridge and message_filters are in no package index.

Arguments: the node's file.
"""

import runpy
import sys
import types

import cv2

from limo_hog.ros2 import messages
from limo_sim.ros.companions import filters


class CvBridge:
    def imgmsg_to_cv2(self, message, _encoding):
        return messages.pixels_of(message).copy()


sys.modules["cv_bridge"] = types.SimpleNamespace(CvBridge=CvBridge)
sys.modules["message_filters"] = filters
cv2.imshow, cv2.waitKey = (lambda *_: None), (lambda _: -1)
runpy.run_path(sys.argv[1], run_name="__main__")
