"""The speaker: lines for people come out, whatever is in them and whoever reads them."""

from __future__ import annotations

import os

from appliance.box.log_writer import Speaker


def test_a_name_that_is_no_text_does_not_silence_what_follows() -> None:
    reading, writing = os.pipe()
    speaker = Speaker(writing)
    speaker.say(os.fsdecode(b"caf\xe9.bvh"))
    speaker.say("The show goes on.")
    speaker.close()
    os.close(writing)
    assert os.read(reading, 1000) == b"caf\\udce9.bvh\nThe show goes on.\n"
    os.close(reading)


def test_who_does_not_read_holds_nobody_up() -> None:
    reading, writing = os.pipe()
    speaker = Speaker(writing)
    for _ in range(1000):
        speaker.say("x" * 1000)
    speaker.close()
    os.close(reading)
    os.close(writing)
