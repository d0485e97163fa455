"""What the container files promise, read from the files: no container engine is needed, and none is replaced."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from rolling_panda.transport.certificates import APART

ROOT = Path(__file__).resolve().parents[2]
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "compose.yaml").read_text())
REAL: dict[str, Any] = yaml.safe_load((ROOT / "compose.real.yaml").read_text())
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
NAMES = ("router", "bridge", "controller", "perception", "server")
SECRET = re.compile(r"password|secret|token|private|BEGIN [A-Z ]*KEY", re.IGNORECASE)


def instructions() -> list[tuple[str, str]]:
    """The Dockerfile as (instruction, rest), continued lines joined, comments left out."""
    text = re.sub(r"^\s*#.*\n", "", (ROOT / "Dockerfile").read_text(), flags=re.MULTILINE)
    lines = re.sub(r"\\\n", " ", text).splitlines()
    return [(head, " ".join(rest.split())) for head, _, rest in (line.strip().partition(" ") for line in lines) if head]


def allowed(compose: Path) -> str:
    """What the schema of the Compose specification has against a file; empty where nothing."""
    check = [Path(sys.executable).parent / "check-jsonschema", "--builtin-schema", "vendor.compose-spec", compose]
    checked = subprocess.run(check, capture_output=True, text=True, timeout=60, check=False)
    return "" if checked.returncode == 0 else checked.stdout + checked.stderr


def last_stage() -> list[tuple[str, str]]:
    steps = instructions()
    return steps[max(i for i, (head, _) in enumerate(steps) if head == "FROM") :]


@pytest.mark.long
@pytest.mark.parametrize("name", ["compose.yaml", "compose.real.yaml"])
def test_the_compose_files_are_what_the_compose_specification_allows(name: str, tmp_path: Path) -> None:
    assert allowed(ROOT / name) == ""
    wrong = tmp_path / name
    wrong.write_text((ROOT / name).read_text().replace("    command:", "    comand:", 1))
    assert "comand" in allowed(wrong)


def test_the_linter_of_dockerfiles_finds_nothing() -> None:
    hadolint = Path(sys.executable).parent / "hadolint"
    found = subprocess.run([hadolint, ROOT / "Dockerfile"], capture_output=True, text=True, timeout=60, check=False)
    assert (found.returncode, found.stdout) == (0, "")


def test_every_process_has_its_container_and_no_other_runs() -> None:
    assert tuple(SERVICES) == ("certificates", *NAMES)
    for name, service in SERVICES.items():
        assert service["command"][0] == name


def test_the_certificates_are_made_once_before_anything_runs() -> None:
    made = SERVICES["certificates"]
    assert made["restart"] == "no" and "ports" not in made
    assert SERVICES["router"]["depends_on"] == {"certificates": {"condition": "service_completed_successfully"}}
    for name in set(NAMES) - {"router"}:
        assert SERVICES[name]["depends_on"] == {"router": {"condition": "service_healthy"}}
    # The image has the folders, so that the volumes belong to the containers' user.
    (folders,) = re.findall(
        r"for name in ([a-z ]+);", next(rest for head, rest in last_stage() if "/certificates" in rest)
    )
    assert sorted(folders.split()) == sorted(APART)
    assert made["volumes"] == [f"{name}-certificates:/certificates/{name}" for name in APART]


@pytest.mark.parametrize("name", SERVICES)
def test_a_container_may_do_no_more_than_it_needs(name: str) -> None:
    service = SERVICES[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in service["security_opt"]
    assert {"privileged", "cap_add", "network_mode", "pid", "ipc", "devices"}.isdisjoint(service)
    assert service["pids_limit"] <= 256
    assert service["mem_limit"] == "1g"


@pytest.mark.parametrize("name", NAMES)
def test_a_container_says_whether_it_is_well(name: str) -> None:
    check = SERVICES[name]["healthcheck"]
    assert check["test"][0] == "CMD"
    assert {"interval", "timeout", "start_period"} <= set(check)


def test_only_the_page_is_published_and_on_the_loopback_address_alone() -> None:
    published = {name: service["ports"] for name, service in SERVICES.items() if "ports" in service}
    assert published == {"server": ["127.0.0.1:8000:8000"]}
    assert COMPOSE["networks"]["robot"] == {"internal": True}
    for name, service in SERVICES.items():
        assert ("door" in service["networks"]) == (name == "server")


def test_no_secret_is_in_a_file_or_an_environment() -> None:
    for service in [*SERVICES.values(), *REAL["services"].values()]:
        assert "environment" not in service
        assert "env_file" not in service
    for head, rest in instructions():
        if head in ("ENV", "ARG", "LABEL"):
            assert not SECRET.search(rest)


@pytest.mark.parametrize("name", NAMES)
def test_a_container_is_given_its_own_key_and_what_the_health_check_needs(name: str) -> None:
    keys = [mount for mount in SERVICES[name]["volumes"] if "certificates" in mount]
    assert keys == [f"{name}-certificates:/certificates/{name}:ro"]
    for words in (SERVICES[name]["command"], SERVICES[name]["healthcheck"]["test"]):
        if "--certificates" in words:
            assert words[words.index("--certificates") + 1] == f"/certificates/{name}"
    for mount in SERVICES[name]["volumes"]:
        source, _, rest = mount.partition(":")
        assert not source.startswith("./") or rest.endswith(":ro"), f"{mount} is not read-only"


def test_every_volume_is_a_line_of_text_and_every_named_one_is_declared() -> None:
    for service in [*SERVICES.values(), *REAL["services"].values()]:
        for mount in service.get("volumes", []):
            assert isinstance(mount, str), f"{mount!r} is no mount"
            source = mount.split(":")[0]
            assert source.startswith("./") or source in COMPOSE["volumes"]


def test_the_image_runs_as_somebody_who_is_not_root() -> None:
    steps = last_stage()
    users = [rest for head, rest in steps if head == "USER"]
    assert users == ["10001:10001"]
    after = steps[[head for head, _ in steps].index("USER") :]
    assert [head for head, _ in after if head == "COPY"] == []
    assert any(head == "RUN" and "useradd --uid 10001" in rest for head, rest in steps)
    assert ("ENTRYPOINT", '["rolling-panda"]') in steps


def test_the_image_is_made_in_stages_from_a_base_that_can_be_pinned() -> None:
    bases = [rest.split(" AS ")[0] for head, rest in instructions() if head == "FROM"]
    assert len(bases) >= 3
    # Or another stage.
    assert set(bases) == {"${BASE_IMAGE}", "wheel"}
    for service in (COMPOSE["x-process"], REAL["services"]["bridge"]):
        assert "BASE_IMAGE" in service["build"]["args"]


def test_whatever_is_installed_is_locked_by_hash_or_our_own_wheel() -> None:
    installs = [
        part for head, rest in instructions() if head == "RUN" for part in re.findall(r"pip install[^&]*", rest)
    ]
    assert len(installs) == 3
    for install in installs:
        assert "--require-hashes -r " in install or "--no-deps /wheel/" in install
    locks = {rest for head, rest in instructions() if head == "ARG" and rest.startswith("LOCK")}
    assert locks == {"LOCK=requirements-run.lock"}
    assert REAL["services"]["bridge"]["build"]["args"]["LOCK"] == "requirements-real.lock"


def test_what_the_image_is_made_from_is_what_the_builder_is_sent() -> None:
    sent = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    copied = {
        word for head, rest in instructions() if head == "COPY" and "--from" not in rest for word in rest.split()[:-1]
    }
    assert copied == sent
    for name in sent:
        assert (ROOT / name).exists(), f"{name} is not there"


@pytest.mark.parametrize("file", [COMPOSE, REAL], ids=["compose.yaml", "compose.real.yaml"])
def test_the_programs_know_the_options_that_they_are_started_with(file: dict[str, Any]) -> None:
    common = "".join(
        (ROOT / "rolling_panda" / name).read_text() for name in ("runtime/process.py", "transport/settings.py")
    )
    for service in file["services"].values():
        name, *words = service["command"]
        source = {
            "router": "rolling_panda/cli/router.py",
            "certificates": "rolling_panda/transport/certificates.py",
        }.get(name, f"{name}/__main__.py")
        known = set(re.findall(r"add_argument\(\s*\"(--[a-z-]+)\"", common + (ROOT / source).read_text()))
        assert {word for word in words if word.startswith("--")} <= known


def test_the_real_bridge_has_a_way_to_arm_and_base_and_no_capability_more() -> None:
    bridge = REAL["services"]["bridge"]
    assert set(bridge["networks"]) == {"robot", "field"}
    assert {"privileged", "cap_add", "network_mode", "cap_drop", "read_only"}.isdisjoint(bridge)
    assert bridge["ulimits"]["rtprio"] == 99
    for name in set(REAL["services"]) - {"bridge"}:
        assert set(REAL["services"][name]) == {"command", "volumes"}


@pytest.mark.slow  # Some seconds, for what changes with the lock alone.
def test_the_bill_of_materials_names_every_locked_package_with_its_hashes(tmp_path: Path) -> None:
    bill = tmp_path / "materials.json"
    cyclonedx = [Path(sys.executable).parent / "cyclonedx-py", "requirements", ROOT / "requirements-run.lock"]
    subprocess.run([*cyclonedx, "--output-format", "JSON", "--output-file", bill], check=True, capture_output=True)
    listed = {
        f"{part['name']}=={part['version']}": part["externalReferences"][0]["hashes"]
        for part in json.loads(bill.read_text())["components"]
    }
    locked = re.findall(r"^([A-Za-z0-9._-]+==\S+)", (ROOT / "requirements-run.lock").read_text(), flags=re.MULTILINE)
    assert len(locked) > 50
    assert set(listed) == set(locked)
    assert all(listed.values())
