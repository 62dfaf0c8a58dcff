# ruff: noqa: E501
"""Sixty nodes by people who knew the tutorials alone: thirty right ones, and thirty with one mistake each.

A node is a template and what is exchanged in it. All were written before the checker was read, and are not fitted to
it.
"""

from __future__ import annotations

from typing import Any

#: A class that does all in the callback of the image.
CALLBACK = """
import cv2
import numpy as np
import rclpy
from cv_bridge import CvBridge
from geometry_msgs.msg import Twist
from rclpy.node import Node
from sensor_msgs.msg import Image


class Finder(Node):
    def __init__(self):
        super().__init__("finder")
        self.br = CvBridge()
        self.det = cv2.HOGDescriptor()
        self.det.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
        self.n = 0
        self.pub = self.create_publisher(Twist, "/cmd_vel", 10)
        self.sub = self.create_subscription(Image, "/limo_camera/image", self.image_cb, 10)

    def find(self, img):
        rects, w = self.det.detectMultiScale(img, winStride=(8, 8), padding=(4, 4), scale=1.05)
        return [tuple(int(v) for v in r) for r in rects], [float(v) for v in np.ravel(w)]

    def choose(self, rects, weights):
        return int(np.argmax(weights))

    def paint(self, canvas, rects, best):
        for x, y, w, h in rects:
            cv2.rectangle(canvas, (x, y), (x + w, y + h), (0, 255, 0), 2)
        x, y, w, h = rects[best]
        cv2.rectangle(canvas, (x, y), (x + w, y + h), (0, 0, 255), 3)
        cv2.circle(canvas, (x + w // 2, y + h // 2), 6, (255, 0, 0), -1)

    def nobody(self):
        self.pub.publish(Twist())

    def drive(self, error):
        t = Twist()
        t.linear.x = 0.2
        t.angular.z = 0.0 if abs(error) < 20 else 0.005 * error
        self.pub.publish(t)

    def window(self, canvas):
        cv2.imshow("Limo Camera", canvas)
        cv2.waitKey(1)

    def report(self, count):
        self.get_logger().info(f"Detections: {count}")

    def image_cb(self, msg):
        self.n += 1
        img = self.br.imgmsg_to_cv2(msg, "bgr8")
        self.work(img)

    def work(self, img):
        canvas = img.copy()
        rects, weights = self.find(img)
        self.report(len(rects))
        if len(rects) == 0:
            self.nobody()
            self.window(canvas)
            return
        best = self.choose(rects, weights)
        self.paint(canvas, rects, best)
        self.window(canvas)
        x, y, w, h = rects[best]
        self.drive(img.shape[1] / 2 - (x + w / 2))


def main(args=None):
    rclpy.init(args=args)
    node = Finder()
    rclpy.spin(node)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
"""

#: The callback keeps the newest message; a timer works on it.
TIMER = (
    CALLBACK,
    (
        "        self.n = 0\n",
        "        self.n = 0\n        self.msg = None\n        self.timer = self.create_timer(1 / RATE, self.tick)\n",
    ),
    (
        '        img = self.br.imgmsg_to_cv2(msg, "bgr8")\n        self.work(img)\n',
        "        self.msg = msg\n\n    def tick(self):\n        if self.msg is not None:\n"
        '            self.work(self.br.imgmsg_to_cv2(self.msg, "bgr8"))\n',
    ),
)

#: No class: functions around a node, which is spun once at a time.
FUNCTIONS = """
import cv2, numpy, rclpy
from cv_bridge import CvBridge
from geometry_msgs.msg import Twist
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image

newest = []
hog = cv2.HOGDescriptor()
hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())


def command(forward, turn):
    twist = Twist()
    twist.linear.x, twist.angular.z = float(forward), float(turn)
    return twist


def look(frame, log):
    boxes, sure = hog.detectMultiScale(frame, winStride=(4, 4), padding=(8, 8), scale=1.05)
    log.info("Detections: %d" % len(boxes))
    if not len(boxes):
        log.warn("No person detected - stopping robot")
        return frame, command(0, 0)
    ranked = sorted(zip(numpy.ravel(sure).tolist(), boxes.tolist()), reverse=True)
    for rank, (_, (x, y, w, h)) in reversed(list(enumerate(ranked))):
        cv2.rectangle(frame, (x, y, w, h), (0, 255, 0) if rank else (0, 0, 255), 2)
    x, y, w, h = ranked[0][1]
    cv2.drawMarker(frame, (x + w // 2, y + h // 2), (255, 0, 0), cv2.MARKER_SQUARE, 8, 8)
    off = frame.shape[1] // 2 - (x + w // 2)
    return frame, command(0.2, 0 if abs(off) < 20 else numpy.clip(0.005 * off, -0.8, 0.8))


def main():
    rclpy.init()
    node = rclpy.create_node("plain")
    bridge = CvBridge()
    out = node.create_publisher(Twist, "/cmd_vel", 1)
    node.create_subscription(Image, "/limo_camera/image", newest.append, qos_profile_sensor_data)
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=0.05)
        if newest:
            frame, twist = look(bridge.imgmsg_to_cv2(newest.pop(), "bgr8").copy(), node.get_logger())
            newest.clear()
            out.publish(twist)
            cv2.imshow("view", frame)
            cv2.waitKey(1)


if __name__ == "__main__":
    main()
"""

