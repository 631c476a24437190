"""The space of poses: a wobble, a line over the map that becomes a dance, and the map itself."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from playwright.sync_api import Page, expect, sync_playwright

from appliance.dancer.material.map_reach import MapReach
from appliance.dancer.material.pose_paths import even_path, wobbled
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.studio.evaluation.coders import load_checkpoint
from appliance.studio.pose_space.drawing import read_line
from appliance.studio.pose_space.latent_poses import PoseMap, latents_of, poses_of
from appliance.studio.pose_space.projections import projections
from appliance.studio.studio_error import StudioError
from tests.studio.bodies import body, moved
from tests.studio.conftest import bunraku
from tests.studio.tiny import moving, swaying
from tools.page_pictures import CHROMIUM


@pytest.fixture(scope="module")
def model(pose_checkpoint: Path) -> Path:
    return pose_checkpoint


def test_a_phrase_comes_back_from_its_path_with_its_heading(model: Path) -> None:
    autoencoder = load_checkpoint(model)[0].autoencoder
    phrase = swaying(4.0, 0).poses[:, list(moving())]
    turn = quaternion.from_axis_angle([0.0, 1.0, 0.0], 2.0)
    turned = phrase.copy()
    turned[:, 0] = quaternion.multiply(np.broadcast_to(turn, phrase[:, 0].shape), phrase[:, 0])
    for poses in (phrase, turned):
        made = poses_of(autoencoder, *latents_of(autoencoder, poses))
        assert np.degrees(quaternion.angle_between(made, poses)).mean() < 8
    np.testing.assert_allclose(
        latents_of(autoencoder, turned)[0], latents_of(autoencoder, phrase)[0], atol=1e-4
    )


def test_a_wobble_has_its_amplitude_and_its_frequency() -> None:
    still = np.zeros((500, 4), np.float32)
    path = wobbled(still, 0.3, 1.5, seed=2)
    assert np.abs(path).max() == pytest.approx(0.3, abs=0.01)
    for column in path.T:
        assert np.abs(np.fft.rfft(column)).argmax() == 15  # cycles in ten seconds
    assert np.abs(path - wobbled(still, 0.3, 1.5, seed=3)).max() > 0.1
    np.testing.assert_array_equal(wobbled(still, 0.0, 1.5, 1), still)


def test_the_map_leads_there_and_back() -> None:
    rng = np.random.default_rng(1)
    latents = rng.standard_normal((3000, 5)).astype(np.float32)
    effect = rng.standard_normal((5, 30)) * np.array([[1.0], [9.0], [0.5], [4.0], [0.1]])
    pose_map = PoseMap.of(latents, latents @ effect, 2)
    points = rng.standard_normal((20, 2))
    np.testing.assert_allclose(pose_map.points(pose_map.latents(points)), points, atol=1e-5)
    assert pose_map.directions[0, 1] > 0.98 and pose_map.directions[1, 3] > 0.9, "what moves the body most"
    assert 0.9 < pose_map.explained < 1
    own = PoseMap.of(latents * (1, 5, 1, 2, 1), latents * (1, 5, 1, 2, 1), 2)
    assert own.directions[0, 1] > 0.99 and own.explained == pytest.approx(29 / 32, abs=0.03)


def test_a_drawn_line_is_walked_at_an_even_speed() -> None:
    path = even_path(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 3.0]]), 400)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert path.shape == (400, 2) and steps[20:-20].max() < 1.2 * np.median(steps)
    np.testing.assert_allclose(path[[0, -1]], [[0, 0], [1, 3]], atol=0.05)


def test_lines_are_read_from_csv_and_svg(tmp_path: Path) -> None:
    table = tmp_path / "line.csv"
    table.write_text("x,y\n0.5, 1\n# a corner\n-2;0.25\n")
    np.testing.assert_allclose(read_line(table), [[0.5, 1], [-2, 0.25]])
    table.write_text("0,5; 1\n-2;0,25\n", "utf-8-sig")  # as spreadsheets of many countries save it
    np.testing.assert_allclose(read_line(table), [[0.5, 1], [-2, 0.25]])
    drawing = tmp_path / "line.svg"
    drawing.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="400" height="200" viewBox="-200 -100 400 200">'
        '<path d="M 0 0 L 1 1"/>'
        '<g transform="translate(100,0)"><path d="M -50,20 L 50,20 L 50,-80"/></g></svg>'
    )
    line = read_line(drawing)
    np.testing.assert_allclose(line[[0, -1]], [[0.5, -0.2], [1.5, 0.8]], atol=1e-3)
    assert np.abs(line - [1.5, -0.2]).sum(axis=1).min() < 0.02


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "0,0\nhere,there\n", ":2: 'here,there' is no point"),
        ("a.csv", "1,1\n1,1\n", "no line with a length"),
        ("a.csv", "0,nan\n1,1", "finite"),
        ("a.svg", "<svg", "cannot be read as SVG|holds no line"),
        ("a.svg", '<svg xmlns="http://www.w3.org/2000/svg"/>', "holds no line"),
    ],
)
def test_what_is_no_line_is_named(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(StudioError, match=message):
        read_line(tmp_path / name)


def test_path_makes_a_wobbling_phrase(model: Path, recordings: Path, tmp_path: Path) -> None:
    out = tmp_path / "wobble.bvh"
    options = ["--model", model, "--out", out, "--wobble", 0.5, 1.0, "--seconds", 2]
    result = bunraku("path", recordings / "sway_0.bvh", *options)
    assert result.exit_code == 0, result.output
    assert len(read_bvh(out)) == 100 and out.with_suffix(".png").exists()
    assert "planting the feet ..." in result.output and "measuring the dance" in result.output
    figures = json.loads(out.with_suffix(".json").read_text())["figures"]
    assert figures["degrees_from_the_phrase"] > 1


def test_a_map_on_which_nothing_changes_is_dead() -> None:
    """Poses that differ by 30 degrees, and maps that lead from one to another, or hardly anywhere."""
    angles = np.radians(np.random.default_rng(1).uniform(0, 60, 400))

    def poses_at(angle: np.ndarray) -> np.ndarray:
        turned = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), angle)
        return np.stack([np.tile(quaternion.IDENTITY, (len(turned), 1)), turned], axis=1)

    low, high = np.array([-1.0, -2.0]), np.array([1.0, 2.0])
    for degrees, is_dead in ((40.0, False), (7.0, True), (0.0, True)):
        per_corner = np.radians(degrees) / 2
        reach = MapReach.of(
            low, high, lambda points, half=per_corner: poses_at(half * points[:, 0]), poses_at(angles)
        )
        assert reach.corners == pytest.approx(degrees, abs=0.1) and reach.usual == pytest.approx(20, abs=3)
        assert reach.is_dead == is_dead
        assert ("is dead: from corner to corner" in reach.sentence()) == is_dead


def test_a_line_on_the_map_becomes_a_dance(
    model: Path, recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "umap", None)
    files = [recordings / f"sway_{number}.bvh" for number in (0, 1)]
    result = bunraku("map", *files, "--model", model, "--out", tmp_path / "map")
    assert result.exit_code == 0, result.output
    for name in ("map.png", "projections.png", "distance.png", "map.html", "map.svg", "map.json"):
        assert (tmp_path / "map" / name).stat().st_size > 100, name
    report = json.loads((tmp_path / "map" / "map.json").read_text())
    assert "UMAP is not installed here: projections.png has PCA and the pose" in result.output
    assert "laying the recordings over the map ..." in result.output
    assert report["reach"]["is_dead"] is False and "The map is alive" in result.output
    assert set(report["projections"]) >= {"PCA, heading kept", "PCA, heading removed", "pose autoencoder"}
    assert report["apart"]["largest"] >= report["apart"]["mean"] > 0
    assert report["apart"]["on_the_clock"] > 0 and "aligned in time" in result.output
    sheet = (tmp_path / "map" / "map.svg").read_text()
    left, top, width, height = (float(x) for x in re.search(r'viewBox="([^"]+)"', sheet)[1].split())
    drawn = f'<path d="M {left + width / 3} {top + height / 2} l {width / 3} 0"/></svg>'
    (tmp_path / "drawn.svg").write_text(sheet.replace("</svg>", drawn))
    line = read_line(tmp_path / "drawn.svg")
    np.testing.assert_allclose(np.ptp(line, axis=0), [width / 300, 0], atol=1e-3)
    out = tmp_path / "drawn.bvh"
    result = bunraku("path", "--draw", tmp_path / "drawn.svg", "--model", model, "--out", out, "--seconds", 3)
    assert result.exit_code == 0, result.output
    assert len(read_bvh(out)) == 150


def test_umap_stands_beside_the_others_where_it_is_installed(
    model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Umap:
        """A stand-in with the interface of umap-learn: the first two numbers of what it was fitted to."""

        def __init__(self, random_state: int, n_jobs: int) -> None: ...

        def fit(self, shapes: np.ndarray) -> Umap:
            self.middle = shapes.mean(axis=0)
            return self

        def transform(self, shapes: np.ndarray) -> np.ndarray:
            return (shapes - self.middle)[:, -3:-1]

    monkeypatch.setitem(sys.modules, "umap", SimpleNamespace(UMAP=Umap))
    autoencoder, phrase = load_checkpoint(model)[0].autoencoder, swaying(2.0, 0)
    pose_map = PoseMap.of(latents_of(autoencoder, phrase.poses[:, list(moving())])[0], np.eye(100, 6), 2)
    found = {one.name: one.points for one in projections(autoencoder, [phrase], moving(), pose_map)}
    kinds = ("heading kept", "heading removed")
    assert list(found) == [
        *(f"PCA, {kind}" for kind in kinds),
        "pose autoencoder",
        *(f"UMAP, {kind}" for kind in kinds),
    ]
    assert not np.allclose(found["UMAP, heading kept"][0], found["UMAP, heading removed"][0])
    monkeypatch.setitem(sys.modules, "umap", None)
    assert len(projections(autoencoder, [phrase], moving(), pose_map)) == 3


def test_the_page_of_the_map_needs_no_network(model: Path, recordings: Path, tmp_path: Path) -> None:
    bunraku("map", recordings / "sway_0.bvh", "--model", model, "--out", tmp_path)
    page = (tmp_path / "map.html").read_text()
    assert not re.search(r"https?://|src=|@import", page)
    data = json.loads(re.search(r"const data = (\{.*\});\n", page)[1])
    assert data["dances"][0]["name"] == "sway_0" and len(data["dances"][0]["path"]) == 100
    phrase = read_bvh(recordings / "sway_0.bvh")
    figure = np.array(data["dances"][0]["figures"][7]).reshape(-1, 3)
    assert figure.shape == (20 + 5, 3), "joints, then the ends of hands, feet and face"
    own, _ = phrase.skeleton.forward_kinematics(phrase.poses[14], np.zeros(3))
    np.testing.assert_allclose(figure[:20], own, atol=2e-3)
    lengths = [np.linalg.norm(figure[joint] - figure[parent]) for joint, parent in data["bones"][-5:]]
    np.testing.assert_allclose(
        lengths, [np.linalg.norm(offset) for _, offset in phrase.skeleton.ends], atol=2e-3
    )


def test_two_numbers_hold_a_body_of_58_joints_and_are_its_whole_map(tmp_path: Path) -> None:
    (tmp_path / "dancer").mkdir()
    for seed in (1, 2):
        write_bvh(tmp_path / "dancer" / f"take_{seed}.bvh", moved(body(fingers=9), seconds=6.0, seed=seed))
    sizes = ["--latent", 2, "--width", 32, "--steps", 30, "--threads", 1]
    options = ["--recordings", tmp_path / "dancer", "--out", tmp_path / "poses", *sizes]
    result = bunraku("train", "--model", "pose", *options)
    assert result.exit_code == 0, result.output
    model, take = tmp_path / "poses" / "checkpoint.pt", tmp_path / "dancer" / "take_1.bvh"
    result = bunraku("map", take, "--model", model, "--out", tmp_path / "map")
    assert result.exit_code == 0, result.output
    data = json.loads(re.search(r"const data = (\{.*\});\n", (tmp_path / "map" / "map.html").read_text())[1])
    path = np.array(data["dances"][0]["path"])
    assert path.shape == (150, 3) and not path[:, 2].any() and np.ptp(path[:, :2], axis=0).min() > 0
    assert len(data["dances"][0]["figures"][0]) == 3 * 58 and len(data["known"]) > 100
    autoencoder = load_checkpoint(model)[0].autoencoder
    assert poses_of(autoencoder, np.zeros((3, 2), np.float32)).shape == (3, 58, 4)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["{rec}/sway_0.bvh"], 2, "--wobble"),
        (["{rec}/sway_0.bvh", "--wobble", "0.5", "50"], 2, "10 Hz"),
        (["--draw", "{rec}/none.svg"], 2, "does not exist"),
    ],
)
def test_what_makes_no_path_is_named(
    arguments: list[str], code: int, message: str, model: Path, recordings: Path, tmp_path: Path
) -> None:
    given = [each.format(rec=recordings) for each in arguments]
    result = bunraku("path", *given, "--model", model, "--out", tmp_path / "x.bvh")
    assert result.exit_code == code and message in " ".join(result.stderr.split()), result.output


def test_a_puppet_is_no_pose_model(puppet_checkpoint: Path, recordings: Path, tmp_path: Path) -> None:
    result = bunraku("map", recordings / "sway_0.bvh", "--model", puppet_checkpoint, "--out", tmp_path)
    assert result.exit_code == 2 and "is no pose model" in " ".join(result.stderr.split())


# How many pixels of a canvas are near a colour.
COUNT = """([id, colour]) => {
  const canvas = document.getElementById(id), [width, height] = [canvas.width, canvas.height];
  const pixels = canvas.getContext("2d").getImageData(0, 0, width, height).data;
  let count = 0;
  for (let at = 0; at < pixels.length; at += 4)
    if (pixels[at + 3] > 60 && colour.every((value, part) => Math.abs(pixels[at + part] - value) < 25))
      count++;
  return count;
}"""
FIRST, SECOND, GHOST, DOTS = (226, 88, 62), (79, 179, 191), (125, 133, 144), (138, 133, 128)


@pytest.fixture(scope="module")
def page(pose_checkpoint: Path, recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """Opened from the disk, without a network; an error of its script fails the test."""
    out = tmp_path_factory.mktemp("map")
    files = [recordings / f"sway_{number}.bvh" for number in (0, 1)]
    result = bunraku("map", *files, "--model", pose_checkpoint, "--out", out)
    assert result.exit_code == 0, result.output
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        context = chromium.new_context(viewport={"width": 1000, "height": 600}, offline=True)
        tab, errors = context.new_page(), list[str]()
        tab.on("pageerror", lambda error: errors.append(str(error)))
        tab.on(
            "request", lambda request: None if request.url.startswith("file:") else errors.append(request.url)
        )
        tab.goto((out / "map.html").as_uri())
        expect(tab.locator("#clock")).not_to_be_empty()
        tab.click("#play")  # pauses
        yield tab
        chromium.close()
    assert errors == []


def test_paths_dots_and_both_figures_are_drawn(page: Page) -> None:
    for canvas, colour in (
        ("map", FIRST),
        ("map", SECOND),
        ("map", DOTS),
        ("figure", FIRST),
        ("figure", GHOST),
    ):
        assert page.evaluate(COUNT, [canvas, colour]) > 50, (canvas, colour)


@pytest.mark.parametrize("canvas", ["map", "figure"])
def test_it_turns_with_the_mouse_and_comes_nearer_with_the_wheel(page: Page, canvas: str) -> None:
    picture = f"document.getElementById('{canvas}').toDataURL()"
    before = page.evaluate(picture)
    box = page.locator(f"#{canvas}").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 90, box["y"] + box["height"] / 2 + 20)
    page.mouse.up()
    page.wait_for_function(f"before => {picture} != before", arg=before)
    turned = page.evaluate(picture)
    page.mouse.wheel(0, -300)
    page.wait_for_function(f"before => {picture} != before", arg=turned)


def test_the_moment_is_chosen_and_the_distance_there_is_told(page: Page) -> None:
    page.fill("#time", "25")
    expect(page.locator("#clock")).to_contain_text("1.0 s")
    text = page.locator("#clock").inner_text()
    source = page.evaluate("JSON.stringify(data.dances.map((dance) => dance.path[25]))")
    one, other = np.array(json.loads(source))
    assert text == f"1.0 s, {np.linalg.norm(one - other):.2f} apart"
    page.select_option("#which", "1")
    expect(page.locator("#clock")).to_contain_text("0.0 s")
    assert page.evaluate(COUNT, ["figure", SECOND]) > 50


def test_it_is_seen_in_perspective_from_above(page: Page) -> None:
    """x to the right, y up, z towards the eye: what is nearer is farther from the middle, and lower."""
    look = """([pitch, z]) => {
      [figure.yaw, figure.pitch, figure.zoom] = [0, pitch, 1];
      const [context, project] = figure.begin(), [x, y] = project([0.2, 0, z]);
      return [x - context.canvas.width / 2, y - context.canvas.height / 2];
    }"""
    (near, level), (far, _) = (page.evaluate(look, [0, z]) for z in (0.5, -0.5))
    assert near > 1.2 * far > 0 and level == pytest.approx(0)
    assert page.evaluate(look, [0.5, 0.5])[1] > 0 > page.evaluate(look, [0.5, -0.5])[1]
