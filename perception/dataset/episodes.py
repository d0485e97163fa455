"""A dataset as episodes: folders and names of LeRobot 2.1, with JSON lines for its Parquet and pictures for its videos.

An episode is a split of the dataset, and each frame has a picture and its mask. LeRobot itself does not load it.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, Literal

import msgspec
import numpy as np
from PIL import Image

from perception.dataset.annotations import Annotated, Exported, Shape, find_picture
from perception.dataset.dataset import MASKS, PICTURES, VALUES, Split, load_values
from rolling_panda.errors import InputError

_CAMERA, _LABELS = "observation.images.camera", "observation.images.labels"
_TASK = "label the wood of vines"
_VERSION = "v2.1"
_DATA: Final = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.jsonl"
_SPLITS: tuple[Split, ...] = ("train", "held-out")


class _Feature(msgspec.Struct):
    dtype: str
    shape: list[int]
    names: list[str] | None = None


class _Info(msgspec.Struct):
    """`meta/info.json`; `splits` has ranges of episodes, `label_values` the values of the masks by class."""

    codebase_version: str
    total_episodes: int
    total_frames: int
    splits: dict[str, str]
    features: dict[str, _Feature]
    label_values: dict[str, int]
    robot_type: str | None = None
    total_tasks: int = 1
    total_chunks: int = 1
    chunks_size: int = 1000
    fps: int = 1
    data_path: Literal["data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.jsonl"] = _DATA


class _Frame(msgspec.Struct):
    """A line of an episode; picture and mask are paths in the folder."""

    timestamp: float
    frame_index: int
    episode_index: int
    index: int
    picture: str = msgspec.field(name=_CAMERA)
    labels: str = msgspec.field(name=_LABELS)
    task_index: int = 0


def is_episodes(path: Path) -> bool:
    """Whether a folder holds episodes."""
    return (path / "meta" / "info.json").is_file()


def write_episodes(folder: Path, pictures: Sequence[Exported]) -> None:
    """Write `meta/`, `data/` and `masks/` beside the pictures.

    Raises:
        InputError: The pictures differ in size.
    """
    sizes = {labels.shape: name for name, labels, _ in pictures}
    if len(sizes) > 1:
        (one, name), (other, another) = list(sizes.items())[:2]
        raise InputError(
            f"{name} has {one[1]}×{one[0]} pixels and {another} {other[1]}×{other[0]}; the frames of episodes have one "
            "size. Export as coco, cvat or labelme"
        )
    (folder / MASKS).mkdir()
    episodes = [kept for split in _SPLITS if (kept := [each for each in pictures if each[2] == split])]
    splits: dict[str, str] = {}
    lines, index = [], 0
    for number, episode in enumerate(episodes):
        frames = []
        for at, (name, labels, _) in enumerate(episode):
            mask = f"{MASKS}/{Path(name).stem}.png"
            Image.fromarray(labels).save(folder / mask)
            frames.append(_Frame(float(at), at, number, index, f"{PICTURES}/{name}", mask))
            index += 1
        _write_lines(folder / _DATA.format(episode_chunk=0, episode_index=number), frames)
        lines.append({"episode_index": number, "tasks": [_TASK], "length": len(episode)})
        splits[episode[0][2]] = f"{number}:{number + 1}"
    height, width = next(iter(sizes))
    features = {
        _CAMERA: _Feature("image", [height, width, 3], ["height", "width", "channel"]),
        _LABELS: _Feature("image", [height, width, 1], ["height", "width", "channel"]),
        "timestamp": _Feature("float32", [1]),
        **{name: _Feature("int64", [1]) for name in ("frame_index", "episode_index", "index", "task_index")},
    }
    info = _Info(_VERSION, len(episodes), index, splits, features, VALUES)
    _write_lines(folder / "meta" / "episodes.jsonl", lines)
    _write_lines(folder / "meta" / "tasks.jsonl", [{"task_index": 0, "task": _TASK}])
    (folder / "meta" / "info.json").write_bytes(msgspec.json.format(msgspec.json.encode(info), indent=1) + b"\n")


def read_episodes(folder: Path) -> list[Annotated]:
    """Read what `write_episodes` has written.

    Raises:
        InputError: A file is missing or damaged, or the episodes are of another kind.
    """
    path = folder / "meta" / "info.json"
    try:
        info = msgspec.json.decode(path.read_bytes(), type=_Info)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: {error}. Only episodes of `rolling-panda dataset export --format episodes` can be read, not "
            "Parquet and video: write their frames as pictures, and label them"
        ) from error
    names = {value: name for name, value in info.label_values.items()}
    out = []
    for number in range(info.total_episodes):
        file = folder / _DATA.format(episode_chunk=number // info.chunks_size, episode_index=number)
        try:
            frames = [msgspec.json.decode(line, type=_Frame) for line in file.read_bytes().splitlines()]
        except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
            raise InputError(f"cannot read the episode {file}: {error}") from error
        split = next((each for each in _SPLITS if info.splits.get(each) == f"{number}:{number + 1}"), None)
        for frame in frames:
            values = load_values(find_picture(folder, frame.labels))
            if unknown := sorted(set(np.unique(values).tolist()) - set(names)):
                raise InputError(f"{folder / frame.labels} holds the value {unknown[0]}, which {path} does not name")
            shapes = tuple(Shape(names[value], mask=values == value) for value in np.unique(values).tolist())
            out.append(Annotated(frame.picture, (values.shape[1], values.shape[0]), shapes, file, split))
    if len(out) != info.total_frames:
        raise InputError(f"{folder} has {len(out)} frames; {path} tells {info.total_frames}")
    return out


def _write_lines(path: Path, lines: Sequence[object]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"".join(msgspec.json.encode(line) + b"\n" for line in lines))
