"""Camera frames in, pruning points out."""

import numpy as np
from numpy.typing import NDArray

from perception.centreline import centrelines
from perception.config import PerceptionConfig
from perception.fragments import find_fragments, find_wood
from perception.frame import View, decode_frame
from perception.keep_out import wire_near
from perception.linking import link
from perception.numbering import RowNumbers
from perception.obstacles import ObstacleMap
from perception.plant import Cane, Plant
from perception.rule import decide
from perception.segmenter import Segmenter
from perception.topology import build_plant
from perception.tracker import Proposal, Tracker
from rolling_panda import messages as m
from rolling_panda.errors import InputError
from rolling_panda.robot_model import RobotModel
from rolling_panda.row_messages import Capsule

#: Every so many samples of a cane's axis go on the wire.
_THIN_OUT = 4
_CORDON = m.WOOD_CLASSES.index("cordon")
#: Fewer pixels of cordon say nothing about how far the row is.
_LEAST_CORDON = 200


class Perception:
    """Sees the row frame by frame. No clock, no threads: the same frames give the same points."""

    def __init__(self, config: PerceptionConfig, segmenter: Segmenter, model: RobotModel | None = None) -> None:
        """Start with an unknown row.

        Args:
            config: Section `[perception]`.
            segmenter: Says which pixel shows what.
            model: For the camera's place; its work space is used, so it is not shared with another thread.
        """
        self._config = config
        self._segmenter = segmenter
        self._model = model or RobotModel()
        self._tracker = Tracker(config.tracker)
        self._numbers = RowNumbers(config.tracker.spur_separation, config.tracker.vine_spacing)
        self._frames = 0
        self._abstained: tuple[str, ...] = ()
        self._canes: tuple[tuple[m.Vector3, ...], ...] = ()
        self._map = ObstacleMap(config.obstacles)
        self.withdrawn: tuple[str, ...] = ()
        """What the last frame took away, with the reasons."""
        self.obstacles: tuple[Capsule, ...] = ()
        """What stands in the way, as far as it was seen."""

    def process(self, frame: m.CameraFrame) -> m.PruningPoints:
        """Take one frame in and tell everything held true now.

        Args:
            frame: As received.

        Raises:
            MessageError: The frame is corrupt; nothing changes.
        """
        view = decode_frame(frame, self._model)
        self.withdrawn = ()
        try:
            labels = self._segmenter.segment(view)
        except InputError as error:
            return self._message(view, self._tracker.points(), (str(error),), ())
        self.obstacles = self._map.update(view, labels)
        self._frames += 1
        if not self._is_survey(view, labels):
            # Too near or too far to read a whole spur; near enough to see whether the wood still stands.
            tracked = self._tracker.update(view, labels, [])
            self.withdrawn = tracked.withdrawn
            return self._message(view, tracked.points, (*tracked.withdrawn, *self._abstained), self._canes)
        plant = perceive(view, labels, self._config)
        numbers = self._numbers.number(plant, view.R[:, 0])
        proposals, abstained = [], []
        for spur, number in zip(plant.spurs, numbers, strict=True):
            decision = decide(spur, self._config.rule, plant.beside(spur))
            place = f"vine {number.vine}, spur {number.spur}"
            for cut in decision.cuts:
                if wire_near(view, labels, cut.position, self._config.rule.wire_distance):
                    near = round(self._config.rule.wire_distance * 1000)
                    abstained.append(f"{place}: a wire passes within {near} mm of the cut; cut this one by hand")
                else:
                    proposals.append(Proposal(cut, number))
            abstained += [f"{place}: {reason}" for reason in decision.abstained]
        tracked = self._tracker.update(view, labels, proposals)
        self.withdrawn = tracked.withdrawn
        self._abstained = tuple(abstained)
        self._canes = tuple(_polyline(cane) for spur in plant.spurs for cane in spur.canes)
        return self._message(view, tracked.points, (*tracked.withdrawn, *abstained), self._canes)

    def _is_survey(self, view: View, labels: NDArray[np.uint8]) -> bool:
        """Whether the frame looks at the cordon from where spurs can be read as a whole."""
        wood = (labels == _CORDON) & (view.depth > 0.0)
        if np.count_nonzero(wood) < _LEAST_CORDON:
            return False
        config = self._config
        return bool(config.survey_nearest <= np.median(view.depth[wood]) <= config.survey_farthest)

    def _message(
        self,
        view: View,
        points: tuple[m.PruningPoint, ...],
        abstained: tuple[str, ...],
        canes: tuple[tuple[m.Vector3, ...], ...],
    ) -> m.PruningPoints:
        return m.PruningPoints(
            header=m.Header(view.stamp, "odom"),
            segmenter=self._segmenter.name,
            frames=self._frames,
            points=points,
            abstained=tuple(text[:500] for text in abstained),
            canes=canes,
        )


def perceive(view: View, labels: "np.ndarray[tuple[int, ...], np.dtype[np.uint8]]", config: PerceptionConfig) -> Plant:
    """One frame to spurs and canes, without memory.

    Args:
        view: The frame.
        labels: H×W class indices.
        config: Section `[perception]`.
    """
    wood = find_wood(view, labels, config.skeleton)
    fragments = find_fragments(wood, view.depth.shape, config.skeleton)
    seen = np.zeros(view.depth.shape, dtype=bool)
    seen[wood.rows, wood.cols] = True
    chains = link(view, fragments, seen, config.skeleton)
    lines = centrelines(view, wood, chains, config.skeleton)
    return build_plant(view, labels, lines, config.skeleton)


def _polyline(cane: Cane) -> tuple[m.Vector3, ...]:
    axis = np.concatenate([cane.axis[:-1:_THIN_OUT], cane.axis[-1:]])
    return tuple((float(x), float(y), float(z)) for x, y, z in axis)