#: Seeing and driving apart, in threads of their own.
THREADS = """
import threading
import cv2
import numpy as np
import rclpy
from cv_bridge import CvBridge
from geometry_msgs.msg import Twist
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Image


class Eyes:
    def __init__(self):
        self.hog = cv2.HOGDescriptor()
        self.hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())

    def best(self, bgr):
        found, weights = self.hog.detectMultiScale(bgr, winStride=(8, 8), padding=(8, 8), scale=1.05)
        order = np.argsort(-np.ravel(weights)) if len(found) else []
        return [found[i] for i in order]


class Robot(Node):
    def __init__(self):
        super().__init__("robot")
        self.declare_parameter("gain", 0.005)
        self.eyes, self.lock, self.bridge = Eyes(), threading.Lock(), CvBridge()
        self.error, self.seen = None, None
        self.create_subscription(Image, "/limo_camera/image", self.see, 10,
                                 callback_group=MutuallyExclusiveCallbackGroup())
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_timer(0.1, self.act, callback_group=MutuallyExclusiveCallbackGroup())

    def see(self, message):
        bgr = self.bridge.imgmsg_to_cv2(message, desired_encoding="bgr8")
        boxes = self.eyes.best(bgr)
        self.get_logger().info("Detections: " + str(len(boxes)))
        view, error = bgr.copy(), None
        for i, (x, y, w, h) in list(enumerate(boxes))[::-1]:
            cv2.rectangle(view, (x, y), (x + w, y + h), (0, 0, 255) if i == 0 else (0, 255, 0), 2)
        if boxes:
            x, y, w, h = boxes[0]
            cv2.circle(view, (int(x + w / 2), int(y + h / 2)), 5, (255, 0, 0), cv2.FILLED)
            error = view.shape[1] / 2 - (x + w / 2)
        with self.lock:
            self.error, self.seen = error, self.get_clock().now()
        cv2.imshow("robot", view)
        cv2.waitKey(1)

    def act(self):
        twist = Twist()
        with self.lock:
            fresh = self.seen is not None and (self.get_clock().now() - self.seen).nanoseconds < 3e8
            if self.error is not None and fresh:
                twist.linear.x = 0.2
                if abs(self.error) > 20:
                    twist.angular.z = self.get_parameter("gain").value * float(self.error)
        self.commands.publish(twist)


def main():
    rclpy.init()
    robot, executor = Robot(), MultiThreadedExecutor(3)
    executor.add_node(robot)
    try:
        executor.spin()
    finally:
        executor.shutdown()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
"""

