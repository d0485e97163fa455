"""Who may say what on the robot's wire: the router's access control, made from the table of topics and services.

Everything that is not listed is refused by the router. A process is known by the common name of its certificate, so
this needs mutual TLS (`rolling_panda.certificates`).
"""

from typing import Any

from rolling_panda import messages as m
from rolling_panda.topics import SERVICES, TOPICS, key

#: May listen and say nothing: `rolling-panda status`, a recorder.
ONLOOKER = "onlooker"
#: Who may ask each service.
CALLERS: dict[str, tuple[m.Process, ...]] = {
    "service/intent": ("server",),
    "service/release": ("controller",),
    "service/plant": ("server",),
}
#: Any robot: keys begin with its name.
_EVERY_ROBOT = "*"
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


def access_control() -> dict[str, Any]:
    """Zenoh's `access_control` for the router: default deny, one policy a process."""
    every = key(_EVERY_ROBOT, "**")
    rules = [
        # What reaches a process was let in by its sender's rules; who has no rules is sent nothing.
        _rule("hear", "egress", _EVERYTHING, [every]),
        _rule("listen", "ingress", _LISTENING, [every]),
    ]
    policies = [{"rules": ["hear", "listen"], "subjects": [ONLOOKER]}]
    for process in m.PROCESSES:
        own = {
            "put": (("put",), _published(process)),
            "answer": (("declare_queryable", "reply"), _answered(process)),
            "ask": (("query",), _asked(process)),
            "alive": (("liveliness_token",), [key(_EVERY_ROBOT, f"alive/{process}")]),
        }
        named = {f"{process} may {what}": told for what, told in own.items() if told[1]}
        rules += [_rule(name, "ingress", messages, keys) for name, (messages, keys) in named.items()]
        policies.append({"rules": ["hear", "listen", *named], "subjects": [process]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in (*m.PROCESSES, ONLOOKER)],
        "policies": policies,
    }


def _published(process: m.Process) -> list[str]:
    return [key(_EVERY_ROBOT, topic.name) for topic in TOPICS if topic.sender in (process, "any")]


def _answered(process: m.Process) -> list[str]:
    return [key(_EVERY_ROBOT, service.name) for service in SERVICES if service.server == process]


def _asked(process: m.Process) -> list[str]:
    return [key(_EVERY_ROBOT, name) for name, callers in CALLERS.items() if process in callers]


def _rule(name: str, flow: str, messages: tuple[str, ...], keys: list[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": list(messages), "key_exprs": keys}
