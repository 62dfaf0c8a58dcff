"""What is in the arena, as data: scenarios, people, furniture, the robot, and their motion over time."""
