"""Who may command the robot: one controller at a time, by the word of the bridge; no kept number locks it out."""

import tempfile
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from bridge.__main__ import main
from bridge.config import BridgeConfig, OdometryConfig
from bridge.core import validator as f
from bridge.core.bridge import TICK_S, BridgeCore
from bridge.core.odometer import Odometer
from bridge.core.state_memory import Remembered, begin_anew, open_memory
from bridge.core.validator import SILENT_S, Fence
from rolling_panda import messages as m
from rolling_panda import reasons
from rolling_panda.errors import InputError, MessageError
from rolling_panda.messages.types import MOST_EPOCHS
from rolling_panda.reasons import text_of
from rolling_panda.runtime.latest_file import KeptValue
from rolling_panda.transport.codec import StrictDecoder, encode
from tests.bridge.test_bridge_core import IdealRobot
from tests.support.bridge_rig import MODEL, REST

TOKENS = ("aa", "bb", "cc")
SOMEBODY = st.sampled_from(TOKENS)
FILE = "bridge.json"
#: What a disk, or somebody's hand, may make of the file.
DAMAGED = (b"", b"{", b"\x00" * 64, b'{"epoch": 4611686018427387904}', b'{"epoch": -1}', b'{"epoch": 1e9, "stops": 1}')


def core(memory: KeptValue[Remembered], robot: IdealRobot | None = None) -> BridgeCore:
    config = BridgeConfig(joints_hz=1000.0)
    odometer = Odometer(MODEL.drive, OdometryConfig(), TICK_S)
    return BridgeCore(robot or IdealRobot(), config, MODEL.limits, odometer, "sim", memory=memory)


