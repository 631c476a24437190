"""Provisioning over a real pseudo-terminal: whatever breaks off, file and wearable stay in step."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from appliance.sensor.keys import KeyFileError, SensorKey, create_keys, load_keys
from appliance.sensor.provisioning.provisioning import (
    Provisioned,
    ProvisioningError,
    WearableSettings,
    provision,
)
from appliance.sensor.provisioning.wearable_console import ConsoleError, WearableConsole
from tests.sensor.fake_console import FakeWearable, Memory

pytestmark = pytest.mark.usefixtures("short_settling")
SETTINGS = WearableSettings("left-wrist", "stage net", "curtain up 9", 9751, "ndof", (0x21, 0x02))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "sensors.keys"


def provisioned(
    fake: FakeWearable,
    path: Path,
    settings: WearableSettings = SETTINGS,
    takes_over: bool = False,
    worn: Sequence[str] = (),
) -> tuple[Provisioned, list[str]]:
    said: list[str] = []
    with WearableConsole(fake.port, patience_s=5.0) as console:
        done = provision(
            console, path, settings, lambda what, message: said.append(f"{what} {message}"), takes_over, worn
        )
    return done, said


def refused(
    fake: FakeWearable,
    path: Path,
    settings: WearableSettings = SETTINGS,
    takes_over: bool = False,
    worn: Sequence[str] = (),
) -> str:
    before = path.read_bytes() if path.exists() else None
    with pytest.raises((ProvisioningError, ConsoleError)) as caught:
        provisioned(fake, path, settings, takes_over, worn)
    assert (path.read_bytes() if path.exists() else None) == before
    assert [one.name for one in path.parent.iterdir()] == ([path.name] if before is not None else [])
    message = str(caught.value)
    for key in (fake.draft.key, fake.saved.key):
        assert not key or key.hex() not in message
    assert settings.password not in message or not settings.password
    return message


def test_both_sides_have_the_same_key_and_the_wearable_all_settings(path: Path) -> None:
    with FakeWearable() as fake:
        done, said = provisioned(fake, path)
    [sensor] = load_keys(path).values()
    assert sensor == done.sensor
    assert path.stat().st_mode & 0o777 == 0o600
    assert fake.saved == Memory(
        *("left-wrist", f"{sensor.device_id:08x}", sensor.key, "stage net", "curtain up 9", "9751"),  # type: ignore[arg-type]
        *("ndof", "21 02"),
    )
    assert (done.replaced, done.was) == (False, "")
    assert said[0].startswith(f"{fake.port} wearable 1.0.0, IMU 00112233, board deadbeef")
    assert len(said) == 4
    assert not any(secret in "\n".join(said) for secret in (sensor.key.hex(), "curtain up 9"))


@pytest.mark.parametrize(("crystal", "reported"), [(True, "yes"), (False, "no"), (None, "yes")])
def test_a_crystal_is_set_only_when_asked_for(path: Path, crystal: bool | None, reported: str) -> None:
    with FakeWearable(Memory(crystal="yes")) as fake:
        provisioned(fake, path, WearableSettings("head", crystal=crystal))
    assert fake.saved.crystal == reported
    assert any(line.startswith("set crystal") for line in fake.heard) == (crystal is not None)


def test_by_cable_alone_it_forgets_a_network_and_keeps_the_rest(path: Path) -> None:
    with FakeWearable(Memory("x", "none", b"", "old net", "old password", 1, "ndof", "21 02")) as fake:
        provisioned(fake, path, WearableSettings("head"))
    assert (fake.saved.network, fake.saved.password) == ("", "")
    assert (fake.saved.fusion, fake.saved.axes) == ("ndof", "21 02")


def test_the_same_wearable_again_gets_a_new_key_under_its_old_id(path: Path) -> None:
    with FakeWearable() as fake:
        first, _ = provisioned(fake, path)
        second, said = provisioned(fake, path)
    assert second.replaced
    assert second.sensor.device_id == first.sensor.device_id
    assert second.sensor.key != first.sensor.key
    assert load_keys(path) == {"left-wrist": second.sensor}
    assert "left-wrist has its new key" in said[-1]


def test_a_sensor_whose_name_is_a_word_of_the_console_is_known_again(path: Path) -> None:
    with FakeWearable() as fake:
        provisioned(fake, path, WearableSettings("device"))
        done, _ = provisioned(fake, path, WearableSettings("device"))
    assert done.replaced


def test_after_new_firmware_it_takes_its_name_again(path: Path) -> None:
    old = create_keys(path, ["left-wrist", "head"])
    with FakeWearable() as blank:
        done, _ = provisioned(blank, path)
    assert load_keys(path) == {"left-wrist": done.sensor, "head": old["head"]}


@pytest.mark.parametrize(
    ("own", "message"), [("spare-1", "is 'spare-1' already"), ("", "provisioned elsewhere")]
)
def test_a_wearable_does_not_take_anothers_name_by_mistake(path: Path, own: str, message: str) -> None:
    keys = create_keys(path, ["left-wrist", "spare-1"])
    device = f"{keys[own].device_id:08x}" if own else "00000001"
    with FakeWearable(Memory("left-wrist", device)) as fake:
        reported = refused(fake, path)
        assert message in reported
        assert f"bunraku sensors replace left-wrist {own or '--port'}" in reported
        assert fake.saved.key == b""
        done, _ = provisioned(fake, path, takes_over=True)
    assert done.was == own
    assert load_keys(path)["left-wrist"] == done.sensor
    assert done.sensor.device_id not in (keys["left-wrist"].device_id, keys["spare-1"].device_id)


def test_a_wearable_of_the_show_does_not_leave_its_joint_to_replace_another(path: Path) -> None:
    keys = create_keys(path, ["left-wrist", "right-ankle"])
    with FakeWearable(Memory("right-ankle", f"{keys['right-ankle'].device_id:08x}")) as fake:
        reported = refused(fake, path, takes_over=True, worn=["right-ankle"])
        assert "This wearable is right-ankle, a sensor of this show" in reported
        assert fake.saved.key == b""
        done, _ = provisioned(
            fake, path, WearableSettings("right-ankle"), worn=["right-ankle"]
        )  # its own name
    assert load_keys(path)["right-ankle"] == done.sensor


def test_a_wearable_that_changes_its_name_tells_the_old_one(path: Path) -> None:
    keys = create_keys(path, ["spare-1"])
    with FakeWearable(Memory("spare-1", f"{keys['spare-1'].device_id:08x}")) as fake:
        done, _ = provisioned(fake, path)
    assert done.was == "spare-1"
    assert list(load_keys(path)) == ["spare-1", "left-wrist"]


STEPS = [
    "show",
    *(f"set {what}" for what in ("name", "device", "key", "network", "password", "port", "fusion", "axes")),
    "prove",
]


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("when", ["pulls_at", "pulls_after"])
def test_a_cable_pulled_before_the_save_has_changed_nothing(path: Path, step: str, when: str) -> None:
    create_keys(path, ["head"])
    fake = FakeWearable(**{when: step})  # type: ignore[arg-type]
    with fake:
        message = refused(fake, path)
    assert "came loose" in message
    assert "Nothing was changed" in message
    assert fake.saved == Memory()
    fake.pulls_at = fake.pulls_after = ""
    with fake:  # plugged in again
        done, _ = provisioned(fake, path)
    assert load_keys(path)["left-wrist"].key == done.sensor.key == fake.saved.key


@pytest.mark.parametrize("when", ["pulls_at", "pulls_after"])
@pytest.mark.parametrize("is_known", [False, True])
def test_a_cable_pulled_at_the_save_is_said_and_mended_by_another_run(
    path: Path, when: str, is_known: bool
) -> None:
    fake = FakeWearable()
    if is_known:
        with fake:
            provisioned(fake, path)
    setattr(fake, when, "save")
    with fake:
        message = refused(fake, path)
    assert "may or may not have its new key" in message
    assert "was not changed, so the box does not let it in" in message
    assert "run this again" in message
    setattr(fake, when, "")
    with fake:
        done, _ = provisioned(fake, path)
    assert load_keys(path) == {"left-wrist": done.sensor}
    assert fake.saved.key == done.sensor.key


def test_a_key_that_arrives_damaged_is_never_saved(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    take = FakeWearable._set

    def damaged(self: FakeWearable, what: str, value: str) -> str:
        return take(self, what, f"{int(value[:2], 16) ^ 0xFF:02x}" + value[2:] if what == "key" else value)

    monkeypatch.setattr(FakeWearable, "_set", damaged)
    with FakeWearable() as fake:
        assert "could not prove that the key arrived" in refused(fake, path)
    assert "save" not in fake.heard


def test_a_wearable_that_loses_its_key_while_saving_is_not_believed(path: Path) -> None:
    with FakeWearable(forgets=True) as fake:
        assert "lost its key" in refused(fake, path)


def test_what_the_wearable_refuses_is_passed_on(path: Path) -> None:
    with FakeWearable(refuses={"set axes": "error: axes are a turn; nothing was changed"}) as fake:
        message = refused(fake, path)
    assert "axes are a turn" in message
    assert "Nothing was changed" in message
    with FakeWearable(refuses={"save": "error: the flash did not take the settings; try again"}) as fake:
        assert "not stored" in refused(fake, path)


def test_another_wire_is_refused_with_both_and_what_to_flash(path: Path) -> None:
    with FakeWearable(wire_hash=0x12345678) as fake:
        message = refused(fake, path)
    assert "firmware 1.0.0 speaks wire 12345678" in message
    assert "Flash firmware/wearable of this version" in message
    assert not any(line.startswith("set") for line in fake.heard)


def test_a_port_where_nothing_answers_is_told_apart(path: Path) -> None:
    with (
        FakeWearable(mute=True, chatter=False) as fake,
        WearableConsole(fake.port, patience_s=0.3) as console,
        pytest.raises(ConsoleError, match="Nothing on"),
    ):
        console.identify()


def test_a_wearable_that_repeats_a_secret_does_not_get_it_printed(path: Path) -> None:
    with FakeWearable(refuses={"set password": "error: what is curtain up 9"}) as fake:
        assert "repeated what is secret" in refused(fake, path)


def test_a_full_disk_is_noticed_before_anything_is_saved(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with FakeWearable() as fake:
        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space"):
            provisioned(fake, path)
    assert fake.saved == Memory()
    assert list(path.parent.iterdir()) == []


def test_a_broken_key_file_stops_it_before_the_wearable_is_touched(path: Path) -> None:
    path.write_text("left-wrist: {")
    with FakeWearable() as fake, pytest.raises(KeyFileError):
        provisioned(fake, path)
    assert fake.heard == ["id"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"name": "left wrist"}, "A sensor's name has"),
        ({"name": "x" * 25}, "1 to 24"),
        ({"network": "n" * 33}, "at most 32 bytes"),
        ({"network": " net"}, "no space at its ends"),
        ({"network": "net\nset key 00"}, "control characters"),
        ({"password": "short"}, "8 to 63"),
        ({"password": "p" * 64}, "8 to 63"),
        ({"password": "with\nline end"}, "control characters"),
        ({"network": ""}, "needs a network"),
        ({"axes": (0x20, 0)}, "no axes"),
        ({"axes": (0x24, 8)}, "no axes"),
        ({"axes": (0x124, 0)}, "no axes"),
    ],
)
def test_settings_that_cannot_be_are_refused_before_anything_is_asked(
    wrong: dict[str, object], message: str
) -> None:
    given = {"name": "a", "network": "net", "password": "password", **wrong}
    with pytest.raises(ProvisioningError, match=message) as caught:
        WearableSettings(**given)  # type: ignore[arg-type]
    assert "with\nline end" not in str(caught.value)


def test_nothing_shows_a_secret(path: Path) -> None:
    with FakeWearable() as fake:
        done, _ = provisioned(fake, path)
    assert "curtain up 9" not in repr(SETTINGS)
    assert done.sensor.key.hex() not in repr(done)


def test_a_fresh_key_has_an_id_of_its_own(path: Path) -> None:
    create_keys(path, [f"sensor-{number}" for number in range(8)])
    with FakeWearable() as fake:
        done, _ = provisioned(fake, path)
    assert isinstance(done.sensor, SensorKey)
    assert len({key.device_id for key in load_keys(path).values()}) == 9
