"""Two robots behind one server: what is asked of one never reaches the other, and one stop reaches both."""

import threading
from contextlib import contextmanager

import msgspec
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from rolling_panda import reasons, topics
from rolling_panda.messages.supervision import StopRecord, StopState
from rolling_panda.reasons import said
from tests.server.test_misuse import control
from tests.server.test_page_socket import Page
from tests.server.test_proxy import drawn
from tests.support.fake_wire import FakeWire, bridge_state, controller_state, pruning_point, pruning_points, telling
from tests.support.running_server import eventually, running_server

NAMES = ("rp1", "rp2")


def numbered(name):
    """The point of a robot, on a vine of the robot's number."""
    return msgspec.structs.replace(pruning_point(f"only-{name}"), vine=int(name[-1]))


@pytest.fixture(scope="module")
def server():
    wires = {name: FakeWire() for name in NAMES}
    with running_server(wires["rp1"], rp2=wires["rp2"]) as running, telling(wires["rp1"]), telling(wires["rp2"]):
        for name, wire in wires.items():
            wire.deliver(topics.BRIDGE, bridge_state())
            wire.deliver(topics.CONTROLLER, controller_state(mode="READY" if name == "rp1" else "PAUSED"))
            wire.deliver(topics.POINTS, pruning_points(numbered(name)))
        running.wires = wires
        yield running


@pytest.fixture(scope="module")
def robots(server):
    """Both robots as their own pages see the server, each with its wire."""
    return [server.robot(name, wire) for name, wire in server.wires.items()]


@pytest.fixture
def client(robots):
    with robots[0].client(user="ann") as client:
        yield client


@contextmanager
def latching(*robots):
    """Bridge and controller of these latch each stop that they are sent."""
    over = threading.Event()

    def latch():
        while not over.wait(0.005):
            for robot in robots:
                records = tuple(StopRecord(each, "server", "ann", said(""), 0.0) for each in stops(robot))
                for process in ("bridge", "controller"):
                    robot.wire.deliver(topics.STOPS, StopState(process=process, stops=records))

    thread = threading.Thread(target=latch)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def stops(robot):
    return {stop.stop_id for stop in robot.wire.sent[topics.STOP.name]}


def hold(client, name):
    """Look at a robot and hold it, as a script does; what is answered."""
    assert client.get(f"/robots/{name}/api/state").status_code == 200
    demand = {"hold": True, "base": {"linear": 0.1, "angular": 0.0}}
    return client.post(f"/robots/{name}/api/teleop", json=demand).json().get("code", "holding")


def test_one_cookie_opens_every_robot_and_none_opens_without_it(robots, client):
    assert client.get("/").headers["location"] == "/robots/rp1/"
    for name in NAMES:
        page = client.get(f"/robots/{name}/")
        assert page.status_code == 200 and "js/app.js" in page.text
        assert "unsafe-inline" not in page.headers["content-security-policy"]
        assert "unsafe-inline" in client.get(f"/robots/{name}/viser/").headers["content-security-policy"]
        assert client.get(f"/robots/{name}/js/app.js").status_code == 200
    with robots[0].visitor() as visitor:
        for path in ("api/state", "camera/color.jpg", "viser/", "api/robots"):
            assert visitor.get(f"/robots/rp2/{path}").status_code == 401
        assert "sign-in.js" in visitor.get("/robots/rp2/").text
        assert visitor.get("/api/robots").status_code == visitor.get("/robots/rp3/api/state").status_code == 401
        assert client.post("/robots/rp2/api/arm", headers={"origin": "http://else.where"}, json={}).status_code == 403


@pytest.mark.parametrize("path", ["api/state", "", "ws", "viser/", "api/stop"])
def test_a_robot_that_is_not_there_is_a_clear_404(client, path):
    answer = client.post(f"/robots/rp3/{path}", json={}) if "api/" in path else client.get(f"/robots/rp3/{path}")
    assert answer.status_code == 404
    assert answer.json()["values"] == {"robot": "rp3", "robots": "rp1, rp2"}


def test_without_a_robots_name_nothing_is_asked_of_any(server, robots, client):
    for path in ("/api/arm", "/api/start", "/api/teleop", "/api/reset", "/api/control/take"):
        assert client.post(path, json={"reason": "x"}).status_code in (404, 405)
    assert client.post("/robots/rp1%2F..%2Frp2/api/arm", json={}).status_code in (404, 405)
    for path in ("/api/state", "/api/points", "/camera/color.jpg", "/viser/"):
        assert client.get(path).status_code == 404
    for path in ("/ws", "/viser", "/robots/rp3/ws"):
        with pytest.raises(InvalidStatus):
            server.socket(client, path)
    assert not robots[0].wire.asked + robots[1].wire.asked