#: The sequel: two topics, a distance.
SEQUEL = """
import cv2
import numpy as np
import rclpy
from cv_bridge import CvBridge
from geometry_msgs.msg import Twist
from message_filters import ApproximateTimeSynchronizer, Subscriber
from rclpy.node import Node
from sensor_msgs.msg import Image


class Keeper(Node):
    def __init__(self):
        super().__init__("keeper")
        self.goal = self.declare_parameter("target_distance", 1.5).value
        self.bridge, self.hog = CvBridge(), cv2.HOGDescriptor()
        self.hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
        self.pub = self.create_publisher(Twist, "/cmd_vel", 10)
        both = [Subscriber(self, Image, t) for t in ("/limo_camera/image", "/limo_camera/depth/image_raw")]
        self.sync = ApproximateTimeSynchronizer(both, 5, 0.08)
        self.sync.registerCallback(self.both)

    def both(self, rgb, depth):
        self.step(self.bridge.imgmsg_to_cv2(rgb, "bgr8"), self.bridge.imgmsg_to_cv2(depth, "32FC1"))

    def away(self, depth, x, y):
        patch = depth[max(0, y - 10):y + 10, max(0, x - 10):x + 10]
        good = patch[np.isfinite(patch) & (patch > 0.0)]
        return float(np.median(good)) if len(good) else None

    def speed(self, metres):
        return float(min(0.3, max(-0.3, 0.5 * (metres - self.goal))))

    def step(self, img, depth):
        boxes, weights = self.hog.detectMultiScale(img, winStride=(8, 8), padding=(4, 4), scale=1.05)
        self.get_logger().info(f"Detections: {len(boxes)}")
        canvas, out = img.copy(), Twist()
        if len(boxes):
            for x, y, w, h in boxes:
                cv2.rectangle(canvas, (x, y), (x + w, y + h), (0, 255, 0), 2)
            x, y, w, h = (int(v) for v in boxes[int(np.argmax(weights))])
            cv2.rectangle(canvas, (x, y), (x + w, y + h), (0, 0, 255), 2)
            u, v = x + w // 2, y + h // 2
            cv2.circle(canvas, (u, v), 6, (255, 0, 0), -1)
            metres = self.away(depth, u, v)
            if metres is not None:
                out.linear.x = self.speed(metres)
                out.angular.z = float(np.clip(0.005 * (img.shape[1] / 2 - u), -0.8, 0.8))
                cv2.putText(canvas, f"{metres:.2f} m", (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255))
        self.pub.publish(out)
        cv2.imshow("Keeper", canvas)
        cv2.waitKey(1)


def main():
    rclpy.init()
    rclpy.spin(Keeper())


if __name__ == "__main__":
    main()
"""

WORK = "        self.work(img)\n"
FIND = CALLBACK[CALLBACK.index("        rects, w = self.det") : CALLBACK.index("    def choose")]
DRIVE = CALLBACK[CALLBACK.index("        t = Twist()\n") : CALLBACK.index("    def window")]
NOBODY = "        self.pub.publish(Twist())\n"
CHOOSE = "        return int(np.argmax(weights))\n"
TURN = "0.0 if abs(error) < 20 else 0.005 * error"
LIST = "        return [tuple(int(v) for v in r) for r in rects], [float(v) for v in np.ravel(w)]\n"
RED = "        cv2.rectangle(canvas, (x, y), (x + w, y + h), (0, 0, 255), 3)\n"
HOG = (
    "        self.det = cv2.HOGDescriptor()\n"
    "        self.det.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())\n"
)
SUBSCRIBE = 'self.create_subscription(Image, "/limo_camera/image", self.image_cb, 10)'
STAMPED = (
    ("from geometry_msgs.msg import Twist\n", "from geometry_msgs.msg import Twist, TwistStamped\n"),
    ("self.create_publisher(Twist,", "self.create_publisher(TwistStamped,"),
    (
        "    def nobody(self):\n        self.pub.publish(Twist())\n",
        "    def send(self, twist):\n        stamped = TwistStamped()\n"
        "        stamped.header.stamp = self.get_clock().now().to_msg()\n        stamped.header.frame_id = 'base_link'\n"
        "        stamped.twist = twist\n        self.pub.publish(stamped)\n\n"
        "    def nobody(self):\n        self.send(Twist())\n",
    ),
    ("        self.pub.publish(t)\n", "        self.send(t)\n"),
)
TRACK = """        if self.n % 5 == 1 or self.tracker is None:
            rects, w = self.det.detectMultiScale(img, winStride=(8, 8), padding=(4, 4), scale=1.05)
            self.tracker = None
            if len(rects):
                self.tracker = cv2.TrackerMIL_create()
                self.tracker.init(img, tuple(int(v) for v in rects[int(np.argmax(w))]))
        else:
            ok, box = self.tracker.update(img)
            rects, w = ([box], [1.0]) if ok else ([], [])
"""
PEOPLE = """        found = self.det.detect(img)
        return [tuple(int(v) for v in b) for b in found.boxes], found.scores.tolist()

"""

#: What to check, the template, and what is exchanged in it.
Node = tuple[str, Any, tuple[tuple[str, str], ...]]


