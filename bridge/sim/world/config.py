"""Configuration of the disturbances: section `[world]`."""

import math
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta, Struct
from msgspec.structs import replace

from rolling_panda.config import load_preset

Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Angle = Annotated[float, Meta(ge=0.0, le=0.1)]
Shift = Annotated[float, Meta(ge=0.0, le=0.05)]
Delay = Annotated[float, Meta(ge=0.0, le=0.2)]
Slope = Annotated[float, Meta(ge=0.0, le=0.2)]
Error = Annotated[float, Meta(ge=0.0, le=0.1)]


class WorldConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Size of each disturbance; 0 switches it off. Keys that are given replace those of the preset.

    Units: m, rad, s. "SD" is a standard deviation, drawn once for a seed unless a line says otherwise; "up to" is the
    end of a uniform distribution around 0.

    Attributes:
        preset: Values of all other keys: `calm` has none of these disturbances, `field` and `storm` are usual and bad
            days of a vineyard in January.
        hand_eye_angle: SD of the camera's rotation on the tool about each axis, beyond `[camera] calibration_angle`.
        hand_eye_shift: SD of its position along each axis.
        focal_error: True focal length against the reported one, up to this fraction.
        frame_delay: Mean time from the joint state of a frame to its exposure.
        frame_jitter: SD of that time, from frame to frame.
        joint_offset: SD of each encoder's zero of the arm.
        mount_angle: SD of the arm's rotation on the base about each axis.
        mount_shift: SD of its position along each axis.
        wheel_error: Rolling radius of both wheels, and the track, up to this fraction. The wheels differ from each
            other by up to a tenth of it.
        slip: SD of the slip of each wheel, correlated over 0.5 m of its path.
        slope_along: Slope of the ground along the row, up to this: gravity leans.
        slope_across: Slope of the ground across the row, up to this: the base rolls towards or away from it.
        bumps: Height of bumps above the mean ground, from 0.6 to 3 m long.
        inertial_errors: Bias and noise of the camera's gyroscope and accelerometer, as multiples of the usual ones.
        sway: Amplitude of canes in the wind, 0.3 m above their base and twice this at the tip, at 0.5 to 2 Hz.
        depth_lost: Fraction of thin wood without depth in each frame, in patches: low sun on active stereo.
        sunlight: Light of a low sun on a surface that faces it, as a multiple of the sky's; it casts hard shadows.
        glare: Stray light in the lens, as a multiple of that in the human eye. It needs `sunlight`.
        wet: Fraction of bark and wires with a film of water: darker, with highlights.
        exposure: Time of exposure of the colour picture, in which the camera's motion blurs it.
        blade_failures: Fraction of bites through a cane of 8 mm that jam or leave it hanging by its bark. It grows with
            the force that the diameter needs.
        cane_modulus: Young's modulus of canes (GPa), by which they push back and bend; 0 lets them give way to all.
        hanging: Fraction of severed canes that do not fall but hang in the wires, a little beside where they stood.
        laterals: Fraction of nodes with a lateral shoot, 3 to 30 cm long and 2 to 5 mm thick.
        tendrils: Fraction of nodes with a tendril, which holds the nearest wire.
        leaves: Fraction of nodes with an old leaf.
        drooping: Fraction of canes that are out of the wires, bent to one side and over others.
    """

    preset: Literal["calm", "field", "storm"] = "calm"
    hand_eye_angle: Angle = 0.0
    hand_eye_shift: Shift = 0.0
    focal_error: Error = 0.0
    frame_delay: Delay = 0.0
    frame_jitter: Delay = 0.0
    joint_offset: Angle = 0.0
    mount_angle: Angle = 0.0
    mount_shift: Shift = 0.0
    wheel_error: Error = 0.0
    slip: Annotated[float, Meta(ge=0.0, le=0.3)] = 0.0
    slope_along: Slope = 0.0
    slope_across: Slope = 0.0
    bumps: Shift = 0.0
    inertial_errors: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.0
    sway: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.0
    depth_lost: Share = 0.0
    sunlight: Annotated[float, Meta(ge=0.0, le=20.0)] = 0.0
    glare: Annotated[float, Meta(ge=0.0, le=20.0)] = 0.0
    wet: Share = 0.0
    exposure: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.0
    blade_failures: Share = 0.0
    cane_modulus: Annotated[float, Meta(ge=0.0, le=20.0)] = 0.0
    hanging: Share = 0.0
    laterals: Share = 0.0
    tendrils: Share = 0.0
    leaves: Share = 0.0
    drooping: Share = 0.0


CALM = WorldConfig()
#: The values of every preset. docs/world.md has the sources.
PRESETS: dict[str, WorldConfig] = {
    "calm": CALM,
    "field": WorldConfig(
        preset="field",
        hand_eye_angle=math.radians(0.3),
        hand_eye_shift=0.003,
        focal_error=0.003,
        frame_delay=0.015,
        frame_jitter=0.005,
        joint_offset=math.radians(0.05),
        mount_angle=math.radians(0.2),
        mount_shift=0.002,
        wheel_error=0.01,
        slip=0.03,
        slope_along=math.radians(3.0),
        slope_across=math.radians(2.0),
        bumps=0.010,
        inertial_errors=1.0,
        sway=0.005,
        depth_lost=0.2,
        sunlight=2.0,
        glare=1.0,
        wet=0.3,
        exposure=0.005,
        blade_failures=0.02,
        cane_modulus=6.5,
        hanging=0.1,
        laterals=0.10,
        tendrils=0.15,
        leaves=0.02,
        drooping=0.10,
    ),
    "storm": WorldConfig(
        preset="storm",
        hand_eye_angle=math.radians(0.6),
        hand_eye_shift=0.006,
        focal_error=0.006,
        frame_delay=0.040,
        frame_jitter=0.015,
        joint_offset=math.radians(0.1),
        mount_angle=math.radians(0.5),
        mount_shift=0.004,
        wheel_error=0.02,
        slip=0.08,
        slope_along=math.radians(6.0),
        slope_across=math.radians(4.0),
        bumps=0.025,
        inertial_errors=2.0,
        sway=0.020,
        depth_lost=0.5,
        sunlight=5.0,
        glare=4.0,
        wet=0.9,
        exposure=0.015,
        blade_failures=0.10,
        cane_modulus=8.0,
        hanging=0.3,
        laterals=0.30,
        tendrils=0.40,
        leaves=0.08,
        drooping=0.30,
    ),
}


def load_world(path: Path) -> WorldConfig:
    """The section `[world]` of a configuration file: the preset, with the keys that are given.

    Raises:
        ConfigError: As of `load_section`.
    """
    return load_preset(path, "world", PRESETS)


def only(knobs: tuple[str, ...], preset: str) -> WorldConfig:
    """A calm world with some disturbances as of a preset."""
    return replace(CALM, **{knob: getattr(PRESETS[preset], knob) for knob in knobs})
