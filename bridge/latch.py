"""The latched software stop: the first one holds until it is released by its own id."""

from rolling_panda.messages import ReleaseStop, StopRequest


class StopLatch:
    """Remembers one stop. A stop that has been released does not latch again when late repetitions of it arrive."""

    def __init__(self) -> None:
        """Start released."""
        self.stop_id = ""
        self.stopped_by = ""
        self._over: set[str] = set()

    def stop(self, request: StopRequest) -> bool:
        """Latch; True when this request is what latched it."""
        if self.stop_id or request.stop_id in self._over:
            return False
        self.stop_id = request.stop_id
        self.stopped_by = f"{request.user or request.source}: {request.reason}"[:500]
        return True

    def release(self, request: ReleaseStop) -> str:
        """Release; the reason why not, or an empty text."""
        if not self.stop_id:
            return "no stop is latched"
        if request.stop_id != self.stop_id:
            return f"the latched stop is {self.stop_id}, not {request.stop_id}"
        self._over.add(self.stop_id)
        self.stop_id = self.stopped_by = ""
        return ""
