"""Fake secateurs as a ROS 2 service: `true` closes the blades, `false` opens them."""

from bridge.fakes.bodies import BladeBody
from bridge.real import ros_messages as ros
from rolling_panda.transport.zenoh import ForeignWire


class FakeCutter:
    """Answers when the blades have reached their end position."""

    def __init__(self, wire: ForeignWire, service: str, blades: BladeBody) -> None:
        """Serve `service`; `close` closes the wire."""
        self._wire, self._blades = wire, blades
        wire.serve(service, self._answer)

    def report(self) -> dict[str, object]:
        """Number of completed closures."""
        return {"bites": self._blades.closures}

    def tell(self, words: list[str]) -> None:
        """No commands."""

    def close(self) -> None:
        """Close the wire."""
        self._wire.close()

    def _answer(self, request: bytes) -> bytes:
        fault = ""
        if ros.decode(ros.SET_BOOL, request).data:
            fault = self._blades.shut()
        else:
            self._blades.open()
        return ros.encode(ros.make(ros.SET_BOOL_REPLY, success=not fault, message=fault))
