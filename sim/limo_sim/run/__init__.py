"""Running the arena: the closed loop, its log, its score, and many runs."""
