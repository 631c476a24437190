"""An option that would do nothing in the way a command is used is refused by its name."""

from __future__ import annotations

import pytest

from tests.command import Command


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("play --alone --window", "--window does nothing with --alone"),
        ("project --offscreen 64x64 --key", "--key does nothing without --raw or --frames"),
        ("kept --out a.bvh", "--out does nothing without the NAME"),
        ("sound --show x", "--show does nothing without --file"),
        ("emulate --serial /dev/none --host 10.0.0.1 --port 1", "--host, --port do nothing with --serial"),
        ("emulate --baud 9600", "--baud does nothing without --serial"),
        ("emulate --joint head", "--joint does nothing without the motion 'trace'"),
        ("filmstrip a.journal --facing x", "--facing does nothing with a journal"),
        ("filmstrip a.bvh --show default", "--show does nothing without --look"),
    ],
)
def test_it_is_named_and_nothing_is_done(arguments: str, message: str, bunraku: Command) -> None:
    said = " ".join(bunraku(*arguments.split(), status=2).err.replace("│", " ").split())
    assert message in said and "out." in said, said


def test_an_option_that_the_user_did_not_write_is_no_reason(bunraku: Command) -> None:
    """A default counts as left out, also where it is not empty."""
    assert (
        "does nothing" not in bunraku("emulate", "--serial", "/dev/none", "--keys", "/absent/x", status=2).err
    )
