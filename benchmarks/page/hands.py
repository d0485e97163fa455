"""Hands on the page of a running demo: the gizmo dragged, the software stop pressed, the page opened anew."""

import random
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.page.latencies import ANSWER_S, onset, times_of_stamps
from benchmarks.page.probe import SCRIPT, Noted, Probe
from bridge.sim.robot import trace
from tests.support.gizmo_hand import GizmoHand
from tests.support.processes.demo import Demo

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Page

#: Of the tool, by each movement of the hand, one way and back (m).
_STEP = 0.02
_POLL_MS = 20
#: The simulator hands its record over every tenth of a second.
_SETTLE_MS = 400
_STOP_LIMIT_S = 5.0
#: When it was (ms); waits for it.
_FIRST_PAINT = """() => new Promise((resolve) => new PerformanceObserver((list) => {
  for (const entry of list.getEntriesByName("first-contentful-paint")) resolve(entry.startTime);
}).observe({ type: "paint", buffered: true }))"""


@dataclass
class Drags:
    """Of each movement of the gizmo (s), from when the browser had it.

    Attributes:
        told: Until the 3-D view was told of it.
        sent: Until the view had sent where the gizmo is.
        setpoint: Until the setpoint of a simulated actuator changed.
        motion: Until an actuator moved.
        servo: Of each: between the two.
        left_out: Movements that found the robot not at rest, or the hold ended by the page.
        unanswered: Movements after which nothing moved in time.
    """

    told: list[float] = field(default_factory=list)
    sent: list[float] = field(default_factory=list)
    setpoint: list[float] = field(default_factory=list)
    motion: list[float] = field(default_factory=list)
    servo: list[float] = field(default_factory=list)
    left_out: int = 0
    unanswered: int = 0


def signed_in(browser: "Browser", demo: Demo, scale: float) -> "BrowserContext":
    """A browser's context with the script's own session, and the probe in each page."""
    context = browser.new_context(
        locale="en-US", viewport={"width": 1280, "height": 800}, device_scale_factor=scale, base_url=demo.url
    )
    context.add_cookies(
        [{"name": name, "value": value, "url": demo.url} for name, value in demo.client.cookies.items()]
    )
    context.add_init_script(SCRIPT)
    return context


def open_page(context: "BrowserContext") -> "Page":
    """The page, with detections on it and its 3-D view."""
    page = context.new_page()
    page.goto("/")
    page.wait_for_selector("[data-cut]", timeout=90_000)
    page.wait_for_selector("rp-scene iframe.loaded", timeout=90_000)
    page.wait_for_timeout(3000)
    return page


def drag(page: "Page", demo: Demo, record: Path, count: int, seed: int, found: Drags) -> None:
    """Move the gizmo `count` times, each time from rest, and find in the simulator's trace when the robot answered.

    Raises:
        InputError: The gizmo cannot be taken any more; what was found until then is there.
    """
    if demo.in_mode("IDLE"):
        demo.post("arm")
    demo.wait(lambda: demo.in_mode("READY"), 20.0)
    page.click('[data-tab="drive"]')
    page.wait_for_selector('#teleop[aria-disabled="false"]', timeout=20_000)
    if page.get_attribute("#teleop", "aria-pressed") == "false":
        page.click("#teleop")
    page.wait_for_timeout(2000)
    (view,) = [frame for frame in page.frames if frame.url.partition("?")[0].endswith("/viser/")]
    hand = GizmoHand(
        page, lambda: demo.state()["controller"]["T_odom_tool"]["position"], lambda: demo.in_mode("TELEOP")
    )
    chance, probe = random.Random(seed), Probe(view)
    moved: list[Noted] = []
    try:
        _move(page, hand, probe, count, chance, moved, found)
    finally:
        hand.let_go()
        page.wait_for_timeout(_SETTLE_MS)
        _answers(moved, trace.read(record).rows, found)
    page.click('[data-tab="work"]')
    demo.wait(lambda: demo.in_mode("READY"), 10.0)


def _move(
    page: "Page",
    hand: GizmoHand,
    probe: Probe,
    count: int,
    chance: random.Random,
    moved: list[Noted],
    found: Drags,
) -> None:
    hand.take()
    away = False
    for _ in range(count):
        # At any moment of the periods of server, controller and bridge.
        page.wait_for_timeout(900 + 100 * chance.random())
        if not hand.holds:
            hand.let_go()
            page.wait_for_timeout(1000)
            hand.take()
            found.left_out, away = found.left_out + 1, False
            continue
        probe.take()
        away = not away
        hand.move(_STEP if away else 0.0)
        moved.append(_sent(page, probe))


def _sent(page: "Page", probe: Probe) -> Noted:
    """What was noted of a movement, until the view has sent it."""
    until, heard = time.monotonic() + ANSWER_S, probe.take()
    while time.monotonic() < until:
        page.wait_for_timeout(_POLL_MS)
        more = probe.take()
        heard.moves.extend(more.moves)
        heard.sent.extend(more.sent)
        if heard.moves and heard.sent:
            break
    return heard


