"""`rolling-panda models`: networks, and which one perception uses from its next start.

list     the shipped networks and those that were taken into use, with their cards
compare  two networks on the held-out pictures of a dataset
use      take a network into use, unless it is worse on held-out pictures than the one in use; `shipped` goes back, and
         `photographs` is the other network that comes with the program
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from perception.dataset.dataset import Dataset, check, read_dataset
from perception.models.cards import Model, choose, choose_shipped, chosen, kept, photographs, read_model, shipped
from perception.models.judge import DECISIVE, TOLERANCE, Figures, judge_held_out, worse
from perception.segmentation.network_segmenter import NetworkSegmenter
from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.runtime.process import ROBOT_ID
from rolling_panda.runtime.state_folder import usual_state_folder

_SHIPPED, _PHOTOGRAPHS = "shipped", "photographs"
_MODEL = f"ONNX file, '{_SHIPPED}' or '{_PHOTOGRAPHS}'"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    arguments = _parser().parse_args(argv)
    try:
        arguments.run(arguments)
    except (RollingPandaError, OSError) as error:
        print(f"rolling-panda models {arguments.command}: {error}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rolling-panda models", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    everything = commands.add_parser("list", help="networks and their cards")
    everything.set_defaults(run=_list)
    two = commands.add_parser("compare", help="two networks on held-out pictures")
    two.set_defaults(run=_compare)
    two.add_argument("first", metavar="MODEL", help=_MODEL)
    two.add_argument("second", metavar="MODEL", help=_MODEL)
    two.add_argument("--data", type=Path, required=True, metavar="DIR", help="dataset with held-out pictures")
    use = commands.add_parser("use", help="take a network into use, unless it is worse than the one in use")
    use.set_defaults(run=_use)
    use.add_argument("model", metavar="MODEL", help=_MODEL)
    use.add_argument("--data", type=Path, metavar="DIR", help="dataset with held-out pictures")
    for command in (everything, use):
        command.add_argument("--robot-id", default=ROBOT_ID, help="robot on the wire (default: %(default)s)")
        state = usual_state_folder("ROBOT_ID")
        command.add_argument("--state", type=Path, metavar="DIR", help=f"folder of its state (default: {state})")
    return parser


def _list(arguments: argparse.Namespace) -> None:
    state = _state(arguments)
    used = chosen(state) or shipped()
    everything = {model.sha256: model for model in (*kept(state), photographs(), shipped())}
    for model in reversed(everything.values()):
        print(f"{'*' if model.sha256 == used.sha256 else ' '} {model.title}")
        if model.card is None:
            print("    no card")
            continue
        for data in model.card.data:
            print(f"    trained on {data.pictures} pictures: {data.source} ({data.licence})")
        for name, figures in model.card.figures.items():
            print(f"    {name}: {_line(figures)}")
    print("* used by perception, unless [perception] weights names another file")


def _compare(arguments: argparse.Namespace) -> None:
    dataset = _dataset(arguments.data)
    for word in (arguments.first, arguments.second):
        model = _model(word)
        print(f"{model.title:32} {_line(judge_held_out(NetworkSegmenter(model.path), dataset))}")
    print(f"on {len(dataset.names('held-out'))} held-out pictures of {dataset.folder}, tolerance {TOLERANCE:g} px")


def _use(arguments: argparse.Namespace) -> None:
    state = _state(arguments)
    if arguments.model == _SHIPPED:
        choose_shipped(state)
        print(f"perception uses the shipped network {shipped().title} from its next start")
        return
    if arguments.model == _PHOTOGRAPHS and arguments.data is None:
        choose(state, photographs(), {})
        print(f"perception uses {photographs().title} from its next start")
        return
    if arguments.data is None:
        raise InputError("give --data with a dataset of held-out pictures, to compare with the network in use")
    model, used, dataset = _model(arguments.model), chosen(state) or shipped(), _dataset(arguments.data)
    old = judge_held_out(NetworkSegmenter(used.path), dataset)
    new = judge_held_out(NetworkSegmenter(model.path), dataset)
    print(f"in use  {used.title:32} {_line(old)}\nnew     {model.title:32} {_line(new)}")
    if losses := worse(old, new):
        raise InputError(
            f"{model.path} is worse than the network in use on the held-out pictures: F of {', '.join(losses)}. "
            "The network in use stays; train longer or on more pictures"
        )
    choose(state, model, {f"{dataset.folder.name}, {len(dataset.names('held-out'))} held out": new})
    print(f"perception uses {model.title} from its next start")


def _state(arguments: argparse.Namespace) -> Path:
    state: Path = arguments.state or usual_state_folder(arguments.robot_id)
    return state


def _model(word: str) -> Model:
    named = {_SHIPPED: shipped, _PHOTOGRAPHS: photographs}
    return named[word]() if word in named else read_model(Path(word))


def _dataset(folder: Path) -> Dataset:
    dataset = read_dataset(folder)
    check(dataset)
    return dataset


def _line(figures: Figures) -> str:
    def said(name: str, key: str) -> str:
        value = figures[name].get(key) if name in figures else None
        return "–" if value is None else f"{value:.3f}"

    return "; ".join(f"{name}: recall {said(name, 'recall')}, precision {said(name, 'precision')}" for name in DECISIVE)


if __name__ == "__main__":
    sys.exit(main())
