"""The network: a small encoder-decoder on 2×2 blocks of pixels, with an output for each pixel.

Folding blocks into channels at the input, and unfolding them at the output, separates canes that are a few pixels wide
at a quarter of the cost of full resolution.
"""

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn

#: Channels at 1/2, 1/4, 1/8 and 1/16 of the image's resolution.
WIDTHS = (16, 32, 48, 64)


class _Block(nn.Sequential):
    def __init__(self, inputs: int, outputs: int, stride: int = 1, dilation: int = 1) -> None:
        super().__init__(
            nn.Conv2d(inputs, outputs, 3, stride, dilation, dilation, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
        )


class Network(nn.Module):
    """Images (N×channels×H×W) to logits (N×classes×H×W)."""

    def __init__(self, channels: int, classes: int) -> None:
        """Fresh weights from torch's random state.

        Args:
            channels: Number of input channels.
            classes: Number of classes.
        """
        super().__init__()
        a, b, c, d = WIDTHS
        self.fold = nn.PixelUnshuffle(2)
        self.at_2 = nn.Sequential(_Block(4 * channels, a), _Block(a, a))
        self.at_4 = nn.Sequential(_Block(a, b, stride=2), _Block(b, b))
        self.at_8 = nn.Sequential(_Block(b, c, stride=2), _Block(c, c))
        self.at_16 = nn.Sequential(_Block(c, d, stride=2), _Block(d, d, dilation=2), _Block(d, d, dilation=4))
        self.narrow = nn.ModuleList([nn.Conv2d(d, c, 1), nn.Conv2d(c, b, 1), nn.Conv2d(b, a, 1)])
        self.join = nn.ModuleList([_Block(c, c), _Block(b, b), nn.Sequential(_Block(a, a), _Block(a, 2 * a))])
        self.answer = nn.Sequential(nn.Conv2d(2 * a, 4 * classes, 1), nn.PixelShuffle(2))

    def forward(self, image: Tensor) -> Tensor:
        """Logits of each pixel; height and width of `image` are multiples of 16."""
        half = self.at_2(self.fold(image))
        quarter = self.at_4(half)
        eighth = self.at_8(quarter)
        deep = self.at_16(eighth)
        for narrow, join, beside in zip(self.narrow, self.join, (eighth, quarter, half), strict=True):
            deep = join(nn.functional.interpolate(narrow(deep), scale_factor=2.0, mode="nearest") + beside)
        return cast(Tensor, self.answer(deep))


class Labeller(nn.Module):
    """The network with an argmax: index of the most likely class."""

    prior: Tensor

    def __init__(self, network: Network, weights: Sequence[float]) -> None:
        """Wrap a trained network.

        Args:
            network: The trained network.
            weights: Class weights of the training. They make it learn small classes, but also predict them too wide.
                For the output their logarithm is subtracted.
        """
        super().__init__()
        self.network = network
        self.register_buffer("prior", torch.log(torch.tensor(list(weights))).reshape(1, -1, 1, 1))

    def forward(self, image: Tensor) -> Tensor:
        """Classes (N×H×W, uint8)."""
        return torch.argmax(self.network(image) - self.prior, dim=1).to(torch.uint8)
