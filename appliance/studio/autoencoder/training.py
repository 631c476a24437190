"""The training loop of the adversarial autoencoder, read top to bottom; seeded and resumable."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from appliance.studio.autoencoder import losses, motion_critic, rotation
from appliance.studio.autoencoder.answers import Answers, AnswerSettings, held_weights
from appliance.studio.autoencoder.architectures import DEFAULT, build
from appliance.studio.autoencoder.autoencoder import Autoencoder, PriorCritic
from appliance.studio.autoencoder.batches import Batch, Batches, Copies, HeldTargets
from appliance.studio.autoencoder.coupled import LEARNED_BODY, Coupled, share_of_pass
from appliance.studio.autoencoder.motion_critic import MotionCritic, Sequences
from appliance.studio.autoencoder.networks import Mlp
from appliance.studio.autoencoder.repertoire import Nearness
from appliance.studio.data.dataset import WINDOW, Dataset, window_starts, windows
from appliance.studio.processes import Processes
from appliance.studio.training_loop import ALONE, TrainingLoop

FEW_TAKES = 4
ADVERSARIAL_BETAS = (0.5, 0.99)  # momentum of Adam, where two networks learn against each other
SAMPLED_PLACES = 4096  # windows, to measure where the dancer's joints are
PLACED = 64  # windows of a step from which the place encoder learns
HAND_PACE = 2.0  # factor on the hand encoder's learning rate: it follows answers, not only the critic
SAMPLED_SEQUENCES = 500  # to measure how the dancer moves
_NO_LONGER_SETTINGS = ("betas",)  # in older checkpoints; nothing read it
SHORTEST_REACH = 0.04  # share of the longest reach that a joint without a bone below it counts as


@dataclass(frozen=True)
class Settings:
    """How to train. minutes bounds the wall time and paces the learning rate, unless steps is given."""

    model: str = "puppet"  # see models.py
    network: str = DEFAULT
    window: int = WINDOW  # poses; the box dances windows of 8, others are for the studio
    variational: bool = False
    latent: int = 0
    width: int = 0
    depth: int = 0
    seed: int = 1
    minutes: float = 45.0
    steps: int = 0
    batch: int = 256
    learning_rate: float = 1e-3
    critic_learning_rate: float = 5e-4
    smoothing: float = 0.999  # decay of the averaged weights
    latent_noise: float = 0.05  # standard deviation; neighbouring latents must decode to neighbouring poses
    input_noise_degrees: float = 0.0
    mixed: bool = True  # precision, on a GPU
    mirror: bool = True
    critic_every: int = 2  # steps; the prior moves slowly
    sequences: int = 20  # dances that the motion critic sees in a step; 0: there is no critic
    passes: int = 10  # at most; the last pass has no hands
    free_sequences: float = 0.4  # share without a hand; half of these wander, coded again and again
    alive_from: float = 0.25  # share of the training after which the network follows the motion critic
    motion_learning_rate: float = 4e-4
    weights: losses.LossWeights = field(default_factory=losses.LossWeights)
    answers: AnswerSettings = field(default_factory=AnswerSettings)

    @property
    def hop(self) -> int:
        """Frames between two training windows: neighbours of long ones differ little."""
        return max(1, self.window // 16)

    @staticmethod
    def from_state(saved: Mapping[str, Any]) -> Settings:
        """The settings of a checkpoint."""
        answers = {**saved["answers"], "nearness": Nearness(**saved["answers"]["nearness"])}
        parts = {"weights": losses.LossWeights(**saved["weights"]), "answers": AnswerSettings(**answers)}
        kept = {name: value for name, value in saved.items() if name not in _NO_LONGER_SETTINGS}
        return Settings(**{**kept, **parts})


@dataclass
class Report:
    """A line of the training's history."""

    step: int
    seconds: float
    fraction: float
    losses: dict[str, float]
    held_out_degrees: float | None = None


