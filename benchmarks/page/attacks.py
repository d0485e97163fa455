"""The software stop while the server is attacked: from the press until the bridge has latched it.

The demo runs as a person would start it. Each press is a request on a connection of its own, as that of a page that
has been open for a while. The attackers are a process on the same machine, with a viewer's session where they need one.
Who presses goes before them, as a browser does in `bench page`: an operator has a computer of their own.
"""

import http.client
import json
import os
import random
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from typing import Any, TypeVar
from urllib.parse import urlsplit

import httpx

from benchmarks.common.documents import bench_parser, write
from benchmarks.page.latencies import Spread, spread
from rolling_panda.errors import InputError
from rolling_panda.runtime.launch import child_environment, python_command
from tests.support.processes.demo import Demo

#: Name in the results: kind and number of the attackers.
ATTACKS = {
    "nothing": ("", 0),
    "200 half-sent heads": ("head", 200),
    "200 slow bodies": ("body", 200),
    "500 idle connections": ("idle", 500),
    "flood of /viser": ("view", 16),
    "flood of /ws": ("page", 16),
    "flood of sign-ins": ("login", 50),
    "large bodies": ("large", 16),
}
#: Asked of the stop under each (s, 99 of 100).
LIMIT_S = 0.1
_LET_BEGIN_S, _PATIENCE_S = 2.0, 10.0
_OPERATOR_NICE = -6
_T = TypeVar("_T")


@dataclass
class Presses:
    """Of each press of the stop (s).

    Attributes:
        latched: Until the bridge had latched it, by its own note of when.
        answered: Until the answer of bridge and controller had come.
        state: How long `GET /api/state` took meanwhile.
        unanswered: Presses that were not confirmed.
    """

    latched: list[float] = field(default_factory=list)
    answered: list[float] = field(default_factory=list)
    state: list[float] = field(default_factory=list)
    unanswered: int = 0


@dataclass(frozen=True)
class Figures:
    """Of one attack; times in s.

    Attributes:
        stop_latched: From the press until the bridge had latched the stop.
        stop_answered: Until the answer of bridge and controller had come.
        state_answered: How long `GET /api/state` took.
        stops_unanswered: Presses that were not confirmed.
        seconds: How long it took in all.
        load: Programs that wanted a core of the machine in this minute.
        attackers: What they did.
    """

    stop_latched: Spread | None
    stop_answered: Spread | None
    state_answered: Spread | None
    stops_unanswered: int
    seconds: float
    load: float
    attackers: dict[str, int]


def under(demo: Demo, viewer: str, name: str, stops: int, seed: int) -> Figures:
    """Press the stop so often under one attack."""
    kind, count = ATTACKS[name]
    done: dict[str, int] = {}
    began = time.monotonic()
    with _attacked(demo.url, viewer, kind, count, done):
        pressed = press(demo, stops, seed)
    return Figures(
        spread(pressed.latched),
        spread(pressed.answered),
        spread(pressed.state),
        pressed.unanswered,
        round(time.monotonic() - began, 1),
        round(os.getloadavg()[0], 1),
        done,
    )


@contextmanager
def _attacked(url: str, viewer: str, kind: str, count: int, done: dict[str, int]) -> Iterator[None]:
    if not kind:
        yield
        return
    with subprocess.Popen(
        python_command("benchmarks.page.attackers", [url, viewer, kind, str(count)]),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=child_environment(),
        preexec_fn=lambda: os.setpriority(os.PRIO_PROCESS, 0, 0),
    ) as attackers:
        try:
            assert attackers.stdout is not None
            attackers.stdout.readline()
            time.sleep(_LET_BEGIN_S)
            yield
            told, _ = attackers.communicate(timeout=_PATIENCE_S)
            done.update(json.loads(told))
        finally:
            attackers.kill()


def press(demo: Demo, count: int, seed: int) -> Presses:
    """Press the stop `count` times; after each it is released."""
    chance, found = random.Random(seed), Presses()
    for _ in range(count):
        _released(demo, found)
        time.sleep(0.1 * chance.random())
        wall, began = time.time(), time.monotonic()
        if _stop(demo) != 200:
            found.unanswered += 1
            continue
        found.answered.append(time.monotonic() - began)
        latched = _until(lambda: _latched(_state(demo, found)))
        found.latched.append(latched - wall)
    return found


