"""Right nodes, and others with one mistake each: three by people who knew the tutorials alone, and changes of nodes."""

import csv
import re
from pathlib import Path

from limo_hog.cli.main import main
from limo_sim.workshop import solution
from limo_sim.workshop.check import Verdict, examine

#: The workshop's own solution: most of the nodes below are it with a few lines exchanged.
FOLLOWER = solution("follower")

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


def checked(folder: Path, text: str, exercise: str = "follower") -> list[Verdict]:
    (folder / "node.py").write_text(text, encoding="utf-8")
    return examine(folder / "node.py", exercise).verdicts


def written(folder: Path, **texts: str) -> Path:
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    return folder


def table_of(folder: Path, *options: str) -> dict[str, dict[str, str]]:
    """Grade a folder by the command line; return its rows by file."""
    table = folder.parent / f"{folder.name}.csv"
    assert main(["workshop", "grade", str(folder), "--csv", str(table), *options]) == 0
    return {row["file"]: row for row in csv.DictReader(table.read_text(encoding="utf-8").splitlines())}


def exchanged(text: str, exchanges: str) -> str:
    """Exchange "old → new", one a line, in a node's text; ⏎ begins a line, in `new` as deep as that of `old`."""
    for exchange in filter(None, map(str.strip, re.sub(r"\n *⏎", "⏎", exchanges).splitlines())):
        old, new = exchange.split(" → ")
        old = old.replace("⏎", "\n")
        assert text.count(old) == 1, (text.count(old), old)
        line = text[: text.index(old)].rpartition("\n")[2] + old
        text = text.replace(old, new.replace("⏎", "\n" + " " * (len(line) - len(line.lstrip()))))
    return text


def nodes(exercise: str, template: str, table: str) -> dict[str, tuple[str, str]]:
    """Return each node's exercise and text, by its name: what is exchanged in the template stands below the name."""
    entries = (entry.partition("\n") for entry in re.split(r"\n(?=\S)", table.strip("\n")))
    return {name: (exercise, exchanged(template, exchanges).lstrip("\n")) for name, _, exchanges in entries}


#: The callback keeps the newest message; a timer works on it.
TIMER = """
    self.bridge = CvBridge() → self.bridge = CvBridge()⏎self.msg = None⏎self.create_timer(1 / RATE, self.tick)
    def on_image(self, message): → def on_image(self, message):⏎    self.msg = message⏎⏎def tick(self):
        ⏎    message = self.msg⏎    if message is None:⏎        return
"""
TIMERS = "\n".join(f"timer of {hertz} Hz{TIMER.replace('RATE', str(hertz))}" for hertz in (3, 5, 10, 20, 30))

