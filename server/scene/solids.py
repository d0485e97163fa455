"""Meshes of fixed shape: the robot's bodies, and the ball of the distance tool.

`mesh_builder.py` makes them in a process of its own, which ends with it: its libraries would take a third of the
server's memory for as long as the server runs.
"""

import functools
import pickle
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rolling_panda.errors import ModelError
from server.scene.meshes import Color


@dataclass(frozen=True)
class Solid:
    """Triangles.

    Attributes:
        vertices: (V, 3), m.
        faces: (F, 3), indices of vertices.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


@dataclass(frozen=True)
class Part:
    """Triangles of one colour on one moving body.

    Attributes:
        joint: Index in the Pinocchio model of the joint that moves the body.
        color: sRGB, 0…255.
        vertices: (V, 3), m, in the joint's frame.
        faces: (F, 3), indices of vertices.
    """

    joint: int
    color: Color
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


@dataclass(frozen=True)
class Solids:
    """All of them."""

    robot: tuple[Part, ...]
    end_ball: Solid


@functools.cache
def build_solids() -> Solids:
    """Build them; takes seconds the first time.

    Raises:
        ModelError: A mesh is missing or unreadable.
    """
    # It computes for seconds, for which no real-time priority is meant.
    first = "from rolling_panda.runtime.scheduling import set_priority; set_priority('perception')"
    command = (sys.executable, "-c", f"{first}; from server.scene.mesh_builder import main; main()")
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode != 0:
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise ModelError(f"cannot build the meshes of the 3-D view: {''.join(last) or f'exit code {done.returncode}'}")
    solids: Solids = pickle.loads(done.stdout)
    return solids
