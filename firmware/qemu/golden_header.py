"""Writes the golden packets as a C++ header, for a processor that reads no files.

Usage: golden_header.py tests/golden/wire.json OUTPUT
"""

from __future__ import annotations

import json
import sys
from pathlib import Path


def header(golden: Path) -> str:
    vectors = json.loads(golden.read_text())
    lines = [
        "// The golden packets. Made from tests/golden/wire.json.",
        "#pragma once",
        "",
        "#include <stdint.h>",
        "",
        "struct Golden {",
        "  const char* packet;",
        "  uint8_t count;",
        "  uint8_t datagram[80];",
        "};",
        "",
        f"constexpr uint32_t kGoldenHash = {vectors['wire_hash']}u;",
        f"constexpr uint8_t kGoldenKey[] = {braced(vectors['key'])};",
        "constexpr Golden kGolden[] = {",
    ]
    for vector in vectors["packets"]:
        datagram = vector["datagram"]
        lines.append(f'    {{"{vector["packet"]}", {len(datagram) // 2}, {braced(datagram)}}},')
    return "\n".join([*lines, "};", ""])


def braced(digits: str) -> str:
    return "{" + ", ".join(f"0x{byte:02x}" for byte in bytes.fromhex(digits)) + "}"


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(header(Path(sys.argv[1])))