class Askers(RuleBasedStateMachine):
    """Three controllers, one bridge that starts again and whose file is damaged; `holder` and `epoch` are the model."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.now, self.holder, self.epoch, self.heard = 0.0, "", 0, 0.0
        self.sequence = 0
        self.told = 0, ""
        self.memory: KeptValue[Remembered] | None = None
        self.start()

    def start(self) -> None:
        self.memory = open_memory(self.folder)
        self.robot = IdealRobot()
        self.core = core(self.memory, self.robot)
        #: Unknown until somebody asks: then the holder from before has its time.
        self.heard = -1.0
        self.tick()

    def stop(self) -> None:
        if self.memory is not None:
            self.memory.close()
        self.memory = None

    def tick(self) -> None:
        self.now += TICK_S
        out = self.core.step(self.now)
        assert out.joints is not None
        self.echo = out.joints.sequence
        if out.state is not None:
            self.told = out.state.epoch, out.state.holder

    def asks(self, token: str) -> None:
        self.tick()
        self.core.on_token(m.TokenRequest(token=token, echo=self.echo, mode="READY"), self.now)
        if self.heard < 0.0:
            self.heard = self.now
        if token != self.holder and (not self.holder or self.now - self.heard >= SILENT_S):
            self.holder, self.epoch = token, self.epoch + 1
        if token == self.holder:
            self.heard = self.now

    @rule(token=SOMEBODY)
    def ask(self, token: str) -> None:
        self.asks(token)

    @rule(token=SOMEBODY, ahead=st.sampled_from([0, 0, 0, -1, 1, 2**20]))
    def command(self, token: str, ahead: int) -> None:
        self.tick()
        self.sequence += 1
        epoch, before = max(0, self.epoch + ahead), self.taken()
        command = m.MotionCommand(epoch=epoch, token=token, sequence=self.sequence, echo=self.echo, xi=REST)  # type: ignore[arg-type]
        self.core.on_motion(command, self.now)
        theirs = token == self.holder and epoch == self.epoch
        assert self.taken() == (self.sequence if theirs else before)
        if theirs:
            self.heard = self.now

    def taken(self) -> int:
        self.tick()
        return self.robot.sent[-1].sequence

    @rule(seconds=st.sampled_from([0.1, 0.5, 1.1]))
    def silence(self, seconds: float) -> None:
        self.now += seconds

    @rule(token=SOMEBODY)
    def give_way(self, token: str) -> None:
        self.core.on_token(m.TokenRequest(token=token, releases=True), self.now)
        if token == self.holder:
            self.holder = ""

    @rule()
    def restart(self) -> None:
        self.stop()
        self.start()

    @rule(content=st.sampled_from(DAMAGED))
    def damage(self, content: bytes) -> None:
        self.stop()
        (self.folder / FILE).write_bytes(content)
        for _ in range(2):
            with pytest.raises(InputError, match="bridge --begin-anew --state"):
                open_memory(self.folder)
        begin_anew(self.folder)
        self.holder, self.epoch = "", 0
        self.start()
        assert self.memory is not None
        (stop,) = self.memory.value.stops
        aside = (self.folder / FILE).with_suffix(".aside")
        assert stop.reason == reasons.bridge_state_set_aside(str(aside)) and aside.read_bytes() == content
        assert self.core.on_release(m.ReleaseStop(stop_id=stop.stop_id, user="ada", reason="looked"), self.now).ok

    @invariant()
    def one_holder_is_remembered_and_an_epoch_that_grew_by_one(self) -> None:
        if self.memory is None:
            return
        # The holder is named once it is on disk.
        end = time.monotonic() + 10.0
        while not self.memory.kept:
            assert time.monotonic() < end
            time.sleep(0.0005)
        self.tick()
        assert (self.memory.value.epoch, self.memory.value.token or "") == (self.epoch, self.holder)
        assert self.told == (self.epoch, m.fingerprint(self.holder) if self.holder else "")

    @precondition(lambda self: self.memory is not None)
    @rule(token=SOMEBODY)
    def nobody_is_locked_out_for_good(self, token: str) -> None:
        self.asks(token)
        self.now += SILENT_S
        self.asks(token)
        assert self.holder == token
        self.one_holder_is_remembered_and_an_epoch_that_grew_by_one()

    def teardown(self) -> None:
        self.stop()


TestAskers = Askers.TestCase
TestAskers.settings = settings(max_examples=25, stateful_step_count=25, deadline=None)


def test_an_epoch_of_ones_own_is_not_accepted_nor_kept() -> None:
    memory = KeptValue(Remembered())
    bridge = core(memory)
    for number in range(1, 4):
        bridge.step(number * TICK_S)
        bridge.on_token(m.TokenRequest(token="aa", echo=number, mode="READY"), number * TICK_S)
        for epoch, token in ((1, "aa"), (2, "mine"), (MOST_EPOCHS, "mine")):
            command = m.MotionCommand(epoch=epoch, token=token, sequence=number, echo=number, xi=REST)  # type: ignore[arg-type]
            bridge.on_motion(command, number * TICK_S)
    refused = {row.reason: row.count for row in bridge.refusals.counts() if row.topic == "command/motion"}
    assert refused == {f.UNKNOWN_EPOCH: 6}
    assert (memory.value.epoch, memory.value.token) == (1, "aa")


@pytest.mark.parametrize("epoch", [2**62, MOST_EPOCHS + 1, -1])
def test_an_absurd_epoch_is_refused_on_the_wire(epoch: int) -> None:
    command: Any = m.MotionCommand(epoch=epoch, token="mine", sequence=1, echo=1, xi=REST)  # type: ignore[arg-type]
    with pytest.raises(MessageError, match="epoch"):
        StrictDecoder(m.MotionCommand).decode(encode(command))


def test_an_absurd_epoch_on_disk_is_told_with_its_cause_and_one_command_ends_it(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / FILE).write_text('{"epoch": 4611686018427387904, "token": "eve"}')
    with pytest.raises(InputError) as told:
        open_memory(tmp_path)
    assert "epoch" in str(told.value) and str(tmp_path / FILE) in str(told.value)
    (line,) = [part for part in str(told.value).split("run: ") if part.startswith("rolling-panda bridge ")]
    assert main(line.split()[2:]) == 0
    assert "a stop is latched, which a supervisor has to reset" in capsys.readouterr().out
    memory = open_memory(tmp_path)
    assert memory.value.epoch == 0 and len(memory.value.stops) == 1
    memory.close()
    assert (tmp_path / "bridge.aside").read_text().startswith('{"epoch": 46')


def test_the_last_epoch_is_given_out_once_and_then_the_way_out_is_told() -> None:
    fence = Fence(MOST_EPOCHS - 1)
    assert fence.claim("aa", 0.0, at_rest=True) is None
    assert fence.claim("bb", SILENT_S, at_rest=True) == f.USED_UP and "--begin-anew" in text_of(f.USED_UP)


def test_the_token_changes_hands_at_rest_alone() -> None:
    fence = Fence()
    assert fence.claim("aa", 0.0, at_rest=False) == f.MOVING
    assert fence.claim("aa", 0.0, at_rest=True) is None
    assert fence.claim("aa", 0.1, at_rest=False) is None
    assert not fence.release("bb") and fence.release("aa")
    assert fence.claim("bb", 0.2, at_rest=False) == f.MOVING
    assert (fence.epoch, fence.token) == (1, None)


def test_an_older_epoch_is_told_from_one_that_was_never_issued() -> None:
    fence = Fence(3, "aa")
    assert [fence.refuse(epoch, "aa") for epoch in (2, 3, 4)] == [f.OLD_EPOCH, None, f.UNKNOWN_EPOCH]
    assert fence.refuse(3, "bb") == f.OTHER_TOKEN


def test_the_token_is_free_a_second_after_the_holders_last_valid_command() -> None:
    fence = Fence()
    assert fence.claim("aa", 0.0, at_rest=True) is None
    fence.renew(5.0)
    assert fence.claim("bb", 5.5, at_rest=True) == f.HELD
    assert fence.claim("bb", 6.1, at_rest=True) is None
