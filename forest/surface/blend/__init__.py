"""The tree's surface as one blended whole (Hart & Baker 2003, sections 5.1 and 5.2)."""
