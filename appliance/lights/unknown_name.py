"""A name that a show's rig does not have."""

from __future__ import annotations


class UnknownNameError(ValueError):
    """The message says which names there are. option: the option of the command that named it."""

    def __init__(self, option: str, message: str) -> None:
        super().__init__(message)
        self.option = option
