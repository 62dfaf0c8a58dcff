"""The last stage before the wheels: it checks the senses and limits every command."""
