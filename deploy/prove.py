"""Builds the image, starts compose.yaml, prunes one cane through the page's REST interface and looks at the containers.

    .venv/bin/python deploy/prove.py                      # with docker compose
    .venv/bin/python deploy/prove.py --engine podman --compose podman-compose
    .venv/bin/python deploy/prove.py --real               # compose.real.yaml on fakes of the devices: guided by hand

Everything happens in a folder of its own and under a project name of its own; at the end all of it is taken down again.
A line for each thing that was looked at; ends with 1 if one is not as docs/deployment.md says.
"""

import argparse
import contextlib
import json
import math
import os
import secrets
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from http.cookiejar import CookieJar
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
PAGE = "http://127.0.0.1:8000"
IMAGE, REAL_IMAGE = "rolling-panda:0.1.0", "rolling-panda-real:0.1.0"
# With --real: the network of arm and base, who is where on it, and whom the base's ROS 2 nodes are behind.
FIELD, BRIDGE_AT, ARM_AT, NODES_AT = "192.168.147.0/24", "192.168.147.9", "192.168.147.2", "192.168.147.3"
NODES = f"tcp/{NODES_AT}:7448"
#: What a process finds out about itself in its container.
_INSIDE = """
import json, os, socket
def reached(host, port):
    try:
        socket.create_connection((host, port), 2).close()
        return True
    except OSError:
        return False
def written(path):
    try:
        open(path, 'w').close()
        return True
    except OSError:
        return False
status = dict(line.split(':', 1) for line in open('/proc/self/status'))
print(json.dumps({'uid': os.getuid(), 'capabilities': int(status['CapEff'], 16), 'bounding': int(status['CapBnd'], 16),
    'no_new_privileges': int(status['NoNewPrivs']), 'root_is_written': written('/written'),
    'outside': reached('1.1.1.1', 53) or reached('1.1.1.1', 443), 'wire': reached('router', 7447)}))
"""


class Proof:
    """Looks at things one after another and remembers whether all were as they should be."""

    def __init__(self) -> None:
        """Nothing has been looked at yet."""
        self.held = True

    def that(self, what: str, held: bool, seen: object = "") -> None:
        """Say one line."""
        self.held &= held
        print(f"{'ok ' if held else 'NOT'}  {what}{'' if held or seen == '' else f': {seen}'}", flush=True)


class Operator:
    """A script that works as the page does."""

    def __init__(self, password: str) -> None:
        """Sign in as ada."""
        self._opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
        self.post("/api/sign-in", {"user": "ada", "password": password})

    def get(self, path: str) -> Any:
        """The answer in JSON."""
        with self._opener.open(PAGE + path, timeout=20) as answer:
            return json.load(answer)

    def post(self, path: str, body: object) -> None:
        """Ask for something; an error says the reason."""
        headers = {"Origin": PAGE, "Content-Type": "application/json"}
        request = urllib.request.Request(PAGE + path, json.dumps(body).encode(), headers)
        try:
            self._opener.open(request, timeout=20).close()
        except urllib.error.HTTPError as error:
            raise RuntimeError(f"{path}: {error.read().decode(errors='replace')[:300]}") from error

    def prune(self, limit_s: float) -> str:
        """Arm, accept what is proposed, start, look on until the first cane is cut; returns how it ended."""
        until, trouble = time.monotonic() + limit_s, "no point was proposed"
        while time.monotonic() < until:
            # Work goes on only while somebody looks; where this script was late, it takes the work up again.
            mode = self._mode()
            states = [row["entry"]["state"] for row in self.get("/api/points")["points"]]
            if "DONE" in states:
                return "DONE"
            try:
                self._go_on(mode, states)
            except RuntimeError as error:
                trouble = str(error)
            time.sleep(0.2)
        return f"nothing was cut in {limit_s:.0f} s; {trouble}"

    def ready(self, limit_s: float) -> None:
        """Arm as soon as every process is there; after a protective stop, as a busy machine brings them, too."""
        until = time.monotonic() + limit_s
        while (mode := self._mode()) not in ("READY", "TELEOP") and time.monotonic() < until:
            with contextlib.suppress(RuntimeError):
                self.post("/api/arm" if mode == "IDLE" else "/api/acknowledge", {})
            time.sleep(0.2)

    def guide(self, limit_s: float, **hold: object) -> float:
        """Hold the robot by hand until its tool is 20 mm away or the time is over; how far it is then (m)."""
        self.ready(limit_s)
        before = self.get("/api/state")["controller"]["T_odom_tool"]["position"]
        until, moved = time.monotonic() + limit_s, 0.0
        while moved < 0.02 and time.monotonic() < until:
            try:
                self.post("/api/teleop", {"hold": True, **hold})
            except RuntimeError:
                self.ready(limit_s)
            moved = math.dist(before, self.get("/api/state")["controller"]["T_odom_tool"]["position"])
            time.sleep(0.04)
        self.post("/api/teleop", {"hold": False})
        return moved

    def _mode(self) -> str:
        return str((self.get("/api/state")["controller"] or {}).get("mode", ""))

    def _go_on(self, mode: str, states: list[str]) -> None:
        if mode == "IDLE":
            self.post("/api/arm", {})
        elif mode == "PAUSED":
            self.post("/api/resume", {})
        elif mode == "READY" and "ACCEPTED" in states:
            self.post("/api/start", {})
        elif mode == "READY" and "PROPOSED" in states:
            self.post("/api/points/accept-all", {"confidence": 0.8})


