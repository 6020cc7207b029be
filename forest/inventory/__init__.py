"""A stand that starts from measured trees: a nursery grows models of them, which are fitted."""

from forest.inventory.settling import Built, settle

__all__ = ["Built", "settle"]
