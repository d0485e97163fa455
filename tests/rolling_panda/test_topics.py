"""The table of what is on the wire is complete and consistent."""

from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda import topics as t
from rolling_panda.commands import PlantRequest


def test_names_are_unique_and_keys_carry_robot_and_version() -> None:
    names = [row.name for row in (*t.TOPICS, *t.SERVICES)]
    assert len(names) == len(set(names))
    assert t.key("rp7", t.MOTION.name) == f"rp/rp7/v{m.SCHEMA_VERSION}/command/motion"


def test_every_message_is_on_the_wire_once() -> None:
    carried = [topic.message for topic in t.TOPICS] + [r for s in t.SERVICES for r in s.requests] + [m.Answer]
    assert len(carried) == len(set(carried))
    modules = (m, intents)
    defined = [value for module in modules for value in vars(module).values()]
    known = {
        kind
        for kind in defined
        if isinstance(kind, type) and issubclass(kind, m.Message | intents.Intent | PlantRequest)
    }
    assert set(carried) == known - {m.Message, intents.Intent, PlantRequest}


def test_senders_and_servers_are_processes() -> None:
    for topic in t.TOPICS:
        assert topic.sender == "any" or set(topic.sender.split(", ")) <= set(m.PROCESSES), topic.name
    for service in t.SERVICES:
        assert service.server in m.PROCESSES and service.timeout_s > 0, service.name


def test_motion_is_never_queued_and_a_stop_never_dropped() -> None:
    for topic in (t.MOTION, t.TELEOP):
        assert (topic.priority, topic.congestion, topic.express) == ("REAL_TIME", "DROP", True)
    assert (t.STOP.priority, t.STOP.congestion, t.STOP.express) == ("REAL_TIME", "BLOCK", True)


def test_images_never_delay_state() -> None:
    for topic in (t.CAMERA, t.POINTS, t.SCENERY):
        assert topic.priority in ("DATA_LOW", "BACKGROUND") and topic.congestion == "DROP"


def test_what_is_latched_is_repeated() -> None:
    assert all(topic.rate_hz > 0 for topic in t.TOPICS if topic.latched)


def test_cutting_and_motion_come_from_the_controller_alone() -> None:
    assert {topic.sender for topic in (t.MOTION, t.CUT)} == {"controller"}
