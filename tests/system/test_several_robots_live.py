"""Two robots of one demo on the page, with real processes, judged by the trace of each simulator."""

import re
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import httpx
import numpy as np
import pytest
from playwright.sync_api import expect

from bridge.sim.robot import trace
from tests.support.operator_page import accept, operator_page
from tests.support.processes.demo import TracedDemo, running_demo

# Slow: two whole simulations and a browser that draws in software, on two cores.
pytestmark = [pytest.mark.browser, pytest.mark.alone, pytest.mark.slow]

#: Everything that one demo starts, twice (s).
STARTUP_S = 110.0
NAMES = ("panda-1", "panda-2")


class Script:
    """Looks on by REST, as a viewer, who supervises nothing."""

    def __init__(self, page: str, token: str) -> None:
        self._client = httpx.Client(base_url=page, headers={"Origin": page}, trust_env=False, timeout=10.0)
        assert self._client.post("/api/sign-in", json={"token": token}).status_code == 200

    def __enter__(self) -> "Script":
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()

    def state(self, robot: str) -> dict[str, object]:
        return dict(self._client.get(f"/robots/{robot}/api/state").json())

    def modes(self) -> list[str]:
        return [str(dict(self.state(name)["controller"])["mode"]) for name in NAMES]  # type: ignore[call-overload]

    def points(self, robot: str) -> dict[str, str]:
        rows = self._client.get(f"/robots/{robot}/api/points").json()["points"]
        return {row["point"]["point_id"]: row["entry"]["state"] for row in rows}

    def told(self, robot: str) -> str:
        """What was said of a robot, for whoever reads why the test failed."""
        lines = self._client.get(f"/robots/{robot}/api/events").json()["events"][-40:]
        rows = self._client.get(f"/robots/{robot}/api/points").json()["points"]
        states = [f"{row['entry']['point_id']} {row['entry']['state']} {row['entry']['reason']}" for row in rows]
        return "\n".join([*(f"{line['process']}: {line['text']}" for line in lines), *states])

    def wait(self, condition: Callable[[], object], limit_s: float, what: str) -> None:
        deadline = time.monotonic() + limit_s
        while not condition():
            assert time.monotonic() < deadline, "\n".join([what, *map(self.told, NAMES)])
            time.sleep(0.1)


def recorded(demo: TracedDemo, name: str) -> trace.Trace:
    return trace.read(demo.trace.with_name(f"{demo.trace.name}-{name}"))


def test_one_works_the_other_stands_and_one_stop_stops_both(tmp_path: Path, chromium_path: str) -> None:
    with running_demo(tmp_path, "--robots", "2", limit_s=STARTUP_S) as demo, ExitStack() as closing:
        assert len(demo.named("bridge")) == len(demo.named("controller")) == 2 and demo.child("server")
        (link,) = re.findall(r"http://\S+", demo.text())
        origin = link.split("/sign-in")[0]
        with operator_page(chromium_path, link, width=1024, height=768) as page:
            invited = page.request.post(
                f"{origin}/api/invite", data={"user": "eve", "role": "viewer"}, headers={"Origin": origin}
            )
            script = closing.enter_context(Script(origin, invited.json()["link"].split("token=")[1]))
            page.wait_for_selector('[data-cut][data-state="PROPOSED"]', timeout=90_000)
            page.click("#arm")
            page.wait_for_selector('#mode[data-mode="READY"]', timeout=15_000)
            script.wait(lambda: script.points("panda-2"), 60, "points of the second robot")

            def cut() -> bool:
                """Accept one and start; again where it was seen elsewhere meanwhile, which voids the acceptance."""
                states = set(script.points("panda-1").values())
                if "DONE" in states or script.modes()[0] == "AUTO":
                    return "DONE" in states
                if "ACCEPTED" not in states:
                    first = page.locator('[data-cut][data-state="PROPOSED"]').first
                    accept(page, str(first.get_attribute("data-cut")))
                elif page.get_attribute("#start", "aria-disabled") == "false":
                    page.click("#start")
                page.wait_for_timeout(500)
                return False

            script.wait(cut, 120, "a cut")
            assert script.modes()[1] == "IDLE"
            assert set(script.points("panda-2").values()) == {"PROPOSED"}
            # Choosing the other one moves neither, and shows the other's own queue and view.
            chosen = page.locator('[data-robot="panda-2"]')
            expect(chosen).to_contain_text("Idle")
            chosen.click()
            expect(chosen).to_have_attribute("aria-current", "page")
            page.wait_for_selector('#mode[data-mode="IDLE"]', timeout=20_000)
            page.wait_for_selector('[data-cut][data-state="PROPOSED"]', timeout=30_000)
            expect(page.locator('[data-cut][data-state="DONE"]')).to_have_count(0)
            expect(page.locator("rp-scene iframe")).to_have_class("loaded", timeout=30_000)
            view = page.frame(url=re.compile(r"/robots/panda-2/viser/"))
            assert view is not None
            view.wait_for_selector("canvas", timeout=30_000)
            page.keyboard.press("Space")
            script.wait(lambda: script.modes() == ["ESTOP_LATCHED"] * 2, 10, "both to stop")
            expect(page.locator('[data-robot="panda-1"]')).to_contain_text("Stopped", timeout=10_000)
            # Each is reset on its own page.
            page.fill("rp-stop-banner textarea, rp-stop-banner input", "the row is clear")
            page.click("#reset")
            script.wait(lambda: script.modes() == ["ESTOP_LATCHED", "IDLE"], 10, "the reset of the second robot alone")
    assert [event["event"] for event in recorded(demo, "panda-1").events].count("cut") >= 1
    other = recorded(demo, "panda-2")
    assert len(other.rows) > 1000 and not other.events
    settled = other.rows[other.rows["time"] > other.rows["time"][0] + 2.0]
    assert np.ptp(settled["base"], axis=0).max() < 1e-3
    assert np.ptp(settled["position"][:, 2:], axis=0).max() < 5e-3
