"""What several commands share: argument types, output, progress, result files."""
