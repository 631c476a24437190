"""The processes of one training, which `torchrun` starts: each takes its share of a batch.

PyTorch's launcher numbers the processes in the environment (RANK, LOCAL_RANK, WORLD_SIZE). Without it there
is one process, and nothing here costs anything.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import Tensor, distributed, nn

SILENCE = timedelta(minutes=10)  # the slowest step, with the report after it, takes less


@dataclass(frozen=True)
class Processes:
    """rank: of this process, 0 to count - 1; the first one leads: only it writes, prints, tells the time."""

    rank: int = 0
    count: int = 1

    @property
    def leads(self) -> bool:
        return self.rank == 0

    def share(self, rows: Tensor) -> Tensor:
        """Every count-th row, of rows that all processes drew alike: together they are the whole batch."""
        return rows if self.count == 1 else rows[self.rank :: self.count]

    def noise(self, like: Tensor) -> Tensor:
        """Standard Gaussian noise of that shape: this process's rows of what one process would draw."""
        rows = self.count * len(like)
        return self.share(torch.randn(rows, *like.shape[1:], dtype=like.dtype, device=like.device))

    def average_gradients(self, parameters: Iterable[nn.Parameter]) -> None:
        """Replace gradients by their mean over all processes."""
        if self.count == 1:
            return
        gradients = [one.grad for one in parameters if one.grad is not None]
        together = self.mean(torch.cat([one.flatten() for one in gradients]))
        parts = torch.split(together, [one.numel() for one in gradients])
        for one, mean in zip(gradients, parts, strict=True):
            one.copy_(mean.view_as(one))

    def mean(self, values: Tensor) -> Tensor:
        """Values of the same shape in all processes -> their mean."""
        if self.count == 1:
            return values
        together = values.to(_device())
        distributed.all_reduce(together)
        return (together / self.count).to(values.device)

    def agreed(self, value: float) -> float:
        """The leading process's value: clocks and signals differ, and all must stop after the same step."""
        if self.count == 1:
            return value
        reported = torch.tensor(value, dtype=torch.float64, device=_device())
        distributed.broadcast(reported, 0)
        return float(reported)


@contextmanager
def joined(device: str) -> Iterator[Processes]:
    """The processes that torchrun started, connected: through NCCL on GPUs, else through gloo.

    device: cpu or cuda; each process takes the GPU of its local rank.
    """
    count = int(os.environ.get("WORLD_SIZE", "1"))
    if count == 1:
        yield Processes()
        return
    if device == "cuda":
        torch.cuda.set_device(int(os.environ["LOCAL_RANK"]))
    distributed.init_process_group("nccl" if device == "cuda" else "gloo", timeout=SILENCE)
    try:
        yield Processes(distributed.get_rank(), count)
    finally:
        distributed.destroy_process_group()


def _device() -> torch.device:
    on_gpu = distributed.get_backend() == "nccl"
    return torch.device("cuda", torch.cuda.current_device()) if on_gpu else torch.device("cpu")
