"""What one instant shows: sensor readings, detections, ranges, appearance and free space."""
