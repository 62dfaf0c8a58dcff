"""A callback that calls a service and waits: a MultiThreadedExecutor, and a callback group for the client."""

import rclpy
from geometry_msgs.msg import Twist
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import SetBool


class Motor(Node):
    def __init__(self):
        super().__init__("motor")
        self.on = False
        self.srv = self.create_service(SetBool, "motor/enable", self.enable)
        self.pub = self.create_publisher(Twist, "/cmd_vel", 10)
        self.create_timer(0.1, self.tick)

    def enable(self, request, response):
        self.on = request.data
        response.success = True
        response.message = f"motor {'on' if self.on else 'off'}"
        return response

    def tick(self):
        twist = Twist()
        twist.linear.x = 0.3 if self.on else 0.0
        self.pub.publish(twist)


class Operator(Node):
    def __init__(self):
        super().__init__("operator")
        client_group = MutuallyExclusiveCallbackGroup()
        timer_group = MutuallyExclusiveCallbackGroup()
        self.client = self.create_client(SetBool, "motor/enable", callback_group=client_group)
        self.timer = self.create_timer(1.0, self.switch, callback_group=timer_group)
        self.wanted = True

    def switch(self):
        answer = self.client.call(SetBool.Request(data=self.wanted))
        self.get_logger().info(answer.message)
        self.wanted = not self.wanted


def main(args=None):
    rclpy.init(args=args)
    executor = MultiThreadedExecutor(num_threads=4)
    for node in (Motor(), Operator()):
        executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.shutdown()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
