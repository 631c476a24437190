"""Continuation: a figure goes on from what it has just danced, by choosing among its own moves.

Every 0.32 s it draws moves from the show's improviser, or from its partner network, and dances one that
suits: that answers another dancer, leads to a place, or any. So it always dances as these do, and the choice
says what about. The work of a choice is spread over three ticks.
"""

from __future__ import annotations

import math

import numpy as np

from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.improvising import BEFORE, MOVE, drawn, parts_of
from appliance.dancer.material.partner_network import LED_STEPS, SEEN, PartnerNetwork
from appliance.dancer.material.steps import HOP, MIDDLE, ROOT, WINDOW
from appliance.dancer.slerp import FloatArray, Slerp
from appliance.dancer.step_memory import StepMemory
from appliance.dancer.takeover import Takeover
from appliance.pose import quaternion
from appliance.pose.quaternion import Array

CANDIDATES = 24
DANCED = 4  # steps of a move that are danced before the next choice
FIRST = 6  # danced of the first move: some have passed until it is made
ANSWERING = 5.0  # how much an answer counts at most, a deviation among the candidates
NATURAL = 1.0  # how much it counts that a move is the dancer's; 1: drawn anew by how likely it is
WHERE = 4.0  # how much a metre nearer to the goal counts
ROAM_M = 1.2  # how far from where it began it goes without a goal
TEMPERATURE, TOP_P, FREE = 1.0, 0.95, 0.5
_ROWS = 40
_HOME = 0.001  # metres a tick, by which it comes back to the phrase's own path


