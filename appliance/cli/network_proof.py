"""A first run of a show's network in a separate process: it may hang, crash, or take all memory."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from appliance.cli.run_with_timeout import CHECK_S, TimedOutError, limit_memory, run_with_timeout
from appliance.dancer.puppet import PuppetNetwork
from appliance.pose.correctable_error import CorrectableError
from appliance.show.check import Finding, not_as_packed, verify_bundle
from appliance.show.show import Show
from appliance.stage.stage_error import StageError

ONE_RUN_S = 20.0


def proved(network: Path, do: Callable[[], None], seconds: float = CHECK_S) -> str:
    """The output of `do`. Raises StageError with its error for the user, or with why it was ended."""

    def reported() -> bytes:
        limit_memory()
        error = ""
        with contextlib.redirect_stdout(io.StringIO()) as output:
            try:
                do()
            except CorrectableError as found:
                error = str(found)
            except MemoryError:
                error = f"{network}: the show takes more memory than this box has for one. Export it again."
        return json.dumps([output.getvalue(), error]).encode()

    try:
        message, error = json.loads(run_with_timeout(seconds, reported))
    except TimedOutError as reason:
        raise StageError(
            f"{network}: this network was given up ({reason}): it never ends, or it crashes. "
            "Nothing is danced. Export the show again, or copy the bundle again."
        ) from None
    if error:
        raise StageError(message + error)
    return str(message)


def require_danceable(findings: Sequence[Finding]) -> None:
    """The rule of `play` and `check`. Raises StageError with all that is wrong."""
    errors = [str(finding) for finding in findings if finding.forbids_dancing]
    if errors:
        raise StageError("\n".join(["This show cannot be danced.", *errors]))


def prove_network(show: Show) -> str:
    """Check the bundle, and run its network once, at the show's iterations; what the user should know of it.

    Raises StageError if it cannot be danced, or the run fails or does not end.
    """

    def run() -> None:
        require_danceable(verify_bundle(show.directory))
        print(not_as_packed(show.directory))
        cast = show.config.cast
        network = PuppetNetwork(show.network, show.skeleton, len(cast))
        for start, puppet in zip(cast, network.puppets, strict=True):
            held = np.isin(network.joints, [hand.joint for hand in start.hands])
            targets, weights = np.tile(network.rest, (network.window, 1, 1)), held.astype(np.float32)
            puppet.hold(held, targets, weights, *start.iterations)
        try:
            network.dance()
        except Exception as error:  # onnxruntime has a separate class for every kind of failure
            raise StageError(
                f"{show.network}: the network fails when it runs ({str(error)[:200]}). Nothing is danced. "
                "Export the show again, or copy the bundle again."
            ) from None

    return proved(show.network, run, ONE_RUN_S).strip()
