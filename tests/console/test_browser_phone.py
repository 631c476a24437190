"""A phone as a sensor: a real browser's orientation moves the joint of a real box."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import BrowserContext, CDPSession, expect
from playwright.sync_api import Page as Tab

from appliance.console.phones import AWAY_S
from appliance.outputs.frame_reader import FrameReader
from appliance.pose import quaternion
from tests.bundles import FIGURE, WORN, write_show
from tests.console.browser import PHONE, await_box, await_true, observe, opened_context, press, unlock
from tests.console.page import Answer, Page, box_with_page
from tests.system.box import Box
from tests.system.processes import run_bunraku, wait_until

pytestmark = pytest.mark.realtime

NAME, JOINT = WORN["sensor"], FIGURE.index(WORN["joint"])
OTHER, OTHERS_JOINT = "right-wrist", FIGURE.index("rThigh")
UPRIGHT = {"alpha": 100.0, "beta": 90.0, "gamma": 0.0}  # the screen faces somewhere, its top edge is up
TURN_DEGREES = 40.0
NEAR = 0.02  # radians
# Notes each colour of the lamp: a short one may be gone before a test looks.
LAMPS = """window.lamps = [];
  new MutationObserver(() => { lamps.push(document.body.dataset.lamp); })
    .observe(document, { attributes: true, subtree: true, attributeFilter: ["data-lamp"] });
