"""What is mutated, and which tests have to notice."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Target:
    """Files that belong together.

    Attributes:
        files: Patterns of the files that are mutated, from the checkout's root.
        tests: The tests that mirror them, below `tests/`.
    """

    files: tuple[str, ...]
    tests: tuple[str, ...]

    def paths(self, root: Path) -> list[str]:
        """The files below a checkout's root that are mutated."""
        found = (path for pattern in self.files for path in root.glob(pattern))
        return sorted({path.relative_to(root).as_posix() for path in found if path.suffix == ".py"})


def _tests(folder: str, names: str) -> tuple[str, ...]:
    return tuple(f"{folder}/test_{name}.py" for name in names.split())


#: By name, what is done soonest first. Of `bridge/` the simulation (`sim/`) and the fakes of makers' devices (`fakes/`)
#: are left out: tests measure against them, and they move no robot.
TARGETS = {
    "codec": Target(("rolling_panda/transport/codec.py",), _tests("rolling_panda", "codec")),
    "server.auth": Target(("server/auth/*",), _tests("server", "access users sessions throttle passwords")),
    "controller.ledger": Target(
        ("controller/ledger/*",),
        _tests(
            "controller",
            "ledger writer journal audit session_report start core_unwritable_ledger point_queue_restored core_session",
        ),
    ),
    "controller.supervision": Target(
        ("controller/supervision/*",),
        _tests(
            "controller",
            "authority fencing modes permission supervisor health latched_stops lease core_control "
            "core_interruptions preview queue_requests tracking_error core_work interrupted",
        )
        + _tests("system", "two_operators"),
    ),
    "bridge.core": Target(
        ("bridge/core/*",),
        _tests(
            "bridge",
            "fence validator latch limiter watchdog cut_memory cut_orders bridge_state bridge_core bridge_memory "
            "odometer picture camera_trigger refusals robot_faults robot_time round_trip",
        ),
    ),
    "bridge": Target(
        ("bridge/*.py", "bridge/real/*"),
        _tests(
            "bridge",
            "bridge_loop bridge_process arm_follower cutter mp500 panda real_robot realsense picture_link ros_messages "
            "bridge_contract",
        )
        + _tests("system", "real_config"),
    ),
    "controller.work": Target(
        ("controller/work/point_queue.py", "controller/work/cutting.py"),
        _tests("controller", "point_queue point_queue_restored queue_requests rule_history blades"),
    ),
    "teleoperation": Target(
        (
            "controller/motion/teleoperation.py",
            "server/robots/teleop.py",
            "server/robots/event_log.py",
            "server/scene/viser_adapter/client_messages.py",
        ),
        _tests("controller", "teleoperation") + _tests("server", "teleop event_log client_messages"),
    ),
    "server.middleware": Target(("server/api/middleware.py",), _tests("server", "middleware sign_in")),
}
