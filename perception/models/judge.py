"""How well classes agree with masks that people drew: recall, precision, overlap, boundaries, calibration."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, distance_transform_edt

from perception.arrays import Labels, Mask
from perception.dataset.dataset import PICTURES, UNLABELLED, Dataset
from perception.segmentation.frame import BACKGROUND, CANE, CORDON, NODE, OLD_CUT, SPUR, TRUNK
from perception.single_image import Photograph, SureSegmenter, load_photograph, segment_photograph
from rolling_panda.errors import InputError

#: Classes of people's masks that are compared, and the program's classes that are the same wood.
SAME = {"trunk": (TRUNK,), "cane": (CANE, NODE, SPUR), "cordon": (CORDON, OLD_CUT)}
#: Also compared as one class, since people draw the border between them anywhere.
TOGETHER = {"trunk and cordon": ("trunk", "cordon"), "wood": ("trunk", "cane", "cordon")}

#: A pixel matches one that is at most so far away (px of the photograph).
TOLERANCE = 3.0
#: The classes whose F may not fall, and by how much it may: a difference of rounding.
DECISIVE, _ROUNDING = ("cane", "trunk and cordon"), 0.005
#: Of a set of pictures: by class, recall, precision and the other figures of `Agreement`.
Figures = dict[str, dict[str, float | None]]
#: Bins of probability for the calibration error.
_BINS = 10


@dataclass
class Agreement:
    """Counts of pixels of one class, which add up over pictures.

    Attributes:
        true: In the mask.
        told: In the class image.
        both: In both.
        found: Of the mask, with a told pixel within the tolerance.
        right: Told, with a pixel of the mask within the tolerance.
        true_edge: On the mask's boundary.
        told_edge: On the told boundary.
        found_edge: Of the mask's boundary, within the tolerance of the told one.
        right_edge: Of the told boundary, within the tolerance of the mask's.
        bins: Of each bin of probability: told pixels, their sum of probabilities, and those in the mask (10×3).
    """

    true: int = 0
    told: int = 0
    both: int = 0
    found: int = 0
    right: int = 0
    true_edge: int = 0
    told_edge: int = 0
    found_edge: int = 0
    right_edge: int = 0
    bins: NDArray[np.float64] = field(default_factory=lambda: np.zeros((_BINS, 3)))

    def add(self, true: Mask, told: Mask, tolerance: float, likely: NDArray[np.floating] | None = None) -> None:
        """Count one picture.

        Args:
            true: The person's mask (H×W).
            told: The class image's (H×W).
            tolerance: A pixel matches one that is at most so far away (px).
            likely: Probability of what was told (H×W, 0…1).
        """
        self.true += int(true.sum())
        self.told += int(told.sum())
        self.both += int((true & told).sum())
        self.found += int((true & _near(told, tolerance)).sum())
        self.right += int((told & _near(true, tolerance)).sum())
        true_edge, told_edge = edge(true), edge(told)
        self.true_edge += int(true_edge.sum())
        self.told_edge += int(told_edge.sum())
        self.found_edge += int((true_edge & _near(told_edge, tolerance)).sum())
        self.right_edge += int((told_edge & _near(true_edge, tolerance)).sum())
        if likely is not None:
            values, hits = likely[told], true[told]
            number = np.clip((values * _BINS).astype(int), 0, _BINS - 1)
            for column, weights in enumerate((None, values, hits.astype(float))):
                self.bins[:, column] += np.bincount(number, weights, minlength=_BINS)

    def figures(self) -> dict[str, float | None]:
        """Recall, precision and their F at the tolerance, intersection over union, boundary F, calibration error.

        A figure that has nothing to be of is None.
        """
        recall, precision = _share(self.found, self.true), _share(self.right, self.told)
        edges = _share(self.found_edge, self.true_edge), _share(self.right_edge, self.told_edge)
        total = float(self.bins[:, 0].sum())
        return {
            "recall": recall,
            "precision": precision,
            "f": _harmonic(recall, precision),
            "iou": _share(self.both, self.true + self.told - self.both),
            "boundary_f": _harmonic(*edges),
            "ece": float(np.abs(self.bins[:, 1] - self.bins[:, 2]).sum() / total) if total else None,
        }


def compared(truth: dict[str, Mask], told: Labels) -> list[tuple[str, Mask, Mask]]:
    """Of each class, and of those taken together: name, true pixels and told pixels."""
    said = {name: np.isin(told, same) for name, same in SAME.items()}
    out = [(name, truth[name], said[name]) for name in SAME]
    for name, parts in TOGETHER.items():
        out.append((name, np.any([truth[p] for p in parts], axis=0), np.any([said[p] for p in parts], axis=0)))
    return out


def tell(photograph: Photograph, segmenter: SureSegmenter) -> tuple[Labels, NDArray[np.float32] | None]:
    """Classes of a photograph at its own size (H×W), and the probability of each pixel's class, or None.

    Raises:
        UnusablePictureError: The photograph is blank.
    """
    photograph, (labels, likely) = segment_photograph(photograph, segmenter)
    width, height = photograph.size
    rows = ((np.arange(height) + 0.5) * labels.shape[0] / height).astype(int)
    cols = ((np.arange(width) + 0.5) * labels.shape[1] / width).astype(int)
    window = np.ix_(rows, cols)
    return labels[window], None if likely is None else likely[window]


def judge_held_out(segmenter: SureSegmenter, dataset: Dataset) -> Figures:
    """How well a network tells the classes of a dataset's held-out pictures; `bench photographs` measures the same.

    Raises:
        InputError: The dataset has no held-out picture, or one that cannot be used.
    """
    names = dataset.names("held-out")
    if not names:
        raise InputError(f"{dataset.folder} holds no picture out; import it with --held-out 0.2")
    totals = {name: Agreement() for name in (*SAME, *TOGETHER)}
    for name in names:
        _, labels = dataset.load(name)
        told, likely = tell(load_photograph(dataset.folder / PICTURES / name), segmenter)
        told = np.where(labels == UNLABELLED, BACKGROUND, told).astype(np.uint8)
        truth = {kind: np.isin(labels, same) for kind, same in SAME.items()}
        for kind, true, said in compared(truth, told):
            totals[kind].add(true, said, TOLERANCE, likely)
    return {kind: total.figures() for kind, total in totals.items()}


def worse(old: Figures, new: Figures) -> list[str]:
    """Of the decisive classes that the pictures show, those at which the new network is worse, with both F."""
    out = []
    for name in DECISIVE:
        before, after = old[name]["f"], new[name]["f"]
        if old[name]["recall"] is not None and (after or 0.0) < (before or 0.0) - _ROUNDING:
            out.append(f"{name} {after or 0.0:.3f} instead of {before or 0.0:.3f}")
    return out


def edge(mask: Mask) -> Mask:
    """Pixels of a mask with a neighbour outside; the picture's own border is no edge."""
    out: Mask = mask & ~binary_erosion(mask, border_value=1)
    return out


def _near(mask: Mask, tolerance: float) -> Mask:
    if not mask.any():
        return np.zeros_like(mask)
    out: Mask = distance_transform_edt(~mask) <= tolerance
    return out


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _harmonic(a: float | None, b: float | None) -> float | None:
    if a is None or b is None:
        return None
    return 2.0 * a * b / (a + b) if a + b else 0.0
