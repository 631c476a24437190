"""What the projector says of itself when asked to: figures of its pictures, in small letters of its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_REMEMBERED = 3600  # pictures: a minute on most displays

# Five rows of three pixels a letter, one octal digit a row.
_WORDS = """
    0 75557  1 26227  2 71747  3 71717  4 55711  5 74717  6 74757  7 71122  8 75757  9 75717
    A 25755  B 65656  C 34443  D 65556  E 74647  F 74644  G 34553  H 55755  I 72227  J 11152
    K 55655  L 44447  M 57755  N 65555  O 25552  P 65644  Q 25563  R 65655  S 34216  T 72222
    U 55557  V 55552  W 55775  X 55255  Y 55222  Z 71247  . 00002  , 00024  : 02020  - 00700
    % 51245  / 11244  ( 24442  ) 21112  _ 00007  + 02720
""".split()
_LETTERS = dict(zip(_WORDS[::2], _WORDS[1::2], strict=True))
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

    def sentence(self) -> str:
        """One line for the terminal."""
        if self.age_p50_ms is None:
            return f"{self.rate:.1f} pictures/s, no dance"
        return (
            f"{self.rate:.1f} pictures/s, frame age at the swap "
            f"{self.age_p50_ms:.0f} ms p50, {self.age_p99_ms:.0f} ms p99"
        )


class Meter:
    """Measures what is shown. Frame age: how long ago what is now on the wall left the stage."""

    def __init__(self) -> None:
        self.pictures = 0
        self._ages_s: deque[float] = deque(maxlen=_REMEMBERED)
        self._swaps: deque[float] = deque(maxlen=_REMEMBERED)

    def shown(self, swapped: float, left_stage: float | None) -> None:
        """A picture is on the wall since `swapped`; `left_stage` None: it does not show a dance."""
        self.pictures += 1
        self._swaps.append(swapped)
        if left_stage is not None:
            self._ages_s.append(swapped - left_stage)

    def figures(self) -> Figures:
        """Over the last minute or so."""
        span_s = self._swaps[-1] - self._swaps[0] if len(self._swaps) > 1 else 0.0
        rate = (len(self._swaps) - 1) / span_s if span_s > 0 else 0.0
        if not self._ages_s:
            return Figures(rate, None, None, self.pictures)
        p50_s, p99_s = np.percentile(self._ages_s, (50, 99))
        return Figures(rate, 1000 * float(p50_s), 1000 * float(p99_s), self.pictures)
