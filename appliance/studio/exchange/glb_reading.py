"""Binary glTF as a recording: the joints of its skins, and one of its animations at an even rate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.glb_file import GlbFile
from appliance.pose import quaternion
from appliance.pose.bvh import STRETCH_M
from appliance.pose.counted import counted
from appliance.pose.plain_names import changed_names, plain_names
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.exchange.figure_facts import MAX_VALUES, checked_recording, checked_skeleton

_DAMAGED = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, RecursionError)
_SHORTEST_ROTATION = 0.5  # length of a quaternion; a shorter one is a hole in the data
_PROP = 0.5  # fraction of the joints of the largest skeleton: a smaller one is not a second dancer
_SHOWN = 8
_WHOLE_RATE = 1e-5  # a rate this near to a whole number is that number: times are stored in single precision


class Choice(NamedTuple):
    """Which skin and which animation, by name or number; None: the whole figure, the longest animation."""

    skin: str | None = None
    animation: str | None = None


WHOLE = Choice()


def read_glb(path: Path, true_fps: float | None = None, choice: Choice = WHOLE) -> Recording:
    """The dance of all skins of one skeleton; nodes above the root joint move the root.

    true_fps: in place of the file's rate. Without a skin the animated nodes are the joints. The recording's
    notes say what was left out. Raises ExchangeError or OSError.
    """
    file = GlbFile(path)
    try:
        return _Scene(file, choice).recording(true_fps)
    except ExchangeError:
        raise
    except _DAMAGED as error:
        raise ExchangeError(path, f"The file is damaged or not as glTF 2 says ({error}).") from error


class _Track(NamedTuple):
    """An animation's track of one property of a node: at `times` (K,) `values` (K, C), and between.

    lost: keys that were no numbers.
    """

    times: Array
    values: Array
    interpolation: str
    lost: int


_Tracks = dict[tuple[int, str], _Track]


class _Scene:
    """The nodes of a file, their parents, and what the chosen animation does to the chosen joints."""

    def __init__(self, file: GlbFile, choice: Choice) -> None:
        self._file = file
        self._notes: list[str] = []
        self._nodes: list[dict[str, Any]] = [_with_parts(node) for node in file.document.get("nodes", [])]
        self._parent = [-1] * len(self._nodes)
        for number, node in enumerate(self._nodes):
            for child in node.get("children", []):
                self._parent[child] = number
        skins = file.document.get("skins", [])
        if choice.skin is not None and not skins:
            raise ExchangeError(file.path, "There is no skin in it: leave --skin out.")
        joints = self._skinned(skins, choice.skin) if skins else set()
        above = {node for joint in joints for node in self._chain(joint)}
        self._tracks = self._animation(above, choice.animation)
        self._notes += [
            f"{path} of '{self._nodes[node].get('name', node)}': {counted(track.lost, 'key')} of "
            f"{track.lost + len(track.times)} lost (no numbers), the joint moves evenly over them"
            for (node, path), track in self._tracks.items()
            if track.lost
        ]
        self._joints = self._ordered(joints or {node for node, _ in self._tracks}, bool(skins))

    def recording(self, true_fps: float | None) -> Recording:
        """The dance."""
        path, joints = self._file.path, self._joints
        times, fps = self._times()
        if len(times) * len(joints) * 4 > MAX_VALUES:
            raise ExchangeError(path, f"It holds more than {MAX_VALUES} numbers. Cut the recording.")
        rows = {joint: row for row, joint in enumerate(joints)}
        parents = [rows.get(self._parent[joint], -1) for joint in joints]
        given = [str(self._nodes[joint].get("name", f"joint{row}")) for row, joint in enumerate(joints)]
        names = plain_names(given)
        if changed := changed_names(given):
            self._notes.append(f"names changed: {changed}")
        poses, places, ends = self._figure(times, parents)
        skeleton = checked_skeleton(path, names, parents, places[0], ends)
        roots = places[:, 0].copy()
        places[:, 0] = 0.0
        stretches = bool(np.ptp(places, axis=0).max(initial=0.0) > STRETCH_M)
        moved = places if stretches else None
        return checked_recording(path, skeleton, poses, roots, true_fps or fps, moved, notes=self._notes)

    def _figure(
        self, times: Array, parents: Sequence[int]
    ) -> tuple[Array, Array, list[tuple[int, list[float]]]]:
        """Local rotations (N, J, 4), places (N, J, 3) from the parent in its frame, the root's in the room,
        and the ends of bones.

        Every joint is where all nodes above put it, whatever these scale or mirror; its own frame is its axes
        without their lengths, right-handed.
        """
        linear: dict[int, Array] = {}
        at: dict[int, Array] = {}
        for node in (*self._chain(self._joints[0])[:0:-1], *self._joints):
            own, place = self._axes(node, times), self._vector("translation", node, times)
            parent = self._parent[node]
            if parent in linear:
                own, place = linear[parent] @ own, at[parent] + (linear[parent] @ place[..., None])[..., 0]
            linear[node], at[node] = own, place
        if np.linalg.det(linear[self._joints[0]][0]) < 0:
            self._notes.append("a node above the joints mirrors the figure: its left side is on the right")
        frames = {joint: self._frame(joint, linear[joint]) for joint in self._joints}
        poses = np.empty((len(times), len(parents), 4))
        places = np.empty((len(times), len(parents), 3))
        ends = []
        for row, (joint, parent) in enumerate(zip(self._joints, parents, strict=True)):
            back = np.eye(3)[None] if parent < 0 else np.swapaxes(frames[self._joints[parent]], 1, 2)
            start = np.zeros((1, 3)) if parent < 0 else at[self._joints[parent]]
            poses[:, row] = quaternion.from_matrix(back @ frames[joint])
            places[:, row] = (back @ (at[joint] - start)[..., None])[..., 0]
            for child in filter(self._is_end, self._nodes[joint].get("children", [])):
                end = frames[joint][0].T @ linear[joint][0] @ self._vector("translation", child, times)[0]
                ends.append((row, end.tolist()))
        return poses, places, ends

    def _frame(self, joint: int, linear: Array) -> Array:
        """(N, 3, 3): a joint's axes without their lengths, at right angles, right-handed."""
        x, y = linear[..., 0], linear[..., 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            x = x / np.linalg.norm(x, axis=-1, keepdims=True)
            y = y - x * np.sum(x * y, axis=-1, keepdims=True)
            y = y / np.linalg.norm(y, axis=-1, keepdims=True)
        if not np.isfinite(y).all():
            name = self._nodes[joint].get("name", joint)
            raise ExchangeError(self._file.path, f"Joint '{name}' is scaled to nothing. Apply scales first.")
        return np.stack([x, y, np.cross(x, y)], axis=-1)

    def _is_end(self, node: int) -> bool:
        bare = not {"children", "mesh", "camera"} & set(self._nodes[node])
        return bare and node not in self._joints and (node, "rotation") not in self._tracks

    def _skinned(self, skins: Sequence[dict[str, Any]], wanted: str | None) -> set[int]:
        """The joints of the skin that is wanted; else of all skins whose joints hang from each other."""
        worn = {node["skin"]: node.get("name") for node in self._nodes if "skin" in node}
        names = [str(skin.get("name") or worn.get(number) or number) for number, skin in enumerate(skins)]
        if wanted is not None:
            meshes = {str(name).casefold(): number for number, name in worn.items() if name}
            number = meshes.get(wanted.casefold(), -1)
            return set(skins[self._named(wanted, names, "skin") if number < 0 else number]["joints"])
        figures: list[tuple[set[int], list[str]]] = []
        for name, skin in zip(names, skins, strict=True):
            joints, called = set(skin["joints"]), [name]
            for other in [one for one in figures if self._hang_together(one[0], joints)]:
                figures.remove(other)
                joints, called = joints | other[0], [*other[1], *called]
            figures.append((joints, called))
        figures.sort(key=lambda figure: -len(figure[0]))
        others = [f"{', '.join(called)} ({counted(len(joints), 'joint')})" for joints, called in figures]
        if len(figures) > 1 and len(figures[1][0]) >= _PROP * len(figures[0][0]):
            raise ExchangeError(
                self._file.path,
                f"{len(figures)} skeletons are in it, of the skins {'; '.join(others[:_SHOWN])}. Choose one: "
                f"--skin '{figures[0][1][-1]}'.",
            )
        if others[1:]:
            left_out = "; ".join(others[1 : _SHOWN + 1])
            self._notes.append(f"skin {others[0]} read, left out: {left_out} (otherwise: --skin NAME)")
        return figures[0][0]

    def _hang_together(self, some: set[int], others: set[int]) -> bool:
        return any(
            not below.isdisjoint(self._chain(joint))
            for above, below in ((some, others), (others, some))
            for joint in above
        )

    def _named(self, wanted: str, names: Sequence[str], what: str) -> int:
        """The number of the thing of this name, else of this number. Raises ExchangeError."""
        folded = [name.casefold() for name in names]
        if wanted.casefold() in folded:
            return folded.index(wanted.casefold())
        if wanted.isdecimal() and int(wanted) < len(names):
            return int(wanted)
        known = ", ".join(f"'{name}'" for name in names[:_SHOWN])
        raise ExchangeError(self._file.path, f"It has no {what} '{wanted}'. It has: {known}.")

    def _animation(self, nodes: set[int], wanted: str | None) -> _Tracks:
        """The tracks of the animation that is wanted, else of the longest that moves one of these nodes.

        No nodes: any will do.
        """
        animations = self._file.document.get("animations", [])
        if not animations:
            raise ExchangeError(self._file.path, "There is no animation in it: export the dance with it.")
        names = [str(one.get("name") or number) for number, one in enumerate(animations)]
        if wanted is not None:
            return self._read_tracks(animations[self._named(wanted, names, "animation")])
        found: list[tuple[float, int, _Tracks]] = []
        damage: Exception | None = None
        for number, animation in enumerate(animations):
            try:
                tracks = self._read_tracks(animation)
            except _DAMAGED as error:
                damage = damage or error
                continue
            moving = [track.times for (node, _), track in tracks.items() if not nodes or node in nodes]
            if moving:
                seconds = max(float(t[-1]) for t in moving) - min(float(t[0]) for t in moving)
                found.append((seconds, number, tracks))
        if not found:
            if damage is not None:
                raise damage
            raise ExchangeError(self._file.path, "The animation does not move the figure.")
        seconds, chosen, tracks = max(found, key=lambda one: (one[0], len(one[2]), -one[1]))
        if len(animations) > 1:
            lengths = {number: f" ({length:.1f} s)" for length, number, _ in found}
            others = [f"'{n}'{lengths.get(k, '')}" for k, n in enumerate(names) if k != chosen]
            more = f" and {len(others) - _SHOWN} more" if len(others) > _SHOWN else ""
            self._notes.append(
                f"animation '{names[chosen]}' ({seconds:.1f} s) read, left out: {', '.join(others[:_SHOWN])}"
                f"{more} (otherwise: --animation NAME)"
            )
        return tracks

    def _read_tracks(self, animation: dict[str, Any]) -> _Tracks:
        tracks: _Tracks = {}
        for channel in animation["channels"]:
            target, sampler = channel["target"], animation["samplers"][channel["sampler"]]
            if "node" not in target or target["path"] not in ("rotation", "translation", "scale"):
                continue
            kind = sampler.get("interpolation", "LINEAR")
            times, values = self._file.array(sampler["input"]), self._file.array(sampler["output"])
            if kind == "CUBICSPLINE":  # in-tangent, value, out-tangent: the values, at the rate of the keys
                values = values.reshape(len(times), 3, -1)[:, 1]
            if len(values) != len(times) or (np.diff(times) <= 0).any():
                raise ValueError("the times of an animation do not rise or do not fit its values")
            sound = np.isfinite(times) & np.isfinite(values).all(axis=1)
            if target["path"] == "rotation":
                sound &= np.linalg.norm(values, axis=1) > _SHORTEST_ROTATION
            if not sound.any():
                raise ValueError(f"no key of an animation's {target['path']} is a number")
            lost = int(np.count_nonzero(~sound))
            tracks[target["node"], target["path"]] = _Track(times[sound], values[sound], kind, lost)
        return tracks

    def _ordered(self, chosen: set[int], skinned: bool) -> list[int]:
        """The joints, each parent before its children; all hang below the first one.

        A node between two joints is one too, and so is the node that carries several root bones of a skin.
        """
        for joint in tuple(chosen):
            above = self._chain(joint)
            highest = max((place for place, node in enumerate(above) if node in chosen), default=0)
            chosen.update(above[: highest + 1])
        tops = [joint for joint in sorted(chosen) if self._parent[joint] not in chosen]
        chains = [self._chain(top) for top in tops]
        shared = [node for node in chains[0] if skinned and all(node in chain for chain in chains)]
        for chain in chains if shared else ():
            chosen.update(chain[: chain.index(shared[0]) + 1])
        tops = shared[:1] or sorted(tops, key=lambda top: -len(self._below(top, chosen)))
        sizes = [len(self._below(top, chosen)) for top in tops]
        named = [
            f"'{self._nodes[top].get('name', top)}' ({counted(n, 'joint')})"
            for top, n in zip(tops, sizes, strict=True)
        ]
        if len(tops) > 1 and sizes[1] >= _PROP * sizes[0]:
            raise ExchangeError(
                self._file.path, f"{len(tops)} skeletons are in it: {', '.join(named[:_SHOWN])}. Export one."
            )
        if named[1:]:
            self._notes.append(f"{named[0]} read, left out: {', '.join(named[1 : _SHOWN + 1])}")
        ordered = self._below(tops[0], chosen)
        by_number = sorted(ordered)
        parents_first = all(self._parent[j] < j for j in by_number[1:]) and by_number[0] == tops[0]
        return by_number if parents_first else ordered

    def _below(self, top: int, chosen: set[int]) -> list[int]:
        """A node and those of the chosen ones below it, level by level."""
        ordered = [top]
        for joint in ordered:
            ordered += [child for child in self._nodes[joint].get("children", []) if child in chosen]
        return ordered

    def _chain(self, node: int) -> list[int]:
        """A node and those above it. Raises ValueError where they form a ring."""
        chain = [node]
        while (node := self._parent[node]) >= 0:
            if node in chain:
                raise ValueError("nodes are their own parents")
            chain.append(node)
        return chain

    def _times(self) -> tuple[Array, float]:
        """Even times at the rate of the densest track, and that rate."""
        moving = {*self._joints, *self._chain(self._joints[0])}
        tracks = [track for (node, _), track in self._tracks.items() if node in moving]
        if not tracks:
            raise ExchangeError(self._file.path, "The animation does not move the figure.")
        densest = max(tracks, key=lambda track: len(track.times)).times
        first, last = min(t.times[0] for t in tracks), max(t.times[-1] for t in tracks)
        if len(densest) < 2 or last <= first:
            return np.array([first]), 50.0
        # evenly sampled: the mean is exact; keys at irregular times: the shortest usual step
        steps = np.diff(densest)
        even = np.ptp(steps) < 0.01 * steps.mean()
        fps = float(1.0 / (steps.mean() if even else np.median(steps)))
        fps = float(round(fps)) if abs(fps - round(fps)) < _WHOLE_RATE * fps else fps
        if (last - first) * fps > MAX_VALUES:
            raise ValueError("an animation that never ends")
        return first + np.arange(round((last - first) * fps) + 1) / fps, fps

    def _vector(self, path: str, node: int, times: Array) -> Array:
        """translation or scale: (N, 3), of one frame where it does not change."""
        track = self._tracks.get((node, path))
        if track is None:
            still = self._nodes[node].get(path, (1, 1, 1) if path == "scale" else (0, 0, 0))
            return np.array(still, dtype=np.float64).reshape(1, 3)
        before, share = _between(track, times)
        after = np.minimum(before + 1, len(track.times) - 1)
        mixed: Array = track.values[before] + share[:, None] * (track.values[after] - track.values[before])
        return mixed

    def _axes(self, node: int, times: Array) -> Array:
        """(N, 3, 3): where a node's own axes point and how long they are; of one frame where it is still."""
        track = self._tracks.get((node, "rotation"))
        if track is None:
            still = np.array(self._nodes[node].get("rotation", (0, 0, 0, 1)), dtype=np.float64)
            turn: Array = np.roll(still, 1).reshape(1, 4)
        else:
            values = quaternion.normalize(np.roll(track.values, 1, axis=-1))
            before, share = _between(track, times)
            turn = quaternion.slerp(values[before], values[np.minimum(before + 1, len(values) - 1)], share)
        axes: Array = quaternion.to_matrix(quaternion.normalize(turn))
        return axes * self._vector("scale", node, times)[:, None, :]


def _with_parts(node: dict[str, Any]) -> dict[str, Any]:
    """A node with translation, rotation and scale in place of a matrix (glTF 2.0, 3.5.2)."""
    if "matrix" not in node:
        return node
    matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T  # it is written column by column
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    if np.linalg.det(matrix[:3, :3]) < 0:
        scale[0] = -scale[0]  # a mirror
    turn = quaternion.from_matrix(matrix[:3, :3] / np.where(scale, scale, 1.0))
    return node | {"translation": matrix[:3, 3], "rotation": np.roll(turn, -1), "scale": scale}


def _between(track: _Track, times: Array) -> tuple[NDArray[np.intp], Array]:
    """The key before each time, and the share of the way to the next one."""
    before = np.clip(np.searchsorted(track.times, times + 1e-6, side="right") - 1, 0, len(track.times) - 1)
    after = np.minimum(before + 1, len(track.times) - 1)
    span = track.times[after] - track.times[before]
    share = np.clip((times - track.times[before]) / np.where(span > 0, span, 1.0), 0.0, 1.0)
    share = np.where(share < 1e-3, 0.0, share)  # times in single precision: a key is a key
    return before, np.zeros_like(share) if track.interpolation == "STEP" else share