def scaled(by: float, back: str) -> tuple[tuple[str, str], ...]:
    """Return what makes the node search a copy of another size, and bring its boxes `back`."""
    return (
        ("self.det.detectMultiScale(img,", f"self.det.detectMultiScale(cv2.resize(img, None, fx={by}, fy={by}),"),
        (LIST, f"        return [tuple(int(v {back}) for v in r) for r in rects], [float(v) for v in np.ravel(w)]\n"),
    )


def rate(hertz: int) -> tuple[tuple[str, str], ...]:
    """Return what gives the timer a rate [Hz]."""
    return (("1 / RATE", f"1 / {hertz}"),)


RIGHT: dict[str, Node] = {
    "callback": ("", CALLBACK, ()),
    **{f"timer of {hertz} Hz": ("", TIMER, rate(hertz)) for hertz in (3, 5, 10, 20, 30)},
    "functions and spin_once": ("", FUNCTIONS, ()),
    "threads": ("", THREADS, ()),
    "timer of 20 Hz in threads": ("", THREADS, (("create_timer(0.1", "create_timer(0.05"),)),
    "coroutine": ("", CALLBACK, (("    def image_cb", "    async def image_cb"),)),
    "TwistStamped": ("", CALLBACK, STAMPED),
    "compressed": (
        "",
        CALLBACK,
        (
            ("import Image\n", "import CompressedImage\n"),
            (SUBSCRIBE, SUBSCRIBE.replace("Image, ", "CompressedImage, ").replace("/image", "/image/compressed")),
            ("self.br.imgmsg_to_cv2(msg,", "self.br.compressed_imgmsg_to_cv2(msg,"),
        ),
    ),
    "crop of the rows": (
        "",
        CALLBACK,
        (
            ("detectMultiScale(img,", "detectMultiScale(img[60:440],"),
            (
                LIST,
                "        return [(int(x), int(y) + 60, int(w_), int(h)) for x, y, w_, h in rects], list(np.ravel(w))\n",
            ),
        ),
    ),
    "crop of the columns": (
        "",
        CALLBACK,
        (
            ("detectMultiScale(img,", "detectMultiScale(img[:, 20:620].copy(),"),
            (
                LIST,
                "        return [(int(x) + 20, int(y), int(w_), int(h)) for x, y, w_, h in rects], list(np.ravel(w))\n",
            ),
        ),
    ),
    "enlarged copy": ("", CALLBACK, scaled(1.5, "/ 1.5")),
    "grey copy": (
        "",
        CALLBACK,
        (("detectMultiScale(img,", "detectMultiScale(cv2.cvtColor(img, cv2.COLOR_BGR2GRAY),"),),
    ),
    "limo_hog's PeopleDetector": (
        "",
        CALLBACK,
        (
            ("import cv2\n", "import cv2\nimport limo_hog\n"),
            (HOG, "        self.det = limo_hog.PeopleDetector()\n"),
            (FIND, PEOPLE),
        ),
    ),
    "limo_hog's windows": (
        "",
        CALLBACK,
        (
            ("import cv2\n", "import cv2\nimport limo_hog\n"),
            (HOG, "        self.det = limo_hog.PeopleDetector()\n"),
            (FIND, PEOPLE.replace("found.boxes", "found.windows")),
        ),
    ),
    "limo_hog's HOGDescriptor": (
        "",
        CALLBACK,
        (("import cv2\n", "import cv2\nimport limo_hog\n"), (HOG, HOG.replace("cv2.", "limo_hog."))),
    ),
    "turns first, then drives": ("", CALLBACK, (("t.linear.x = 0.2", "t.linear.x = 0.2 if abs(error) < 60 else 0.0"),)),
    "slower off centre": ("", CALLBACK, (("t.linear.x = 0.2", "t.linear.x = 0.2 * (1 - abs(error) / 320)"),)),
    "logs every tenth image": (
        "",
        CALLBACK,
        (("        self.get_logger()", "        if self.n % 10 == 1:\n            self.get_logger()"),),
    ),
    "tracker between detections": (
        "",
        CALLBACK,
        (("        self.n = 0\n", "        self.n = 0\n        self.tracker = None\n"), (FIND, TRACK + LIST + "\n")),
    ),
    "smoothed": (
        "",
        CALLBACK,
        (
            ("        self.n = 0\n", "        self.n = 0\n        self.smooth = None\n"),
            (
                "        t = Twist()\n",
                "        self.smooth = error if self.smooth is None else 0.5 * (self.smooth + error)\n"
                "        error = self.smooth\n        t = Twist()\n",
            ),
            (NOBODY, NOBODY + "        self.smooth = None\n"),
        ),
    ),
    "draws by slices": (
        "",
        CALLBACK,
        (
            (
                RED,
                "        x, y = max(x, 0), max(y, 0)\n        for d in (0, 1, 2):\n"
                "            canvas[y + d, x:x + w] = canvas[min(y + h + d, 479), x:x + w] = (0, 0, 255)\n"
                "            canvas[y:y + h, x + d] = canvas[y:y + h, min(x + w + d, 639)] = (0, 0, 255)\n",
            ),
        ),
    ),
    "depth in a second window": (
        "",
        CALLBACK,
        (
            (
                SUBSCRIBE,
                SUBSCRIBE + '\n        self.create_subscription(Image, "/limo_camera/depth/image_raw", self.dep, 10)',
            ),
            (
                "    def image_cb",
                "    def dep(self, msg):\n        metres = self.br.imgmsg_to_cv2(msg)\n"
                "        grey = np.clip(np.nan_to_num(metres) / 8 * 255, 0, 255).astype(np.uint8)\n"
                "        cv2.imshow('depth', cv2.applyColorMap(grey, cv2.COLORMAP_JET))\n\n    def image_cb",
            ),
        ),
    ),
    "sequel": ("sequel", SEQUEL, ()),
    "sequel with a latched depth": (
        "sequel",
        SEQUEL,
        (
            (
                "        both = [",
                "        self.depth = None\n        for t, f in (('/limo_camera/depth/image_raw', self.keep), "
                "('/limo_camera/image', self.see)):\n            self.create_subscription(Image, t, f, 10)\n        return\n"
                "        both = [",
            ),
            (
                "    def both(",
                "    def keep(self, message):\n        self.depth = message\n\n    def see(self, message):\n"
                "        if self.depth is not None:\n            self.both(message, self.depth)\n\n    def both(",
            ),
        ),
    ),
    "sequel by a timer of 15 Hz": (
        "sequel",
        SEQUEL,
        (
            ("        self.step(self", "        self.pair = (self"),
            (
                '(depth, "32FC1"))\n\n    def away',
                '(depth, "32FC1"))\n\n'
                "    def tick(self):\n        if self.pair:\n            self.step(*self.pair)\n\n    def away",
            ),
            (
                "        both = [",
                "        self.pair = None\n        self.create_timer(1 / 15, self.tick)\n        both = [",
            ),
        ),
    ),
    "sequel, a percentile of a larger patch": (
        "sequel",
        SEQUEL,
        (
            ("y - 10):y + 10, max(0, x - 10):x + 10]", "y - 15):y + 15, max(0, x - 8):x + 8]"),
            ("np.median(good)", "np.percentile(good, 45)"),
        ),
    ),
}

