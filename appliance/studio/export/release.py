"""From a checkpoint to a show: export, quantization gate, report, and everything else in a bundle."""

from __future__ import annotations

import errno
import logging
import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from appliance.body.mesh_file import MESH_FILE
from appliance.exchange.glb_body import BODY_FILE
from appliance.pose import quaternion
from appliance.pose.anatomy import Anatomy
from appliance.pose.recording import Recording
from appliance.pose.roles import UPPER_ARMS
from appliance.pose.skeleton import Skeleton
from appliance.pose.whole_file import exchange, sync
from appliance.show.bundle import write_checksums
from appliance.studio.autoencoder.training_run import stop_signals
from appliance.studio.dance_files import write_report
from appliance.studio.data.dataset import Dataset, Take
from appliance.studio.data.remembered import KEY, Remembered, reading_facts
from appliance.studio.data.sources import Sources
from appliance.studio.evaluation.coders import MovedJoints, OnnxCoder, Poses, TorchCoder, load_puppet
from appliance.studio.evaluation.evaluation import evaluate, fitting_hop, load_takes
from appliance.studio.evaluation.own_answer import own_answer
from appliance.studio.evaluation.pictures import longest_sound
from appliance.studio.evaluation.puppetry_report import print_answer
from appliance.studio.evaluation.report import write_up
from appliance.studio.evaluation.report_picture import draw_report
from appliance.studio.export import packing
from appliance.studio.export.chosen_phrase import choose_phrase
from appliance.studio.export.export import export
from appliance.studio.export.gate import judge, median_ms, sample_windows
from appliance.studio.progress import logged
from appliance.studio.studio_error import StudioError

_log = logging.getLogger(__name__)

EQUALITY = 1e-4  # in any component of any quaternion after 10 iterations
EQUALITY_WINDOWS = 16
PHRASE_S = 60.0
SHORT_PHRASE_S = 20.0  # a held-out excerpt shorter than this gives way to a longer one from training
HANGING_DEGREES = 80.0  # below horizontal: a hanging arm does not touch the hip
LEVEL_DEGREES = 45.0  # above horizontal: a bone that points further up is no arm
_PHRASE_OF_ITS_OWN = "Its own: bunraku improvise CHECKPOINT --out FILE, then bunraku export --phrase FILE."
ANSWER = "answer.png"  # there only if the answer to a hand was measured
_MADE = ".export-"
FIRST_HANDS = ("left upper arm", "left forearm", "left hand", "right upper arm", "head")


@dataclass(frozen=True)
class Request:
    """The options for a show. name '': the folder's; phrase None: the bundle's own, or an excerpt; hand: the
    joint that the first sensor holds, None: the left upper arm.
    """

    checkpoint: Path
    source: Sources
    out: Path
    name: str = ""
    phrase: Path | None = None
    hand: str | None = None


def release(request: Request, dataset: Dataset, console: Console) -> dict[str, Any]:
    """Write the whole bundle and return its report. Raises StudioError if export and training differ.

    Its files take the place of those in `out` once all are made: after an error, Ctrl-C or a power cut the
    show that was there is as it was.
    """
    request.out.mkdir(parents=True, exist_ok=True)
    for left in request.out.glob(f"{_MADE}*"):  # by an export that was killed
        shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=_MADE, dir=request.out) as folder:
        made = Path(folder) / "show"
        made.mkdir()
        with logged(console):
            report = _make(request, dataset, made, console)
        put_in_place(made, request.out.resolve())
    print_answer(console, report["puppetry"])
    return report


