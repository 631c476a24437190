"""The help file: everything that helps, and no secret."""

from __future__ import annotations

import zipfile
from pathlib import Path

from appliance.cli.help_file import help_file

BOX = """# our Wi-Fi password is swordfish
sensors: {keys: keys.yaml}
console:
  port: 8080
  report:
    webhook: https://me:hunter2@hooks.example.org/T0ken
    mail: {to: [a@b.c], sender: a@b.c, host: mail.b.c, user: stage, password: mail.password}
"""
LOG = [
    "12:00 play: The page: http://10.0.0.2:8080, PIN 123456.",
    "12:01 play: http://10.0.0.2/phone#left=abcdef2345",
]
SECRETS = ("swordfish", "hunter2", "T0ken", "123456", "abcdef2345", "mail.password")


def test_it_has_each_part_and_no_secret(tmp_path: Path) -> None:
    box, out = tmp_path / "box.yaml", tmp_path / "help.zip"
    box.write_text(BOX)
    help_file(
        out, box, tmp_path / "no journal", LOG, {"verdict": "PIN 123456"}, {"host": "stage"}, "All is well.\n"
    )
    with zipfile.ZipFile(out) as whole:
        parts = {name: whole.read(name).decode() for name in whole.namelist()}
    assert set(parts) == {"README.txt", "doctor.txt", "log.txt", "status.json", "box.yaml", "versions.json"}
    assert "missing" in parts["README.txt"] and "made" in parts["README.txt"]
    assert parts["doctor.txt"] == "All is well.\n"
    assert "port: 8080" in parts["box.yaml"] and "host: mail.b.c" in parts["box.yaml"]
    for name, text in parts.items():
        assert not [secret for secret in SECRETS if secret in text], name


def test_a_broken_box_file_is_no_reason_to_send_nothing(tmp_path: Path) -> None:
    box, out = tmp_path / "box.yaml", tmp_path / "help.zip"
    for text in ("a: [", "", "\ufeff- &a [*a]\n"):
        box.write_text(text)
        help_file(out, box, None, [], {}, {}, "")
        with zipfile.ZipFile(out) as whole:
            assert whole.read("box.yaml")
            assert "not asked for" in whole.read("README.txt").decode()
