"""`rolling-panda train`: fine-tune a network for photographs on labelled pictures of one's own vineyard.

It trains on the pictures of the split `train` with drawn ones among them, judges on the held-out ones, ends when these
do not get better, and writes the best network with its card. A run that was interrupted continues where it stopped.
"""

import argparse
import copy
import hashlib
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor, nn

from perception.arrays import Labels
from perception.dataset.dataset import MANIFEST, UNLABELLED, Dataset, check, read_dataset
from perception.models.cards import Card, Data, photographs, read_model, write_card
from perception.models.judge import DECISIVE, Figures, judge_held_out
from perception.segmentation.frame import BACKGROUND, GROUND
from perception.segmentation.network_segmenter import NetworkSegmenter, network_input
from perception.single_image import photograph_width
from perception.training.familiarity import add_familiarity
from perception.training.int8 import weights_of
from perception.training.wide.drawing import FAR, Artist, Drawing
from perception.training.wide.export import MULTIPLE, Answer, prior, write_onnx
from perception.training.wide.fit import keep, weighted_loss
from perception.training.wide.network import PhotographNetwork, load_pretrained
from rolling_panda.errors import InputError, RollingPandaError
from rolling_panda.messages.types import WOOD_CLASSES

#: `--from` these begins with the encoder of ImageNet, or with the shipped network of drawn photographs.
IMAGENET, _PHOTOGRAPHS = "imagenet", "photographs"
#: Parts of one's own pictures in a batch; one drawn picture is added, so that what was learned before is kept.
_OWN = 3
#: Pictures by which a network tells what is familiar.
_SHOWN = 400
#: Rates of decoder and encoder, and the range of sizes at which pictures are shown.
_RATE, _ENCODER_RATE, _SCALES = 1e-3, 2e-4, (0.6, 1.15)
#: Steps between judgements, and judgements without a better one after which training ends.
_JUDGE_EVERY, _PATIENCE = 50, 6


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rolling-panda train", description=__doc__)
    parser.add_argument(
        "--from",
        dest="begin",
        required=True,
        metavar="MODEL",
        help=f"'{_PHOTOGRAPHS}', '{IMAGENET}' or an ONNX file of `….wide`",
    )
    parser.add_argument("--data", type=Path, required=True, nargs="+", metavar="DIR", help="datasets")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="ONNX file to write; its card beside it"
    )
    parser.add_argument("--work", type=Path, default=Path("build/train"), metavar="DIR", help="state and curve")
    parser.add_argument("--steps", type=int, default=2000, help="at most (default: %(default)s)")
    parser.add_argument("--size", type=int, default=320, help="side of the parts (px, default: %(default)s)")
    parser.add_argument("--judge-every", type=int, default=_JUDGE_EVERY, metavar="STEPS", help="(default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    words = parser.parse_args(argv)
    try:
        _train(words, list(sys.argv[1:] if argv is None else argv))
    except (RollingPandaError, OSError) as error:
        print(f"rolling-panda train: {error}", file=sys.stderr)
        return 1
    return 0


def _train(words: argparse.Namespace, options: list[str]) -> None:
    if words.size % MULTIPLE or words.size < 64 or words.steps < 1 or words.judge_every < 1:
        raise InputError(
            f"--size {words.size} --steps {words.steps} --judge-every {words.judge_every}: give a size that is a "
            f"multiple of {MULTIPLE} from 64, and whole numbers from 1"
        )
    datasets = [_read(folder) for folder in words.data]
    network = PhotographNetwork(len(WOOD_CLASSES))
    torch.manual_seed(words.seed)
    begun = None
    if words.begin != IMAGENET:
        begun = photographs() if words.begin == _PHOTOGRAPHS else read_model(Path(words.begin))
    if begun is None:
        load_pretrained(network.encoder)
    else:
        load_exported(network, begun.path)
    marks = [(each.folder / MANIFEST).read_bytes() for each in datasets] + [(begun.sha256 if begun else "").encode()]
    tuner = Tuner(network, datasets, words.size, words.seed, hashlib.sha256(b"".join(marks)).hexdigest())
    words.work.mkdir(parents=True, exist_ok=True)
    kept = words.work / "state.pt"
    if kept.exists():
        tuner.restore(torch.load(kept, weights_only=True), kept)
        print(f"continues after step {tuner.step}", flush=True)
    else:
        tuner.judge()
    print(f"step {tuner.step:>6}  held-out F {tuner.curve[-1].f:.3f}", flush=True)
    begin, first = time.monotonic(), tuner.step
    while tuner.step < words.steps and tuner.waited < _PATIENCE:
        losses = [tuner.train_step() for _ in range(min(words.judge_every, words.steps - tuner.step))]
        tuner.judge(float(np.mean(losses)))
        keep(tuner, kept)
        lines = "".join(f"{each.step},{each.loss:.5f},{each.f:.5f}\n" for each in tuner.curve)
        (words.work / "curve.csv").write_text(f"step,loss,held-out F\n{lines}", encoding="utf-8")
        left = (time.monotonic() - begin) / (tuner.step - first) * (words.steps - tuner.step) / 60.0
        last = tuner.curve[-1]
        print(f"step {last.step:>6}  loss {last.loss:.4f}  held-out F {last.f:.3f}  {left:.0f} min left", flush=True)
    best = max(each.f for each in tuner.curve)
    if not best > tuner.curve[0].f:
        raise InputError(
            f"no better on the held-out pictures than at the beginning (F {tuner.curve[0].f:.3f}) after {tuner.step} "
            f"steps; {words.out} is not written. Label more pictures, or look whether the labels fit"
        )
    print("writes the network with its limit of familiarity; a minute or two", flush=True)
    figures = _write(words.out, tuner, datasets)
    data = [Data(d.manifest.source, d.manifest.licence, len(d.names("train"))) for d in datasets]
    before = begun.card.data if begun is not None and begun.card is not None else ()
    command = " ".join(["rolling-panda train", *options])
    write_card(
        words.out,
        Card(
            hashlib.sha256(words.out.read_bytes()).hexdigest(),
            (*before, *data),
            command,
            begun.sha256 if begun is not None else "",
            figures,
        ),
    )
    print(f"held-out F {tuner.curve[0].f:.3f} before, {best:.3f} now; {words.out} is written")


def _read(folder: Path) -> Dataset:
    dataset = read_dataset(folder)
    try:
        summary = check(dataset)
    except InputError as error:
        raise InputError(f"{folder}: {error}") from error
    if not all(summary.pictures.values()):
        train, held_out = summary.pictures["train"], summary.pictures["held-out"]
        raise InputError(
            f"{folder} has {train} pictures to train on and {held_out} held out; both are needed: import it with "
            "--held-out 0.2"
        )
    return dataset


def _write(path: Path, tuner: "Tuner", datasets: Sequence[Dataset]) -> dict[str, Figures]:
    """Write the best network; returns its figures on the held-out pictures, of the file itself."""
    network, temperature = tuner.best()
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new.onnx")
    write_onnx(new, network, temperature)
    add_familiarity(new, tuner.shown(_SHOWN))
    new.replace(path)
    segmenter = NetworkSegmenter(path)
    return {f"{d.folder.name}, {len(d.names('held-out'))} held out": judge_held_out(segmenter, d) for d in datasets}


@dataclass(frozen=True)
class Judgement:
    """A point of the curve: step, mean loss since the last one, and F on the held-out pictures at a temperature."""

    step: int
    loss: float
    f: float
    temperature: float


class Tuner:
    """A network in training, its optimiser and its best weights so far. It can be saved and resumed."""

    def __init__(
        self, network: PhotographNetwork, datasets: Sequence[Dataset], size: int, seed: int, mark: str
    ) -> None:
        """Begin.

        Args:
            network: With the weights to begin from.
            datasets: With pictures of both splits.
            size: Side of the parts that are trained on (px).
            seed: Of the choice of parts.
            mark: Of datasets and first weights; a state of another mark is not resumed.
        """
        self._network, self._datasets, self.size, self._seed, self._mark = network, datasets, size, seed, mark
        # Its normalisation stays as it was trained: batches are small.
        network.eval()
        self._artist = Artist(size)
        pictures = [dataset.load(name) for dataset in datasets for name in dataset.names("train")]
        # A picture without a label teaches nothing.
        self._pictures = [each for each in pictures if (each[1] != UNLABELLED).any()] or pictures
        held_out = [dataset.load(name) for dataset in datasets for name in dataset.names("held-out")]
        self._held_out = [_scaled(color, labels, 1.0, 0) for color, labels in held_out]
        encoder = set(network.encoder.parameters())
        decoder = [parameter for parameter in network.parameters() if parameter not in encoder]
        groups = [{"params": decoder, "lr": _RATE}, {"params": list(network.encoder.parameters()), "lr": _ENCODER_RATE}]
        self._optimiser = torch.optim.AdamW(groups, weight_decay=1e-3)
        self._best = copy.deepcopy(network.state_dict())
        self.step, self.waited = 0, 0
        self.curve: list[Judgement] = []

    def train_step(self) -> float:
        """One step; returns its loss."""
        rng = np.random.default_rng([self._seed, self.step])
        parts = [self._part(rng) for _ in range(_OWN)] + [self._artist.draw(self._seed, self.step)]
        images = torch.from_numpy(np.stack([network_input(each.color, each.depth) for each in parts]))
        labels = torch.from_numpy(np.stack([each.labels for each in parts]).astype(np.int64))
        known = labels != UNLABELLED
        logits = self._network(images).permute(0, 2, 3, 1)[known].T
        loss = weighted_loss(logits[None, :, None], labels[known][None, None])
        self._optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self._network.parameters(), 5.0)
        self._optimiser.step()
        self.step += 1
        return float(loss.detach())

    def judge(self, loss: float = float("nan")) -> None:
        """Judge on the held-out pictures, and remember the weights if they are the best so far."""
        # Which class is told depends on the temperature, since wood is told from a low probability on.
        temperature = _temperature(self._network, self._held_out)
        segmenter = _TorchSegmenter(self._network, temperature)
        values = [_mean_f(judge_held_out(segmenter, dataset)) for dataset in self._datasets]
        f = float(np.mean(values))
        if not self.curve or f > max(each.f for each in self.curve):
            self._best, self.waited = copy.deepcopy(self._network.state_dict()), 0
        else:
            self.waited += 1
        self.curve.append(Judgement(self.step, loss, f, temperature))

    def best(self) -> tuple[PhotographNetwork, float]:
        """The network that was best on the held-out pictures, and its temperature."""
        out: PhotographNetwork = copy.deepcopy(self._network)
        out.load_state_dict(self._best)
        return out, max(self.curve, key=lambda each: each.f).temperature

    def shown(self, count: int) -> list[NDArray[np.float32]]:
        """Inputs of the network (each 4×size×size): parts of the own pictures and drawings by turns."""
        rng = np.random.default_rng([self._seed, count])
        parts = [self._artist.draw(self._seed, k, 1) if k % 2 else self._part(rng) for k in range(count)]
        return [network_input(each.color, each.depth) for each in parts]

    def state(self) -> dict[str, object]:
        """Everything that `restore` needs."""
        return {
            "mark": self._mark,
            "step": self.step,
            "waited": self.waited,
            "network": self._network.state_dict(),
            "best": self._best,
            "optimiser": self._optimiser.state_dict(),
            "curve": [(each.step, each.loss, each.f, each.temperature) for each in self.curve],
        }

    def restore(self, state: dict[str, object], path: Path) -> None:
        """Go on from where `state` was taken.

        Raises:
            InputError: It is of other data or another first network.
        """
        if state.get("mark") != self._mark:
            raise InputError(f"{path} is of other datasets or another --from; give another --work, or remove it")
        step, waited, curve, best = state["step"], state["waited"], state["curve"], state["best"]
        assert isinstance(step, int) and isinstance(waited, int) and isinstance(curve, list) and isinstance(best, dict)
        self.step, self.waited, self._best = step, waited, best
        self.curve = [Judgement(*each) for each in curve]
        self._network.load_state_dict(state["network"])
        self._optimiser.load_state_dict(state["optimiser"])

    def _part(self, rng: np.random.Generator) -> Drawing:
        """A part of a picture at random size, mirrored in half of the cases, lighter or darker, of another white."""
        color, labels = self._pictures[int(rng.integers(len(self._pictures)))]
        whole = _scaled(color, labels, float(rng.uniform(*_SCALES)), self.size)
        height, width = whole.labels.shape
        y, x = int(rng.integers(height - self.size + 1)), int(rng.integers(width - self.size + 1))
        window = slice(y, y + self.size), slice(x, x + self.size)
        gain = rng.uniform(0.7, 1.3) * rng.uniform(0.93, 1.07, 3)
        light = np.clip(whole.color[window] * gain, 0.0, 255.0).astype(np.uint8)
        step = 1 if rng.random() < 0.5 else -1
        return Drawing(light[:, ::step], None, whole.labels[window][:, ::step])


