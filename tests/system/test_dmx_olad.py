"""Our universes as the real Open Lighting Architecture receives them: Art-Net, sACN, a USB widget."""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from appliance.outputs.dmx.open_wire import open_universes
from appliance.outputs.dmx.pace import Universe
from appliance.show.dmx import DmxConfig
from hw_sim.dmx.usb_pro import GET_PARAMETERS, GET_SERIAL, UsbProWidget
from tests.outputs.dmx.conftest import config, universe
from tests.system import namespace, olad
from tests.system.namespace import Cable, Namespace
from tests.system.olad import Olad
from tests.system.processes import wait_until

pytestmark = pytest.mark.skipif(olad.why_not() is not None, reason=str(olad.why_not()))

ART_NET_IN, SACN_IN = "2-1-I-0", "11-1-I-0"
LOST_AFTER_S = 2.5
BOX, NODE = "10.77.0.1", "10.77.0.2"

Venue = tuple[Namespace, Namespace, Cable]


class Sender:
    """Offers the same universe 40 times a second, as the lights do, until it ends."""

    def __init__(self, wires: list[DmxConfig], state: Path | None, network: Namespace | None = None) -> None:
        self._universes = open_universes(wires, state)
        self._network = network
        self._ended = threading.Event()
        self._goodbye = False
        self.levels = bytes(512)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def cut_power(self) -> float:
        """Stop without sending anything more; the time of that, monotonic seconds."""
        self._ended.set()
        self._thread.join()
        return time.monotonic()

    def close(self) -> float:
        """End as a show does; the time of that, monotonic seconds."""
        self._goodbye = True
        return self.cut_power()

    def __enter__(self) -> Sender:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _run(self) -> None:
        if self._network is None:
            self._send_all()
        else:
            with self._network.entered():
                self._send_all()

    def _send_all(self) -> None:
        while not self._ended.wait(0.005):
            self._each(lambda one, now: one.offer(self.levels, now))
        if self._goodbye:
            self._each(lambda one, now: one.close(now))

    def _each(self, act: Callable[[Universe, float], object]) -> None:
        for one in self._universes:
            act(one, time.monotonic())


def has_art_net_port() -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("0.0.0.0", 6454))
        except OSError:
            return False
        return True


@pytest.fixture
def art_net() -> Iterator[Namespace | None]:
    """A network in which Art-Net's port is free: one of the test's own, else this machine's."""
    if namespace.why_not() is None:
        with Namespace("artnet") as network:
            yield network
    elif has_art_net_port():
        yield None
    else:
        pytest.skip(f"Art-Net's port 6454 is taken, and {namespace.why_not()}")


def test_art_net(art_net: Namespace | None) -> None:
    with (
        Olad(olad.art_net_node(), {ART_NET_IN: 1}, art_net) as daemon,
        Sender([config("artnet")], None, art_net) as box,
    ):
        for seed in (1, 2, 3):
            box.levels = universe(seed)
            daemon.await_levels(1, universe(seed))
        box.levels = bytes(512)
        daemon.await_levels(1, bytes(512))


def test_art_net_net_and_subnet(art_net: Namespace | None) -> None:
    node = olad.art_net_node(net=5, subnet=3)
    with (
        Olad(node, {ART_NET_IN: 4}, art_net) as daemon,
        Sender([config("artnet", universe=4, number=5 << 8 | 3 << 4 | 4)], None, art_net) as box,
        Sender([config("artnet", universe=4)], None, art_net) as other,
    ):
        other.levels = universe(9)
        box.levels = universe(1)
        daemon.await_levels(4, universe(1))


def test_an_art_net_node_follows_again_after_a_restart(art_net: Namespace | None) -> None:
    with (
        Olad(olad.art_net_node(), {ART_NET_IN: 1}, art_net) as daemon,
        Sender([config("artnet")], None, art_net) as box,
    ):
        box.levels = universe(1)
        daemon.await_levels(1, universe(1))
        daemon.stop()
        box.levels = universe(2)
        daemon.start()
        daemon.await_levels(1, universe(2))


@pytest.fixture
def venue() -> Iterator[Venue]:
    """The box's network and the node's, and the cable between them."""
    if namespace.why_not() is not None:
        pytest.skip(f"sACN needs a network of its own: {namespace.why_not()}")
    with Namespace("box") as box, Namespace("node") as node:
        yield box, node, Cable(box, f"{BOX}/24", node, f"{NODE}/24")


def by_multicast(priority: int) -> DmxConfig:
    return config("sacn", interface=BOX, priority=priority)


