"""Context managers that close themselves."""

from typing import Self


class Closing:
    """Closes itself at the end of its `with` block."""

    def close(self) -> None:
        """Release what is held; subclasses define it."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        """Return the object itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()
