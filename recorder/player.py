"""Which messages of a recording are due: those of the time that passes, or after a jump the newest of each kind."""

import bisect
from collections import defaultdict

from recorder.tape import Recorded, Tape
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.messages import supervision as control_messages
from rolling_panda.messages.commands import SeekReplay
from rolling_panda.messages.supervision import ReplayState
from rolling_panda.topics import Topic

# What the robot tells of itself; commands and what pages ask for stay in the recording.
_PLAYED = {
    topic.name
    for topic in (
        topics.JOINTS, topics.ODOMETRY, topics.BRIDGE, topics.CONTROLLER, topics.CONTROL, topics.STOPS, topics.PLAN,
        topics.HEARTBEAT, topics.EVENT, topics.CAMERA, topics.POINTS, topics.CROPS, topics.OBSTACLES, topics.SCENERY,
    )
}  # fmt: skip
# While nothing passes, what is slower than this (Hz) is told once, and the rest so often (s) that it stays fresh.
_FAST_HZ, _AGAIN_S = 5.0, 0.1


class Player:
    """A position in a tape that moves with time. Pure: `now` (s) is the caller's clock."""

    def __init__(self, tape: Tape, name: str, now: float) -> None:
        """At the beginning, playing.

        Args:
            tape: Its messages in order.
            name: Of the file, for people.
            now: Present time (s).
        """
        self._name, self._tape = name, tape
        self._rows = [row for row in tape.rows if row.topic.name in _PLAYED and not _of_the_server(row)]
        self._times = [row.at - tape.begins_at for row in self._rows]
        kinds: defaultdict[tuple[str, str], list[int]] = defaultdict(list)
        for index, row in enumerate(self._rows):
            if row.topic is not topics.EVENT:
                kinds[row.topic.name, _process(row)].append(index)
        self._kinds = list(kinds.values())
        self._position, self._now, self._told = 0.0, now, float("-inf")
        self._next = 0
        self._jumped = False
        self._playing = True

    @property
    def state(self) -> ReplayState:
        """Where it stands."""
        return ReplayState(
            name=self._name,
            begins_at=self._tape.begins_at,
            duration_s=self._tape.duration_s,
            position_s=self._position,
            playing=self._playing,
        )

    def seek(self, request: SeekReplay) -> None:
        """Go somewhere, or stand still, or go on."""
        self._playing = request.playing
        if request.position_s is not None:
            self._position = min(request.position_s, self._tape.duration_s)
            self._next = bisect.bisect_right(self._times, self._position)
            self._jumped = True

    def step(self, now: float) -> list[Recorded]:
        """Let time pass until `now`; what is to be told, in order."""
        passed, self._now = now - self._now, now
        due: list[Recorded] = []
        if self._jumped:
            self._jumped = False
            self._told = now
            due = self._newest(all_kinds=True)
        if self._playing:
            self._position = min(self._position + passed, self._tape.duration_s)
            end = bisect.bisect_right(self._times, self._position)
            due += self._rows[self._next : end]
            self._next = end
            self._playing = self._position < self._tape.duration_s
        elif now - self._told >= _AGAIN_S:
            self._told = now
            due += self._newest(all_kinds=False)
        return due

    def _newest(self, all_kinds: bool) -> list[Recorded]:
        """The newest of each kind up to the position."""
        found = []
        for indices in self._kinds:
            before = bisect.bisect_left(indices, self._next)
            row = self._rows[indices[before - 1]] if before else None
            if row is not None and (all_kinds or row.topic.rate_hz >= _FAST_HZ):
                found.append(row)
        return found


def _process(row: Recorded) -> str:
    """What several processes tell on one topic is not one kind."""
    if row.topic is topics.HEARTBEAT or row.topic is topics.STOPS:
        message = row.message()
        if isinstance(message, m.Heartbeat | control_messages.StopState):
            return str(message.process)
    return ""


def _of_the_server(row: Recorded) -> bool:
    return _process(row) == "server"


def played(topic: Topic[m.Message]) -> bool:
    """Whether messages of this topic are told again."""
    return topic.name in _PLAYED
