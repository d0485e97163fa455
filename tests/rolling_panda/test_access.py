"""On a wire with certificates each process may say what is its own to say, and an intruder nothing at all."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import msgspec
import numpy as np
import pytest

from bridge.sim.robot.trace import read
from rolling_panda import commands as intents
from rolling_panda import messages as m
from rolling_panda.config import TransportConfig
from rolling_panda.errors import InputError, ServiceError, TransportError
from rolling_panda.reasons import said
from rolling_panda.topics import BRIDGE, INTENT, JOINTS, MOTION, RELEASE, SERVICES, STOP, TOKEN, TOPICS, key
from rolling_panda.transport.access import BEARERS, CALLERS, access_control
from rolling_panda.transport.certificates import APART, NAMES, main, make
from rolling_panda.transport.zenoh import ForeignWire, Onlooker, Router, Transport
from tests.support.processes.local_router import free_port
from tests.support.processes.processes import Processes
from tests.support.waiting import until

pytestmark = pytest.mark.processes

ROBOTS = ("rp1", "rp2")


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wire") / "certificates"
    make(folder, ("127.0.0.1",), 2)
    return folder


def config(endpoint: str, folder: Path | str) -> TransportConfig:
    return TransportConfig(connect=(endpoint,), connect_timeout_s=2.0, certificates=str(folder))


@pytest.fixture(scope="module")
def endpoint(certificates: Path):
    endpoint = f"tls/127.0.0.1:{free_port()}"
    router = Router(TransportConfig(mode="router", connect=(), listen=(endpoint,), certificates=str(certificates)))
    yield endpoint
    router.close()


def test_each_topic_is_said_by_its_senders_and_carried_to_its_readers_alone(certificates: Path, endpoint: str) -> None:
    """Everybody with a certificate says something on every topic, and asks to be told every topic, also by wildcard."""
    settings = config(endpoint, certificates)
    got: set[tuple[str, str, str]] = set()
    with ExitStack() as stack:
        bearers = {name: ForeignWire(settings, name) for name in BEARERS}
        for wire in bearers.values():
            stack.callback(wire.close)
        wanted = [key("rp1", topic.name) for topic in TOPICS]

        def listen(reader: str) -> Callable[[bytes, float], None]:
            def hear(said: bytes, at: float) -> None:
                sender, where = said.decode().split()
                got.add((sender, where, reader))

            return hear

        for reader, wire in bearers.items():
            for where in (*wanted, key("rp1", "**"), "**"):
                wire.subscribe(where, listen(reader))
        says = [
            (wire.publisher(where), f"{sender} {where}".encode())
            for sender, wire in bearers.items()
            for where in wanted
        ]
        expected = {
            (sender, key("rp1", topic.name), reader)
            for topic in TOPICS
            for sender in m.PROCESSES
            for reader in BEARERS
            if topic.said_by(sender) and topic.read_by(reader)
        }

        def everybody_says_everything() -> None:
            for say, what in says:
                say(what)
            time.sleep(0.2)

        end = time.monotonic() + 20.0
        while not got >= expected and time.monotonic() < end:
            everybody_says_everything()
        # Once more: what should not come would have come with it.
        everybody_says_everything()
    # What a session says itself is delivered within it, without any router.
    assert {row for row in got if row[0] != row[2]} == {row for row in expected if row[0] != row[2]}


def test_a_service_is_asked_by_its_callers_and_answered_by_its_process(certificates: Path, endpoint: str) -> None:
    settings = config(endpoint, certificates)
    release = m.ReleaseStop(stop_id="s", user="ada", reason="test")
    with (
        Transport(settings, "bridge", "rp1") as bridge,
        Transport(settings, "controller", "rp1") as controller,
        Transport(settings, "server", "rp1") as server,
    ):
        bridge.serve(RELEASE, lambda request: m.Answer(ok=True, reason=said("the bridge")))
        controller.serve(INTENT, lambda request: m.Answer(ok=True, reason=said("the controller")))
        time.sleep(0.3)
        assert controller.call(RELEASE, release).reason == said("the bridge")
        with pytest.raises(ServiceError):
            server.call(RELEASE, release)
        assert server.present() == {"bridge", "controller", "server"}
        with Transport(settings, "perception", "rp1") as perception:
            # What it declares to answer does not count, and what it asks is not answered.
            perception.serve(RELEASE, lambda request: m.Answer(ok=True, reason=said("not the bridge")))
            time.sleep(0.3)
            assert {controller.call(RELEASE, release).reason for _ in range(10)} == {said("the bridge")}
            with pytest.raises(ServiceError):
                perception.call(INTENT, intents.Arm(user="eve"))
        assert server.call(INTENT, intents.Arm(user="ada")).reason == said("the controller")


def test_the_table_names_the_callers_of_every_service() -> None:
    assert set(CALLERS) == {service.name for service in SERVICES}
    assert INTENT.name in CALLERS
    told = access_control()
    assert told["default_permission"] == "deny"
    names = {subject["cert_common_names"][0] for subject in told["subjects"]}
    assert names == {f"{name}.rp1" for name in BEARERS}


def test_every_rule_is_for_one_robot() -> None:
    told = access_control(ROBOTS)
    for rule in told["rules"]:
        robot = rule["id"].split(":")[0]
        assert all(expression.startswith(f"rp/{robot}/") for expression in rule["key_exprs"]), rule
    for policy in told["policies"]:
        robot = policy["subjects"][0].rsplit(".", 1)[1]
        assert policy["rules"] and all(rule.startswith(f"{robot}:") for rule in policy["rules"])


def test_one_robots_certificates_say_nothing_to_another_robot(tmp_path: Path) -> None:
    """Two robots at one router: a process is heard on its own robot's keys."""
    endpoint, folder = f"tls/127.0.0.1:{free_port()}", tmp_path / "two"
    make(folder, ("127.0.0.1",), 2, ROBOTS)
    settings, command = config(endpoint, folder), m.MotionCommand(epoch=1, sequence=1, echo=1, xi=(0.0,) * 9)
    router = Router(msgspec.structs.replace(settings, mode="router", connect=(), listen=(endpoint,), robots=ROBOTS))
    with ExitStack() as stack:
        stack.callback(router.close)

        def wire(process: m.Process, robot: str, certificates: Path) -> Transport:
            return stack.enter_context(Transport(config(endpoint, certificates), process, robot))

        heard = {robot: wire("bridge", robot, folder).slot(MOTION) for robot in ROBOTS}
        said = {robot: wire("controller", robot, folder / "rp2").publisher(MOTION) for robot in ROBOTS}
        until(lambda: said["rp2"].put(command) or heard["rp2"].peek() is not None, 10.0)
        for _ in range(5):
            for publisher in said.values():
                publisher.put(command)
            time.sleep(0.05)
        assert heard["rp1"].peek() is None


