"""The picture by NDI: what NDI's library is given, by a double of it in C with the structs of NDI's SDK."""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Iterator
from ctypes.util import find_library
from pathlib import Path

import pytest

from appliance.projector.stream.feed import AGAIN_S, Feed
from appliance.show.stream import StreamConfig
from hw_sim.peers import free_ports
from tests.logged import said
from tests.projector.test_stream import connected

WITHIN_S = 60.0
RED_OVER_DARK_BLUE = bytes([0, 0, 100, 7, 255, 0, 0, 7])  # bottom row first
LIBRARY = r"""
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
typedef struct { const char *name, *groups; bool clock_video, clock_audio; } create_t;
typedef struct {
    int xres, yres, four_cc, rate_n, rate_d; float aspect; int format; int64_t timecode;
    uint8_t *data; int stride; const char *metadata; int64_t timestamp;
} frame_t;
bool NDIlib_initialize(void) { return true; }
void *NDIlib_send_create(const create_t *c) {
    FILE *told = fopen(getenv("NDI_DOUBLE"), "w");
    fprintf(told, "%s %d%d\n", c->name, c->clock_video, c->clock_audio);
    return told;
}
int NDIlib_send_get_no_connections(void *told, uint32_t wait_ms) { return 1; }
void NDIlib_send_send_video_v2(void *told, const frame_t *f) {
    fprintf(told, "%dx%d %.4s %d/%d %d %d ", f->xres, f->yres, (const char *)&f->four_cc, f->rate_n,
            f->rate_d, f->format, f->timecode == INT64_MAX);
    for (int at = 0; at < f->yres * f->stride; at++) fprintf(told, "%02x", f->data[at]);
    fprintf(told, "\n");
    fflush(told);
    while (getenv("NDI_HANGS")) sleep(1);
}
"""


@pytest.fixture
def reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """What the library was given, a line each."""
    (tmp_path / "ndi.c").write_text(LIBRARY)
    made = ["cc", "-shared", "-fPIC", "-o", tmp_path / "libndi.so.6", tmp_path / "ndi.c"]
    subprocess.run(made, check=True)
    monkeypatch.setenv("NDI_RUNTIME_DIR_V6", str(tmp_path))
    monkeypatch.setenv("NDI_DOUBLE", str(tmp_path / "told"))
    yield tmp_path / "told"


@pytest.mark.parametrize(
    ("has_alpha", "pixels"),
    [(False, "RGBX 25/1 1 1 ff000007000064"), (True, "RGBA 25/1 1 1 ff0000ff0000ff64")],
)
def test_receivers_get_the_upright_picture(reported: Path, has_alpha: bool, pixels: str) -> None:
    port = free_ports(1, socket.SOCK_STREAM)[0]
    feed = Feed(StreamConfig(port=port, ndi="Bunraku", ndi_alpha=has_alpha))
    until = time.monotonic() + WITHIN_S
    lines: list[str] = []
    while len(lines) < 3:
        assert time.monotonic() < until
        feed.offer(time.monotonic(), (1, 2), lambda: RED_OVER_DARK_BLUE)
        time.sleep(0.01)
        lines = reported.read_text().splitlines() if reported.exists() else []
    feed.close()
    assert not said and lines[0] == "Bunraku 00"
    assert lines[1].startswith(f"1x2 {pixels}")


def test_a_library_that_never_returns_is_started_again_and_no_picture_waits(
    reported: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The receiver's network is gone in the middle of a picture; later it is back."""
    monkeypatch.setenv("NDI_HANGS", "1")
    feed = Feed(StreamConfig(port=free_ports(1, socket.SOCK_STREAM)[0], ndi="Bunraku"))
    until, longest_s = time.monotonic() + WITHIN_S, 0.0
    while not reported.exists() or reported.read_text().count("\n") < 3:
        began = time.monotonic()
        assert began < until
        feed.offer(began, (1, 2), lambda: RED_OVER_DARK_BLUE)
        if reported.exists() and reported.read_text().count("\n") == 2:  # it hangs with its first picture
            monkeypatch.delenv("NDI_HANGS", raising=False)
            longest_s = max(longest_s, time.monotonic() - began)
        time.sleep(0.01)
    feed.close()
    assert len(said) == 1 and "has ended, or hung" in said[0]
    assert longest_s < AGAIN_S, "no picture waits for the library"


@pytest.mark.skipif(find_library("ndi") is not None, reason="NDI's library is installed here")
def test_without_the_library_it_is_told_and_http_goes_on(capfd: pytest.CaptureFixture[str]) -> None:
    port = free_ports(1, socket.SOCK_STREAM)[0]
    feed = Feed(StreamConfig(port=port, ndi="Bunraku"))
    feed.offer(time.monotonic(), (1, 1), lambda: bytes(4))
    connected(port, "/").close()  # it listens
    feed.close()
    assert not said
    assert "does not go out by NDI: there is no libndi on this machine" in capfd.readouterr().err
