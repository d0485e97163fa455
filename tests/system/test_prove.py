"""What `deploy/prove.py --real` changes of the real profile, and nothing else of it."""

from copy import deepcopy
from pathlib import Path

import yaml

from bridge.real.config import RealConfig
from deploy import prove
from rolling_panda.config import load_section

ROOT = Path(__file__).resolve().parents[2]


def test_the_robot_of_the_proof_is_the_real_one_with_fakes_for_devices(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(prove.robot((ROOT / "assets/config/real.toml").read_text()))
    real = load_section(file, "real", RealConfig)
    assert (real.arm.address, real.arm.realtime) == (prove.ARM_AT, "ignore")
    assert (real.base.connect, real.cutter.connect) == (prove.NODES, prove.NODES)
    assert real.cutter.service and not real.camera.enabled
    assert real.arm.load_mass == 1.2, "what is not the devices' place stays"


def test_only_the_camera_and_the_network_card_of_the_real_profile_are_missing() -> None:
    real = yaml.safe_load((ROOT / "compose.real.yaml").read_text())
    proof = prove.on_fakes(deepcopy(real))
    for name, service in real["services"].items():
        missing = {key for key, value in service.items() if proof["services"][name].get(key) != value}
        assert missing == ({"devices", "device_cgroup_rules"} if name == "bridge" else set())
    assert proof["networks"]["field"]["internal"]
    for name in set(proof["services"]) - set(real["services"]):
        assert set(proof["services"][name]["networks"]) == {"field"}, "a device is on no other network"
