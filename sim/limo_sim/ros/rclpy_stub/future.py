"""Futures: an answer that comes later, and callbacks written as coroutines that await one."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.rclpy_stub.groups import ReentrantCallbackGroup


class Future:
    """An answer that may not be there yet."""

    def __init__(self, *, executor: Any = None) -> None:
        #: What runs the done callbacks as tasks; None runs them at once.
        self.executor = executor
        self._done = self._cancelled = False
        self._result: Any = None
        self._exception: BaseException | None = None
        self._callbacks: list[Callable[[Any], Any]] = []

    def __await__(self) -> Generator[Future, None, Any]:
        while not (self._done or self._cancelled):
            yield self
        return self.result()

    def done(self) -> bool:
        """Whether the answer is there; as in rclpy, it is not where it was cancelled."""
        return self._done

    def cancelled(self) -> bool:
        """Whether it was cancelled."""
        return self._cancelled

    def cancel(self) -> None:
        """Want no answer any more."""
        if not self._done:
            self._cancelled = True
            self._call_back()

    def result(self) -> Any:
        """Return the answer, None where it is not there yet; raises what was set as its exception."""
        if self._exception is not None:
            raise self._exception
        return self._result

    def exception(self) -> BaseException | None:
        """Return the exception that was set, if any."""
        return self._exception

    def set_result(self, result: Any) -> None:
        """Give the answer."""
        self._result, self._done = result, True
        self._call_back()

    def set_exception(self, exception: BaseException) -> None:
        """Say why there is no answer."""
        self._exception, self._done = exception, True
        self._call_back()

    def add_done_callback(self, callback: Callable[[Any], Any]) -> None:
        """Call back with the future when it is done or cancelled; at once where it is."""
        self._callbacks.append(callback)
        if self._done or self._cancelled:
            self._call_back()

    def remove_done_callback(self, callback: Callable[[Any], Any]) -> bool:
        """Forget a callback; returns whether it was there."""
        known = callback in self._callbacks
        if known:
            self._callbacks.remove(callback)
        return known

    def _call_back(self) -> None:
        callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            if self.executor is None:
                callback(self)
            else:
                self.executor.create_task(callback, self)


class Task(Future):
    """A callback that an executor runs: a function at once, a coroutine step by step whenever it spins."""

    def __init__(
        self, handler: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None, executor: Any = None
    ) -> None:
        super().__init__(executor=executor)
        self._handler, self._args, self._kwargs = handler, args, kwargs or {}
        self._coroutine = handler if hasattr(handler, "send") else None
        self._awaits: Future | None = None
        self.callback_group = ReentrantCallbackGroup()

    def executing(self) -> bool:
        """Whether it is being worked on; a coroutine that awaits is not."""
        return False

    def is_ready(self) -> bool:
        """Whether it can go on."""
        awaits = self._awaits
        return not self._done and not self._cancelled and (awaits is None or awaits.done() or awaits.cancelled())

    def take(self) -> Callable[[], None]:
        """Return the work that can be done now."""
        return self._step

    def _step(self) -> None:
        try:
            self._go_on()
        except Exception as error:
            self.set_exception(error)
            raise

    def _go_on(self) -> None:
        if self._coroutine is None:
            made = self._handler(*self._args, **self._kwargs)
            if not hasattr(made, "send"):
                self.set_result(made)
                return
            self._coroutine = made
        try:
            awaited = self._coroutine.send(None)
        except StopIteration as end:
            self.set_result(end.value)
            return
        if not isinstance(awaited, Future):
            raise StubError(f"limo-hog run does not offer to await {type(awaited).__name__}: await a future of rclpy")
        self._awaits = awaited
