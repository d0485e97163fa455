"""The router's access control, derived from the tables of topics and services.

The router denies whatever is not listed. It identifies a process of a robot by the common name of its certificate,
which needs mutual TLS (`rolling_panda.transport.certificates`). A certificate of one robot gives no access to another.
"""

from collections.abc import Sequence
from typing import Any

from rolling_panda import messages as m
from rolling_panda.topics import ROBOT_ID, SERVICES, TOPICS, key

#: Reads which processes are up: `rolling-panda status`.
ONLOOKER = "onlooker"
#: Reads every topic: `rolling-panda record`.
RECORDER = "recorder"
#: The devices behind the drivers on the robot's own router, or their fakes.
DEVICES = "devices"
#: Names of all certificates of a robot.
BEARERS = (*m.PROCESSES, RECORDER, ONLOOKER, DEVICES)
#: Processes that may call each service.
CALLERS: dict[str, tuple[m.Process, ...]] = {
    "service/intent": ("server",),
    "service/release": ("controller",),
    "service/plant": ("server",),
    "service/calibration": ("controller",),
    "service/seek": ("server",),
}
_PUBLISHED = ("put", "delete")
_DECLARED = (
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)
_EVERYTHING = (*_PUBLISHED, *_DECLARED)


def common_name(name: str, robot_id: str) -> str:
    """Common name of a certificate of a robot."""
    return f"{name}.{robot_id}"


def access_control(robots: Sequence[str] = (ROBOT_ID,), field: Sequence[str] = ()) -> dict[str, Any]:
    """Zenoh's `access_control` for a router: default deny, one policy for each certificate of each robot.

    Args:
        robots: Their ids.
        field: Keys of the devices, routed between the bridge and the devices; empty where they have their own router.
    """
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for robot in robots:
        shared = [
            # Ingress rules decide on queries and declarations; their egress is always permitted.
            _rule(f"{robot}: hear", "egress", _DECLARED, [key(robot, "**")]),
            _rule(
                f"{robot}: who is there",
                "ingress",
                ("liveliness_query", "declare_liveliness_subscriber"),
                [key(robot, "alive/*")],
            ),
        ]
        devices = [
            _rule(f"{robot}: field {flow}", flow, _EVERYTHING, list(field)) for flow in ("ingress", "egress") if field
        ]
        rules += [*shared, *devices]
        for bearer in BEARERS:
            own = _own(bearer, robot)
            rules += own
            applied = [*shared, *own, *(devices if bearer in ("bridge", DEVICES) else [])]
            policies.append({"rules": [rule["id"] for rule in applied], "subjects": [common_name(bearer, robot)]})
    names = [common_name(bearer, robot) for robot in robots for bearer in BEARERS]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in names],
        "policies": policies,
    }


def _own(bearer: str, robot: str) -> list[dict[str, Any]]:
    """Rules for what a certificate may publish, subscribe to, answer and query."""
    process = next((each for each in m.PROCESSES if each == bearer), None)
    read = [topic.name for topic in TOPICS if topic.read_by(bearer)]
    own: list[tuple[str, str, tuple[str, ...], list[str]]] = [
        ("read", "ingress", ("declare_subscriber",), read),
        ("be told", "egress", _PUBLISHED, read),
    ]
    if process is not None:
        own += [
            ("put", "ingress", ("put",), [topic.name for topic in TOPICS if topic.said_by(process)]),
            (
                "answer",
                "ingress",
                ("declare_queryable", "reply"),
                [service.name for service in SERVICES if service.server == process],
            ),
            ("ask", "ingress", ("query",), [name for name, callers in CALLERS.items() if process in callers]),
            ("alive", "ingress", ("liveliness_token",), [f"alive/{process}"]),
        ]
    return [
        _rule(f"{robot}: {bearer} may {what}", flow, messages, [key(robot, name) for name in names])
        for what, flow, messages, names in own
        if names
    ]


def _rule(name: str, flow: str, messages: tuple[str, ...], keys: list[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": list(messages), "key_exprs": keys}
