"""Resumption: the stage writes a checkpoint after each frame, and a restarted stage goes on from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from appliance.box.checkpoint import (
    FILE,
    Checkpoint,
    CheckpointReader,
    CheckpointWriter,
    boot_id,
    read_checkpoints,
)
from appliance.show.box import Resume
from appliance.stage.reconcile import Reconciler
from appliance.stage.stage_parts import StageParts

_BEGINS = (
    "The place where the dance stood is damaged, or holds numbers that no stage has: it was dropped, and the "
    "show begins at the beginning. Export its journal for us."
)
TRIES = 5  # starts from one place without a frame: then it is the place that is wrong


class Resumption:
    """Reads the last checkpoint and writes the next ones: some microseconds a tick, and never to a disk.

    restarts, power_cuts: how often this show went on after one; went_on: whether it does so in this start;
    complaint: why no checkpoint is written, else "". dropped: a place held numbers that no stage has.
    """

    def __init__(self, show: str, runtime: Path, state: Path | None, wanted: Resume) -> None:
        """runtime: the folder of the box's processes; state: the one on the disk, if there is one."""
        self._show, self._boot = show, boot_id()
        self.complaint = ""
        self.went_on = False
        self._found, self._after_power_cut, self.dropped = _found(runtime, state, wanted, self._boot)
        self.restarts = self._found.restarts if self._found else 0
        self.power_cuts = self._found.power_cuts if self._found else 0
        self._now: Checkpoint | None = None
        self._writer: CheckpointWriter | None = None
        try:
            self._writer = CheckpointWriter(runtime)
        except OSError as error:
            self.complaint = (
                f"{runtime}: the place of the dance cannot be kept there ({error.strerror}). The dance goes "
                "on; after a crash it begins at the beginning. Free memory there, or give another folder as "
                "`runtime:` in the box file."
            )

    @property
    def comes_back(self) -> bool:
        """Whether a stage danced here since the machine was switched on, and was not ended."""
        return self._found is not None and not self._after_power_cut

    def go_on(self, reconciler: Reconciler, now: float) -> str:
        """Before the first tick: put the dance where the show was. A sentence about it, or ""."""
        place = self._found
        if place is None:
            return _BEGINS if self.dropped else ""
        if self._after_power_cut:
            self.power_cuts += 1
        else:
            self.restarts += 1
        why = "After a power cut" if self._after_power_cut else "After a restart of the stage"
        if place.tries >= TRIES:
            return (
                f"{why}: {place.tries} starts at {_where(place, reconciler.parts)} "
                "ended without a frame. The show begins at the beginning. Export its journal for us."
            )
        try:
            message = self._take(place, reconciler, now)
        except ValueError as error:
            return f"{why}: the show begins at the beginning. {error}"
        self.went_on = True
        where = f" in the cue '{place.cue}'" if place.cue else ""
        where += f" at {_where(place, reconciler.parts)}"
        return f"{why} the show goes on{where}. {message}".rstrip()

    def write_start(self, reconciler: Reconciler) -> None:
        """Right before the first tick: count this start."""
        tries = min(self._found.tries + 1, TRIES) if self._found and self._found.tries < TRIES else 1
        self._write(replace(self._place(reconciler, -1), tries=tries))

    def write_checkpoint(self, reconciler: Reconciler, tick: int) -> None:
        """The frame of this tick has left, and the dance has moved on: the next frame begins here."""
        if self._writer is not None:
            self._write(self._place(reconciler, tick))

    def write_end(self) -> None:
        """The show was ended: the next one begins at the beginning."""
        if self._now is not None:
            self._write(replace(self._now, ended=True))

    def close(self) -> None:
        """Let go of the file; the place stays in it."""
        if self._writer is not None:
            self._writer.close()

    def _take(self, place: Checkpoint, reconciler: Reconciler, now: float) -> str:
        """Raises ValueError where this show has no such place."""
        if place.show != self._show:
            raise ValueError(f"Before, the show was '{place.show}'.")
        parts = reconciler.parts
        # A power cut took the show state, so nothing would start a phrase that stood.
        rate = place.rate or (reconciler.rate if self._after_power_cut else 0.0)
        now_rate = 0.0 if reconciler.stands(now) else rate
        made = reconciler.danced_before(*(one.made for one in place.puppets))
        messages = [
            one.go_on(noted, now_rate, material)
            for one, noted, material in zip(parts.puppets, place.puppets, made, strict=False)
        ]
        reconciler.cue, reconciler.rate = place.cue, rate
        reconciler.generation = 0 if self._after_power_cut else place.applied
        if self._after_power_cut and place.source:
            reconciler.source = place.source
        reconciler.motion = place.motion
        level, seed, begins_at = place.liveliness
        parts.liveliness.go_on(level, seed, begins_at + place.tick + 1)
        return " ".join(filter(None, messages))

    def _place(self, reconciler: Reconciler, tick: int) -> Checkpoint:
        liveliness = reconciler.parts.liveliness
        return Checkpoint(
            self._show,
            tuple([puppet.noted for puppet in reconciler.parts.puppets]),
            reconciler.rate,
            reconciler.cue,
            self._boot,
            tick,
            self.restarts,
            self.power_cuts,
            applied=reconciler.generation,
            source=reconciler.wanted,
            motion=reconciler.motion,
            liveliness=(liveliness.asked, liveliness.seed, liveliness.begins_at),
        )

    def _write(self, place: Checkpoint) -> None:
        self._now = place
        if self._writer is None:
            return
        try:
            self._writer.write(place)
        except ValueError as error:  # names of several thousand characters
            self._writer, self.complaint = None, f"The place of the dance is not kept: {error}"


def _where(place: Checkpoint, parts: StageParts) -> str:
    is_led = [puppet is parts.led for puppet in parts.puppets]
    one = place.puppets[is_led.index(True)] if len(place.puppets) == len(is_led) else place.puppets[-1]
    return f"{one.position_s:.1f} s of the phrase '{one.phrase}'"


def _found(
    runtime: Path, state: Path | None, wanted: Resume, boot: str
) -> tuple[Checkpoint | None, bool, bool]:
    """The checkpoint to continue from, if any; whether the machine was restarted since; whether one was
    dropped because no stage could be there.
    """
    if wanted == "never":
        return None, False, False
    reader = CheckpointReader(runtime)
    place, dropped = reader.read(), reader.dropped
    reader.close()
    if place is None and state is not None:
        places, was_dropped = read_checkpoints(state / FILE)
        place, dropped = next(iter(places), None), dropped or was_dropped
    if place is None or place.ended:
        return None, False, dropped
    power_cut = place.boot != boot
    return (None, False, dropped) if power_cut and wanted == "after_crash" else (place, power_cut, dropped)
