"""bunraku experiment writes page, strips, recordings and figures of the networks that it compares."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from appliance.pose.bvh import read_bvh, write_bvh
from appliance.show.bundle import default_show_path
from appliance.studio.experiments.families import CONDITIONS


def test_the_command_writes_page_strips_recordings_and_figures_of_two_networks_side_by_side(
    tmp_path: Path, puppet_checkpoint: Path, long_run: bool
) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    phrase = read_bvh(default_show_path() / "phrase.bvh")
    write_bvh(folder / "solo.bvh", phrase.excerpt(0, 12))
    (tmp_path / "excerpts.yaml").write_text("mine: {take: solo, start: 2}\n")
    done = subprocess.run(
        [
            *(sys.executable, "-m", "appliance.cli.app", "experiment", "--out", str(tmp_path / "out")),
            *("--recordings", str(folder), "--excerpts", str(tmp_path / "excerpts.yaml")),
            *("--network", str(puppet_checkpoint)),
            "--pictures" if long_run else "--no-pictures",
        ],
        env={**os.environ, "COLUMNS": "200"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "(a) One pass reproduces the recording faithfully." in " ".join(
        done.stdout.replace("│", " ").split()
    )
    report = json.loads((tmp_path / "out/experiments.json").read_text())
    assert report["excerpts"]["mine"]["take"] == "solo"
    assert [name.partition(",")[0] for name in report["networks"]] == ["coupled", "mlp"]
    for network in report["networks"].values():
        assert set(network["claims"]) == set("abcdefg")
    page = (tmp_path / "out/experiments.html").read_text()
    assert "".join(f"<th>{name}</th>" for name in ("bounds", *report["networks"], "null networks")) in page
    assert list(report["null_networks"]) == ["copy", "paste", "mean", "untrained"]
    copied = report["null_networks"]["copy"]["claims"]
    assert copied["a"]["holds_on_the_whole"] and not copied["f"]["holds_on_the_whole"]
    assert report["worth"]["a"] == "copy and paste pass, rightly: nothing is to change"
    assert "http" not in page, "it opens without a network"
    assert page.count("data:image/jpeg;base64,") == (13 if long_run else 0)
    assert (tmp_path / "out/experiments.png").exists() == long_run
    danced = sorted((tmp_path / "out").glob("coupled*/mine/*.bvh"))
    assert len(danced) == len(CONDITIONS) + 1
    assert len(read_bvh(next(path for path in danced if path.name == "turning_5s_10_10.bvh"))) == 750
