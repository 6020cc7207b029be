"""A stand that is grown, looked at and worked on as it grows, without any screen."""

from forest.live.session import LiveSession

__all__ = ["LiveSession"]