RIGHT = {
    **nodes("follower", FUNCTIONS, "functions and spin_once"),
    **nodes("follower", THREADS, "threads\ntimer of 20 Hz in threads\n  create_timer(0.1 → create_timer(0.05"),
    **nodes("follower", FOLLOWER, TIMERS),
    **nodes(
        "follower",
        FOLLOWER,
        """
coroutine
    def on_image → async def on_image
TwistStamped
    import Twist → import Twist, TwistStamped
    self.create_publisher(Twist, → self.create_publisher(TwistStamped,
    def show → def send(self, twist):⏎    stamped = TwistStamped(twist=twist)
        ⏎    stamped.header.stamp = self.get_clock().now().to_msg()⏎    stamped.header.frame_id = 'base_link'
        ⏎    self.commands.publish(stamped)⏎⏎def show
    self.commands.publish(Twist()) → self.send(Twist())
    self.commands.publish(twist) → self.send(twist)
compressed
    import Image → import CompressedImage
    (Image, '/limo_camera/image' → (CompressedImage, '/limo_camera/image/compressed'
    self.bridge.imgmsg_to_cv2(message, → self.bridge.compressed_imgmsg_to_cv2(message,
crop of the rows
    detectMultiScale(image, → detectMultiScale(image[60:440],
    scale=1.05) → scale=1.05)⏎boxes = [(x, y + 60, w, h) for x, y, w, h in boxes]
crop of the columns
    detectMultiScale(image, → detectMultiScale(image[:, 20:620].copy(),
    scale=1.05) → scale=1.05)⏎boxes = [(x + 20, y, w, h) for x, y, w, h in boxes]
enlarged copy
    detectMultiScale(image, → detectMultiScale(cv2.resize(image, None, fx=1.5, fy=1.5),
    scale=1.05) → scale=1.05)⏎boxes = [[int(side / 1.5) for side in box] for box in boxes]
grey copy
    detectMultiScale(image, → detectMultiScale(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY),
limo_hog's PeopleDetector
    import cv2 → import cv2⏎import limo_hog
    cv2.HOGDescriptor() → limo_hog.PeopleDetector()
    self.hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector()) → pass
    boxes, weights = → found =
    .detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05) → .detect(image)
        ⏎boxes, weights = found.boxes, found.scores
limo_hog's HOGDescriptor
    import cv2 → import cv2⏎import limo_hog
    cv2.HOGDescriptor() → limo_hog.HOGDescriptor()
    cv2.HOGDescriptor_getDefaultPeopleDetector() → limo_hog.HOGDescriptor_getDefaultPeopleDetector()
turns first, then drives
    = self.speed → = 0.2 if abs(error) < 60 else 0.0
slower off centre
    = self.speed → = 0.2 * float(1 - abs(error) / 320)
logs every tenth image
    self.get_logger() → self.n = getattr(self, 'n', 0) + 1⏎if self.n % 10 == 1:⏎    self.get_logger()
tracker between detections
    self.bridge = CvBridge() → self.bridge = CvBridge()⏎self.n, self.tracker = 0, None
    self.hog.detectMultiScale( → self.find(
    def show → def find(self, image, **options):⏎    self.n += 1⏎    if self.n % 5 != 1 and self.tracker is not None:
        ⏎        ok, box = self.tracker.update(image)
        ⏎        return ([tuple(int(v) for v in box)], [1.0]) if ok else ([], [])
        ⏎    boxes, w = self.hog.detectMultiScale(image, **options)⏎    self.tracker = None⏎    if len(boxes):
        ⏎        self.tracker = cv2.TrackerMIL_create()
        ⏎        self.tracker.init(image, tuple(int(v) for v in boxes[int(np.argmax(w))]))⏎    return boxes, w⏎⏎def show
smoothed
    self.bridge = CvBridge() → self.bridge = CvBridge()⏎self.smooth = None
    middle - cx → self.smooth = float(middle - cx if self.smooth is None else 0.5 * (self.smooth + middle - cx))
    self.commands.publish(Twist()) → self.commands.publish(Twist())⏎self.smooth = None
draws by slices
    cv2.rectangle(picture, (x, y), (x + w, y + h), (0, 0, 255), 3) → x, y = max(x, 0), max(y, 0)⏎for d in (0, 1, 2):
        ⏎    picture[y + d, x:x + w] = picture[min(y + h + d, 479), x:x + w] = (0, 0, 255)
        ⏎    picture[y:y + h, x + d] = picture[y:y + h, min(x + w + d, 639)] = (0, 0, 255)
depth in a second window
    def show → def on_depth(self, message):⏎    metres = self.bridge.imgmsg_to_cv2(message)
        ⏎    grey = np.clip(np.nan_to_num(metres) / 8 * 255, 0, 255).astype(np.uint8)
        ⏎    cv2.imshow('depth', cv2.applyColorMap(grey, cv2.COLORMAP_JET))⏎⏎def show
    self.create_subscription(Image, → self.create_subscription(Image, '/limo_camera/depth/image_raw', self.on_depth, 10)
        ⏎self.create_subscription(Image,
""",
    ),
    **nodes(
        "proxemic",
        SEQUEL,
        """
sequel
sequel with a latched depth
    both = [ → self.depth = None⏎self.create_subscription(Image, '/limo_camera/depth/image_raw', self.keep, 10)
        ⏎self.create_subscription(Image, '/limo_camera/image', self.see, 10)⏎return⏎both = [
    def both( → def keep(self, message):⏎    self.depth = message⏎⏎def see(self, message):
        ⏎    if self.depth is not None:⏎        self.both(message, self.depth)⏎⏎def both(
sequel by a timer of 15 Hz
    both = [ → self.pair = None⏎self.create_timer(1 / 15, self.tick)⏎both = [
    self.step(self → self.pair = (self
    def away( → def tick(self):⏎    if self.pair:⏎        self.step(*self.pair)⏎⏎def away(
sequel, a percentile of a larger patch
    y - 10):y + 10, max(0, x - 10):x + 10] → y - 15):y + 15, max(0, x - 8):x + 8]
    np.median(good) → np.percentile(good, 45)
""",
    ),
}

