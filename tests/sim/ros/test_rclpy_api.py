"""Every public name of rclpy, as recorded from its sources, is there with its parameters or is refused by name."""

from pathlib import Path

import pytest
from tests.ros2.real import needs_rclpy, start
from tests.sim.ros.scripts import Run

RECORDS = Path(__file__).parent / "rclpy_api"

#: What rclpy makes by itself: a script makes none of it, so the parameters of its constructor are rclpy's own affair.
MADE_BY_RCLPY = "Publisher Subscription Service Client Timer Rate Task"

PROBE = """
import importlib
import inspect
import pathlib

import rclpy.callback_groups, rclpy.clock, rclpy.duration, rclpy.executors, rclpy.parameter, rclpy.qos, rclpy.task
import rclpy.time
from std_srvs.srv import Empty

rclpy.init()
n = Node('n')
timer = n.create_timer(1.0, print)
instances = [
    n, n.create_publisher(Twist, 'a', 1), n.create_subscription(Twist, 'b', print, 1), timer, n.create_rate(1.0),
    n.create_client(Empty, 'c'), n.create_service(Empty, 'c', print), n.get_clock(), rclpy.task.Future(),
    rclpy.task.Task(print), rclpy.executors.SingleThreadedExecutor(), rclpy.executors.MultiThreadedExecutor(),
    rclpy.callback_groups.MutuallyExclusiveCallbackGroup(), rclpy.callback_groups.ReentrantCallbackGroup(),
    rclpy.time.Time(), rclpy.duration.Duration(), rclpy.qos.QoSProfile(depth=1), rclpy.parameter.Parameter('p'),
]
of = {type(one).__name__: one for one in instances}
of['Executor'], of['CallbackGroup'] = of['SingleThreadedExecutor'], of['ReentrantCallbackGroup']


def found(owner, name, told):
    try:
        return getattr(owner, name)
    except (AttributeError, ImportError) as error:
        # A class names the base that lacks it.
        if 'limo-hog run does not offer' not in str(error) or f'.{name}' not in str(error):
            n.get_logger().error(f'{told}: {error}')
        return None


for line in pathlib.Path('RECORD').read_text().splitlines()[1:]:
    module_name, rest = line.split(' ', 1)
    path, has_parameters, parameters = rest.partition('(')
    try:
        owner = importlib.import_module(module_name)
    except ImportError as error:
        if f'does not offer {module_name}' not in str(error):
            n.get_logger().error(f'{module_name}: {error}')
        continue
    name, _, member = path.partition('.')
    thing = found(owner, name, f'{module_name}.{name}')
    if thing is None:
        continue
    if member and member != '__init__':
        thing = found(of.get(name, thing), member, f'{name}.{member}')
    made_by_rclpy = member == '__init__' and (name in 'MADE'.split() or issubclass(thing, Exception))
    if thing is None or not has_parameters or made_by_rclpy:
        continue
    ours = inspect.signature(thing).parameters
    if any(one.kind == one.VAR_KEYWORD for one in ours.values()):
        continue
    for wanted in parameters.rstrip(')').split(', '):
        if wanted and not wanted.startswith('*') and wanted not in ours:
            n.get_logger().error(f'{path} has no parameter {wanted}')
"""


@pytest.mark.parametrize("branch", ["humble", "jazzy", "kilted"])
def test_every_name_of_rclpy_is_there_or_is_refused_by_name(run: Run, branch: str) -> None:
    text = PROBE.replace("RECORD", str(RECORDS / f"{branch}.txt")).replace("MADE", MADE_BY_RCLPY)
    outcome = run(text)
    assert "never published" in outcome.failure, outcome.traceback
    assert "\n".join(message for _, level, message in outcome.logged if level == "ERROR") == ""


@needs_rclpy
def test_the_record_is_what_the_installed_rclpy_says() -> None:
    program = Path(__file__).parents[2] / "ros2" / "rclpy_nodes" / "names.py"
    assert start(program).communicate(timeout=60)[0] == (RECORDS / "jazzy.txt").read_text()
