"""What the demo costs this machine: processor and memory, idle and moving, and one idle page's traffic and work.

The demo runs as a person would start it. Processor time is that of its whole process tree; memory is the proportional
set size, which counts shared pages once.
"""

import base64
import os
import shutil
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import psutil

from benchmarks.common.documents import bench_parser, write
from tests.support.chromium import FLAGS
from tests.support.processes.demo import Demo


@dataclass(frozen=True)
class Cost:
    """Of one situation: cores in all and by process, and memory (MiB)."""

    cores: float
    memory_mib: float
    by_process: dict[str, float]


@dataclass(frozen=True)
class PageCost:
    """Of one idle page: bytes a second received, cores of the browser, more cores of the demo than without it."""

    bytes_per_s: float
    browser_cores: float
    demo_cores: float


def cost(root: psutil.Process, seconds: float) -> Cost:
    """Processor and memory of a process and all below it, over `seconds`."""
    before, began = processor_times(root), time.monotonic()
    time.sleep(seconds)
    by_process = cores_between(before, processor_times(root), time.monotonic() - began)
    memory = sum(process.memory_full_info().pss for process in [root, *root.children(recursive=True)])
    return Cost(round(sum(by_process.values()), 3), round(memory / 2**20), by_process)


def cores_between(
    before: dict[int, tuple[str, float]], after: dict[int, tuple[str, float]], passed: float
) -> dict[str, float]:
    """Cores used by each process between two `processor_times` that are `passed` (s) apart."""
    by_process: dict[str, float] = {}
    for pid, (name, spent) in after.items():
        if pid in before:
            by_process[name] = round(by_process.get(name, 0.0) + (spent - before[pid][1]) / passed, 3)
    return by_process


def page_cost(demo: Demo, chromium: str, seconds: float, without: Cost) -> PageCost:
    """What one page costs that is open and left alone, in headless Chromium that draws in software."""
    # Here and not above: the rest is measured without a browser.
    from playwright.sync_api import sync_playwright

    link = demo.post("invite", user="bench", role="viewer")["link"]
    received = 0
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        page = browser.new_context(locale="en-US", viewport={"width": 1280, "height": 800}).new_page()
        wire = page.context.new_cdp_session(page)

        def frame(event: dict[str, Any]) -> None:
            nonlocal received
            data = event["response"]["payloadData"]
            received += len(base64.b64decode(data)) if event["response"]["opcode"] == 2 else len(data)

        def fetched(event: dict[str, Any]) -> None:
            nonlocal received
            received += event["encodedDataLength"]

        wire.on("Network.webSocketFrameReceived", frame)
        wire.on("Network.loadingFinished", fetched)
        wire.send("Network.enable")
        page.goto(link)
        page.wait_for_selector("[data-cut]", timeout=90_000)
        page.wait_for_timeout(15_000)
        browser_tree = [p for p in psutil.Process(os.getpid()).children(recursive=True) if "chrom" in p.name()]
        before, began, already = sum(_spent(p) for p in browser_tree), time.monotonic(), received
        # The page's events are handled only while Playwright is waiting, so the demo is measured around such a wait.
        demo_before = processor_times(demo.tree)
        page.wait_for_timeout(seconds * 1000)
        passed = time.monotonic() - began
        demo_after = processor_times(demo.tree)
        spent = sum(_spent(p) for p in browser_tree) - before
        demo_spent = sum(t - demo_before[pid][1] for pid, (_, t) in demo_after.items() if pid in demo_before)
        bytes_per_s = (received - already) / passed
        browser.close()
    return PageCost(round(bytes_per_s), round(spent / passed, 3), round(demo_spent / passed - without.cores, 3))


def processor_times(root: psutil.Process) -> dict[int, tuple[str, float]]:
    """Name and processor time (s) of a process and of all below it, by their ids."""
    return {process.pid: (_name(process), _spent(process)) for process in [root, *root.children(recursive=True)]}


def _spent(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _name(process: psutil.Process) -> str:
    words = process.cmdline()
    if "-m" in words:
        module = words[words.index("-m") + 1]
        return "router" if module == "rolling_panda" and "router" in words else module.replace("rolling_panda", "demo")
    return "camera"


def main(argv: Sequence[str]) -> int:
    """Run the benchmark; returns the exit code."""
    parser = bench_parser("load", __doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="how long each situation lasts (default: 20)")
    parser.add_argument("--seed", type=int, default=0, help="row to grow (default: 0)")
    parser.add_argument("--robots", type=int, default=1, help="so many robots at once (default: 1)")
    parser.add_argument("--port", type=int, default=8765, help="port of the page (default: 8765)")
    arguments = parser.parse_args(argv)
    print("starting the demo", flush=True)
    demo = Demo(arguments.port, arguments.seed, None, "--robots", str(arguments.robots))
    try:
        time.sleep(10.0)
        print(f"idle, {arguments.seconds:.0f} s", flush=True)
        idle = cost(demo.tree, arguments.seconds)
        chromium, page = shutil.which("chromium"), None
        if chromium is None:
            print("no Chromium: the page is not measured", flush=True)
        else:
            print(f"one idle page, {arguments.seconds:.0f} s", flush=True)
            page = page_cost(demo, chromium, arguments.seconds, idle)
        with demo.watched():
            demo.begin_work()
            time.sleep(3.0)
            print(f"moving, {arguments.seconds:.0f} s", flush=True)
            moving = cost(demo.tree, arguments.seconds)
            still_working = demo.in_mode("AUTO")
            factor = min(state["bridge"]["real_time_factor"] for state in demo.states())
    finally:
        demo.close()
    _show(idle, moving, page, factor, still_working)
    document = {
        "seconds": arguments.seconds,
        "robots": arguments.robots,
        "idle": asdict(idle),
        "moving": asdict(moving),
        "page": asdict(page) if page is not None else None,
        "real_time_factor": round(factor, 3),
        "still_working": still_working,
    }
    write(arguments.json, document)
    return 0


def _show(idle: Cost, moving: Cost, page: PageCost | None, factor: float, still_working: bool) -> None:
    print(f"{'cores':<12} {'idle':>7} {'moving':>7}")
    for name in sorted(idle.by_process | moving.by_process):
        print(f"{name:<12} {idle.by_process.get(name, 0):>7.2f} {moving.by_process.get(name, 0):>7.2f}")
    print(f"{'all':<12} {idle.cores:>7.2f} {moving.cores:>7.2f}")
    print(f"{'memory MiB':<12} {idle.memory_mib:>7.0f} {moving.memory_mib:>7.0f}")
    print(f"real-time factor while moving {factor:.2f}{'' if still_working else '; work had ended before the end'}")
    if page is not None:
        print(
            f"one idle page: {page.bytes_per_s:.0f} bytes/s, {page.browser_cores:.2f} cores of a browser that draws in "
            f"software, {page.demo_cores:+.2f} cores of the demo"
        )
