"""How often a universe leaves, with a clock of the test's own."""

from __future__ import annotations

from itertools import pairwise

import pytest

from appliance.outputs.dmx.pace import KEEP_ALIVE_S, REPEATS, Universe
from tests.outputs.dmx.conftest import config, universe


class Listener:
    """A wire that remembers."""

    name = "listener"
    sent = dropped = 0
    last_error = ""
    is_open = True
    trouble = None

    def __init__(self) -> None:
        self.heard: list[tuple[float, bytes]] = []
        self.is_closed = False

    def send_universe(self, levels: bytes | bytearray, now: float) -> None:
        self.heard.append((now, bytes(levels)))

    def close(self) -> None:
        self.is_closed = True


def paced(**keys: object) -> tuple[Universe, Listener]:
    listener = Listener()
    return Universe(config("artnet", **keys), listener), listener


@pytest.mark.parametrize("offers_hz", [44, 50, 60, 1000])
@pytest.mark.parametrize("rate_hz", [1.0, 30.0, 40.0, 44.0])
def test_what_changes_leaves_at_the_wire_s_rate(offers_hz: int, rate_hz: float) -> None:
    one, listener = paced(rate_hz=rate_hz)
    seconds = 20
    for offer in range(seconds * offers_hz):
        one.offer(universe(offer), offer / offers_hz)
    times = [now for now, _ in listener.heard]
    assert all(late - early >= 0.25 / rate_hz - 1e-9 for early, late in pairwise(times))
    assert all(late - early >= 9 / rate_hz for early, late in zip(times, times[10:], strict=False))
    assert len(times) >= 0.95 * seconds * min(rate_hz, offers_hz)


def test_a_caller_that_wakes_late_now_and_then_gets_every_universe_away() -> None:
    one, listener = paced()
    late_s = (0.0, 0.004, 0.0, 0.0, 0.009, 0.001)
    for tick in range(600):
        assert one.offer(universe(tick), tick * 0.025 + late_s[tick % len(late_s)])
    assert len(listener.heard) == 600


def test_the_newest_leaves() -> None:
    one, listener = paced()
    one.offer(universe(1), 0.0)
    one.offer(universe(2), 0.002)
    one.offer(universe(3), 0.004)
    one.offer(universe(3), 0.026)
    assert [data for _, data in listener.heard] == [universe(1), universe(3)]


def test_what_does_not_change_is_repeated_and_then_kept_alive() -> None:
    one, listener = paced()
    for tick in range(4000):
        one.offer(universe(), tick * 0.001)
    times = [now for now, _ in listener.heard]
    assert times[: REPEATS + 1] == pytest.approx([0.0, 0.00625, 0.03125, 0.05625], abs=0.002)
    gaps = [late - early for early, late in pairwise(times[REPEATS:])]
    assert gaps == pytest.approx([KEEP_ALIVE_S] * len(gaps), abs=0.002)
    assert gaps


def test_a_change_after_a_rest_leaves_at_once() -> None:
    one, listener = paced()
    for tick in range(2000):
        one.offer(universe(), tick * 0.001)
    before = len(listener.heard)
    assert one.offer(universe(1), 2.0)
    assert len(listener.heard) == before + 1


def test_darkness_at_the_start_is_sent_too() -> None:
    one, listener = paced()
    assert one.offer(bytes(512), 0.0)
    assert listener.heard == [(0.0, bytes(512))]


def test_what_was_offered_last_leaves_before_the_end() -> None:
    one, listener = paced()
    one.offer(universe(), 0.0)
    one.offer(bytes(512), 0.001)
    one.close(0.002)
    assert listener.heard[-1] == (0.002, bytes(512))
    assert listener.is_closed


def test_a_box_that_cedes_sends_nothing_more() -> None:
    """What waited when the other box took over would be a second source for the node."""
    one, listener = paced()
    for offer in range(3):
        one.offer(universe(offer), 0.001 * offer)
    before = len(listener.heard)
    one.cede(0.004)
    one.close(9.0)
    assert (len(listener.heard), listener.is_closed) == (before, True)


def test_after_a_stall_nothing_leaves_in_a_burst() -> None:
    one, listener = paced()
    one.offer(universe(0), 0.0)
    for tick in range(90):
        one.offer(universe(tick), 5.0 + tick * 0.001)
    times = [now for now, _ in listener.heard]
    assert times == pytest.approx([0.0, 5.0, 5.006, 5.031, 5.056, 5.081], abs=0.002)


@pytest.mark.parametrize("channels", [0, 511, 513])
def test_a_universe_has_512_channels(channels: int) -> None:
    one, listener = paced()
    with pytest.raises(ValueError, match=f"512 channels, not {channels}"):
        one.offer(bytes(channels), 0.0)
    assert not listener.heard


def test_a_buffer_that_is_used_again_is_seen_to_change() -> None:
    one, listener = paced()
    levels = bytearray(512)
    one.offer(levels, 0.0)
    levels[0] = 255
    one.offer(levels, 0.030)
    assert listener.heard[-1][1][0] == 255


def test_an_adapter_without_memory_has_its_usual_rate() -> None:
    assert config("open-dmx").rate == 30.0
    assert config("open-dmx", rate_hz=20.0).rate == 20.0
    assert config("sacn").rate == 40.0
