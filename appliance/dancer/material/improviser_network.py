"""Improviser network: an improviser and the autoencoder that encodes for it, by onnxruntime."""

from __future__ import annotations

from collections.abc import Mapping

from appliance.dancer.material.improvising import Numbers
from appliance.dancer.material.motion_network import MotionNetwork
from appliance.dancer.material.steps import ROOT, WINDOW


class ImproviserNetwork(MotionNetwork):
    """A Coder of steps and a Choreographer. features: numbers of a step; code_size: of a move's code."""

    kind = "improviser"

    def code_of(self, before: Numbers, move: Numbers) -> Numbers:
        """See Choreographer."""
        return self._run(["code_of_move"], steps_heard=before, move_heard=move)[0]

    def forecast(self, before: Numbers, code: Numbers, cells: Numbers) -> tuple[Numbers, Numbers]:
        """See Choreographer."""
        mixture, later = self._run(["mixture", "later_cells"], last_steps=before, last_code=code, cells=cells)
        return mixture, later

    def move_of(self, before: Numbers, code: Numbers) -> Numbers:
        """See Choreographer."""
        return self._run(["next_move"], steps_before=before, next_code=code)[0]

    def _take_facts(self, facts: Mapping[str, str]) -> None:
        self.mixtures, self.cells = int(facts["bunraku.mixtures"]), self._idle["cells"].shape[1]
        self.features = self._idle["move_heard"].shape[2]
        self.code_size = self._idle["next_code"].shape[1]
        if self.window != WINDOW or self.features != self.latent + ROOT:
            raise ValueError("its steps are not those of its windows")
