"""What engineers look at: programs of the processes, and the traffic of the wire."""

import time

from rolling_panda.messages.page import Diagnostics, TopicTraffic
from rolling_panda.topics import TOPICS
from server.robots.link import RobotLink


def diagnose(link: RobotLink, now: float) -> Diagnostics:
    """The programs and the traffic at `now` (s, monotonic)."""
    traffic = link.traffic
    return Diagnostics(
        wall_time=time.time(),
        programs=tuple(link.programs[name] for name in sorted(link.programs)),
        topics=tuple(
            TopicTraffic(
                name=topic.name,
                sender=topic.sender,
                nominal_hz=topic.rate_hz,
                received=traffic.knows(topic.name),
                count=traffic.count(topic.name),
                rate_hz=traffic.rate_hz(topic.name),
                age_s=traffic.age_s(topic.name, now),
                rejected=link.rejected[topic.name],
            )
            for topic in TOPICS
        ),
    )
