"""`rolling-panda frames`: camera pictures of a recording, as JPEG files, to label them."""

import argparse
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from recorder.recording import Recording, read_recording
from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.messages.robot import CameraFrame

#: Default of `--every` (s).
_EVERY_S = 2.0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda frames", description=__doc__)
    parser.add_argument("recording", type=Path, metavar="FILE", help="MCAP file of `rolling-panda record`")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="new folder for the pictures")
    parser.add_argument(
        "--every", type=float, default=_EVERY_S, metavar="S", help="at most one picture in so many seconds (default: 2)"
    )
    arguments = parser.parse_args(argv)
    try:
        if not 0.0 <= arguments.every <= 3600.0:
            raise InputError(f"--every {arguments.every}: give 0 to 3600 seconds")
        recording = read_recording(arguments.recording)
        count = write_frames(recording, arguments.out, arguments.every)
    except RollingPandaError as error:
        print(f"rolling-panda frames: {error}", file=sys.stderr)
        return 1
    print(f"{count} pictures in {arguments.out}" + ("" if recording.complete else "; the recording is incomplete"))
    return 0


def write_frames(recording: Recording, out: Path, every_s: float) -> int:
    """Write `frame_SEQUENCE.jpg` for the frames of a recording; returns their number.

    Close-ups are left out, since networks are trained on pictures of the survey.

    Args:
        recording: The recording.
        out: New folder; it is written whole or not at all.
        every_s: Least time between two pictures (s).

    Raises:
        InputError: There is no frame, the folder exists, or it cannot be written.
    """
    if out.exists():
        raise InputError(f"{out} exists already; give a new folder with --out")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        half = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
        try:
            names = set()
            for at, frame in _chosen(recording, every_s):
                # After a restart of the camera numbers begin anew.
                name = f"frame_{at - recording.begins_at:09.2f}s_{frame.sequence:06}.jpg"
                (half / name).write_bytes(frame.color_jpeg)
                names.add(name)
            if not names:
                raise InputError("the recording holds no camera frame; record while the camera runs")
            half.chmod(0o755)
            os.rename(half, out)
        finally:
            shutil.rmtree(half, ignore_errors=True)
    except OSError as error:
        raise InputError(f"cannot write {out}: {error.strerror}") from error
    return len(names)


def _chosen(recording: Recording, every_s: float) -> Iterator[tuple[float, CameraFrame]]:
    last = -float("inf")
    for each in recording.messages:
        if each.topic.message is CameraFrame and each.at - last >= every_s:
            frame = each.message()
            assert isinstance(frame, CameraFrame)
            if not frame.point_id:
                last = each.at
                yield each.at, frame


if __name__ == "__main__":
    sys.exit(main())
