"""Another value for a key: the text keeps everything else, and reads as what was asked for."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from appliance.show.yaml_edit import with_value

VENUE = """\
# The hall in May
sensors:
  udp: {host: 0.0.0.0, port: 9750}  # broadcast
outputs:
  osc:
    - {host: 192.0.2.7, port: 9004}
    # the second one
    - host: 192.0.2.8
      port: 9005
console:
  viewers:
  - 192.0.2.0/24

  # the rehearsal stays
  rehearsal: true
control:
"""


@pytest.mark.parametrize(
    ("location", "value"),
    [
        (("sensors", "udp", "port"), 9751),
        (("sensors", "udp", "host"), "127.0.0.1"),
        (("outputs", "osc", 0, "port"), 9100),
        (("outputs", "osc", 1, "host"), "192.0.2.9"),
        (("console", "viewers"), ["fd00::/8", "192.0.2.0/24"]),
        (("console", "viewers"), []),
        (("console", "host"), "::"),
        (("console", "rehearsal"), False),
        (("control", "port"), 9100),
        (("journal", "folder"), "a: strange # name"),
        (("sensors", "keys"), "sensors.keys"),
        (("outputs", "osc", 0, "dialect"), "vmc"),
    ],
)
def test_one_value_changes_and_no_comment_is_lost(location: tuple[str | int, ...], value: Any) -> None:
    wanted = yaml.safe_load(VENUE)
    at: Any = wanted
    for step in location[:-1]:
        at[step] = at.get(step) or {} if isinstance(at, dict) else at[step]
        at = at[step]
    at[location[-1]] = value
    text = with_value(VENUE, location, value)
    assert yaml.safe_load(text) == wanted, text
    assert [
        line.partition("#")[2] for line in text.splitlines() if "#" in line and "strange" not in line
    ] == [line.partition("#")[2] for line in VENUE.splitlines() if "#" in line]


@pytest.mark.parametrize("text", ["", "# nothing yet\n"])
def test_an_empty_file_gets_its_first_key(text: str) -> None:
    changed = with_value(text, ("console", "port"), 8081)
    assert yaml.safe_load(changed) == {"console": {"port": 8081}} and changed.startswith(text)


def test_what_cannot_be_changed_is_said() -> None:
    with pytest.raises(ValueError, match="no entry 5"):
        with_value(VENUE, ("outputs", "osc", 5, "port"), 1)
    with pytest.raises(ValueError, match="not YAML"):
        with_value("a: [", ("a",), 1)
