"""What stands after --ros-args means what it means to ROS 2; rclpy, where it is, is asked."""

import json
from pathlib import Path
from typing import Any

import pytest
from tests.ros2.real import needs_rclpy, start

from limo_hog.ros2.arguments import RosArgumentError, parse_ros_arguments

TOPICS = ["scan", "/scan", "~/x"]
PLAIN = ["/follower", "/scan", "/scan", "/follower/x"]
ROBOT1 = ["/robot1/follower", "/robot1/scan", "/scan", "/robot1/follower/x"]

FILE = """
follower: {ros__parameters: {speed: 0.1, nested: {a: 2}}}
/robot1/follower: {ros__parameters: {own: 1}}
/**: {ros__parameters: {all: true, speed: 9.0}}
/*/follower: {ros__parameters: {star: s}}
robot1: {follower: {ros__parameters: {deep: 3}}}
"""

#: Arguments; the node's name and the `TOPICS`; its parameters.
CASES: list[tuple[str, list[str], dict[str, Any]]] = [
    ("", PLAIN, {}),
    ("-r scan:=/scan_filtered", ["/follower", "/scan_filtered", "/scan_filtered", "/follower/x"], {}),
    ("-r /scan:=laser", ["/follower", "/laser", "/laser", "/follower/x"], {}),
    ("-r rostopic://scan:=/t", ["/follower", "/t", "/t", "/follower/x"], {}),
    ("-r __ns:=/robot1", ROBOT1, {}),
    ("-r __ns:=/robot1 -r /scan:=/x", ["/robot1/follower", "/robot1/scan", "/x", "/robot1/follower/x"], {}),
    ("-r __ns:=/r --remap scan:=front/scan", ["/r/follower", "/r/front/scan", "/scan", "/r/follower/x"], {}),
    ("-r __node:=other", ["/other", "/scan", "/scan", "/other/x"], {}),
    ("-r other:scan:=/no -r follower:scan:=/yes", ["/follower", "/yes", "/yes", "/follower/x"], {}),
    ("-r __name:=z -r z:scan:=/z", ["/z", "/z", "/z", "/z/x"], {}),
    ("-r follower:__ns:=/r", ["/r/follower", "/r/scan", "/scan", "/r/follower/x"], {}),
    ("-r ~/x:=/y -r scan:=~/mine", ["/follower", "/follower/mine", "/follower/mine", "/y"], {}),
    ("-r scan:=/a -r scan:=/b -r /a:=/c", ["/follower", "/a", "/a", "/follower/x"], {}),
    ("--params-file FILE", PLAIN, {"speed": 9.0, "nested.a": 2, "all": True}),
    ("--params-file FILE -r __ns:=/robot1", ROBOT1, {"own": 1, "all": True, "speed": 9.0, "star": "s", "deep": 3}),
    ("-p speed:=2.0 --params-file FILE", PLAIN, {"speed": 0.1, "nested.a": 2, "all": True}),
    ("-p follower:n:=1 -p other:m:=1", PLAIN, {"n": 1}),
    ("-p follower:n:=1 -r __ns:=/robot1", ROBOT1, {}),
    ("-p s:=on -p t:=010 -p u:=1e3 -p v:=[1,2] -p w:='5'", PLAIN, {"s": True, "t": 8, "u": 1e3, "v": [1, 2], "w": "5"}),
    ("--log-level debug --disable-rosout-logs -p a:=x", PLAIN, {"a": "x"}),
]
WRONG = [
    "-r __ns:=robot1",
    "-r scan",
    "-r a-b:=c",
    "-r scan:=laser/",
    "-r scan:=~laser",
    "-p speed",
    "-p a:=[1",
    "--no",
]
WRONG += ["--params-file /none.yaml"]


@pytest.mark.parametrize(("words", "names", "parameters"), CASES)
def test_names_and_parameters_are_those_of_ros_2(words: str, names: Any, parameters: Any, here: Path) -> None:
    (here / "FILE").write_text(FILE)
    node = parse_ros_arguments(["--ros-args", *words.split()]).named("follower")
    assert ([node.full, *map(node.resolve, TOPICS)], node.parameters) == (names, parameters)


@pytest.mark.parametrize("words", WRONG)
def test_malformed_arguments_are_refused_and_named(words: str) -> None:
    with pytest.raises(RosArgumentError, match=words.split()[-1].replace("[", r"\[")):
        parse_ros_arguments(["--ros-args", *words.split()])


HOSTILE = {
    "deep lists": (b"n: {ros__parameters: {a: " + 5000 * b"[" + 5000 * b"]" + b"}}", "nested more than 50 deep"),
    "deep maps": (b"".join(b" " * depth + b"a:\n" for depth in range(2000)), "nested more than 50 deep"),
    "itself": (b"n: {ros__parameters: &x {a: *x}}", "an alias"),
    "not UTF-8": (b"n: {ros__parameters: {a: \xe9}}", "cannot be read"),
}


@pytest.mark.timeout(10)
@pytest.mark.parametrize(("text", "why"), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_parameter_file_is_refused_at_once(text: bytes, why: str, tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_bytes(text)
    with pytest.raises(RosArgumentError, match=why):
        parse_ros_arguments(["--ros-args", "--params-file", str(tmp_path / "p.yaml")])


@needs_rclpy
def test_rclpy_reads_the_same_arguments_alike(here: Path) -> None:
    (here / "FILE").write_text(FILE)
    told = [words.split() for words in [case[0] for case in CASES] + WRONG]
    asked = "".join(json.dumps({"arguments": words, "topics": TOPICS}) + "\n" for words in told)
    said = start(Path(__file__).parent / "rclpy_nodes" / "arguments.py").communicate(asked, timeout=120)[0]
    assert [json.loads(line) for line in said.splitlines()] == [*([n, p] for _, n, p in CASES), *[None] * len(WRONG)]
