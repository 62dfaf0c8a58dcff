"""Services: a request of one node, answered by a callback of another or of the same script."""

from __future__ import annotations

import copy
import math
from collections import deque
from collections.abc import Callable
from typing import Any

from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.rclpy_stub.context import Context
from limo_sim.ros.rclpy_stub.future import Future
from limo_sim.ros.rclpy_stub.groups import CallbackGroup
from limo_sim.ros.rclpy_stub.partial import PartialApi
from limo_sim.ros.rclpy_stub.qos import QoSProfile

#: A call without a time limit that has waited so long can never be answered [s]: an answer takes no simulated time
#: where something spins. Chosen: long enough for a service that sleeps.
NEVER_AFTER = 30.0


class Service(PartialApi, missing=("send_response", "configure_introspection", "handle", "logger_name")):
    """Answers requests by a callback of the script."""

    def __init__(
        self,
        srv_type: Any,
        names: tuple[str, str],
        callback: Callable[[Any, Any], Any],
        callback_group: CallbackGroup,
        qos_profile: QoSProfile,
        context: Context,
    ) -> None:
        self._context = context
        self.srv_type, (self.srv_name, self.service_name) = srv_type, names
        self.callback, self.callback_group, self.qos_profile = callback, callback_group, qos_profile
        self.requests: deque[tuple[Any, Client, Future]] = deque()

    def is_ready(self) -> bool:
        """Whether a request waits."""
        return bool(self.requests)

    def take(self) -> Callable[[], Any]:
        """Return the work of answering the oldest request."""
        request, client, future = self.requests.popleft()

        def answer() -> Any:
            response = self.callback(request, self.srv_type.Response())
            if hasattr(response, "send"):
                return self._awaited(response, client, future)
            self._respond(response, client, future)
            return None

        return answer

    async def _awaited(self, response: Any, client: Client, future: Future) -> None:
        self._respond(await response, client, future)

    def _respond(self, response: Any, client: Client, future: Future) -> None:
        if not isinstance(response, self.srv_type.Response):
            raise TypeError(
                f"the callback of the service {self.srv_name!r} must return its response, a "
                f"{self.srv_type.__name__}.Response; came {type(response).__name__}: end it with `return response`"
            )
        client.responses.append((copy.deepcopy(response), future))

    def destroy(self) -> None:
        """End the service."""
        self._context.world.services.pop(self.service_name, None)


class Client(PartialApi, missing=("configure_introspection", "handle", "logger_name", "get_pending_request")):
    """Sends requests."""

    def __init__(
        self, srv_type: Any, names: tuple[str, str], qos: QoSProfile, group: CallbackGroup, context: Context
    ) -> None:
        self._context = context
        self.srv_type, (self.srv_name, self.service_name) = srv_type, names
        #: The executor that last served it: it runs the done callbacks of its futures.
        self.executor: Any = None
        self.qos_profile, self.callback_group = qos, group
        self.responses: deque[tuple[Any, Future]] = deque()

    def service_is_ready(self) -> bool:
        """Whether a node offers the service."""
        return self.service_name in self._context.world.services

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait until a node offers the service; False when simulated time is up before."""
        world = self._context.world
        until = math.inf if timeout_sec is None else world.time + timeout_sec
        return world.turns.wait(self.service_is_ready, until)

    def call_async(self, request: Any) -> Future:
        """Send a request; the future gets its answer while an executor spins the node."""
        if not isinstance(request, self.srv_type.Request):
            raise TypeError(
                f"the service {self.srv_name!r} takes a {self.srv_type.__name__}.Request, came {type(request).__name__}"
            )
        future = Future()
        server = self._context.world.services.get(self.service_name)
        if server is not None:
            server.requests.append((copy.deepcopy(request), self, future))
        return future

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Send a request and wait for its answer, None when `timeout_sec` is up.

        Raises `StubError` if the answer can never come, where ROS would wait for ever.
        """
        future = self.call_async(request)
        world = self._context.world
        limit = NEVER_AFTER if timeout_sec is None else timeout_sec
        if world.turns.wait(future.done, world.time + limit):
            return future.result()
        if timeout_sec is None:
            raise StubError(
                f"call() of the service {self.srv_name!r} has waited for {NEVER_AFTER:g} s and can have no answer: "
                "spin the node in another thread, or use call_async; in a callback, the client needs a "
                "callback group of its own and a MultiThreadedExecutor"
            )
        return None

    def remove_pending_request(self, future: Future) -> None:
        """Want no answer any more."""
        future.cancel()

    def is_ready(self) -> bool:
        """Whether an answer waits."""
        return bool(self.responses)

    def take(self) -> Callable[[], Any]:
        """Return the work of giving the oldest answer to its future."""
        response, future = self.responses.popleft()
        future.executor = self.executor
        return lambda: None if future.cancelled() else future.set_result(response)

    def destroy(self) -> None:
        """End the client."""
        self.responses.clear()
