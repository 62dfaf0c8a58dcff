"""Small programs of rclpy. What one prints must be the same, line by line, under ROS 2's own rclpy and under ours.

`python programs.py` plays all of them, each under a line with its name.
"""

import threading
import time

import rclpy
from builtin_interfaces.msg import Duration as DurationMessage
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.clock import ClockType
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPresetProfiles, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from rclpy.time import Time
from std_msgs.msg import Int32, String
from std_srvs.srv import SetBool, Trigger


def attempt(work):
    """Return what a call gives, or the name of what it raises."""
    try:
        return work()
    except Exception as error:
        return type(error).__name__


def spin(node, seconds, executor=None):
    until = time.monotonic() + seconds
    while rclpy.ok() and time.monotonic() < until:
        rclpy.spin_once(node, executor=executor, timeout_sec=0.02)


HELPERS = [*globals(), "HELPERS"]


def timers_fire_in_the_order_of_their_times(node):
    for name, period in (("a", 0.1), ("b", 0.14), ("c", 0.24)):
        node.create_timer(period, lambda name=name: print(name))
    spin(node, 0.53)


def a_timer_is_cancelled_and_reset(node):
    def call():
        print("called")
        timer.cancel()

    timer = node.create_timer(0.06, call)
    spin(node, 0.2)
    print(timer.is_canceled(), timer.timer_period_ns, timer.time_until_next_call())
    timer.reset()
    spin(node, 0.2)
    print(node.destroy_timer(timer), node.destroy_timer(timer), len(list(node.timers)))


def a_timer_without_autostart_waits_for_reset(node):
    timer = node.create_timer(0.05, lambda: print("called"), autostart=False)
    spin(node, 0.15)
    print(timer.is_canceled())
    timer.reset()
    spin(node, 0.07)


def a_blocked_timer_leaves_out_what_it_missed(node):
    calls = []

    def call():
        calls.append(round(time.monotonic() - began, 1))
        if len(calls) == 1:
            time.sleep(0.5)

    began = time.monotonic()
    node.create_timer(0.2, call)
    spin(node, 1.1)
    print(calls)


def a_rate_sleeps_while_another_thread_spins(node):
    thread = threading.Thread(target=spin, args=(node, 0.8), daemon=True)
    thread.start()
    rate, began = node.create_rate(10.0), time.monotonic()
    for _ in range(3):
        rate.sleep()
    print(round(time.monotonic() - began, 1))
    thread.join()
    print(node.destroy_rate(rate), attempt(lambda: node.create_rate(0.0)))


def the_newest_messages_wait_for_a_slow_reader(node):
    for depth in (1, 3):
        topic = f"numbers{depth}"
        node.create_subscription(Int32, topic, lambda message, depth=depth: print(depth, message.data), depth)
        publisher = node.create_publisher(Int32, topic, 10)
        time.sleep(0.3)
        for number in range(5):
            publisher.publish(Int32(data=number))
        time.sleep(0.2)
    spin(node, 0.2)


def subscriptions_are_served_in_the_order_of_their_making(node):
    for name in ("first", "second"):
        node.create_subscription(String, "words", lambda message, name=name: print(name, message.data), 10)
    publisher = node.create_publisher(String, "words", 10)
    time.sleep(0.3)
    for word in ("one", "two"):
        publisher.publish(String(data=word))
    time.sleep(0.2)
    spin(node, 0.2)
    print(publisher.get_subscription_count(), node.count_publishers("/words"), node.count_subscribers("/words"))