def test_without_a_certificate_of_this_authority_nobody_comes_in(
    certificates: Path, endpoint: str, tmp_path: Path
) -> None:
    with pytest.raises(TransportError):
        Transport(
            TransportConfig(connect=(endpoint.replace("tls", "tcp"),), connect_timeout_s=1.0, plain_wire=True),
            "controller",
            "rp1",
        )
    make(tmp_path / "own", ("127.0.0.1",), 2)
    with pytest.raises(TransportError):
        Transport(config(endpoint, tmp_path / "own"), "controller", "rp1")
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    (mixed / "ca.pem").write_bytes((certificates / "ca.pem").read_bytes())
    for name in ("controller.pem", "controller.key"):
        (mixed / name).write_bytes((tmp_path / "own" / name).read_bytes())
    with Onlooker(config(endpoint, certificates), "rp1") as listener:
        got = listener.slot(STOP)
        time.sleep(0.3)
        with pytest.raises(TransportError):
            intruder = Transport(config(endpoint, mixed), "controller", "rp1")
            stop = m.StopRequest(stop_id="a", source="x", user="eve", reason=said("r"))
            intruder.publisher(STOP).put(stop)
        time.sleep(0.3)
        assert got.peek() is None


def test_what_does_not_fit_is_one_clear_line(certificates: Path, tmp_path: Path, capsys) -> None:
    with pytest.raises(TransportError, match="no certificate file .*bridge.pem.*rolling-panda certificates"):
        folder = tmp_path / "some"
        folder.mkdir()
        (folder / "ca.pem").write_text("")
        Transport(config("tls/127.0.0.1:1", folder), "bridge", "rp1")
    with pytest.raises(TransportError, match="every endpoint is tls/HOST:PORT; got tcp/127.0.0.1:1"):
        Transport(config("tcp/127.0.0.1:1", certificates), "bridge", "rp1")
    with pytest.raises(InputError, match="give --out a new folder"):
        make(certificates, ("127.0.0.1",), 2)
    assert main(["--out", str(tmp_path / "new"), "--days", "0"]) == 1
    assert "1 to 3650" in capsys.readouterr().err
    assert main(["--out", str(tmp_path / "new")]) == 0
    assert all((tmp_path / "new" / f"{name}.key").stat().st_mode & 0o077 == 0 for name in NAMES)


