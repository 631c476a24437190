"""Commands of bunraku, run in the test's own process."""

from __future__ import annotations

from typing import NamedTuple

import pytest


class Output(NamedTuple):
    """What a command printed."""

    out: str
    err: str


class Command:
    """`bunraku("check", show, status=2)`: run a command to its end; fails for another exit status."""

    def __init__(self, capture: pytest.CaptureFixture[str]) -> None:
        self._capture = capture

    def __call__(self, *arguments: object, status: int = 0) -> Output:
        from appliance.cli.app import main  # here: importing it sets the environment of numerical libraries

        self._capture.readouterr()
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        output = Output(*self._capture.readouterr())
        assert (ended.value.code or 0) == status, output
        assert "Traceback" not in output.err, output.err
        return output
