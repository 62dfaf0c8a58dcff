"""Listens as any ROS 2 node does, reliable and without settings: counts messages for some seconds after the first.

Arguments: seconds, then topic=package/Type ...; with --busy it computes 40 ms for each image, with --best-effort it
does not ask again, with --die it is killed at its end. Prints the nodes it sees with their topics, then the counts.
"""

import importlib
import json
import os
import signal
import sys
import time

import rclpy
from rclpy.qos import qos_profile_sensor_data


def main():
    seconds, wanted = float(sys.argv[1]), dict(word.split("=") for word in sys.argv[2:] if "=" in word)
    rclpy.init(args=[])
    node = rclpy.create_node("listener")
    counts = dict.fromkeys(wanted, 0)
    first = {}
    until = None

    def count(topic):
        def callback(message):
            until_done = time.monotonic() + 0.04
            while "--busy" in sys.argv and hasattr(message, "encoding") and time.monotonic() < until_done:
                pass
            if until is not None:
                counts[topic] += 1
            first.setdefault(topic, time.monotonic())

        return callback

    quality = qos_profile_sensor_data if "--best-effort" in sys.argv else 10
    for topic, kind in wanted.items():
        package, name = kind.split("/")
        message = getattr(importlib.import_module(f"{package}.msg"), name)
        node.create_subscription(message, topic, count(topic), quality)
    print("ready", flush=True)
    patience = time.monotonic() + 40
    while len(first) < len(wanted) and time.monotonic() < patience:
        rclpy.spin_once(node, timeout_sec=0.1)
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        rclpy.spin_once(node, timeout_sec=0.1)
    seen = {}
    for name, namespace in node.get_node_names_and_namespaces():
        if name != "listener":
            writes = node.get_publisher_names_and_types_by_node(name, namespace)
            reads = node.get_subscriber_names_and_types_by_node(name, namespace)
            seen[f"{namespace.rstrip('/')}/{name}"] = [dict(writes), dict(reads)]
    print(
        json.dumps({"nodes": seen, "counts": counts, "missing": [topic for topic in wanted if topic not in first]}),
        flush=True,
    )
    if "--die" in sys.argv:
        os.kill(os.getpid(), signal.SIGKILL)


main()
