"""Partner network: which moves answer what another dancer has just danced, and how well, by onnxruntime."""

from __future__ import annotations

from collections.abc import Mapping

from appliance.dancer.material.improvising import BEFORE, MOVE, Numbers
from appliance.dancer.material.motion_network import MotionNetwork
from appliance.dancer.material.steps import ROOT

LED_STEPS = 16  # the other dancer's: 1.3 s
GAP = 4  # steps by which the other dancer is known less far than the figure that answers
SEEN = BEFORE + MOVE


class PartnerNetwork(MotionNetwork):
    """Steps are features (T, F) of the show's improviser; see steps.Steps.

    mixtures: Gaussians of an answer.
    """

    kind = "partner"

    def scores(self, led: Numbers, moves: Numbers) -> Numbers:
        """How well each move, with the 3 steps before it (N, 11, F), answers the other's steps (16, F): (N,),
        the logarithm of its likelihood among moves of this dancer. The led steps end 4 steps before the move.
        """
        return self._run(["scores"], led=led[None], moves=moves)[0]

    def answers(self, before: Numbers, led: Numbers) -> Numbers:
        """After its own last steps (3, F) and the other's steps (16, F): the mixture (1, K * (2 C + 1)) of
        the code of the next move.
        """
        return self._run(["mixture"], before=before[None], led=led[None])[0]

    def _take_facts(self, facts: Mapping[str, str]) -> None:
        self.features, self.mixtures = self._idle["led"].shape[2], int(facts["bunraku.mixtures"])
        shapes = (1, LED_STEPS, self.features), (1, SEEN, self.latent + ROOT)
        if (self._idle["led"].shape, self._idle["moves"].shape) != shapes:
            raise ValueError("its steps are not those of an improviser")
