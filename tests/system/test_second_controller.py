"""A second controller of one robot, as processes of their own over TLS: it waits, says so, and takes over."""

import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from rolling_panda import reasons
from rolling_panda.config import TransportConfig
from rolling_panda.reasons import text_of
from rolling_panda.resources import resource
from rolling_panda.topics import BRIDGE, CONTROLLER
from rolling_panda.transport.certificates import make
from rolling_panda.transport.zenoh import Onlooker
from tests.support.processes.local_router import free_port
from tests.support.processes.processes import Processes
from tests.support.waiting import until

pytestmark = pytest.mark.paced


class Site(Processes):
    """Router and bridge run; controllers come and go."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        super().__init__(folder)
        stack.callback(self.close)
        make(folder / "certificates", ("127.0.0.1",), 2)
        self.endpoint, self.shown = f"tls/127.0.0.1:{free_port()}", str(folder / "certificates")
        text = resource("assets/config/sim.toml").read_text().replace("width = 848", "width = 64")
        (folder / "sim.toml").write_text(text.replace("height = 480", "height = 48"))
        self.launch("router", "rolling_panda", ["router", "--listen", self.endpoint, "--certificates", self.shown])
        self.process("bridge", "bridge", "bridge")
        wire = TransportConfig(connect=(self.endpoint,), connect_timeout_s=20.0, certificates=self.shown)
        self.onlooker = stack.enter_context(Onlooker(wire, "rp1"))
        self._bridge, self._controller = self.onlooker.slot(BRIDGE), self.onlooker.slot(CONTROLLER)

    def process(self, module: str, state: str, name: str) -> "subprocess.Popen[str]":
        own = ["--connect", self.endpoint, "--config", str(self.folder / "sim.toml"), "--certificates", self.shown]
        return self.launch(name, module, [*own, "--state", str(self.folder / state)])

    @property
    def held(self) -> tuple[int, str]:
        """Epoch and holder of the fencing token."""
        newest = self._bridge.peek()
        return (0, "") if newest is None else (newest.message.epoch, newest.message.holder)

    def mode(self) -> str:
        newest = self._controller.peek()
        return "" if newest is None else newest.message.mode

    def refused(self) -> int:
        newest = self._bridge.peek()
        assert newest is not None
        return sum(row.count for row in newest.message.rejections if row.topic == "command/token")


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with ExitStack() as stack:
        yield Site(tmp_path, stack)


@pytest.mark.long
def test_it_waits_says_so_and_takes_over_after_the_first_has_ended_or_was_killed(site: Site) -> None:
    first = site.process("controller", "one", "first")
    until(lambda: bool(site.held[1]) and site.mode() == "IDLE")
    epoch, holder = site.held
    second, same = site.process("controller", "two", "second"), site.process("controller", "one", "same")
    assert same.wait(60) == 1 and f"another controller works with {site.folder / 'one'}" in site.log("same").read_text()
    until(lambda: site.refused() > 5)
    assert text_of(reasons.controller_waits()) in site.log("second").read_text()
    assert site.held == (epoch, holder) and site.mode() == "IDLE"
    first.terminate()
    until(lambda: site.held[1] not in ("", holder), 20.0)
    assert site.held[0] == epoch + 1 and first.wait(20) == 0
    holder = site.held[1]
    third = site.process("controller", "one", "third")
    before = site.refused()
    until(lambda: site.refused() > before + 5)
    second.kill()
    until(lambda: site.held[1] not in ("", holder), 20.0)
    assert site.held[0] == epoch + 2 and third.poll() is None
    until(lambda: site.mode() == "IDLE")
