"""`rolling-panda bench replay FILE PROCESS`: a recording is played into a process, and what it says is compared.

The process runs as it is now, on a simulated clock, with the recorded messages of the others as its input. Commands of
operators are on no topic, so a controller says the same until the first of them. Stamps and durations of the loop are
left out of the comparison. A recording that begins later than the process differs in sequence numbers and in what the
process had learned by then.
"""

import secrets
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from msgspec.structs import replace

from benchmarks.common.documents import bench_parser, write
from controller.config import ControllerConfig
from controller.core import Controller
from perception.config import PerceptionConfig
from perception.loop import PerceptionProcess, Worker
from perception.pipeline import Perception
from perception.segmentation.segmenter import choose_segmenter
from recorder.recording import read_recording
from rolling_panda import messages as m
from rolling_panda.config import RobotConfig, load_section
from rolling_panda.errors import RollingPandaError
from rolling_panda.model.robot import RobotModel
from rolling_panda.resources import resource
from rolling_panda.topics import TOPIC_OF
from rolling_panda.transport.codec import encode
from rolling_panda.transport.memory import World
from rolling_panda.transport.runner import Core
from tests.support.worlds.world import RecordedController

Job = TypeVar("Job")
Result = TypeVar("Result")
#: A message and its time since the beginning (s).
Said = tuple[float, m.Message]


@dataclass(frozen=True)
class Comparison:
    """What a process said on a topic, then and now.

    Attributes:
        topic: Name of the topic.
        recorded: Messages in the recording.
        replayed: Messages of the replay.
        equal: Recorded messages that the replay has too.
        differs_at: Time of the first one that it has not (s); None without one.
        fields: Fields in which that one differs from what the replay said next to it in time.
    """

    topic: str
    recorded: int
    replayed: int
    equal: int
    differs_at: float | None
    fields: tuple[str, ...] = ()


