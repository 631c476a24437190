"""bunraku-wifi.yaml: the Wi-Fi of a new box, from its card or a stick, and NetworkManager's profile of it."""

from __future__ import annotations

import re
import uuid
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, model_validator

from appliance.show.section import Section, key, refusal
from appliance.show.validation import validated
from appliance.show.yaml_file import parsed_yaml

NAME = "bunraku-wifi.yaml"
PROFILE = "wifi.nmconnection"
_NAMES = uuid.UUID("2f6c1d4e-0b9a-4c39-8f0e-6a4f4f6f2d11")  # namespace: the same network, the same id
_CHANNELS = (1, 6, 11)


def _country(text: str) -> str:
    if len(text) == 2 and text.isascii() and text.isalpha() and text.isupper():
        return text
    raise refusal(f"'{text}' is no country.", "Write its two letters in capitals: DE.")


def _norway(value: Any) -> Any:
    """NO without quotation marks is 'no' to YAML."""
    return "NO" if value is False else value


def _quoted(value: Any) -> Any:
    """The value is not repeated: errors are shown on the wall."""
    if isinstance(value, int | float | bool):
        raise refusal("This is a number to YAML.", 'Put it in quotation marks: "...".')
    return value


def _network(text: str) -> str:
    if 1 <= len(text.encode()) <= 32 and text.isprintable() and text == text.strip():
        return text
    raise refusal("This is no name of a network.", "It has 1 to 32 letters, as the router shows it.")


def _password(text: str) -> str:
    if 8 <= len(text) <= 63 and text.isascii() and text.isprintable():
        return text
    raise refusal(
        f"A password has 8 to 63 letters, digits or punctuation; this one has {len(text)}.",
        "Copy it from the router.",
    )


def _hostname(text: str) -> str:
    letters = text.replace("-", "")
    if text.isascii() and letters.isalnum() and len(text) <= 63 and text == text.strip("-").lower():
        return text
    raise refusal(f"'{text}' is no name of a computer.", "Write small letters, digits and hyphens.")


class WifiFile(Section):
    """bunraku-wifi.yaml."""

    country: Annotated[str, BeforeValidator(_norway), AfterValidator(_country)] = key(
        "Where the box is, two letters: a radio that does not know it stays silent."
    )
    name: Annotated[str, BeforeValidator(_quoted), AfterValidator(_network)] = key(
        "The network's name, as the router shows it."
    )
    password: Annotated[str, BeforeValidator(_quoted), AfterValidator(_password)] = key(
        "The network's password."
    )
    hostname: Annotated[str, AfterValidator(_hostname)] = key("The box's own name.", "bunraku")
    access_point: bool = key("The box makes this network itself.", False)
    channel: int = key("Channel of the access point: 1, 6 or 11.", 6)

    @model_validator(mode="after")
    def _channel_is_free_of_its_neighbours(self) -> WifiFile:
        if self.channel not in _CHANNELS:
            raise refusal(f"Channel {self.channel} overlaps its neighbours.", "Write 1, 6 or 11.", "channel")
        return self


def read_wifi(path: Path, content: bytes) -> WifiFile:
    """The file's content. Raises ConfigError with file, line, what is wrong and what to do."""
    return validated(WifiFile, parsed_yaml(path, content), {})


def is_filled_in(text: str) -> bool:
    """False for the example that the image brings, in which every line is a comment."""
    return any(line.strip() and not line.lstrip().startswith("#") for line in text.splitlines())


def profile(wifi: WifiFile) -> str:
    """NetworkManager's keyfile of a network that the box joins, by whichever Wi-Fi card it has."""
    sections = {
        "connection": {
            "id": "wifi",
            "uuid": str(uuid.uuid5(_NAMES, wifi.name)),
            "type": "wifi",
            "autoconnect-retries": "0",  # for ever
        },
        # Names that look like a list of numbers are one; numbers are always a name.
        "wifi": {"mode": "infrastructure", "ssid": _bytes(wifi.name), "powersave": "2"},
        "wifi-security": {"key-mgmt": "wpa-psk", "psk": _escaped(wifi.password)},
        "ipv4": {"method": "auto", "dhcp-hostname": wifi.hostname},
        "ipv6": {"method": "auto", "dhcp-hostname": wifi.hostname},
    }
    return "\n".join(
        f"[{title}]\n" + "".join(f"{name}={value}\n" for name, value in values.items())
        for title, values in sections.items()
    )


def _bytes(text: str) -> str:
    return "".join(f"{byte};" for byte in text.encode())


def _escaped(text: str) -> str:
    """As a keyfile has it: a backslash twice, blanks at an end by their code."""
    text = text.replace("\\", "\\\\")
    ended = text.rstrip(" ")
    begun = ended.lstrip(" ")
    return "\\s" * (len(ended) - len(begun)) + begun + "\\s" * (len(text) - len(ended))


def unescaped(text: str) -> str:
    """A value of a keyfile as it was meant."""
    return re.sub(r"\\(.)", lambda found: " " if found[1] == "s" else found[1], text)
