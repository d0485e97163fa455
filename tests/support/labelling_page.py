"""The labelling page's server in a thread, on a small dataset, with a network that the test plays."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image

from labelling.folder import open_folder
from labelling.pictures import Pictures, packed
from labelling.service import labelling_server, listen_locally
from perception.segmentation.frame import CANE, GROUND

#: Width and height of the pictures.
SIZE = (96, 64)


class PlayedProposals:
    """Proposes a cane in columns 10 to 19, and ground elsewhere."""

    title = "played.onnx 0123456789ab"

    def of(self, picture: Path) -> bytes:
        labels = np.full(SIZE[::-1], GROUND, np.uint8)
        labels[:, 10:20] = CANE
        return packed(labels)


def vines(folder: Path, count: int = 3) -> Path:
    """A folder of pictures of noise; returns its dataset, wholly unlabelled."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(count):
        color = np.random.default_rng(number).integers(0, 255, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
        Image.fromarray(color).save(folder / f"v{number}.jpg")
    return open_folder(folder)[0].folder


@contextmanager
def labelling_page(dataset: Path, port: int = 0) -> Iterator[str]:
    """Serves the page meanwhile; gives the link to sign in with."""
    with listen_locally(port) as listener:
        server, link = labelling_server(listener, Pictures(dataset), PlayedProposals())
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            yield link
        finally:
            server.should_exit = True
            thread.join()
