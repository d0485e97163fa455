"""Builds the image, starts compose.yaml, prunes one cane through the page's REST interface and looks at the containers.

    .venv/bin/python deploy/prove.py                      # with docker compose
    .venv/bin/python deploy/prove.py --engine podman --compose podman-compose

Everything happens in a folder of its own and under a project name of its own; at the end all of it is taken down again.
A line for each thing that was looked at; ends with 1 if one is not as docs/deployment.md says.
"""

import argparse
import json
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
IMAGE = "rolling-panda:0.1.0"
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
            mode = (self.get("/api/state")["controller"] or {}).get("mode", "")
            states = [row["entry"]["state"] for row in self.get("/api/points")["points"]]
            if "DONE" in states:
                return "DONE"
            try:
                self._go_on(mode, states)
            except RuntimeError as error:
                trouble = str(error)
            time.sleep(0.2)
        return f"nothing was cut in {limit_s:.0f} s; {trouble}"

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
    arguments = parser.parse_args()
    services: dict[str, Any] = yaml.safe_load((ROOT / "compose.yaml").read_text())["services"]
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
        if not arguments.no_build:
            base = [f"--build-arg=BASE_IMAGE={os.environ['BASE_IMAGE']}"] if "BASE_IMAGE" in os.environ else []
            subprocess.run([arguments.engine, "build", *base, "-t", IMAGE, str(ROOT)], check=True)
        (here / "users").mkdir(mode=0o700)
        words = "rolling-panda certificates --out /here/certificates"
        words += " && rolling-panda user add ada --role supervisor --file /here/users/users.json --password-stdin"
        words += " && chown -R 10001:10001 /here/certificates /here/users"
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
        subprocess.run([*compose, "up", "--detach", "--no-build"], cwd=here, check=True)
        try:
            look(proof, services, engine, password)
        finally:
            subprocess.run([*compose, "down", "--volumes"], cwd=here, check=False)
    return 0 if proof.held else 1


def look(proof: Proof, services: dict[str, Any], engine: Any, password: str) -> None:
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
    ended = Operator(password).prune(180.0)
    proof.that("a cane is cut, from acceptance to DONE", ended == "DONE", ended)


if __name__ == "__main__":
    sys.exit(main())
