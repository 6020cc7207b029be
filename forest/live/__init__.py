"""A stand that is grown, looked at and worked on as it grows, without any screen."""

from forest.live.session import LiveSession
from forest.live.taking_up import take_up

__all__ = ["LiveSession", "take_up"]
