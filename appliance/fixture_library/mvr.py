"""A rig in MVR (DIN SPEC 15801) as the fixtures of a show and their profiles."""

from __future__ import annotations

import io
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO, Literal
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from appliance.fixture_library import gdtf
from appliance.fixture_library.foreign_archive import LARGEST_XML, archive_of, member, xml_of
from appliance.fixture_library.gdtf_file import FAULTS, MISSING
from appliance.fixture_library.open_fixture_library import LibraryError
from appliance.show.venue_lights import MAX_FIXTURES

Array = NDArray[np.float64]
Placed = tuple[Array, Array]  # rotation (3, 3) and origin (3,), from an object's axes into those of the rig

UNMOVED: Placed = (np.eye(3), np.zeros(3))
_STAGE_FROM_RIG = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
# A fixture is drawn hanging, seen from the audience (DIN SPEC 15800): its base is up, its beam down (-z). A
# head's own axes have y from its base along the beam, and z where it tilts: about x, from -z to y.
_DRAWN_FROM_OWN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_UPSIDE_DOWN = np.diag([-1.0, -1.0, 1.0])

_SCENE = "GeneralSceneDescription.xml"
_LARGEST_GDTF = 64_000_000
_MOST_WORK = 1_000_000  # elements; pymvr 1.0.7 reads the list inside these twice, at each level
_READ_TWICE = ("SceneObject", "Truss", "Support", "VideoScreen", "Projector")
_CONTAINERS = ("group_objects", "scene_objects", "trusses", "supports", "video_screens", "projectors")
_LONGEST_NAME = 64

Profiles = dict[str, dict[str, Any]]  # values by the name of the profile's file


def rig_of(stream: BinaryIO) -> tuple[list[dict[str, Any]], Profiles, list[str]]:
    """Fixtures as a show lists them, their profiles, and sentences about what was left out.

    Raises LibraryError.
    """
    with archive_of(stream) as archive:
        rig = _Rig(archive)
        for layer in _scene(archive).layers:
            for fixture, where in _below(layer, UNMOVED, rig.notes):
                rig.add(fixture, where)
    if not rig.fixtures:
        raise LibraryError(" ".join(["The rig has no fixture that a show can light.", *rig.notes[:3]]))
    return rig.fixtures, rig.profiles, list(dict.fromkeys(rig.notes))


class _Rig:
    def __init__(self, archive: zipfile.ZipFile) -> None:
        self.fixtures: list[dict[str, Any]] = []
        self.profiles: Profiles = {}
        self.notes: list[str] = []
        self._archive = archive
        self._names: Counter[str] = Counter()
        self._profile_names: dict[tuple[str, str], str | None] = {}

    def add(self, fixture: Any, where: Placed) -> None:
        """Patch one fixture, or note why it is left out."""
        name = self._free_name(str(fixture.name or "").strip() or "fixture")
        addresses = sorted(fixture.addresses.addresses, key=lambda one: int(one.dmx_break))
        if not addresses:
            self._leave_out(name, "has no address")
            return
        if len(self.fixtures) == MAX_FIXTURES:
            self._leave_out(name, f"is more than the {MAX_FIXTURES} of a show")
            return
        profile = self._profile(str(fixture.gdtf_spec or ""), str(fixture.gdtf_mode or ""))
        if profile is None:
            self._leave_out(name, "has no profile")
            return
        if len(addresses) > 1:
            self.notes.append(f"'{name}' has several addresses; a show's fixture has the first one only.")
        place, pose, turn = on_stage(where)
        entry: dict[str, Any] = {
            "name": name,
            "profile": profile,
            "mode": self.profiles[profile]["modes"][0]["name"],
            "universe": int(addresses[0].universe),
            "address": int(addresses[0].address),
            "place": list(place),
            "pose": pose,
            "turn": list(turn),
        }
        for key in ("pan", "tilt"):
            if getattr(fixture, f"dmx_invert_{key}"):
                entry[f"invert_{key}"] = True
        self.fixtures.append(entry)

    def _leave_out(self, name: str, why: str) -> None:
        self.notes.append(f"'{name}' {why}: it is left out.")

    def _free_name(self, name: str) -> str:
        """The fixture's name, numbered from the second of that name on."""
        name = name[: _LONGEST_NAME - 5].strip()
        self._names[name] += 1
        while self._names[name] > 1:
            numbered = f"{name} {self._names[name]}"
            if numbered not in self._names:
                self._names[numbered] = 1
                return numbered
            self._names[name] += 1
        return name

    def _profile(self, spec: str, mode: str) -> str | None:
        """The name of the profile of a GDTF file in one mode; converted when it is first asked for."""
        if (spec, mode) not in self._profile_names:
            try:
                self._profile_names[spec, mode] = self._converted(spec, mode)
            except LibraryError as error:
                self.notes.append(f"{spec or 'A fixture'}: {error}")
                self._profile_names[spec, mode] = None
        return self._profile_names[spec, mode]

    def _converted(self, spec: str, mode: str) -> str:
        # pymvr decodes the name as code page 437, as zipfile does where a name is not marked as UTF-8
        spelt = (spec, spec.encode("cp437", "replace").decode("utf-8", "replace"))
        found = next((name for name in spelt if name in self._archive.namelist()), None)
        if found is None:
            raise LibraryError(f"The archive has no GDTF file '{spec[:60]}'.")
        data = member(self._archive, found, _LARGEST_GDTF)
        values, notes = gdtf.profile_values(io.BytesIO(data), mode)
        self.notes += [f"{values['name']}: {note}" for note in notes]
        name = re.sub(r"[^a-z0-9]+", "-", f"{values['name']} {mode}".casefold()).strip("-")[:80] or "fixture"
        while name in self.profiles:
            name += "-2"
        self.profiles[name] = values
        return name


