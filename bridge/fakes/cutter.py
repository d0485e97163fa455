"""Secateurs as a ROS 2 service shows them: `true` closes the blades, `false` opens them."""

from bridge.fakes.bodies import BladeBody
from bridge.real import ros_messages as ros
from rolling_panda.transport.zenoh import ForeignWire


class FakeCutter:
    """Answers when the blades are there."""

    def __init__(self, wire: ForeignWire, service: str, blades: BladeBody) -> None:
        """Serve `service`; the wire is closed with the cutter."""
        self._wire, self._blades = wire, blades
        wire.serve(service, self._answer)

    def report(self) -> dict[str, object]:
        """How often the blades have met."""
        return {"bites": self._blades.bites}

    def tell(self, words: list[str]) -> None:
        """It has no buttons."""

    def close(self) -> None:
        """Let go of the wire."""
        self._wire.close()

    def _answer(self, request: bytes) -> bytes:
        fault = ""
        if ros.decode(ros.SET_BOOL, request).data:
            fault = self._blades.shut()
        else:
            self._blades.open()
        return ros.encode(ros.make(ros.SET_BOOL_REPLY, success=not fault, message=fault))
