"""Who may say what on the robot's wire: the router's access control, made from the table of topics and services.

Everything that is not listed is refused by the router. A process of a robot is known by the common name of its
certificate, so this needs mutual TLS (`rolling_panda.certificates`); with the certificate of one robot nothing can be
said to another at the same router.
"""

from collections.abc import Sequence
from typing import Any

from rolling_panda import messages as m
from rolling_panda.topics import ROBOT_ID, SERVICES, TOPICS, key

#: May listen and say nothing: `rolling-panda status`, a recorder.
ONLOOKER = "onlooker"
#: Who may ask each service.
CALLERS: dict[str, tuple[m.Process, ...]] = {
    "service/intent": ("server",),
    "service/release": ("controller",),
    "service/plant": ("server",),
    "service/seek": ("server",),
}
_LISTENING = ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")
_EVERYTHING = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)


def common_name(name: str, robot_id: str) -> str:
    """What the certificate of a robot's process, or of its onlooker, says its bearer is."""
    return f"{name}.{robot_id}"


def access_control(robots: Sequence[str] = (ROBOT_ID,)) -> dict[str, Any]:
    """Zenoh's `access_control` for a router: default deny, one policy for each process of each robot."""
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    names: list[str] = []
    for robot in robots:
        every = [key(robot, "**")]
        shared = [f"{robot}: hear", f"{robot}: listen"]
        # What reaches a process was let in by its sender's rules; who has no rules is sent nothing.
        rules.append(_rule(shared[0], "egress", _EVERYTHING, every))
        rules.append(_rule(shared[1], "ingress", _LISTENING, every))
        policies.append({"rules": shared, "subjects": [common_name(ONLOOKER, robot)]})
        for process in m.PROCESSES:
            own = _own(process, robot)
            rules += own
            told = [*shared, *(rule["id"] for rule in own)]
            policies.append({"rules": told, "subjects": [common_name(process, robot)]})
        names += [common_name(name, robot) for name in (*m.PROCESSES, ONLOOKER)]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in names],
        "policies": policies,
    }


def _own(process: m.Process, robot: str) -> list[dict[str, Any]]:
    """Rules for what is a process's own to say, answer and ask."""
    own: dict[str, tuple[tuple[str, ...], list[str]]] = {
        "put": (("put",), [topic.name for topic in TOPICS if topic.said_by(process)]),
        "answer": (
            ("declare_queryable", "reply"),
            [service.name for service in SERVICES if service.server == process],
        ),
        "ask": (("query",), [name for name, callers in CALLERS.items() if process in callers]),
        "alive": (("liveliness_token",), [f"alive/{process}"]),
    }
    return [
        _rule(f"{robot}: {process} may {what}", "ingress", messages, [key(robot, name) for name in names])
        for what, (messages, names) in own.items()
        if names
    ]


def _rule(name: str, flow: str, messages: tuple[str, ...], keys: list[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": list(messages), "key_exprs": keys}
