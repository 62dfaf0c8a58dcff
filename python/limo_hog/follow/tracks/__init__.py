"""What persists from frame to frame: the state of each person, and which box belongs to which."""