def a_late_reader_gets_what_was_kept(node):
    kept = QoSProfile(depth=2, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(Int32, "kept", kept)
    for number in range(4):
        publisher.publish(Int32(data=number))
    for name, qos in (("volatile", 10), ("kept", kept)):
        node.create_subscription(Int32, "kept", lambda message, name=name: print(name, message.data), qos)
    spin(node, 0.4)
    publisher.publish(Int32(data=9))
    spin(node, 0.3)


def a_reader_that_asks_for_more_than_is_offered_hears_nothing(node):
    best = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    kept = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    for offered in ("best", "reliable", "kept"):
        publisher = node.create_publisher(Int32, offered, {"best": best, "reliable": 5, "kept": kept}[offered])
        for asked, qos in (("best", best), ("reliable", 5), ("kept", kept)):
            node.create_subscription(Int32, offered, lambda _, who=(offered, asked): print(*who), qos)
        spin(node, 0.3)
        publisher.publish(Int32(data=1))
        spin(node, 0.2)


def profiles_say_what_they_hold(_):
    names = "history", "depth", "reliability", "durability"
    for profile in (QoSProfile(depth=3), *(QoSPresetProfiles[name].value for name in ("SENSOR_DATA", "DEFAULT"))):
        print([getattr(getattr(profile, name), "name", getattr(profile, name)) for name in names])
    print(attempt(QoSProfile), attempt(lambda: QoSProfile(history=HistoryPolicy.KEEP_LAST)))
    print(QoSProfile(history=HistoryPolicy.KEEP_ALL).history.name, QoSProfile(depth=0).depth)
    print(QoSProfile(depth=1) == QoSProfile(depth=1), QoSProfile(depth=1) == QoSProfile(depth=2))
    print(QoSPresetProfiles.get_from_short_key("sensor_data").depth, len(QoSPresetProfiles.short_keys()) > 6)


def wrong_qualities_and_types_are_refused(node):
    for depth in (-1, "1"):
        print(attempt(lambda depth=depth: node.create_publisher(Int32, "a", depth)))
    for name in ("a b", "a/", "", "1a", "a//b"):
        print(attempt(lambda name=name: node.create_publisher(Int32, name, 1)))
    print(attempt(lambda: node.create_client(Trigger, "a b")))
    print(attempt(lambda: node.create_service(Trigger, "1", print)))
    print(attempt(lambda: node.create_publisher(Int32, "a", 1).publish(String())))


def a_service_answers_an_asynchronous_call(node):
    def answer(request, response):
        print("asked", request.data)
        response.success, response.message = request.data, "done"
        return response

    node.create_service(SetBool, "switch", answer)
    client = node.create_client(SetBool, "switch")
    print(client.wait_for_service(2.0), client.service_is_ready())
    future = client.call_async(SetBool.Request(data=True))
    future.add_done_callback(lambda done: print("called back", done.result().message))
    print(future.done(), future.result())
    rclpy.spin_until_future_complete(node, future, timeout_sec=2.0)
    print(future.done(), future.result().success)
    spin(node, 0.1)


def a_missing_service_is_waited_for_in_vain(node):
    client = node.create_client(Trigger, "nobody")
    print(client.service_is_ready(), client.wait_for_service(timeout_sec=0.2))
    future = client.call_async(Trigger.Request())
    rclpy.spin_until_future_complete(node, future, timeout_sec=0.3)
    print(future.done(), attempt(lambda: client.call_async(SetBool.Request())))
    print(node.destroy_client(client), node.destroy_client(client))


def a_callback_awaits_a_service_and_others_go_on(node):
    def answer(_, response):
        print("answers")
        response.message = "yes"
        return response

    async def ask():
        timer.cancel()
        print("asks")
        print("heard", (await client.call_async(Trigger.Request())).message)

    node.create_service(Trigger, "trigger", answer)
    client = node.create_client(Trigger, "trigger")
    client.wait_for_service(2.0)
    # In a group that holds the client as well, the answer is waited for in vain.
    for group in (ReentrantCallbackGroup(), None):
        timer = node.create_timer(0.05, ask, callback_group=group)
        spin(node, 0.4)


def a_call_waits_in_a_thread_of_a_multi_threaded_executor(node):
    def answer(_, response):
        response.message = "yes"
        return response

    def ask():
        timer.cancel()
        print(client.call(Trigger.Request()).message)

    node.create_service(Trigger, "trigger", answer)
    client = node.create_client(Trigger, "trigger", callback_group=MutuallyExclusiveCallbackGroup())
    client.wait_for_service(2.0)
    timer = node.create_timer(0.05, ask, callback_group=MutuallyExclusiveCallbackGroup())
    spin(node, 0.6, MultiThreadedExecutor(num_threads=3))


def futures_are_done_cancelled_or_failed(_):
    future = Future()
    future.add_done_callback(lambda done: print("called back", done.result()))
    print(future.done(), future.cancelled(), future.result(), future.exception())
    future.set_result(5)
    print(future.done(), future.result())
    future.add_done_callback(lambda done: print("at once", done.result()))
    future.cancel()
    print(future.cancelled(), future.done())
    cancelled = Future()
    cancelled.add_done_callback(lambda done: print("called back", done.cancelled(), done.done()))
    cancelled.cancel()
    print(cancelled.cancelled(), cancelled.done(), cancelled.result())
    failed = Future()
    failed.set_exception(ValueError("bad"))
    print(failed.done(), attempt(failed.result), failed.exception())
    print(Future().remove_done_callback(print))


def an_executor_runs_tasks(node):
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    async def coroutine(text):
        return f"{text} and {await waits}"

    waits = Future()
    node.create_timer(0.05, lambda: waits.set_result("more"))
    quick, slow = executor.create_task(lambda: 7), executor.create_task(coroutine, "some")
    quick.add_done_callback(lambda task: print("quick", task.result()))
    print(quick.done(), slow.done())
    executor.spin_until_future_complete(slow, timeout_sec=1.0)
    print(quick.result(), slow.result())
    broken = executor.create_task(lambda: 1 / 0)
    print(attempt(lambda: executor.spin_until_future_complete(broken, timeout_sec=1.0)), broken.done())
    print(attempt(broken.result))


def executors_keep_nodes(node):
    executor = SingleThreadedExecutor()
    print(executor.add_node(node), executor.add_node(node), executor.get_nodes() == [node], node.executor is executor)
    print(executor.spin_once(timeout_sec=0.0), executor.spin_once(timeout_sec=0.05))
    executor.remove_node(node)
    print(executor.get_nodes(), executor.shutdown(), attempt(lambda: executor.spin_once(timeout_sec=0.1)))


def what_a_callback_raises_comes_out_of_spinning(node):
    def call():
        print("called")
        raise ValueError("bad")

    node.create_timer(0.05, call)
    for _ in range(2):
        print(attempt(lambda: rclpy.spin_once(node, timeout_sec=1.0)))
    executor = SingleThreadedExecutor()
    print(attempt(lambda: rclpy.spin(node, executor)))


def parameters_keep_their_types(node):
    print(node.declare_parameter("gain", 1.5).value, node.declare_parameter("names", ["a", "b"]).type_.name)
    print(attempt(lambda: node.declare_parameter("gain", 1.5)), attempt(lambda: node.get_parameter("none")))
    done = node.set_parameters([Parameter("gain", value=2.5), Parameter("gain", value="text")])
    print([one.successful for one in done], node.get_parameter("gain").value)
    print(node.get_parameter_or("none", Parameter("other", value=3)).value, node.get_parameter_or("none").type_.name)
    print(node.has_parameter("gain"), node.undeclare_parameter("gain"), node.has_parameter("gain"))
    print(attempt(lambda: node.set_parameters([Parameter("gain", value=1.0)])))
    print(attempt(lambda: node.undeclare_parameter("gain")), node.has_parameter("use_sim_time"))
    print(attempt(lambda: node.declare_parameter("typed", Parameter.Type.DOUBLE).value))
    node.declare_parameters("arm", [("speed", 0.5), ("limits.low", 1), ("limits.high", 2)])
    print({name: one.value for name, one in sorted(node.get_parameters_by_prefix("arm").items())})
    print([one.value for one in node.get_parameters(["arm.speed", "arm.limits.low"])])
    given = {"parameter_overrides": [Parameter("gain", value=2.5)], "allow_undeclared_parameters": True}
    free = rclpy.create_node("free", automatically_declare_parameters_from_overrides=True, **given)
    print(free.get_parameter("gain").value, free.get_parameter("none").value)
    for value in (True, 1, 1.5, "a", [True], [1], [1.5], ["a"], [b"a"], [], None):
        one = Parameter("p", value=value)
        sent = one.get_parameter_value()
        print(one.type_.name, one.value, sent.type, sent.string_value, list(sent.double_array_value))
        print(sent.bool_value, sent.integer_value, sent.double_value, list(sent.string_array_value))
    print(attempt(lambda: Parameter("p", value=b"a")), attempt(lambda: Parameter("p", value={})))
    print(attempt(lambda: Parameter("p", Parameter.Type.INTEGER, 1.5)))


def a_callback_may_refuse_a_parameter(node):
    from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult

    def check(parameters):
        print("checks", [(one.name, one.value) for one in parameters])
        return SetParametersResult(successful=parameters[0].value < 3, reason="too much")

    node.declare_parameter("count", 1)
    node.add_on_set_parameters_callback(check)
    print([(one.successful, one.reason) for one in node.set_parameters([Parameter("count", value=2)])])
    print([(one.successful, one.reason) for one in node.set_parameters([Parameter("count", value=5)])])
    print(node.get_parameter("count").value, attempt(lambda: node.declare_parameter("more", 9)))
    node.remove_on_set_parameters_callback(check)
    node.declare_parameter("fixed", 1, ParameterDescriptor(read_only=True))
    print([one.successful for one in node.set_parameters([Parameter("fixed", value=2)])])
    node.declare_parameter("any", 1, ParameterDescriptor(dynamic_typing=True))
    print([one.successful for one in node.set_parameters([Parameter("any", value="text")])])


def times_and_durations_are_reckoned(_):
    time_, span = Time(seconds=3, nanoseconds=5), Duration(seconds=1.5)
    print(time_, span, (time_ + span).nanoseconds, (time_ - span).nanoseconds, (time_ - Time(seconds=1)).nanoseconds)
    print(time_.seconds_nanoseconds(), time_.to_msg(), span.to_msg(), Duration(seconds=-0.5).to_msg())
    print(Duration.from_msg(DurationMessage(sec=2, nanosec=7)).nanoseconds)
    print(attempt(lambda: Time.from_msg(time_.to_msg()) == time_))
    ros = Time(seconds=3, nanoseconds=5, clock_type=ClockType.ROS_TIME)
    print(attempt(lambda: ros == time_), attempt(lambda: ros < time_), attempt(lambda: ros - time_))
    print(time_ > Time(), span >= Duration(nanoseconds=1), span != Duration(), attempt(lambda: span < time_))
    print(attempt(lambda: Time(seconds=-1)), attempt(lambda: Time(nanoseconds=1) - Duration(nanoseconds=2)))
    print(attempt(lambda: time_ + time_), attempt(lambda: span + span))
    print(attempt(lambda: time_ == 3), attempt(lambda: span == 3))
    print(repr(Time.from_msg(time_.to_msg()).clock_type), Time.from_msg(time_.to_msg()) - ros)


def nodes_and_topics_have_names(node):
    print(node.get_name(), node.get_namespace(), node.get_fully_qualified_name(), node.get_logger().name)
    other = rclpy.create_node("other", namespace="robot1")
    print(other.get_namespace(), other.get_fully_qualified_name(), other.get_logger().name)
    print([other.resolve_topic_name(name) for name in ("scan", "/scan", "~/scan", "a/b")])
    print(other.resolve_service_name("s"))
    print(attempt(lambda: rclpy.create_node("a b")), attempt(lambda: rclpy.create_node("a", namespace="b c")))
    print(attempt(lambda: rclpy.create_node("")))
    publisher = other.create_publisher(Int32, "~/numbers", 1)
    print(publisher.topic_name, publisher.msg_type.__name__, publisher.qos_profile.depth)
    print(other.create_subscription(Int32, "numbers", print, 1).topic_name)
    print(other.create_client(Trigger, "trigger").srv_name, other.create_service(Trigger, "t", print).srv_name)
    print(other.destroy_node(), list(other.publishers))


def groups_say_which_callbacks_run_at_once(node):
    for group in (MutuallyExclusiveCallbackGroup(), ReentrantCallbackGroup()):
        running, most = [], []

        def work(running=running, most=most):
            running.append(1)
            most.append(len(running))
            time.sleep(0.12)
            running.pop()

        timers = [node.create_timer(0.1, work, callback_group=group) for _ in range(2)]
        executor = MultiThreadedExecutor(num_threads=4)
        spin(node, 0.6, executor)
        for timer in timers:
            node.destroy_timer(timer)
        spin(node, 0.3, executor)
        print(type(group).__name__, max(most), group.has_entity(timers[0]))


def what_is_destroyed_calls_no_more(node):
    heard = node.create_subscription(Int32, "numbers", lambda message: print(message.data), 10)
    publisher = node.create_publisher(Int32, "numbers", 10)
    spin(node, 0.3)
    publisher.publish(Int32(data=1))
    spin(node, 0.2)
    print(node.destroy_subscription(heard), node.destroy_subscription(heard))
    publisher.publish(Int32(data=2))
    spin(node, 0.2)
    print(node.destroy_publisher(publisher), attempt(lambda: publisher.publish(Int32(data=3))))
    print(len(list(node.subscriptions)), node.count_publishers("/numbers"))


def log_lines_say_whether_they_came(node):
    logger = node.get_logger()
    print([logger.info("often", throttle_duration_sec=60.0) for _ in range(2)])
    print([logger.info("once", once=True) for _ in range(2)])
    print([logger.info("skip", skip_first=True) for _ in range(3)])
    print(logger.debug("unheard"), logger.warning("odd"))
    print(logger.get_child("arm").name, logger.get_effective_level().name)


def shutting_down_ends_spinning(node):
    def stop():
        print("stops")
        rclpy.shutdown()

    node.create_timer(0.05, stop)
    print(attempt(lambda: rclpy.spin(node)), rclpy.ok())
    print(attempt(lambda: rclpy.create_node("late")), attempt(rclpy.shutdown), rclpy.try_shutdown())
    rclpy.init()
    print(rclpy.ok(), attempt(rclpy.init))


for title, play in list(globals().items()):
    if title in HELPERS:
        continue
    print(f"# {title}", flush=True)
    rclpy.init()
    one = rclpy.create_node("small")
    print("raises", name) if isinstance(name := attempt(lambda play=play, one=one: play(one)), str) else None
    if rclpy.ok():
        one.destroy_node()
        rclpy.shutdown()
print("# end", flush=True)
