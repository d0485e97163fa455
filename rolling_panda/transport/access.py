"""Who may say and hear what on the robot's wire: the router's access control, made from the tables of topics.

Everything that is not listed is refused by the router. A process of a robot is known by the common name of its
certificate, so this needs mutual TLS (`rolling_panda.transport.certificates`); with the certificate of one robot
nothing can be said to another at the same router.
"""

from collections.abc import Sequence
from typing import Any

from rolling_panda import messages as m
from rolling_panda.topics import ROBOT_ID, SERVICES, TOPICS, key

#: Sees who is up, and says nothing: `rolling-panda status`.
ONLOOKER = "onlooker"
#: Hears every topic, and says nothing: `rolling-panda record`.
RECORDER = "recorder"
#: Whoever stands behind the drivers on the robot's own router: the fakes of the devices.
DEVICES = "devices"
#: Everybody who has a certificate of a robot.
BEARERS = (*m.PROCESSES, RECORDER, ONLOOKER, DEVICES)
#: Who may ask each service.
CALLERS: dict[str, tuple[m.Process, ...]] = {
    "service/intent": ("server",),
    "service/release": ("controller",),
    "service/plant": ("server",),
    "service/seek": ("server",),
}
_SAID = ("put", "delete")
_DECLARED = (
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)
_EVERYTHING = (*_SAID, *_DECLARED)


def common_name(name: str, robot_id: str) -> str:
    """What the certificate of a robot's process, or of its onlooker, says its bearer is."""
    return f"{name}.{robot_id}"


def access_control(robots: Sequence[str] = (ROBOT_ID,), field: Sequence[str] = ()) -> dict[str, Any]:
    """Zenoh's `access_control` for a router: default deny, one policy for each bearer of a certificate of each robot.

    Args:
        robots: Their ids.
        field: Keys of the devices, carried between the bridge and the devices; empty where they have their own router.
    """
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for robot in robots:
        shared = [
            # Who is sent a question or an answer was let in by the rules for what is declared and asked.
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
            told = [*shared, *own, *(devices if bearer in ("bridge", DEVICES) else [])]
            policies.append({"rules": [rule["id"] for rule in told], "subjects": [common_name(bearer, robot)]})
    names = [common_name(bearer, robot) for robot in robots for bearer in BEARERS]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in names],
        "policies": policies,
    }


def _own(bearer: str, robot: str) -> list[dict[str, Any]]:
    """Rules for what is a bearer's own to say, hear, answer and ask."""
    process = next((each for each in m.PROCESSES if each == bearer), None)
    read = [topic.name for topic in TOPICS if topic.read_by(bearer)]
    own: list[tuple[str, str, tuple[str, ...], list[str]]] = [
        ("read", "ingress", ("declare_subscriber",), read),
        ("be told", "egress", _SAID, read),
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
