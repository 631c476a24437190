"""The command line that starts another process of the box with this Python."""

from __future__ import annotations

import sys

BUNRAKU = (sys.executable, "-m", "appliance.cli")
