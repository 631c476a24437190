"""OSC packets as plain messages, both ways, with python-osc; what is none raises ValueError, nothing else."""

from __future__ import annotations

from collections.abc import Sequence

from pythonosc.osc_message_builder import BuildError, OscMessageBuilder
from pythonosc.osc_packet import OscPacket
from pythonosc.parsing import osc_types

Message = tuple[str | int | float, ...]  # an OSC address and its arguments
MOST_MESSAGES = 64  # of a bundle; a desk that sends more at once sends several bundles


def messages_in(received: bytes) -> list[tuple[str, list[object]]]:
    """Addresses and arguments of a datagram, bundles flattened, time tags taken as 'now'.

    Raises ValueError for what is no OSC, and for bundles of more than MOST_MESSAGES.
    """
    try:
        messages = [timed.message for timed in OscPacket(received).messages]
    except Exception as error:  # python-osc raises many kinds, RecursionError among them
        raise ValueError("This is no OSC.") from error
    if len(messages) > MOST_MESSAGES:
        raise ValueError(f"A bundle of {len(messages)} messages is too long: send {MOST_MESSAGES} at most.")
    return [(message.address, message.params) for message in messages]


def datagram(message: Message) -> bytes:
    """One OSC message: its address, then whole numbers, fractions and texts. Raises ValueError for others."""
    try:
        builder = OscMessageBuilder(str(message[0]))
        for argument in message[1:]:
            builder.add_arg(argument)
        return bytes(builder.build().dgram)
    except (BuildError, osc_types.BuildError, ValueError) as error:
        raise ValueError(f"This is no OSC: {error}") from None


def readable(text: str) -> str:
    """What may be shown on a terminal, whoever sent it: no control characters."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)


def is_readable(values: Sequence[object]) -> bool:
    """Whether the texts among them have no control characters in them."""
    return all(value.isprintable() for value in values if isinstance(value, str))
