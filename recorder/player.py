"""Plays a recording: the messages that are due, and after a seek the newest of each topic and process."""

import bisect
from collections import defaultdict
from typing import Any

from recorder.recording import RecordedMessage, Recording
from rolling_panda import messages as m
from rolling_panda import topics
from rolling_panda.commands import SeekReplay
from rolling_panda.messages.supervision import ReplayState, StopState, Timeline
from rolling_panda.timeline import TimelineBuilder
from rolling_panda.topics import Topic

#: State of the robot; commands and requests are not played.
_PLAYED = {
    topic.name
    for topic in (
        topics.JOINTS, topics.ODOMETRY, topics.BRIDGE, topics.CONTROLLER, topics.CONTROL, topics.STOPS, topics.PLAN,
        topics.HEARTBEAT, topics.EVENT, topics.CAMERA, topics.POINTS, topics.PICTURES, topics.OBSTACLES, topics.SCENERY,
        topics.SCENERY_MOTION, topics.REPORT, topics.PROGRAM,
    )
}  # fmt: skip
#: While paused, messages of topics at least this fast (Hz) are repeated with this period (s), so that they do not get
#: stale.
_REPEATED_HZ, _REPEAT_PERIOD_S = 5.0, 0.1


class Player:
    """Playback position in a recording. It has no clock: `now` (s) is the caller's."""

    def __init__(self, recording: Recording, name: str, now: float) -> None:
        """Stand at the beginning, to be played at its own speed.

        Args:
            recording: The recording.
            name: Of the file, for display.
            now: Present time (s).
        """
        self._name, self._recording = name, recording
        self._messages = [each for each in recording.messages if is_played(each.topic) and _process(each) != "server"]
        self._times = [each.at - recording.begins_at for each in self._messages]
        sources: defaultdict[tuple[str, str], list[int]] = defaultdict(list)
        for index, each in enumerate(self._messages):
            if each.topic is not topics.EVENT:
                sources[each.topic.name, _process(each)].append(index)
        self._sources = list(sources.values())
        self._position, self._now, self._repeated = 0.0, now, float("-inf")
        self._next = 0
        self._sought = False
        self._playing, self._speed = False, 1.0
        #: Of the whole recording.
        self.timeline = _timeline(recording)

    @property
    def state(self) -> ReplayState:
        """Playback state."""
        return ReplayState(
            name=self._name,
            begins_at=self._recording.begins_at,
            duration_s=self._recording.duration_s,
            position_s=self._position,
            playing=self._playing,
            speed=self._speed,
            complete=self._recording.complete,
        )

    def seek(self, request: SeekReplay) -> None:
        """Set position and speed, pause or continue."""
        self._playing, self._speed = request.playing, request.speed or self._speed
        if request.position_s is not None:
            self._position = min(request.position_s, self._recording.duration_s)
            self._next = bisect.bisect_right(self._times, self._position)
            self._sought = True

    def step(self, now: float) -> list[RecordedMessage]:
        """Advance to `now`; returns the messages that are due, in order."""
        elapsed, self._now = now - self._now, now
        due: list[RecordedMessage] = []
        if self._sought:
            self._sought = False
            self._repeated = now
            due = self._newest(0.0)
        if self._playing:
            self._position = min(self._position + self._speed * elapsed, self._recording.duration_s)
            end = bisect.bisect_right(self._times, self._position)
            due += self._messages[self._next : end]
            self._next = end
            self._playing = self._position < self._recording.duration_s
        elif now - self._repeated >= _REPEAT_PERIOD_S:
            self._repeated = now
            due += self._newest(_REPEATED_HZ)
        return due

    def _newest(self, min_rate_hz: float) -> list[RecordedMessage]:
        """The newest message of each source up to the position, of topics with a least rate."""
        counts = [(indices, bisect.bisect_left(indices, self._next)) for indices in self._sources]
        newest = [self._messages[indices[count - 1]] for indices, count in counts if count]
        return [each for each in newest if each.topic.rate_hz >= min_rate_hz]


def _process(recorded: RecordedMessage) -> str:
    """The sender, on topics with several senders; else empty."""
    if recorded.topic in (topics.HEARTBEAT, topics.STOPS, topics.PROGRAM):
        message = recorded.message()
        if isinstance(message, m.Heartbeat | StopState | m.Program):
            return str(message.process)
    return ""


def _timeline(recording: Recording) -> Timeline:
    builder = TimelineBuilder()
    for each in recording.messages:
        if each.topic is topics.EVENT:
            line = each.message()
            assert isinstance(line, m.LogEvent)
            builder.add(each.at, line)
    return builder.timeline(recording.begins_at, recording.begins_at + recording.duration_s)


def is_played(topic: Topic[Any]) -> bool:
    """Whether messages of this topic are played."""
    return topic.name in _PLAYED
