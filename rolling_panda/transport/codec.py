"""Encoding of messages: msgpack maps, decoded strictly."""

from typing import Any, Generic, TypeVar

import msgspec

from rolling_panda import reasons
from rolling_panda.errors import MessageError
from rolling_panda.messages.types import Reason
from rolling_panda.reasons import text_of

T = TypeVar("T")
_ENCODER = msgspec.msgpack.Encoder()
#: Characters of the decoder's words: the bridge's state repeats them.
_WORDS = 200


class UndecodableError(MessageError):
    """Bytes are not a message of their topic; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        """Store the reason."""
        super().__init__(text_of(reason))
        self.reason = reason


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
            UndecodableError: Not msgpack, another type or none, an unknown or missing field, a wrong length, NaN,
                infinity, or a number out of range; the reason names the field.
        """
        try:
            message = self._decoder.decode(data)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise UndecodableError(reasons.message_undecodable(len(data), str(error)[:_WORDS])) from error
        if isinstance(message, _Nothing):
            raise UndecodableError(reasons.message_without_type(len(data)))
        return message
