"""`rolling-panda dataset`: labelled pictures of a vineyard.

import  reads COCO, CVAT for images, labelme, VGG Image Annotator or masks, and writes a dataset
label   opens a page on this machine to label the pictures of a dataset or a folder
from-decisions  writes a dataset from what operators decided, and a recording of that time
export  writes a dataset for COCO, CVAT or labelme
check   loads every picture and mask of a dataset, and tells what it holds
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from labelling.folder import open_folder
from perception.dataset.__main__ import dataset_parser
from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.runtime.state_folder import usual_state_folder

#: Default of `--port`. A fixed one lets a page that was open before a restart go on saving.
_PORT = 8077
#: Default of `--within` (s).
_WITHIN_S = 5.0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser, commands = dataset_parser(__doc__ or "")
    _add_label(commands)
    _add_from_decisions(commands)
    arguments = parser.parse_args(argv)
    try:
        arguments.run(arguments)
    except (RollingPandaError, OSError) as error:
        print(f"rolling-panda dataset {arguments.command}: {error}", file=sys.stderr)
        return 1
    return 0


def _add_label(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    label = commands.add_parser(
        "label",
        help="open a page on this machine to label pictures",
        description="Open a page on this machine and print its link; Ctrl-C ends it. Every stroke is saved at once.",
    )
    label.set_defaults(run=_label)
    label.add_argument("folder", type=Path, metavar="DIR", help="dataset, or folder of pictures")
    label.add_argument(
        "--out", type=Path, metavar="DATASET", help="for a folder of pictures: its dataset (default: DIR-labelled)"
    )
    label.add_argument("--source", default="", metavar="TEXT", help="of a new dataset: where its pictures come from")
    label.add_argument("--licence", default="own", metavar="TEXT", help="of a new dataset (default: %(default)s)")
    label.add_argument("--port", type=int, default=_PORT, help="of the page (default: %(default)s; 0 = any)")
    _add_model(label)


def _add_model(command: argparse.ArgumentParser) -> None:
    command.add_argument("--model", metavar="MODEL", help="network: ONNX file, or 'shipped' (default: the one in use)")
    command.add_argument("--robot-id", default=ROBOT_ID, help="robot whose network it is (default: %(default)s)")
    state = usual_state_folder("ROBOT_ID")
    command.add_argument("--state", type=Path, metavar="DIR", help=f"folder of its state (default: {state})")


def _add_from_decisions(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    told = commands.add_parser(
        "from-decisions",
        help="write a dataset from what operators decided about points",
        description="Write a dataset from the decisions in a ledger and the camera frames of a recording of that time.",
    )
    told.set_defaults(run=_from_decisions)
    told.add_argument("ledger", type=Path, metavar="LEDGER", help="folder of the robot's state, or ledger.sqlite in it")
    told.add_argument("recording", type=Path, metavar="FILE", help="MCAP file of `rolling-panda record`")
    told.add_argument("out", type=Path, metavar="DIR", help="new folder for the dataset")
    told.add_argument(
        "--within", type=float, default=_WITHIN_S, metavar="S", help="from a decision to its picture (default: 5)"
    )
    told.add_argument("--source", default="", metavar="TEXT", help="where the pictures come from")
    _add_model(told)


def _from_decisions(arguments: argparse.Namespace) -> None:
    from labelling.decisions import read_decisions
    from labelling.from_decisions import POINTS, write_decisions
    from labelling.proposals import proposing_model
    from perception.segmentation.network_segmenter import NetworkSegmenter
    from recorder.recording import read_recording

    if not 0.0 <= arguments.within <= 3600.0:
        raise InputError(f"--within {arguments.within}: give 0 to 3600 seconds")
    if arguments.out.exists():
        raise InputError(f"{arguments.out} exists already; give a new folder, or remove that one")
    decisions, taken_back = read_decisions(arguments.ledger)
    recording = read_recording(arguments.recording)
    model = proposing_model(arguments.model, arguments.state or usual_state_folder(arguments.robot_id))
    source = arguments.source or f"decisions of operators, {arguments.recording.name}"
    outcome = write_decisions(
        decisions, recording, arguments.out, NetworkSegmenter(model.path), arguments.within, source
    )
    labelled = sum(each.labelled > 0 for each in outcome.lines)
    pictures = len({each.picture for each in outcome.lines})
    print(f"{len(decisions)} decisions, and {taken_back} that were taken back")
    for kind, count in Counter(each.decision for each in outcome.lines).most_common():
        print(f"{count:5} {kind}")
    for cause, count in outcome.unmatched.most_common():
        print(f"{count:5} without a picture: {cause}")
    print(f"{pictures} picture{'s' * (pictures != 1)} and {POINTS} in {arguments.out}")
    print(f"{labelled:5} decisions have labelled pixels there")
    if not recording.complete:
        print("the recording is incomplete")


def _label(arguments: argparse.Namespace) -> None:
    # The web server and the network are needed by this command alone.
    from labelling.pictures import Pictures
    from labelling.proposals import Proposals, proposing_model
    from labelling.service import listen_locally, serve

    with listen_locally(arguments.port) as listener:
        model = proposing_model(arguments.model, arguments.state or usual_state_folder(arguments.robot_id))
        dataset, added = open_folder(arguments.folder, arguments.out, arguments.source, arguments.licence)
        if added:
            print(f"{added} pictures copied to {dataset.folder}")
        print(f"labels are saved in {dataset.folder}; {model.title} proposes")
        serve(listener, Pictures(dataset.folder), Proposals(model.path, model.title))


if __name__ == "__main__":
    sys.exit(main())
