"""The errors of Rolling Panda: one root, so that an entry point can turn any of them into one clear line."""


class RollingPandaError(Exception):
    """Root of every error that the program raises on purpose.

    The text says what was got, what is allowed and what to do.
    """


class ConfigError(RollingPandaError):
    """A configuration file is missing, unreadable, or has a wrong key or value."""


class MessageError(RollingPandaError):
    """Bytes from the wire are not the message that the topic carries."""


class ModelError(RollingPandaError):
    """A robot description is missing or inconsistent."""


class TransportError(RollingPandaError):
    """The wire is not usable: no router, a bad endpoint, a closed session."""


class ServiceError(TransportError):
    """A service did not answer in time, or answered with something else than its reply."""


class InputError(RollingPandaError):
    """A value given by a person or a script is outside what is allowed."""


class ControlError(RollingPandaError):
    """A control step has no answer: its numbers are not finite or its equations cannot be solved."""


class LedgerError(RollingPandaError):
    """The ledger cannot be read or written, or has been changed from outside."""