def _stop(demo: Demo) -> int:
    """Press it; the status of the answer, 0 where none came."""
    link = http.client.HTTPConnection(urlsplit(demo.url).netloc, timeout=_PATIENCE_S)
    cookie = "; ".join(f"{name}={value}" for name, value in demo.client.cookies.items())
    headers = {"Origin": demo.url, "Cookie": cookie, "Content-Type": "application/json"}
    try:
        link.request("POST", "/api/stop", json.dumps({"reason": "pressed by the benchmark"}), headers)
        answer = link.getresponse()
        answer.read()
        return answer.status
    except (OSError, http.client.HTTPException):
        return 0
    finally:
        link.close()


def _released(demo: Demo, found: Presses) -> None:
    def at_rest() -> bool:
        state = _state(demo, found)
        if state["controller"]["mode"] != "ESTOP_LATCHED" and not _latched(state):
            return True
        _again(lambda: demo.client.post("/api/reset", json={"reason": "pressed by the benchmark"}))
        return False

    _until(at_rest)


def _state(demo: Demo, found: Presses) -> dict[str, Any]:
    began = time.monotonic()
    state = dict(_again(lambda: demo.client.get("/api/state")).json())
    found.state.append(time.monotonic() - began)
    return state


def _latched(state: dict[str, Any]) -> float:
    """When (wall clock, s) the bridge latched the stop that it holds; 0 where it holds none."""
    held = [stop for each in state["stops"] if each["process"] == "bridge" for stop in each["stops"]]
    return float(held[0]["wall_time"]) if held else 0.0


def _again(ask: Callable[[], httpx.Response]) -> httpx.Response:
    """Ask, on another connection where the server has ended the one that was kept."""
    for _ in range(5):
        try:
            return ask()
        except httpx.TransportError:
            continue
    return ask()


def _until(condition: Callable[[], _T]) -> _T:
    end = time.monotonic() + _PATIENCE_S
    while not (value := condition()):
        if time.monotonic() > end:
            raise InputError(f"the demo did not get there within {_PATIENCE_S:.0f} s")
        time.sleep(0.02)
    return value


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns 1 where a stop under attack was not in time."""
    parser = bench_parser("attacks", __doc__)
    parser.add_argument("--stops", type=int, default=110, help="presses of the stop under each (default: 110)")
    parser.add_argument("--only", nargs="+", choices=tuple(ATTACKS), default=tuple(ATTACKS), help="these attacks alone")
    parser.add_argument("--seed", type=int, default=0, help="row to grow (default: 0)")
    parser.add_argument("--port", type=int, default=8768, help="port of the page (default: 8768)")
    arguments = parser.parse_args(argv)
    print("starting the demo", flush=True)
    demo = Demo(arguments.port, arguments.seed)
    with suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, _OPERATOR_NICE)
    document: dict[str, Any] = {"stops": arguments.stops, "limit_s": LIMIT_S}
    held = True
    try:
        viewer = demo.guest("onlooker", "viewer")
        for name in arguments.only:
            found = under(demo, viewer, name, arguments.stops, arguments.seed)
            document[name] = asdict(found)
            held &= _show(name, found)
            write(arguments.json, document)
    finally:
        demo.close()
    return 0 if held else 1


def _show(name: str, found: Figures) -> bool:
    latched, answered = found.stop_latched, found.stop_answered
    if latched is None or answered is None:
        print(f"{name:<24} no stop was answered")
        return False
    held = latched.p99 <= LIMIT_S and not found.stops_unanswered
    ranks = f"median {1000 * latched.median:.0f}, p99 {1000 * latched.p99:.0f}, most {1000 * latched.most:.0f}"
    print(
        f"{name:<24} latched {ranks} ms (n {latched.n}), answered p99 {1000 * answered.p99:.0f} ms, "
        f"{found.stops_unanswered} unanswered: {'held' if held else 'NOT HELD'}; load {found.load}; {found.attackers}",
        flush=True,
    )
    return held
