"""What people do to a stand between two years: which trees, by which rule, when, and the record."""

from forest.management.brushing import Brush
from forest.management.doing import act, check_due
from forest.management.hand import Hand
from forest.management.shaping import Marks, Obstacles
from forest.management.treatments import Treatments

__all__ = ["Brush", "Hand", "Marks", "Obstacles", "Treatments", "act", "check_due"]