class _World(World):
    """Keeps what is said."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[Said] = []

    def say(self, message: m.Message) -> None:
        self.said.append((self.now, message))


def replay(messages: Sequence[Said], process: m.Process, core: Core, period_s: float) -> list[Said]:
    """What a process says to recorded messages.

    Args:
        messages: All that was recorded, in order of time.
        process: The process.
        core: Its core.
        period_s: Time between its steps (s).
    """
    world = _World()
    node = world.add(process, core, period_s)
    heard = [each for each in messages if TOPIC_OF[type(each[1])].read_by(process) and sender(each[1]) != process]
    end, following = messages[-1][0], 0
    while world.now < end:
        tick = (world.ticks + 1) * world.tick_s
        while following < len(heard) and heard[following][0] < tick + 0.5 * world.tick_s:
            node.wire.deliver(TOPIC_OF[type(heard[following][1])], heard[following][1], tick)
            following += 1
        world.tick()
    return world.said


def compare(recorded: Iterable[Said], replayed: Iterable[Said], process: m.Process) -> list[Comparison]:
    """What a process said then and now, by topic."""
    then = [each for each in recorded if sender(each[1]) == process]
    rows = []
    for kind in sorted({type(message) for _, message in then}, key=lambda kind: TOPIC_OF[kind].name):
        before = [(at, _comparable(message)) for at, message in then if type(message) is kind]
        now = [(at, _comparable(message)) for at, message in replayed if type(message) is kind]
        left = Counter(encode(message) for _, message in now)
        differing = []
        for at, message in before:
            content = encode(message)
            if left[content] > 0:
                left[content] -= 1
            else:
                differing.append((at, message))
        first = differing[0] if differing else None
        fields = (
            () if first is None or not now else _fields(first[1], min(now, key=lambda each: abs(each[0] - first[0]))[1])
        )
        equal, differs_at = len(before) - len(differing), None if first is None else first[0]
        rows.append(Comparison(TOPIC_OF[kind].name, len(before), len(now), equal, differs_at, fields))
    return rows


def sender(message: m.Message) -> str:
    """The process that sent a message; empty where it does not say."""
    if isinstance(message, m.StopRequest):
        return message.source
    said = getattr(message, "process", "")
    return str(said) or TOPIC_OF[type(message)].sender


def _fields(one: m.Message, other: m.Message) -> tuple[str, ...]:
    """Names of the fields in which two messages of one type differ."""
    return tuple(name for name in one.__struct_fields__ if getattr(one, name) != getattr(other, name))


def _comparable(message: m.Message) -> m.Message:
    """The message without stamp and durations."""
    changes: dict[str, Any] = {}
    if isinstance(header := getattr(message, "header", None), m.Header):
        changes["header"] = replace(header, stamp=0.0)
    if isinstance(message, m.ControllerState):
        changes |= {"tick_s": 0.0, "ticks": 0, "late_ticks": 0}
    return replace(message, **changes)


class _AtOnce(Worker[Job, Result]):
    """A worker without a thread: a job is done when it is submitted, so that a replay repeats."""

    def __init__(self, work: Callable[[Job], Result]) -> None:
        self._work = work
        self._result: Result | RollingPandaError | None = None

    def submit(self, job: Job, now: float) -> bool:
        try:
            self._result = self._work(job)
        except RollingPandaError as error:
            self._result = error
        return True

    def poll(self) -> Result | RollingPandaError | None:
        result, self._result = self._result, None
        return result

    def busy_for(self, now: float) -> float:
        return 0.0


def perception(path: Path) -> tuple[Core, float]:
    """Perception by a configuration file, and its period (s)."""
    config = load_section(path, "perception", PerceptionConfig)
    model = RobotModel(load_section(path, "robot", RobotConfig))
    segmenter = choose_segmenter(config.segmenter, Path(config.weights) if config.weights else None, config.threads)
    return PerceptionProcess(config, Perception(config, segmenter, model), _AtOnce), 1.0 / config.rate_hz


def controller(path: Path, messages: Iterable[Said]) -> tuple[Core, float]:
    """A controller by a configuration file that draws the tokens of the recorded one, and its period (s)."""
    config = load_section(path, "controller", ControllerConfig)
    drawn = iter(dict.fromkeys(message.token for _, message in messages if isinstance(message, m.TokenRequest)))
    core = Controller(
        config, load_section(path, "robot", RobotConfig), draw=lambda: next(drawn, "") or secrets.token_hex(8)
    )
    return RecordedController(core), 1.0 / config.rate_hz


def main(argv: Sequence[str]) -> int:
    """Replay, print and write the comparison; returns 0 where everything is equal."""
    parser = bench_parser("replay", __doc__)
    parser.add_argument("file", type=Path, metavar="FILE", help="MCAP file of `rolling-panda record`")
    parser.add_argument("process", choices=("perception", "controller"), help="process that is run again")
    parser.add_argument("--config", type=Path, default=resource("assets/config/sim.toml"), help="its configuration")
    arguments = parser.parse_args(argv)
    recording = read_recording(arguments.file)
    messages = [(each.at - recording.begins_at, each.message()) for each in recording.messages]
    process: m.Process = arguments.process
    path = arguments.config
    core, period_s = perception(path) if process == "perception" else controller(path, messages)
    rows = compare(messages, replay(messages, process, core, period_s), process)
    print(f"{'topic':<24}{'recorded':>10}{'replayed':>10}{'equal':>8}  first difference")
    for row in rows:
        first = "" if row.differs_at is None else f"{row.differs_at:.2f} s: {', '.join(row.fields)}"
        print(f"{row.topic:<24}{row.recorded:>10}{row.replayed:>10}{row.equal:>8}  {first}")
    write(arguments.json, {"process": process, "topics": [asdict(row) for row in rows]})
    return 0 if all(row.equal == row.recorded for row in rows) else 1