def test_what_is_asked_of_one_reaches_that_one_alone(robots, client):
    one, other = robots
    assert client.post("/robots/rp2/api/arm", json={}).status_code == 200
    assert [type(asked).__name__ for asked in other.wire.asked] == ["Arm"] and not one.wire.asked
    for name in NAMES:
        eventually(
            lambda name=name: (
                [row["point"]["point_id"] for row in client.get(f"/robots/{name}/api/points").json()["points"]]
                == [f"only-{name}"]
            )
        )
        with Page(robots[NAMES.index(name)], client) as page:
            assert page.hear("PageState")["controller"]["mode"] == {"rp1": "READY", "rp2": "PAUSED"}[name]
    eventually(lambda: "/vines/2" in drawn(other, client))
    assert "/vines/1" not in drawn(other, client)


def test_who_holds_control_of_one_holds_nothing_of_the_other(robots, client):
    one, other = robots
    mine = client.get("/robots/rp1/api/state").json()["client"]
    one.wire.deliver(topics.CONTROL, control(mine))
    other.wire.deliver(topics.CONTROL, control("somebody else"))
    try:
        eventually(lambda: hold(client, "rp1") == "holding")
        assert hold(client, "rp2") == "control_held"
        # A glance is as old as the last state that was made.
        eventually(lambda: [each["yours"] for each in client.get("/api/robots").json()] == [True, False])
        told = client.get("/api/robots").json()[1]
        assert told["path"] == "/robots/rp2/" and told["mode"] == "PAUSED"
    finally:
        client.post("/robots/rp1/api/teleop", json={"hold": False})
        for robot in robots:
            robot.wire.deliver(topics.CONTROL, control(""))


def test_one_person_holds_one_robot_at_a_time(robots, client):
    other = robots[1].wire.sent[topics.TELEOP.name]

    def refused():
        del other[:]
        words = [hold(client, name) for name in NAMES]
        if words == ["holding", "other_robot_held"]:
            return True
        # This machine has paused for longer than a hold lives: once more.
        for name in NAMES:
            client.post(f"/robots/{name}/api/teleop", json={"hold": False})
        return False

    eventually(refused, 20.0)
    assert not any(target.hold for target in other)
    client.post("/robots/rp1/api/teleop", json={"hold": False})
    eventually(lambda: hold(client, "rp2") == "holding")
    client.post("/robots/rp2/api/teleop", json={"hold": False})


def test_a_glance_at_a_robot_is_no_look_at_it(robots, client):
    one, other = (robot.wire.sent[topics.PRESENCE.name] for robot in robots)
    with Page(robots[0], client) as page:
        page.look()
        eventually(lambda: not other[-1].people)
        for _ in range(3):
            page.look()
            assert client.get("/api/robots").status_code == 200
        said = len(other)
        eventually(lambda: len(other) > said + 1)
        assert not any(each.people for each in other[said:])
        page.look()
        eventually(lambda: one[-1].people)


def test_a_stop_of_one_leaves_the_other_alone_and_the_one_at_the_root_stops_all(robots, client):
    one, other = robots
    for robot in robots:
        robot.wire.sent[topics.STOP.name].clear()
    assert client.post("/robots/rp2/api/stop", json={"reason": "only that"}).status_code == 503
    eventually(lambda: stops(other))
    assert not stops(one)
    with one.client("viewer", "eve") as eve:
        answer = eve.post("/api/stop", json={"reason": "both"})
    assert answer.status_code == 503
    assert (answer.json()["code"], answer.json()["values"]) == ("stop_of_all_unconfirmed", {"robots": "rp1, rp2"})
    assert len(stops(one)) == 1 and len(stops(other)) == 2
    with latching(*robots):
        answer = client.post("/api/stop")
    assert answer.status_code == 200, answer.text
    assert answer.json()["reason"] == reasons.text_of(reasons.stop_of_all_confirmed("rp1, rp2"))
    with latching(one):
        answer = client.post("/api/stop")
    assert (answer.status_code, answer.json()["values"]) == (503, {"robots": "rp2"})
    assert {stop.reason for stop in one.wire.sent[topics.STOP.name]} == {said("both"), said("software stop")}


def test_signing_out_of_one_signs_out_of_all_and_lets_everything_go(robots, client):
    one, other = robots
    with Page(one, client) as first, Page(other, client) as second:
        second.hold_until_sent(other)
        assert client.post("/robots/rp1/api/sign-out", json={}).status_code == 200
        for page in (first, second):
            with pytest.raises(ConnectionClosed):
                page.hear("never")
    eventually(lambda: not other.wire.sent[topics.TELEOP.name][-1].hold)
    for name in NAMES:
        assert client.get(f"/robots/{name}/api/state").status_code == 401
    for robot in robots:
        said = robot.wire.sent[topics.EVENT.name]
        eventually(lambda said=said: reasons.signed_out("ann") in [event.reason for event in said])