def _scaled(color: NDArray[np.uint8], labels: Labels, factor: float, least: int) -> Drawing:
    """A picture at the width at which `perceive` would see it, times a factor, and at least so large on each side."""
    height, width = labels.shape
    wanted = photograph_width(width, labels) * factor
    size = max(1, round(wanted)), max(1, round(wanted * height / width))
    pad = ((0, max(0, least - size[1])), (0, max(0, least - size[0])))
    resized = np.pad(np.asarray(Image.fromarray(color).resize(size, Image.Resampling.BOX)), (*pad, (0, 0)), mode="edge")
    classes = np.asarray(Image.fromarray(labels).resize(size, Image.Resampling.NEAREST))
    return Drawing(resized, None, np.pad(classes, pad, constant_values=UNLABELLED))


def _temperature(network: PhotographNetwork, pictures: Sequence[Drawing]) -> float:
    """The temperature of least cross entropy on labelled pixels; a far pixel may be background or ground."""
    kept, labels = [], []
    with torch.inference_mode():
        for each in pictures:
            logits, known = _logits(network, each.color), each.labels != UNLABELLED
            # Every seventh pixel is enough.
            chosen = torch.from_numpy(np.flatnonzero(known)[::7])
            kept.append((logits - prior()[:, None, None]).flatten(1)[:, chosen].T)
            labels.append(torch.from_numpy(each.labels.reshape(-1).astype(np.int64))[chosen])
        all_logits, all_labels = torch.cat(kept), torch.cat(labels)
        candidates = np.geomspace(0.5, 3.0, 37)
        losses = []
        for temperature in candidates:
            told = torch.log_softmax(all_logits / temperature, dim=1)
            either = torch.logaddexp(told[:, BACKGROUND], told[:, GROUND])
            right = told.gather(1, all_labels.clamp(max=FAR - 1)[:, None])[:, 0]
            losses.append(-float(torch.where(all_labels == FAR, either, right).mean()))
    return float(candidates[int(np.argmin(losses))])


