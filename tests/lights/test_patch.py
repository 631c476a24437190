"""The patch: what a value does on the wire, byte for byte, and what master and blackout do to it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from appliance.lights.patch import Patch, Values
from appliance.show.config_error import ConfigError
from appliance.show.fixture_profile import built_in_folder, load_profile
from appliance.show.lights import LightsConfig


def patch_of(fixtures: list[dict[str, Any]], show: Path | None = None) -> Patch:
    config = LightsConfig.model_validate({"fixtures": fixtures}, context={"directory": show})
    return Patch(config.fixtures, show)


@pytest.fixture
def show(tmp_path: Path) -> Path:
    """A show's folder with profiles of its own."""
    profiles = {
        "odd": {
            "name": "Odd",
            "modes": [
                {
                    "name": "one",
                    "channels": ["dimmer", "-", "pan fine", "tilt", "pan", "pan finer", "strobe", "amber"],
                }
            ],
            "attributes": [
                {"name": "dimmer", "limits": [8, 134], "invert": True},
                {"name": "strobe", "limits": [10, 19], "default": 0.5},
            ],
        },
        "cells": {
            "name": "Cells",
            "modes": [{"name": "one", "channels": ["dimmer", "dimmer 1", "red 1", "dimmer 2", "red 2"]}],
        },
        "cmy": {"name": "CMY", "modes": [{"name": "one", "channels": ["cyan", "magenta", "yellow"]}]},
        "white": {"name": "White", "modes": [{"name": "one", "channels": ["warm white", "cold white"]}]},
        "fog": {
            "name": "Fog",
            "modes": [{"name": "one", "channels": ["fog", "fan"]}],
            "attributes": [{"name": "fog", "dims": True}],
        },
    }
    (tmp_path / "profiles").mkdir()
    for name, profile in profiles.items():
        (tmp_path / "profiles" / f"{name}.yaml").write_text(yaml.safe_dump(profile))
    return tmp_path


def with_values(patch: Patch, **values: float) -> Values:
    """The defaults with some attributes changed on all fixtures; _ stands for a space."""
    changed = patch.defaults.copy()
    for name, value in values.items():
        changed[patch.select([], name.replace("_", " "))] = value
    return changed


def test_every_byte_lands_where_the_profile_has_it(show: Path) -> None:
    patch = patch_of([{"name": "odd", "profile": "odd", "universe": 3, "address": 101}], show)
    levels = patch.encode(with_values(patch, dimmer=1.0, pan=0x123456 / 0xFFFFFF, tilt=1.0))[3]
    assert levels[100:108] == bytes([8, 0, 0x34, 255, 0x12, 0x56, 14, 255])
    assert not any(levels[:100]) and not any(levels[108:])
    dark = patch.encode(with_values(patch, dimmer=0.0))[3]
    assert dark[100] == 134


@pytest.mark.parametrize(("value", "coarse", "fine"), [(0.0, 0, 0), (1.0, 255, 255), (0.5, 128, 0)])
def test_sixteen_bits_are_used_to_their_ends(value: float, coarse: int, fine: int) -> None:
    patch = patch_of([{"name": "head", "profile": "moving-wash", "address": 1}])
    assert patch.encode(with_values(patch, pan=value))[1][:2] == bytes([coarse, fine])


@pytest.mark.parametrize(("inverted", "first"), [(False, 255), (True, 0)])
def test_pan_turns_round_where_the_patch_says_so(inverted: bool, first: int) -> None:
    patch = patch_of([{"name": "head", "profile": "moving-wash", "address": 1, "invert_pan": inverted}])
    assert patch.encode(with_values(patch, pan=1.0))[1][0] == first


def test_universes_are_apart_and_full_ones_fit() -> None:
    fixtures = [
        {"name": f"{universe}-{address}", "profile": "dimmer", "universe": universe, "address": address}
        for universe in (7, 2)
        for address in range(1, 513)
    ]
    patch = patch_of(fixtures)
    values = np.concatenate([np.full(512, 1.0), np.zeros(512)])
    levels = patch.encode(values)
    assert levels == {7: bytes([255]) * 512, 2: bytes(512)}


def test_the_master_scales_dimmers_and_leaves_the_rest() -> None:
    patch = patch_of([{"name": "par", "profile": "led-par", "mode": "RGBW", "address": 1}])
    values = with_values(patch, dimmer=1.0, red=1.0)
    assert patch.encode(patch.dimmed(values, 0.5))[1][:2] == bytes([128, 255])
    assert patch.encode(patch.dimmed(values, 0.0))[1][:2] == bytes([0, 255])


