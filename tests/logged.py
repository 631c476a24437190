"""What the product has logged: `said` has the sentences of the test that runs, in their order."""

from __future__ import annotations

import logging

from appliance.box.log import OURS

said: list[str] = []


class _Listing(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        said.append(record.getMessage())


logging.getLogger(OURS).addHandler(_Listing())
