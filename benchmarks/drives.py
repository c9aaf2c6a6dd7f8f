"""The drives that are measured on."""

from lfd_replay.generated.car_following import following_truth

__all__ = ["following_truth"]
