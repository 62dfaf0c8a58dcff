"""The arena's commands of `limo-hog`, found through the entry-point group `limo_hog.commands`."""