def main() -> int:
    """Prove it."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--engine", default="docker", help="the engine's command")
    parser.add_argument("--compose", default="docker compose", help="the compose command")
    parser.add_argument("--no-build", action="store_true", help=f"the image {IMAGE} is there already")
    parser.add_argument("--real", action="store_true", help=f"compose.real.yaml too, on fakes ({REAL_IMAGE})")
    arguments = parser.parse_args()
    services: dict[str, Any] = yaml.safe_load((ROOT / "compose.yaml").read_text())["services"]
    # It ends when the certificates are there.
    del services["certificates"]
    proof, password = Proof(), secrets.token_urlsafe(16)

    def engine(*words: str, feed: str = "") -> str:
        done = subprocess.run([arguments.engine, *words], capture_output=True, text=True, input=feed, check=False)
        if done.returncode:
            raise RuntimeError(f"{arguments.engine} {words[0]} failed: {(done.stdout + done.stderr)[-800:]}")
        return done.stdout

    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        shutil.copy(ROOT / "compose.yaml", here)
        compose = [*shlex.split(arguments.compose), "-p", "rolling-panda-proof"]
        if arguments.real:
            compose += ["-f", "compose.yaml", "-f", "compose.real.yaml"]
            os.environ.update(FIELD_ADDRESS=BRIDGE_AT, FIELD_SUBNET=FIELD, FIELD_INTERFACE="none")
            real = yaml.safe_load((ROOT / "compose.real.yaml").read_text())
            (here / "compose.real.yaml").write_text(yaml.safe_dump(on_fakes(real)))
            (here / "my-robot.toml").write_text(robot((ROOT / "assets/config/real.toml").read_text()))
        if not arguments.no_build:
            base = [f"--build-arg=BASE_IMAGE={os.environ['BASE_IMAGE']}"] if "BASE_IMAGE" in os.environ else []
            subprocess.run([arguments.engine, "build", *base, "-t", IMAGE, str(ROOT)], check=True)
            if arguments.real:
                base.append("--build-arg=LOCK=requirements-real.lock")
                subprocess.run([arguments.engine, "build", *base, "-t", REAL_IMAGE, str(ROOT)], check=True)
        (here / "users").mkdir(mode=0o700)
        words = "rolling-panda user add ada --role supervisor --file /here/users/users.json --password-stdin"
        words += " && chown -R 10001:10001 /here/users"
        engine(
            "run",
            "--rm",
            "-i",
            "--user",
            "0",
            "--entrypoint",
            "sh",
            "-v",
            f"{here}:/here",
            IMAGE,
            "-c",
            words,
            feed=password,
        )
        try:
            subprocess.run([*compose, "up", "--detach", "--no-build"], cwd=here, check=True)
            look(proof, services, engine)
            operator = Operator(password)
            if arguments.real:
                guide(proof, operator)
            else:
                ended = operator.prune(180.0)
                proof.that("a cane is cut, from acceptance to DONE", ended == "DONE", ended)
        finally:
            subprocess.run([*compose, "down", "--volumes"], cwd=here, check=False)
    return 0 if proof.held else 1


def on_fakes(real: dict[str, Any]) -> dict[str, Any]:
    """compose.real.yaml where there is neither a network card towards a robot nor a camera: fakes in two containers."""
    for usb in ("devices", "device_cgroup_rules"):
        del real["services"]["bridge"][usb]
    network = {"driver": "bridge", "internal": True, "ipam": {"config": [{"subnet": FIELD}]}}
    shared = {"image": REAL_IMAGE, "init": True, "stdin_open": True}
    fakes = {
        "nodes": {"command": ["router", "--listen", f"tcp/0.0.0.0:{NODES.rsplit(':', 1)[1]}"], "at": NODES_AT},
        "devices": {
            "entrypoint": ["python", "-m", "bridge.fakes"],
            "command": ["--config", "/config/robot.toml", "--connect", NODES, "--arm", ARM_AT],
            "volumes": ["./my-robot.toml:/config/robot.toml:ro"],
            # The router may not listen yet.
            "restart": "unless-stopped",
            "at": ARM_AT,
        },
    }
    for name, service in fakes.items():
        at = service.pop("at")
        real["services"][name] = {**shared, **service, "networks": {"field": {"ipv4_address": at}}}
    return {**real, "networks": {"field": network}}


def robot(text: str) -> str:
    """The real robot's configuration with the fakes in it, on a kernel without PREEMPT_RT."""
    text = text.replace('address = ""', f'address = "{ARM_AT}"').replace('"enforce"', '"ignore"')
    text = text.replace('connect = ""', f'connect = "{NODES}"')
    text = text.replace('service = ""', f'service = "cutter/close"\nconnect = "{NODES}"')
    return text.replace("[real.camera]", "[real.camera]\nenabled = false")


