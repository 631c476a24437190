"""bunraku-wifi.yaml: read, refused with line and cure, and written as a profile that NetworkManager takes."""

from __future__ import annotations

import configparser
from pathlib import Path

import pytest

from appliance.release.wifi import WifiFile, is_filled_in, profile, read_wifi
from appliance.show.config_error import ConfigError

EXAMPLE = Path(__file__).resolve().parents[2] / "deploy" / "image" / "bunraku-wifi.yaml"
GOOD = {"country": "DE", "name": "stage net", "password": "correct horse"}


def read(text: str) -> WifiFile:
    return read_wifi(Path("/media/bunraku/bunraku-wifi.yaml"), text.encode())


def keyfile(wifi: WifiFile) -> configparser.ConfigParser:
    parser = configparser.ConfigParser(interpolation=None, delimiters=("=",))
    parser.read_string(profile(wifi))
    return parser


def test_the_example_asks_for_nothing_and_is_sound_once_its_number_signs_are_gone() -> None:
    example = EXAMPLE.read_text()
    assert not is_filled_in(example)
    keys = [line.removeprefix("# ") for line in example.splitlines() if line.partition(":")[0] in _COMMENTED]
    wifi = read("\n".join(keys))
    assert (wifi.country, wifi.access_point, wifi.channel) == ("DE", True, 6)
    assert len(keys) == len(WifiFile.model_fields), "the example has every key"


_COMMENTED = {f"# {name}" for name in WifiFile.model_fields}


def test_a_network_becomes_a_profile() -> None:
    read = keyfile(WifiFile(**GOOD))
    assert bytes(map(int, read["wifi"]["ssid"].strip(";").split(";"))) == b"stage net"
    assert read["wifi-security"]["psk"] == "correct horse"
    assert read["wifi-security"]["key-mgmt"] == "wpa-psk"
    assert read["ipv4"]["dhcp-hostname"] == "bunraku"


@pytest.mark.parametrize("name", ["1;2;3;", "net=work", "Bühne", "[wifi]", "#1"])
@pytest.mark.parametrize("password", ["semi;colon=1", "back\\slash", "  blanks  ", "[wifi]80", "#12345678"])
def test_no_name_and_no_password_is_taken_for_something_else(name: str, password: str) -> None:
    read = keyfile(WifiFile(country="DE", name=name, password=password))
    assert bytes(map(int, read["wifi"]["ssid"].strip(";").split(";"))).decode() == name
    assert _as_networkmanager_reads(read["wifi-security"]["psk"]) == password


def _as_networkmanager_reads(value: str) -> str:
    """GLib's escapes in a value: a backslash and one letter."""
    text, signs = "", iter(value)
    for sign in signs:
        text += {"s": " ", "\\": "\\"}[next(signs)] if sign == "\\" else sign
    return text


def test_the_same_network_keeps_its_profile_and_another_one_has_its_own() -> None:
    one, again, other = (
        keyfile(WifiFile(country="DE", name=name, password="12345678"))["connection"]["uuid"]
        for name in ("a", "a", "b")
    )
    assert one == again != other


def test_norway_is_a_country() -> None:
    assert read("country: NO\nname: hall\npassword: correct horse\n").country == "NO"


@pytest.mark.parametrize(
    ("text", "line", "message", "cure"),
    [
        ("country: DE\nname: hall\n", 1, "'password' is missing", ""),
        ("country: DE\nname: hall\npassword: short\n", 3, "this one has 5", "Copy it from the router"),
        ("country: de\nname: hall\npassword: 12345678a\n", 1, "'de' is no country", "in capitals"),
        ("country: DE\nname: hall\npasword: 12345678a\n", 3, "Unknown key 'pasword'", "password"),
        ("country: DE\nname: hall\npassword: 01234567\n", 3, "This is a number to YAML", "quotation marks"),
        ("country: DE\nname: hall\npassword: 123abc456\nchannel: 3\n", 4, "Channel 3 overlaps", "1, 6 or 11"),
        ("country: DE\nname: hall\npassword: 123abc456\nhostname: My Box\n", 4, "'My Box'", "small letters"),
        ("country: DE\nname: hall\npassword: 'a\n", 4, "This is not YAML", "the one above"),
        ("country: DE\nname: \u201chall\u201d\npassword: \u00fcmlaut-12\n", 3, "A password has", ""),
    ],
)
def test_a_fault_is_named_with_its_line_and_its_cure(text: str, line: int, message: str, cure: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read(text)
    assert caught.value.problems[-1].line == line, str(caught.value)
    assert message in str(caught.value)
    assert cure in str(caught.value)
    assert "342391" not in str(caught.value), "a password is not shown on the wall"
