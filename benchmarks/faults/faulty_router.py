"""A router that can fail: each process has a door of its own, and between each two of them is a way with faults.

It stands where `rolling-panda router` stands, but carries the bytes itself. What is to go wrong is told to it in JSON,
a line each on standard input; when it is so, it answers with a line on standard output:

    {"from": "controller", "to": "bridge", "topic": "command/motion", "fault": {"loss": 1.0}}
    {"from": "controller", "to": "bridge", "topic": "command/motion", "replay": true}
    {"clear": true}

`*` stands for every process or topic.
"""

import argparse
import itertools
import json
import sys
import threading
from collections.abc import Iterable, Sequence
from typing import Any

import zenoh

from benchmarks.faults.lossy_link import BadWay, Parcel, WayFault
from rolling_panda.config import TransportConfig
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.runtime.scheduling import set_priority
from rolling_panda.topics import SERVICES, key
from rolling_panda.transport.settings import wire_settings

_ALL = "*"
_REMOTE = zenoh.Locality.REMOTE


class FaultyRouter:
    """Doors by the process's name, and ways between them."""

    def __init__(self, doors: dict[str, str], robot_id: str, seed: int = 0) -> None:
        """Open a door for each process at its endpoint.

        Args:
            doors: Endpoint to listen at, by process.
            robot_id: Whose wire it is.
            seed: Of what is lost or spoiled.
        """
        self._prefix = key(robot_id, "")
        self._sessions = {name: zenoh.open(_config(endpoint)) for name, endpoint in doors.items()}
        self._ways = {pair: BadWay(seed + n) for n, pair in enumerate(itertools.permutations(doors, 2))}
        self._tokens: dict[tuple[str, str], zenoh.LivelinessToken] = {}
        for name, session in self._sessions.items():
            session.declare_subscriber(f"{self._prefix}**", self._receiver(name), allowed_origin=_REMOTE)
            session.liveliness().declare_subscriber(key(robot_id, f"alive/{name}"), self._presence(name), history=True)
            for service in SERVICES:
                if service.server in doors and service.server != name:
                    session.declare_queryable(
                        key(robot_id, service.name),
                        self._asker(name, service.server, service.name, service.timeout_s),
                        allowed_origin=_REMOTE,
                    )

    def set(self, origin: str, to: str, topic: str, fault: WayFault) -> None:
        """From now on the ways between these have this fault for this topic."""
        for way in self._between(origin, to):
            way.set(topic, fault)

    def replay(self, origin: str, to: str, topic: str) -> int:
        """Send the last messages once more; returns how many."""
        return sum(way.replay(topic) for way in self._between(origin, to))

    def clear(self) -> None:
        """All ways are well."""
        for way in self._ways.values():
            way.clear()

    def close(self) -> None:
        """Carry nothing more and close the doors."""
        for way in self._ways.values():
            way.close()
        for session in self._sessions.values():
            session.close()

    def _between(self, origin: str, to: str) -> Iterable[BadWay]:
        return [w for (a, b), w in self._ways.items() if origin in (_ALL, a) and to in (_ALL, b)]

    def _receiver(self, name: str) -> Any:
        def receive(sample: zenoh.Sample) -> None:
            path, payload = str(sample.key_expr), sample.payload.to_bytes()
            how = {
                "priority": sample.priority,
                "congestion_control": sample.congestion_control,
                "express": sample.express,
                "allowed_destination": _REMOTE,
            }
            for (origin, to), way in self._ways.items():
                if origin == name:
                    way.send(Parcel(path.removeprefix(self._prefix), payload, _putter(self._sessions[to], path, how)))

        return receive

    def _presence(self, name: str) -> Any:
        """Whoever is at a door is announced at all the others."""

        def change(sample: zenoh.Sample) -> None:
            for other, session in self._sessions.items():
                if other == name:
                    continue
                token = self._tokens.pop((name, other), None)
                if token is not None:
                    token.undeclare()
                if sample.kind == zenoh.SampleKind.PUT:
                    self._tokens[name, other] = session.liveliness().declare_token(str(sample.key_expr))

        return change

    def _asker(self, name: str, server: str, topic: str, timeout_s: float) -> Any:
        """A request goes the way to who serves, and its answer the way back."""

        def ask(query: zenoh.Query) -> None:
            payload = query.payload.to_bytes() if query.payload is not None else b""

            def reply(content: bytes) -> None:
                with query:
                    query.reply(query.key_expr, content)

            def deliver(request: bytes) -> None:
                threading.Thread(target=answer, args=(request,), daemon=True).start()

            def answer(request: bytes) -> None:
                for item in self._sessions[server].get(
                    query.key_expr, payload=request, timeout=timeout_s, allowed_destination=_REMOTE
                ):
                    if item.ok is not None:
                        self._ways[server, name].send(Parcel(topic, item.ok.payload.to_bytes(), reply))

            self._ways[name, server].send(Parcel(topic, payload, deliver))

        return ask


def _putter(session: zenoh.Session, path: str, how: dict[str, Any]) -> Any:
    def put(payload: bytes) -> None:
        if not session.is_closed():
            session.put(path, payload, **how)

    return put


def _config(endpoint: str) -> zenoh.Config:
    out = zenoh.Config()
    for path, value in wire_settings(
        TransportConfig(mode="router", connect=(), listen=(endpoint,), plain_wire=True), "router"
    ).items():
        out.insert_json5(path, json.dumps(value))
    return out


def obey(router: FaultyRouter, line: str) -> str:
    """Do what a line says; returns the answer."""
    order = json.loads(line)
    if order.get("clear"):
        router.clear()
        return "clear"
    ends = order.get("from", _ALL), order.get("to", _ALL), order.get("topic", _ALL)
    if order.get("replay"):
        return f"replayed {router.replay(*ends)}"
    router.set(*ends, WayFault(**order["fault"]))
    return "set"


def main(argv: Sequence[str] | None = None) -> int:
    """Carry messages until standard input closes. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--door", action="append", required=True, metavar="PROCESS=ENDPOINT", help="one for each")
    parser.add_argument("--robot-id", default=ROBOT_ID)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args(argv)
    set_priority("control")
    router = FaultyRouter(dict(door.split("=", 1) for door in arguments.door), arguments.robot_id, arguments.seed)
    print("open", flush=True)
    for line in sys.stdin:
        print(obey(router, line), flush=True)
    router.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
