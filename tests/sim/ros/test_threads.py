"""Threads, services and rates of a script in lock step; where ROS would wait for ever, the error says why."""

import os
import signal
import subprocess
import sys
import time

import pytest
from tests.sim.ros.scripts import Run

NODE = "import threading, time\nrclpy.init()\nn = Node('n')\npub = n.create_publisher(Twist, 'cmd_vel', 1)\n"
SERVICE = "from std_srvs.srv import Trigger\n"


def test_the_scripts_end_waits_for_its_threads_but_not_for_daemons(run: Run) -> None:
    text = """
def count(name, times, period):
    for i in range(times):
        time.sleep(period)
        n.get_logger().info(f'{name} {i}')
threading.Thread(target=count, args=('waited for', 2, 0.5)).start()
threading.Thread(target=count, args=('daemon', 99, 0.6), daemon=True).start()
pub.publish(Twist())
"""
    assert run(NODE + text).said == ["waited for 0", "daemon 0", "waited for 1"]


def test_events_and_queues_wait_in_the_arenas_time(run: Run) -> None:
    text = """
import queue
box, go = queue.Queue(), threading.Event()
def work():
    go.wait()
    time.sleep(1.0)
    box.put('done')
worker = threading.Thread(target=work)
worker.start()
n.get_logger().info(str(go.wait(timeout=0.5)))
go.set()
try:
    box.get(timeout=0.4)
except queue.Empty:
    n.get_logger().info(f'empty at {n.get_clock().now().nanoseconds / 1e9:.1f}')
n.get_logger().info(box.get())
worker.join()
pub.publish(Twist())
"""
    assert run(NODE + text).said == ["False", "empty at 0.9", "done"]


def test_a_pool_computes_without_simulated_time(run: Run) -> None:
    text = """
from concurrent.futures import ThreadPoolExecutor
with ThreadPoolExecutor(2) as pool:
    squares = sum(pool.map(lambda k: k * k, range(5)))
n.get_logger().info(f'{squares} at {n.get_clock().now().nanoseconds}')
pub.publish(Twist())
raise SystemExit(0)
"""
    assert run(NODE + text).said == ["30 at 0"]


def test_what_a_thread_raises_ends_the_run_and_an_endless_loop_in_it_is_stopped(run: Run) -> None:
    text = NODE + "threading.Thread(target=lambda: 1 / 0).start()\npub.publish(Twist())\nrclpy.spin(n)"
    assert "failed with ZeroDivisionError at 0.00 s" in run(text).failure
    text = NODE + "def loop():\n    while not over: pass\nover = []\n"
    text += "threading.Thread(target=loop).start()\npub.publish(Twist())\n"
    text += "try:\n    rclpy.spin(n)\nfinally:\n    over.append(1)"
    assert "hung" in run(text, patience=0.5).failure


@pytest.mark.parametrize(
    ("without", "then"),
    [
        ("del threading._time", "not hasattr(threading, '_time')"),
        ("del queue.time", "not hasattr(queue, 'time')"),
        ("threading.Condition = type('Condition', (), {'wait': time.sleep})", "threading.Condition.wait is sleep"),
    ],
)
def test_a_python_without_a_private_of_cpythons_takes_turns_all_the_same(without: str, then: str) -> None:
    text = f"""
import queue, threading, time
from limo_sim.ros.lockstep.threads import take_turns
from limo_sim.ros.lockstep.turns import Turns
{without}
sleep = time.sleep
take_turns(Turns(lambda _: None, lambda: 0.0, lambda: False, print))
assert time.sleep is not sleep
assert {then}
"""
    subprocess.run([sys.executable, "-c", text], check=True)


#: Waits for ever beside other threads, as a script beside OpenCV's.
WAITS = """
import threading, time
from limo_sim.ros.lockstep.patience import HungError, Patience
for _ in range(30):
    threading.Thread(target=time.sleep, args=(1000,), daemon=True).start()
try:
    with Patience(0.5).watching():
        print("waits", flush=True)
        threading.Event().wait()
except HungError:
    print("hung")
"""


@pytest.mark.skipif(os.name != "posix", reason="signals are sent as POSIX has them")
def test_a_wait_that_was_stopped_beyond_its_time_is_interrupted_when_it_goes_on() -> None:
    # (A signal that comes meanwhile goes to any of the threads: the main thread missed nine in ten.)
    for _ in range(3):
        process = subprocess.Popen([sys.executable, "-c", WAITS], stdout=subprocess.PIPE, text=True)
        with process:
            assert process.stdout is not None
            assert process.stdout.readline() == "waits\n"
            process.send_signal(signal.SIGSTOP)
            time.sleep(0.7)
            process.send_signal(signal.SIGCONT)
            try:
                assert process.communicate(timeout=20)[0] == "hung\n"
            finally:
                process.kill()


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("n.create_rate(10).sleep()", "Rate.sleep() has waited for 2.2 s"),
        (SERVICE + "n.create_client(Trigger, 'go').call(Trigger.Request())", "spin the node in another thread"),
        ("n.create_timer(0.1, lambda: rclpy.spin_once(n))\nrclpy.spin(n)", "Executor is already spinning"),
        (
            SERVICE + "n.create_service(Trigger, 'go', lambda request, response: None)\n"
            "rclpy.spin_until_future_complete(n, n.create_client(Trigger, 'go').call_async(Trigger.Request()))",
            "must return its response",
        ),
        (SERVICE + "n.create_client(Trigger, 'go').call_async(Trigger())", "takes a Trigger.Request, came Trigger"),
        ("n.create_client(Twist, 'go')", "want a service type such as std_srvs.srv.Trigger"),
        (
            "from concurrent.futures import ThreadPoolExecutor\nThreadPoolExecutor().submit(rclpy.ok).result()",
            "not in a pool's",
        ),
    ],
)
def test_what_would_wait_for_ever_or_is_misused_is_named(run: Run, text: str, named: str) -> None:
    assert named in run(NODE + "pub.publish(Twist())\n" + text, seconds=60.0).failure


def test_a_service_that_no_node_offers_is_warned_of(run: Run) -> None:
    text = SERVICE + "pub.publish(Twist())\nn.create_client(Trigger, 'goo').wait_for_service()"
    warned = "no node offers the service '/goo', asked for at line 13; offered: none"
    assert run(NODE + text, seconds=3.0).said == [warned]
