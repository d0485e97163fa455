"""Encoding of messages: msgpack maps, decoded strictly."""

from typing import Any, Generic, TypeVar

import msgspec

from rolling_panda.errors import MessageError

T = TypeVar("T")
_ENCODER = msgspec.msgpack.Encoder()


class _Nothing(msgspec.Struct, frozen=True, tag="", forbid_unknown_fields=True):
    """Turns a single type into a union, since msgspec requires the tag only in unions."""


def encode(message: msgspec.Struct) -> bytes:
    """Msgpack bytes of a message, a map with its `type` tag."""
    return _ENCODER.encode(message)


class StrictDecoder(Generic[T]):
    """Decodes one message type, or a tagged union of them, and rejects everything else."""

    def __init__(self, *types: type[T]) -> None:
        """Prepare for any of `types`."""
        union: Any = _Nothing
        for kind in types:
            union = union | kind
        self._decoder: msgspec.msgpack.Decoder[T] = msgspec.msgpack.Decoder(union, strict=True)

    def decode(self, data: bytes) -> T:
        """The message in `data`.

        Raises:
            MessageError: Not msgpack, another type or none, an unknown or missing field, a wrong length, NaN, infinity,
                or a number out of range; the text names the field.
        """
        try:
            message = self._decoder.decode(data)
        except msgspec.MsgspecError as error:
            raise MessageError(f"{len(data)} bytes refused: {error}") from error
        except (UnicodeDecodeError, RecursionError) as error:
            raise MessageError(f"{len(data)} bytes refused: not a message ({error})") from error
        if isinstance(message, _Nothing):
            raise MessageError(f"{len(data)} bytes refused: the type is empty")
        return message