def _make(request: Request, dataset: Dataset, folder: Path, console: Console) -> dict[str, Any]:
    """Write what is new in the bundle into a folder; its report."""
    coder, state = load_puppet(request.checkpoint)
    name = request.name or request.out.resolve().name
    missing = [name for name in coder.joints if name not in dataset.skeleton.names]
    if missing:
        raise StudioError(
            f"The recordings lack joints that {request.checkpoint} moves ({', '.join(missing)}). "
            "Give the folder that it was trained on with --recordings."
        )
    places = [dataset.skeleton.index(name) for name in coder.joints]
    judged_on = dataset.measured_on()
    joint, doubt = first_hand(dataset.skeleton, coder.joints, request.hand)
    file = request.phrase
    given = None if file is None else (_given_phrase(file, coder, dataset), f"made of {file.name}")
    with tempfile.TemporaryDirectory(dir=folder.parent) as networks:
        files = _export_both(coder, state["settings"]["network"], Path(networks))
        coders = {precision: OnnxCoder(file) for precision, file in files.items()}
        windows = sample_windows(judged_on, places)
        difference = _difference(coder, coders["fp32"], windows)
        _log.info(f"The network file computes what was trained (to {difference:.0e} after 10 iterations).")
        verdict = judge(coders["fp32"], coders["int8"], windows)
        _log.info(verdict.sentence())
        times = {precision: median_ms(one, windows[0]) for precision, one in coders.items()}
        files[verdict.precision].replace(folder / "puppet.onnx")
    evaluation = evaluate(coder, judged_on, fitting_hop(coder, judged_on))
    names = sorted(take.name for take in judged_on)
    report = write_up(coder, state, dataset, evaluation, names, verdict, difference, times)
    report[KEY] = reading_facts(request.source.catalogue)
    _log.info("Measuring whether the body answers a hand.")
    error = report["degrees"]["1"]["mean"]
    report["puppetry"] = own_answer(coder, dataset, folder / ANSWER, error, state["step"], console)
    packing.write_skeleton(folder, dataset.skeleton, _shown_pose(dataset))
    about = "what the show starts from; another: bunraku export --phrase FILE"
    if given is not None:
        phrase, about = given
        packing.write_phrase(folder, phrase)
    elif not (request.out / packing.PHRASE).exists():
        phrase, about, report["phrase"] = _own_phrase(dataset)
        packing.write_phrase(folder, phrase)
        _log.info(f"phrase.bvh is {about}. The bundle contains a recording. {_PHRASE_OF_ITS_OWN}")
        about = f"{about}. {_PHRASE_OF_ITS_OWN}"
    if not (request.out / packing.SHOW).exists():
        if doubt:
            _log.info(doubt)
        hand: dict[str, Any] = {"sensor": "left-wrist", "joint": joint}
        hanging = hanging_orientation(dataset.skeleton, hand["joint"])
        if hanging is not None:
            hand["at_neutral"] = hanging
        thanks, has_feet = request.source.catalogue.acknowledgement, bool(dataset.skeleton.feet)
        packing.write_show_yaml(folder, name, [hand], thanks, about, has_feet)
    elif request.name or request.hand:
        _log.info(f"{request.out / packing.SHOW} stays as it is: --name and --hand are for a new one.")
    write_report(folder / "report.json", report)
    shown = _longest_sound_take(judged_on)
    draw_report(folder / "report.png", name, report, evaluation, coder, shown)
    for name in (BODY_FILE, MESH_FILE):
        if (request.out / name).is_file():
            shutil.copyfile(request.out / name, folder / name)
    packing.write_surface(folder)
    return report


def put_in_place(made: Path, folder: Path) -> None:
    """The files of a show take the place of those in a folder; the others stay. Raises OSError.

    All at once: a copy of the folder with them is exchanged for it. Where that cannot be done they follow one
    another, the checksums last, and a first Ctrl-C waits: until then no box accepts the show.
    """
    whole = folder.with_name(f".{folder.name}.new")
    try:
        _copy_with(made, folder, whole)
        exchange(whole, folder)
    except OSError:
        with stop_signals():
            if not (made / ANSWER).exists():
                (folder / ANSWER).unlink(missing_ok=True)
            for file in made.iterdir():
                file.replace(folder / file.name)
            write_checksums(folder)
    finally:
        shutil.rmtree(whole, ignore_errors=True)


