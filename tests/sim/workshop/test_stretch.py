"""The stretch tasks' checks: a node that does the task has all points, the workshop's solution does not."""

import re
from pathlib import Path

import pytest
from tests.sim.workshop.strangers import FOLLOWER, checked, exchanged, nodes

from limo_hog.cli.main import main
from limo_sim.workshop import template

#: Nodes that do a task, or do it otherwise: by the public page's name of the depth image, or by a tracker from the
#: first box on, which looks at nobody else. The last one drives until the chair's legs, ahead or beside, are near.
DONE = nodes(
    "follower",
    FOLLOWER,
    """
a
    self.create_subscription(Image, → self.depth = None
        ⏎self.create_subscription(Image, '/limo_camera/depth/image_raw', self.on_depth, 10)
        ⏎self.create_subscription(Image,
    def on_image( → def on_depth(self, message):
        ⏎    self.depth = self.bridge.imgmsg_to_cv2(message, 'passthrough')⏎⏎def on_image(
    twist.linear.x = self.speed → cy = y + h // 2⏎patch = self.depth[cy - 10 : cy + 10, cx - 10 : cx + 10]
        ⏎distance = float(np.median(patch[np.isfinite(patch)]))
        ⏎twist.linear.x = float(np.clip(0.5 * (distance - 1.5), -0.3, 0.3))
b
    scale=1.05) → scale=1.05, groupThreshold=0)⏎boxes, weights = self.merge(boxes, np.ravel(weights))
    def show( → def merge(self, boxes, weights):⏎    kept = []⏎    for i in np.argsort(-weights):
        ⏎        x, y, w, h = boxes[i]
        ⏎        for u, v, a, b in boxes[kept]:
        ⏎            shared = max(min(x + w, u + a) - max(x, u), 0) * max(min(y + h, v + b) - max(y, v), 0)
        ⏎            if shared > 0.3 * min(w * h, a * b):⏎                break
        ⏎        else:⏎            kept.append(i)⏎    return boxes[kept], weights[kept]⏎⏎def show(
c
    import cv2 → import cv2⏎from limo_hog import PeopleDetector
    boxes, weights = → found = PeopleDetector().detect(image)⏎boxes, weights =
    self.hog.detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05) → found.boxes, found.scores
d
    best = int(np.argmax(weights)) → centres = [x + w / 2 for x, y, w, h in boxes]
        ⏎self.last = getattr(self, 'last', centres[int(np.argmax(weights))])
        ⏎best = int(np.argmin([abs(centre - self.last) for centre in centres]))⏎self.last = centres[best]
e
    import Image → import Image, LaserScan
    self.create_subscription(Image, → self.room = 9.0⏎self.create_subscription(LaserScan, '/scan', self.on_scan, 10)
        ⏎self.create_subscription(Image,
    def on_image( → def on_scan(self, scan):⏎    ranges = np.array(scan.ranges)
        ⏎    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
        ⏎    ahead = ranges[(np.abs(angles) < 0.4) & np.isfinite(ranges)]
        ⏎    self.room = float(ahead.min()) if ahead.size else 9.0⏎⏎def on_image(
    = self.speed → = self.speed if self.room > 0.5 else 0.0
d, by a tracker
    self.hog.detectMultiScale( → self.search(
    def show( → def search(self, image, **options):⏎    if hasattr(self, 'tracker'):
        ⏎        ok, box = self.tracker.update(image)
        ⏎        return ([tuple(int(side) for side in box)], [1.0]) if ok else ([], [])
        ⏎    boxes, weights = self.hog.detectMultiScale(image, **options)⏎    if len(boxes):
        ⏎        self.tracker = cv2.TrackerMIL_create()
        ⏎        self.tracker.init(image, tuple(int(side) for side in boxes[int(np.argmax(weights))]))
        ⏎    return boxes, weights⏎⏎def show(
""",
)
DONE |= nodes("follower", DONE["a"][1], "a, by another name\n    image_raw → camera_image_depth")
LATE = exchanged(DONE["e"][1], "< 0.4 → < 0.8\n> 0.5 → > 0.25")

#: What the workshop's model solution, which does none of them, is told.
MISSED = {
    "a": ("the depth image is read", "does not subscribe to '/limo_camera/depth/image_raw'"),
    "b": ("every hit is asked for", "give detectMultiScale groupThreshold=0"),
    "c": ("another detector finds the person", "HOGDescriptor is still asked"),
    "d": ("the person followed first stays the one", "the red box leaves the first person"),
    "e": ("the robot stops before the chair", "into the chair"),
}


@pytest.mark.parametrize("name", DONE)
def test_a_node_that_does_the_task_has_all_points(tmp_path: Path, name: str) -> None:
    verdicts = checked(tmp_path, DONE[name][1], f"stretch {name[0]}")
    assert [verdict for verdict in verdicts if not verdict.holds] == []
    assert sum(verdict.points for verdict in verdicts) == 100


@pytest.mark.parametrize("task", MISSED)
def test_the_solution_is_told_what_is_missing_and_the_template_has_no_points(tmp_path: Path, task: str) -> None:
    verdicts = {verdict.checkpoint: verdict for verdict in checked(tmp_path, FOLLOWER, f"stretch {task}")}
    name, said = MISSED[task]
    assert verdicts[name].holds is False and said in verdicts[name].evidence
    assert sum(verdict.points for verdict in checked(tmp_path, template("follower"), f"stretch {task}")) == 0


@pytest.mark.parametrize("node", ["in time", "late"])
def test_the_way_driven_and_the_way_left_add_up_to_the_chair(tmp_path: Path, node: str) -> None:
    verdicts = checked(tmp_path, LATE if node == "late" else DONE["e"][1], "stretch e")
    (stops,) = (verdict for verdict in verdicts if verdict.checkpoint == "the robot stops before the chair")
    driven, left = map(float, re.findall(r"(\d\.\d\d) m", stops.evidence)[:2])
    # The seat's edge is at 1.5 - 0.17 m, the robot's front at 0.145 m when it starts, and the person straight ahead.
    assert driven + left == pytest.approx(1.5 - 0.17 - 0.145, abs=0.02)
    assert stops.holds is (node == "in time")
    assert ("wanted are at least 0.2 m" in stops.evidence) is (node == "late")


def test_the_report_has_points_evidence_and_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    node, page = tmp_path / "node.py", tmp_path / "report.html"
    node.write_text(DONE["a"][1].replace("'Camera'", "'<b>Camera</b>'"))
    assert main(["workshop", "check", str(node), "--stretch", "a", "--html", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "100 <small>of 100 points" in text
    assert text.count("data:image/jpeg;base64,") == 4
    assert "A person stands 3.4 m ahead" in text
    assert "&lt;b&gt;Camera" in text
    assert "<b>" not in text and "http" not in text
    assert "task A  60/60" in capsys.readouterr().out
    assert main(["workshop", "check", str(node), "--stretch", "a", "--sequel"]) == 2
