"""Which joints are held, where, and how firmly: what the interactive passes of the iteration bring about."""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeVar

Values = TypeVar("Values")  # torch tensors or numpy arrays


class HeldJoints(NamedTuple, Generic[Values]):
    """For M joints in windows of T poses.

    mask (M,): which are held; targets (B, T, M, 4): one orientation for each pose of each window; weights
    (M,), 0 to 1: how firmly. For all windows alike: targets (T, M, 4); a different hold for each: weights
    (B, M).
    """

    mask: Values
    targets: Values
    weights: Values


class HeldPlaces(NamedTuple, Generic[Values]):
    """Joints that are held at places, by hands that ask for no orientation.

    places (B, M, 3): metres from the root joint, without the heading of the window's middle pose (+Z ahead);
    weights (B, M), 0 to 1: how firmly, 0 of a joint that is not held. For all windows alike: (M, 3), (M,).
    """

    places: Values
    weights: Values
