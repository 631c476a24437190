"""What springs cost a tick, beside the puppet's own ten iterations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.bundle import default_show_path
from appliance.show.show import load_show
from appliance.stage.stage_parts import StageParts, assemble

GROUP = "springs on the upper body, a tick"


@pytest.fixture
def parts() -> Iterator[StageParts]:
    default: Path = default_show_path()
    box = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
    made = assemble(load_show(default), box)
    for puppet in made.puppets:
        puppet.start(0.0)
    yield made
    made.close()


@pytest.mark.parametrize(
    ("what", "setting", "fade_s"),
    [
        ("alone", "loose", 0.0),
        ("with feedback", "strings", 0.0),
        ("with feedback, in a fade", "strings", 1e6),
    ],
)
def test_springs(
    measured: Callable[..., Any], parts: StageParts, what: str, setting: str, fade_s: float
) -> None:
    springs = parts.led.springs
    assert springs is not None
    springs.enabled = True
    springs.call(setting)
    if fade_s:
        springs.call("loose", fade_s)
    now = iter(range(10**9))
    for _ in range(100):  # until they hold
        springs.pull(0.02 * next(now))
    measured(f"springs {what}", GROUP)(lambda: springs.pull(0.02 * next(now)))
    assert springs.is_holding


def test_the_puppet(measured: Callable[..., Any], parts: StageParts) -> None:
    hands, puppet = parts.led.hands, parts.led.puppet
    puppet.select(parts.led.motion.window())
    puppet.hold(hands.mask, hands.targets, hands.weights, 10, 9)
    measured("ten iterations of the puppet", GROUP, reference=True)(parts.network.dance)