def _copy_with(made: Path, folder: Path, whole: Path) -> None:
    """Links to the files of both, and their checksums, on the disk. Raises OSError."""
    if Path.cwd().is_relative_to(folder) or folder.stat().st_uid != os.geteuid():
        raise OSError(errno.EBUSY, "the folder must stay the same one", str(folder))
    replaced = {file.name for file in made.iterdir()} | {ANSWER}

    def gone(inside: str, names: list[str]) -> list[str]:
        in_folder = inside == str(folder)
        return [name for name in names if in_folder and (name in replaced or name.startswith(_MADE))]

    shutil.rmtree(whole, ignore_errors=True)
    shutil.copytree(made, whole, copy_function=_link)
    shutil.copytree(folder, whole, symlinks=True, ignore=gone, copy_function=_link, dirs_exist_ok=True)
    write_checksums(whole)
    for name in replaced:
        if (whole / name).exists():
            sync(whole / name)
    sync(whole)


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:  # the file is another user's, or the disk has no links
        shutil.copy2(source, target)


def first_hand(skeleton: Skeleton, joints: Sequence[str], wanted: str | None = None) -> tuple[str, str]:
    """The joint that a new show gives to its sensor, and what is doubtful about it, in words ('': nothing).

    The wanted one; else the left upper arm by the names; else by the skeleton's shape. joints: those that the
    network moves. Raises StudioError where it does not move the wanted one.
    """
    if wanted is not None:
        if wanted not in joints:
            raise StudioError(f"No hand can hold '{wanted}': the network moves {', '.join(joints)}.")
        return wanted, ""
    called = {role: skeleton.names[joint] for role, joint in skeleton.roles.items()}
    named = next((called[role] for role in FIRST_HANDS if called.get(role) in joints), None)
    if named is not None:
        meant = called.get("left upper arm") == named
        why = f"The left upper arm does not move or has no known name: the first hand holds {named}."
        return named, "" if meant else f"{why} Another: --hand JOINT, or hands: in show.yaml."
    chosen = _arm_by_shape(skeleton, joints) or joints[-1]
    return chosen, (
        f"No joint has a name that is known for an arm (bunraku inspect lists them). The first hand holds "
        f"{chosen}, by the skeleton's shape. Another: --hand JOINT, or hands: in show.yaml."
    )


def _arm_by_shape(skeleton: Skeleton, joints: Sequence[str]) -> str | None:
    """The first long bone of the limb that begins highest, the left one where sides are known."""
    anatomy = Anatomy(skeleton)
    starts = []
    for _, first in anatomy.limbs():
        chain = anatomy.chain(first)
        joint = chain[anatomy.limb_start(chain)]
        if skeleton.names[joint] in joints:
            above = round(float(anatomy.positions[joint, 1]) / anatomy.height, 1)
            starts.append((above, float(anatomy.positions[joint] @ anatomy.across), skeleton.names[joint]))
    return max(starts)[2] if starts else None


def hanging_orientation(skeleton: Skeleton, joint: str) -> list[float] | None:
    """Local orientation (w, x, y, z) of an arm that hangs while the dancer stands still.

    None for what is not an upper arm, and for one that hangs in the rest pose: those stay as they are there.
    """
    place = skeleton.index(joint)
    if skeleton.stance is not None:
        return [round(float(part), 3) for part in skeleton.stance[place]]
    arms = [skeleton.roles[role] for role in UPPER_ARMS if role in skeleton.roles]
    if arms and place not in arms:
        return None
    bones = [
        offset for offset, parent in zip(skeleton.offsets, skeleton.parents, strict=True) if parent == place
    ]
    bone = max(bones, key=lambda offset: float(np.linalg.norm(offset)), default=np.array([0.0, -1.0, 0.0]))
    level = np.array([bone[0], 0.0, bone[2]])
    slope = float(np.degrees(np.arctan2(-bone[1], np.linalg.norm(level))))
    if not -LEVEL_DEGREES < slope < HANGING_DEGREES:
        return None
    lowered = np.radians(HANGING_DEGREES - slope)
    down = quaternion.from_axis_angle(np.cross(level, [0.0, -1.0, 0.0]), lowered)
    return [round(float(part), 3) for part in down]