class Training(TrainingLoop[Report]):
    """State of a training: networks, optimisers, averages, history."""

    report_type = Report
    saved: tuple[str, ...] = ("autoencoder", "averaged", "critic", "optimizer", "critic_optimizer")

    def __init__(
        self,
        dataset: Dataset,
        settings: Settings,
        device: str = "cpu",
        processes: Processes = ALONE,
        start: Autoencoder | None = None,
    ) -> None:
        """start: a network of the settings' architecture and sizes that the training goes on from."""
        super().__init__(settings, processes, torch.device(device))
        torch.manual_seed(settings.seed)
        self.settings, self.dataset = settings, dataset
        still = dataset.still_pose()
        rest = torch.tensor(still[list(dataset.moving)])
        network, shape = build(
            settings.network,
            settings.window,
            len(dataset.moving),
            settings.variational,
            latent=settings.latent,
            width=settings.width,
            depth=settings.depth,
        )
        self.autoencoder = Autoencoder(network, shape, rest).to(self.device)
        network.start_at(rest.float().flatten().to(self.device))
        if start is not None:
            self.autoencoder.load_state_dict(start.state_dict())
        bones = rotation.moving_bones(dataset.skeleton, dataset.moving, torch.tensor(still))
        self.body = rotation.MovingSkeleton(bones).to(self.device)
        mirror = settings.mirror and dataset.mirrors
        self.train_windows = self._training_windows(mirror)
        if isinstance(network, Coupled):
            network.places.set_bones(bones)
            if start is None:
                network.places.measure(self._places(self._some_windows(SAMPLED_PLACES)))
        self._can_be_placed = torch.tensor([float(parent >= 0) for parent in bones.parents]).to(self.device)
        self.averaged = copy.deepcopy(self.autoencoder).requires_grad_(False).eval()
        self.critic = PriorCritic(shape.latent).to(self.device)
        self.held_windows = torch.tensor(
            windows(dataset.held_out, dataset.moving, window=settings.window, hop=settings.hop)
        ).to(self.device)
        betas = ADVERSARIAL_BETAS if isinstance(network, Coupled) else (0.9, 0.999)
        hands: list[torch.nn.Parameter] = []
        if isinstance(network, Coupled):
            hands = [*network.hands.parameters(), *network.places.parameters()]
        of_hands = {id(parameter) for parameter in hands}
        others = [each for each in self.autoencoder.parameters() if id(each) not in of_hands]
        groups = [{"params": others, "pace": 1.0}, {"params": hands, "pace": HAND_PACE}]
        self.optimizer = torch.optim.Adam(
            [group for group in groups if group["params"]], lr=settings.learning_rate, betas=betas, fused=True
        )
        self.critic_optimizer = torch.optim.Adam(
            self.critic.parameters(), lr=settings.critic_learning_rate, betas=(0.5, 0.999), fused=True
        )
        chances = self.holding_chances()
        if isinstance(network, Coupled):
            own, takes = self._own_windows(mirror)
            answers = Answers(self.train_windows, own, takes, chances, settings.answers)
            self.batches: Batches = answers
        else:
            self.batches = Copies(self.train_windows, settings.input_noise_degrees, processes)
        self._chances = chances
        self.sequences: Sequences | None = None
        is_seen = settings.sequences and motion_critic.blended_poses(settings.window) >= 3
        if isinstance(network, Coupled) and is_seen:
            sequences = Sequences(dataset, settings.window, self.device)
            if len(sequences):
                self._let_motion_be_seen(sequences)
        self._go_apart()
        self._critic_loss = torch.zeros((), device=self.device)

    def report(self, means: Mapping[str, float]) -> Report:
        return Report(self.step, self.seconds, self.fraction, dict(means), self.held_out_degrees())

    def train_step(self) -> dict[str, Tensor]:
        """One step of the critic and one of the autoencoder on a random batch."""
        settings = self.settings
        self._pace_learning()
        total = torch.zeros((), device=self.device)
        reported: dict[str, Tensor] = {}
        latents = []
        for batch in self.batches.draw(settings.batch // self.processes.count):
            coded, parts = self._pull(batch, batch.hands) if batch.hands else self._code(batch)
            for name, part in parts.items():
                total = total + getattr(settings.weights, name) * part
                reported[name] = part
            latents.append(coded)
        coded = torch.cat(latents)
        if self.sequences is not None:
            loss, parts = self._see_motion(self.sequences)
            total, reported = total + loss, reported | parts
        if settings.weights.prior:
            if self.step % settings.critic_every == 0:
                self._critic_loss = self._train_critic(coded)
            prior = losses.prior_loss(self.critic, coded)
            total = total + settings.weights.prior * prior
            reported |= {"prior": prior, "critic": self._critic_loss}
        self._descend(total, self.optimizer, self.autoencoder)
        self._average_weights(self.averaged, self.autoencoder)
        self.step += 1
        with torch.no_grad():
            reported |= {"latent_mean": coded.mean(0).abs().mean(), "latent_std": coded.std(0).mean()}
        return {name: part.detach() for name, part in reported.items()}

    def _code(self, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        """Code a batch once: latents (B, Z), and the losses.

        The decoder sees noisy latents, or samples of a variational network's; those that are returned, for
        the critic, have no noise.
        """
        windows, parts = batch.windows, {}
        if self.settings.variational:
            with self.mixed:
                coded, log_variance = self.autoencoder.encode_gaussian(windows)
            coded, log_variance = coded.float(), log_variance.float()
            parts["divergence"] = losses.divergence(coded, log_variance)
            seen = coded + torch.exp(0.5 * log_variance) * self.processes.noise(coded)
        else:
            with self.mixed:
                coded = self.autoencoder.encode(windows)
            coded = coded.float()
            seen = coded + self.settings.latent_noise * self.processes.noise(coded)
        with self.mixed:
            raw = self.autoencoder.decode_raw(seen).float()
        if isinstance(self.autoencoder.network, Coupled):
            parts["place"] = self._place_loss(windows[:PLACED], coded[:PLACED])
        parts.update(losses.reconstruction_losses(raw, batch.answer, self.body, self.settings.weights))
        return coded, parts

    def _place_loss(self, windows: Tensor, coded: Tensor) -> Tensor:
        """How far latents (B, Z) are from what the places of one to three joints of windows say of them; only
        the place encoder learns from it.
        """
        network = self.autoencoder.network
        assert isinstance(network, Coupled)
        chances = self._can_be_placed.clamp_min(1e-6)  # a small body has fewer joints than hands
        held = held_weights(len(windows), chances, 0.0) * self._can_be_placed
        with self.mixed:
            guess = network.places(self._places(windows), held).float()
        loss: Tensor = (guess - coded.detach()).square().mean()
        return loss

    @torch.no_grad()
    def _places(self, windows: Tensor) -> Tensor:
        """Places (B, M, 3) of the joints of heading-free windows (B, T, M, 4)."""
        network = self.autoencoder.network
        assert isinstance(network, Coupled)
        return network.places.seen(self.body(windows))

    def _some_windows(self, sample: int) -> Tensor:
        """Training windows, evenly from all takes."""
        rows = torch.linspace(0, len(self.train_windows) - 1, min(sample, len(self.train_windows))).long()
        return self.train_windows[rows]

    def _pull(self, batch: Batch, hands: HeldTargets) -> tuple[Tensor, dict[str, Tensor]]:
        """Latents (B, Z) of a batch, and how far the hands' pulls are from where the answers lie."""
        network = self.autoencoder.network
        assert isinstance(network, Coupled)
        with self.mixed:
            coded = self.autoencoder.encode(batch.windows).float()
            with torch.no_grad():
                way = self.autoencoder.encode(batch.answer).float() - coded
            held = (hands.held > 0).float()
            there, here = network.difference(coded.detach(), batch.windows, hands.goal, held)
        return coded, {"pull": ((there - here).float() - way).square().mean()}

    def _led(self, windows: Tensor, hands: HeldTargets, passes: int) -> Tensor:
        """Heading-free windows (B, T, M, 4) after passes in which the hands hold their joints."""
        network = self.autoencoder.network
        assert isinstance(network, Coupled)
        start, lively = windows, windows.new_ones(len(windows))
        is_held = hands.held > 0
        goal = torch.where(is_held[:, None, :, None], hands.goal, start)
        with self.mixed:
            latents, pasted = self.autoencoder.encode(torch.cat([start, goal])).chunk(2)
            coded, held, noise = (latents, pasted), is_held.float(), torch.zeros_like(latents)
            pull = network.pull(coded, start, goal, held, lively, noise, LEARNED_BODY)
            for number in range(passes):
                if number:
                    latents = self.autoencoder.encode(windows)
                raw = self.autoencoder.decode_raw(latents + share_of_pass(number) * pull)
                windows = rotation.normalize(raw.float())
        return windows

    def _let_motion_be_seen(self, sequences: Sequences) -> None:
        """Add the motion critic, which no other kind of training has, nor its checkpoint."""
        settings = self.settings
        poses = motion_critic.blended_poses(settings.window)
        self.sequences = sequences
        self.motion_critic = MotionCritic(self.autoencoder.shape.joints, poses).to(self.device)
        self.motion_optimizer = torch.optim.Adam(
            self.motion_critic.parameters(),
            lr=settings.motion_learning_rate,
            betas=ADVERSARIAL_BETAS,
            fused=True,
        )
        known = motion_critic.blended(sequences.draw(SAMPLED_SEQUENCES).windows)
        self.motion_critic.measure(motion_critic.level(known)[0])
        self.saved = (*self.saved, "motion_critic", "motion_optimizer")

    def _see_motion(self, sequences: Sequences) -> tuple[Tensor, dict[str, Tensor]]:
        """One step of the motion critic, and the network's loss for what it says of dances with hands."""
        settings, weights = self.settings, self.settings.weights
        count = max(2, settings.sequences // self.processes.count)
        dances, hands, real = sequences.draw(count), sequences.draw(count), sequences.draw(2 * count)
        free = round(count * settings.free_sequences)
        wandering = sequences.wandering(free // 2)
        dances.windows[: free // 2] = wandering.windows
        held = motion_critic.draw_hands(count, self._chances, free)
        held_real = motion_critic.draw_hands(2 * count, self._chances, 2 * free)
        passes = motion_critic.draw_passes(settings.passes)
        goal = hands.as_hands_of(dances.windows)
        whole = self._danced(dances.windows.flatten(0, 1), goal.flatten(0, 1), held, passes)
        danced = whole.view_as(dances.windows)
        wandering.go_on(danced[: free // 2], passes)
        motion, target = motion_critic.level(motion_critic.blended(danced), motion_critic.middle_target(goal))
        features = self.motion_critic.features(motion, target, held)
        own = motion_critic.level(
            motion_critic.blended(real.windows), motion_critic.middle_target(real.targets)
        )
        true = self.motion_critic.features(*own, held_real)
        with_penalty = self.step % motion_critic.PENALTY_EVERY == 0
        judged = motion_critic.critic_loss(self.motion_critic, true, features, with_penalty)
        self._descend(judged, self.motion_optimizer)
        alive = motion_critic.alive_loss(self.motion_critic, features)
        off_hand = motion_critic.off_hand_loss(motion, target, held)
        grown = min(max(self.fraction - settings.alive_from, 0.0) / 0.05, 1.0) if settings.alive_from else 1.0
        loss = grown * weights.alive * alive + weights.off_hand * off_hand
        return loss, {"alive": alive, "off_hand": off_hand, "motion_critic": judged}

    def _danced(self, windows: Tensor, goal: Tensor, held: Tensor, passes: int) -> Tensor:
        """Windows (B * W, T, M, 4), goal alike, with headings, danced as on stage; held (B, M)."""
        autoencoder = self.autoencoder
        facing = autoencoder.facing(windows)
        start = autoencoder.without_heading(windows, facing)
        each = held.repeat_interleave(len(windows) // len(held), dim=0)
        x = self._led(start, HeldTargets(autoencoder.without_heading(goal, facing), each), passes - 1)
        with self.mixed:
            x = rotation.normalize(autoencoder.decode_raw(autoencoder.encode(x)).float())
        return autoencoder.with_heading(x, facing)

    def _train_critic(self, latents: Tensor) -> Tensor:
        loss = losses.critic_loss(self.critic, latents, self.processes.noise(latents))
        self._descend(loss, self.critic_optimizer)
        return loss.detach()

    def holding_chances(self) -> Tensor:
        """(M,): relative frequency with which each joint is held: the more of the body hangs on it, the more.

        A head or hand whose bone has no end in the file counts as short, so that it is learned too.
        """
        reach = self.dataset.skeleton.reaches[list(self.dataset.moving)]
        share = np.maximum(reach / max(float(reach.max()), 1e-9), SHORTEST_REACH)
        return torch.tensor(np.sqrt(share), dtype=torch.float32, device=self.device)

    @torch.no_grad()
    def held_out_degrees(self, sample: int = 2048) -> float | None:
        """Mean joint angle error in degrees of the averaged network on windows of held-out takes."""
        if not len(self.held_windows):
            return None
        rows = torch.linspace(0, len(self.held_windows) - 1, min(sample, len(self.held_windows))).long()
        batch = self.held_windows[rows]
        made, _ = self.averaged.iterate(batch, 1)
        return math.degrees(float(rotation.angle_between(made, batch).mean()))

    @torch.no_grad()
    def latent_moments(self, sample: int = 8192) -> tuple[Tensor, Tensor]:
        """Mean and standard deviation (Z,) of the averaged network's latents of the training windows."""
        latents = self.averaged.encode(self._some_windows(sample))
        return latents.mean(0), latents.std(0).clamp_min(1e-3)

    def state(self) -> dict[str, Any]:
        """Everything that a resumed training needs, and the latent moments that load_autoencoder removes."""
        return {
            **self._shared_state(),
            "settings": asdict(self.settings),
            "joints": list(self.dataset.moving_names),
            "shape": asdict(self.autoencoder.shape),
            "random_gpu": torch.cuda.get_rng_state(self.device) if self.device.type == "cuda" else None,
            "latent_moments": self.latent_moments(),
            "batches": self.batches.state(),
            "sequences": {} if self.sequences is None else self.sequences.state(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        super().restore(state)
        self.batches.restore(state["batches"])
        if self.sequences is not None:
            self.sequences.restore(state["sequences"])
        if self.device.type == "cuda" and state.get("random_gpu") is not None:
            torch.cuda.set_rng_state(state["random_gpu"].cpu(), self.device)
        self._go_apart()

    def _go_apart(self) -> None:
        """When batches contain simulated hands, each rank is seeded differently: building a batch costs more
        than the step. All other random numbers are the same in all ranks, and each takes its share.
        """
        if isinstance(self.batches, Answers) and not self.processes.leads:
            torch.manual_seed(1_000_003 * (self.step + 1) + 1009 * self.settings.seed + self.processes.rank)

    def _training_windows(self, mirror: bool) -> Tensor:
        """(N, T, M, 4): heading-free windows to learn from, of each take its mirror image too if wanted."""
        settings, dataset = self.settings, self.dataset
        poses = windows(dataset.training, dataset.moving, mirror, settings.window, settings.hop)
        found, network = torch.from_numpy(poses).to(self.device), self.autoencoder
        for part in torch.split(found, 4096):  # in place: an hour of dance has a gigabyte of windows
            part.copy_(network.without_heading(part, network.facing(part)))
        return found

    def _own_windows(self, mirror: bool) -> tuple[Tensor, Tensor]:
        """Those of the training windows that are no mirror images, and the numbers of their takes (N,).

        Each of a few takes is counted as several, so that a window is answered by what it is not part of.
        """
        settings, takes = self.settings, self.dataset.training
        counts = [len(window_starts(take, settings.hop, settings.window)) for take in takes]
        names = sorted({take.take for take in takes})
        parts = 1 if len(names) >= FEW_TAKES else FEW_TAKES
        numbers = [
            names.index(take.take) * parts + torch.arange(count, device=self.device) * parts // max(count, 1)
            for take, count in zip(takes, counts, strict=True)
        ]
        windows = torch.split(self.train_windows, [count for count in counts for _ in range(1 + mirror)])
        return torch.cat(windows[:: 1 + mirror]), torch.cat(numbers)

    def _pace_learning(self) -> None:
        warm = min(1.0, (self.step + 1) / 200)
        cosine = self._cosine()
        for group in self.optimizer.param_groups:
            group["lr"] = group["pace"] * self.settings.learning_rate * warm * max(cosine, 0.005)
        for group in self.critic_optimizer.param_groups:
            group["lr"] = self.settings.critic_learning_rate * max(cosine, 0.1)
        if self.sequences is not None:
            for group in self.motion_optimizer.param_groups:
                group["lr"] = self.settings.motion_learning_rate * max(cosine, 0.1)


def load_autoencoder(path: Path) -> tuple[Autoencoder, list[str], dict[str, Any]]:
    """The averaged network of a checkpoint, its joint names, and the whole state.

    The critic shapes the latents, but other losses keep their mean and scale some tenths off the prior's; the
    rest is removed here exactly, without a change to any window.
    """
    state = torch.load(path, map_location="cpu", weights_only=True)
    shape = dict(state["shape"])
    network, built = build(state["settings"]["network"], shape.pop("window"), shape.pop("joints"), **shape)
    autoencoder = Autoencoder(network, built, torch.zeros(built.joints, 4))
    autoencoder.load_state_dict(state["averaged"])
    if isinstance(network, Mlp):
        network.standardise(*state["latent_moments"])
    return autoencoder.requires_grad_(False).eval(), state["joints"], state