def test_of_two_boxes_the_higher_priority_is_seen_and_the_other_takes_over(
    venue: Venue, tmp_path: Path
) -> None:
    network, node, _ = venue
    with (
        Olad(olad.sacn_node(NODE), {SACN_IN: 1}, node) as daemon,
        Sender([by_multicast(100)], tmp_path / "second", network) as second,
    ):
        second.levels = universe(100)
        daemon.await_levels(1, universe(100))

        def ends_at_once() -> bool:
            """Three Stream_Terminated end it before the source counts as lost."""
            with Sender([by_multicast(150)], tmp_path / "first", network) as first:
                first.levels = universe(150)
                daemon.await_levels(1, universe(150))
                second.levels = universe(101)  # the lower priority is not seen
                time.sleep(0.2)
                assert daemon.levels(1) == universe(150)
                ended = first.close()
                return daemon.await_levels(1, universe(101)) - ended < LOST_AFTER_S

        wait_until(ends_at_once)  # again where a busy machine was slow to look
        with Sender([by_multicast(150)], tmp_path / "first", network) as first:
            first.levels = universe(151)
            daemon.await_levels(1, universe(151))
            ended = first.cut_power()
            # Its lights stay until it counts as lost; its last keep-alive may be 1 s old by then.
            assert daemon.await_levels(1, universe(101)) - ended > LOST_AFTER_S - 1.0


def test_sacn_unicast_survives_a_still_picture(venue: Venue, tmp_path: Path) -> None:
    network, node, _ = venue
    with (
        Olad(olad.sacn_node(NODE), {SACN_IN: 1}, node) as daemon,
        Sender([config("sacn", host=NODE, priority=150)], tmp_path / "still", network) as still,
        Sender([by_multicast(100)], tmp_path / "moving", network) as moving,
    ):
        still.levels, moving.levels = universe(7), universe(8)
        daemon.await_levels(1, universe(7))
        until = time.monotonic() + 2 * LOST_AFTER_S
        while time.monotonic() < until:  # keep-alives alone hold it
            assert daemon.levels(1) == universe(7)
            time.sleep(0.1)


def test_a_cable_pulled_out_and_back(venue: Venue, tmp_path: Path) -> None:
    network, node, cable = venue
    with (
        Olad(olad.sacn_node(NODE), {SACN_IN: 1}, node) as daemon,
        Sender([by_multicast(100)], tmp_path, network) as box,
    ):
        box.levels = universe(1)
        daemon.await_levels(1, universe(1))
        cable.pull_out()
        box.levels = universe(2)
        time.sleep(0.3)
        assert daemon.levels(1) == universe(1)
        cable.plug_in()
        daemon.await_levels(1, universe(2))


def test_preview_is_for_visualisers_alone(venue: Venue, tmp_path: Path) -> None:
    network, node, _ = venue
    with (
        Olad(olad.sacn_node(NODE), {SACN_IN: 1}, node) as daemon,
        Sender(
            [config("sacn", interface=BOX, preview=True, priority=200)], tmp_path / "p", network
        ) as preview,
        Sender([by_multicast(100)], tmp_path / "s", network) as show,
    ):
        preview.levels, show.levels = universe(1), universe(2)
        daemon.await_levels(1, universe(2))
        time.sleep(0.2)
        assert daemon.levels(1) == universe(2)


@pytest.fixture
def widget() -> Iterator[UsbProWidget]:
    """With a name that no other test run uses."""
    with olad.shared_folder() as folder, UsbProWidget(folder / f"ttyUSB{os.getpid()}") as plugged_in:
        yield plugged_in


def with_widget(widget: UsbProWidget) -> dict[str, olad.Settings]:
    return {"usbserial": {"device_dir": str(widget.path.parent), "device_prefix": "ttyUSB"}}


def widget_out(widget: UsbProWidget) -> str:
    return f"5-{widget.serial_number:08x}-O-0"


def await_widget(widget: UsbProWidget, daemon: Olad, levels: bytes) -> None:
    wait_until(lambda: widget.levels == levels, lambda: daemon.log)


def test_olad_recognizes_our_widget_as_a_real_one(widget: UsbProWidget) -> None:
    with Olad(with_widget(widget), {widget_out(widget): 1}) as daemon:
        device = "Enttec Usb Pro Device, Serial #: 01234567, firmware 1.44"
        wait_until(lambda: device in daemon.ask("json/get_ports"), lambda: daemon.log)
        assert {GET_PARAMETERS, GET_SERIAL} <= set(widget.labels)
        for seed in (1, 2):
            daemon.set_levels(1, universe(seed))
            await_widget(widget, daemon, universe(seed))


def test_from_our_art_net_through_olad_to_the_widget(widget: UsbProWidget, art_net: Namespace | None) -> None:
    plugins = {**olad.art_net_node(), **with_widget(widget)}
    with (
        Olad(plugins, {ART_NET_IN: 1, widget_out(widget): 1}, art_net) as daemon,
        Sender([config("artnet")], None, art_net) as box,
    ):
        for seed in (1, 2):
            box.levels = universe(seed)
            await_widget(widget, daemon, universe(seed))
        box.levels = bytes(512)
        await_widget(widget, daemon, bytes(512))
