"""The ground around the robot: what stands where, where a lost person may be, and ways to drive there."""
