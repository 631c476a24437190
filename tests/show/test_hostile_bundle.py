"""Bundles from anywhere: links, FIFOs, devices, enormous files and nonsense are refused in words."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from appliance.cli.run_with_timeout import run_with_timeout
from appliance.dancer.puppet import PuppetError, PuppetNetwork
from appliance.show.bundle import CHECKSUMS, MOST_FILES, write_checksums
from appliance.show.check import verify_bundle
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from tests.show.conftest import SHOW_YAML, save_network, skeleton

PATIENCE_S = 60.0
SECRET = "hunter2 is the password of the box"
FILES = ("show.yaml", "skeleton.bvh", "phrase.bvh", "puppet.onnx", "report.json", CHECKSUMS)


def said(directory: Path) -> list[str]:
    """What the check says, level first; it may not hang."""

    def check() -> bytes:
        return json.dumps([f"{found.level} {found}" for found in verify_bundle(directory)]).encode()

    messages: list[str] = json.loads(run_with_timeout(PATIENCE_S, check))
    return messages


def about(directory: Path, name: str) -> str:
    """All that the check says about one file, which may not pass in silence."""
    found = [message for message in said(directory) if name in message]
    assert found, name
    return "\n".join(found)


@pytest.mark.parametrize("name", FILES)
def test_a_fifo_is_refused_and_holds_nothing_up(bundle: Path, name: str) -> None:
    (bundle / name).unlink()
    os.mkfifo(bundle / name)
    message = about(bundle, name)
    assert "no regular file" in message or "missing or unreadable" in message


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("where", ["/dev/zero", "/etc", "nowhere"])
def test_a_link_out_of_the_bundle_is_refused(bundle: Path, name: str, where: str) -> None:
    (bundle / name).unlink()
    (bundle / name).symlink_to(where)
    assert about(bundle, name)


@pytest.mark.parametrize("name", FILES)
def test_the_contents_of_a_private_file_are_not_disclosed(bundle: Path, tmp_path: Path, name: str) -> None:
    private = tmp_path / "private"
    private.write_text(SECRET)
    (bundle / name).unlink()
    (bundle / name).symlink_to(private)
    message = about(bundle, name)
    assert "hunter2" not in "\n".join(said(bundle))
    assert "leads out of the folder: put the file itself there" in message or name == CHECKSUMS
    if name == "show.yaml":
        with pytest.raises(ConfigError) as refused:
            load_show(bundle)
        assert "hunter2" not in str(refused.value)


def test_a_profile_is_the_show_s_own_file(bundle: Path, tmp_path: Path) -> None:
    (tmp_path / "private").write_text(SECRET)
    (bundle / "profiles").mkdir()
    (bundle / "profiles" / "own.yaml").symlink_to(tmp_path / "private")
    lights = "lights: {fixtures: [{name: wash, profile: own, address: 1}]}\n"
    (bundle / "show.yaml").write_text(SHOW_YAML + lights)
    message = about(bundle, "own.yaml")
    assert "leads out of the folder" in message and "hunter2" not in message


def test_links_within_the_bundle_are_followed(bundle: Path) -> None:
    (bundle / "takes").mkdir()
    (bundle / "phrase.bvh").rename(bundle / "takes" / "spring.bvh")
    (bundle / "phrase.bvh").symlink_to("takes/spring.bvh")
    write_checksums(bundle)
    assert said(bundle) == []
    moved = bundle.with_name("elsewhere")
    moved.symlink_to(bundle)
    assert said(moved) == []


@pytest.mark.parametrize("name", FILES)
def test_an_enormous_file_is_not_read(bundle: Path, name: str) -> None:
    with (bundle / name).open("r+b") as file:
        file.truncate(1 << 40)  # and no room taken
    assert about(bundle, name)


def test_a_folder_that_is_no_show_is_not_searched_to_its_end(bundle: Path) -> None:
    (bundle / "more").mkdir()
    for number in range(MOST_FILES):
        (bundle / "more" / str(number)).touch()
    assert f"more than {MOST_FILES} files" in "\n".join(said(bundle))


@pytest.mark.parametrize(
    "number",
    [
        "1" + ":59" * 3000,
        "1" + ":0" * 200 + ".5",
        "0x" + "f" * 6000,
        "0b" + "1" * 20_000,
        "9" * 5000,
        "1_" * 3000,
        "-9223372036854775809",
    ],
)
def test_a_number_that_is_none_is_refused_with_its_line(bundle: Path, number: str) -> None:
    (bundle / "show.yaml").write_text(
        SHOW_YAML.replace("coding_iterations: 10", f"coding_iterations: {number}")
    )
    message = about(bundle, "show.yaml:3")
    assert len(message) < 1000


@pytest.mark.parametrize(
    "rest",
    ["[" * 100_000, f"[[1, 0, 0, {'9' * 400}]]", "[" + "[1, 0, 0, 0]," * 200_000, '{"a": 1}', "[[[]]]"],
)
def test_a_rest_pose_that_is_none_is_refused(bundle: Path, rest: str) -> None:
    save_network(bundle / "puppet.onnx", facts={"rest": rest})
    assert "rest pose" in about(bundle, "puppet.onnx")
    with pytest.raises(PuppetError, match="does not say what it moves"):
        PuppetNetwork(bundle / "puppet.onnx", skeleton())


@pytest.mark.parametrize("word", [b"[[1.0", b"targets", b"bunraku.joints", b"poses"])
def test_a_network_with_metadata_that_is_not_text_is_refused(bundle: Path, word: bytes) -> None:
    content = (bundle / "puppet.onnx").read_bytes()
    (bundle / "puppet.onnx").write_bytes(content.replace(word, b"\xd7" + word[1:]))
    assert about(bundle, "puppet.onnx")
    with pytest.raises(PuppetError):
        PuppetNetwork(bundle / "puppet.onnx", skeleton())


def test_a_network_of_very_many_joints_is_refused_in_few_words(bundle: Path) -> None:
    names = ",".join(f"joint {number}" for number in range(100_000))
    save_network(bundle / "puppet.onnx", facts={"joints": names})
    assert "more than 1000" in about(bundle, "puppet.onnx")
    save_network(bundle / "puppet.onnx", facts={"joints": ",".join(names.split(",")[:900])})
    assert len(about(bundle, "puppet.onnx").splitlines()) < 20


def test_a_report_that_is_nested_too_deeply_is_a_warning(bundle: Path) -> None:
    (bundle / "report.json").write_text("[" * 100_000)
    assert "warning" in about(bundle, "report.json") and "not JSON" in about(bundle, "report.json")


def test_a_network_reads_no_other_file(bundle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its weights could lie in any file of the machine, and come out as poses."""
    import onnx
    from onnx.external_data_helper import set_external_data

    model = onnx.load(str(bundle / "puppet.onnx"))
    weights = onnx.helper.make_tensor("nothing", onnx.TensorProto.FLOAT, [4], bytes(16), raw=True)
    model.graph.initializer.append(weights)
    model.graph.node[0].CopyFrom(onnx.helper.make_node("Add", ["window", "nothing"], ["poses"]))
    set_external_data(model.graph.initializer[0], "weights.bin")
    model.graph.initializer[0].ClearField("raw_data")
    (bundle / "weights.bin").write_bytes(bytes(16))
    (bundle / "puppet.onnx").write_bytes(model.SerializeToString())
    write_checksums(bundle)
    assert "cannot be read as a network" in about(bundle, "puppet.onnx")
    monkeypatch.chdir(bundle)
    with pytest.raises(PuppetError, match="cannot read this network"):
        PuppetNetwork(bundle / "puppet.onnx", skeleton())