#: The task that should lose points stands first; `any`: whichever.
WRONG = {
    **nodes(
        "follower",
        FOLLOWER,
        """
1 a window three seconds late
    cv2.imshow('Camera', picture) → self.old = getattr(self, 'old', []) + [picture]
        ⏎cv2.imshow('Camera', self.old[-30:][0])
2 a number that was made up
    self.get_logger().info(f'Detections: {len(boxes)}') → self.n = getattr(self, 'n', 0) + 1⏎if self.n % 30 == 1:
        ⏎    self.get_logger().info('Detections: 1')
3 the last command again
    self.commands.publish(Twist()) → self.commands.publish(getattr(self, 'last', Twist()))
    self.commands.publish(twist) → self.last = twist⏎self.commands.publish(twist)
3 a timer that always drives
    def show → def drive(self):⏎    twist = Twist()⏎    twist.linear.x = 0.2⏎    self.commands.publish(twist )⏎⏎def show
    self.bridge = CvBridge() → self.bridge = CvBridge()⏎self.create_timer(0.1, self.drive)
3 searches by turning
    self.commands.publish(Twist()) → twist = Twist()⏎twist.angular.z = 0.5⏎self.commands.publish(twist )
3 fails without a box
    len(boxes) == 0 → len(boxes) < 0
3 leftmost
    int(np.argmax(weights)) → min(range(len(boxes)), key=lambda i: boxes[i][0])
3 largest
    int(np.argmax(weights)) → max(range(len(boxes)), key=lambda i: boxes[i][2])
3 least sure
    int(np.argmax(weights)) → int(np.argmin(weights))
3 all red
    (0, 255, 0), 2) → (0, 0, 255), 2)
3 colours of RGB
    (0, 0, 255), 3) → (255, 0, 0), 3)
    6, (255, 0, 0), -1) → 6, (0, 0, 255), -1)
3 boxes of a second ago
    x, y, w, h = boxes[best] → self.past = (getattr(self, 'past', []) + [boxes[best]])[-10:]
        ⏎x, y, w, h = self.past[0]
4 drives back
    = self.speed → = -0.2
4 a gain too small
    self.gain * float → 0.0002 * float
4 steers by the blue shirt
    error = middle - cx → blue = (image[..., 0].astype(int) - image[..., 2] > 50).nonzero()[1]
        ⏎error = middle - blue.mean() if len(blue) else 0.0
""",
    ),
    "any the model solution, read": (
        "follower",
        "import importlib.resources as r\n"
        "exec((r.files('limo_sim.workshop') / 'nodes' / 'follower.solution.txt').read_text())\n",
    ),
    **nodes(
        "proxemic",
        SEQUEL,
        """
5 one pixel, unknown is nine metres
    return float(np.median(good)) if len(good) else None → one = float(depth[y, x])
        ⏎return one if np.isfinite(one) and one > 0 else 9.0
5 never back
    max(-0.3, → max(0.0,
""",
    ),
}
