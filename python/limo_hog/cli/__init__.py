"""The command line `limo-hog`: one module a command."""
