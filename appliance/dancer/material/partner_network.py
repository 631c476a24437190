"""Partner network: which moves answer what another dancer has just danced, and how well, by onnxruntime."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from appliance.dancer.material.improvising import BEFORE, MOVE, Numbers
from appliance.dancer.material.motion_network import MotionNetwork
from appliance.dancer.material.steps import ROOT

LED_STEPS = 16  # the other dancer's: 1.3 s
GAP = 4  # steps by which the other dancer is known less far than the figure that answers
SEEN = BEFORE + MOVE


class PartnerNetwork(MotionNetwork):
    """Steps are features (T, F) of the show's improviser; see steps.Steps. It dances as one of the dancers
    that it learned from: `who` (W,) is 1 for that one, 0 for the others. Couples are numbered 0, 1; then the
    same in the mirror.

    dancers: W.
    """

    kind = "partner"

    def scores(self, led: Numbers, moves: Numbers) -> Numbers:
        """How well each move, with the 3 steps before it (N, 11, F), answers the other's steps (16, F): (N,),
        the logarithm of its likelihood among moves of this dancer. The led steps end 4 steps before the move.
        """
        return self._run(["scores"], led=led[None], moves=moves)[0]

    def natural(self, moves: Numbers, who: Numbers) -> Numbers:
        """How much likelier each move, with the 3 steps before it (N, 11, F), is of the dancer than drawn by
        this network: (N,), a logarithm.
        """
        return self._run(["natural"], moves=moves, who=who[None])[0]

    def answers(self, own: Numbers, led: Numbers | None, who: Numbers, noise: Numbers) -> Numbers:
        """After its own last steps (11, F) and the other's (16, F), None: nobody's: a code (N, C) of the next
        move for each row of noise (N, C), which is standard Gaussian.
        """
        seen = {"own": own[None], "who": who[None], "noise": noise}
        if led is not None:
            seen |= {"led": led[None], "heard": np.ones((1, 1), np.float32)}
        return self._run(["codes"], **seen)[0]

    def recognised(self, steps: Numbers) -> int:
        """Number of the dancer that steps (11, F) are most like."""
        return int(self._run(["alike"], own=steps[None])[0].argmax())

    def _take_facts(self, facts: Mapping[str, str]) -> None:
        self.features, self.dancers = self._idle["led"].shape[2], self._idle["who"].shape[1]
        shapes = (1, LED_STEPS, self.features), (1, SEEN, self.latent + ROOT)
        if (self._idle["led"].shape, self._idle["moves"].shape) != shapes or self.dancers % 2:
            raise ValueError("its steps are not those of an improviser")