class Continuation(Takeover):
    """Poses and roots of a continued dance, laid over a phrase's window; once a tick.

    temperature, top_p: of the draws. follow: 1 answers, 0.5 does not care, 0 contrasts. goal: x, z in metres
    on the puppet's own floor; None: it roams about where it began.
    """

    SNAPSHOT = (
        *("temperature", "top_p", "follow", "delay_steps", "goal"),
        *("_leaves", "_left", "_is_going", "_signs"),
        *("_rows", "_roots", "_head", "_end", "_steps", "_cells", "_turn", "_place", "_slope", "_home"),
        *("_work", "_codes", "_move", "_decoded", "_who"),
    )

    def __init__(
        self,
        network: ImproviserNetwork,
        partner: PartnerNetwork | None,
        joints: int,
        window: int = WINDOW,
        tick_s: float = 0.02,
    ) -> None:
        super().__init__(tick_s)
        self._network, self._partner, self._length = network, partner, window
        self.temperature, self.top_p, self.follow, self.delay_steps = TEMPERATURE, TOP_P, FREE, 0
        self.goal: tuple[float, float] | None = None
        self._leaves = self._is_going = False
        self._left = np.zeros(2)  # how far from the phrase's path the figure was left, x and z
        features, moving = network.features, len(network.places)
        self._rows = np.zeros((_ROWS, moving, 4), np.float32)
        self._roots = np.zeros((_ROWS, 3), np.float32)
        self._head = self._end = 0
        self._steps = np.zeros((SEEN, features), np.float32)
        self._cells = np.zeros((2, 1, network.cells), np.float32)
        self._turn = 0  # which memory is next: each remembers moves, two of which overlap by half
        self._place, self._slope, self._home = np.zeros(3), np.zeros(3), np.zeros(2)
        self._work = 0
        self._codes = np.zeros((CANDIDATES, network.code_size), np.float32)
        self._move = np.zeros((MOVE, features), np.float32)
        self._decoded = np.zeros((WINDOW, moving, 4), np.float32)
        self._who = np.zeros(0 if partner is None else partner.dancers, np.float32)
        self._window = np.zeros((window, joints, 4), np.float32)
        self._path = np.zeros((window, 3), np.float32)
        # Between two dances that turn more than half a turn apart, the short way would change sides.
        self._over = Slerp(window * moving, short=False)
        self._signs = np.ones((moving, 1), np.float32)
        self._laid = np.zeros((window, moving, 4), np.float32)
        self._rise = (np.sin(np.pi * (np.arange(HOP) + 0.5) / WINDOW) ** 2)[:, None]

    def choose(self, chosen: bool, fade_s: float) -> None:
        """Take over from the phrase, or give back to it where the figure stands, over fade_s."""
        self._leaves = self._chosen and not chosen
        super().choose(chosen, fade_s)

    def lay_over(
        self,
        window: FloatArray,
        roots: FloatArray,
        own: StepMemory,
        led: StepMemory | None,
        rng: np.random.Generator | None,
        still_steps: int = 0,
    ) -> tuple[FloatArray, FloatArray]:
        """The window (T, J, 4) and the roots (T, 3) that the puppet starts from, of the phrase's own.

        own: what the figure has danced, the last still_steps of it standing still: it goes on from before.
        led: what the other one has danced, None: nobody. rng: of this tick.
        """
        if self._chosen and not self._is_going:
            self._begin(own, window, still_steps)
        if self._is_going:
            self._head += 1
            if self._work or self._end - self._head < self._length + 3:
                self._work_on(led, rng)
        if self._leaves:
            if self._is_going and self._share:
                self._left[:] = (self._roots[self._head] - roots[0])[[0, 2]]
            self._leaves = False
        is_ready = self._is_going and self._end - self._head >= self._length
        goes = self._chosen and is_ready
        if is_ready and self._share in (0.0, 1.0):
            self._signs[:] = quaternion.sides(self._rows[self._head], window[0, self._network.places])
        self._fade(goes)
        if not self._share or not is_ready:
            self._is_going = self._is_going and self._chosen
            self._left *= max(0.0, 1.0 - _HOME / max(math.hypot(*self._left), _HOME))
            return (window, self._moved(roots)) if self._left.any() else (window, roots)
        rows = slice(self._head, self._head + self._length)
        flat, places = self._laid.reshape(-1, 4), self._network.places
        np.multiply(self._rows[rows], self._signs, out=self._laid)
        if self.share < 1.0:
            self._over(flat, window[:, places].reshape(-1, 4), 1.0 - self.share, out=flat)
        self._window[:] = window
        self._window[:, places] = self._laid
        path = self._moved(roots)
        path += np.float32(self.share) * (self._roots[rows] - path)
        return self._window, path

    def _moved(self, roots: FloatArray) -> FloatArray:
        """The phrase's roots from where the figure was left."""
        np.copyto(self._path, roots)
        self._path[:, [0, 2]] += self._left.astype(np.float32)
        return self._path

    def _begin(self, own: StepMemory, window: FloatArray, still_steps: int) -> None:
        heard = own.recent(SEEN, still_steps)
        if heard is None:
            heard = own.recent(SEEN)
        if heard is None:
            return
        self._steps[:] = heard
        self._place[:], self._slope[:] = own.place, 0.0
        if not still_steps:
            self._slope[:] = _way(heard[-1], own.place[2] - heard[-1, -ROOT + 2])
            self._slope[1] = heard[-1, -1] - heard[-2, -1]
        self._home[:] = own.place[:2]
        self._cells[:], self._turn, self._work, self._who[:] = 0.0, 0, 0, 0.0
        self._rows[:] = window[0, self._network.places]
        self._head, self._end = own.age, 0
        self._is_going = True
        self._decoded[:] = self._facing(self._network.decode(heard[-1:, :-ROOT]), [own.place[2]])[0]

    def _work_on(self, led: StepMemory | None, rng: np.random.Generator | None) -> None:
        """A third of a choice."""
        network, before = self._network, self._steps[-BEFORE:]
        rng = rng or np.random.default_rng(0)
        if self._work == 0 and self._partner is not None:
            self._draw_answers(self._partner, self._seen(led), rng)
        elif self._work == 0:
            code = network.code_of(self._steps[None, :BEFORE], self._steps[None, BEFORE:])
            mixture, self._cells[self._turn] = network.forecast(before[None], code, self._cells[self._turn])
            self._turn = 1 - self._turn
            self._codes[:] = self._drawn(mixture, network.mixtures, CANDIDATES, rng)
        elif self._work == 1:
            moves = network.move_of(np.repeat(before[None], CANDIDATES, 0), self._codes)
            self._move[:] = moves[self._suits(before, moves, led, rng).argmax()]
        else:
            self._dance(self._move)
        self._work = (self._work + 1) % 3

    def _draw_answers(
        self, partner: PartnerNetwork, led: FloatArray | None, rng: np.random.Generator
    ) -> None:
        """Codes of moves after the other's steps, and of moves that do not look at them, by the dial."""
        if not self._who.any():  # the other dancer of a couple
            who = partner.recognised(self._steps) if led is None else partner.recognised(led[-SEEN:]) ^ 1
            self._who[who] = 1.0
        answers = 0 if led is None else round(CANDIDATES * max(0.0, 2 * (self.follow - FREE)))
        for seen, rows in ((led, slice(0, answers)), (None, slice(answers, CANDIDATES))):
            if len(self._codes[rows]):
                noise = self.temperature * rng.standard_normal(self._codes[rows].shape)
                self._codes[rows] = partner.answers(self._steps, seen, self._who, noise.astype(np.float32))

    def _drawn(self, mixture: FloatArray, mixtures: int, count: int, rng: np.random.Generator) -> FloatArray:
        logits, means, log_scales = parts_of(mixture, mixtures)
        logits = nucleus(logits, self.top_p)
        logits, means, log_scales = (np.repeat(part, count, 0) for part in (logits, means, log_scales))
        return drawn(logits, means, log_scales, self.temperature, rng)

    def _seen(self, led: StepMemory | None) -> FloatArray | None:
        return None if led is None else led.recent(LED_STEPS, self.delay_steps)

    def _suits(
        self, before: FloatArray, moves: FloatArray, led: StepMemory | None, rng: np.random.Generator
    ) -> FloatArray:
        """(N,): how well each of the moves (N, 8, F) suits."""
        suits = np.zeros(CANDIDATES, np.float32)
        suits[0] = 1e-6  # the first one where nothing matters
        if self._partner is not None:
            whole = np.concatenate([np.repeat(before[None], CANDIDATES, 0), moves], axis=1)
            suits = nucleus(NATURAL * self._partner.natural(whole, self._who)[None], self.top_p)[0]
            suits += self.temperature * rng.gumbel(size=CANDIDATES).astype(np.float32)
            seen = self._seen(led)
            if seen is not None and self.follow != FREE:
                score = self._partner.scores(seen, whole)
                suits += 2 * (self.follow - FREE) * ANSWERING * (score - score.mean()) / (score.std() + 1e-6)
        ways = _ends(self._place, moves[:, :, -ROOT:])
        away = np.linalg.norm(ways - (self._home if self.goal is None else self.goal), axis=-1)
        away = away[:, -1] if self.goal is None else away.mean(axis=1)
        near = ROAM_M if self.goal is None else 0.0
        suits -= (WHERE * np.maximum(away - near, 0.0)).astype(np.float32)
        return suits

    def _dance(self, move: FloatArray) -> None:
        """Rows for the next steps of a move; as many as are danced before the next choice."""
        count = FIRST if not self._end else DANCED
        headings = self._place[2] + np.cumsum(move[: count + 1, -ROOT + 2].astype(float))
        knots = np.empty((count + 2, 3))
        x, z, _ = self._place
        knots[0] = x, self._steps[-1, -1], z
        knots[1:, [0, 2]] = _ends(self._place, move[: count + 1, -ROOT:])
        knots[1:, 1] = move[: count + 1, -1]
        made = self._facing(self._network.decode(move[:count, :-ROOT]), headings[:count])
        windows = np.concatenate([self._decoded[None], made])
        earlier, later = windows[:-1, MIDDLE:], windows[1:, :MIDDLE]
        poses = quaternion.slerp(earlier.astype(float), later.astype(float), self._rise[None])
        kept = self._end - self._head if self._end else 0
        if kept:
            self._rows[:kept], self._roots[:kept] = (
                self._rows[self._head : self._end].copy(),
                self._roots[self._head : self._end].copy(),
            )
            self._head = 0
        new = slice(kept, kept + HOP * count)
        last = self._rows[max(kept - 1, 0)]
        together = np.concatenate([last[None], poses.reshape(-1, *last.shape)])
        self._rows[new] = quaternion.continuous(together)[1:]
        self._roots[new], self._slope[:] = _curve(knots, self._slope)
        self._end = kept + HOP * count
        self._decoded[:] = made[-1]
        self._place[:] = *knots[count, [0, 2]], headings[count - 1]
        self._steps[:-count] = self._steps[count:].copy()
        self._steps[-count:] = move[:count]

    def _facing(self, windows: FloatArray, headings: FloatArray | list[float]) -> FloatArray:
        """Windows (W, 8, M, 4) of unit length, turned to their headings (W,)."""
        windows = quaternion.normalize(windows)
        half = np.asarray(headings, np.float32)[:, None] / 2
        turns = np.zeros((len(windows), 1, 4), np.float32)
        turns[..., 0], turns[..., 2] = np.cos(half), np.sin(half)
        windows[:, :, 0] = quaternion.multiply(turns, windows[:, :, 0])
        return windows


