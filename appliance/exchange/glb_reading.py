"""Binary glTF as a recording: the joints of its skin, and its first animation at an even rate."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from appliance.exchange.exchange_error import ExchangeError
from appliance.exchange.figure_facts import MAX_VALUES, checked_recording, checked_skeleton
from appliance.exchange.glb_file import GlbFile
from appliance.pose import quaternion
from appliance.pose.bvh import STRETCH_M
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording

_DAMAGED = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, RecursionError)
_STILL_SCALE = 1e-3  # a joint that is scaled by less is not scaled
_WHOLE_RATE = 1e-5  # a rate this near to a whole number is that number: times are stored in single precision


def read_glb(path: Path) -> Recording:
    """The dance of the first skin in the first animation; nodes above the root joint move the root.

    Without a skin the animated nodes are the joints. Raises ExchangeError or OSError.
    """
    file = GlbFile(path)
    try:
        return _Scene(file).recording()
    except ExchangeError:
        raise
    except _DAMAGED as error:
        raise ExchangeError(path, f"The file is damaged or not as glTF 2 says ({error}).") from error


class _Track(NamedTuple):
    """What an animation says of one property of a node: at `times` (K,) `values` (K, C), and between."""

    times: Array
    values: Array
    interpolation: str


class _Scene:
    """The nodes of a file, their parents, and what the animation does to them."""

    def __init__(self, file: GlbFile) -> None:
        self._file = file
        self._nodes: list[dict[str, Any]] = file.document.get("nodes", [])
        self._parent = [-1] * len(self._nodes)
        for number, node in enumerate(self._nodes):
            for child in node.get("children", []):
                self._parent[child] = number
        self._tracks = self._read_tracks()
        self._joints = self._find_joints()

    def recording(self) -> Recording:
        """The dance."""
        path, joints = self._file.path, self._joints
        times, fps = self._times()
        if len(times) * len(joints) * 4 > MAX_VALUES:
            raise ExchangeError(path, f"It holds more than {MAX_VALUES} numbers. Cut the recording.")
        rows = {joint: row for row, joint in enumerate(joints)}
        parents = [rows.get(self._parent[joint], -1) for joint in joints]
        names = [str(self._nodes[joint].get("name", f"joint{row}")) for row, joint in enumerate(joints)]
        poses = np.stack([self._rotation(joint, times) for joint in joints], axis=1)
        places = np.stack([self._vector("translation", joint, times) for joint in joints], axis=1)
        scale = self._carry(poses, places, times)
        offsets = scale * places[0]
        ends = [
            (rows[joint], (scale * np.array(self._nodes[child].get("translation", (0, 0, 0)))).tolist())
            for joint in joints
            for child in self._nodes[joint].get("children", [])
            if self._is_end(child)
        ]
        skeleton = checked_skeleton(path, names, parents, offsets, ends)
        moving = scale * places
        moving[:, 0] = 0.0
        stretches = bool(np.ptp(moving, axis=0).max(initial=0.0) > STRETCH_M)
        return checked_recording(path, skeleton, poses, places[:, 0], fps, moving if stretches else None)

    def _is_end(self, node: int) -> bool:
        bare = not {"children", "mesh", "camera"} & set(self._nodes[node])
        return bare and node not in self._joints and (node, "rotation") not in self._tracks

    def _read_tracks(self) -> dict[tuple[int, str], _Track]:
        animations = self._file.document.get("animations", [])
        if not animations:
            raise ExchangeError(self._file.path, "There is no animation in it: export the dance with it.")
        tracks: dict[tuple[int, str], _Track] = {}
        for channel in animations[0]["channels"]:
            target, sampler = channel["target"], animations[0]["samplers"][channel["sampler"]]
            if "node" not in target or target["path"] not in ("rotation", "translation", "scale"):
                continue
            kind = sampler.get("interpolation", "LINEAR")
            times, values = self._file.array(sampler["input"]), self._file.array(sampler["output"])
            if kind == "CUBICSPLINE":  # in-tangent, value, out-tangent: the values, at the rate of the keys
                values = values.reshape(len(times), 3, -1)[:, 1]
            if len(values) != len(times) or (np.diff(times) <= 0).any():
                raise ValueError("the times of an animation do not rise or do not fit its values")
            tracks[target["node"], target["path"]] = _Track(times, values, kind)
        return tracks

    def _find_joints(self) -> list[int]:
        """The joints, each parent before its children; all hang below the first one."""
        skins = self._file.document.get("skins", [])
        chosen = set(skins[0]["joints"] if skins else [node for node, _ in self._tracks])
        for joint in tuple(chosen):  # a node between two joints is one too
            above = self._chain(joint)
            highest = max((place for place, node in enumerate(above) if node in chosen), default=0)
            chosen.update(above[: highest + 1])
        tops = [joint for joint in sorted(chosen) if self._parent[joint] not in chosen]
        if len(tops) != 1:
            raise ExchangeError(
                self._file.path, f"{len(tops)} skeletons are in it; one is needed. Export one figure alone."
            )
        ordered = [tops[0]]
        for joint in ordered:
            ordered += [child for child in self._nodes[joint].get("children", []) if child in chosen]
        by_number = sorted(ordered)
        parents_first = all(self._parent[j] < j for j in by_number[1:]) and by_number[0] == tops[0]
        return by_number if parents_first else ordered

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
        tracks = [track for (node, _), track in self._tracks.items() if node in self._joints]
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
        """translation or scale (N, 3)."""
        still = self._nodes[node].get(path, (1, 1, 1) if path == "scale" else (0, 0, 0))
        track = self._tracks.get((node, path))
        if track is None:
            if "matrix" in self._nodes[node]:
                raise ValueError("a node has a matrix; export with translation and rotation")
            return np.tile(np.array(still, dtype=np.float64), (len(times), 1))
        before, share = _between(track, times)
        after = np.minimum(before + 1, len(track.times) - 1)
        mixed: Array = track.values[before] + share[:, None] * (track.values[after] - track.values[before])
        return mixed

    def _rotation(self, node: int, times: Array) -> Array:
        """(N, 4), w first."""
        track = self._tracks.get((node, "rotation"))
        if track is None:
            still = np.roll(np.array(self._nodes[node].get("rotation", (0, 0, 0, 1)), dtype=np.float64), 1)
            return np.tile(still, (len(times), 1))
        values = np.roll(track.values, 1, axis=-1)
        before, share = _between(track, times)
        after = np.minimum(before + 1, len(track.times) - 1)
        return quaternion.slerp(
            quaternion.normalize(values[before]), quaternion.normalize(values[after]), share
        )

    def _carry(self, poses: Array, places: Array, times: Array) -> float:
        """Turn and move the root (in place) as the nodes above it do; how much these scale the figure."""
        for joint in self._joints:
            if np.abs(self._vector("scale", joint, times) - 1.0).max() > _STILL_SCALE:
                name = self._nodes[joint].get("name", joint)
                raise ExchangeError(
                    self._file.path, f"Joint '{name}' is scaled. Apply scales before the export."
                )
        whole = 1.0
        for node in self._chain(self._joints[0])[1:]:
            scales = self._vector("scale", node, times)
            factor = float(scales[0, 0])
            if np.abs(scales - factor).max() > _STILL_SCALE * abs(factor) or factor <= 0:
                raise ExchangeError(self._file.path, "The figure is scaled unevenly. Apply scales first.")
            turn = self._rotation(node, times)
            poses[:, 0] = quaternion.multiply(turn, poses[:, 0])
            moved = quaternion.rotate(turn, factor * places[:, 0])
            places[:, 0] = moved + self._vector("translation", node, times)
            whole *= factor
        return whole


def _between(track: _Track, times: Array) -> tuple[NDArray[np.intp], Array]:
    """The key before each time, and the share of the way to the next one."""
    before = np.clip(np.searchsorted(track.times, times + 1e-6, side="right") - 1, 0, len(track.times) - 1)
    after = np.minimum(before + 1, len(track.times) - 1)
    span = track.times[after] - track.times[before]
    share = np.clip((times - track.times[before]) / np.where(span > 0, span, 1.0), 0.0, 1.0)
    share = np.where(share < 1e-3, 0.0, share)  # times in single precision: a key is a key
    return before, np.zeros_like(share) if track.interpolation == "STEP" else share
