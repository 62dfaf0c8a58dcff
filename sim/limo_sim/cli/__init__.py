"""The arena's commands of `limo-hog`, which `limo_hog.cli.main` lists."""