def test_apart_each_has_its_own_and_they_are_kept_until_they_are_too_old(tmp_path: Path, capsys) -> None:
    out = tmp_path / "volumes"

    def made(days: int) -> dict[str, bytes]:
        assert main(["--apart", "--out", str(out), "--days", str(days)]) == 0
        return {str(path.relative_to(out)): path.read_bytes() for path in out.rglob("*.*")}

    first = made(6)
    for name in APART:
        held = {Path(path).stem for path in first if path.startswith(f"{name}/")} - {"ca"}
        assert held == {name, "onlooker"} if name in m.PROCESSES else {name}
        assert (out / name).stat().st_mode & 0o777 == 0o700
    assert len({first[f"{name}/ca.pem"] for name in APART}) == 1
    # Good for less than a week: anew, all of them.
    second = made(30)
    assert set(second) == set(first) and not set(second.values()) & set(first.values())
    assert made(30) == second and "kept what was there" in capsys.readouterr().out
    # An interrupted start leaves some of two authorities: anew.
    (out / "server/ca.pem").write_bytes(first["server/ca.pem"])
    assert not set(made(30).values()) & set(second.values())
    assert main(["--apart", "--out", str(out), "--robot", "a", "--robot", "b"]) == 1
    assert "--apart is for one robot; got a, b" in capsys.readouterr().err


def commands(wire: Transport, seconds: float) -> None:
    """Ask for the token, and drive forward by commands that answer the newest joint state, as a controller does."""
    joints, state = wire.slot(JOINTS), wire.slot(BRIDGE)
    token, motion = wire.publisher(TOKEN), wire.publisher(MOTION)
    end, sequence = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        newest, bridge = joints.peek(), state.peek()
        if newest is not None:
            sequence, echo = sequence + 1, newest.message.sequence
            xi = (0.0 if sequence < 40 else 1.0,) * 2 + (0.0,) * 7
            # The epoch of one's own making is what the bridge has given out, where that is not told.
            epoch = 1 if bridge is None else bridge.message.epoch
            command = m.MotionCommand(epoch=epoch, token="aa", sequence=sequence, echo=echo, xi=xi)
            token.put(m.TokenRequest(token="aa", echo=echo, mode="TELEOP"))
            motion.put(command)
        time.sleep(0.01)


def test_only_the_controller_moves_the_robot(certificates: Path, tmp_path: Path) -> None:
    endpoint, trace = f"tls/127.0.0.1:{free_port()}", tmp_path / "trace"
    shared = ["--certificates", str(certificates)]
    settings = TransportConfig(connect=(endpoint,), connect_timeout_s=20.0, certificates=str(certificates))

    def driven() -> float:
        return float(np.abs(read(trace).rows["base_velocity"][:, 0]).max())

    with Processes(tmp_path) as site:
        site.launch("router", "rolling_panda", ["router", "--listen", endpoint, *shared])
        kept = ["--trace", str(trace), "--connect", endpoint, "--state", str(tmp_path / "state")]
        site.launch("bridge", "bridge", ["sim", *kept, *shared])
        with Onlooker(settings, "rp1") as onlooker:
            state = onlooker.slot(BRIDGE)
            site.wait(lambda: state.peek() is not None, 60.0, "the bridge")
        for intruder in ("server", "perception"):
            with Transport(settings, intruder, "rp1") as wire:
                commands(wire, 1.0)
        assert driven() < 1e-3
        with Transport(settings, "controller", "rp1") as wire:
            commands(wire, 1.5)
        time.sleep(0.3)
        assert driven() > 0.02
