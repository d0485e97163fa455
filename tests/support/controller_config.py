"""Configurations of the controller with other values."""

from typing import Any

from msgspec.structs import replace

from controller.config import ControllerConfig


def controller_config(config: ControllerConfig | None = None, **values: Any) -> ControllerConfig:
    """A configuration with these values; `SECTION__KEY` goes into its section."""
    made = config or ControllerConfig()
    for name, value in values.items():
        section, _, key = name.rpartition("__")
        if section:
            key, value = section, replace(getattr(made, section), **{key: value})
        made = replace(made, **{key: value})
    return made