def nucleus(logits: FloatArray, top_p: float) -> FloatArray:
    """Logits (B, K) of the likeliest Gaussians that have top_p of the probability together; others: -1e9."""
    shares = np.exp(logits - logits.max(axis=1, keepdims=True))
    shares /= shares.sum(axis=1, keepdims=True)
    order = np.argsort(-shares, axis=1)
    before = np.cumsum(np.take_along_axis(shares, order, 1), axis=1) - np.take_along_axis(shares, order, 1)
    left = np.zeros_like(shares, dtype=bool)
    np.put_along_axis(left, order, before >= top_p, 1)
    return np.where(left, np.float32(-1e9), logits)


def _way(step: FloatArray, heading: float) -> Array:
    """A step's displacement (3,) on the floor, from its own heading before."""
    left, ahead = float(step[-ROOT]), float(step[-ROOT + 1])
    cosine, sine = math.cos(heading), math.sin(heading)
    return np.array([cosine * left + sine * ahead, 0.0, cosine * ahead - sine * left])


def _ends(place: Array, ways: FloatArray) -> Array:
    """Where each of the steps (..., T, 4) ends: x, z (..., T, 2) metres; place: x, z, heading before them."""
    left, ahead, turn, _ = np.moveaxis(ways.astype(float), -1, 0)
    heading = place[2] + np.cumsum(turn, axis=-1) - turn
    cosine, sine = np.cos(heading), np.sin(heading)
    moved = np.stack([cosine * left + sine * ahead, cosine * ahead - sine * left], -1)
    ends: Array = place[:2] + np.cumsum(moved, axis=-2)
    return ends


def _curve(knots: Array, slope: Array) -> tuple[Array, Array]:
    """A cubic curve (4 * (T - 2), 3) through all knots (T, 3) but the last, which only gives the slope (3,)
    at the end.
    """
    slopes = np.concatenate([slope[None], (knots[2:] - knots[:-2]) / 2])
    t = (np.arange(HOP) / HOP)[None, :, None]
    a, b, da, db = knots[:-2, None], knots[1:-1, None], slopes[:-1, None], slopes[1:, None]
    t2, t3 = t * t, t * t * t
    curve = (2 * t3 - 3 * t2 + 1) * a + (t3 - 2 * t2 + t) * da + (3 * t2 - 2 * t3) * b + (t3 - t2) * db
    return curve.reshape(-1, 3), slopes[-1]
