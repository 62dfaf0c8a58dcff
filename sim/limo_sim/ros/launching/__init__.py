"""Python launch files of the simple kind: nodes with parameters, remaps and launch arguments, in one run."""
