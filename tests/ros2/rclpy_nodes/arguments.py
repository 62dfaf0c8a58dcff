"""Says how rclpy reads --ros-args: a line of JSON with arguments and topics comes, one with names goes."""

import json
import sys

import rclpy


def read(case):
    context = rclpy.Context()
    try:
        rclpy.init(args=["--ros-args", *case["arguments"]], context=context)
    except Exception:
        return None
    node = rclpy.create_node("follower", context=context, automatically_declare_parameters_from_overrides=True)
    own = {name: one.value for name, one in node._parameters.items()}
    for name in ("use_sim_time", "start_type_description_service"):
        own.pop(name, None)
    names = [node.get_fully_qualified_name(), *(node.resolve_topic_name(topic) for topic in case["topics"])]
    node.destroy_node()
    rclpy.shutdown(context=context)
    return [names, own]


for line in sys.stdin:
    print(json.dumps(read(json.loads(line))), flush=True)