def _scene(archive: zipfile.ZipFile) -> Any:
    """The scene as `pymvr` reads it, from an archive that holds nothing else."""
    try:
        import pymvr
    except ImportError:
        raise LibraryError(MISSING) from None
    try:
        root = xml_of(member(archive, _SCENE, LARGEST_XML), _SCENE)
    except KeyError:
        raise LibraryError(f"The archive has no '{_SCENE}': it is not an MVR file.") from None
    if _work(root) > _MOST_WORK:
        raise LibraryError("The rig is nested too deeply. It is not read.")
    alone = io.BytesIO()
    with zipfile.ZipFile(alone, "w") as rewritten:
        rewritten.writestr(_SCENE, ElementTree.tostring(root))
    try:
        with pymvr.GeneralSceneDescription(alone) as description:
            return description.scene
    except FAULTS as error:
        raise LibraryError(
            f"This is not a rig in MVR ({type(error).__name__}: {str(error)[:100]}). Export it again."
        ) from error


def _work(element: ElementTree.Element) -> int:
    """How many elements `pymvr` visits."""
    inner = sum(map(_work, element))
    return min(1 + inner * (2 if element.tag in _READ_TWICE else 1), _MOST_WORK + 1)


def _below(parent: Any, outer: Placed, notes: list[str]) -> Iterator[tuple[Any, Placed]]:
    """Fixtures in an object, with their places in the rig; a faulty matrix leaves out what is below it."""
    try:
        where = placed(outer, parent.matrix.matrix)
    except (ValueError, TypeError) as error:
        if type(parent).__name__ == "Fixture" or parent.child_list is not None:
            notes.append(f"'{parent.name or type(parent).__name__}' is left out: {error}.")
        return
    if type(parent).__name__ == "Fixture":
        yield parent, where
    children = parent.child_list
    if children is not None:
        for kind in ("fixtures", *_CONTAINERS):
            for child in getattr(children, kind):
                yield from _below(child, where, notes)


def placed(outer: Placed, rows: Sequence[Sequence[float]]) -> Placed:
    """An object inside another one, by its matrix in MVR: rows u, v, w (its axes) and o (its origin).

    Raises ValueError for a matrix that is not a rotation, scaled or not.
    """
    numbers = np.array([list(row)[:3] for row in rows], float)
    axes = numbers[:3].T
    lengths = np.linalg.norm(axes, axis=0)
    if numbers.shape != (4, 3) or not np.isfinite(numbers).all() or lengths.min() < 1e-6:
        raise ValueError("its matrix has no direction")
    rotation = axes / lengths
    if np.abs(rotation.T @ rotation - np.eye(3)).max() > 1e-2 or np.linalg.det(rotation) < 0.0:
        raise ValueError("its matrix is skewed or mirrored")
    return outer[0] @ rotation, outer[0] @ numbers[3] + outer[1]


def on_stage(
    where: Placed,
) -> tuple[tuple[float, ...], Literal["hanging", "standing"], tuple[float, ...]]:
    """Place in metres, pose, and turn (yaw, pitch, roll in degrees) as a show writes them."""
    rotation = _STAGE_FROM_RIG @ where[0] @ _DRAWN_FROM_OWN
    is_standing = bool(rotation[1, 1] > 0.0)
    turned = rotation if is_standing else rotation @ _UPSIDE_DOWN
    pitch = np.arcsin(np.clip(-turned[1, 2], -1.0, 1.0))
    if np.cos(pitch) > 1e-6:
        yaw, roll = np.arctan2(turned[0, 2], turned[2, 2]), np.arctan2(turned[1, 0], turned[1, 1])
    else:
        yaw, roll = np.arctan2(-turned[2, 0], turned[0, 0]), 0.0
    place = tuple(round(float(part), 3) + 0.0 for part in _STAGE_FROM_RIG @ where[1] / 1000.0)
    turn = tuple(round(float(angle), 2) + 0.0 for angle in np.degrees([yaw, pitch, roll]))
    return place, "standing" if is_standing else "hanging", turn