@pytest.mark.parametrize(
    ("profile", "lit", "half", "dark"),
    [
        ("rgb", [255, 255, 255], [128, 128, 128], [0, 0, 0]),
        ("cmy", [0, 0, 0], [128, 128, 128], [255, 255, 255]),
        ("white", [255, 255], [128, 128], [0, 0]),
    ],
)
def test_a_lamp_without_a_dimmer_is_dimmed_by_its_colours(
    show: Path, profile: str, lit: list[int], half: list[int], dark: list[int]
) -> None:
    patch = patch_of([{"name": "lamp", "profile": profile, "address": 1}], show)
    count = len(lit)
    for dimmer, level, wanted in [(1, 1, lit), (1, 0.5, half), (0.5, 1, half), (0, 1, dark), (1, 0, dark)]:
        shown = patch.dimmed(with_values(patch, dimmer=dimmer), level)
        assert list(patch.encode(shown)[1][:count]) == wanted
    assert list(patch.encode(patch.dimmed(patch.defaults, 1.0))[1][:count]) == dark  # until a rule lights it


def test_amber_goes_dark_with_the_colours_beside_it(show: Path) -> None:
    profile = {"name": "A", "modes": [{"name": "one", "channels": ["red", "green", "blue", "amber"]}]}
    (show / "profiles" / "amber.YAML").write_text(yaml.safe_dump(profile))
    patch = patch_of([{"name": "lamp", "profile": "amber", "address": 1}], show)
    values = with_values(patch, dimmer=1.0, amber=1.0)
    assert patch.encode(patch.dimmed(values, 1.0))[1][3] == 255
    assert patch.encode(patch.dimmed(values, 0.0))[1][3] == 0
    assert patch.encode(patch.dimmed(with_values(patch, dimmer=1.0), 1.0))[1][3] == 0  # waits for a rule


def test_cells_are_dimmed_once_by_the_dimmer_above_them(show: Path) -> None:
    patch = patch_of([{"name": "bar", "profile": "cells", "address": 1}], show)
    shown = patch.dimmed(with_values(patch, dimmer=1.0), 0.5)
    assert list(patch.encode(shown)[1][:5]) == [128, 255, 255, 255, 255]
    assert len(patch.select(["bar"], "red")) == 2
    assert len(patch.select(["bar"], "red 2")) == 1
    assert len(patch.select(["bar"], "dimmer")) == 1


def test_fog_obeys_the_blackout_when_its_profile_says_so(show: Path) -> None:
    patch = patch_of([{"name": "fog", "profile": "fog", "address": 1}], show)
    assert list(patch.encode(patch.dimmed(with_values(patch, fog=1.0, fan=1.0), 0.0))[1][:2]) == [0, 255]


@pytest.mark.parametrize("name", sorted(path.stem for path in built_in_folder().glob("*.yaml")))
def test_the_profiles_that_come_along_are_sound(name: str) -> None:
    profile = load_profile(name, None)
    for mode in profile.modes:
        patch = patch_of([{"name": "one", "profile": name, "mode": mode.name, "address": 1}])
        assert len(patch.encode(patch.defaults)[1]) == 512
        assert not patch.dimmed(patch.defaults, 1.0)[patch.dims].any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("channels: [pan, pan]", "'pan' is on channels 1 and 2"),
        ("channels: [tilt, pan fine]", "'pan fine' has no coarse channel 'pan'"),
        ("channels: [pan]\n    chanels: 1", "Did you mean 'channels'?"),
        ("channels: [pan]\nattributes:\n  - {name: pna}", "Did you mean 'pan'?"),
        ("channels: [pan]\nattributes:\n  - {name: pan, limits: [9, 3]}", "no room between its ends"),
        ("channels: []", "too short or too long"),
    ],
)
def test_a_faulty_profile_is_named_with_its_line(tmp_path: Path, change: str, message: str) -> None:
    (tmp_path / "profiles").mkdir()
    file = tmp_path / "profiles" / "bad.yaml"
    file.write_text(f"name: Bad\nmodes:\n  - name: one\n    {change}\n")
    with pytest.raises(ConfigError) as caught:
        load_profile("bad", tmp_path)
    assert message in str(caught.value)
    assert f"{file}:" in str(caught.value)
    assert caught.value.line >= 4 or "attributes" in change


def test_a_show_may_bring_its_own_version_of_a_profile(tmp_path: Path) -> None:
    (tmp_path / "profiles").mkdir()
    own = {"name": "Mine", "modes": [{"name": "one", "channels": ["dimmer"]}]}
    (tmp_path / "profiles" / "led-par.yaml").write_text(yaml.safe_dump(own))
    assert load_profile("led-par", tmp_path).name == "Mine"
    assert load_profile("led-par", None).name != "Mine"
    with pytest.raises(KeyError):
        load_profile("../show", tmp_path)


def test_at_rest_everything_is_zero_but_what_would_be_light(show: Path) -> None:
    patch = patch_of(
        [
            {"name": "par", "profile": "led-par", "address": 1},
            {"name": "cmy", "profile": "cmy", "address": 21},
        ],
        show,
    )
    levels = patch.encode(patch.rest())[1]
    assert levels[20:23] == bytes((255, 255, 255))
    assert not any(levels[:20]) and not any(levels[23:])
