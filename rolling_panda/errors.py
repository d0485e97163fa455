"""Errors of Rolling Panda, with one base class, so that an entry point can print any of them as one line."""


class RollingPandaError(Exception):
    """Base class of all errors that the program raises.

    The text has the value, the allowed values and the remedy.
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
    """A service did not answer in time, or its reply was invalid."""


class InputError(RollingPandaError):
    """A value given by a person or a script is outside what is allowed."""


class ControlError(RollingPandaError):
    """A control step has no solution: a value is not finite, or its equations cannot be solved."""


class LedgerError(RollingPandaError):
    """The ledger cannot be read or written, or has been changed from outside."""