def _shown_pose(dataset: Dataset) -> NDArray[np.float64]:
    """(J, 4): still joints as they are; where the zero pose is no figure, the others as in the stance."""
    pose, stance = dataset.still_pose(), dataset.skeleton.stance
    if stance is not None:
        pose[list(dataset.moving)] = stance[list(dataset.moving)]
    return pose


def _export_both(coder: TorchCoder, architecture: str, folder: Path) -> dict[str, Path]:
    files = {precision: folder / f"{precision}.onnx" for precision in ("fp32", "int8")}
    for precision, file in files.items():
        int8 = precision == "int8"
        export(coder.autoencoder, list(coder.joints), file, int8=int8, architecture=architecture)
    return files


def _difference(coder: TorchCoder, exported: OnnxCoder, windows: Poses) -> float:
    """Largest difference of a component after 10 iterations; raises StudioError above EQUALITY."""
    few = windows[np.linspace(0, len(windows) - 1, min(EQUALITY_WINDOWS, len(windows))).astype(int)]
    if not len(few):
        raise StudioError(
            "The recordings have no window of 8 sound poses on which the export could be checked."
        )
    trained, played = coder.iterate(few, 10)[0], exported.iterate(few, 10)[0]
    difference = float(np.abs(quaternion.aligned(played, trained) - trained).max())
    if not difference <= EQUALITY:
        raise StudioError(
            f"The exported network differs from the trained one by {difference:.1g} after 10 iterations "
            f"(limit: {EQUALITY:g}). No show was written. This is a bug in the export: report it."
        )
    return difference


def _given_phrase(file: Path, coder: MovedJoints, dataset: Dataset) -> Recording:
    """The phrase in a BVH file. Raises StudioError if its skeleton is not the recordings'."""
    trained = Remembered(dataset.catalogue.reading, dataset.skeleton)
    phrase = load_takes([file], coder, trained=trained)[0].recording
    if not phrase.skeleton.same_joints(dataset.skeleton):
        raise StudioError(
            f"{file} does not have the skeleton of the recordings. Give a phrase with the same skeleton."
        )
    return phrase


def _own_phrase(dataset: Dataset) -> tuple[Recording, str, dict[str, Any]]:
    """The phrase of a show that was given none, what it is in words, and for the report."""
    chosen = choose_phrase(dataset)
    if chosen is None:
        phrase, take = _excerpt(dataset)
        message = (
            f"{phrase.seconds:.0f} s of the recording {take}: none is long enough for a phrase that loops"
        )
        return phrase, message, {"recording": take}
    message = (
        f"{chosen.recording} from {chosen.from_s:.1f} to {chosen.to_s:.1f} s, the stretch of the recordings "
        "that loops best"
    )
    return chosen.phrase, message, chosen.as_json()


def _excerpt(dataset: Dataset) -> tuple[Recording, str]:
    """A phrase cut from a held-out take, or from any take if those are short; and the take's name."""
    for takes in (dataset.measured_on(), dataset.takes):
        take = _longest_sound_take(takes)
        phrase = longest_sound(take, PHRASE_S)
        if phrase.seconds >= SHORT_PHRASE_S:
            break
    return phrase, take.name


def _longest_sound_take(takes: Sequence[Take]) -> Take:
    """The take with the longest stretch without a capture error."""
    return max(takes, key=lambda take: len(longest_sound(take, PHRASE_S)))
