"""Controllers: from an observation and a state to a wanted command."""
