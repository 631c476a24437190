"""OSC receivers: joint frames leave as UDP datagrams; what cannot leave at once is dropped and counted."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from appliance.outputs.datagram_sender import DatagramPath, DatagramSender
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.dialects import DIALECTS, Addressed
from appliance.outputs.osc.frame_message import FrameMessage
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig


class OscOutputs:
    """All OSC receivers of a box. Encoded once a frame for all receivers that want the same."""

    def __init__(
        self,
        configs: Sequence[OscConfig],
        skeleton: Skeleton,
        asked_for: bool = True,
        puppets: Sequence[Sequence[str]] = ((),),
        has_live: bool = False,
    ) -> None:
        """puppets: of each the joints of its hands, "" of one that points no single joint; has_live: the show
        takes a live dancer.
        """
        self.receivers = tuple(
            DatagramSender(
                f"{config.host}:{config.port} ({config.dialect})",
                DatagramPath(config.host, config.port, broadcast=True),
                asked_for,
            )
            for config in configs
        )
        self._frame_message = FrameMessage()
        forms = [config.model_dump_json(exclude={"host", "port", "frame_message"}) for config in configs]
        rows = itertools.count()
        numbered = ([(next(rows), joint) for joint in joints] for joints in puppets)
        hands = [{row: joint for row, joint in one if joint} for one in numbered]
        self._encoders = [  # for each puppet
            {
                form: DIALECTS[config.dialect](
                    skeleton,
                    addressed,
                    Addressed(config.number_of(puppet), own, has_live and puppet == (config.puppet or 0)),
                )
                for form, config in dict(zip(forms, configs, strict=True)).items()
                if (addressed := config.of_puppet(puppet)) is not None
            }
            for puppet, own in enumerate(hands)
        ]
        self._audience = list(zip(configs, forms, self.receivers, strict=True))

    def send_frame(self, frame: JointFrame) -> None:
        """Send a frame to every receiver. Never waits, never raises."""
        mark = self._frame_message.encode(frame)
        encoded = [
            {form: encoder.encode(frame, puppet) for form, encoder in encoders.items()}
            for puppet, encoders in zip(frame.puppets, self._encoders, strict=True)
        ]
        for config, form, receiver in self._audience:
            datagrams = [*mark] if config.frame_message else []
            for of_puppet in encoded:
                datagrams += of_puppet.get(form, ())
            receiver.send_datagrams(datagrams, frame.frame_time)

    def close(self) -> None:
        for receiver in self.receivers:
            receiver.close()