#: The task that should lose points stands first; an empty one: any.
WRONG: dict[str, Node] = {
    "1 no window": ("", CALLBACK, (('        cv2.imshow("Limo Camera", canvas)\n', ""),)),
    "1 a window three seconds late": (
        "",
        CALLBACK,
        (
            (
                '        cv2.imshow("Limo Camera", canvas)\n',
                '        self.old = getattr(self, "old", []) + [canvas]\n        cv2.imshow("Limo Camera", self.old[-30:][0])\n',
            ),
        ),
    ),
    "2 a number that was made up": (
        "",
        CALLBACK,
        (
            (
                '        self.get_logger().info(f"Detections: {count}")',
                "        if self.n % 30 == 1:\n            self.get_logger().info('Detections: 1')",
            ),
        ),
    ),
    "2 boxes of the enlarged copy": ("", CALLBACK, scaled(1.5, "* 1")),
    "2 float image": ("", CALLBACK, (("detectMultiScale(img,", "detectMultiScale(img / 255.0,"),)),
    "3 the last command again": (
        "",
        CALLBACK,
        (
            (NOBODY, "        self.pub.publish(getattr(self, 'last', Twist()))\n"),
            ("        self.pub.publish(t)", "        self.last = t\n        self.pub.publish(t)"),
        ),
    ),
    "3 a timer that always drives": (
        "",
        CALLBACK,
        (("        self.n = 0\n", "        self.n = 0\n        self.create_timer(0.1, lambda: self.drive(0))\n"),),
    ),
    "3 nothing is published": ("", CALLBACK, ((NOBODY, "        pass\n"),)),
    "3 searches by turning": (
        "",
        CALLBACK,
        ((NOBODY, "        t = Twist()\n        t.angular.z = 0.5\n        self.pub.publish(t)\n"),),
    ),
    "3 fails without a box": ("", CALLBACK, (("        if len(rects) == 0:", "        if len(rects) < 0:"),)),
    "3 leftmost": ("", CALLBACK, ((CHOOSE, "        return min(range(len(rects)), key=lambda i: rects[i][0])\n"),)),
    "3 largest": ("", CALLBACK, ((CHOOSE, "        return max(range(len(rects)), key=lambda i: rects[i][2])\n"),)),
    "3 first": ("", CALLBACK, ((CHOOSE, "        return 0\n"),)),
    "3 least sure": ("", CALLBACK, ((CHOOSE, "        return int(np.argmin(weights))\n"),)),
    "3 all red": ("", CALLBACK, (("(0, 255, 0), 2)", "(0, 0, 255), 2)"),)),
    "3 colours of RGB": (
        "",
        CALLBACK,
        ((RED, RED.replace("(0, 0, 255)", "(255, 0, 0)")), ("6, (255, 0, 0), -1)", "6, (0, 0, 255), -1)")),
    ),
    "3 no dot": ("", CALLBACK, (("        cv2.circle(canvas, (x + w // 2, y + h // 2), 6, (255, 0, 0), -1)\n", ""),)),
    "3 boxes of a second ago": (
        "",
        CALLBACK,
        (
            (
                "        self.paint(canvas, rects, best)\n",
                "        self.past = (getattr(self, 'past', []) + [rects[best]])[-10:]\n"
                "        self.paint(canvas, self.past[:1], 0)\n",
            ),
        ),
    ),
    "4 turns away": ("", CALLBACK, (("0.005 * error", "-0.005 * error"),)),
    "4 no dead-band": ("", CALLBACK, ((TURN, "0.005 * error"),)),
    "4 only turns": ("", CALLBACK, (("t.linear.x = 0.2", "t.linear.x = 0.0"),)),
    "4 drives back": ("", CALLBACK, (("t.linear.x = 0.2", "t.linear.x = -0.2"),)),
    "4 a gain too small": ("", CALLBACK, (("0.005 * error", "0.0002 * error"),)),
    "4 a command in eight": (
        "",
        CALLBACK,
        (("        self.pub.publish(t)", "        if self.n % 8 == 1:\n            self.pub.publish(t)"),),
    ),
    "4 sleeps": (
        "",
        CALLBACK,
        (("        self.pub.publish(t)", "        self.pub.publish(t)\n        __import__('time').sleep(0.2)"),),
    ),
    "4 steers by the blue shirt": (
        "",
        CALLBACK,
        (
            (
                "        self.drive(img.shape[1] / 2 - (x + w / 2))",
                "        blue = (img[..., 0].astype(int) - img[..., 2] > 50).nonzero()[1]\n"
                "        self.drive(img.shape[1] / 2 - blue.mean() if len(blue) else 0.0)",
            ),
        ),
    ),
    " best effort commands": (
        "",
        CALLBACK,
        (
            ("from rclpy.node", "from rclpy.qos import QoSProfile, ReliabilityPolicy\nfrom rclpy.node"),
            ('"/cmd_vel", 10)', '"/cmd_vel", QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))'),
        ),
    ),
    " the model solution, read": (
        "",
        (
            "import importlib.resources as r\n"
            "exec((r.files('limo_sim.workshop') / 'nodes' / 'follower.solution.txt').read_text())\n"
        ),
        (),
    ),
    "5 one pixel, unknown is nine metres": (
        "sequel",
        SEQUEL,
        (
            (
                "        return float(np.median(good)) if len(good) else None",
                "        one = float(depth[y, x])\n        return one if np.isfinite(one) and one > 0 else 9.0",
            ),
        ),
    ),
    "5 never back": ("sequel", SEQUEL, (("max(-0.3,", "max(0.0,"),)),
}


def source(node: Node) -> str:
    """Return the node's file."""
    _, template, exchanged = node
    text = template if isinstance(template, str) else template[0]
    for old, new in (*(() if isinstance(template, str) else template[1:]), *exchanged):
        assert text.count(old) == 1, (text.count(old), old)
        text = text.replace(old, new)
    return text.lstrip("\n")