def _answers(moved: list[Noted], rows: Any, found: Drags) -> None:
    clock = rows["clock"]
    for heard in moved:
        if not heard.moves or not heard.sent:
            found.unanswered += 1
            continue
        at, told = heard.moves[0]
        setpoint, motion = onset(clock, rows["setpoint"], at), onset(clock, rows["velocity"], at)
        if setpoint is None or motion is None:
            found.left_out += 1
        elif np.isinf(setpoint) or np.isinf(motion):
            found.unanswered += 1
        else:
            found.told.append(told - at)
            found.sent.append(heard.sent[0] - at)
            found.setpoint.append(setpoint)
            found.motion.append(motion)
            found.servo.append(motion - setpoint)


@dataclass
class Stops:
    """Of each press of the software stop (s), from when the browser had it.

    Attributes:
        latched: Until the bridge had latched it, by the bridge's own note of when.
        answered: Until the page had the answer, which waits for bridge and controller.
        unanswered: Presses that were not confirmed in time.
    """

    latched: list[float] = field(default_factory=list)
    answered: list[float] = field(default_factory=list)
    unanswered: int = 0


def press_stop(page: "Page", demo: Demo, count: int, seed: int) -> Stops:
    """Press the stop `count` times; after each it is released and the robot is armed again."""
    chance, found, probe = random.Random(seed), Stops(), Probe(page)
    for _ in range(count):
        if demo.in_mode("ESTOP_LATCHED"):
            _reset(demo)
        if demo.in_mode("PAUSED"):
            # A hold that the server renewed too late ends so.
            demo.post("resume")
            demo.wait(lambda: demo.in_mode("READY"), 20.0)
        if not demo.in_mode("READY"):
            demo.post("arm")
            demo.wait(lambda: demo.in_mode("READY"), 20.0)
        page.wait_for_timeout(100 + 100 * chance.random())
        box = page.locator("#stop").bounding_box()
        assert box is not None
        probe.take()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.mouse.down()
        page.mouse.up()
        until = time.monotonic() + _STOP_LIMIT_S
        heard = probe.take()
        presses, answers = heard.presses, heard.stops
        # The page asks again where bridge and controller have not confirmed it in time.
        while (not answers or answers[-1][1] != 200) and time.monotonic() < until:
            page.wait_for_timeout(_POLL_MS)
            answers += probe.take().stops
        if not presses or not answers or answers[-1][1] != 200:
            found.unanswered += 1
            continue
        # What the server shows is made anew ten times a second.
        demo.wait(lambda: _latched(demo), _STOP_LIMIT_S)
        wall_ahead = time.time() - time.monotonic()
        found.latched.append(_latched(demo)[-1]["wall_time"] - wall_ahead - presses[0][0])
        found.answered.append(answers[-1][0] - presses[0][0])
        _reset(demo)
    return found


def _reset(demo: Demo) -> None:
    demo.post("reset", reason="pressed by the benchmark")
    demo.wait(lambda: demo.in_mode("IDLE"), 10.0)


def _latched(demo: Demo) -> list[dict[str, Any]]:
    """Stops that the bridge holds, the newest first."""
    return [stop for each in demo.state()["stops"] if each["process"] == "bridge" for stop in each["stops"]]


def watch_screen(page: "Page", record: Path, seconds: float) -> list[tuple[float, float]]:
    """Of each state that the page draws meanwhile: when it was measured, and when it was painted (s)."""
    probe = Probe(page)
    probe.take()
    page.wait_for_timeout(1000 * seconds)
    states = probe.take().states
    page.wait_for_timeout(300)
    rows = trace.read(record).rows
    stamps = np.array([stamp for stamp, _, _ in states])
    measured = times_of_stamps(stamps, rows["time"], rows["clock"])
    return list(zip(measured.tolist(), [painted for _, _, painted in states], strict=True))


def first_paints(context: "BrowserContext", count: int) -> tuple[list[float], list[float]]:
    """First contentful paint of the page, opened anew each time, and when the robot's state stood on it (s)."""
    paints, filled = [], []
    for _ in range(count):
        page = context.new_page()
        # Nothing is taken from the browser's own store.
        context.new_cdp_session(page).send("Network.setCacheDisabled", {"cacheDisabled": True})
        page.goto("/", wait_until="commit")
        page.wait_for_selector('#mode:not([data-mode=""])', timeout=30_000)
        filled.append(float(page.evaluate("performance.now()")) / 1000)
        paints.append(float(page.evaluate(_FIRST_PAINT)) / 1000)
        page.close()
    return paints, filled


class Heap:
    """What the scripts of a page hold: each reading after a collection."""

    def __init__(self, page: "Page") -> None:
        """From now on, with a first reading."""
        self._page, self._wire = page, page.context.new_cdp_session(page)
        self._began = time.monotonic()
        self.readings: list[tuple[float, float]] = []
        """Minutes since the first, MB."""
        self.read()

    def read(self) -> None:
        """Take a reading."""
        self._wire.send("HeapProfiler.collectGarbage")
        used = self._wire.send("Runtime.getHeapUsage")["usedSize"] / 1e6
        self.readings.append((round((time.monotonic() - self._began) / 60, 2), round(used, 2)))

    def watch(self, minutes: float, every_s: float = 30.0) -> None:
        """Until the page has been open for so long, a reading every half minute."""
        while (left := 60 * minutes - (time.monotonic() - self._began)) > 0:
            self._page.wait_for_timeout(1000 * min(every_s, left))
            self.read()

    @property
    def growth_mb(self) -> float:
        """From the first reading to the greatest."""
        return round(max(mb for _, mb in self.readings) - self.readings[0][1], 2)
