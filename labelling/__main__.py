"""`rolling-panda dataset`: labelled pictures of a vineyard.

import  reads COCO, CVAT for images, labelme, VGG Image Annotator or masks, and writes a dataset
label   opens a page on this machine to label the pictures of a dataset or a folder
export  writes a dataset for COCO, CVAT or labelme
check   loads every picture and mask of a dataset, and tells what it holds
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from labelling.folder import open_folder
from perception.dataset.__main__ import dataset_parser
from rolling_panda.errors import RollingPandaError
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.runtime.state_folder import usual_state_folder

#: Default of `--port`. A fixed one lets a page that was open before a restart go on saving.
_PORT = 8077


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser, commands = dataset_parser(__doc__ or "")
    _add_label(commands)
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
    label.add_argument(
        "--model", metavar="MODEL", help="that proposes: ONNX file, or 'shipped' (default: the one in use)"
    )
    label.add_argument("--port", type=int, default=_PORT, help="of the page (default: %(default)s; 0 = any)")
    label.add_argument("--robot-id", default=ROBOT_ID, help="robot whose network proposes (default: %(default)s)")
    state = usual_state_folder("ROBOT_ID")
    label.add_argument("--state", type=Path, metavar="DIR", help=f"folder of its state (default: {state})")


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
