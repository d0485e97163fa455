"""An equivalent network with fewer operations, for export.

Moving pixels into channels and back takes ONNX Runtime nearly as long as all convolutions together. Both moves are
linear and can be merged into the neighbouring layers. The first convolution gets a kernel of twice the size and a
stride of two. The last one gets another order of its channels, so that only the chosen class of each pixel is moved.
"""

from copy import deepcopy
from typing import cast

import torch
from torch import Tensor, nn

from perception.training.network import Labeller

#: Side of the blocks of pixels that the network works on.
_BLOCK = 2


class CompactLabeller(nn.Module):
    """Equal to a labeller except for rounding."""

    def __init__(self, labeller: Labeller) -> None:
        """Take over the weights; the labeller stays as it is."""
        super().__init__()
        network = deepcopy(labeller.network).to(memory_format=torch.contiguous_format)
        begin, answer = network.at_2[0], network.answer[0]
        assert isinstance(begin, nn.Sequential) and isinstance(begin[0], nn.Conv2d) and isinstance(answer, nn.Conv2d)
        begin[0] = _on_pixels(begin[0])
        network.fold = cast(nn.PixelUnshuffle, nn.Identity())
        network.answer = nn.Sequential(_by_place(answer, labeller.prior.flatten()))
        self._network = network
        self._classes = labeller.prior.numel()

    def forward(self, image: Tensor) -> Tensor:
        """Classes (N×H×W, uint8)."""
        logits = self._network(image)
        count, _, height, width = logits.shape
        chosen = torch.argmax(logits.reshape(count, _BLOCK**2, self._classes, height, width), dim=2).to(torch.uint8)
        return nn.functional.pixel_shuffle(chosen, _BLOCK).squeeze(1)


def _on_pixels(layer: nn.Conv2d) -> nn.Conv2d:
    """The convolution of an image's blocks, folded into channels, as one of the image itself."""
    outputs, folded, side, _ = layer.weight.shape
    channels = folded // _BLOCK**2
    out = nn.Conv2d(channels, outputs, _BLOCK * side, _BLOCK, _BLOCK * (side // 2), bias=False)
    # Of each input: channel, row in the block, column in the block; of the kernel: block row, block column.
    parts = layer.weight.detach().reshape(outputs, channels, _BLOCK, _BLOCK, side, side)
    out.weight = nn.Parameter(parts.permute(0, 1, 4, 2, 5, 3).reshape(out.weight.shape).contiguous())
    return out


def _by_place(layer: nn.Conv2d, prior: Tensor) -> nn.Conv2d:
    """The last convolution, less what each class had weighed, all classes of one pixel of the block side by side."""
    assert layer.bias is not None
    out = nn.Conv2d(layer.in_channels, layer.out_channels, 1)
    classes = len(prior)
    weight = layer.weight.detach().reshape(classes, _BLOCK**2, layer.in_channels, 1, 1)
    bias = layer.bias.detach().reshape(classes, _BLOCK**2) - prior[:, None]
    out.weight = nn.Parameter(weight.transpose(0, 1).reshape(layer.weight.shape).contiguous())
    out.bias = nn.Parameter(bias.T.reshape(-1).contiguous())
    return out