def _logits(network: nn.Module, color: NDArray[np.uint8]) -> Tensor:
    height, width = color.shape[:2]
    image = np.pad(network_input(color, None), ((0, 0), (0, -height % MULTIPLE), (0, -width % MULTIPLE)), mode="edge")
    out: Tensor = network(torch.from_numpy(image)[None])[0]
    return out[:, :height, :width]


def _mean_f(figures: Figures) -> float:
    """Mean F of the decisive classes that the pictures show."""
    return float(np.mean([figures[name]["f"] or 0.0 for name in DECISIVE if figures[name]["recall"] is not None]))


class _TorchSegmenter:
    """Tells classes as the exported network will."""

    def __init__(self, network: PhotographNetwork, temperature: float) -> None:
        self._answer = Answer(copy.deepcopy(network), temperature).eval()

    def classify_surely(
        self, color: NDArray[np.uint8], depth: NDArray[np.float32] | None
    ) -> tuple[Labels, NDArray[np.float32] | None]:
        height, width = color.shape[:2]
        image = network_input(color, depth)
        image = np.pad(image, ((0, 0), (0, -height % MULTIPLE), (0, -width % MULTIPLE)), mode="edge")
        with torch.inference_mode():
            classes, _ = self._answer(torch.from_numpy(image)[None])
        labels: Labels = classes[0, :height, :width].numpy()
        return labels, None