def guide(proof: Proof, operator: Operator) -> None:
    """Look at what a person does by the page with the real robot's drivers."""
    operator.ready(60.0)
    state = operator.get("/api/state")
    proof.that("the bridge is the real robot's", state["bridge"]["kind"] == "real", state["bridge"]["kind"])
    moved = operator.guide(20.0, joints=[0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0])
    proof.that("the arm is moved by hand, through libfranka", moved >= 0.02, moved)
    moved = operator.guide(20.0, base={"linear": 0.05, "angular": 0.0})
    proof.that("the base is moved by hand, through ROS 2 over Zenoh", moved >= 0.02, moved)
    operator.post("/api/stop", {"reason": "proof"})
    until = time.monotonic() + 5.0
    while not (stop := operator.get("/api/state")["bridge"]["stop_id"]) and time.monotonic() < until:
        time.sleep(0.1)
    proof.that("the software stop is latched at the bridge", bool(stop))


def look(proof: Proof, services: dict[str, Any], engine: Any) -> None:
    """Look at everything that docs/deployment.md promises of the running containers."""
    names = {name: f"rolling-panda-proof_{name}_1" for name in services}
    running = engine("ps", "--format", "{{.Names}}").split()
    if names["server"] not in running:
        # Compose's own way of putting names together differs.
        names = {name: f"rolling-panda-proof-{name}-1" for name in services}
    for name, service in services.items():
        check = service["healthcheck"]["test"][1:]
        until, trouble = time.monotonic() + 120.0, "never asked"
        while trouble and time.monotonic() < until:
            try:
                engine("exec", names[name], *check)
                trouble = ""
            except RuntimeError as error:
                trouble = str(error)
                time.sleep(1.0)
        proof.that(f"{name} says that it is well", not trouble, trouble)
    for name in services:
        seen = json.loads(engine("exec", names[name], "python", "-c", _INSIDE))
        proof.that(f"{name} is not root", seen["uid"] == 10001, seen["uid"])
        proof.that(f"{name} has no capability and can get none", seen["capabilities"] == seen["bounding"] == 0, seen)
        proof.that(f"{name} gains no privileges", seen["no_new_privileges"] == 1)
        proof.that(f"{name} cannot write to its root", not seen["root_is_written"])
        proof.that(f"{name} reaches the router", seen["wire"])
        if name != "server":
            proof.that(f"{name} reaches nothing outside", not seen["outside"])
    published = engine("ps", "--format", "{{.Ports}}").split()
    proof.that(
        "only the page is published, on the loopback address", published == ["127.0.0.1:8000->8000/tcp"], published
    )
    version = json.load(urllib.request.urlopen(f"{PAGE}/version", timeout=20))
    proof.that(f"the page is there: version {version['version']}", bool(version["packages_sha256"]))


if __name__ == "__main__":
    sys.exit(main())
