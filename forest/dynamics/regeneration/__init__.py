"""How a stand renews itself: seeds, cohorts of seedlings, recruits and sprouts."""