def load_exported(network: PhotographNetwork, path: Path) -> None:
    """Give a network the weights of an ONNX file that `write_onnx` wrote.

    Export merges most normalisations into the convolutions before them; these become the identity with an offset.

    Raises:
        InputError: The file is of another network.
    """
    try:
        graph = onnx.load(str(path)).graph
    except Exception as error:
        raise InputError(f"cannot read the network {path}: {error}") from error
    values = {name: torch.from_numpy(value.copy()) for name, value in weights_of(graph).items()}
    nodes = [node for node in graph.node if node.op_type in ("Conv", "BatchNormalization")]
    layers = _in_order(network)
    other = InputError(
        f"{path} is no network of `python -m perception.training.wide`; give one, or --from {IMAGENET} to begin anew"
    )
    offset: Tensor | None = None
    with torch.no_grad():
        for layer in layers:
            if isinstance(layer, nn.BatchNorm2d):
                if nodes and nodes[0].op_type == "BatchNormalization":
                    parts = [values[name] for name in nodes.pop(0).input[1:]]
                    offset = None
                elif offset is not None:
                    ones = torch.ones_like(offset)
                    parts = [torch.sqrt(ones + layer.eps), offset, torch.zeros_like(offset), ones]
                else:
                    raise other
                own = (layer.weight, layer.bias, layer.running_mean, layer.running_var)
                for mine, theirs in zip(own, parts, strict=True):
                    if mine is None or mine.shape != theirs.shape:
                        raise other
                    mine.copy_(theirs)
                continue
            if not nodes or nodes[0].op_type != "Conv":
                raise other
            inputs = [values.get(name) for name in nodes.pop(0).input[1:]]
            weight = inputs[0]
            if weight is None or weight.shape != layer.weight.shape:
                raise other
            offset = inputs[1] if len(inputs) > 1 else None
            if layer is network.answer[0] and offset is not None:
                # `Answer` has places of classes instead of classes of places, and takes the prior off.
                size = len(WOOD_CLASSES)
                weight = weight.reshape(-1, size, *weight.shape[1:]).transpose(0, 1).reshape(weight.shape)
                offset = (offset.reshape(-1, size).T + prior()[:, None]).reshape(-1)
            layer.weight.copy_(weight)
            if layer.bias is not None and offset is not None:
                layer.bias.copy_(offset)
    if nodes:
        raise other


def _in_order(network: PhotographNetwork) -> list[nn.Conv2d | nn.BatchNorm2d]:
    """Convolutions and normalisations in the order in which they compute."""
    order: list[nn.Conv2d | nn.BatchNorm2d] = []
    hooks = [
        module.register_forward_hook(lambda module, *_: order.append(module))
        for module in network.modules()
        if isinstance(module, nn.Conv2d | nn.BatchNorm2d)
    ]
    training = network.training
    with torch.no_grad():
        network.eval()(torch.zeros(1, 4, 64, 64))
    network.train(training)
    for hook in hooks:
        hook.remove()
    return order


if __name__ == "__main__":
    sys.exit(main())