"""
# A phone in a hand measures motion all the time; the page says of one that does not that it lies still.
IN_A_HAND = """setInterval(() => dispatchEvent(new Event("devicemotion")), 50);"""
NO_SOCKETS = """WebSocket = class {
  static OPEN = 1;
  readyState = 3;
  constructor() { setTimeout(() => this.onclose({ code: 1006 })); }
  close() {}
}"""
Stage = tuple[Box, Page, FrameReader]


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    folder = tmp_path_factory.mktemp("phones")
    show = write_show(folder / "show", hands=[WORN, {"sensor": OTHER, "joint": "rThigh"}])
    phones = [{"name": name, "from": "phone"} for name in (NAME, OTHER)]
    settings = {"sensors": {"foreign": phones, "keys": None}}
    with box_with_page(show, folder, settings=settings, has_sensors=False) as (box, page):
        reader = FrameReader(box.runtime)
        yield box, page, reader
        reader.close()


class Phone:
    """A browser with motion sensors, at an address of the box."""

    def __init__(
        self, context: BrowserContext, address: str, script: str = "", motion: str = IN_A_HAND
    ) -> None:
        self.errors: list[str] = []
        context.grant_permissions(["accelerometer", "gyroscope"])
        self.tab: Tab = context.new_page()
        self.tab.on("pageerror", lambda error: self.errors.append(str(error)))
        for one in filter(None, (LAMPS, motion, script)):
            self.tab.add_init_script(one)
        self._sensors: CDPSession = context.new_cdp_session(self.tab)
        self.turn(**UPRIGHT)
        self.tab.goto(address)
        expect(self.tab.locator("#begin")).to_be_enabled()

    def turn(self, **angles: float) -> None:
        """Degrees, as browsers tell them."""
        self._sensors.send("DeviceOrientation.setDeviceOrientationOverride", angles)

    def begin(self, where: str = "left-arm") -> None:
        press(self.tab, f'[data-where="{where}"]')
        press(self.tab, "#begin")

    def see(self, state: str) -> None:
        """The phone is locked, or another app is opened; or this page is back."""
        self.tab.evaluate(
            """(state) => {
              Object.defineProperty(document, "visibilityState", { value: state, configurable: true });
              document.dispatchEvent(new Event("visibilitychange"));
            }""",
            state,
        )

    def await_lamp(self, lamp: str) -> None:
        expect(self.tab.locator("body")).to_have_attribute("data-lamp", lamp)

    def take_neutral_pose(self) -> None:
        """A still phone gives no event: the page sends its last reading again."""
        self.await_lamp("on")
        self.tab.evaluate("lamps.length = 0")
        wait_until(self._asks_for_neutral_pose, "it never asks to stand still")
        self.await_lamp("on")

    def _asks_for_neutral_pose(self) -> bool:
        """A press counts for nothing while the first neutral pose is taken: then it is pressed again."""
        press(self.tab, "#neutral-pose")
        with contextlib.suppress(AssertionError):
            return bool(wait_until(lambda: self.tab.evaluate("lamps.includes('slow')"), patience_s=5.0))
        return False


def invited(page: Page, name: str = NAME) -> str:
    """The address that `bunraku console phone` prints."""
    done = run_bunraku("console", "phone", name, "--box", page.box_file)
    assert done.returncode == 0, done.stderr
    return next(word for word in done.stdout.split() if "/phone#" in word)


def angle(stage: Stage, degrees: float) -> float:
    """Radians between the joint and a turn about the vertical."""
    frame = stage[2].newest(time.monotonic())
    assert frame is not None
    wanted = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.radians(degrees))
    return float(quaternion.angle_between(frame.puppets[0].pose[JOINT], wanted))


def held(stage: Stage, joint: int = JOINT) -> float:
    frame = stage[2].newest(time.monotonic())
    assert frame is not None
    return float(frame.puppets[0].holds[joint])


@pytest.mark.parametrize("script", ["", NO_SOCKETS], ids=["WebSocket", "POST"])
def test_a_phone_holds_a_joint_until_its_page_is_closed(
    context: BrowserContext, stage: Stage, script: str
) -> None:
    phone = Phone(context, invited(stage[1]), script)
    phone.begin()
    phone.take_neutral_pose()
    wait_until(lambda: held(stage) == 1.0)
    phone.turn(**UPRIGHT | {"alpha": UPRIGHT["alpha"] + TURN_DEGREES})
    wait_until(lambda: angle(stage, TURN_DEGREES) < NEAR, lambda: f"{angle(stage, TURN_DEGREES)}")
    phone.take_neutral_pose()
    wait_until(lambda: angle(stage, 0.0) < NEAR, lambda: f"{angle(stage, 0.0)}")
    phone.see("hidden")
    wait_until(lambda: held(stage) < 1.0)
    phone.see("visible")
    wait_until(lambda: held(stage) == 1.0)
    phone.tab.reload()
    phone.begin()
    phone.await_lamp("on")
    assert not phone.errors
    phone.tab.close(run_before_unload=True)
    wait_until(lambda: not stage[1].get("/api/phones").value[0]["taken"])
    wait_until(lambda: held(stage) < 1.0)
    wait_until(lambda: held(stage) == 0.0)


def test_a_phone_without_motion_says_so_and_gives_its_joint_back(
    context: BrowserContext, stage: Stage
) -> None:
    phone = Phone(context, invited(stage[1]), motion="")
    phone.begin()
    wait_until(lambda: held(stage) > 0.0)
    phone.await_lamp("still")
    wait_until(lambda: held(stage) == 0.0)
    phone.turn(**UPRIGHT | {"alpha": UPRIGHT["alpha"] + TURN_DEGREES})
    wait_until(lambda: held(stage) > 0.0)
    phone.tab.close(run_before_unload=True)
    wait_until(lambda: held(stage) == 0.0)


def test_one_phone_is_a_sensor_and_another_takes_its_place_only_when_asked(
    context: BrowserContext, stage: Stage
) -> None:
    page = stage[1]
    address = invited(page)
    first = Phone(context, address)
    first.begin("chest")
    first.await_lamp("on")
    assert context.browser is not None
    other = opened_context(context.browser, **PHONE)
    stranger = Phone(other, address)
    stranger.begin()
    expect(stranger.tab.locator("#phone-said")).to_contain_text(f"Another phone is {NAME} now.")
    press(stranger.tab, "#take-over")
    expect(stranger.tab.locator("#phone-said")).to_contain_text("no longer valid")
    expect(first.tab.locator("#start")).to_be_hidden()
    first.await_lamp("on")
    wait_until(lambda: held(stage) > 0.9, "a used code took the joint away")  # it may still be fading in
    second = Phone(other, invited(page, OTHER))
    second.begin()
    wait_until(lambda: min(held(stage, OTHERS_JOINT), held(stage)) > 0.0)  # both at once
    second.tab.close()
    stranger.tab.fill("#phone-pin", page.pin)
    stranger.begin()
    press(stranger.tab, "#take-over")
    stranger.await_lamp("on")
    expect(first.tab.locator("#start")).to_be_visible()
    expect(first.tab.locator("#phone-said")).to_contain_text(f"Another phone is {NAME} now.")
    stranger.tab.reload()
    assert not first.errors and not stranger.errors
    other.close()


def test_the_technician_s_page_shows_a_code_that_a_phone_reads(context: BrowserContext, stage: Stage) -> None:
    tab = context.new_page()
    tab.goto(stage[1].origin)
    unlock(tab, stage[1])
    press(tab, '[data-page="sensors"]')
    press(tab, "#phones button")
    await_true(tab, "document.querySelector('#phone-qr path')?.getAttribute('d').length > 1000")
    address = tab.locator("#phone-address").inner_text()
    assert f"/phone#{NAME}=" in address and "127.0.0.1" not in address, "no phone reaches that"


def test_without_a_websocket_the_page_asks_for_words_and_frames(
    context: BrowserContext, stage: Stage
) -> None:
    tab = context.new_page()
    tab.add_init_script(NO_SOCKETS)
    tab.goto(stage[1].origin)
    await_box(tab)
    observe(tab)
    press(tab, '[data-page="dance"]')
    await_true(tab, "seen.frames > 20")
    expect(tab.locator("body")).not_to_have_class("silent")


class HeldUpError(Exception):
    """This machine was silent until the box counted the phone as away."""


def unless_held_up(do: Callable[[], None]) -> None:
    """Do it; again where a busy machine was silent for longer than a phone may be."""

    def is_done() -> bool:
        with contextlib.suppress(HeldUpError):
            do()
            return True
        return False

    wait_until(is_done)


class Session:
    """Readings of a phone, one by one."""

    def __init__(self, page: Page, session: str, begun: float) -> None:
        self.page, self.session, self._said_at = page, session, begun

    def post(self, t: Any, **message: Any) -> Answer:
        said_before, self._said_at = self._said_at, time.monotonic()
        reading = {"session": self.session, "t": t, "turned": [0, 90, 0], **message}
        answer = self.page.post("/api/phones/reading", reading)
        if answer.status == 410 and time.monotonic() - said_before > AWAY_S:
            raise HeldUpError
        return answer


def joined(page: Page) -> Session:
    begun, joining = time.monotonic(), {"name": NAME, "where": "hand", "take_over": True}
    return Session(page, page.post("/api/phones/join", joining).value["session"], begun)


def test_a_phone_that_sends_nonsense_is_counted_and_holds_nothing(stage: Stage) -> None:
    stage[1].unlock()
    unless_held_up(lambda: send_nonsense(stage))
    stage[1].cookie = ""


def send_nonsense(stage: Stage) -> None:
    page = stage[1]
    phone = joined(page)
    counted = page.get("/api/phones").value[0]["counts"].get("no_numbers", 0)
    sent = 0.0

    def send(**message: Any) -> Any:
        nonlocal sent
        sent += 20.0
        answer = phone.post(**{"t": sent, **message})
        return answer.value["said"] if answer.status == 200 else answer.status

    assert send() == ""
    for turned in (
        [None] * 3,
        [0, 0],
        [0, 0, "1"],
        [1e9, 0, 0],
        [10**400, 0, 0],
        {"a": 1},
        "x",
        [True, 0, 0],
    ):
        assert send(turned=turned) == "no_numbers", turned
    assert page.post("/api/phones/reading", b'{"t": NaN}').status == 400
    assert send(t=None) == "no_numbers"
    assert send(t=sent - 10) == "", "it was overtaken"
    sent = -1e6
    assert send() == "clock_back" and send() == ""
    assert send(session="0" * 32) == 410 and send(session="") == 410 and send(session=5) == 410
    assert page.get("/api/phones").value[0]["counts"]["no_numbers"] == counted + 9
    wait_until(
        lambda: any(
            one["name"] == "phone-refused" and NAME in one["message"] for one in page.status()["fallbacks"]
        )
    )
    page.post("/api/phones/leave", {"session": phone.session})
    wait_until(lambda: held(stage) == 0.0)


FLOOD = """async (session) => {
  const socket = new WebSocket(`ws://${location.host}/api/phones/live`);
  await new Promise((opened) => { socket.onopen = opened; });
  for (let t = 1; t <= 10000; t++) socket.send(JSON.stringify({ session, t, turned: [0, 90, 0] }));
  return new Promise((over) => {
    socket.onmessage = ({ data }) => { if (data.includes("too_fast")) over(); };
  });
}"""


def test_ten_thousand_readings_at_once_are_counted_and_the_hand_stays(
    context: BrowserContext, stage: Stage
) -> None:
    tab = context.new_page()
    tab.goto(stage[1].origin)
    stage[1].unlock()
    unless_held_up(lambda: flood(tab, stage[1]))
    stage[1].cookie = ""


def flood(tab: Tab, page: Page) -> None:
    """The phone speaks as it should all the while."""

    def too_fast() -> int:
        return int(page.get("/api/phones").value[0]["counts"].get("too_fast", 0))

    counted, phone, is_over = too_fast(), joined(page), threading.Event()
    answers: list[int] = []

    def speak() -> None:
        while not is_over.wait(0.05):
            answers.append(phone.post(20000 + len(answers)).status)

    with ThreadPoolExecutor(1) as beside:
        speaking = beside.submit(speak)
        try:
            tab.evaluate(FLOOD, phone.session)
            wait_until(lambda: too_fast() > counted + 5000 or speaking.done())
        finally:
            is_over.set()
        speaking.result()
    assert set(answers) == {200}, "one flood ended the session"


def test_a_phone_needs_the_pin_or_its_code(stage: Stage) -> None:
    page = stage[1]
    page.cookie = ""
    joining = {"name": NAME, "where": "hand", "take_over": True}
    assert page.post("/api/phones/join", joining).status == 401
    assert page.post("/api/phones/code", {"name": NAME}).status == 401
    assert page.post("/api/phones/join", {**joining, "name": "head"}).status == 404
    for where in ("foot", ["hand"], {}, None):
        assert page.post("/api/phones/join", {**joining, "where": where}).status == 400, where
    answers = [page.post("/api/phones/join", {**joining, "code": "x" * 10}).status for _ in range(7)]
    assert answers[0] == 403 and answers[-1] == 429
