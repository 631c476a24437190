"""The projector's figures about its pictures, and the small letters to show them on the wall."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_REMEMBERED = 3600  # pictures whose age counts: a minute on most displays
_COUNTED_S = 2.0  # over which the rate is counted

# Five rows of three pixels a letter, one octal digit a row.
_SIGNS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ.,:-%/()_+"
_ROWS = (
    "755572622771747717175571174717747577112275757757172575565656344436555674647"
    "746443455355755722271115255655444475775565555255526564425563656553421672222"
    "555575555255775552555522271247000020002402020007005124511244244422111200007"
    "02720"
)
_LETTERS = {sign: _ROWS[5 * k : 5 * k + 5] for k, sign in enumerate(_SIGNS)}
_ADVANCE, _LINE = 4, 7  # pixels from letter to letter, from line to line


def letters(lines: Sequence[str]) -> NDArray[np.uint8]:
    """Lines of text as an image (height, width) of 0 and 255, top row first; unknown letters stay empty."""
    width = max((len(line) for line in lines), default=0) * _ADVANCE + 1
    image = np.zeros((len(lines) * _LINE + 1, width), np.uint8)
    for row, line in enumerate(lines):
        for column, letter in enumerate(line.upper()):
            for y, bits in enumerate(_LETTERS.get(letter, "00000")):
                for x in range(3):
                    if int(bits, 8) & (4 >> x):
                        image[1 + row * _LINE + y, 1 + column * _ADVANCE + x] = 255
    return image


@dataclass(frozen=True)
class Figures:
    """How pictures came out: pictures a second, frame age at the swap in milliseconds (None: no dance)."""

    rate: float
    age_p50_ms: float | None
    age_p99_ms: float | None
    pictures: int
    dances: int  # among these, how many of the last minute showed a dance

    def sentence(self) -> str:
        """One line for the terminal."""
        if self.age_p50_ms is None:
            return f"{self.rate:.1f} pictures/s, no dance"
        return (
            f"{self.rate:.1f} pictures/s, frame age at the swap "
            f"{self.age_p50_ms:.0f} ms p50, {self.age_p99_ms:.0f} ms p99"
        )


class Meter:
    """Measures the pictures shown. Frame age: how long ago the frame now on the wall left the stage."""

    def __init__(self) -> None:
        self.pictures = 0
        self._ages_s: deque[float] = deque(maxlen=_REMEMBERED)
        self._swaps: deque[float] = deque()

    def note_swap(self, swapped: float, left_stage: float | None) -> None:
        """Note that a picture is on the wall since `swapped`; `left_stage` None: it shows no dance."""
        self.pictures += 1
        self._swaps.append(swapped)
        while self._swaps[-1] - self._swaps[0] > _COUNTED_S and len(self._swaps) > 2:
            self._swaps.popleft()
        if left_stage is not None:
            self._ages_s.append(swapped - left_stage)

    def figures(self) -> Figures:
        """Ages over the last minute or so, the rate over the last two seconds."""
        span_s = self._swaps[-1] - self._swaps[0] if len(self._swaps) > 1 else 0.0
        rate = (len(self._swaps) - 1) / span_s if span_s > 0 else 0.0
        if not self._ages_s:
            return Figures(rate, None, None, self.pictures, 0)
        p50_s, p99_s = np.percentile(self._ages_s, (50, 99))
        return Figures(rate, 1000 * float(p50_s), 1000 * float(p99_s), self.pictures, len(self._ages_s))
