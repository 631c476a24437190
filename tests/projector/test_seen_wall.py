"""Pictures of the wall for the page: every ten seconds, every two while somebody looks."""

from __future__ import annotations

from pathlib import Path

from appliance.box.wall_file import ASKED, EVERY_S, SOON_S, WALL, ask_for_wall, wall_picture
from appliance.projector.seen_wall import SeenWall
from tests.system.processes import wait_until


def test_pictures_come_sooner_while_somebody_looks(tmp_path: Path) -> None:
    seen, read = SeenWall(tmp_path), []

    def offer(now: float) -> int:
        """How many pictures were read by then."""
        seen.offer(now, (4, 4), lambda: read.append(now) or bytes(64))
        wait_until(lambda: seen._writing is None or not seen._writing.is_alive())
        return len(read)

    assert [offer(0.0), offer(SOON_S + 0.1), offer(EVERY_S + 0.1)] == [1, 1, 2]
    ask_for_wall(tmp_path)
    now = 2 * EVERY_S
    assert [offer(now), offer(now + SOON_S / 2), offer(now + SOON_S + 0.1)] == [3, 3, 4]
    (tmp_path / ASKED).unlink()
    assert offer(now + 2 * SOON_S + 0.2) == 4
    assert wall_picture(tmp_path, (tmp_path / WALL).stat().st_mtime)
    seen.close()
